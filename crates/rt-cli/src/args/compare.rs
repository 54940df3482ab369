//! Options of `raybalance compare` and `raybalance diff`.

use super::heading;
use super::parse::{named, parse_devices, parse_fraction, parse_size};
use super::{DeviceArgs, SceneArgs};
use clap::Args;
use rt_balance::QueueKind;
use rt_balance::catalogue::{Entry, Make, MakePolicy, POLICIES, QUEUES};
use rt_lab::estimators;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    /// yard, car, or a file (OBJ, PLY, STL, glTF)
    pub(crate) scene: PathBuf,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    /// Size of the picture in pixels [default: 960x600; 320x200 with --quick]
    #[arg(long, help_heading = heading::PICTURE, value_parser = parse_size, value_name = "WxH")]
    pub(crate) size: Option<[u32; 2]>,
    /// Rays per pixel [default: 4; 1 with --quick]
    #[arg(long, help_heading = heading::PICTURE, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) spp: Option<u32>,
    /// Diffuse bounces
    #[arg(long, help_heading = heading::PICTURE, default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(0..=16))]
    pub(crate) bounces: u32,
    /// Devices, such as cpu:1,cpu:1@0.5,vulkan:0 (threads, speed, number) or auto: one per core and every graphics card
    #[arg(long, help_heading = heading::DEVICES, value_name = "LIST", value_parser = parse_devices)]
    pub(crate) devices: Option<String>,
    #[command(flatten)]
    pub(crate) device: DeviceArgs,
    /// Queues to combine with --policy and --estimator, beside the default [without the three: the useful ways and
    /// their rivals]
    #[arg(long, help_heading = heading::SCHEDULING, value_parser = named(QUEUES), value_delimiter = ',',
          value_name = "NAMES")]
    pub(crate) queue: Vec<&'static Entry<QueueKind>>,
    /// Policies to combine
    #[arg(long, help_heading = heading::SCHEDULING, value_parser = named(POLICIES), value_delimiter = ',',
          value_name = "NAMES")]
    pub(crate) policy: Vec<&'static Entry<MakePolicy>>,
    /// Estimators to combine; those that learn are measured for a first picture and for later frames
    #[arg(long, help_heading = heading::SCHEDULING, value_parser = named(estimators::all()), value_delimiter = ',',
          value_name = "NAMES")]
    pub(crate) estimator: Vec<&'static Entry<Make>>,
    /// Share of the rays that estimators sample, such as 1/64 [default: each one's own]
    #[arg(long, help_heading = heading::SCHEDULING, value_parser = parse_fraction, value_name = "F")]
    pub(crate) fraction: Option<f64>,
    /// Number of tasks per stream; the hybrid queue cuts those that are too large for devices to end together
    #[arg(long, help_heading = heading::SCHEDULING, conflicts_with = "task_size", value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) tasks: Option<u32>,
    /// Rays per task [default: 1024, or 512 or 256 where devices would have less than 64 tasks]
    #[arg(long, help_heading = heading::SCHEDULING, value_name = "RAYS",
          value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) task_size: Option<u32>,
    /// Rounds that count, in each of which everything is measured once; at least 6 for intervals of 95% [default: 7; 3
    /// with --quick]
    #[arg(long, help_heading = heading::EXPERIMENT, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: Option<u32>,
    /// Seconds that it may take: a round that would end later is not begun, but one is always measured
    #[arg(long, help_heading = heading::EXPERIMENT, value_name = "SECONDS")]
    pub(crate) budget: Option<u32>,
    /// Measure every task by itself in each round, so that the excess over the best possible schedule is known
    #[arg(long, help_heading = heading::EXPERIMENT)]
    pub(crate) reference: bool,
    /// Seed of samples, pixels and bounces; each round has the next one
    #[arg(long, help_heading = heading::EXPERIMENT, default_value_t = 1)]
    pub(crate) seed: u32,
    /// A small picture and few rounds: a look at the form, not a measurement
    #[arg(long, help_heading = heading::EXPERIMENT)]
    pub(crate) quick: bool,
    /// Folder for compare.json, .csv, .md, .svg and report.html
    #[arg(long, help_heading = heading::OUTPUT, default_value = "out/compare", value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Print JSON instead of tables
    #[arg(long, help_heading = heading::OUTPUT)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct DiffArgs {
    /// report.json of `render`, or compare.json of `compare`
    pub(crate) before: PathBuf,
    /// The same of another run, on this machine or another
    pub(crate) after: PathBuf,
    /// Print JSON instead of tables
    #[arg(long, help_heading = heading::OUTPUT)]
    pub(crate) json: bool,
}
