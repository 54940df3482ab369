//! The kernels that count, over the scene's two-wide tree.

use rt_bvh::{PacketWalk, Stack};
use rt_core::{Coherence, Hit, Precision, Ray, Scene, TestCounts, Walk};
use rt_simd::Isa;

/// How rays are walked. Hits and counts are the same bits whichever it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kernels {
    /// Single rays, and packets in the words that every processor of the target has.
    Portable,
    /// Packets in words of AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2(HasAvx2),
}

/// Proof that the processor has what [`rt_bvh::walk_packets_avx2`] is compiled for; made by [`Kernels::of`] alone.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HasAvx2(());

impl Kernels {
    /// Those for some instructions, as far as the processor has them.
    pub(crate) fn of(isa: Isa) -> Self {
        #[cfg(target_arch = "x86_64")]
        if isa >= Isa::Avx2
            && is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt")
        {
            return Self::Avx2(HasAvx2(()));
        }
        Self::Portable
    }

    /// Walks rays and hands hits and counts to `sink`, in order. Neighbours in the list share packets, which pays where
    /// they go alike.
    pub(crate) fn walk<R, S>(
        self,
        scene: &Scene,
        stack: &mut Stack,
        walk: PacketWalk<'_>,
        coherence: Coherence,
        rays: R,
        sink: S,
    ) where
        R: Iterator<Item = (Ray, u32)>,
        S: FnMut(Hit, TestCounts),
    {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(proof) => walk_avx2(proof, scene, stack, walk, rays, sink),
            // Measured in words of SSE2: packets make camera rays faster, and incoherent ones a little slower.
            Self::Portable if coherence == Coherence::Coherent => rt_bvh::walk_packets(scene, stack, walk, rays, sink),
            Self::Portable => walk_alone(scene, stack, walk, rays, sink),
        }
    }
}

fn walk_alone<R, S>(scene: &Scene, stack: &mut Stack, walk: PacketWalk<'_>, rays: R, sink: S)
where
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    match walk {
        PacketWalk::Trace(spec) => rt_bvh::trace(scene, stack, spec, rays, sink),
        PacketWalk::Reduced(walk) => {
            rt_bvh::count(scene, stack, Walk::Reduced(walk), Precision::Robust, rays, sink);
        }
        PacketWalk::Tree(tree) => tree.count(scene, stack, rays, sink),
    }
}

/// Walks packets in words of AVX2. The proof is an argument so that no caller lacks it.
#[cfg(target_arch = "x86_64")]
#[expect(unsafe_code, reason = "whether the processor has AVX2 is known only at run time")]
fn walk_avx2<R, S>(_proof: HasAvx2, scene: &Scene, stack: &mut Stack, walk: PacketWalk<'_>, rays: R, sink: S)
where
    R: Iterator<Item = (Ray, u32)>,
    S: FnMut(Hit, TestCounts),
{
    // SAFETY: a `HasAvx2` is made only where the processor has every feature that the function is compiled for.
    unsafe { rt_bvh::walk_packets_avx2(scene, stack, walk, rays, sink) }
}
