//! Launches and walks in the SIMD words of the processor.

use crate::tracer::coherence;
use rt_bvh::BlockTree;
use rt_core::{
    Coherence, CountedTree, Hit, Precision, Query, Ray, RayMask, RaySource, Scene, StreamSpec, TestCounts, Walk,
};
use rt_simd::{Kernel, Scratch, use_large_pages};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Rays that are made or gathered before they are traced: as many as the kernels sort at once.
pub(crate) const WINDOW: usize = 1024;

/// Trees that devices opened together have in common, so that a scene's is made and held once.
#[derive(Debug, Default)]
pub(crate) struct Trees(Mutex<Vec<Known>>);

/// A tree that somebody traces.
#[derive(Debug)]
struct Known {
    scene: Weak<Scene>,
    /// The mask whose hidden triangles it is without; `None`: it has all.
    mask: Option<u32>,
    tree: Weak<BlockTree>,
}

impl Trees {
    /// The scene's tree; `None` where it has too many triangles for one.
    pub(crate) fn of(&self, scene: &Arc<Scene>) -> Option<Arc<BlockTree>> {
        let make = |trees: &[Known]| {
            // Of a scene that has moved since there is one that only needs to be fitted.
            let moved = find(trees, None, |known| known.has_tree_of(scene)).and_then(|tree| tree.refit(scene));
            moved.map_or_else(|| BlockTree::new(scene), Some)
        };
        self.known_or(scene, None, make)
    }

    /// The same without what `mask` hides, of the one that has all.
    fn shown(&self, scene: &Arc<Scene>, all: &BlockTree, mask: u32) -> Option<Arc<BlockTree>> {
        self.known_or(scene, Some(mask), |_| Some(all.of_shown(|primitive| scene.shows(primitive, mask))))
    }

    /// A tree that somebody has already, or else what `make` makes of those that there are.
    fn known_or(
        &self,
        scene: &Arc<Scene>,
        mask: Option<u32>,
        make: impl FnOnce(&[Known]) -> Option<BlockTree>,
    ) -> Option<Arc<BlockTree>> {
        // A panic of whoever had it leaves the list whole.
        let mut trees = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        trees.retain(|known| known.scene.strong_count() > 0 && known.tree.strong_count() > 0);
        if let Some(tree) = find(&trees, mask, |known| Arc::ptr_eq(known, scene)) {
            return Some(tree);
        }
        let tree = Arc::new(make(&trees)?);
        use_large_pages(&tree);
        trees.push(Known { scene: Arc::downgrade(scene), mask, tree: Arc::downgrade(&tree) });
        Some(tree)
    }
}

/// The first tree for a mask whose scene `is_it`.
fn find(trees: &[Known], mask: Option<u32>, is_it: impl Fn(&Arc<Scene>) -> bool) -> Option<Arc<BlockTree>> {
    let of_mask = trees.iter().filter(|known| known.mask == mask);
    of_mask.filter(|known| known.scene.upgrade().is_some_and(|scene| is_it(&scene))).find_map(|it| it.tree.upgrade())
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
        self.trees.of(scene).map(|tree| self.launches(tree))
    }

    /// The scene without what `mask` hides, of its launches that have all.
    pub(crate) fn shown(&self, scene: &Arc<Scene>, all: &Launches, mask: u32) -> Option<Launches> {
        self.trees.shown(scene, &all.tree, mask).map(|tree| self.launches(tree))
    }

    fn launches(&self, tree: Arc<BlockTree>) -> Launches {
        Launches { kernel: self.kernel, tree, idle: Mutex::default() }
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

/// Where the results of rays go: a hit of each, or none where no one asks for them and tests are counted; and the tests
/// of each, or none.
pub(crate) struct Results<'a> {
    pub(crate) hits: &'a mut [Hit],
    pub(crate) counts: &'a mut [TestCounts],
}

impl Launches {
    /// Whether these kernels trace a stream, and count it where it or a walk is `counted`. `robust` and `f64` are the
    /// same hits; nothing here is `fast`'s, and what is counted are tests of this tree. They find one hit of a ray.
    pub(crate) const fn suit(spec: StreamSpec, counted: bool) -> bool {
        let needs_scene = counted && matches!(spec.counted, CountedTree::Scene);
        let has_one_hit = !matches!(spec.query, Query::All { .. });
        !needs_scene && !matches!(spec.precision, Precision::Fast) && has_one_hit
    }

    /// Traces the rays of a range of a stream. Those that are done miss; beside their mask stands whether they are
    /// many, so that others take their places in packets (see `tracer::FEW_DONE`).
    pub(crate) fn trace(
        &self,
        source: &RaySource,
        spec: StreamSpec,
        range: Range<u32>,
        done: Option<(&RayMask, bool)>,
        results: Results<'_>,
    ) {
        if let Some((done, true)) = done {
            let rest: Vec<u32> = range.clone().filter(|&ray| !done.contains(ray)).collect();
            let mut hits = vec![Hit::MISS; rest.len()];
            let mut counts = vec![TestCounts::default(); if results.counts.is_empty() { 0 } else { rest.len() }];
            self.walk(source, spec, Walk::Full, &rest, Results { hits: &mut hits, counts: &mut counts });
            results.hits.fill(Hit::MISS);
            results.counts.fill(TestCounts::default());
            let place = |ray: u32| (ray - range.start) as usize;
            rest.iter().zip(counts).for_each(|(&ray, count)| results.counts[place(ray)] = count);
            rest.iter().zip(hits).for_each(|(&ray, hit)| results.hits[place(ray)] = hit);
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
            results.windows(range.len(), |results, window| {
                let first = range.start + window.start as u32;
                let (rays, excluded) = room.places(window.len());
                self.kernel.make(source, first, rays, excluded);
                if let Some((done, _)) = done {
                    let none = Ray::new([0.0; 3].into(), [0.0; 3].into());
                    done.set_in(first..first + window.len() as u32).for_each(|ray| rays[(ray - first) as usize] = none);
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
        results.windows(numbers.len(), |results, window| {
            let numbers = &numbers[window];
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
        if counts.is_empty() {
            self.kernel.trace(&self.tree, scratch, how, rays, excluded, hits);
        } else {
            self.kernel.count(&self.tree, scratch, walk, how, rays, excluded, counts, hits);
        }
    }
}

impl<'a> Results<'a> {
    /// Those of the next rays, so many of them.
    pub(crate) fn split_off(&mut self, rays: usize) -> Results<'a> {
        let (hits, counts) = (rays.min(self.hits.len()), rays.min(self.counts.len()));
        Results {
            hits: self.hits.split_off_mut(..hits).unwrap_or_default(),
            counts: self.counts.split_off_mut(..counts).unwrap_or_default(),
        }
    }

    /// Calls `each` with the results of [`WINDOW`] of so many rays after those of the others, and which these are.
    fn windows(mut self, rays: usize, mut each: impl FnMut(Results<'_>, Range<usize>)) {
        for first in (0..rays).step_by(WINDOW) {
            let size = WINDOW.min(rays - first);
            each(self.split_off(size), first..first + size);
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
