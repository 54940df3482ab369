//! The GPU kernels of raybalance, compiled from WGSL when this crate is built.
//!
//! `shaders/*.wgsl` are the only source. The build joins them, once for each [`Layout`], [`Purpose`] and size of the
//! traversal stack, checks them, writes SPIR-V with every floating-point operation decorated `NoContraction`, WGSL that
//! does without ([`Kernel::wgsl`]), and the table that [`kernel`] looks up. What a kernel reads and writes, and why its
//! decisions are those of `rt_bvh`, is said in the
//! sources.
//!
//! # Current state and limits
//!
//! * Two layouts: the two-wide tree of `rt_core` and the eight-wide compressed one of `rt_bvh`.
//! * Kernels rely on additions and multiplications in single precision being rounded to nearest, one by one, as Vulkan
//!   drivers do with `NoContraction`; [`Purpose::Arithmetic`] finds out. Denormal numbers may be flushed. A device that
//!   can promise more is asked to ([`FloatControls`]).
#![forbid(unsafe_code)]

use std::ffi::CStr;

mod float_controls;

pub use float_controls::FloatControls;

include!(concat!(env!("OUT_DIR"), "/kernels.rs"));

/// Result of a ray that hits nothing.
pub const MISS: u32 = u32::MAX;

/// Result of a ray that the host must trace: its numbers are too large or small for the kernel, or rounding left in
/// doubt what it hits.
pub const DOUBTFUL: u32 = u32::MAX - 1;

/// Which tree a kernel walks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Layout {
    /// The scene's own: `rt_core::Node`.
    #[default]
    Two,
    /// The eight-wide compressed one: `rt_bvh::WideNode`.
    Wide,
}

/// What a kernel finds out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Purpose {
    /// The nearest hit.
    Closest,
    /// The nearest hit, and exact counts.
    ClosestCounted,
    /// Whether anything is hit.
    Any,
    /// Whether anything is hit, and exact counts.
    AnyCounted,
    /// Counts of the reduced traversal that takes a leaf for a hit.
    LeafAsHit,
    /// Counts of the reduced traversal that never shortens the ray.
    Unshortened,
    /// No traversal, but a stream's camera rays.
    Camera,
    /// No traversal, but a stream's rays that leave surfaces.
    Bounce,
    /// No traversal, but sums, products and quotients, by which a device is checked.
    Arithmetic,
    /// For tests: as [`Purpose::Closest`], and each ray counts how often it was visited since it was loaded.
    Visiting,
    /// For tests: as [`Purpose::ClosestCounted`], and each ray counts its visits.
    VisitingCounted,
    /// For tests, no traversal: the visits that a ray counted, in place of its box tests.
    Visits,
    /// Wrong on purpose, for tests: every ray misses.
    Poisoned,
    /// Wrong on purpose, for tests: takes a second or more, and most rays are not answered.
    Slow,
    /// For tests: valid, but wider than any device takes, so that it cannot be compiled.
    TooWide,
}

impl Purpose {
    /// Whether the kernel writes counts.
    #[must_use]
    pub const fn counts(self) -> bool {
        matches!(
            self,
            Self::ClosestCounted
                | Self::AnyCounted
                | Self::LeafAsHit
                | Self::Unshortened
                | Self::VisitingCounted
                | Self::Visits
        )
    }

    /// Whether the kernel reads a launch's rays: it traces, or does so wrongly on purpose, or tells of visits.
    #[must_use]
    pub const fn traces(self) -> bool {
        !matches!(self, Self::Camera | Self::Bounce | Self::Arithmetic)
    }

    /// Whether the kernel does wrong on purpose.
    #[must_use]
    pub const fn is_faulty(self) -> bool {
        matches!(self, Self::Poisoned | Self::Slow | Self::TooWide)
    }
}

/// A compiled kernel.
#[derive(Debug)]
pub struct Kernel {
    /// The tree it walks. [`Layout::Two`] for a kernel that does not trace.
    pub layout: Layout,
    /// What it finds out.
    pub purpose: Purpose,
    /// Entries of its stack: at least the depth of the scene. 0 for a kernel that does not trace.
    pub stack: u32,
    /// Name of its entry point.
    pub entry: &'static CStr,
    /// Invocations in a workgroup, by axis.
    pub workgroup: [u32; 3],
    /// The buffers it reads and writes.
    pub bindings: &'static [Binding],
    code: &'static [u8],
    /// The source for APIs that compile WGSL and cannot say that operations must not be fused: it hides every result
    /// from the compiler behind a zero that only the host knows, `Frame::zero`, `Camera::zero`, `Bounce::zero` or the
    /// first pair of [`Purpose::Arithmetic`].
    pub wgsl: &'static str,
}

