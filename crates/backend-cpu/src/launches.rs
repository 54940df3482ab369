//! Launches and walks in the SIMD words of the processor.

use crate::tracer::coherence;
use rt_bvh::BlockTree;
use rt_core::{
    Coherence, CountedTree, Hit, Precision, Query, Ray, RayMask, RaySource, Scene, StreamSpec, TestCounts, Walk,
};
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
        let find = |is_it: &dyn Fn(&Arc<Scene>) -> bool| {
            let known = trees.iter().find(|(known, _)| known.upgrade().is_some_and(|known| is_it(&known)));
            known.and_then(|(_, tree)| tree.upgrade())
        };
        if let Some(tree) = find(&|known| Arc::ptr_eq(known, scene)) {
            return Some(tree);
        }
        // Of a scene that has moved since there is one that only needs to be fitted.
        let fitted = find(&|known| known.has_tree_of(scene)).and_then(|tree| tree.refit(scene));
        let tree = Arc::new(match fitted {
            Some(tree) => tree,
            None => BlockTree::new(scene)?,
        });
        trees.push((Arc::downgrade(scene), Arc::downgrade(&tree)));
        Some(tree)
    }
}

/// How scenes are brought into the layout of the kernels.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    kernel: Kernel,
    trees: Arc<Trees>,
}

impl Layout {
    pub(crate) const fn new(kernel: Kernel, trees: Arc<Trees>) -> Self {
        Self { kernel, trees }
    }

    /// The scene for the kernels; `None` where it has too many triangles for them.
    pub(crate) fn of(&self, scene: &Arc<Scene>) -> Option<Launches> {
        let tree = self.trees.of(scene)?;
        Some(Launches { kernel: self.kernel, tree, idle: Mutex::default() })
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

/// Where the results of rays go: a hit of each, and the tests of each where they are counted.
pub(crate) struct Results<'a> {
    pub(crate) hits: &'a mut [Hit],
    pub(crate) counts: Option<&'a mut [TestCounts]>,
}

impl Launches {
    /// Whether these kernels trace a stream, and count it where it or a walk is `counted`. `robust` and `f64` are the
    /// same hits; nothing here is `fast`'s, and what is counted are tests of this tree.
    pub(crate) const fn suit(spec: StreamSpec, counted: bool) -> bool {
        let needs_scene = counted && matches!(spec.counted, CountedTree::Scene);
        !needs_scene && !matches!(spec.precision, Precision::Fast)
    }

    /// Traces the rays of a range of a stream. Those that are done miss; beside their mask stands whether they are
    /// many, so that others take their places in packets (see `tracer::FEW_DONE`).
    pub(crate) fn trace(
        &self,
        source: &RaySource,
        spec: StreamSpec,
        range: Range<u32>,
        done: Option<(&RayMask, bool)>,
        mut results: Results<'_>,
    ) {
        if let Some((done, true)) = done {
            let rest: Vec<u32> = range.clone().filter(|&ray| !done.contains(ray)).collect();
            let mut hits = vec![Hit::MISS; rest.len()];
            let mut counts = vec![TestCounts::default(); if results.counts.is_some() { rest.len() } else { 0 }];
            let counted = results.counts.as_ref().map(|_| &mut counts[..]);
            self.walk(source, spec, Walk::Full, &rest, Results { hits: &mut hits, counts: counted });
            results.hits.fill(Hit::MISS);
            if let Some(to) = &mut results.counts {
                to.fill(TestCounts::default());
                let places = rest.iter().zip(&counts);
                places.for_each(|(&ray, count)| to[(ray - range.start) as usize] = *count);
            }
            rest.iter().zip(&hits).for_each(|(&ray, hit)| results.hits[(ray - range.start) as usize] = *hit);
            return;
        }
        let how = (spec.query, coherence(source, spec));
        let mut room = self.room();
        if let (RaySource::Explicit { rays, origins }, None) = (source, done) {
            // A caller's own rays are read where they are.
            let range = range.start as usize..range.end as usize;
            let excluded = origins.as_ref().map_or(&[][..], |origins| &origins[range.clone()]);
            self.answer(&mut room.scratch, Walk::Full, how, (&rays[range], excluded), results);
        } else {
            results.windows(|results, place| {
                let first = range.start + place as u32;
                let (rays, excluded) = room.places(results.hits.len());
                self.kernel.make(source, first, rays, excluded);
                if let Some((done, _)) = done {
                    let none = Ray::new([0.0; 3].into(), [0.0; 3].into());
                    let rays = rays.iter_mut().zip(first..).filter(|(_, number)| done.contains(*number));
                    rays.for_each(|(ray, _)| *ray = none);
                }
                self.answer_room(&mut room, Walk::Full, how, results);
            });
        }
        self.give_back(room);
    }

    /// Walks rays of a stream, which are in the order of their numbers.
    pub(crate) fn walk(&self, source: &RaySource, spec: StreamSpec, walk: Walk, numbers: &[u32], results: Results<'_>) {
        let how = (spec.query, coherence(source, spec));
        let mut room = self.room();
        results.windows(|results, place| {
            let numbers = &numbers[place..place + results.hits.len()];
            let (rays, excluded) = room.places(numbers.len());
            self.kernel.make_of(source, numbers, rays, excluded);
            self.answer_room(&mut room, walk, how, results);
        });
        self.give_back(room);
    }

    fn room(&self) -> Room {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    fn give_back(&self, room: Room) {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(room);
    }

    /// Walks the rays that were put into a room.
    fn answer_room(&self, room: &mut Room, walk: Walk, how: (Query, Coherence), results: Results<'_>) {
        self.answer(&mut room.scratch, walk, how, (&room.rays, &room.excluded), results);
    }

    fn answer(
        &self,
        scratch: &mut Scratch,
        walk: Walk,
        how: (Query, Coherence),
        (rays, excluded): (&[Ray], &[u32]),
        Results { hits, counts }: Results<'_>,
    ) {
        match counts {
            None => self.kernel.trace(&self.tree, scratch, how, rays, excluded, hits),
            Some(counts) => self.kernel.count(&self.tree, scratch, walk, how, rays, excluded, counts, hits),
        }
    }
}

impl Results<'_> {
    /// Calls `each` with the results of [`WINDOW`] rays after those of the others, and where they begin.
    fn windows(self, mut each: impl FnMut(Results<'_>, usize)) {
        let mut counts = self.counts.map(|counts| counts.chunks_mut(WINDOW));
        for (i, hits) in self.hits.chunks_mut(WINDOW).enumerate() {
            each(Results { hits, counts: counts.as_mut().and_then(Iterator::next) }, i * WINDOW);
        }
    }
}

impl Room {
    /// Places for so many rays, and for the primitives that they start on.
    fn places(&mut self, count: usize) -> (&mut [Ray], &mut [u32]) {
        self.rays.resize(count, Ray::new([0.0; 3].into(), [0.0; 3].into()));
        self.excluded.resize(count, u32::MAX);
        (&mut self.rays, &mut self.excluded)
    }
}
