//! Launches in the SIMD words of the processor: rays that nobody counts.

use crate::tracer::coherence;
use rt_bvh::BlockTree;
use rt_core::{Hit, Precision, Ray, RayMask, RaySource, Scene, StreamSpec};
use rt_simd::{Kernel, Scratch};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Rays that are made or gathered before they are traced: as many as the kernels sort at once.
pub(crate) const WINDOW: usize = 1024;

/// Trees that devices opened together have in common, so that a scene's is made and held once.
#[derive(Debug, Default)]
pub(crate) struct Trees(Mutex<Vec<(Weak<Scene>, Weak<BlockTree>)>>);

impl Trees {
    /// The scene's tree; `None` where it has too many triangles for one.
    pub(crate) fn of(&self, scene: &Arc<Scene>) -> Option<Arc<BlockTree>> {
        // A panic of whoever had it leaves the list whole.
        let mut trees = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        trees.retain(|(scene, tree)| scene.strong_count() > 0 && tree.strong_count() > 0);
        let known = trees.iter().find(|(known, _)| known.upgrade().is_some_and(|known| Arc::ptr_eq(&known, scene)));
        if let Some(tree) = known.and_then(|(_, tree)| tree.upgrade()) {
            return Some(tree);
        }
        let tree = Arc::new(BlockTree::new(scene)?);
        trees.push((Arc::downgrade(scene), Arc::downgrade(&tree)));
        Some(tree)
    }
}

/// A scene in the layout of the kernels, and room for the threads that trace it.
#[derive(Debug)]
pub(crate) struct Launches {
    kernel: Kernel,
    tree: Arc<BlockTree>,
    idle: Mutex<Vec<Room>>,
}

/// What a thread traces with.
#[derive(Debug, Default)]
struct Room {
    scratch: Scratch,
    rays: Vec<Ray>,
    excluded: Vec<u32>,
    hits: Vec<Hit>,
}

impl Launches {
    pub(crate) const fn new(kernel: Kernel, tree: Arc<BlockTree>) -> Self {
        Self { kernel, tree, idle: Mutex::new(Vec::new()) }
    }

    /// Whether a stream's launches are for these kernels. `robust` and `f64` are the same hits. Counts depend on a
    /// ray's company here, so that launches and samples could not be compared; and nothing here is `fast`'s.
    pub(crate) const fn suit(spec: StreamSpec) -> bool {
        !spec.counts && !matches!(spec.precision, Precision::Fast)
    }

    /// Traces the rays of a range of a stream. Those that are done miss; beside their mask stands whether they are
    /// many, so that others take their places in packets (see `tracer::FEW_DONE`).
    pub(crate) fn trace(
        &self,
        source: &RaySource,
        spec: StreamSpec,
        range: Range<u32>,
        done: Option<(&RayMask, bool)>,
        hits: &mut [Hit],
    ) {
        let taken = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut room = taken.unwrap_or_default();
        match (source, done) {
            (RaySource::Explicit { rays, origins }, None) => {
                let range = range.start as usize..range.end as usize;
                let excluded = origins.as_ref().map_or(&[][..], |origins| &origins[range.clone()]);
                let how = (spec.query, coherence(source, spec));
                self.kernel.trace(&self.tree, &mut room.scratch, how, &rays[range], excluded, hits);
            }
            (_, Some((done, true))) => {
                hits.fill(Hit::MISS);
                let rest: Vec<u32> = range.clone().filter(|&ray| !done.contains(ray)).collect();
                for numbers in rest.chunks(WINDOW) {
                    room.trace(self, source, spec, numbers.iter().map(|&ray| source.ray(ray)));
                    for (&ray, hit) in numbers.iter().zip(&room.hits) {
                        hits[(ray - range.start) as usize] = *hit;
                    }
                }
            }
            _ => {
                let none = (Ray::new([0.0; 3].into(), [0.0; 3].into()), u32::MAX);
                let is_done = |ray: u32| done.is_some_and(|(done, _)| done.contains(ray));
                let mut numbers = range;
                for hits in hits.chunks_mut(WINDOW) {
                    let rays = numbers.by_ref().take(hits.len());
                    let rays = rays.map(|ray| if is_done(ray) { none } else { source.ray(ray) });
                    room.trace(self, source, spec, rays);
                    hits.copy_from_slice(&room.hits);
                }
            }
        }
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(room);
    }
}

impl Room {
    /// Traces rays of a stream that are made here; the hits are in `hits`.
    fn trace(
        &mut self,
        launches: &Launches,
        source: &RaySource,
        spec: StreamSpec,
        rays: impl Iterator<Item = (Ray, u32)>,
    ) {
        let Self { scratch, rays: made, excluded, hits } = self;
        made.clear();
        excluded.clear();
        for (ray, origin) in rays {
            made.push(ray);
            excluded.push(origin);
        }
        hits.clear();
        hits.resize(made.len(), Hit::MISS);
        let how = (spec.query, coherence(source, spec));
        launches.kernel.trace(&launches.tree, scratch, how, made, excluded, hits);
    }
}
