//! Any rank's side of a deal: what to compute next, and when to ask for more.

use crate::{Lease, Machine, Patience, ToServer, ToWorker};
use std::collections::VecDeque;
use std::time::Duration;

/// Most tiles that wait at a rank, however short they are.
const MOST: usize = 256;

/// Share of a tile's predicted seconds by which more is asked for earlier: predictions are off.
const CAUTION: f64 = 0.25;

/// Any rank's side of a deal, rank 0's own too: what to compute next, and when to ask for more. Does no I/O and knows
/// no clock: times are since any moment that stays the same.
#[derive(Debug)]
pub struct Worker {
    patience: Patience,
    fingerprint: u64,
    queue: VecDeque<Lease>,
    running: Option<(Lease, Duration)>,
    asked: Option<Asked>,
    /// Whether anything was heard of rank 0 yet.
    was_heard: bool,
    /// Whether it has told its prices, so that it can begin.
    is_ready: bool,
    end: Option<End>,
    /// Shortest time between a question and its answer; others had to wait for tiles.
    round_trip: Option<Duration>,
    /// Of the tiles that are finished.
    seconds: f64,
    cost: f64,
    finished: u32,
    heard: Duration,
    spoken: Duration,
}

#[derive(Clone, Copy, Debug)]
struct Asked {
    at: Duration,
    is_idle: bool,
}

/// How a deal ends for a rank.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// All tiles are finished.
    Finished {
        /// Whether all ranks are there.
        is_complete: bool,
    },
    /// Rank 0 has another job.
    Refused(String),
    /// Rank 0 stopped.
    Stopped(String),
    /// Rank 0 is lost, and how that was noticed.
    ServerLost(String),
}

impl Worker {
    /// A rank that introduces itself.
    #[must_use]
    pub fn new(patience: Patience, fingerprint: u64, machine: Machine, now: Duration, out: &mut Vec<ToServer>) -> Self {
        out.push(ToServer::Hello { fingerprint, machine });
        Self {
            patience,
            fingerprint,
            queue: VecDeque::new(),
            running: None,
            asked: None,
            was_heard: false,
            is_ready: false,
            end: None,
            round_trip: None,
            seconds: 0.0,
            cost: 0.0,
            finished: 0,
            heard: now,
            spoken: now,
        }
    }

    /// Tells what it expects tiles to cost, some or none; from now on it asks for tiles.
    pub fn priced(&mut self, now: Duration, prices: Vec<Lease>, out: &mut Vec<ToServer>) {
        if !prices.is_empty() {
            self.say(now, ToServer::Prices(prices), out);
        }
        self.is_ready = true;
        self.consider(now, out);
    }

    /// Takes a message of rank 0.
    pub fn receive(&mut self, now: Duration, message: ToWorker, out: &mut Vec<ToServer>) {
        self.hear_of_server(now);
        match message {
            ToWorker::Welcome | ToWorker::Alive => {}
            ToWorker::Lease(leases) => {
                if let Some(Asked { at, .. }) = self.asked.take() {
                    let took = now.saturating_sub(at);
                    self.round_trip = Some(self.round_trip.map_or(took, |least| least.min(took)));
                }
                self.queue.extend(leases);
            }
            // It was too late to be refused; what it has done for others it would do for this one.
            ToWorker::Finished { fingerprint, .. } if fingerprint != self.fingerprint => {
                let why = "scene, options or program differ from those of rank 0: start the same command with the same \
                           files on all nodes";
                self.end = Some(End::Refused(why.to_owned()));
            }
            ToWorker::Finished { is_complete, .. } => self.end = Some(End::Finished { is_complete }),
            ToWorker::Refused(why) => self.end = Some(End::Refused(why)),
            ToWorker::Stopped(why) => self.end = Some(End::Stopped(why)),
        }
        self.consider(now, out);
    }

    /// The tile to compute next, if there is one.
    pub fn take(&mut self, now: Duration) -> Option<u32> {
        if self.end.is_some() {
            return None;
        }
        let lease = self.queue.pop_front()?;
        self.running = Some((lease, now));
        Some(lease.tile)
    }

