//! What ranks tell each other before and after they deal: the scene, and what each of them did when.

use crate::message::{decode, encode};
use crate::{ClusterError, Patience, Transport, TransportError};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Bytes of a message that is a part of something larger: far more than what a message costs by itself, and few enough
/// that a rank passes on one while it receives the next.
const CHUNK: usize = 1 << 20;

/// How long a rank listens before it looks whether it is to stop.
const LISTEN: Duration = Duration::from_millis(5);

/// How long rank 0 waits for each answer when all is done.
const ANSWER: Duration = Duration::from_secs(5);

/// How often a rank is asked what time it has. The answer that came soonest is the best one.
const QUESTIONS: u32 = 16;

/// In place of the round of a deal.
const ROUND: u32 = u32::MAX;

/// A transport over which rank 0 tells all others something before they deal, and hears something of each afterwards.
pub struct Relay<'a> {
    transport: Box<dyn Transport + 'a>,
    patience: Patience,
    cancel: Option<&'a AtomicBool>,
    /// What came before it was wanted.
    early: VecDeque<(u32, Vec<u8>)>,
    /// Ranks that take nothing any more.
    deaf: Vec<u32>,
    /// Messages to them, which will never leave.
    stuck: usize,
}

impl fmt::Debug for Relay<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Relay").field("rank", &self.transport.rank()).field("deaf", &self.deaf).finish_non_exhaustive()
    }
}

/// What rank 0 heard of another rank.
#[derive(Clone, Debug, PartialEq)]
pub struct Heard {
    /// What the rank had to say.
    pub bytes: Vec<u8>,
    /// What its clock shows when rank 0's shows 0, in seconds; right to half of [`Heard::round_trip_s`].
    pub clock_ahead_s: f64,
    /// Seconds between question and answer.
    pub round_trip_s: f64,
}

/// What rank 0 asks when all is done.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Question {
    /// What time a rank has.
    Time(u32),
    /// What it has to say; follows the answer.
    Say,
    /// Nothing more.
    Done,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Answer {
    /// To the question of this number: seconds.
    Time(u32, f64),
    Say,
}

impl<'a> Relay<'a> {
    /// Over a transport; `cancel` is set to `true` to stop.
    #[must_use]
    pub fn new(transport: Box<dyn Transport + 'a>, patience: Patience, cancel: Option<&'a AtomicBool>) -> Self {
        Self { transport, patience, cancel, early: VecDeque::new(), deaf: Vec::new(), stuck: 0 }
    }

