//! How far loading got, and whether to go on.

use std::ops::ControlFlow;

/// How far a loader got in its present stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadProgress {
    /// What is being done.
    pub stage: LoadStage,
    /// Bytes, vertices or triangles done.
    pub done: u64,
    /// Bytes, vertices or triangles to do in this stage; 0 where that is not known.
    pub total: u64,
}

/// The stages of loading and building, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LoadStage {
    /// Reading the file into memory, in bytes.
    Reading,
    /// Parsing the text, in bytes.
    Parsing,
    /// Leaving out vertices that no face uses, and placing the others in single precision, in triangles and vertices.
    Placing,
    /// Looking at the numbers of the model ([`crate::scan`]), in triangles.
    Scanning,
    /// Building the tree, in triangles that are in their place.
    Building,
}

impl LoadStage {
    /// Bytes, vertices or triangles between two calls: some hundred calls a second.
    pub(crate) const fn step(self) -> u64 {
        match self {
            Self::Reading | Self::Parsing => 1 << 20,
            Self::Placing | Self::Scanning => 1 << 16,
            Self::Building => 1 << 13,
        }
    }
}

/// Told how far loading got; loading ends at once with an error when it breaks.
pub type Watch<'a> = dyn FnMut(LoadProgress) -> ControlFlow<()> + 'a;

/// A watch that never stops anything.
pub fn unwatched(_: LoadProgress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// The watch said to stop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stopped;

/// Calls a watch once for each step of a stage.
pub(crate) struct Meter<'a, 'b> {
    stage: LoadStage,
    total: u64,
    next: u64,
    watch: &'a mut Watch<'b>,
}

impl<'a, 'b> Meter<'a, 'b> {
    /// Begins a stage, of which the watch is told.
    pub(crate) fn begin(stage: LoadStage, total: u64, watch: &'a mut Watch<'b>) -> Result<Self, Stopped> {
        let mut meter = Self { stage, total, next: 0, watch };
        meter.at(0)?;
        Ok(meter)
    }

    /// So much is done.
    #[inline]
    pub(crate) fn at(&mut self, done: u64) -> Result<(), Stopped> {
        if done < self.next { Ok(()) } else { self.tell(done) }
    }

    #[cold]
    fn tell(&mut self, done: u64) -> Result<(), Stopped> {
        self.next = done + self.stage.step();
        match (self.watch)(LoadProgress { stage: self.stage, done, total: self.total }) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Stopped),
        }
    }
}
