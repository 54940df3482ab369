//! That rank 0 is there is heard even while it does something else than exchange messages.

use crate::message::{NO_ROUND, Word, encode};
use crate::{Transport, TransportError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// A transport over which rank 0 says all the time that it is there: reading a scene, building its tree and writing
/// pictures take minutes, in which silence would say nothing.
pub(crate) struct Lifeline {
    shared: Arc<Shared>,
    keeper: Option<JoinHandle<()>>,
}

struct Shared {
    line: Mutex<Line>,
    is_over: Condvar,
}

struct Line {
    transport: Box<dyn Transport>,
    every: Duration,
    /// When the others were last told; `None` where there is nobody to tell.
    told: Option<Instant>,
    /// Ranks that take nothing any more.
    deaf: Vec<u32>,
    is_over: bool,
}

impl Lifeline {
    /// On rank 0 starts a thread that tells all others every so often.
    ///
    /// # Errors
    /// When there is no thread to be had.
    pub(crate) fn new(transport: Box<dyn Transport>, every: Duration) -> Result<Self, TransportError> {
        let tells = transport.rank() == 0 && transport.size() > 1;
        let mut line = Line { transport, every, told: None, deaf: Vec::new(), is_over: false };
        if tells {
            line.tell();
        }
        let shared = Arc::new(Shared { line: Mutex::new(line), is_over: Condvar::new() });
        let keep = {
            let shared = Arc::clone(&shared);
            move || shared.keep(every)
        };
        let start = || thread::Builder::new().name("lifeline".to_owned()).spawn(keep);
        let keeper = tells.then(start).transpose();
        let keeper = keeper.map_err(|error| TransportError(format!("no thread can be started: {error}")))?;
        Ok(Self { shared, keeper })
    }

    /// Leaves out a rank that takes nothing any more: what is sent to it would wait for ever.
    pub(crate) fn leave_out(&mut self, rank: u32) {
        self.shared.line().deaf.push(rank);
    }

    pub(crate) fn leaves_out(&self, rank: u32) -> bool {
        self.shared.line().deaf.contains(&rank)
    }

    /// The transport, for one call. The thread that tells gets no turn between short calls in a loop, so each of them
    /// tells when it is time.
    fn call<T>(&self, call: impl FnOnce(&mut dyn Transport) -> T) -> T {
        let mut line = self.shared.line();
        line.tell_in_time();
        call(&mut *line.transport)
    }
}

impl Shared {
    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn keep(&self, every: Duration) {
        let mut line = self.line();
        while !line.is_over {
            line.tell_in_time();
            line = self.is_over.wait_timeout(line, every).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Line {
    fn tell_in_time(&mut self) {
        if self.told.is_some_and(|told| told.elapsed() >= self.every) {
            self.tell();
        }
    }

    fn tell(&mut self) {
        self.told = Some(Instant::now());
        for to in (1..self.transport.size()).filter(|to| !self.deaf.contains(to)) {
            // Whoever exchanges messages next is told that it cannot.
            let _ = self.transport.send(to, encode(NO_ROUND, Word::Alive, &[]));
        }
    }
}

impl Drop for Lifeline {
    fn drop(&mut self) {
        self.shared.line().is_over = true;
        self.shared.is_over.notify_all();
        if let Some(keeper) = self.keeper.take() {
            // It does not panic, and there is nothing to be done about it here if it did.
            let _ = keeper.join();
        }
    }
}

impl Transport for Lifeline {
    fn rank(&self) -> u32 {
        self.shared.line().transport.rank()
    }

    fn size(&self) -> u32 {
        self.shared.line().transport.size()
    }

    fn send(&mut self, to: u32, message: Vec<u8>) -> Result<(), TransportError> {
        self.call(|transport| transport.send(to, message))
    }

    fn receive(&mut self, within: Duration) -> Result<Option<(u32, Vec<u8>)>, TransportError> {
        self.call(|transport| transport.receive(within))
    }

    fn lost(&mut self) -> Vec<(u32, String)> {
        self.call(|transport| transport.lost())
    }

    fn flush(&mut self, within: Duration) -> Result<usize, TransportError> {
        self.call(|transport| transport.flush(within))
    }
}
