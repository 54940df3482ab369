//! The command line: what all commands share here, each command's own options in a file of its name.

mod balance;
mod bench;
mod devices;
mod figure1;
mod parse;
mod render;
mod scene;
mod trace;
mod tradeoff;
mod verify;

pub(crate) use balance::{BalanceArgs, EstimateArgs};
pub(crate) use bench::BenchArgs;
use clap::{Args, Parser, Subcommand};
pub(crate) use devices::DeviceArgs;
pub(crate) use figure1::Figure1Args;
pub(crate) use render::RenderArgs;
use rt_report::exit::Exit;
pub(crate) use scene::{PrecisionArg, SceneArgs};
pub(crate) use trace::TraceArgs;
pub(crate) use tradeoff::{PrecisionTradeoffArgs, TradeArg, TradeArgs, TradeoffArgs};
pub(crate) use verify::VerifyArgs;

/// Trace a scene over several devices, balanced by estimated cost.
///
/// Without a command, renders the built-in garden into out/ and prints how well the work was balanced.
#[derive(Debug, Parser)]
#[command(name = "raybalance", version, about, long_about)]
#[command(after_help = format!("Examples:
  raybalance                                        render the built-in garden into out/
  raybalance render car --size 1280x800 --spp 8     the built-in car, better sampled
  raybalance render room.obj --devices cpu:1,cpu:1@0.5 --queue hybrid
  raybalance render room.obj --queue central --estimator uniform --reference
  raybalance trace room.obj --rays rays.npy --hits hits.npy
  raybalance verify --backend cpu,vulkan:0

{}.", Exit::HELP))]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a picture, with cost maps, a timeline and a report of how the work was balanced
    Render(Box<RenderArgs>),
    /// Trace rays from a NumPy file and write the hits to another
    Trace(Box<TraceArgs>),
    /// Draw the paper's Figure 1: tracing time against task size, with and without cost initialisation
    #[command(name = "figure1")]
    Figure1(Figure1Args),
    /// Measure what speed costs in accuracy: every trade within a time budget, or the one named
    Tradeoff(TradeoffArgs),
    /// Check the promises about hits (watertight, exact, deterministic) on this machine's devices
    Verify(VerifyArgs),
    /// Measure how fast each device traces, and what reduced traversal costs beside full
    Bench(Box<BenchArgs>),
    /// List the devices of this machine
    Devices(ListArgs),
    /// List the built-in scenes
    Scenes(ListArgs),
}

#[derive(Debug, Args)]
pub(crate) struct ListArgs {
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
        assert_eq!(RenderArgs::default().size, [960, 600]);
    }
}
