//! What ranks tell each other before and after they deal: the scene, and what each of them did when.

use crate::lifeline::Lifeline;
use crate::message::{NO_ROUND, Word, decode, encode};
use crate::{ClusterError, Patience, Transport, TransportError};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fmt;
use std::ops::Range;
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

/// A transport over which rank 0 tells all others something before they deal, and hears something of each afterwards.
///
/// As long as it is there, and whatever rank 0 does meanwhile, the others hear that rank 0 is there
/// ([`Patience::heartbeat`]); when they do not, [`Relay::receive`], [`Relay::answer`] and a deal over it end after
/// [`Patience::server`] of listening.
pub struct Relay<'a> {
    line: Lifeline,
    patience: Patience,
    cancel: Option<&'a AtomicBool>,
    /// What came before it was wanted.
    early: VecDeque<(u32, Vec<u8>)>,
    /// Messages to ranks that take nothing any more; they will never leave.
    stuck: usize,
    /// How long this rank has listened since it last heard of rank 0, if it ever did.
    silence: Option<Duration>,
}

impl fmt::Debug for Relay<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Relay").field("rank", &self.rank()).field("silence", &self.silence).finish_non_exhaustive()
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

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Answer {
    /// To the question of this number: seconds.
    Time(u32, f64),
    Say,
}

