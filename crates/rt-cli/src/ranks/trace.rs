//! `raybalance trace` by several processes: each traces ranges of the rays, rank 0 gathers and writes the hits.

use super::{Ranks, explained, print, warn};
use crate::interrupt;
use anyhow::Result;
use rt_balance::report::StreamRun;
use rt_balance::{BalanceError, Balancer, Scheduling, Stream};
use rt_bvh::Stack;
use rt_cluster::{ClusterReport, Deal, Finished, Job, deal};
use rt_core::{Hit, Ray, RaySource, Scene, StreamKind, StreamSpec, TestCounts};
use rt_render::TaskCut;
use rt_render::tiles::hash_tree;
use std::hash::{DefaultHasher, Hasher};
use std::io;
use std::ops::Range;

/// Ranges of each process, where there are enough rays.
const PER_RANK: u32 = 64;

/// Least rays of a range.
const LEAST_RAYS: u32 = 1 << 14;

/// Rays of a range that are walked for its price.
const SAMPLES: usize = 16;

/// What is traced, and by which devices.
pub(crate) struct RayRanges<'a> {
    pub(crate) rays: &'a [Ray],
    pub(crate) scene: &'a Scene,
    pub(crate) spec: StreamSpec,
    pub(crate) seed: u32,
    pub(crate) cut: TaskCut,
    pub(crate) balancer: &'a mut Balancer,
    pub(crate) scheduling: &'a mut Scheduling,
    pub(crate) runs: &'a mut Vec<StreamRun>,
    pub(crate) ranges: u32,
}

impl RayRanges<'_> {
    /// How many ranges `rays` rays are cut into.
    pub(crate) fn count(rays: u32, ranks: u32) -> u32 {
        (rays / LEAST_RAYS).clamp(1, PER_RANK * ranks)
    }

    fn range(&self, number: u32) -> Range<usize> {
        range(self.rays.len(), self.ranges, number)
    }

    /// Of what must be the same on all ranks.
    fn fingerprint(&self) -> u64 {
        let mut hash = DefaultHasher::new();
        hash.write(env!("CARGO_PKG_VERSION").as_bytes());
        hash_tree(self.scene, &mut hash);
        hash.write(bytemuck::cast_slice(self.rays));
        hash.write(format!("{:?} {}", self.spec, self.ranges).as_bytes());
        hash.finish()
    }
}

/// Ranges differ by at most one ray.
fn range(rays: usize, ranges: u32, number: u32) -> Range<usize> {
    let start = |number: u32| (rays as u64 * u64::from(number) / u64::from(ranges)) as usize;
    start(number)..start(number + 1)
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
        self.runs.push(self.balancer.trace(&stream, self.scheduling, &mut hits, wanted, interrupt::control())?);
        Ok([bytemuck::cast_slice(&hits), bytemuck::cast_slice::<_, u8>(&counts)].concat())
    }
}

/// Traces this process's part. On rank 0 `hits` and `counts` are all there afterwards; whether all processes are there
/// still, and there what was done by whom.
pub(crate) fn run(
    mut job: RayRanges<'_>,
    ranks: &mut Ranks,
    hits: &mut [Hit],
    mut counts: Option<&mut [TestCounts]>,
) -> Result<(bool, Option<ClusterReport>)> {
    let (rays, ranges) = (job.rays.len(), job.ranges);
    let about = Deal { cancel: Some(interrupt::flag()), ..Deal::new(ranges, job.fingerprint()) };
    let mut take = |Finished { tile, bytes, .. }: Finished<'_>| {
        let range = range(rays, ranges, tile);
        let of_hits = range.len() * size_of::<Hit>();
        let of_counts = counts.as_ref().map_or(0, |_| range.len() * size_of::<TestCounts>());
        if bytes.len() != of_hits + of_counts {
            return Err(io::Error::other(format!("range {tile} came with {} bytes", bytes.len())));
        }
        let (front, back) = bytes.split_at(of_hits);
        bytemuck::cast_slice_mut(&mut hits[range.clone()]).copy_from_slice(front);
        if let Some(counts) = &mut counts {
            bytemuck::cast_slice_mut(&mut counts[range]).copy_from_slice(back);
        }
        Ok(())
    };
    let dealt = deal(&mut *ranks.transport(), &about, &mut job, &mut take).map_err(explained)?;
    Ok((dealt.is_complete, dealt.report))
}

/// What each rank did, for people.
pub(crate) fn tell(report: &ClusterReport, as_json: bool) -> Result<()> {
    warn(report);
    if as_json { Ok(()) } else { print(std::slice::from_ref(report)) }
}
