//! One scene on one Vulkan device.

use crate::buffer::Buffer;
use crate::device::{IN_FLIGHT, Shared};
use crate::error::invalid;
use crate::launch::Slot;
use crate::resident::{Resident, Uploader, upload_rays};
use crate::timeline::Timeline;
use rt_bvh::Stack;
use rt_bvh::offload::Offload;
use rt_core::{
    Clock, DeviceError, DeviceErrorKind, Hit, Launch, Query, RayMask, RaySource, ReducedWalk, Scene, Span, StreamSpec,
    Task, TestCounts, Ticket, Tracer, Walk,
};
use rt_shaders::{DOUBTFUL, MISS, Purpose};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The longest a walk may take. The trait gives none; a walk is a sample of a stream, so minutes mean a hang.
const WALK_LIMIT: Duration = Duration::from_secs(600);

/// How long dropping a tracer waits for launches in flight. What is not done then is never freed.
const DROP_LIMIT: Duration = Duration::from_secs(10);

/// A scene resident on a Vulkan device.
#[derive(Debug)]
pub(crate) struct VulkanTracer {
    shared: Arc<Shared>,
    scene: Arc<Scene>,
    clock: Clock,
    source: RaySource,
    spec: StreamSpec,
    pending: VecDeque<Pending>,
    /// Launches whose results are on the host because a later one was asked for first.
    finished: Vec<(Ticket, Launch)>,
    next_ticket: u64,
    stack: Stack,
    /// Taken only when the tracer is dropped.
    gpu: Option<Gpu>,
}

/// What the device holds for the tracer.
#[derive(Debug)]
struct Gpu {
    timeline: Timeline,
    uploader: Uploader,
    resident: Resident,
    rays: Option<Buffer>,
    /// One for each launch that may be in flight, and one for walks.
    slots: Vec<Slot>,
    /// Those that are not in use.
    free: Vec<usize>,
}

/// A launch in flight.
#[derive(Debug)]
struct Pending {
    ticket: Ticket,
    /// The slot and the timeline's value; `None` where there was nothing to trace.
    running: Option<(usize, u64)>,
    /// The rays traced.
    items: Vec<u32>,
    /// For each item, its place among the launch's hits; empty where that is the item's own.
    places: Vec<u32>,
    /// Number of the launch's hits.
    total: usize,
    start: Duration,
}

impl VulkanTracer {
    pub(crate) fn new(shared: Arc<Shared>, scene: Arc<Scene>, clock: Clock) -> Result<Self, DeviceError> {
        let logical = &shared.logical;
        let mut timeline = Timeline::new(logical)?;
        let mut uploader = Uploader::new(logical)?;
        let resident = Resident::new(logical, &mut uploader, &mut timeline, &scene)?;
        let slots = (0..=IN_FLIGHT).map(|_| Slot::new(logical, shared.layout())).collect::<Result<Vec<_>, _>>()?;
        let free = (0..slots.len()).collect();
        let gpu = Gpu { timeline, uploader, resident, rays: None, slots, free };
        Ok(Self {
            stack: Stack::for_scene(&scene),
            shared,
            scene,
            clock,
            source: RaySource::Explicit { rays: Arc::new([]), origins: None },
            spec: StreamSpec::default(),
            pending: VecDeque::new(),
            finished: Vec::new(),
            next_ticket: 0,
            gpu: Some(gpu),
        })
    }

    /// Starts a kernel over `items`; `None` if there are none.
    fn start(&mut self, purpose: Purpose, counted: bool, items: &[u32]) -> Result<Option<(usize, u64)>, DeviceError> {
        if items.is_empty() {
            return Ok(None);
        }
        let pipeline = self.shared.pipeline(purpose, self.scene.depth())?;
        let Gpu { timeline, resident, rays, slots, free, .. } = self.gpu.as_mut().ok_or_else(lost)?;
        let (Some(rays), Some(&index)) = (rays, free.last()) else {
            return Err(invalid("no rays are loaded".to_owned()));
        };
        let value = slots[index].start(resident, rays, pipeline, items, counted, timeline)?;
        free.pop();
        Ok(Some((index, value)))
    }

