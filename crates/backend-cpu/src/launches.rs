//! Launches in the SIMD words of the processor: rays that nobody counts.

use crate::tracer::coherence;
use rt_bvh::BlockTree;
use rt_core::{Coherence, Hit, Precision, Query, Ray, RayMask, RaySource, Scene, StreamSpec};
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
        let how = (spec.query, coherence(source, spec));
        match (source, done) {
            // A caller's own rays are read where they are.
            (RaySource::Explicit { rays, origins }, None) => {
                let range = range.start as usize..range.end as usize;
                let excluded = origins.as_ref().map_or(&[][..], |origins| &origins[range.clone()]);
                self.kernel.trace(&self.tree, &mut room.scratch, how, &rays[range], excluded, hits);
            }
            (_, Some((done, true))) => {
                hits.fill(Hit::MISS);
                let rest: Vec<u32> = range.clone().filter(|&ray| !done.contains(ray)).collect();
                let mut found = [Hit::MISS; WINDOW];
                for numbers in rest.chunks(WINDOW) {
                    let found = &mut found[..numbers.len()];
                    let (rays, excluded) = room.places(numbers.len());
                    for ((ray, excluded), &number) in rays.iter_mut().zip(excluded).zip(numbers) {
                        (*ray, *excluded) = source.ray(number);
                    }
                    room.trace(self, how, found);
                    for (&number, hit) in numbers.iter().zip(&*found) {
                        hits[(number - range.start) as usize] = *hit;
                    }
                }
            }
            _ => {
                for (hits, first) in hits.chunks_mut(WINDOW).zip(range.step_by(WINDOW)) {
                    let (rays, excluded) = room.places(hits.len());
                    source.rays(first, rays, excluded);
                    if let Some((done, _)) = done {
                        let none = Ray::new([0.0; 3].into(), [0.0; 3].into());
                        let rays = rays.iter_mut().zip(first..).filter(|(_, number)| done.contains(*number));
                        rays.for_each(|(ray, _)| *ray = none);
                    }
                    room.trace(self, how, hits);
                }
            }
        }
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(room);
    }
}

impl Room {
    /// Places for so many rays, and for the primitives that they start on.
    fn places(&mut self, count: usize) -> (&mut [Ray], &mut [u32]) {
        self.rays.resize(count, Ray::new([0.0; 3].into(), [0.0; 3].into()));
        self.excluded.resize(count, u32::MAX);
        (&mut self.rays, &mut self.excluded)
    }

    /// Traces the rays that were put there.
    fn trace(&mut self, launches: &Launches, how: (Query, Coherence), hits: &mut [Hit]) {
        launches.kernel.trace(&launches.tree, &mut self.scratch, how, &self.rays, &self.excluded, hits);
    }
}
