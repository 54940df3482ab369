//! The command line: what all commands share here, each command's own options in a file of its name.

mod balance;
mod bench;
mod compare;
mod devices;
mod figure1;
mod parse;
mod render;
mod scene;
mod simulate;
mod trace;
mod tradeoff;
mod verify;

pub(crate) use balance::{BalanceArgs, EstimateArgs};
pub(crate) use bench::BenchArgs;
use clap::{Args, Parser, Subcommand};
pub(crate) use compare::{CompareArgs, DiffArgs};
pub(crate) use devices::{DeviceArgs, opener};
pub(crate) use figure1::Figure1Args;
pub(crate) use render::RenderArgs;
use rt_report::exit::Exit;
use rt_scene::scenes;
pub(crate) use scene::{PrecisionArg, SceneArgs};
pub(crate) use simulate::SimulateArgs;
use std::ffi::{OsStr, OsString};
use std::path::Path;
pub(crate) use trace::TraceArgs;
pub(crate) use tradeoff::{PrecisionTradeoffArgs, TradeArg, TradeArgs, TradeoffArgs};
pub(crate) use verify::VerifyArgs;

/// Groups of options, as `--help` shows them.
mod heading {
    pub(super) const SCENE: &str = "Scene";
    pub(super) const PICTURE: &str = "Camera and picture";
    pub(super) const RAYS: &str = "Rays";
    pub(super) const DEVICES: &str = "Devices";
    pub(super) const MACHINES: &str = "Several machines";
    pub(super) const SCHEDULING: &str = "Scheduling";
    pub(super) const EXPERIMENT: &str = "Experiment";
    pub(super) const OUTPUT: &str = "Output";
}

/// Trace a scene over several devices, balanced by estimated cost.
///
/// Without a command it renders: the file that is named, or the built-in garden, into out/, and prints how well the
/// work was balanced.
#[derive(Debug, Parser)]
#[command(name = "raybalance", version, about, long_about)]
#[command(after_help = format!("Examples:
  raybalance                                        render the built-in garden into out/
  raybalance room.obj                               render your own scene
  raybalance car --size 1280x800 --spp 8            the built-in car, larger
  raybalance render room.obj --devices cpu:1,cpu:1@0.5 --queue hybrid
  raybalance compare room.obj --devices cpu:1,vulkan:0
  raybalance render room.obj --queue central --estimator uniform --reference
  raybalance trace room.obj --rays rays.npy --hits hits.npy
  raybalance verify --devices cpu,vulkan:0

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
    /// Find out what to use for a scene and devices: queues, policies and estimators in turn, with a verdict
    Compare(Box<CompareArgs>),
    /// Set two runs side by side: report.json of two renders, or compare.json of two comparisons
    Diff(DiffArgs),
    /// Draw the paper's Figure 1: tracing time against task size, with and without cost initialisation
    #[command(name = "figure1")]
    Figure1(Figure1Args),
    /// Play machines that are not there from measured task times: every strategy's makespan, excess and launches
    Simulate(Box<SimulateArgs>),
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

/// Puts `render` before what it is meant for where no command is named: `raybalance room.obj`, `raybalance --spp 4`.
///
/// A word is a scene's if it is the name of a built-in one or of a file; what looks like neither is left for the parser
/// to name as a wrong command.
pub(crate) fn with_command(mut words: Vec<OsString>) -> Vec<OsString> {
    let is_file = |word: &OsStr| Path::new(word).extension().is_some() || Path::new(word).is_file();
    let is_scene = |word: &OsStr| word.to_str().and_then(scenes::find).is_some() || is_file(word);
    let is_option = |word: &OsStr| {
        let own = ["-h", "--help", "-V", "--version"];
        word.as_encoded_bytes().starts_with(b"-") && own.iter().all(|own| word != *own)
    };
    if words.get(1).is_some_and(|word| is_option(word) || is_scene(word)) {
        words.insert(1, "render".into());
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// Fails when `render` goes before a command, before help, or not before a scene.
    #[test]
    fn what_names_no_command_renders() {
        for (given, meant) in [
            ("", ""),
            ("room.obj --spp 4", "render room.obj --spp 4"),
            ("car", "render car"),
            ("--spp 4", "render --spp 4"),
            ("render car", "render car"),
            ("trace room.obj", "trace room.obj"),
            ("--help", "--help"),
            ("-V", "-V"),
            ("rendr car", "rendr car"),
            ("help", "help"),
        ] {
            let words = |line: &str| -> Vec<OsString> {
                ["raybalance"].into_iter().chain(line.split_whitespace()).map(Into::into).collect()
            };
            assert_eq!(with_command(words(given)), words(meant), "{given}");
        }
    }

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
        assert_eq!(RenderArgs::default().size, [960, 600]);
    }
}
