//! A scene and the layouts in which a device holds it.

use crate::SceneImage;
use rt_bvh::kernel_io::KernelIo;
use rt_bvh::{Stack, WideShape, WideTree, count_wide, trace_wide};
use rt_core::{Hit, MAX_DEPTH, Precision, Ray, Scene, StreamSpec, TestCounts, Walk};
use rt_shaders::{Layout, Purpose};
use std::sync::Arc;

/// Which layout is walked for what. By default the two-wide one for all, so that a device holds one tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Layouts {
    /// Where only hits are wanted.
    pub trace: Layout,
    /// Where tests are counted. Other than [`Layout::Two`] only for comparing layouts: estimates of several devices can
    /// be added up only where all count on one layout.
    pub count: Layout,
}

impl Layouts {
    /// What is used unless something else is asked for: hits over the wide layout, counts over the two-wide one.
    ///
    /// On processors posing as graphics cards the wide layout was measured to be the faster one
    /// (docs/results/layouts.md). On graphics cards it was not measured: there the choice rests on Ylitie, Karras and
    /// Laine (2017), who report 1.9 to 2.1 times the speed of earlier kernels for incoherent rays, and on its nodes
    /// taking a third of the memory.
    pub const USUAL: Self = Self { trace: Layout::Wide, count: Layout::Two };

    /// The layout of kernels for a purpose.
    #[must_use]
    pub const fn of(self, purpose: Purpose) -> Layout {
        match purpose {
            Purpose::Arithmetic | Purpose::Camera | Purpose::Bounce => Layout::Two,
            purpose if purpose.counts() => self.count,
            _ => self.trace,
        }
    }
}

/// The trees that a device holds of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trees {
    layouts: Layouts,
    /// Of both trees; 0 for the wide one where there is none.
    depths: [u32; 2],
}

impl Trees {
    /// The layout that kernels for a purpose walk, and the depth of its tree.
    #[must_use]
    pub fn of(self, purpose: Purpose) -> (Layout, u32) {
        let layout = self.layouts.of(purpose);
        (layout, self.depths[usize::from(layout == Layout::Wide)])
    }
}

/// A scene as a device holds it.
#[derive(Debug)]
pub struct GpuScene {
    given: Arc<Scene>,
    trees: Trees,
    /// Dropped when it is on the device, unless the host counts on it.
    wide: Option<WideTree>,
    /// Of the wide tree, once it is on the device: where triangles are, and what is to be fitted when they move.
    shape: Option<WideShape>,
}

impl From<Arc<Scene>> for GpuScene {
    /// The two-wide layout alone.
    fn from(given: Arc<Scene>) -> Self {
        Self::new(given, Layouts::default())
    }
}

impl GpuScene {
    /// Makes the wide tree where a layout asks for it. One that is too deep for the kernels is left out, and the
    /// two-wide one does all.
    #[must_use]
    pub fn new(given: Arc<Scene>, layouts: Layouts) -> Self {
        let wanted = layouts.trace == Layout::Wide || layouts.count == Layout::Wide;
        let wide = wanted.then(|| WideTree::new(&given)).filter(|tree| tree.depth() <= MAX_DEPTH);
        let depths = [given.depth(), wide.as_ref().map_or(0, WideTree::depth)];
        let layouts = if wide.is_some() { layouts } else { Layouts::default() };
        Self { given, trees: Trees { layouts, depths }, wide, shape: None }
    }

