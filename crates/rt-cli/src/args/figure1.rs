//! Options of `raybalance figure1`.

use super::parse::{parse_devices, parse_size};
use super::{EstimateArgs, SceneArgs, heading};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct Figure1Args {
    /// yard, car, or files (OBJ, PLY, STL, glTF)
    #[arg(default_values = ["yard", "car"], value_name = "SCENE")]
    pub(crate) scenes: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    #[command(flatten)]
    pub(crate) estimate: EstimateArgs,
    /// Devices to trace on, or with --replay the one to measure [default: cpu:1,cpu:1,cpu:1]
    #[arg(long, help_heading = heading::DEVICES, value_name = "LIST", value_parser = parse_devices)]
    pub(crate) devices: Option<String>,
    /// Play M equal virtual devices from task times measured on one real device [default: 3 with fewer than 3 cores]
    #[arg(long, help_heading = heading::EXPERIMENT, value_name = "M",
          value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) replay: Option<u32>,
    /// Task sizes in rays
    #[arg(long, help_heading = heading::EXPERIMENT, value_delimiter = ',', default_value = "64,256,1024,4096,16384",
          value_name = "RAYS", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) task_sizes: Vec<u32>,
    /// Size of the picture in pixels, one ray each [default: 1024x640; 320x200 with --quick]
    #[arg(long, help_heading = heading::EXPERIMENT, value_parser = parse_size, value_name = "WxH")]
    pub(crate) size: Option<[u32; 2]>,
    /// Interleaved repetitions, at least 6 for whiskers of 95% [default: 9; 3 with --quick]
    #[arg(long, help_heading = heading::EXPERIMENT, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: Option<u32>,
    /// Seed of samples, pixels and bounces
    #[arg(long, help_heading = heading::EXPERIMENT, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Small pictures and few repetitions: a look at the form, not a measurement
    #[arg(long, help_heading = heading::EXPERIMENT)]
    pub(crate) quick: bool,
    /// Folder for figure1.svg, .png, .csv, .json and report.html
    #[arg(long, help_heading = heading::OUTPUT, default_value = "out/figure1", value_name = "DIR")]
    pub(crate) out: PathBuf,
}