impl<'a> Relay<'a> {
    /// Over a transport; `cancel` is set to `true` to stop.
    ///
    /// # Errors
    /// On rank 0, when it can have no thread to tell that it is there.
    pub fn new(
        transport: Box<dyn Transport>,
        patience: Patience,
        cancel: Option<&'a AtomicBool>,
    ) -> Result<Self, ClusterError> {
        let line = Lifeline::new(transport, patience.heartbeat)?;
        Ok(Self { line, patience, cancel, early: VecDeque::new(), stuck: 0, silence: None })
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
        let from = (self.rank() - 1) / 2;
        for chunk in into.chunks_mut(CHUNK) {
            let bytes = self.next_part(from)?;
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

    /// The ranks to which this one passes on what it hears.
    fn behind(&self) -> Range<u32> {
        let first = 2 * self.rank() + 1;
        first.min(self.size())..(first + 2).min(self.size())
    }

    fn pass_on(&mut self, chunk: &[u8]) -> Result<(), ClusterError> {
        for to in self.behind() {
            if self.line.leaves_out(to) {
                continue;
            }
            let begin = Instant::now();
            self.line.send(to, encode(NO_ROUND, Word::Part, chunk))?;
            loop {
                self.check()?;
                let left = self.line.flush(LISTEN)?;
                if left <= self.stuck {
                    break;
                }
                if begin.elapsed() > self.patience.rank {
                    self.line.leave_out(to);
                    self.stuck = left;
                    break;
                }
            }
        }
        Ok(())
    }

    /// The next part that a rank passes on; what others send meanwhile is kept.
    fn next_part(&mut self, from: u32) -> Result<Vec<u8>, ClusterError> {
        let mut begin = Instant::now();
        while begin.elapsed() < self.patience.welcome {
            self.check()?;
            let Some((rank, bytes)) = self.listen()? else { continue };
            match decode(rank, &bytes) {
                Ok((NO_ROUND, Word::Part, part)) if rank == from => return Ok(part.to_vec()),
                Ok((NO_ROUND, Word::Alive, _)) => {
                    // Rank 0 may have much to do before it tells anything.
                    if rank == from {
                        begin = Instant::now();
                    }
                    // Those behind this rank hear of rank 0, but not whether this one is there to pass on.
                    if rank == 0 {
                        self.behind().try_for_each(|to| self.line.send(to, encode(NO_ROUND, Word::Alive, &[])))?;
                    }
                }
                _ => self.early.push_back((rank, bytes)),
            }
        }
        let waited = self.patience.welcome.as_secs_f64();
        Err(ClusterError::ServerLost(format!("rank {from} sent nothing for {waited} s")))
    }

    /// The next message from outside, if there is one soon.
    fn listen(&mut self) -> Result<Option<(u32, Vec<u8>)>, ClusterError> {
        let message = self.receive_new(LISTEN)?;
        match self.lost_server() {
            Some(why) => Err(ClusterError::ServerLost(why)),
            None => Ok(message),
        }
    }

    fn receive_new(&mut self, within: Duration) -> Result<Option<(u32, Vec<u8>)>, TransportError> {
        let begin = Instant::now();
        let message = self.line.receive(within)?;
        match &message {
            Some((0, _)) => self.silence = Some(Duration::ZERO),
            _ => self.silence = self.silence.map(|silence| silence + begin.elapsed()),
        }
        Ok(message)
    }

    /// That rank 0 is not heard of any more, if so.
    fn lost_server(&self) -> Option<String> {
        let limit = self.patience.server;
        let is_lost = self.silence.is_some_and(|silence| silence > limit);
        is_lost.then(|| format!("it was not heard of for {} s", limit.as_secs_f64()))
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
        for to in 1..self.size() {
            self.line.send(to, encode(NO_ROUND, Word::Done, &[]))?;
        }
        self.line.flush(ANSWER)?;
        heard
    }

    fn ask_one(&mut self, rank: u32, clock: &dyn Fn() -> Duration) -> Result<Option<Heard>, ClusterError> {
        // Round trip, and how far the clock is ahead.
        let mut best: Option<(f64, f64)> = None;
        for number in 0..QUESTIONS {
            let asked = clock().as_secs_f64();
            self.line.send(rank, encode(NO_ROUND, Word::Time(number), &[]))?;
            let is_it = |answer: &Answer| matches!(answer, Answer::Time(of, _) if *of == number);
            let Some((Answer::Time(_, theirs), _)) = self.answer_of(rank, is_it)? else { return Ok(None) };
            let round_trip = clock().as_secs_f64() - asked;
            if best.is_none_or(|(least, _)| round_trip < least) {
                best = Some((round_trip, theirs - (asked + round_trip / 2.0)));
            }
        }
        self.line.send(rank, encode(NO_ROUND, Word::Say, &[]))?;
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
            if let Ok((NO_ROUND, answer, said)) = decode::<Answer>(from, &bytes)
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
            let message = match self.early.pop_front() {
                Some(early) => Some(early),
                None => self.listen()?,
            };
            let Some((from, word)) = message else { continue };
            let Ok((NO_ROUND, word, _)) = decode::<Word>(from, &word) else { continue };
            begin = Instant::now();
            let answer = match word {
                Word::Time(number) => encode(NO_ROUND, Answer::Time(number, clock().as_secs_f64()), &[]),
                Word::Say => encode(NO_ROUND, Answer::Say, bytes),
                Word::Done => return Ok(()),
                Word::Alive | Word::Part => continue,
            };
            self.line.send(from, answer)?;
        }
        Err(ClusterError::ServerLost(format!("it asked nothing for {} s", self.patience.welcome.as_secs_f64())))
    }

    fn receive_any(&mut self, within: Duration) -> Result<Option<(u32, Vec<u8>)>, TransportError> {
        match self.early.pop_front() {
            Some(early) => Ok(Some(early)),
            None => self.receive_new(within),
        }
    }
}

impl Transport for Relay<'_> {
    fn rank(&self) -> u32 {
        self.line.rank()
    }

    fn size(&self) -> u32 {
        self.line.size()
    }

    fn send(&mut self, to: u32, message: Vec<u8>) -> Result<(), TransportError> {
        self.line.send(to, message)
    }

    fn receive(&mut self, within: Duration) -> Result<Option<(u32, Vec<u8>)>, TransportError> {
        self.receive_any(within)
    }

    fn lost(&mut self) -> Vec<(u32, String)> {
        let mut lost = self.line.lost();
        lost.extend(self.lost_server().map(|why| (0, why)));
        lost
    }

    fn flush(&mut self, within: Duration) -> Result<usize, TransportError> {
        self.line.flush(within)
    }
}
