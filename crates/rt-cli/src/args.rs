//! The command line.

mod cards;
mod parse;

pub(crate) use cards::CardArgs;
use clap::{Args, Parser, Subcommand, ValueEnum};
use glam::Vec3;
use parse::{parse_bytes, parse_fraction, parse_share, parse_size, parse_vec3};
use rt_bvh::Builder;
use rt_core::Precision;
use std::path::PathBuf;

/// Trace a scene over several devices, balanced by estimated cost.
///
/// Without a command, renders the built-in garden into out/ and prints how well the work was balanced.
#[derive(Debug, Parser)]
#[command(name = "raybalance", version, about, long_about)]
#[command(after_help = "Examples:
  raybalance                                        render the built-in garden into out/
  raybalance render car --size 1280x800 --spp 8     the built-in car, better sampled
  raybalance render room.obj --devices cpu:1,cpu:1@0.5 --queue hybrid
  raybalance render room.obj --queue central --estimator uniform --reference
  raybalance trace room.obj --rays rays.npy --hits hits.npy
  raybalance verify --backend cpu,vulkan:0

Exit codes: 0 success, 1 failure, 2 wrong usage, 130 interrupted.")]
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

/// Where the scene comes from and how its tree is built.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneArgs {
    /// Leave out triangles with NaN or infinite vertices instead of refusing the file
    #[arg(long)]
    pub(crate) drop_invalid: bool,
    /// Tree builder: sah, or ploc-fastest, -very-fast, -fast, -medium, -slow, -very-slow
    #[arg(long, default_value = DEFAULT_BUILDER, value_name = "NAME")]
    pub(crate) builder: Builder,
    /// Triangle tests: robust (watertight), fast (leaks on edges), f64; default: what the scene requires
    #[arg(long, value_enum)]
    pub(crate) precision: Option<PrecisionArg>,
}

/// Builds scenes of 300,000 triangles in a quarter of a second, and traces rooms faster than `sah`, whose trees are
/// a little better outdoors (`cargo run --release -p rt-benches --bin traversal -- SCENE --builder NAME`).
pub(crate) const DEFAULT_BUILDER: &str = "ploc-medium";

/// How the cost of a task is estimated.
#[derive(Clone, Debug, Args)]
pub(crate) struct EstimateArgs {
    /// How the cost of a task is estimated
    #[arg(long, value_enum, default_value_t = EstimatorArg::Auto)]
    pub(crate) estimator: EstimatorArg,
    /// Share of the rays that is sampled for the estimate, from 1/4096 to 1 (such as 1/64 or 0.0156); default 1/64;
    /// the estimator auto follows its budget instead, and adaptive begins with 1/256
    #[arg(long, value_parser = parse_fraction, value_name = "F")]
    pub(crate) fraction: Option<f64>,
    /// Share of the trace that the estimator auto may spend on sampling (such as 0.005)
    #[arg(long, value_parser = parse_share, default_value = "0.005", value_name = "F")]
    pub(crate) budget: f64,
    /// What a reduced walk does at a leaf
    #[arg(long, value_enum, default_value_t = ReducedArg::Leaf)]
    pub(crate) reduced: ReducedArg,
}

/// How work is cut, estimated and dealt.
#[derive(Clone, Debug, Args)]
pub(crate) struct BalanceArgs {
    /// Devices, such as cpu:1,cpu:1@0.5,vulkan:0 (threads, speed, number) or auto: one per core and every graphics card
    #[arg(long, value_name = "LIST")]
    pub(crate) devices: Option<String>,
    #[command(flatten)]
    pub(crate) cards: CardArgs,
    #[command(flatten)]
    pub(crate) estimate: EstimateArgs,
    /// How tasks are dealt to devices (static queue; the hybrid queue takes lpt only, the central queue none)
    #[arg(long, value_enum)]
    pub(crate) policy: Option<PolicyArg>,
    /// How devices get their tasks
    #[arg(long, value_enum, default_value_t = QueueArg::Hybrid)]
    pub(crate) queue: QueueArg,
    /// Number of tasks per stream
    #[arg(long, conflicts_with = "task_size", value_parser = clap::value_parser!(u32).range(1..), value_name = "N")]
    pub(crate) tasks: Option<u32>,
    /// Rays per task [default: 1024]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), value_name = "RAYS")]
    pub(crate) task_size: Option<u32>,
    /// Seed of samples, pixels and bounces
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u32,
}

