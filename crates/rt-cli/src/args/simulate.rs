//! Options of `raybalance simulate`.

use super::parse::{parse_seconds, parse_size, parse_speed};
use super::{SceneArgs, heading};
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Debug, Args)]
pub(crate) struct SimulateArgs {
    /// yard, car, or an OBJ file, whose task times are measured on one core
    #[arg(default_value = "yard", value_name = "SCENE")]
    pub(crate) scene: PathBuf,
    /// Take the task times from the report.json of a run with --reference, and play that run again as well
    #[arg(long, conflicts_with_all = ["scene", "task_size", "size"], value_name = "FILE")]
    pub(crate) from: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    /// Numbers of devices [default: 3,8,64; with --from none]
    #[arg(long, help_heading = heading::DEVICES, value_delimiter = ',', value_name = "M,...",
          value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) devices: Vec<u32>,
    /// Speeds of the devices, in turn; 1 is the device that was measured
    #[arg(long, help_heading = heading::DEVICES, value_delimiter = ',', default_value = "1", value_name = "SPEED,...",
          value_parser = parse_speed)]
    pub(crate) speeds: Vec<f64>,
    /// Numbers of nodes, each with all of these devices
    #[arg(long, help_heading = heading::DEVICES, value_delimiter = ',', default_value = "1", value_name = "N,...",
          value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) nodes: Vec<u32>,
    /// Seconds that a launch costs a device beside its tasks [default: as measured]
    #[arg(long, help_heading = heading::DEVICES, value_name = "SECONDS", value_parser = parse_seconds)]
    pub(crate) launch: Option<Duration>,
    /// Seconds until a device has the launch it claims, or with several nodes until a message arrives
    #[arg(long, help_heading = heading::DEVICES, value_name = "SECONDS", default_value = "0.00001",
          value_parser = parse_seconds)]
    pub(crate) claim: Duration,
    /// Rays per task [default: 1024, or 512 or 256 where devices would have less than 64 tasks]
    #[arg(long, help_heading = heading::EXPERIMENT, value_name = "RAYS", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) task_size: Option<u32>,
    /// Size of the picture in pixels, one ray each
    #[arg(long, help_heading = heading::EXPERIMENT, value_parser = parse_size, default_value = "1024x640", value_name = "WxH")]
    pub(crate) size: [u32; 2],
    /// Seed of samples, pixels and bounces
    #[arg(long, help_heading = heading::EXPERIMENT, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Folder for simulate.svg and simulate.json
    #[arg(long, help_heading = heading::OUTPUT, default_value = "out/simulate", value_name = "DIR")]
    pub(crate) out: PathBuf,
}
