//! The buffers of one launch in flight.

use crate::opened::Opened;
use crate::pipeline::{BUFFERS, Pipeline};
use rt_core::arguments::invalid;
use rt_core::{DeviceError, DeviceErrorKind, TestCounts};
use rt_gpu::{Answer, RayList, RayRecipe};
use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};
use wgpu::{
    Buffer, BufferAsyncError, BufferUsages, ComputePassDescriptor, ComputePassTimestampWrites, MapMode, QuerySet,
    QuerySetDescriptor, QueryType, SubmissionIndex,
};

const WORD: u64 = 4;
const COUNTS: u64 = size_of::<TestCounts>() as u64;
/// Bytes of two timestamps.
const STAMPS: u64 = 16;

/// What a launch does.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Job<'a> {
    /// The kernel that makes rays first, and what it is told.
    pub making: Option<(&'a Pipeline, &'a RayRecipe)>,
    /// The kernel that traces.
    pub tracing: &'a Pipeline,
    /// Which rays.
    pub list: &'a RayList,
    /// Whether it counts.
    pub counted: bool,
}

/// Room for one launch.
#[derive(Debug)]
pub(crate) struct Slot {
    opened: Arc<Opened>,
    room: Room,
    /// For what the device makes rays of.
    recipe: Option<Buffer>,
    stamps: Option<Stamps>,
    running: Option<Running>,
}

/// Buffers for up to `items` rays that `words` words name, with counts for up to `counted`.
#[derive(Debug)]
struct Room {
    words: u32,
    items: u32,
    counted: u32,
    list: Buffer,
    found: Buffer,
    counts: Buffer,
    /// What goes back to the host: see [`Back`].
    back: Buffer,
}

/// The two timestamps of a launch.
#[derive(Debug)]
struct Stamps {
    queries: QuerySet,
    resolved: Buffer,
    /// Nanoseconds of a tick.
    tick: f64,
}

/// A launch in flight.
#[derive(Debug)]
struct Running {
    done: SubmissionIndex,
    mapped: Receiver<Result<(), BufferAsyncError>>,
    back: Back,
}

/// Where each part of the results lies in the buffer that goes back to the host, in bytes, each a multiple of 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Back {
    found: u64,
    counts: [u64; 2],
    stamps: u64,
}

impl Back {
    fn new(items: u32, counted: u32) -> Self {
        let found = u64::from(items) * WORD;
        let counts = found.next_multiple_of(COUNTS);
        let end = counts + u64::from(counted) * COUNTS;
        Self { found, counts: [counts, end], stamps: end }
    }

    fn size(self) -> u64 {
        self.stamps + STAMPS
    }
}

impl Room {
    fn new(opened: &Opened, [words, items, counted]: [u32; 3]) -> Result<Self, DeviceError> {
        let buffer = |what: &str, size: u64, usage| opened.buffer(&format!("{what} of {items} rays"), size, usage);
        let written = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        Ok(Self {
            words,
            items,
            counted,
            list: buffer("the list", u64::from(words) * WORD, BufferUsages::STORAGE | BufferUsages::COPY_DST)?,
            found: buffer("the hits", u64::from(items) * WORD, written)?,
            counts: buffer("the counts", u64::from(counted) * COUNTS, written)?,
            back: buffer(
                "the results",
                Back::new(items, counted).size(),
                BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            )?,
        })
    }
}

impl Stamps {
    fn new(opened: &Opened, tick: f64) -> Result<Self, DeviceError> {
        let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
        let resolved = opened.buffer("the timestamps", STAMPS, usage)?;
        let queries = opened.scoped("create timestamps", DeviceErrorKind::Lost, || {
            opened.device.create_query_set(&QuerySetDescriptor { label: None, ty: QueryType::Timestamp, count: 2 })
        })?;
        Ok(Self { queries, resolved, tick })
    }
}

impl Slot {
    pub(crate) fn new(opened: &Arc<Opened>) -> Result<Self, DeviceError> {
        let stamps = opened.tick.map(|tick| Stamps::new(opened, tick)).transpose()?;
        Ok(Self { opened: Arc::clone(opened), room: Room::new(opened, [0; 3])?, recipe: None, stamps, running: None })
    }

    /// Makes and traces rays of `rays`. The slot's last launch is done. `scene` are the buffers of bindings 0 to 3.
    pub(crate) fn start(&mut self, scene: [&Buffer; 4], rays: &Buffer, job: Job<'_>) -> Result<(), DeviceError> {
        let Job { list, counted, .. } = job;
        if let Some((_, recipe)) = job.making {
            self.fill_recipe(recipe)?;
        }
        let (count, words) = (list.items(), list.words());
        let counts = if counted { count } else { 0 };
        let needed = [words.len() as u32, count, counts];
        let there = [self.room.words, self.room.items, self.room.counted];
        if there.iter().zip(needed).any(|(there, needed)| *there < needed) {
            self.room = Room::new(&self.opened, std::array::from_fn(|i| there[i].max(needed[i])))?;
        }
        let back = Back::new(count, counts);
        let Self { opened, room, .. } = &*self;
        opened.queue.write_buffer(&room.list, 0, bytemuck::cast_slice(words));
        let (tell, mapped) = sync_channel(1);
        let done = opened.scoped("start a launch", DeviceErrorKind::Lost, || {
            let done = self.submit(scene, rays, job, back);
            room.back.map_async(MapMode::Read, 0..back.size(), move |result| {
                // Nobody listens any more when the launch was given up.
                let _ = tell.send(result);
            });
            done
        })?;
        self.running = Some(Running { done, mapped, back });
        Ok(())
    }