#[derive(Debug, Args)]
pub(crate) struct Figure1Args {
    /// yard, car, or OBJ files
    #[arg(default_values = ["yard", "car"], value_name = "SCENE")]
    pub(crate) scenes: Vec<String>,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    #[command(flatten)]
    pub(crate) estimate: EstimateArgs,
    /// Devices to trace on, or with --replay the one to measure [default: cpu:1,cpu:1,cpu:1]
    #[arg(long, value_name = "LIST")]
    pub(crate) devices: Option<String>,
    /// Play M equal virtual devices from task times measured on one real device [default: 3 with fewer than 3 cores]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) replay: Option<u32>,
    /// Task sizes in rays
    #[arg(long, value_delimiter = ',', default_value = "64,256,1024,4096,16384", value_name = "RAYS",
          value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) task_sizes: Vec<u32>,
    /// Size of the picture in pixels, one ray each [default: 1024x640; 320x200 with --quick]
    #[arg(long, value_parser = parse_size, value_name = "WxH")]
    pub(crate) size: Option<[u32; 2]>,
    /// Interleaved repetitions, at least 6 for whiskers of 95% [default: 9; 3 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: Option<u32>,
    /// Seed of samples, pixels and bounces
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Small pictures and few repetitions: a look at the form, not a measurement
    #[arg(long)]
    pub(crate) quick: bool,
    /// Folder for figure1.svg, .png, .csv, .json and report.html
    #[arg(long, default_value = "out/figure1", value_name = "DIR")]
    pub(crate) out: PathBuf,
}

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
}

#[derive(Clone, Debug, Args)]
pub(crate) struct TradeArgs {
    /// yard, car, or OBJ files
    #[arg(default_values = ["yard", "car"], value_name = "SCENE")]
    pub(crate) scenes: Vec<String>,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    /// The device to measure, such as cpu:1 or vulkan:0
    #[arg(long, default_value = "cpu:1", value_name = "DEVICE")]
    pub(crate) device: String,
    /// Size of the picture in pixels, one ray each [default: 1024x640; 320x200 with --quick]
    #[arg(long, value_parser = parse_size, value_name = "WxH")]
    pub(crate) size: Option<[u32; 2]>,
    /// Interleaved repetitions, at least 6 for intervals of 95% [default: 9; 2 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: Option<u32>,
    /// Seconds after which no further repetition is begun; one is always measured [default without a trade: 600]
    #[arg(long, value_name = "SECONDS")]
    pub(crate) budget: Option<u32>,
    /// Seed of samples, pixels and bounces
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Small pictures, few settings and repetitions: a look at the form, not a measurement
    #[arg(long)]
    pub(crate) quick: bool,
    /// Folder for tables, charts, raw numbers and report.html
    #[arg(long, default_value = "out/tradeoff", value_name = "DIR")]
    pub(crate) out: PathBuf,
}

#[derive(Debug, Parser)]
pub(crate) struct RenderArgs {
    /// yard, car, or an OBJ file [default: yard]
    pub(crate) scene: Option<String>,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    #[command(flatten)]
    pub(crate) balance: BalanceArgs,
    /// Size of the picture in pixels
    #[arg(long, value_parser = parse_size, default_value = "960x600", value_name = "WxH")]
    pub(crate) size: [u32; 2],
    /// Rays per pixel
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) spp: u32,
    /// Diffuse bounces
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(0..=16))]
    pub(crate) bounces: u32,
    /// Frames of a slow orbit about the target
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) frames: u32,
    /// Camera position, such as 1,1.5,4
    #[arg(long, value_parser = parse_vec3, allow_hyphen_values = true, value_name = "X,Y,Z")]
    pub(crate) eye: Option<Vec3>,
    /// Point the camera looks at
    #[arg(long, value_parser = parse_vec3, allow_hyphen_values = true, value_name = "X,Y,Z")]
    pub(crate) target: Option<Vec3>,
    /// Which way is up
    #[arg(long, value_parser = parse_vec3, allow_hyphen_values = true, value_name = "X,Y,Z")]
    pub(crate) up: Option<Vec3>,
    /// Vertical field of view in degrees
    #[arg(long, value_name = "DEGREES")]
    pub(crate) fov: Option<f32>,
    /// Memory for rays and hits in flight, such as 512M or 2G; larger streams run in waves
    #[arg(long, value_parser = parse_bytes, default_value = "4G", value_name = "BYTES")]
    pub(crate) memory: u64,
    /// Measure every task by itself in separate passes, so that excess and estimation errors are known
    #[arg(long)]
    pub(crate) reference: bool,
    /// Folder for image.png, cost.png, timeline.svg, trace.json, report.json and report.html
    #[arg(long, default_value = "out", value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Print the report as JSON instead of tables
    #[arg(long)]
    pub(crate) json: bool,
}