impl Kernel {
    /// The SPIR-V for a device that has `controls`.
    #[must_use]
    pub fn spirv_with(&self, controls: FloatControls) -> Vec<u32> {
        controls.apply(self.spirv())
    }

    /// The SPIR-V, for any device.
    #[must_use]
    pub fn spirv(&self) -> Vec<u32> {
        self.code.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect()
    }
}

/// A storage buffer of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Descriptor set.
    pub group: u32,
    /// Number within the set.
    pub binding: u32,
    /// Name in the source.
    pub name: &'static str,
    /// Whether the kernel writes to it.
    pub written: bool,
}

/// The kernel for a layout and purpose whose stack is the smallest that suffices for a tree of that depth; `None` for
/// depths above `rt_core::MAX_DEPTH`.
#[must_use]
pub fn kernel(layout: Layout, purpose: Purpose, depth: u32) -> Option<&'static Kernel> {
    let fits = |kernel: &&Kernel| kernel.layout == layout && kernel.purpose == purpose && kernel.stack >= depth;
    KERNELS.iter().filter(fits).min_by_key(|kernel| kernel.stack)
}

/// A structure as kernels see it.
#[cfg(test)]
struct Structure {
    name: &'static str,
    size: u32,
    members: &'static [(&'static str, u32)],
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::mem::{offset_of, size_of};
    use rt_bvh::WideNode;
    use rt_bvh::kernel_io::{KernelBounce, KernelCamera, KernelRay};
    use rt_core::{MAX_DEPTH, Node, TestCounts, Triangle};

    fn layout(name: &str) -> (&'static [(&'static str, u32)], usize) {
        let layout = LAYOUTS.iter().find(|layout| layout.name == name).expect("in the table");
        (layout.members, layout.size as usize)
    }

    #[test]
    fn layouts_are_those_of_the_host() {
        let node = [("planes", offset_of!(Node, bounds) as u32), ("links", offset_of!(Node, child) as u32)];
        assert_eq!(layout("Node"), (&node[..], size_of::<Node>()));
        assert_eq!(offset_of!(Node, count), offset_of!(Node, child) + 8, "both are one vector in the kernel");
        // What is in its five words is checked by tracing.
        assert_eq!(layout("WideNode"), (&[("words", 0)][..], size_of::<WideNode>()));
        assert_eq!(layout("Triangle"), (&[("vertices", 0)][..], size_of::<Triangle>()));
        let ray = [
            ("origin", offset_of!(KernelRay, origin)),
            ("tmin", offset_of!(KernelRay, tmin)),
            ("reciprocal", offset_of!(KernelRay, reciprocal)),
            ("tmax", offset_of!(KernelRay, tmax)),
            ("shear", offset_of!(KernelRay, shear)),
            ("depth", offset_of!(KernelRay, depth)),
            ("excluded", offset_of!(KernelRay, excluded)),
            ("kind", offset_of!(KernelRay, kind)),
        ]
        .map(|(name, offset)| (name, offset as u32));
        assert_eq!(layout("Ray"), (&ray[..], size_of::<KernelRay>()));
        assert_eq!(layout("VisitedRay"), layout("Ray"));
        assert_eq!(layout("Frame"), (&[("low", 0), ("root", 12), ("high", 16), ("zero", 28)][..], 32));
        assert_eq!(layout("RayList").0, &[("next", 0), ("lanes", 4), ("count", 8), ("ranges", 12), ("rays", 16)]);
        let camera = [
            ("origin", offset_of!(KernelCamera, origin)),
            ("samples", offset_of!(KernelCamera, samples)),
            ("forward", offset_of!(KernelCamera, forward)),
            ("seed", offset_of!(KernelCamera, seed)),
            ("right", offset_of!(KernelCamera, right)),
            ("numbers", offset_of!(KernelCamera, numbers)),
            ("up", offset_of!(KernelCamera, up)),
            ("count", offset_of!(KernelCamera, count)),
            ("pixel", offset_of!(KernelCamera, pixel)),
            ("aspect", offset_of!(KernelCamera, aspect)),
            ("tmax", offset_of!(KernelCamera, tmax)),
            ("exponents", offset_of!(KernelCamera, exponents)),
            ("zero", offset_of!(KernelCamera, zero)),
            ("pixels", offset_of!(KernelCamera, pixels)),
            ("first_sample", offset_of!(KernelCamera, first_sample)),
            ("is_centred", offset_of!(KernelCamera, is_centred)),
            ("unused", size_of::<KernelCamera>() - 8),
            ("words", size_of::<KernelCamera>()),
        ]
        .map(|(name, offset)| (name, offset as u32));
        assert_eq!(layout("Camera").0, camera);
        let bounce = [
            ("middle", offset_of!(KernelBounce, middle)),
            ("disc", offset_of!(KernelBounce, disc)),
            ("tangent", offset_of!(KernelBounce, tangent)),
            ("seed", offset_of!(KernelBounce, seed)),
            ("bitangent", offset_of!(KernelBounce, bitangent)),
            ("samples", offset_of!(KernelBounce, samples)),
            ("dimension", offset_of!(KernelBounce, dimension)),
            ("paths", offset_of!(KernelBounce, paths)),
            ("count", offset_of!(KernelBounce, count)),
            ("tmax", offset_of!(KernelBounce, tmax)),
            ("coordinates", offset_of!(KernelBounce, coordinates)),
            ("exponents", offset_of!(KernelBounce, exponents)),
            ("zero", offset_of!(KernelBounce, zero)),
            ("departures", offset_of!(KernelBounce, departures)),
            ("first_group", offset_of!(KernelBounce, first_group)),
            ("unused", size_of::<KernelBounce>() - 20),
            ("words", size_of::<KernelBounce>()),
        ]
        .map(|(name, offset)| (name, offset as u32));
        assert_eq!(layout("Bounce").0, bounce);
        // vec2<u32>.
        assert_eq!((offset_of!(TestCounts, boxes), offset_of!(TestCounts, triangles)), (0, 4));
        assert_eq!(size_of::<TestCounts>(), 8);
    }

    #[test]
    fn every_purpose_has_a_kernel_for_every_depth() {
        use Purpose::{Any, AnyCounted, Closest, ClosestCounted, LeafAsHit, Unshortened, Visiting, VisitingCounted};
        for layout in [Layout::Two, Layout::Wide] {
            let tests_own = [Visiting, VisitingCounted];
            for purpose in
                [Closest, ClosestCounted, Any, AnyCounted, LeafAsHit, Unshortened].into_iter().chain(tests_own)
            {
                for depth in 0..=MAX_DEPTH {
                    let kernel = kernel(layout, purpose, depth).expect("one for each depth");
                    assert!(kernel.stack >= depth && (kernel.layout, kernel.purpose) == (layout, purpose));
                }
                assert!(kernel(layout, purpose, MAX_DEPTH + 1).is_none());
            }
        }
    }

    #[test]
    fn every_kernel_is_spirv_with_the_same_buffers() {
        const MAGIC: u32 = 0x0723_0203;
        let all = KERNELS[0].bindings;
        assert_eq!(all.iter().map(|b| b.binding).collect::<Vec<_>>(), (0..8).collect::<Vec<_>>());
        for kernel in KERNELS {
            assert_eq!(kernel.spirv()[0], MAGIC);
            if kernel.purpose != Purpose::TooWide {
                assert_eq!(kernel.workgroup, [64, 1, 1]);
            }
            let bindings: Vec<_> = kernel.bindings.iter().map(|b| (b.binding, b.written)).collect();
            match kernel.purpose {
                Purpose::Arithmetic => assert_eq!(bindings, [(4, false), (6, true)]),
                Purpose::Camera => assert_eq!(bindings, [(5, false), (6, true)]),
                Purpose::Bounce => assert_eq!(bindings, [(1, false), (2, false), (5, false), (6, true)]),
                // They visit no node.
                purpose if purpose.is_faulty() => assert_eq!(kernel.bindings, &all[1..]),
                Purpose::Visiting | Purpose::VisitingCounted | Purpose::Visits => {
                    let others = |b: &&Binding| b.binding != 4 && b.binding != 0;
                    assert!(kernel.bindings.iter().filter(others).eq(all.iter().filter(others)));
                    assert!(kernel.bindings.iter().any(|b| b.binding == 4 && b.written));
                }
                _ => assert_eq!(kernel.bindings, all),
            }
        }
    }

    /// Fails when the build leaves out the pass over the SPIR-V.
    #[test]
    fn every_sum_and_product_is_kept_apart() {
        let computes = |kernel: &&Kernel| !kernel.purpose.is_faulty() && kernel.purpose != Purpose::Visits;
        for kernel in KERNELS.iter().filter(computes) {
            let words = kernel.spirv();
            let (mut decorated, mut arithmetic) = (Vec::new(), Vec::new());
            let mut at = 5;
            while at < words.len() {
                let (length, op) = ((words[at] >> 16) as usize, words[at] & 0xffff);
                match op {
                    // OpDecorate … NoContraction
                    71 if words[at + 2] == 42 => decorated.push(words[at + 1]),
                    // FAdd, FSub, FMul, FDiv, VectorTimesScalar
                    129 | 131 | 133 | 136 | 142 => arithmetic.push(words[at + 2]),
                    _ => {}
                }
                at += length;
            }
            assert!(arithmetic.len() > 20 && arithmetic.iter().all(|id| decorated.contains(id)));
        }
    }
}