    /// On rank 0: tells all others. They must call [`Relay::receive`] with as many bytes.
    ///
    /// Along a tree, in which each rank passes on to two others what it gets: no rank sends more than twice what there
    /// is, and the last one has it after some log₂ N messages more. A rank that takes nothing is left out after
    /// [`Patience::rank`], and those behind it hear nothing.
    ///
    /// # Errors
    /// When this rank can send nothing, or is to stop.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), ClusterError> {
        bytes.chunks(CHUNK).try_for_each(|chunk| self.pass_on(chunk))
    }

    /// On any other rank: hears what rank 0 tells, and passes it on.
    ///
    /// # Errors
    /// When nothing comes for long, this rank is cut off, or it is to stop.
    pub fn receive(&mut self, into: &mut [u8]) -> Result<(), ClusterError> {
        let from = (self.transport.rank() - 1) / 2;
        for chunk in into.chunks_mut(CHUNK) {
            // Before the first there may be much to do for rank 0.
            let bytes = self.next_of(from, self.patience.welcome)?;
            if bytes.len() != chunk.len() {
                return Err(ClusterError::Message { from, source: postcard::Error::DeserializeUnexpectedEnd });
            }
            chunk.copy_from_slice(&bytes);
            self.pass_on(&bytes)?;
        }
        Ok(())
    }

    /// On rank 0: tells all others something short, which they [`Relay::hear`].
    ///
    /// # Errors
    /// As of [`Relay::send`].
    pub fn tell<T: Serialize>(&mut self, value: &T) -> Result<(), ClusterError> {
        let bytes = postcard::to_allocvec(value).expect("plain data in memory");
        self.send(&(bytes.len() as u64).to_le_bytes())?;
        self.send(&bytes)
    }

    /// On any other rank: hears something short.
    ///
    /// # Errors
    /// As of [`Relay::receive`], and when it is something else.
    pub fn hear<T: DeserializeOwned>(&mut self) -> Result<T, ClusterError> {
        let mut length = [0; 8];
        self.receive(&mut length)?;
        let mut bytes = vec![0; u64::from_le_bytes(length) as usize];
        self.receive(&mut bytes)?;
        postcard::from_bytes(&bytes).map_err(|source| ClusterError::Message { from: 0, source })
    }

    fn pass_on(&mut self, chunk: &[u8]) -> Result<(), ClusterError> {
        let first = 2 * self.transport.rank() + 1;
        for to in first..(first + 2).min(self.transport.size()) {
            if self.deaf.contains(&to) {
                continue;
            }
            let begin = Instant::now();
            self.transport.send(to, chunk.to_vec())?;
            loop {
                self.check()?;
                let left = self.transport.flush(LISTEN)?;
                if left <= self.stuck {
                    break;
                }
                if begin.elapsed() > self.patience.rank {
                    self.deaf.push(to);
                    self.stuck = left;
                    break;
                }
            }
        }
        Ok(())
    }

    /// The next message of a rank; what others send meanwhile is kept.
    fn next_of(&mut self, from: u32, within: Duration) -> Result<Vec<u8>, ClusterError> {
        let begin = Instant::now();
        while begin.elapsed() < within {
            self.check()?;
            match self.transport.receive(LISTEN)? {
                Some((rank, bytes)) if rank == from => return Ok(bytes),
                Some(other) => self.early.push_back(other),
                None => {}
            }
        }
        Err(ClusterError::ServerLost(format!("rank {from} sent nothing for {} s", within.as_secs_f64())))
    }

    fn check(&self) -> Result<(), ClusterError> {
        let is_cancelled = self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed));
        if is_cancelled { Err(ClusterError::Cancelled) } else { Ok(()) }
    }

    /// On rank 0: hears of each of `ranks` what it has to say, and how its clock differs; `None` where it does not
    /// answer.
    ///
    /// All others must call [`Relay::answer`] meanwhile. How clocks differ is measured as by F. Cristian,
    /// *Probabilistic Clock Synchronization* (1989): half-way between question and answer, of the soonest answer.
    ///
    /// # Errors
    /// When this rank is cut off, or is to stop.
    pub fn ask(&mut self, ranks: &[u32], clock: &dyn Fn() -> Duration) -> Result<Vec<Option<Heard>>, ClusterError> {
        let heard = ranks.iter().map(|&rank| self.ask_one(rank, clock)).collect();
        for to in 1..self.transport.size() {
            self.transport.send(to, encode(ROUND, Question::Done, &[]))?;
        }
        self.transport.flush(ANSWER)?;
        heard
    }

    fn ask_one(&mut self, rank: u32, clock: &dyn Fn() -> Duration) -> Result<Option<Heard>, ClusterError> {
        // Round trip, and how far the clock is ahead.
        let mut best: Option<(f64, f64)> = None;
        for number in 0..QUESTIONS {
            let asked = clock().as_secs_f64();
            self.transport.send(rank, encode(ROUND, Question::Time(number), &[]))?;
            let is_it = |answer: &Answer| matches!(answer, Answer::Time(of, _) if *of == number);
            let Some((Answer::Time(_, theirs), _)) = self.answer_of(rank, is_it)? else { return Ok(None) };
            let round_trip = clock().as_secs_f64() - asked;
            if best.is_none_or(|(least, _)| round_trip < least) {
                best = Some((round_trip, theirs - (asked + round_trip / 2.0)));
            }
        }
        self.transport.send(rank, encode(ROUND, Question::Say, &[]))?;
        let said = self.answer_of(rank, |answer| matches!(answer, Answer::Say))?;
        let heard = |((_, bytes), (round_trip_s, clock_ahead_s))| Heard { bytes, clock_ahead_s, round_trip_s };
        Ok(said.zip(best).map(heard))
    }

    fn answer_of(
        &mut self,
        rank: u32,
        is_it: impl Fn(&Answer) -> bool,
    ) -> Result<Option<(Answer, Vec<u8>)>, ClusterError> {
        let begin = Instant::now();
        while begin.elapsed() < ANSWER {
            self.check()?;
            let Some((from, bytes)) = self.receive_any(LISTEN)? else { continue };
            // What is late is of a deal that is over.
            if let Ok((ROUND, answer, said)) = decode::<Answer>(from, &bytes)
                && from == rank
                && is_it(&answer)
            {
                return Ok(Some((answer, said.to_vec())));
            }
        }
        Ok(None)
    }

    /// On any other rank: answers rank 0 until it asks no more.
    ///
    /// # Errors
    /// When rank 0 asks nothing for long, this rank is cut off, or it is to stop.
    pub fn answer(&mut self, bytes: &[u8], clock: &dyn Fn() -> Duration) -> Result<(), ClusterError> {
        let mut begin = Instant::now();
        while begin.elapsed() < self.patience.welcome {
            self.check()?;
            let Some((from, question)) = self.receive_any(LISTEN)? else { continue };
            let Ok((ROUND, question, _)) = decode::<Question>(from, &question) else { continue };
            begin = Instant::now();
            let answer = match question {
                Question::Time(number) => encode(ROUND, Answer::Time(number, clock().as_secs_f64()), &[]),
                Question::Say => encode(ROUND, Answer::Say, bytes),
                Question::Done => return Ok(()),
            };
            self.transport.send(from, answer)?;
        }
        Err(ClusterError::ServerLost(format!("it asked nothing for {} s", self.patience.welcome.as_secs_f64())))
    }

    fn receive_any(&mut self, within: Duration) -> Result<Option<(u32, Vec<u8>)>, TransportError> {
        match self.early.pop_front() {
            Some(early) => Ok(Some(early)),
            None => self.transport.receive(within),
        }
    }
}

impl Transport for Relay<'_> {
    fn rank(&self) -> u32 {
        self.transport.rank()
    }

    fn size(&self) -> u32 {
        self.transport.size()
    }

    fn send(&mut self, to: u32, message: Vec<u8>) -> Result<(), TransportError> {
        self.transport.send(to, message)
    }

    fn receive(&mut self, within: Duration) -> Result<Option<(u32, Vec<u8>)>, TransportError> {
        self.receive_any(within)
    }

    fn lost(&mut self) -> Vec<(u32, String)> {
        self.transport.lost()
    }

    fn flush(&mut self, within: Duration) -> Result<usize, TransportError> {
        self.transport.flush(within)
    }
}