impl Default for RenderArgs {
    fn default() -> Self {
        Self::parse_from(["render"])
    }
}

#[derive(Debug, Args)]
pub(crate) struct TraceArgs {
    /// yard, car, or an OBJ file
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    #[command(flatten)]
    pub(crate) balance: BalanceArgs,
    /// Rays: N×8 little-endian float32 NumPy array (ox oy oz tmin dx dy dz tmax)
    #[arg(long, value_name = "FILE")]
    pub(crate) rays: PathBuf,
    /// Hits to write: N×4 float32 (t, u, v, bits of the primitive id; a miss has t = inf and id 0xffffffff)
    #[arg(long, value_name = "FILE")]
    pub(crate) hits: PathBuf,
    /// Counts to write: N×2 uint32 (box tests, triangle tests)
    #[arg(long, value_name = "FILE")]
    pub(crate) counts: Option<PathBuf>,
    /// Stop at any hit instead of the nearest
    #[arg(long)]
    pub(crate) any: bool,
    /// Print the report as JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    /// yard, car, or OBJ files (a cameras.tsv beside them is used) [default: yard car]
    pub(crate) scenes: Vec<String>,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    /// Devices, one after the other, such as cpu:1,vulkan:0, or auto: all cores together and every graphics card
    #[arg(long, value_name = "LIST")]
    pub(crate) devices: Option<String>,
    #[command(flatten)]
    pub(crate) cards: CardArgs,
    /// Rays of a launch, of each kind [default: 4194304 on graphics cards, 262144 on processors]
    #[arg(long, value_parser = clap::value_parser!(u32).range(64..=1 << 28), value_name = "N")]
    pub(crate) rays: Option<u32>,
    /// Repetitions that count; one more goes before
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..=10_000), value_name = "N")]
    pub(crate) repeat: u32,
    /// Few rays, three repetitions: to see that it works
    #[arg(long, conflicts_with_all = ["rays", "repeat"])]
    pub(crate) quick: bool,
    /// Seed of bounces and random rays
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Print JSON, with every single measurement, instead of tables
    #[arg(long)]
    pub(crate) json: bool,
    /// Write that JSON to a file as well
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "Exit codes: 0 every promise held, 1 some did not, 2 wrong usage, 130 interrupted.")]
pub(crate) struct VerifyArgs {
    /// Scenes beside the suite's own meshes: yard, car, or OBJ files [default: yard car]
    pub(crate) scenes: Vec<String>,
    /// Devices to verify, one after the other, such as cpu:2,vulkan:0; as the list that render takes
    #[arg(long, value_name = "LIST", default_value = "cpu")]
    pub(crate) backend: String,
    /// Try these cases only, named as the report names them, such as watertight [default: all]
    #[arg(long = "case", value_name = "NAME", value_delimiter = ',',
          value_parser = clap::builder::PossibleValuesParser::new(rt_verify::Suite::case_names()))]
    pub(crate) cases: Vec<String>,
    /// Triangle tests that are to keep the promises; fast is known not to
    #[arg(long, value_enum, default_value_t = PrecisionArg::Robust)]
    pub(crate) precision: PrecisionArg,
    /// Under a minute on two cores; the default
    #[arg(long)]
    pub(crate) quick: bool,
    /// 10^8 rays at closed surfaces, 10^7 spawned rays, 2^24 triangles
    #[arg(long, conflicts_with = "quick")]
    pub(crate) full: bool,
    /// Rays of each line about closed surfaces, with which the other lines scale [default: 210,000; 6,720,000 with --full]
    #[arg(long, value_parser = clap::value_parser!(u32).range(100..=100_000_000), value_name = "N")]
    pub(crate) rays: Option<u32>,
    /// Tree builder: sah, or ploc-fastest, -very-fast, -fast, -medium, -slow, -very-slow
    #[arg(long, default_value = DEFAULT_BUILDER, value_name = "NAME")]
    pub(crate) builder: Builder,
    /// Seed of rays and meshes
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct PrecisionTradeoffArgs {
    /// yard, car, or OBJ files [default: yard car]
    pub(crate) scenes: Vec<String>,
    /// Devices to measure, one after the other, such as cpu:2,vulkan:0; as the list that render takes
    #[arg(long, value_name = "LIST", default_value = "cpu")]
    pub(crate) backend: String,
    /// Fewer rays and runs: a look, not a measurement
    #[arg(long)]
    pub(crate) quick: bool,
    /// Runs of each precision, all in turn [default: 30; 6 with --quick]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000), value_name = "N")]
    pub(crate) runs: Option<u32>,
    /// Size of the picture whose rays are traced, in pixels [default: 960x600; 320x200 with --quick]
    #[arg(long, value_parser = parse_size, value_name = "WxH")]
    pub(crate) size: Option<[u32; 2]>,
    /// Rays of each stream that the exact reference judges [default: 2000; 200 with --quick]
    #[arg(long, value_name = "N")]
    pub(crate) sample: Option<u32>,
    /// Tree builder: sah, or ploc-fastest, -very-fast, -fast, -medium, -slow, -very-slow
    #[arg(long, default_value = DEFAULT_BUILDER, value_name = "NAME")]
    pub(crate) builder: Builder,
    /// Seed of the rays
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Folder for precision.json, precision.csv, precision.md, precision.svg and report.html
    #[arg(long, default_value = "out/tradeoff", value_name = "DIR")]
    pub(crate) out: PathBuf,
}

