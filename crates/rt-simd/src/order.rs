//! Rays that go any way, put in an order in which neighbours go alike.
//!
//! After the many schemes that sort secondary rays, of which B. Moon and others, *Cache-Oblivious Ray Reordering*
//! (2010), give an overview; what pays here is the plainest: by octant and dominant axis of the direction, within a
//! window, so that rays stay near those that left from nearby.

use crate::lanes::LANES;
use crate::packet::RAYS;
use rt_bvh::BlockNode;
use rt_core::intersect::shear_axes;
use rt_core::{Coherence, Hit, Ray};

/// Rays that are sorted together: a task of 32 × 32 pixels.
pub(crate) const WINDOW: usize = 1024;

/// One packet in so many is looked at to find out whether neighbours go alike.
const STRIDE: usize = 4;

/// And one ray in so many of it: one for each sixteen that are tested together.
const STEP: usize = LANES;

/// Whether so few neighbours go alike that sorting pays: more than two of a packet's four bins differ on average. Of
/// camera rays and shadow rays towards the sun hardly any do, of diffuse rays nearly all. A wrong guess costs less than
/// half the speed. Measured: looking at every packet waits for memory, 8% of the time of the fastest rays.
fn pays(rays: &[Ray]) -> bool {
    let (mut packets, mut bins) = (0, 0);
    for packet in rays.chunks_exact(RAYS).step_by(STRIDE) {
        packets += 1;
        bins += packet.iter().step_by(STEP).fold(0_u32, |bins, ray| bins | 1 << bin_of(ray)).count_ones();
    }
    bins > 2 * packets
}

/// Whether rays of which this is said are to be sorted.
pub(crate) fn are_to_be_sorted(coherence: Coherence, rays: &[Ray]) -> bool {
    match coherence {
        Coherence::Unknown => pays(rays),
        Coherence::Coherent => false,
        Coherence::Incoherent => true,
    }
}

/// Octants times dominant axes.
const BINS: usize = 24;

/// Room for a window's rays in order.
#[derive(Clone, Debug)]
pub(crate) struct Sorted {
    pub(crate) rays: Vec<Ray>,
    pub(crate) excluded: Vec<u32>,
    pub(crate) hits: Vec<Hit>,
    /// For each place, the ray that is there.
    order: Vec<u16>,
    bins: Vec<u8>,
}

impl Sorted {
    pub(crate) fn new() -> Self {
        Self {
            rays: vec![Ray::new(glam::Vec3::ZERO, glam::Vec3::ZERO); WINDOW],
            excluded: vec![u32::MAX; WINDOW],
            hits: vec![Hit::MISS; WINDOW],
            order: vec![0; WINDOW],
            bins: vec![0; WINDOW],
        }
    }

    /// Takes a window of rays, and what each of them must not hit if that is said; returns how many there are.
    pub(crate) fn take(&mut self, rays: &[Ray], excluded: &[u32]) {
        let mut starts = [0_u16; BINS + 1];
        for (ray, bin) in rays.iter().zip(&mut self.bins) {
            *bin = bin_of(ray);
            starts[usize::from(*bin) + 1] += 1;
        }
        for bin in 0..BINS {
            starts[bin + 1] += starts[bin];
        }
        for (i, (ray, &bin)) in rays.iter().zip(&self.bins).enumerate() {
            let place = usize::from(starts[usize::from(bin)]);
            starts[usize::from(bin)] += 1;
            (self.rays[place], self.order[place]) = (*ray, i as u16);
            if let Some(&excluded) = excluded.get(i) {
                self.excluded[place] = excluded;
            }
        }
    }

    /// Puts what belongs to the rays in order where they came from.
    pub(crate) fn give<T: Copy>(&self, sorted: &[T], to: &mut [T]) {
        for (&one, &i) in sorted.iter().zip(&self.order[..to.len()]) {
            to[usize::from(i)] = one;
        }
    }
}

fn bin_of(ray: &Ray) -> u8 {
    let octant = ray.direction.to_array().iter().rev().fold(0, |octant, d| octant << 1 | u8::from(*d < 0.0));
    octant * 3 + shear_axes(ray.direction)[2] as u8
}

/// The order in which the slots of a node go on the stack, as [`BlockNode::orders`] has it.
#[inline(always)]
pub(crate) fn order<const ANY: bool>(node: &BlockNode, octant: usize) -> u32 {
    if ANY { 0o7654_3210 } else { node.orders()[octant & 7] }
}
