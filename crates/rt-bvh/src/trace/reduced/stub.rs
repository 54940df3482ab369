//! A truncated tree: its top, and below it what rays paid there on average.

use super::super::slabs::LocalRay;
use super::super::stack::{Pending, Stack};
use super::super::triangle::Robust;
use super::super::visitor::Nearest;
use super::super::walk::{Visitor, each_in, walk};
use crate::scale::{pow2, scaled};
use alloc::collections::BinaryHeap;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::ops::ControlFlow;
use glam::Vec3;
use rt_core::{Child, Hit, Node, Ray, Scene, TestCounts, random};

/// Inner nodes kept: 64 kB, which the second-level cache of any processor holds, and where the paper's measure of a
/// GPU's fast memory lies, too.
const TOP_NODES: usize = 1024;

/// Rays traced to calibrate, per stub: a ray enters some ten stubs, so a mean is of some hundred rays.
const RAYS_PER_STUB: usize = 16;

/// What a ray that enters a subtree pays there on average.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stub {
    boxes: f32,
    triangles: f32,
    /// Share of the rays that hit something there.
    hit: f32,
    /// How far behind the entry they hit, in local units.
    depth: f32,
}

/// Sums over the rays that entered a stub.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    rays: f32,
    boxes: f32,
    triangles: f32,
    hits: f32,
    depth: f32,
}

impl Sums {
    fn plus(self, other: &Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            boxes: self.boxes + other.boxes,
            triangles: self.triangles + other.triangles,
            hits: self.hits + other.hits,
            depth: self.depth + other.depth,
        }
    }

    /// Means, with one more ray that paid what rays pay in stubs over all.
    fn stub(&self, all: &Self) -> Stub {
        let mean = |own: f32, total: f32| (own + total / all.rays.max(1.0)) / (self.rays + 1.0);
        let hits = mean(self.hits, all.hits);
        let depth = mean(self.depth, all.depth) / hits.max(f32::MIN_POSITIVE);
        Stub { boxes: mean(self.boxes, all.boxes), triangles: mean(self.triangles, all.triangles), hit: hits, depth }
    }
}

/// The top of the scene's tree, whose leaf children number stubs, and the stubs.
pub(super) fn calibrated(scene: &Scene) -> (Vec<Node>, Vec<Stub>) {
    let (nodes, roots) = top(scene);
    let sums = RefCell::new(vec![Sums::default(); roots.len()]);
    let calibration = Calibration { scene, roots: &roots, sums: &sums };
    let rays = (0..(RAYS_PER_STUB * roots.len()) as u32).filter_map(|i| calibration_ray(scene, i));
    let mut stack = Stack::for_scene(scene);
    each_in::<Tracing<'_>, _, _>(scene, &nodes, &calibration, &mut stack, rays, |_, _| {});
    let sums = sums.into_inner();
    let all = sums.iter().fold(Sums::default(), |all, own| all.plus(own));
    (nodes, sums.iter().map(|own| own.stub(&all)).collect())
}

/// Keeps the nodes with the largest boxes, from the root down; returns them and what hangs below: a subtree or leaf for
/// each leaf child.
fn top(scene: &Scene) -> (Vec<Node>, Vec<Pending>) {
    let all = scene.nodes();
    let mut nodes = vec![all[0]];
    let mut roots = Vec::new();
    // By area, whose bits order like the numbers as they are not negative; then by place, to be deterministic.
    let mut open = BinaryHeap::new();
    let offer = |open: &mut BinaryHeap<(u32, u32, usize)>, node: &Node, at: u32| {
        for side in (0..2).filter(|&side| node.child(side) != Child::Absent) {
            open.push((node.bounds[side].half_area().max(0.0).to_bits(), at, side));
        }
    };
    offer(&mut open, &all[0], 0);
    while let Some((_, parent, side)) = open.pop() {
        let at = nodes.len() as u32;
        let own = &mut nodes[parent as usize];
        match own.child(side) {
            Child::Inner(below) if (at as usize) < TOP_NODES => {
                own.child[side] = at;
                offer(&mut open, &all[below as usize], at);
                nodes.push(all[below as usize]);
            }
            _ => {
                let root = Pending { child: own.child[side], count: own.count[side], entry: 0.0 };
                (own.child[side], own.count[side]) = (roots.len() as u32, 1);
                roots.push(root);
            }
        }
    }
    (nodes, roots)
}

