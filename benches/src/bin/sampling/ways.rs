//! The ways to walk a sample.

use super::LIMIT;
use rt_bvh::Stack;
use rt_core::{
    Hit, Launch, Ray, RayMask, RaySource, Scene, Span, StreamKind, StreamSpec, Task, TestCounts, Tracer, Walk,
};
use rt_sched::sample::{Fraction, RaySampler};
use std::error::Error;
use std::hint::black_box;
use std::sync::Arc;

/// Rays of a packet on processors.
const PACKET: u32 = 16;

/// How a sample is walked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// Scattered rays, each on its own over the two-wide tree: single rays on this thread. Processors only.
    Alone,
    /// Scattered rays, gathered into packets, or one to each lane of a graphics card.
    Compacted,
    /// As many rays in whole packets of consecutive ones: few places, each with all its neighbours.
    WholePackets,
    /// Scattered rays, each in the packet of its neighbours in the stream, whose lanes stay empty.
    MaskedLanes,
    /// A launch of all rays with a mask of those that are done: all but the sample. It counts nothing, but brings hits.
    MaskedLaunch,
}

impl Way {
    pub(crate) const ALL: [(Self, &str); 5] = [
        (Self::Alone, "single rays"),
        (Self::Compacted, "compacted"),
        (Self::WholePackets, "whole packets"),
        (Self::MaskedLanes, "masked lanes"),
        (Self::MaskedLaunch, "launch with mask"),
    ];
}

/// A sample, in each form that a way needs.
#[derive(Debug)]
pub(crate) struct Sample {
    pub(crate) scattered: Vec<u32>,
    pub(crate) packets: Vec<u32>,
    /// All rays, of which only the scattered ones are valid.
    masked: RaySource,
    every: Vec<u32>,
    done: Arc<RayMask>,
}

impl Sample {
    pub(crate) fn new(source: &RaySource, kind: StreamKind, tasks: &[Task], fraction: Fraction, seed: u32) -> Self {
        let (mut scattered, mut packets) = (Vec::new(), Vec::new());
        for &task in tasks {
            RaySampler::for_kind(kind).sample(task, fraction, seed, &mut scattered);
            whole_packets(task, fraction, seed, &mut packets);
        }
        let every: Vec<u32> = (0..source.len()).collect();
        let mut done = RayMask::new(source.len());
        let mut chosen = scattered.iter().copied().peekable();
        let (mut rays, mut origins) = (Vec::new(), Vec::new());
        for &index in &every {
            let (ray, origin) = source.ray(index);
            if chosen.next_if_eq(&index).is_some() {
                rays.push(ray);
            } else {
                done.insert(index);
                // Misses at once: its limits are in the wrong order.
                rays.push(Ray::with_range(ray, 1.0, 0.0));
            }
            origins.push(origin);
        }
        let masked = RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) };
        Self { scattered, packets, masked, every, done: Arc::new(done) }
    }
}

/// Appends packets of consecutive rays of a task, equally spaced from a random start: as many rays as other samplers
/// take.
fn whole_packets(task: Task, fraction: Fraction, seed: u32, out: &mut Vec<u32>) {
    let count = fraction.of(task.rays);
    let (all, chosen) = (task.rays.div_ceil(PACKET), count.div_ceil(PACKET));
    let places = Task { first: 0, rays: all };
    let (mut starts, share) = (Vec::new(), f64::from(chosen) / f64::from(all));
    let Some(share) = Fraction::new(share) else { return };
    RaySampler::Strided.sample(places, share, seed ^ task.first, &mut starts);
    let rays = starts.iter().flat_map(|start| start * PACKET..(start + 1) * PACKET);
    out.extend(rays.filter(|&ray| ray < task.rays).take(count as usize).map(|ray| task.first + ray));
}

/// A device with its scene, that times itself: processors by their own time, so that other programs count little, other
/// devices by their time in kernels.
pub(crate) struct Subject {
    pub(crate) scene: Arc<Scene>,
    pub(crate) tracer: Box<dyn Tracer>,
    pub(crate) is_processor: bool,
}

impl Subject {
    /// Seconds for a launch of all rays but the ones done.
    pub(crate) fn trace(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<f64, Box<dyn Error>> {
        let mut launch = Launch::default();
        let tracer = &mut self.tracer;
        timed(self.is_processor, || {
            let ticket = tracer.submit(tasks, done)?;
            tracer.wait(ticket, LIMIT, &mut launch)?;
            Ok(launch.span)
        })
    }

    /// Seconds for some rays as single ones on this thread.
    pub(crate) fn trace_alone(
        &self,
        source: &RaySource,
        rays: impl Iterator<Item = u32>,
        spec: StreamSpec,
    ) -> Result<f64, Box<dyn Error>> {
        let mut stack = Stack::for_scene(&self.scene);
        let rays = rays.map(|ray| source.ray(ray));
        timed(true, || {
            rt_bvh::trace(&self.scene, &mut stack, spec, rays, |hit, counts| {
                black_box((hit, counts));
            });
            Ok(Span::default())
        })
    }

    /// Seconds for a walk of some rays with counts, hits kept.
    pub(crate) fn walk(&mut self, rays: &[u32], walk: Walk) -> Result<f64, Box<dyn Error>> {
        let (mut counts, mut hits) = (vec![TestCounts::default(); rays.len()], vec![Hit::MISS; rays.len()]);
        let tracer = &mut self.tracer;
        timed(self.is_processor, || Ok(tracer.walk(rays, walk, &mut counts, Some(&mut hits))?))
    }

    /// Seconds and rays of one way to walk a sample of the loaded rays; `None` where the device lacks the way. The
    /// stream is loaded again if need be.
    pub(crate) fn run(
        &mut self,
        way: Way,
        sample: &Sample,
        source: &RaySource,
        tasks: &[Task],
    ) -> Result<Option<(f64, usize)>, Box<dyn Error>> {
        let spec = StreamSpec::default();
        let seconds = match way {
            Way::Alone if !self.is_processor => return Ok(None),
            Way::Alone => {
                let spec = StreamSpec { counts: true, ..spec };
                self.trace_alone(source, sample.scattered.iter().copied(), spec)?
            }
            Way::Compacted => self.walk(&sample.scattered, Walk::Full)?,
            Way::WholePackets => self.walk(&sample.packets, Walk::Full)?,
            Way::MaskedLanes => {
                self.tracer.load_rays(sample.masked.clone(), spec)?;
                let seconds = self.walk(&sample.every, Walk::Full);
                self.tracer.load_rays(source.clone(), spec)?;
                seconds?
            }
            Way::MaskedLaunch => self.trace(tasks, Some(&sample.done))?,
        };
        let rays = if way == Way::WholePackets { sample.packets.len() } else { sample.scattered.len() };
        Ok(Some((seconds, rays)))
    }
}

/// Processor time of the process for `work`, or the time in kernels that it tells.
fn timed(is_processor: bool, work: impl FnOnce() -> Result<Span, Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let begin = processor_s();
    let span = work()?;
    Ok(if is_processor { processor_s() - begin } else { span.in_kernel.as_secs_f64() })
}

/// Seconds for which this process has kept processors busy.
#[cfg(unix)]
fn processor_s() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

#[cfg(not(unix))]
fn processor_s() -> f64 {
    rt_balance::clock().as_secs_f64()
}
