//! Ranks that are threads of one process, for tests and for trying things out: messages are delayed, and ranks die, as
//! a seed says.

use crate::{Transport, TransportError};
use rt_core::random;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// What happens to messages and ranks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Weather {
    /// Seed of everything that is random.
    pub seed: u32,
    /// Longest time that a message takes; each takes a random part of it, but never overtakes an earlier one between
    /// the same two ranks.
    pub delay: Duration,
}

impl Weather {
    /// Messages arrive at once.
    pub const CALM: Self = Self { seed: 0, delay: Duration::ZERO };
}

/// One rank of a network.
#[derive(Debug)]
pub struct LocalRank {
    rank: u32,
    network: Arc<Network>,
    /// Messages that it may still send before it dies.
    life: Option<u32>,
}

#[derive(Debug)]
struct Network {
    size: u32,
    weather: Weather,
    state: Mutex<State>,
    arrived: Condvar,
}

#[derive(Debug, Default)]
struct State {
    /// For each rank, what is on its way to it, the earliest first.
    boxes: Vec<BinaryHeap<Reverse<Letter>>>,
    /// When the last message from one rank to another arrives.
    last: BTreeMap<(u32, u32), Instant>,
    sent: u32,
    dead: Vec<bool>,
}

#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Letter {
    at: Instant,
    number: u32,
    from: u32,
    bytes: Vec<u8>,
}

/// `size` ranks that can reach each other.
#[must_use]
pub fn network(size: u32, weather: Weather) -> Vec<LocalRank> {
    let boxes = (0..size).map(|_| BinaryHeap::new()).collect();
    let state = State { boxes, dead: vec![false; size as usize], ..State::default() };
    let network = Arc::new(Network { size, weather, state: Mutex::new(state), arrived: Condvar::new() });
    (0..size).map(|rank| LocalRank { rank, network: Arc::clone(&network), life: None }).collect()
}

impl LocalRank {
    /// The rank dies when it has sent so many messages: it sends and receives nothing any more, and nobody is told.
    #[must_use]
    pub fn dying_after(self, messages: u32) -> Self {
        Self { life: Some(messages), ..self }
    }
}

impl Network {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn check(&self, rank: u32) -> Result<(), TransportError> {
        if self.dead[rank as usize] { Err(TransportError("this rank is dead".to_owned())) } else { Ok(()) }
    }
}

impl Transport for LocalRank {
    fn rank(&self) -> u32 {
        self.rank
    }

    fn size(&self) -> u32 {
        self.network.size
    }

    fn send(&mut self, to: u32, bytes: Vec<u8>) -> Result<(), TransportError> {
        let Weather { seed, delay } = self.network.weather;
        let mut state = self.network.state();
        if let Some(life) = &mut self.life {
            if *life == 0 {
                state.dead[self.rank as usize] = true;
            }
            *life = life.saturating_sub(1);
        }
        state.check(self.rank)?;
        let number = state.sent;
        state.sent += 1;
        let [share, _] = random::pair(seed, number, 0);
        let last = state.last.get(&(self.rank, to)).copied();
        let at = (Instant::now() + delay.mul_f32(share)).max(last.unwrap_or_else(Instant::now));
        state.last.insert((self.rank, to), at);
        if !state.dead[to as usize] {
            state.boxes[to as usize].push(Reverse(Letter { at, number, from: self.rank, bytes }));
        }
        drop(state);
        self.network.arrived.notify_all();
        Ok(())
    }

    fn receive(&mut self, within: Duration) -> Result<Option<(u32, Vec<u8>)>, TransportError> {
        let deadline = Instant::now() + within;
        let mut state = self.network.state();
        loop {
            state.check(self.rank)?;
            let now = Instant::now();
            let letters = &mut state.boxes[self.rank as usize];
            let next = letters.peek().map(|Reverse(letter)| letter.at);
            if next.is_some_and(|at| at <= now) {
                return Ok(letters.pop().map(|Reverse(letter)| (letter.from, letter.bytes)));
            }
            let until = next.map_or(deadline, |at| at.min(deadline));
            if now >= deadline {
                return Ok(None);
            }
            let waited = self.network.arrived.wait_timeout(state, until - now);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}
