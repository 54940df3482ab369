//! The buffers and commands of one launch in flight.

use crate::buffer::{Buffer, Use};
use crate::commands::{Commands, Stage};
use crate::logical::Logical;
use crate::pipeline::{Bindings, Layout, Pipeline};
use crate::timeline::Timeline;
use crate::upload::Resident;
use rt_core::{DeviceError, TestCounts};
use rt_gpu::{RayList, RayRecipe};
use std::sync::Arc;
use std::time::Duration;

/// What a launch does.
#[derive(Debug)]
pub(crate) struct Job<'a> {
    /// The kernel that makes rays first, and what it is told.
    pub making: Option<(Arc<Pipeline>, &'a RayRecipe)>,
    /// The kernel that traces.
    pub tracing: Arc<Pipeline>,
    /// Which rays.
    pub list: &'a RayList,
    /// Whether it counts.
    pub counted: bool,
}

/// Room for one launch.
#[derive(Debug)]
pub(crate) struct Slot {
    logical: Arc<Logical>,
    layout: Arc<Layout>,
    commands: Commands,
    bindings: Bindings,
    room: Room,
    /// Made for the first rays that the device makes.
    making: Option<Making>,
    /// Items that the last launch counted.
    counted: usize,
    /// What the last launch runs, kept until it is done.
    pipelines: [Option<Arc<Pipeline>>; 2],
}

/// Room for a recipe.
#[derive(Debug)]
struct Making {
    bindings: Bindings,
    upload: Buffer,
    recipe: Buffer,
}

impl Making {
    fn new(logical: &Arc<Logical>, layout: &Arc<Layout>, bytes: u64) -> Result<Self, DeviceError> {
        let buffer = |purpose| Buffer::new(logical, "what rays are made of", bytes, purpose);
        Ok(Self { bindings: Bindings::new(layout)?, upload: buffer(Use::Upload)?, recipe: buffer(Use::Kernel)? })
    }
}

/// Buffers for up to `items` rays that `words` words name, with counts for up to `counted`.
#[derive(Debug)]
struct Room {
    words: u32,
    items: u32,
    counted: u32,
    upload: Buffer,
    list: Buffer,
    found: Buffer,
    found_back: Buffer,
    counts: Buffer,
    counts_back: Buffer,
}

const WORD: u64 = 4;
const COUNTS: u64 = size_of::<TestCounts>() as u64;

impl Room {
    fn new(logical: &Arc<Logical>, [words, items, counted]: [u32; 3]) -> Result<Self, DeviceError> {
        let buffer = |what: &str, count: u32, size: u64, purpose| {
            Buffer::new(logical, &format!("{what} of {count} rays"), u64::from(count) * size, purpose)
        };
        Ok(Self {
            words,
            items,
            counted,
            upload: buffer("the list", words, WORD, Use::Upload)?,
            list: buffer("the list", words, WORD, Use::Kernel)?,
            found: buffer("the hits", items, WORD, Use::Kernel)?,
            found_back: buffer("the hits", items, WORD, Use::Download)?,
            counts: buffer("the counts", counted, COUNTS, Use::Kernel)?,
            counts_back: buffer("the counts", counted, COUNTS, Use::Download)?,
        })
    }

    /// Whether it is as large in every way.
    const fn fits(&self, [words, items, counted]: [u32; 3]) -> bool {
        self.words >= words && self.items >= items && self.counted >= counted
    }
}

impl Slot {
    pub(crate) fn new(logical: &Arc<Logical>, layout: &Arc<Layout>) -> Result<Self, DeviceError> {
        Ok(Self {
            logical: Arc::clone(logical),
            layout: Arc::clone(layout),
            commands: Commands::new(logical)?,
            bindings: Bindings::new(layout)?,
            room: Room::new(logical, [0; 3])?,
            making: None,
            counted: 0,
            pipelines: [None, None],
        })
    }