    /// Waits for a kernel, fills `hits` (and `counts`, if not empty) for its items, and returns the time in it.
    fn finish(
        &mut self,
        running: Option<(usize, u64)>,
        items: &[u32],
        limit: Duration,
        how: How,
        mut out: impl FnMut(usize, Hit, TestCounts),
    ) -> Result<Duration, DeviceError> {
        let Some((index, value)) = running else {
            return Ok(Duration::ZERO);
        };
        let gpu = self.gpu.as_mut().ok_or_else(lost)?;
        gpu.timeline.wait(value, limit)?;
        self.shared.logical.check_validation()?;
        gpu.free.push(index);
        let slot = &gpu.slots[index];
        let found = slot.found(items.len());
        let counts = if how.counted() { slot.counts(items.len()) } else { &[] };
        let offload = Offload::new(&self.scene);
        let mut doubtful = Vec::new();
        for (i, (&item, &slot)) in items.iter().zip(found).enumerate() {
            let hit = match slot {
                DOUBTFUL => {
                    doubtful.push(i);
                    continue;
                }
                MISS => Hit::MISS,
                slot => offload.finish(&self.source.ray(item).0, slot).ok_or_else(|| {
                    let what = format!("the Vulkan device's hit of ray {item} with triangle {slot} is none");
                    DeviceError::new(DeviceErrorKind::Lost, what)
                })?,
            };
            out(i, hit, counts.get(i).copied().unwrap_or_default());
        }
        let mut places = doubtful.iter().copied();
        let rays = doubtful.iter().map(|&i| self.source.ray(items[i]));
        let sink = |hit, counts| {
            if let Some(i) = places.next() {
                out(i, hit, counts);
            }
        };
        match how {
            How::Trace(spec) => rt_bvh::trace(&self.scene, &mut self.stack, spec, rays, sink),
            How::Reduced(kind) => {
                let walk = Walk::Reduced(kind);
                rt_bvh::count(&self.scene, &mut self.stack, walk, self.spec.precision, rays, sink);
            }
        }
        self.shared.traced(items.len(), doubtful.len());
        Ok(slot.in_kernel().unwrap_or_default())
    }

    /// Brings the oldest launch's results to the host.
    fn collect(&mut self, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let Some(pending) = self.pending.pop_front() else {
            return Err(lost());
        };
        let Pending { running, items, places, total, start, .. } = pending;
        out.clear();
        out.hits.resize(total, Hit::MISS);
        out.counts.resize(if self.spec.counts { total } else { 0 }, TestCounts::default());
        let Launch { hits, counts, .. } = &mut *out;
        let how = How::Trace(self.spec);
        let in_kernel = self.finish(running, &items, limit, how, |i, hit, count| {
            let place = places.get(i).map_or(i, |&place| place as usize);
            hits[place] = hit;
            if let Some(slot) = counts.get_mut(place) {
                *slot = count;
            }
        })?;
        let end = (self.clock)();
        out.span = Span { start, end, in_kernel: in_kernel.min(end.saturating_sub(start)) };
        Ok(())
    }
}

/// What was asked of the rays of a kernel.
#[derive(Clone, Copy, Debug)]
enum How {
    Trace(StreamSpec),
    Reduced(ReducedWalk),
}

impl How {
    const fn counted(self) -> bool {
        match self {
            Self::Trace(spec) => spec.counts,
            Self::Reduced(_) => true,
        }
    }

    const fn purpose(self) -> Purpose {
        match self {
            Self::Trace(StreamSpec { query: Query::Closest, counts: false, .. }) => Purpose::Closest,
            Self::Trace(StreamSpec { query: Query::Closest, counts: true, .. }) => Purpose::ClosestCounted,
            Self::Trace(StreamSpec { query: Query::Any, counts: false, .. }) => Purpose::Any,
            Self::Trace(StreamSpec { query: Query::Any, counts: true, .. }) => Purpose::AnyCounted,
            Self::Reduced(ReducedWalk::LeafAsHit) => Purpose::LeafAsHit,
            Self::Reduced(ReducedWalk::Unshortened) => Purpose::Unshortened,
        }
    }
}

fn lost() -> DeviceError {
    DeviceError::new(DeviceErrorKind::Lost, "the Vulkan tracer was lost in an earlier call")
}