    /// What the device is to hold.
    #[must_use]
    pub fn image(&self) -> SceneImage<'_> {
        match &self.wide {
            Some(tree) => SceneImage::with_wide(tree),
            None => SceneImage::new(&self.given),
        }
    }

    /// Its trees.
    #[must_use]
    pub const fn trees(&self) -> Trees {
        self.trees
    }

    /// Whether it holds the wide tree, but only for hits, which do not depend on it.
    pub(crate) fn can_do_without_wide(&self) -> bool {
        self.wide.is_some() && self.trees.layouts.count == Layout::Two
    }

    /// Frees what was only needed for the image.
    #[must_use]
    pub(crate) fn settled(mut self) -> Self {
        self.shape = match &self.wide {
            Some(tree) if self.trees.layouts.count == Layout::Wide => Some(tree.shape()),
            _ => self.wide.take().map(WideTree::into_shape),
        };
        self
    }

    /// The scene when its triangles have moved, not settled yet; `None` if it has another tree.
    pub(crate) fn moved(&self, given: Arc<Scene>) -> Option<Self> {
        given.has_tree_of(&self.given).then(|| {
            let wide = self.shape.as_ref().map(|shape| shape.refit(&given));
            Self { given, trees: self.trees, wide, shape: None }
        })
    }

    /// The wide tree as it is on the device.
    pub(crate) const fn shape(&self) -> Option<&WideShape> {
        self.shape.as_ref()
    }

    /// For each triangle on the device, where it is in the given scene; empty where that is its own place.
    pub(crate) fn slots(&self) -> &[u32] {
        self.shape.as_ref().map_or(&[], WideShape::slots)
    }

    /// The scene as it was given.
    pub(crate) fn given(&self) -> &Scene {
        &self.given
    }

    /// For each slot of the given scene, where its triangle is on the device; empty where that is its own place.
    pub(crate) fn places(&self) -> Vec<u32> {
        let mut places = vec![0; self.slots().len()];
        (0..).zip(self.slots()).for_each(|(place, &given)| places[given as usize] = place);
        places
    }

    /// The hit of a ray with the triangle at a slot of the device's order.
    pub(crate) fn finish(&self, io: &KernelIo<'_>, ray: &Ray, slot: u32) -> Option<Hit> {
        let slots = self.slots();
        let given = if slots.is_empty() { Some(slot) } else { slots.get(slot as usize).copied() };
        io.finish(ray, given?)
    }

    /// Traces a ray on the host, with counts as the device would count.
    pub(crate) fn trace(&self, stack: &mut Stack, spec: StreamSpec, ray: (Ray, u32)) -> (Hit, TestCounts) {
        let mut out = (Hit::MISS, TestCounts::default());
        let sink = |hit, counts| out = (hit, counts);
        match &self.wide {
            Some(tree) if spec.counts => trace_wide(tree, stack, spec, std::iter::once(ray), sink),
            _ => rt_bvh::trace(&self.given, stack, spec, std::iter::once(ray), sink),
        }
        out
    }

    /// Counts a ray's tests on the host as the device would.
    pub(crate) fn count(&self, stack: &mut Stack, walk: Walk, precision: Precision, ray: (Ray, u32)) -> TestCounts {
        let mut out = TestCounts::default();
        let sink = |_, counts| out = counts;
        match &self.wide {
            Some(tree) => count_wide(tree, stack, walk, precision, std::iter::once(ray), sink),
            None => rt_bvh::count(&self.given, stack, walk, precision, std::iter::once(ray), sink),
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_bvh::{BuildOptions, Mesh, build};
    use rt_core::random;

    const COUNT: u32 = 500;

    fn scene() -> Arc<Scene> {
        let vertex = |i: u32| {
            let [at, corner] = [[5, i / 3, 0], [5, i, 1]].map(|seed| random::pcg3d(seed).map(random::unit));
            std::array::from_fn(|axis| at[axis] + 0.2 * corner[axis]).into()
        };
        let positions: Vec<_> = (0..3 * COUNT).map(vertex).collect();
        let indices: Vec<_> = (0..COUNT).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh { positions: &positions, indices: &indices };
        build(mesh, &BuildOptions::default()).expect("valid").scene
    }

    #[test]
    fn hits_go_to_the_wide_tree_and_counts_to_the_two_wide_one() {
        let scene = GpuScene::new(scene(), Layouts::USUAL);
        let (trees, two) = (scene.trees(), scene.given().depth());
        assert_eq!(trees.of(Purpose::Closest).0, Layout::Wide);
        assert!(trees.of(Purpose::Any).1 < two && trees.of(Purpose::Any).1 > 0);
        for purpose in [Purpose::ClosestCounted, Purpose::AnyCounted, Purpose::LeafAsHit, Purpose::Unshortened] {
            assert_eq!(trees.of(purpose), (Layout::Two, two));
        }
        let image = scene.image();
        let (what, wide) = image.wide();
        let bytes = size_of_val(scene.given().nodes());
        assert!(what.contains(&bytes.to_string()) && !wide.is_empty() && wide.len() < bytes);
    }

    // Fails when the device's slots are taken for the scene's.
    #[test]
    fn slots_are_turned_back() {
        let given = scene();
        let triangle = |image: &SceneImage<'_>, slot: usize| image.buffers()[1].1[36 * slot..][..36].to_vec();
        let scene = GpuScene::new(Arc::clone(&given), Layouts::USUAL);
        let on_device: Vec<_> = (0..COUNT as usize).map(|slot| triangle(&scene.image(), slot)).collect();
        let scene = scene.settled();
        assert!(scene.wide.is_none() && scene.slots().len() == on_device.len());
        for (slot, bytes) in on_device.iter().enumerate() {
            assert_eq!(*bytes, triangle(&SceneImage::new(&given), scene.slots()[slot] as usize));
            assert_eq!(scene.places()[scene.slots()[slot] as usize], slot as u32);
        }
        assert!(scene.slots().windows(2).any(|pair| pair[0] > pair[1]), "the order is another one");
        let alone = GpuScene::from(given).settled();
        assert!(alone.wide.is_none() && alone.slots().is_empty());
    }
}