    /// Makes and traces rays of `rays`, and returns the value of the timeline that says it is done. The slot's
    /// last launch is done.
    pub(crate) fn start(
        &mut self,
        scene: &Resident,
        rays: &Buffer,
        Job { making, tracing, list, counted }: Job<'_>,
        timeline: &mut Timeline,
    ) -> Result<u64, DeviceError> {
        if let Some((_, recipe)) = &making {
            self.fill_recipe(recipe, scene, rays)?;
        }
        let (count, words) = (list.items(), list.words());
        let counts = if counted { count } else { 0 };
        let needed = [words.len() as u32, count, counts];
        if !self.room.fits(needed) {
            let Room { words, items, counted, .. } = self.room;
            let [a, b, c] = needed;
            self.room = Room::new(&self.logical, [words.max(a), items.max(b), counted.max(c)])?;
        }
        let Self { commands, bindings, room, making: made, .. } = self;
        room.upload.write(0, words);
        let [nodes, triangles, primitives, frame] = scene.bindings(tracing.tree());
        bindings.choose([nodes, triangles, primitives, frame, rays, &room.list, &room.found, &room.counts]);
        commands.record(|to| {
            // The launch before this one may still be running: its kernel must not be timed with ours.
            to.barrier(Stage::Kernel, Stage::Copy);
            to.copy(&room.upload, &room.list, 0, size_of_val(words) as u64);
            let making = making.as_ref().zip(made.as_ref());
            if let Some(((_, recipe), made)) = making {
                to.copy(&made.upload, &made.recipe, 0, size_of_val(recipe.words()) as u64);
            }
            to.barrier(Stage::Copy, Stage::Kernel);
            to.stamp(0);
            if let Some(((kernel, recipe), made)) = making {
                to.run(kernel, &made.bindings, recipe.count());
                to.barrier(Stage::Kernel, Stage::Kernel);
            }
            to.run(&tracing, bindings, list.lanes());
            to.stamp(1);
            to.barrier(Stage::Kernel, Stage::Copy);
            if count > 0 {
                to.copy(&room.found, &room.found_back, 0, u64::from(count) * WORD);
            }
            if counts > 0 {
                to.copy(&room.counts, &room.counts_back, 0, u64::from(count) * COUNTS);
            }
            to.barrier(Stage::Copy, Stage::Host);
        })?;
        self.counted = counts as usize;
        self.pipelines = [Some(tracing), making.map(|(kernel, _)| kernel)];
        timeline.submit(self.commands.raw())
    }

    /// Writes a recipe to where it is copied from, and chooses its kernel's buffers.
    fn fill_recipe(&mut self, recipe: &RayRecipe, scene: &Resident, rays: &Buffer) -> Result<(), DeviceError> {
        let bytes = size_of_val(recipe.words()) as u64;
        let making = match self.making.take() {
            Some(making) if making.recipe.size() >= bytes => making,
            _ => Making::new(&self.logical, &self.layout, bytes)?,
        };
        let Making { bindings, upload, recipe: buffer, .. } = self.making.insert(making);
        upload.write(0, recipe.words());
        let [tree, triangles, primitives, frame] = scene.bindings(rt_gpu::Layout::Two);
        // Kernels that make rays read neither a list nor the last buffer.
        bindings.choose([tree, triangles, primitives, frame, frame, buffer, rays, frame]);
        Ok(())
    }

    /// What the kernel found for each item of the last launch, which is done.
    pub(crate) fn found(&self, count: usize) -> &[u32] {
        self.room.found_back.read(count)
    }

    /// The counts of each item of the last launch, which is done; empty if it did not count.
    pub(crate) fn counts(&self) -> &[TestCounts] {
        self.room.counts_back.read(self.counted)
    }

    /// Time in the kernel of the last launch, which is done.
    pub(crate) fn in_kernel(&self) -> Option<Duration> {
        self.commands.elapsed()
    }
}