/// Ray `i` of the calibration: from a random triangle in a random direction, as bounced rays start. `None` where the
/// scene has no triangle, or is so large that the ray cannot be said in the coordinates of its file.
fn calibration_ray(scene: &Scene, i: u32) -> Option<(Ray, u32)> {
    // Keeps these random numbers apart from those of others.
    const SEED: u32 = 0x57ab_ca11;
    let slot = random::below(scene.triangles().len() as u32, SEED, i, 0) as usize;
    let triangle = scene.triangles().get(slot)?;
    let [a, b] = random::pair(SEED, i, 1);
    let [u, v] = if a + b > 1.0 { [1.0 - a, 1.0 - b] } else { [a, b] };
    let origin = triangle.a + (triangle.b - triangle.a) * u + (triangle.c - triangle.a) * v;
    let [height, turn] = random::pair(SEED, i, 2);
    let z = 2.0 * height - 1.0;
    let (sin, cos) = libm::sincosf(core::f32::consts::TAU * turn);
    let radius = libm::sqrtf((1.0 - z * z).max(0.0));
    let ray = Ray::new(scaled(origin, pow2(scene.scale_exponent())), Vec3::new(cos * radius, sin * radius, z));
    ray.is_valid().then(|| (ray, scene.primitives().get(slot)))
}

/// What calibrating rays share.
struct Calibration<'a> {
    scene: &'a Scene,
    roots: &'a [Pending],
    sums: &'a RefCell<Vec<Sums>>,
}

/// Traces a ray in full, and notes what it pays in each stub.
struct Tracing<'a> {
    calibration: &'a Calibration<'a>,
    nearest: Nearest<'a, Robust, false, true>,
    stack: Stack,
}

impl<'a> Visitor<'a> for Tracing<'a> {
    type Data = Calibration<'a>;
    const COUNTS: bool = false;

    fn begin(calibration: &'a Calibration<'a>, ray: LocalRay, excluded: u32) -> Self {
        let scene = calibration.scene;
        Self { calibration, nearest: Nearest::begin(scene, ray, excluded), stack: Stack::for_scene(scene) }
    }

    fn ray(&self) -> &LocalRay {
        self.nearest.ray()
    }

    fn boxes(&mut self, _count: u32) {}

    fn limit(&self) -> f32 {
        self.nearest.limit()
    }

    fn leaf(&mut self, entry: f32, first: u32, _count: u32) -> ControlFlow<()> {
        let root = Pending { entry, ..self.calibration.roots[first as usize] };
        let (before, limit) = (self.nearest.counts(), self.nearest.limit());
        let flow = walk(self.calibration.scene.nodes(), &mut self.stack.entries, root, &mut self.nearest);
        let (after, cut) = (self.nearest.counts(), self.nearest.limit());
        let length = self.ray().direction.length();
        if let Some(sums) = self.calibration.sums.borrow_mut().get_mut(first as usize) {
            sums.rays += 1.0;
            sums.boxes += (after.boxes - before.boxes) as f32;
            sums.triangles += (after.triangles - before.triangles) as f32;
            if cut < limit {
                sums.hits += 1.0;
                sums.depth += (cut - entry).max(0.0) * length;
            }
        }
        flow
    }

    fn finish(self) -> (Hit, TestCounts) {
        self.nearest.finish()
    }
}

/// Counts tests above the stubs and adds what stubs cost; a ray ends in a stub as often as calibrating rays did.
pub(super) struct StubWalk<'a> {
    stubs: &'a [Stub],
    ray: LocalRay,
    limit: f32,
    /// Length of a unit of distance.
    length: f32,
    boxes: u32,
    /// Box and triangle tests in stubs.
    below: [f32; 2],
}

impl<'a> Visitor<'a> for StubWalk<'a> {
    type Data = [Stub];
    const COUNTS: bool = true;

    #[inline]
    fn begin(stubs: &'a [Stub], ray: LocalRay, _excluded: u32) -> Self {
        let (limit, length) = (ray.local_limit(ray.given.tmax), ray.direction.length());
        Self { stubs, ray, limit, length, boxes: 0, below: [0.0; 2] }
    }

    #[inline(always)]
    fn ray(&self) -> &LocalRay {
        &self.ray
    }

    #[inline(always)]
    fn boxes(&mut self, count: u32) {
        self.boxes += count;
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn leaf(&mut self, entry: f32, first: u32, _count: u32) -> ControlFlow<()> {
        let stub = &self.stubs[first as usize];
        self.below = [self.below[0] + stub.boxes, self.below[1] + stub.triangles];
        let [word, ..] = random::pcg3d([entry.to_bits(), self.ray.direction.x.to_bits(), first]);
        if random::unit(word) < stub.hit {
            self.limit = self.limit.min(entry + stub.depth / self.length);
        }
        ControlFlow::Continue(())
    }

    #[inline]
    fn finish(self) -> (Hit, TestCounts) {
        let whole = |tests: f32| (tests + 0.5) as u32;
        let [boxes, triangles] = self.below.map(whole);
        (Hit::MISS, TestCounts { boxes: self.boxes + boxes, triangles })
    }
}
