//! Measuring one device on one scene.

use super::streams::Rays;
use crate::Lab;
use anyhow::{Context, Result};
use rt_balance::clock;
use rt_balance::devices::Opened;
use rt_core::{
    DeviceError, Launch, Precision, ReducedWalk, Scene, Span, StreamSpec, Task, TestCounts, Tracer, Traffic, Walk,
    tasks_of,
};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

/// The longest that a launch may take.
const LIMIT: Duration = Duration::from_secs(600);

/// Launches that are sent one behind the other to see what is between them.
pub(crate) const QUEUED: u32 = 8;

/// What is timed beside full traversal, which comes first in every repetition.
pub(crate) const WALKS: [(&str, Walk); 3] = [
    ("exact_counts", Walk::Full),
    ("leaf_as_hit", Walk::Reduced(ReducedWalk::LeafAsHit)),
    ("unshortened", Walk::Reduced(ReducedWalk::Unshortened)),
];

/// One device and one scene.
pub(crate) struct Bench<'a> {
    pub(crate) lab: Lab<'a>,
    pub(crate) named: &'a Opened,
    pub(crate) tree: Arc<Scene>,
    pub(crate) precision: Precision,
    pub(crate) repeat: u32,
}

/// What was measured on the scene.
#[derive(Debug)]
pub(crate) struct Measured {
    /// Seconds until the scene was on the device.
    pub(crate) scene_upload_s: f64,
    pub(crate) kinds: Vec<Samples>,
}

/// What was measured of one kind of rays: one entry for each repetition, seconds.
#[derive(Debug, Default)]
pub(crate) struct Samples {
    pub(crate) kind: &'static str,
    pub(crate) rays: u32,
    /// In kernels of full traversal, all rays in one launch.
    pub(crate) full_s: Vec<f64>,
    /// In kernels of each of [`WALKS`]; none of a walk that the device does not have.
    pub(crate) walks_s: [Vec<f64>; 3],
    /// From the submission of that launch until its hits are on the host.
    pub(crate) whole_s: Vec<f64>,
    /// Between kernels of [`QUEUED`] launches, for each of them, while as many as the device takes are in flight.
    pub(crate) gap_s: Vec<f64>,
    /// Share of these launches' time spent inside kernels.
    pub(crate) kernel_share: Vec<f64>,
    /// Preparing the rays and copying them to the device.
    pub(crate) upload_s: Vec<f64>,
    /// After the kernel of the one launch: copying hits back, what the host makes of them, the hand-over.
    pub(crate) read_back_s: Vec<f64>,
    /// Bytes of one upload.
    pub(crate) uploaded: u64,
    /// Bytes copied back of one launch.
    pub(crate) downloaded: u64,
    /// Rays of that launch that the host traced.
    pub(crate) on_host: u64,
}

