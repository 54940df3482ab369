//! Options of `raybalance render`.

use super::heading;
use super::parse::{parse_bytes, parse_degrees, parse_fov, parse_point, parse_seconds, parse_size, parse_vec3};
use super::{BalanceArgs, SceneArgs};
use clap::Parser;
use glam::{DVec3, Vec3};
use rt_cluster::Shard;
use rt_report::frames::Frames;
use rt_report::recipe::Recipe;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Debug, Parser)]
pub(crate) struct RenderArgs {
    /// yard, car, or a file (OBJ, PLY, STL, glTF) [default: yard]
    pub(crate) scene: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    /// Size of the picture in pixels
    #[arg(long, help_heading = heading::PICTURE, value_parser = parse_size, default_value = "960x600",
          value_name = "WxH")]
    pub(crate) size: [u32; 2],
    /// Rays per pixel
    #[arg(long, help_heading = heading::PICTURE, default_value_t = 16,
          value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) spp: u32,
    /// Seconds from the start after which the picture is to be there, with as many of --spp as fit, at least one
    #[arg(long, help_heading = heading::PICTURE, value_parser = parse_seconds, value_name = "SECONDS",
          conflicts_with_all = ["frames", "reference", "checkpoint"])]
    pub(crate) time: Option<Duration>,
    /// Diffuse bounces
    #[arg(long, help_heading = heading::PICTURE, default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(0..=16))]
    pub(crate) bounces: u32,
    /// Frames of an animation: 24 for frames 0 to 23, 8..16 for frames 8 to 15. Those that are whole in --out already,
    /// by the same scene and options, are not rendered again
    #[arg(long, help_heading = heading::PICTURE, default_value = "1", value_name = "N|A..B")]
    pub(crate) frames: Frames,
    /// Degrees that frames 0 to the last together turn about the target; with 360 they can be played for ever
    /// [default: one for each frame]
    #[arg(long, help_heading = heading::PICTURE, value_parser = parse_degrees, allow_hyphen_values = true,
          value_name = "DEGREES", requires = "frames")]
    pub(crate) orbit: Option<f32>,
    /// Wind in the garden's trees, so that they move from frame to frame: a fresh breeze, or --wind=60 for a hurricane
    #[arg(long, help_heading = heading::PICTURE, requires = "frames", conflicts_with = "broadcast", num_args = 0..=1,
          require_equals = true, default_missing_value = "1", value_name = "STRENGTH")]
    pub(crate) wind: Option<rt_scene::wind::Strength>,
    /// Key frames that the camera moves along, one in a line: frame, eye, target, up and field of view, separated by
    /// tabs, and coordinates by blanks
    #[arg(long, help_heading = heading::PICTURE, value_name = "FILE", requires = "frames",
          conflicts_with_all = ["orbit", "eye", "target", "up", "fov"])]
    pub(crate) camera: Option<PathBuf>,
    /// Camera position in the coordinates of the file, such as 1,1.5,4
    #[arg(long, help_heading = heading::PICTURE, value_parser = parse_point, allow_hyphen_values = true,
          value_name = "X,Y,Z")]
    pub(crate) eye: Option<DVec3>,
    /// Point the camera looks at, likewise
    #[arg(long, help_heading = heading::PICTURE, value_parser = parse_point, allow_hyphen_values = true,
          value_name = "X,Y,Z")]
    pub(crate) target: Option<DVec3>,
    /// Which way is up
    #[arg(long, help_heading = heading::PICTURE, value_parser = parse_vec3, allow_hyphen_values = true,
          value_name = "X,Y,Z")]
    pub(crate) up: Option<Vec3>,
    /// Vertical field of view in degrees
    #[arg(long, help_heading = heading::PICTURE, value_parser = parse_fov, allow_hyphen_values = true,
          value_name = "DEGREES")]
    pub(crate) fov: Option<f32>,
    #[command(flatten)]
    pub(crate) balance: BalanceArgs,
    /// Memory for rays and hits in flight, such as 512M or 2G: larger pictures run in waves. Not counted are the scene,
    /// 12 bytes a pixel for the picture, and what is recorded of each task; what does not fit the machine is refused
    #[arg(long, help_heading = heading::DEVICES, value_parser = parse_bytes, default_value = "4G",
          value_name = "BYTES")]
    pub(crate) memory: u64,
    /// Measure every task by itself in separate passes, so that excess and estimation errors are known
    #[arg(long, help_heading = heading::EXPERIMENT)]
    pub(crate) reference: bool,
    /// Folder for image.png, cost.png, timeline.svg, trace.json, tasks.csv, report.json and report.html
    #[arg(long, help_heading = heading::OUTPUT, default_value = "out", value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Write radiance and costs as numbers too: image.exr and cost.exr (OpenEXR)
    #[arg(long, help_heading = heading::OUTPUT)]
    pub(crate) exr: bool,
    /// Folder that keeps what is finished, so that the same command goes on where it was stopped or killed, with any
    /// number of processes; only pictures and report.json are written then
    #[arg(long, help_heading = heading::MACHINES, value_name = "DIR")]
    pub(crate) checkpoint: Option<PathBuf>,
    /// Under mpirun, send the scene with its tree from the first process to the others, which then need not read and
    /// build it
    #[arg(long, help_heading = heading::MACHINES)]
    pub(crate) broadcast: bool,
    /// Which part of the frames is rendered: 1/8 to 8/8 for the first to the last of eight processes that share --out,
    /// or of eight mpirun; with --checkpoint each goes on within a frame
    #[arg(long, help_heading = heading::MACHINES, value_name = "I/N", requires = "frames",
          conflicts_with = "reference")]
    pub(crate) shard: Option<Shard>,
    /// Print a script that starts a process for each of --shards, and render nothing: slurm or hq (HyperQueue) for a
    /// task array, parallel for a command in each line
    #[arg(long, help_heading = heading::MACHINES, value_name = "ENGINE", requires_all = ["frames", "shards"],
          conflicts_with_all = ["shard", "reference"])]
    pub(crate) emit: Option<Recipe>,
    /// Into how many parts --emit deals the frames
    #[arg(long, help_heading = heading::MACHINES, value_name = "N", requires = "emit",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(Shard::MOST)))]
    pub(crate) shards: Option<u32>,
    /// Print the report as JSON instead of tables
    #[arg(long, help_heading = heading::OUTPUT)]
    pub(crate) json: bool,
}

impl Default for RenderArgs {
    fn default() -> Self {
        Self::parse_from(["render"])
    }
}
