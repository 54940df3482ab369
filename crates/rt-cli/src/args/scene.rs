//! Where the scene comes from, how its tree is built and how its triangles are tested.

use super::heading;
use clap::{Args, ValueEnum};
use rt_bvh::Builder;
use rt_core::Precision;

/// Where the scene comes from and how its tree is built.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::SCENE)]
pub(crate) struct SceneArgs {
    /// Leave out faces that are malformed, or that use a vertex which is, instead of refusing the file
    #[arg(long)]
    pub(crate) drop_invalid: bool,
    /// Put a floor under the scene, on which it casts a soft shadow
    #[arg(long)]
    pub(crate) floor: bool,
    /// Tree builder: sah, or ploc-fastest, -very-fast, -fast, -medium, -slow, -very-slow
    #[arg(long, default_value_t, value_name = "NAME")]
    pub(crate) builder: Builder,
    /// Triangle tests: robust (exact, watertight), fast (leaks on edges), f64; default: what the scene requires
    #[arg(long, value_enum)]
    pub(crate) precision: Option<PrecisionArg>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PrecisionArg {
    /// Exact: single precision decides, double and exact arithmetic where it cannot
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