impl PrecisionTradeoffArgs {
    /// What suits the options of all trades together.
    pub(crate) fn of(all: &TradeArgs) -> Self {
        Self {
            scenes: all.scenes.clone(),
            backend: all.device.clone(),
            quick: all.quick,
            runs: all.repeat,
            size: all.size,
            sample: None,
            builder: all.source.builder,
            seed: all.seed,
            out: all.out.clone(),
        }
    }

    /// Size of the picture, number of runs and of sampled rays.
    pub(crate) fn effort(&self) -> ([u32; 2], u32, u32) {
        let (size, runs, sample) = if self.quick { ([320, 200], 6, 200) } else { ([960, 600], 30, 2_000) };
        (self.size.unwrap_or(size), self.runs.unwrap_or(runs), self.sample.unwrap_or(sample))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PrecisionArg {
    /// Watertight: single precision, doubtful cases decided in double
    Robust,
    /// Plain single precision; may leak between triangles
    Fast,
    /// Double precision throughout
    F64,
}

impl From<PrecisionArg> for Precision {
    fn from(arg: PrecisionArg) -> Self {
        match arg {
            PrecisionArg::Robust => Self::Robust,
            PrecisionArg::Fast => Self::Fast,
            PrecisionArg::F64 => Self::Double,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum EstimatorArg {
    /// Whichever of exact, field and history predicted such streams best, within --budget
    Auto,
    /// All rays cost the same
    Uniform,
    /// Box and triangle tests of sampled rays, without triangles
    Reduced,
    /// Full traversal of sampled rays, whose hits are kept
    Exact,
    /// As exact, with as many samples as they are worth, where they are worth most
    Adaptive,
    /// As exact, with a map of where in the scene rays are dear
    Field,
    /// Measured times of the previous pass or frame
    History,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ReducedArg {
    /// A leaf entered counts as the hit
    Leaf,
    /// The ray is never shortened
    Unshortened,
    /// The ray is cut by a plane for each leaf, as often as its triangles cover it (CPU devices)
    Plane,
    /// Only the top of the tree is walked, over calibrated stubs (CPU devices)
    Truncated,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PolicyArg {
    /// Contiguous blocks of tasks
    Block,
    /// Tasks in turn
    RoundRobin,
    /// Dearest remaining task to the device that would finish it first
    Lpt,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum QueueArg {
    /// One launch per device with its whole share
    Static,
    /// One task per launch, dearest first
    Central,
    /// Static shares in geometric launches, with stealing
    Hybrid,
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