impl Bench<'_> {
    pub(crate) fn run(&self, streams: &[Rays]) -> Result<Measured> {
        let begin = clock();
        let tracer = self.named.device.tracer(Arc::clone(&self.tree), clock);
        let mut tracer = tracer.with_context(|| format!("{} cannot take the scene", self.named.entry))?;
        let scene_upload_s = (clock() - begin).as_secs_f64();
        let mut kinds = Vec::new();
        for rays in streams {
            let mut samples = Samples { kind: rays.kind, rays: rays.source.len(), ..Samples::default() };
            // The first one compiles kernels and fills caches.
            for repetition in 0..=self.repeat {
                self.lab.go_on()?;
                if repetition == 1 {
                    samples = Samples { kind: samples.kind, rays: samples.rays, ..Samples::default() };
                }
                self.repetition(&mut *tracer, rays, &mut samples)
                    .with_context(|| format!("{}, {} rays", self.named.entry, rays.kind))?;
            }
            kinds.push(samples);
        }
        Ok(Measured { scene_upload_s, kinds })
    }

    /// Everything once, one after the other, so that a drift of the machine's speed is in all of it.
    fn repetition(&self, tracer: &mut dyn Tracer, rays: &Rays, samples: &mut Samples) -> Result<(), DeviceError> {
        let spec = StreamSpec::new(rays.query, self.precision, false);
        let before = tracer.traffic();
        let begin = clock();
        tracer.load_rays(rays.source.clone(), spec)?;
        samples.upload_s.push((clock() - begin).as_secs_f64());
        let mut launch = Launch::default();
        // The first launch may make the rays: what it takes more than the second belongs to the upload.
        let first = self.launch(tracer, samples.rays, &mut launch)?;
        let first_s = launch.span.duration();
        let second = self.launch(tracer, samples.rays, &mut launch)?;
        samples.uploaded = tracer.traffic().since(&before).uploaded - 2 * second.uploaded;
        if first.uploaded > second.uploaded {
            let made_s = first_s.saturating_sub(launch.span.duration()).as_secs_f64();
            samples.upload_s.iter_mut().last().into_iter().for_each(|seconds| *seconds += made_s);
        }
        (samples.downloaded, samples.on_host) = (second.downloaded, second.on_host);
        samples.full_s.push(launch.span.busy().as_secs_f64());
        samples.whole_s.push(launch.span.duration().as_secs_f64());
        samples.read_back_s.push((launch.span.duration().as_secs_f64() - launch.span.busy().as_secs_f64()).max(0.0));

        let all: Vec<u32> = (0..samples.rays).collect();
        let mut counts = vec![TestCounts::default(); all.len()];
        let capabilities = self.named.device.info().capabilities;
        let walks = WALKS.iter().zip(&mut samples.walks_s).filter(|((_, walk), _)| capabilities.has_walk(*walk));
        for ((_, walk), seconds) in walks {
            seconds.push(tracer.walk(&all, *walk, &mut counts, None)?.busy().as_secs_f64());
        }

        let spans = self.queued(tracer, samples.rays, &mut launch)?;
        let busy = busy_s(&spans);
        let kernels: f64 = spans.iter().map(|span| span.busy().as_secs_f64()).sum();
        samples.gap_s.push((busy - kernels).max(0.0) / spans.len().max(1) as f64);
        samples.kernel_share.push((kernels / busy).min(1.0));
        Ok(())
    }

    /// All rays in one launch; returns what crossed the bus.
    fn launch(&self, tracer: &mut dyn Tracer, rays: u32, launch: &mut Launch) -> Result<Traffic, DeviceError> {
        let before = tracer.traffic();
        let ticket = tracer.submit(&tasks_of(rays, u32::MAX), None)?;
        tracer.wait(ticket, LIMIT, launch)?;
        Ok(tracer.traffic().since(&before))
    }

    /// All rays in [`QUEUED`] launches, with as many in flight as the device takes.
    fn queued(&self, tracer: &mut dyn Tracer, rays: u32, launch: &mut Launch) -> Result<Vec<Span>, DeviceError> {
        let tasks: Vec<Task> = tasks_of(rays, rays.div_ceil(QUEUED));
        let most = self.named.device.info().in_flight.max(1) as usize;
        let (mut in_flight, mut spans) = (VecDeque::new(), Vec::new());
        let mut left = tasks.iter();
        loop {
            while in_flight.len() < most
                && let Some(task) = left.next()
            {
                in_flight.push_back(tracer.submit(std::slice::from_ref(task), None)?);
            }
            let Some(ticket) = in_flight.pop_front() else { return Ok(spans) };
            tracer.wait(ticket, LIMIT, launch)?;
            spans.push(launch.span);
        }
    }
}

/// From the first start to the last end: the launches follow each other without a pause of ours.
fn busy_s(spans: &[Span]) -> f64 {
    let start = spans.iter().map(|span| span.start).min().unwrap_or_default();
    let end = spans.iter().map(|span| span.end).max().unwrap_or_default();
    end.saturating_sub(start).as_secs_f64()
}
