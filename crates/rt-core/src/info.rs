//! What a device is and can do.

use crate::{CountedTree, Precision, Query, ReducedWalk, StreamSpec, Walk};
use alloc::string::String;

/// What a device is, for people and for the driver.
///
/// Made by [`DeviceInfo::new`], so that more can be told later without a change to those who tell less.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct DeviceInfo {
    /// The device's own name, such as a processor's or graphics card's.
    pub name: String,
    /// The backend that drives it: `"cpu"`, `"wgpu"`, `"vulkan"`.
    pub backend: &'static str,
    /// Hardware threads used, or compute units; 1 where unknown.
    pub units: u32,
    /// How many launches may be in flight, at least 1: with 2, the device never waits for the host between launches.
    pub in_flight: u32,
    /// Bytes of memory a scene may use, where known.
    pub memory: Option<u64>,
    /// What it can do.
    pub capabilities: Capabilities,
}

impl DeviceInfo {
    /// A device of one unit that takes one launch at a time, of which nothing else is known.
    #[must_use]
    pub fn new(name: impl Into<String>, backend: &'static str) -> Self {
        let capabilities = Capabilities::UNKNOWN;
        Self { name: name.into(), backend, units: 1, in_flight: 1, memory: None, capabilities }
    }

    /// The same with so many hardware threads or compute units.
    #[must_use]
    pub const fn with_units(mut self, units: u32) -> Self {
        self.units = units;
        self
    }

    /// The same with so many launches in flight.
    #[must_use]
    pub const fn with_in_flight(mut self, in_flight: u32) -> Self {
        self.in_flight = in_flight;
        self
    }

    /// The same with so many bytes of memory for scenes.
    #[must_use]
    pub const fn with_memory(mut self, memory: Option<u64>) -> Self {
        self.memory = memory;
        self
    }

    /// The same with these capabilities.
    #[must_use]
    pub const fn with_capabilities(mut self, capabilities: Capabilities) -> Self {
        self.capabilities = capabilities;
        self
    }
}

/// What a device can do. What it cannot, it is not asked for; a device that finds out later says
/// [`Unsupported`](crate::DeviceErrorKind::Unsupported).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capabilities {
    /// One bit for each of [`ReducedWalk::ALL`].
    reduced: u8,
    /// One bit for each of [`Precision::ALL`].
    precisions: u8,
    counts: Counted,
    defined_bits: bool,
    makes_rays: bool,
    all_hits: bool,
    masks: bool,
}

/// What a device counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Counted {
    /// Nothing: it has no walks, and streams that ask for counts go to others.
    Nothing,
    /// Tests of a tree of its own: they tell what its tasks cost, and can be compared with those of devices of the same
    /// backend alone.
    OwnTree,
    /// Tests of the scene's own tree ([`Scene::nodes`](crate::Scene::nodes)), as [`TestCounts`](crate::TestCounts)
    /// says: the same numbers on every such device.
    SceneTree,
    /// As [`Counted::OwnTree`], which is cheaper, or as [`Counted::SceneTree`], if a stream asks for that
    /// ([`CountedTree`]).
    EitherTree,
}

impl Capabilities {
    /// One hit of each ray may be asked for, whatever the precision, among all primitives. Counts and roundings are the
    /// device's own, and the host makes the rays.
    pub const UNKNOWN: Self = Self {
        reduced: 0b11,
        precisions: 0b111,
        counts: Counted::OwnTree,
        defined_bits: false,
        makes_rays: false,
        all_hits: false,
        masks: false,
    };

    /// The same with these reduced walks and no others.
    #[must_use]
    pub fn with_reduced_walks(mut self, walks: &[ReducedWalk]) -> Self {
        self.reduced = bits(&ReducedWalk::ALL, |walk| walks.contains(walk));
        self
    }

    /// The same with these precisions and no others.
    #[must_use]
    pub fn with_precisions(mut self, precisions: &[Precision]) -> Self {
        self.precisions = bits(&Precision::ALL, |precision| precisions.contains(precision));
        self
    }

    /// The same with other counts.
    #[must_use]
    pub const fn with_counts(mut self, counts: Counted) -> Self {
        self.counts = counts;
        self
    }

    /// The same for a device whose careful hits are [defined](Self::has_defined_bits) to the last bit.
    #[must_use]
    pub const fn with_defined_bits(mut self) -> Self {
        self.defined_bits = true;
        self
    }

    /// The same for a device that makes camera rays and bounces itself.
    #[must_use]
    pub const fn making_rays(mut self) -> Self {
        self.makes_rays = true;
        self
    }

    /// The same for a device that finds several hits of a ray ([`Query::All`]).
    #[must_use]
    pub const fn with_all_hits(mut self) -> Self {
        self.all_hits = true;
        self
    }

    /// The same for a device whose rays pass by what their mask hides ([`StreamSpec::mask`]).
    #[must_use]
    pub const fn with_masks(mut self) -> Self {
        self.masks = true;
        self
    }

