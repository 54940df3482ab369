//! Rays of the caller's own dealt to several processes: each traces ranges of them, and one gathers the hits.

use crate::TaskCut;
use crate::tiles::hash_tree;
use rt_balance::report::StreamRun;
use rt_balance::{BalanceError, Balancer, Control, Scheduling, Stream};
use rt_bvh::Stack;
use rt_cluster::{Finished, Job};
use rt_core::{Hit, Ray, RaySource, Scene, StreamKind, StreamSpec, TestCounts};
use std::fmt;
use std::hash::{DefaultHasher, Hasher};
use std::io;
use std::ops::Range;

/// Ranges of each process, where there are enough rays.
const PER_RANK: u32 = 64;

/// Least rays of a range.
const LEAST_RAYS: u32 = 1 << 14;

/// Rays of a range that are walked for its price.
const SAMPLES: usize = 16;

/// What is traced, and by which devices of this process.
pub struct RayRanges<'a> {
    /// All rays, the same on every process.
    pub rays: &'a [Ray],
    /// What they are traced through.
    pub scene: &'a Scene,
    /// What is asked of each.
    pub spec: StreamSpec,
    /// Seed of the estimator's samples.
    pub seed: u32,
    /// How ranges are cut into tasks.
    pub cut: TaskCut,
    /// The devices.
    pub balancer: &'a mut Balancer,
    /// How ranges are scheduled.
    pub scheduling: &'a mut Scheduling,
    /// What was recorded of the ranges traced here.
    pub runs: &'a mut Vec<StreamRun>,
    /// What stops a range.
    pub control: Control<'a>,
    /// How many ranges there are ([`RayRanges::count`]).
    pub ranges: u32,
}

impl fmt::Debug for RayRanges<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RayRanges").field("rays", &self.rays.len()).field("ranges", &self.ranges).finish()
    }
}

impl RayRanges<'_> {
    /// How many ranges `rays` rays are cut into for `ranks` processes.
    #[must_use]
    pub fn count(rays: u32, ranks: u32) -> u32 {
        (rays / LEAST_RAYS).clamp(1, PER_RANK * ranks)
    }

    /// Of what must be the same on all processes.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let mut hash = DefaultHasher::new();
        hash.write(env!("CARGO_PKG_VERSION").as_bytes());
        hash_tree(self.scene, &mut hash);
        hash.write(bytemuck::cast_slice(self.rays));
        hash.write(format!("{:?} {}", self.spec, self.ranges).as_bytes());
        hash.finish()
    }

    fn range(&self, number: u32) -> Range<usize> {
        range(self.rays.len(), self.ranges, number)
    }
}

/// Ranges differ by at most one ray.
fn range(rays: usize, ranges: u32, number: u32) -> Range<usize> {
    let start = |number: u32| (rays as u64 * u64::from(number) / u64::from(ranges)) as usize;
    start(number)..start(number + 1)
}

/// Puts a finished range, one of `ranges`, where it belongs among all hits, and counts if there are any.
///
/// # Errors
/// When it has other bytes than it should.
pub fn gather(
    finished: Finished<'_>,
    ranges: u32,
    hits: &mut [Hit],
    counts: Option<&mut [TestCounts]>,
) -> io::Result<()> {
    let Finished { tile, bytes, .. } = finished;
    let range = range(hits.len(), ranges, tile);
    let of_hits = range.len() * size_of::<Hit>();
    let of_counts = counts.as_ref().map_or(0, |_| range.len() * size_of::<TestCounts>());
    if bytes.len() != of_hits + of_counts {
        return Err(io::Error::other(format!("range {tile} came with {} bytes", bytes.len())));
    }
    let (front, back) = bytes.split_at(of_hits);
    bytemuck::cast_slice_mut(&mut hits[range.clone()]).copy_from_slice(front);
    if let Some(counts) = counts {
        bytemuck::cast_slice_mut(&mut counts[range]).copy_from_slice(back);
    }
    Ok(())
}

impl Job for RayRanges<'_> {
    type Error = BalanceError;

    fn price(&mut self, tile: u32) -> f32 {
        let rays = &self.rays[self.range(tile)];
        let step = rays.len().div_ceil(SAMPLES).max(1);
        let picked = rays.iter().step_by(step).map(|&ray| (ray, u32::MAX));
        let spec = StreamSpec { counts: true, ..self.spec };
        let mut tests = 0_u64;
        rt_bvh::trace(self.scene, &mut Stack::for_scene(self.scene), spec, picked, |_, counts| {
            tests += u64::from(counts.boxes) + u64::from(counts.triangles);
        });
        tests as f32 * step as f32
    }

    fn compute(&mut self, tile: u32) -> Result<Vec<u8>, BalanceError> {
        let rays = &self.rays[self.range(tile)];
        let source = RaySource::Explicit { rays: rays.into(), origins: None };
        let devices = self.balancer.devices().count();
        let stream = self.cut.of(Stream::new(source, StreamKind::Custom, self.spec), devices);
        let stream = Stream { seed: self.seed, wave: tile, ..stream };
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut counts = vec![TestCounts::default(); if self.spec.counts { rays.len() } else { 0 }];
        let wanted = self.spec.counts.then_some(&mut counts[..]);
        self.runs.push(self.balancer.trace(&stream, self.scheduling, &mut hits, wanted, self.control)?);
        Ok([bytemuck::cast_slice(&hits), bytemuck::cast_slice::<_, u8>(&counts)].concat())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: ranges that overlap or leave rays out; counts written where hits belong; a wrong length let through.
    #[test]
    fn ranges_cover_all_rays_and_land_in_their_places() {
        for (rays, ranges) in [(0, 1), (1, 1), (10, 3), (1 << 20, 64), (1000, 999)] {
            let ends: Vec<Range<usize>> = (0..ranges).map(|number| range(rays, ranges, number)).collect();
            assert!(ends[0].start == 0 && ends.last().unwrap().end == rays);
            assert!(ends.windows(2).all(|pair| pair[0].end == pair[1].start && pair[1].len() <= pair[0].len() + 1));
        }
        let (mut hits, mut counts) = (vec![Hit::MISS; 10], vec![TestCounts::default(); 10]);
        let found = [Hit { primitive: 7, ..Hit::MISS }; 3];
        let of = [TestCounts { boxes: 5, triangles: 6 }; 3];
        let bytes = [bytemuck::cast_slice(&found), bytemuck::cast_slice::<_, u8>(&of)].concat();
        let finished = |bytes| Finished { tile: 1, seconds: 1.0, bytes };
        gather(finished(&bytes), 3, &mut hits, Some(&mut counts)).unwrap();
        assert!((0..10).all(|i| (hits[i].primitive == 7) == (3..6).contains(&i)));
        assert!((0..10).all(|i| (counts[i].boxes == 5) == (3..6).contains(&i)));
        assert!(gather(finished(&bytes), 3, &mut hits, None).is_err());
    }
}
