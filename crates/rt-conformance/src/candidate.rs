//! A device under test, and what it claims.

use rt_core::{Device, DeviceInfo, Precision, Query, StreamSpec};

/// What a device may do beyond what every device must.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Capability {
    /// `t`, `u` and `v` are the very bits of [`rt_core::intersect::hit`]: devices may share a stream without a seam.
    DefinedBits,
    /// Launches count tests where a stream asks them to.
    Counts,
    /// [`rt_core::Walk::Full`]: estimates may sample rays in full.
    FullWalks,
    /// [`rt_core::ReducedWalk::LeafAsHit`] and [`rt_core::ReducedWalk::Unshortened`].
    ReducedWalks,
    /// Counts are those of the scene's own tree, so that samples of all devices are counted alike.
    CommonTree,
}

impl Capability {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::DefinedBits, Self::Counts, Self::FullWalks, Self::ReducedWalks, Self::CommonTree];
}

/// A device with its claims.
#[derive(Clone, Copy)]
pub(crate) struct Candidate<'a> {
    pub(crate) device: &'a dyn Device,
    pub(crate) claims: &'a [Capability],
}

impl Candidate<'_> {
    pub(crate) fn claims(&self, capability: Capability) -> bool {
        self.claims.contains(&capability)
    }

    pub(crate) fn info(&self) -> &DeviceInfo {
        self.device.info()
    }

    /// Nearest hits, exactly, with counts where the device counts.
    pub(crate) fn spec(&self) -> StreamSpec {
        StreamSpec::new(Query::Closest, Precision::Robust, self.claims(Capability::Counts))
    }
}
