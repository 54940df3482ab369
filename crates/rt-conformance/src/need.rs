//! What a case needs of a device beyond what every device must do.

use rt_core::{Capabilities, Counted, Device, Precision, Query, ReducedWalk, StreamSpec, Walk};
use std::fmt;

/// What a case needs a device to say of itself, in its [`Capabilities`]. Where the device says less, the case is not
/// tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Need {
    /// [`Capabilities::has_defined_bits`].
    DefinedBits,
    /// Launches that count tests where a stream asks them to, and [`Walk::Full`]: anything but [`Counted::Nothing`].
    Counts,
    /// [`Capabilities::counts_scene_tree`]: counts that can be compared with those of other devices.
    SceneTree,
    /// A precision beside [`Precision::Robust`], which every device must have.
    Precision(Precision),
    /// A reduced walk.
    ReducedWalk(ReducedWalk),
    /// [`Capabilities::has_all_hits`].
    AllHits,
    /// [`Capabilities::has_masks`].
    Masks,
}

impl Need {
    /// Whether a device of these capabilities has it.
    #[must_use]
    pub fn is_met_by(self, capabilities: &Capabilities) -> bool {
        match self {
            Self::DefinedBits => capabilities.has_defined_bits(),
            Self::Counts => capabilities.counts() != Counted::Nothing,
            Self::SceneTree => capabilities.counts_scene_tree(),
            Self::Precision(precision) => capabilities.has_precision(precision),
            Self::ReducedWalk(walk) => capabilities.has_walk(Walk::Reduced(walk)),
            Self::AllHits => capabilities.has_all_hits(),
            Self::Masks => capabilities.has_masks(),
        }
    }
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DefinedBits => write!(f, "hits that are defined to the last bit"),
            Self::Counts => write!(f, "counts of tests"),
            Self::SceneTree => write!(f, "counts of the scene's own tree"),
            Self::Precision(precision) => write!(f, "the precision {precision:?}"),
            Self::ReducedWalk(walk) => write!(f, "the walk {walk:?}"),
            Self::AllHits => write!(f, "several hits of a ray"),
            Self::Masks => write!(f, "masks of primitives"),
        }
    }
}

/// Whether `device` says that it has what is needed.
pub(crate) fn has(device: &dyn Device, need: Need) -> bool {
    need.is_met_by(&device.info().capabilities)
}

/// Those of `precisions` that `device` has.
pub(crate) fn had<const N: usize>(device: &dyn Device, precisions: [Precision; N]) -> impl Iterator<Item = Precision> {
    let capabilities = device.info().capabilities;
    precisions.into_iter().filter(move |precision| capabilities.has_precision(*precision))
}

/// Nearest hits, exactly, with counts where `device` counts.
pub(crate) fn counted(device: &dyn Device) -> StreamSpec {
    StreamSpec::new(Query::Closest, Precision::Robust, has(device, Need::Counts))
}
