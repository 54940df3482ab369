//! Options of `raybalance verify`.

use super::PrecisionArg;
use super::parse::parse_devices;
use clap::Args;
use rt_bvh::Builder;
use rt_report::exit::Exit;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = format!("{}; here 1 is also that some promise did not hold.", Exit::HELP))]
pub(crate) struct VerifyArgs {
    /// Scenes beside the suite's own meshes: yard, car, or files (OBJ, PLY, STL, glTF) [default: yard car]
    pub(crate) scenes: Vec<PathBuf>,
    /// Devices to verify, one after the other, such as cpu:2,vulkan:0; as the list that render takes
    #[arg(long, value_name = "LIST", default_value = "cpu", value_parser = parse_devices)]
    pub(crate) devices: String,
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
    /// Rays of each line about closed surfaces, with which the other lines scale [default: 210,000; 6,720,000 with
    /// --full]
    #[arg(long, value_parser = clap::value_parser!(u32).range(100..=100_000_000), value_name = "N")]
    pub(crate) rays: Option<u32>,
    /// Tree builder: sah, or ploc-fastest, -very-fast, -fast, -medium, -slow, -very-slow
    #[arg(long, default_value_t, value_name = "NAME")]
    pub(crate) builder: Builder,
    /// Seed of rays and meshes
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u32,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}
