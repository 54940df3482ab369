//! Options of `raybalance tradeoff` and of each trade.

use super::SceneArgs;
use super::heading;
use super::parse::{parse_own_devices, parse_size};
use clap::{Args, Subcommand};
use rt_bvh::Builder;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct TradeoffArgs {
    #[command(subcommand)]
    pub(crate) trade: Option<TradeArg>,
    #[command(flatten)]
    pub(crate) common: TradeArgs,
}

#[derive(Debug, Subcommand)]
pub(crate) enum TradeArg {
    /// How many rays to sample by which estimator: overhead, error, and the makespan that follows
    Sampling(TradeArgs),
    /// Fast against robust against double precision: speed, wrong answers, errors of distances
    Precision(PrecisionTradeoffArgs),
    /// How long to build the tree: build time against rays per second
    Build(TradeArgs),
    /// Which layout of the tree: memory and time to make it against rays per second, on graphics cards
    Layout(TradeArgs),
}

#[derive(Clone, Debug, Args)]
pub(crate) struct TradeArgs {
    /// yard, car, or files (OBJ, PLY, STL, glTF)
    #[arg(default_values = ["yard", "car"], value_name = "SCENE")]
    pub(crate) scenes: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    /// The device to measure, such as cpu:1 or vulkan:0; for layout a list [default: cpu:1; for layout every graphics
    /// card]
    #[arg(long, help_heading = heading::DEVICES, value_name = "LIST", value_parser = parse_own_devices)]
    pub(crate) devices: Option<String>,
    /// Size of the picture in pixels, one ray each [default: 1024x640, 320x200 with --quick, smaller where a budget
    /// demands it]
    #[arg(long, help_heading = heading::EXPERIMENT, value_parser = parse_size, value_name = "WxH")]
    pub(crate) size: Option<[u32; 2]>,
    /// Interleaved repetitions, at least 6 for intervals of 95% [default: 9; 2 with --quick]
    #[arg(long, help_heading = heading::EXPERIMENT, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: Option<u32>,
    /// Seconds that it may take: a repetition that would end later is not begun, but one is always measured [default of
    /// all trades together: 600; 150 with --quick]
    #[arg(long, help_heading = heading::EXPERIMENT, value_name = "SECONDS")]
    pub(crate) budget: Option<u32>,
    /// Seed of samples, pixels and bounces
    #[arg(long, help_heading = heading::EXPERIMENT, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Small pictures, few settings and repetitions: a look at the form, not a measurement
    #[arg(long, help_heading = heading::EXPERIMENT)]
    pub(crate) quick: bool,
    /// Folder for tables, charts, raw numbers and report.html
    #[arg(long, help_heading = heading::OUTPUT, default_value = "out/tradeoff", value_name = "DIR")]
    pub(crate) out: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct PrecisionTradeoffArgs {
    /// yard, car, or files (OBJ, PLY, STL, glTF) [default: yard car]
    pub(crate) scenes: Vec<PathBuf>,
    /// Devices to measure, one after the other, such as cpu:2,vulkan:0; as the list that render takes
    #[arg(long, help_heading = heading::DEVICES, value_name = "LIST", default_value = "cpu",
          value_parser = parse_own_devices)]
    pub(crate) devices: String,
    /// Fewer rays and repetitions: a look, not a measurement
    #[arg(long, help_heading = heading::EXPERIMENT)]
    pub(crate) quick: bool,
    /// Repetitions of each precision, all in turn [default: 30; 6 with --quick]
    #[arg(long, help_heading = heading::EXPERIMENT, value_parser = clap::value_parser!(u32).range(1..=10_000),
          value_name = "N")]
    pub(crate) repeat: Option<u32>,
    /// Size of the picture whose rays are traced, in pixels [default: 960x600; 320x200 with --quick]
    #[arg(long, help_heading = heading::EXPERIMENT, value_parser = parse_size, value_name = "WxH")]
    pub(crate) size: Option<[u32; 2]>,
    /// Rays of each stream that the exact reference judges [default: 2000; 200 with --quick]
    #[arg(long, help_heading = heading::EXPERIMENT, value_name = "N")]
    pub(crate) sample: Option<u32>,
    /// Tree builder: sah, or ploc-fastest, -very-fast, -fast, -medium, -slow, -very-slow
    #[arg(long, help_heading = heading::SCENE, default_value_t, value_name = "NAME")]
    pub(crate) builder: Builder,
    /// Seed of the rays
    #[arg(long, help_heading = heading::EXPERIMENT, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Folder for precision.json, precision.csv, precision.md, precision.svg and report.html
    #[arg(long, help_heading = heading::OUTPUT, default_value = "out/tradeoff", value_name = "DIR")]
    pub(crate) out: PathBuf,
}