    /// Whether a tile was taken that is not finished.
    #[must_use]
    pub const fn is_computing(&self) -> bool {
        self.running.is_some()
    }

    /// Notes that the tile that was taken is finished. The message comes first in `out`; the tile's bytes follow it.
    pub fn done(&mut self, now: Duration, out: &mut Vec<ToServer>) {
        let Some((Lease { tile, cost }, since)) = self.running.take() else { return };
        let seconds = now.saturating_sub(since).as_secs_f64();
        self.seconds += seconds;
        self.cost += f64::from(cost);
        self.finished += 1;
        self.say(now, ToServer::Done { tile, seconds: seconds as f32 }, out);
        self.consider(now, out);
    }

    /// Looks at the time: whether to ask for more, whether to say that it is there, and whether rank 0 is.
    pub fn tick(&mut self, now: Duration, out: &mut Vec<ToServer>) {
        if self.end.is_some() {
            return;
        }
        self.consider(now, out);
        if now.saturating_sub(self.spoken) > self.patience.heartbeat {
            self.say(now, ToServer::Alive, out);
        }
        let limit = if self.was_heard { self.patience.server } else { self.patience.welcome };
        if now.saturating_sub(self.heard) > limit {
            self.lose_server(format!("it was not heard of for {} s", limit.as_secs_f64()));
        }
    }

    /// Notes that rank 0 is there, whatever it said.
    pub fn hear_of_server(&mut self, now: Duration) {
        (self.heard, self.was_heard) = (now, true);
    }

    /// Notes that rank 0 is known to be lost.
    pub fn lose_server(&mut self, why: String) {
        self.end.get_or_insert(End::ServerLost(why));
    }

    /// How it ended, once it has.
    #[must_use]
    pub const fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }

    /// Asks for more where what is left lasts no longer than an answer takes.
    fn consider(&mut self, now: Duration, out: &mut Vec<ToServer>) {
        if self.end.is_some() || !self.is_ready || self.queue.len() >= MOST {
            return;
        }
        let is_idle = self.running.is_none() && self.queue.is_empty();
        let (left, longest) = self.left(now);
        let ahead = 2.0 * self.round_trip.unwrap_or_default().as_secs_f64() + CAUTION * longest;
        let is_short = if self.finished == 0 { self.queue.is_empty() } else { left <= ahead };
        let is_new = match self.asked {
            None => is_idle || is_short,
            // Rank 0 keeps the last tiles for those that are idle.
            Some(asked) => is_idle && !asked.is_idle,
        };
        if is_new {
            let at = self.asked.map_or(now, |asked| asked.at);
            self.asked = Some(Asked { at, is_idle });
            let rate = if self.seconds > 0.0 { self.cost / self.seconds } else { 0.0 };
            let cost = ((ahead - left).max(0.0) * rate) as f32;
            self.say(now, ToServer::Ask { cost, is_idle }, out);
        }
    }

    /// Seconds that what it has should take, and those of the longest tile.
    fn left(&self, now: Duration) -> (f64, f64) {
        let mean = self.seconds / f64::from(self.finished.max(1));
        let predicted = |lease: &Lease| {
            let cost = f64::from(lease.cost);
            if cost > 0.0 && self.cost > 0.0 { cost * self.seconds / self.cost } else { mean }
        };
        let running = self.running.map_or((0.0, 0.0), |(lease, since)| {
            let whole = predicted(&lease);
            ((whole - now.saturating_sub(since).as_secs_f64()).max(0.0), whole)
        });
        let add = |(sum, longest): (f64, f64), seconds: f64| (sum + seconds, longest.max(seconds));
        self.queue.iter().map(predicted).fold(running, add)
    }

    fn say(&mut self, now: Duration, message: ToServer, out: &mut Vec<ToServer>) {
        self.spoken = now;
        out.push(message);
    }
}
