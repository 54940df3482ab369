//! Options of `raybalance bench`.

use super::parse::parse_devices;
use super::{DeviceArgs, SceneArgs, heading};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    /// yard, car, or files (OBJ, PLY, STL, glTF) (a cameras.tsv beside them is used) [default: yard car]
    pub(crate) scenes: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    /// Devices, one after the other, such as cpu:1,vulkan:0, or auto: all cores together and every graphics card
    #[arg(long, help_heading = heading::DEVICES, value_name = "LIST", value_parser = parse_devices)]
    pub(crate) devices: Option<String>,
    #[command(flatten)]
    pub(crate) device: DeviceArgs,
    /// Rays of a launch, of each kind [default: 4194304 on graphics cards, 262144 on processors]
    #[arg(long, help_heading = heading::EXPERIMENT, value_parser = clap::value_parser!(u32).range(64..=1 << 28),
          value_name = "N")]
    pub(crate) rays: Option<u32>,
    /// Repetitions that count; one more goes before
    #[arg(long, help_heading = heading::EXPERIMENT, default_value_t = 7,
          value_parser = clap::value_parser!(u32).range(1..=10_000), value_name = "N")]
    pub(crate) repeat: u32,
    /// Few rays, three repetitions: to see that it works
    #[arg(long, help_heading = heading::EXPERIMENT, conflicts_with_all = ["rays", "repeat"])]
    pub(crate) quick: bool,
    /// Seed of bounces and random rays
    #[arg(long, help_heading = heading::EXPERIMENT, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Print JSON, with every single measurement, instead of tables
    #[arg(long, help_heading = heading::OUTPUT)]
    pub(crate) json: bool,
    /// Write that JSON to a file as well
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}
