//! Streams that pass by some of a scene: trees without what their masks hide.
//!
//! The kernels know no masks, so that nobody pays for those. A mask belongs to a whole stream; so what it hides can be
//! left out of the tree instead, once for all rays, and these are traced as fast as any.

use crate::launches::{Launches, Layout};
use rt_core::{Scene, StreamSpec};
use std::sync::Arc;

/// Masks whose trees are kept, for streams that take turns: what the camera sees, what casts shadows, what bounces off.
const KEPT: usize = 4;

/// Triangles for each ray of a stream beyond which the tree does not pay. It took 0.2 µs for each triangle of the
/// scene on two busy cores, a ray that goes alone over the two-wide tree 0.4 to 0.7 µs longer (`rt-benches`, program
/// `masks`): 2 to 4 triangles a ray for one stream, and the tree is kept for the next.
const MOST_PER_RAY: usize = 8;

/// Launches of the masks that were used last, the latest first.
#[derive(Debug, Default)]
pub(crate) struct Masked(Vec<(u32, Launches)>);

impl Masked {
    /// Whether a stream of so many rays is traced over a tree without what its mask hides. It depends on the stream
    /// alone, so that all devices count tests of the same tree.
    pub(crate) fn pays(scene: &Scene, rays: u32) -> bool {
        scene.triangles().len() <= MOST_PER_RAY * rays as usize
    }

    /// Makes ready for a stream of so many rays; `all` are the launches without a mask.
    pub(crate) fn prepare(&mut self, layout: &Layout, scene: &Arc<Scene>, all: &Launches, spec: StreamSpec, rays: u32) {
        if !Launches::suit(spec, spec.counts) || !Self::pays(scene, rays) {
            return;
        }
        let known = self.0.iter().position(|&(mask, _)| mask == spec.mask);
        let latest = match known {
            Some(place) => Some(self.0.remove(place)),
            None => {
                // The memory of the oldest is free before there is another.
                self.0.truncate(KEPT - 1);
                layout.shown(scene, all, spec.mask).map(|launches| (spec.mask, launches))
            }
        };
        if let Some(latest) = latest {
            self.0.insert(0, latest);
        }
    }

    /// Those of a stream that was prepared, unless its rays go alone.
    pub(crate) fn of(&self, scene: &Scene, mask: u32, rays: u32) -> Option<&Launches> {
        let known = || self.0.iter().find(|&&(known, _)| known == mask).map(|(_, launches)| launches);
        if Self::pays(scene, rays) { known() } else { None }
    }
}
