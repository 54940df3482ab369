//! Options of `raybalance trace`.

use super::heading;
use super::{BalanceArgs, SceneArgs};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct TraceArgs {
    /// yard, car, or a file (OBJ, PLY, STL, glTF)
    pub(crate) scene: PathBuf,
    #[command(flatten)]
    pub(crate) source: SceneArgs,
    /// Rays: N×8 little-endian float32 or float64 NumPy array (ox oy oz tmin dx dy dz tmax) in the file's coordinates
    #[arg(long, help_heading = heading::RAYS, value_name = "FILE")]
    pub(crate) rays: PathBuf,
    /// Stop at any hit instead of the nearest
    #[arg(long, help_heading = heading::RAYS)]
    pub(crate) any: bool,
    #[command(flatten)]
    pub(crate) balance: BalanceArgs,
    /// Hits to write: N×4 float32 (t, u, v, bits of the primitive id; a miss has t = inf and id 0xffffffff)
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    pub(crate) hits: PathBuf,
    /// Counts to write: N×2 uint32 (box tests, triangle tests)
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    pub(crate) counts: Option<PathBuf>,
    /// Print the report as JSON instead of a table
    #[arg(long, help_heading = heading::OUTPUT)]
    pub(crate) json: bool,
}