    /// Whether it has such a walk.
    #[must_use]
    pub fn has_walk(&self, walk: Walk) -> bool {
        let reduced = |walk| bits(&ReducedWalk::ALL, |known| *known == walk) & self.reduced != 0;
        self.counts != Counted::Nothing
            && match walk {
                Walk::Full => true,
                Walk::Reduced(walk) => reduced(walk),
            }
    }

    /// Whether it traces so carefully.
    #[must_use]
    pub fn has_precision(&self, precision: Precision) -> bool {
        bits(&Precision::ALL, |known| *known == precision) & self.precisions != 0
    }

    /// Whether it can trace such a stream, unless the stream's mask hides primitives: that takes
    /// [`Capabilities::has_masks`].
    #[must_use]
    pub fn can_trace(&self, spec: StreamSpec) -> bool {
        let counts = match (self.counts, spec.counted) {
            (Counted::Nothing, _) => false,
            (Counted::OwnTree, counted) => counted == CountedTree::Own,
            (Counted::SceneTree | Counted::EitherTree, _) => true,
        };
        let hits = self.all_hits || !matches!(spec.query, Query::All { .. });
        self.has_precision(spec.precision) && (counts || !spec.counts) && hits
    }

    /// Whether it finds several hits of a ray ([`Query::All`]).
    #[must_use]
    pub const fn has_all_hits(&self) -> bool {
        self.all_hits
    }

    /// Whether its rays pass by what their mask hides ([`StreamSpec::mask`]).
    #[must_use]
    pub const fn has_masks(&self) -> bool {
        self.masks
    }

    /// Whether it can count tests of the scene's tree.
    #[must_use]
    pub const fn counts_scene_tree(&self) -> bool {
        matches!(self.counts, Counted::SceneTree | Counted::EitherTree)
    }

    /// What it counts.
    #[must_use]
    pub const fn counts(&self) -> Counted {
        self.counts
    }

    /// Whether `t`, `u` and `v` of its hits are the very bits of [`intersect::hit`](crate::intersect::hit), but for
    /// [`Precision::Fast`]: such devices share a stream without a seam.
    #[must_use]
    pub const fn has_defined_bits(&self) -> bool {
        self.defined_bits
    }

    /// Whether it makes the rays of cameras and bounces itself, where its arithmetic gives the host's bits; otherwise
    /// the host makes them.
    #[must_use]
    pub const fn makes_rays(&self) -> bool {
        self.makes_rays
    }
}

impl Default for Capabilities {
    fn default() -> Self {
        Self::UNKNOWN
    }
}

/// One bit for each of `all` that is chosen.
fn bits<T>(all: &[T], is_chosen: impl Fn(&T) -> bool) -> u8 {
    (0..).zip(all).filter(|(_, one)| is_chosen(one)).fold(0, |bits, (place, _): (u32, _)| bits | 1 << place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::num::NonZero;

    /// Mutants: a bit for the wrong walk or precision; walks of a device that counts nothing; several hits of one that
    /// finds one.
    #[test]
    fn a_device_can_do_what_it_says_and_no_more() {
        for (place, walk) in ReducedWalk::ALL.into_iter().enumerate() {
            let one = Capabilities::UNKNOWN.with_reduced_walks(&[walk]);
            for (other_place, other) in ReducedWalk::ALL.into_iter().enumerate() {
                assert_eq!(one.has_walk(Walk::Reduced(other)), place == other_place);
                assert!(Capabilities::UNKNOWN.has_walk(Walk::Reduced(other)));
            }
            assert!(one.has_walk(Walk::Full));
        }
        let nothing = Capabilities::UNKNOWN.with_counts(Counted::Nothing);
        assert!(!nothing.has_walk(Walk::Full) && !nothing.has_walk(Walk::Reduced(ReducedWalk::LeafAsHit)));
        let counted = StreamSpec { counts: true, ..StreamSpec::default() };
        assert!(nothing.can_trace(StreamSpec::default()) && !nothing.can_trace(counted));
        let scene = StreamSpec { counted: CountedTree::Scene, ..counted };
        for (counts, can) in [
            (Counted::Nothing, false),
            (Counted::OwnTree, false),
            (Counted::SceneTree, true),
            (Counted::EitherTree, true),
        ] {
            let device = Capabilities::UNKNOWN.with_counts(counts);
            assert_eq!((device.can_trace(scene), device.counts_scene_tree()), (can, can));
        }
        let all = StreamSpec { query: Query::All { most: NonZero::<u32>::MIN }, ..StreamSpec::default() };
        assert!(!Capabilities::UNKNOWN.can_trace(all) && Capabilities::UNKNOWN.with_all_hits().can_trace(all));
        for precision in Precision::ALL {
            let one = Capabilities::UNKNOWN.with_precisions(&[precision]);
            for other in Precision::ALL {
                assert_eq!(one.can_trace(StreamSpec { precision: other, ..counted }), other == precision);
            }
        }
    }
}
