//! Ranks that are processes started by `mpirun`, on any machines.
//!
//! Point to point alone: collective calls wait for ranks that are lost. Sending and receiving never block, so that
//! neither two ranks that send to each other nor a rank that dies in the middle of a message stop anything. MPI has no
//! receiving with a time limit, so waiting is asking again, at growing distances.

mod raw;

use crate::{Transport, TransportError};
use ::mpi::Threading;
use ::mpi::environment::{Universe, initialize_with_threading};
use raw::{Receiving, Sending};
use std::collections::VecDeque;
use std::error::Error;
use std::fmt;
use std::mem;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

/// First and longest time between two questions whether a message is there: below what dealing a tile costs, and
/// seldom enough that waiting takes no processor from those that compute.
const WAITS: [Duration; 2] = [Duration::from_micros(20), Duration::from_micros(500)];

/// Most messages that wait for one rank.
const MOST_UNSENT: usize = 2048;

/// All ranks of this run. Made and left by one thread.
pub struct World {
    universe: Universe,
    rank: u32,
    size: u32,
}

impl fmt::Debug for World {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("World").field("rank", &self.rank).field("size", &self.size).finish_non_exhaustive()
    }
}

/// MPI cannot be used as it is needed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MpiError(String);

impl fmt::Display for MpiError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MPI: {}", self.0)
    }
}

impl Error for MpiError {}

impl World {
    /// Joins the other ranks.
    ///
    /// # Errors
    /// When that was done before, or this MPI does not let another thread than the first exchange messages.
    pub fn join() -> Result<Self, MpiError> {
        let (universe, threading) = initialize_with_threading(Threading::Serialized)
            .ok_or_else(|| MpiError("it was initialised before".to_owned()))?;
        if threading < Threading::Serialized {
            return Err(MpiError("only the first thread may exchange messages: use a build with threads".to_owned()));
        }
        let [rank, size] = raw::rank_and_size();
        raw::return_errors();
        Ok(Self { universe, rank, size })
    }

    /// The number of this rank.
    #[must_use]
    pub const fn rank(&self) -> u32 {
        self.rank
    }

    /// How many ranks there are.
    #[must_use]
    pub const fn size(&self) -> u32 {
        self.size
    }

    /// Leaves in good order, together with all other ranks, if `is_complete` says that they are there.
    ///
    /// That waits for all of them, for ever where one is lost, even if nobody knows yet. So it is not done where a loss
    /// is to be survived: MPI is left as it is then, which a launcher that recovers does not mind.
    pub fn leave(self, is_complete: bool) {
        if !is_complete || recovers() {
            mem::forget(self.universe);
        }
    }
}

/// Whether the launcher lets the others go on when a rank is lost (OpenMPI's `--enable-recovery`).
fn recovers() -> bool {
    std::env::var("OMPI_MCA_orte_enable_recovery").is_ok_and(|value| value != "0")
}

/// This rank's messages.
pub struct MpiRank {
    world: Arc<World>,
    sending: Vec<(u32, Sending)>,
    /// In the order they were begun in, which is that of each sender.
    receiving: VecDeque<(u32, Receiving)>,
    lost: Vec<(u32, String)>,
}

impl fmt::Debug for MpiRank {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MpiRank").field("world", &self.world).field("sending", &self.sending.len()).finish()
    }
}

impl MpiRank {
    /// What carries this rank's messages. One at a time: two would take each other's messages.
    #[must_use]
    pub fn new(world: &Arc<World>) -> Self {
        Self { world: Arc::clone(world), sending: Vec::new(), receiving: VecDeque::new(), lost: Vec::new() }
    }

    /// Lets go of what has left.
    fn settle(&mut self) {
        let Self { sending, lost, .. } = self;
        sending.retain_mut(|(to, message)| match message.is_done() {
            Ok(is_done) => !is_done,
            Err(why) => {
                lost.push((*to, why));
                false
            }
        });
    }

    /// The next message, if one is there.
    fn next(&mut self) -> Option<(u32, Vec<u8>)> {
        while let Some((from, begun)) = Receiving::begin() {
            self.receiving.push_back((from, begun));
        }
        let mut blocked = Vec::new();
        let mut place = 0;
        while let Some((from, message)) = self.receiving.get_mut(place) {
            let from = *from;
            // Messages of one rank stay in order.
            if !blocked.contains(&from) {
                match message.is_done() {
                    Ok(true) => {
                        let (from, message) = self.receiving.remove(place)?;
                        return Some((from, message.into_bytes()));
                    }
                    Ok(false) => blocked.push(from),
                    Err(why) => {
                        self.receiving.remove(place);
                        self.lost.push((from, why));
                        continue;
                    }
                }
            }
            place += 1;
        }
        None
    }
}

impl Transport for MpiRank {
    fn rank(&self) -> u32 {
        self.world.rank
    }

    fn size(&self) -> u32 {
        self.world.size
    }

    fn send(&mut self, to: u32, message: Vec<u8>) -> Result<(), TransportError> {
        self.settle();
        // Far more than a rank leaves unread that is busy for an hour. A lost one must not make this one look after
        // ever more messages that never leave.
        if self.sending.iter().filter(|(rank, _)| *rank == to).count() >= MOST_UNSENT {
            self.lost.push((to, format!("it takes no messages: {MOST_UNSENT} wait for it")));
            return Ok(());
        }
        let bytes = message.len();
        match Sending::begin(to, message) {
            Some(Ok(begun)) => self.sending.push((to, begun)),
            Some(Err(why)) => self.lost.push((to, why)),
            None => {
                let why = format!("a message of {bytes} bytes is longer than MPI allows: cut the job into more tiles");
                return Err(TransportError(why));
            }
        }
        Ok(())
    }

    fn receive(&mut self, within: Duration) -> Result<Option<(u32, Vec<u8>)>, TransportError> {
        let begin = Instant::now();
        let [mut wait, longest] = WAITS;
        loop {
            self.settle();
            if let Some(message) = self.next() {
                return Ok(Some(message));
            }
            let left = within.saturating_sub(begin.elapsed());
            if left.is_zero() {
                return Ok(None);
            }
            thread::sleep(wait.min(left));
            wait = (2 * wait).min(longest);
        }
    }

    fn lost(&mut self) -> Vec<(u32, String)> {
        mem::take(&mut self.lost)
    }

    fn flush(&mut self, within: Duration) -> Result<usize, TransportError> {
        let begin = Instant::now();
        self.settle();
        while !self.sending.is_empty() && begin.elapsed() < within {
            thread::sleep(WAITS[0]);
            self.settle();
        }
        Ok(self.sending.len())
    }
}