impl Tracer for VulkanTracer {
    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        let open = self.pending.len() + self.finished.len();
        if open > 0 {
            return Err(invalid(format!("load_rays: {open} launches are in flight: wait for them")));
        }
        if let RaySource::Explicit { rays, origins: Some(origins) } = &source
            && rays.len() != origins.len()
        {
            return Err(invalid(format!("load_rays: {} rays but {} origins", rays.len(), origins.len())));
        }
        let gpu = self.gpu.as_mut().ok_or_else(lost)?;
        // First, so that there need not be room for both.
        gpu.rays = None;
        self.source = RaySource::Explicit { rays: Arc::new([]), origins: None };
        let Gpu { timeline, uploader, rays, .. } = gpu;
        *rays = Some(upload_rays(&self.shared.logical, uploader, timeline, &self.scene, &source)?);
        self.shared.logical.check_validation()?;
        (self.source, self.spec) = (source, spec);
        Ok(())
    }

    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        let lengths_agree = counts.len() == rays.len() && hits.as_ref().is_none_or(|h| h.len() == rays.len());
        if !lengths_agree {
            return Err(invalid(format!("walk: {} rays need as many counts and hits", rays.len())));
        }
        let loaded = self.source.len();
        if let Some(bad) = rays.iter().find(|&&ray| ray >= loaded) {
            return Err(invalid(format!("walk: ray {bad} of {loaded}")));
        }
        let how = match walk {
            // The stream's own query: an any-hit stream costs what its any-hit kernel costs.
            Walk::Full => How::Trace(StreamSpec { counts: true, ..self.spec }),
            Walk::Reduced(kind) => How::Reduced(kind),
        };
        let start = (self.clock)();
        let running = self.start(how.purpose(), true, rays)?;
        let hits = hits.unwrap_or_default();
        let in_kernel = self.finish(running, rays, WALK_LIMIT, how, |i, hit, count| {
            counts[i] = count;
            if let Some(slot) = hits.get_mut(i) {
                *slot = hit;
            }
        })?;
        let end = (self.clock)();
        Ok(Span { start, end, in_kernel: in_kernel.min(end.saturating_sub(start)) })
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        if self.pending.len() + self.finished.len() >= IN_FLIGHT as usize {
            return Err(invalid(format!("submit: {IN_FLIGHT} launches are in flight already: wait for one")));
        }
        let loaded = self.source.len();
        let outside = |task: &&Task| u64::from(task.first) + u64::from(task.rays) > u64::from(loaded);
        if let Some(task) = tasks.iter().find(outside) {
            return Err(invalid(format!(
                "submit: a task of {} rays from ray {} does not fit into {loaded} loaded rays",
                task.rays, task.first
            )));
        }
        let start = (self.clock)();
        let total: usize = tasks.iter().map(|task| task.rays as usize).sum();
        let all = tasks.iter().flat_map(Task::range);
        let (mut items, mut places) = (Vec::with_capacity(total), Vec::new());
        match done {
            None => items.extend(all),
            Some(mask) => {
                for (place, ray) in (0..).zip(all) {
                    if !mask.contains(ray) {
                        items.push(ray);
                        places.push(place);
                    }
                }
            }
        }
        let running = self.start(How::Trace(self.spec).purpose(), self.spec.counts, &items)?;
        let ticket = Ticket(self.next_ticket);
        self.next_ticket += 1;
        self.pending.push_back(Pending { ticket, running, items, places, total, start });
        Ok(ticket)
    }

    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        let begin = Instant::now();
        if let Some(position) = self.finished.iter().position(|(t, _)| *t == ticket) {
            *out = self.finished.swap_remove(position).1;
            return Ok(());
        }
        if !self.pending.iter().any(|pending| pending.ticket == ticket) {
            return Err(invalid(format!("wait: launch {} is not in flight", ticket.0)));
        }
        // Launches end in order, so earlier ones are taken to the host first.
        while let Some(oldest) = self.pending.front().map(|pending| pending.ticket) {
            let left = limit.saturating_sub(begin.elapsed());
            if oldest == ticket {
                return self.collect(left, out);
            }
            let mut launch = Launch::default();
            self.collect(left, &mut launch)?;
            self.finished.push((oldest, launch));
        }
        Err(lost())
    }
}

impl Drop for VulkanTracer {
    fn drop(&mut self) {
        if let Some(gpu) = self.gpu.take()
            && !gpu.timeline.idle(DROP_LIMIT)
        {
            // The device may still write to the buffers: better lost than freed.
            std::mem::forget(gpu);
        }
    }
}