    /// Sends a recipe to the device.
    fn fill_recipe(&mut self, recipe: &RayRecipe) -> Result<(), DeviceError> {
        let bytes: &[u8] = bytemuck::cast_slice(recipe.words());
        let size = bytes.len() as u64;
        let buffer = match self.recipe.take() {
            Some(buffer) if buffer.size() >= size => buffer,
            _ => self.opened.buffer("what rays are made of", size, BufferUsages::STORAGE | BufferUsages::COPY_DST)?,
        };
        let Self { opened, recipe, .. } = self;
        let buffer = recipe.insert(buffer);
        opened.scoped("write a buffer", DeviceErrorKind::Lost, || opened.queue.write_buffer(buffer, 0, bytes))
    }

    fn submit(&self, scene: [&Buffer; 4], rays: &Buffer, job: Job<'_>, back: Back) -> SubmissionIndex {
        let Self { opened, room, recipe, stamps, .. } = self;
        let [tree, triangles, primitives, frame] = scene;
        let buffers: [&Buffer; BUFFERS] =
            [tree, triangles, primitives, frame, rays, &room.list, &room.found, &room.counts];
        let bindings = job.tracing.bind(&opened.device, buffers);
        let making = job.making.zip(recipe.as_ref()).map(|((kernel, given), recipe)| {
            // It reads no tree, and no list of rays.
            let buffers = [tree, triangles, primitives, frame, frame, recipe, rays, frame];
            (kernel, kernel.bind(&opened.device, buffers), given.count())
        });
        let mut encoder = opened.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let timestamp_writes = stamps.as_ref().map(|stamps| ComputePassTimestampWrites {
            query_set: &stamps.queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        });
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor { label: None, timestamp_writes });
        if let Some((kernel, bindings, count)) = &making {
            kernel.run(opened, &mut pass, bindings, *count);
        }
        job.tracing.run(opened, &mut pass, &bindings, job.list.lanes());
        drop(pass);
        encoder.copy_buffer_to_buffer(&room.found, 0, &room.back, 0, back.found);
        let [start, end] = back.counts;
        if end > start {
            encoder.copy_buffer_to_buffer(&room.counts, 0, &room.back, start, end - start);
        }
        if let Some(stamps) = stamps {
            encoder.resolve_query_set(&stamps.queries, 0..2, &stamps.resolved, 0);
            encoder.copy_buffer_to_buffer(&stamps.resolved, 0, &room.back, back.stamps, STAMPS);
        }
        opened.queue.submit([encoder.finish()])
    }

    /// Waits at most `limit` for the launch in flight and shows `read` what it wrote.
    pub(crate) fn wait(&mut self, limit: Duration, read: &mut dyn FnMut(Answer<'_>)) -> Result<(), DeviceError> {
        let begin = Instant::now();
        let Running { done, mapped, back } =
            self.running.take().ok_or_else(|| invalid("no such kernel is in flight"))?;
        let opened = &self.opened;
        opened.wait(done, limit)?;
        // Another thread that waits for the device may be the one that runs the callback.
        match mapped.recv_timeout(limit.saturating_sub(begin.elapsed()).max(GRACE)) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(opened.lose(&error.to_string())),
            Err(_) => return Err(opened.hung(limit)),
        }
        let view = self.room.back.get_mapped_range(0..back.size()).map_err(|e| opened.lose(&e.to_string()))?;
        let part = |range: Range<u64>| view.get(range.start as usize..range.end as usize).unwrap_or_default();
        let torn = |e: bytemuck::PodCastError| opened.lose(&format!("its results lie at an odd address: {e}"));
        let found = bytemuck::try_cast_slice(part(0..back.found)).map_err(torn)?;
        let counts = bytemuck::try_cast_slice(part(back.counts[0]..back.counts[1])).map_err(torn)?;
        let ticks: &[u64] = bytemuck::try_cast_slice(part(back.stamps..back.size())).map_err(torn)?;
        let in_kernel = self.stamps.as_ref().map(|stamps| {
            let passed = ticks[1].wrapping_sub(ticks[0]);
            Duration::from_nanos((passed as f64 * stamps.tick) as u64)
        });
        read(Answer { found, counts, in_kernel });
        drop(view);
        self.room.back.unmap();
        opened.check()
    }

    /// Whether the launch in flight, if any, ends within `limit`.
    pub(crate) fn is_idle(&mut self, limit: Duration) -> bool {
        self.running.take().is_none_or(|running| self.opened.wait(running.done, limit).is_ok())
    }
}

/// How long another thread may take to run a callback that is due.
const GRACE: Duration = Duration::from_secs(1);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_the_results_are_aligned_and_apart() {
        for (items, counted) in [(0, 0), (1, 0), (1, 1), (7, 7), (8, 0)] {
            let back = Back::new(items, counted);
            assert!(back.found <= back.counts[0] && back.counts[0] < back.counts[0] + 8 * u64::from(counted) + 1);
            assert!([back.counts[0], back.stamps, back.size()].iter().all(|offset| offset % 8 == 0));
            assert_eq!(back.counts[1] - back.counts[0], 8 * u64::from(counted));
            assert!(back.stamps >= back.counts[1]);
        }
    }
}
