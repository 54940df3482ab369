//! The thread that carries messages between a rank's decisions and its transport.

use crate::message::{decode, encode, round_of};
use crate::{
    ClusterError, ClusterReport, End, Lease, Ledger, Machine, Patience, Server, ToServer, ToWorker, Transport, Worker,
};
use rt_core::with_causes;
use std::error::Error;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How long the thread listens before it looks whether a tile is finished. That delays no computing: the next tile is
/// there already.
const LISTEN: Duration = Duration::from_millis(1);

/// How long the last messages may take to leave.
const LEAVE: Duration = Duration::from_secs(5);

/// What is dealt: tiles that any rank can compute from their number.
pub trait Job {
    /// Why this rank cannot compute any more.
    type Error: Error + Send + Sync + 'static;

    /// What a tile is expected to cost, in any unit that is the same on all ranks. It should take far less time than
    /// the tile. Each rank is asked for a share of the tiles, once.
    fn price(&mut self, tile: u32) -> f32;

    /// Computes a tile: the same bytes on every rank.
    ///
    /// # Errors
    /// When this rank can compute nothing any more; its tiles go to the others.
    fn compute(&mut self, tile: u32) -> Result<Vec<u8>, Self::Error>;
}

/// What is dealt to whom, and how.
#[derive(Clone, Debug)]
pub struct Deal<'a> {
    /// How many tiles there are.
    pub tiles: u32,
    /// Of everything that must be the same on all ranks for their results to fit together.
    pub fingerprint: u64,
    /// Which deal of several over the same transport this is; the same on all ranks.
    pub round: u32,
    /// What tiles cost, where that is known (as from the frame before) on rank 0; no rank may be asked then, so all
    /// must have `Some`.
    pub prices: Option<&'a [f32]>,
    /// On rank 0, tiles that are finished already.
    pub finished: &'a [u32],
    /// How long ranks wait for each other.
    pub patience: Patience,
    /// Set to `true` to stop: on rank 0 all ranks, elsewhere this one.
    pub cancel: Option<&'a AtomicBool>,
}

impl Deal<'_> {
    /// A deal of `tiles` tiles, of which nothing is known.
    #[must_use]
    pub fn new(tiles: u32, fingerprint: u64) -> Self {
        Self { tiles, fingerprint, round: 0, prices: None, finished: &[], patience: Patience::default(), cancel: None }
    }

    fn ledger(&self) -> Ledger {
        let mut ledger = Ledger::new(self.tiles);
        for (tile, &cost) in (0..).zip(self.prices.unwrap_or_default()) {
            ledger.price(Lease { tile, cost });
        }
        self.finished.iter().for_each(|&tile| {
            ledger.finish(tile);
        });
        ledger
    }

    fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}

/// A tile that is finished, as rank 0 gets it.
#[derive(Clone, Copy, Debug)]
pub struct Finished<'a> {
    /// The tile.
    pub tile: u32,
    /// Wall seconds that it took.
    pub seconds: f32,
    /// What [`Job::compute`] made of it.
    pub bytes: &'a [u8],
}

/// How a deal ended.
#[derive(Clone, Debug)]
pub struct Dealt {
    /// Whether no rank was lost, so that all can leave in good order.
    pub is_complete: bool,
    /// On rank 0, what was done by whom.
    pub report: Option<ClusterReport>,
}

/// Takes what is finished.
pub type Take<'a> = dyn FnMut(Finished<'_>) -> io::Result<()> + Send + 'a;

/// Computes this rank's part of a deal, and on rank 0 keeps what all ranks computed: `take` is called there once for
/// each tile that was not finished before, in any order, by another thread.
///
/// Returns when all tiles are finished. A rank that was lost is no error then: the report names it.
///
/// # Errors
/// When the tiles cannot be finished, or this rank cannot take part.
///
/// # Panics
/// Where the job does; the other ranks then do its part.
pub fn deal<J: Job>(
    transport: &mut dyn Transport,
    deal: &Deal<'_>,
    job: &mut J,
    take: &mut Take<'_>,
) -> Result<Dealt, ClusterError> {
    let (rank, size) = (transport.rank(), transport.size());
    let begin = Instant::now();
    let mut said = Vec::new();
    let worker = Worker::new(deal.patience, deal.fingerprint, Machine::this(), Duration::ZERO, &mut said);
    let desk = Desk { worker: Mutex::new(worker), changed: Condvar::new(), begin };
    let (tell, told) = channel();
    thread::scope(|threads| {
        let server =
            (rank == 0).then(|| Server::new(deal.ledger(), size, deal.fingerprint, deal.patience, Duration::ZERO));
        let courier = Courier { transport, deal, desk: &desk, server, take, sent: (0, 0) };
        let courier = threads.spawn(move || courier.run(said, &told));
        let failed = work(&desk, deal, rank..deal.tiles, size, job, tell);
        let ended = courier.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        match (ended, failed) {
            // On rank 0 the others finished it; the report says that rank 0 did not take part.
            (Ok(dealt), _) if rank == 0 => Ok(dealt),
            // The cause, not what followed from it.
            (_, Some(error)) => Err(ClusterError::Job(error)),
            (ended, None) => ended,
        }
    })
}

/// Where the thread that computes and the one that carries messages meet.
struct Desk {
    worker: Mutex<Worker>,
    /// There are tiles, or it is over.
    changed: Condvar,
    begin: Instant,
}

impl Desk {
    fn worker(&self) -> MutexGuard<'_, Worker> {
        // No step of a worker is left half done by a panic.
        self.worker.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Duration {
        self.begin.elapsed()
    }

    /// Waits for the next tile; `None` when it is over.
    fn next(&self) -> Option<u32> {
        let mut worker = self.worker();
        loop {
            if let Some(tile) = worker.take(self.now()) {
                return Some(tile);
            }
            if worker.end().is_some() {
                return None;
            }
            worker = self.changed.wait(worker).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// What the computing thread tells the other.
enum Told {
    Prices(Vec<Lease>),
    Done(Vec<u8>, Vec<ToServer>),
    Failed(String),
}

type JobError = Box<dyn Error + Send + Sync>;

/// Prices every `size`th tile, then computes until it is over; the error that ended it before.
fn work<J: Job>(
    desk: &Desk,
    deal: &Deal<'_>,
    tiles: std::ops::Range<u32>,
    size: u32,
    job: &mut J,
    tell: Sender<Told>,
) -> Option<JobError> {
    let priced = if deal.prices.is_some() { 0..0 } else { tiles };
    let is_over = || deal.is_cancelled() || desk.worker().end().is_some();
    let prices = priced.step_by(size as usize).take_while(|_| !is_over());
    let prices = prices.map(|tile| Lease { tile, cost: job.price(tile) }).collect();
    // Nobody listens any more when it is over.
    let _ = tell.send(Told::Prices(prices));
    while let Some(tile) = desk.next() {
        match job.compute(tile) {
            Ok(bytes) => {
                let mut said = Vec::new();
                desk.worker().done(desk.now(), &mut said);
                let _ = tell.send(Told::Done(bytes, said));
            }
            Err(error) => {
                let _ = tell.send(Told::Failed(with_causes(&error)));
                return Some(Box::new(error));
            }
        }
    }
    None
}

/// The thread that carries messages.
struct Courier<'a> {
    transport: &'a mut dyn Transport,
    deal: &'a Deal<'a>,
    desk: &'a Desk,
    /// On rank 0.
    server: Option<Server>,
    take: &'a mut Take<'a>,
    /// Messages and bytes that went in and out.
    sent: (u64, u64),
}

impl Courier<'_> {
    fn run(mut self, said: Vec<ToServer>, told: &Receiver<Told>) -> Result<Dealt, ClusterError> {
        let ended = self.carry(said, told);
        if let (Err(error), Some(server)) = (&ended, &mut self.server) {
            let mut out = Vec::new();
            server.stop(self.desk.now(), &with_causes(error), &mut out);
            // Whoever can be reached.
            let _ = self.tell(out);
        }
        let _ = self.transport.flush(LEAVE);
        // Whatever happened, nobody waits for this thread any longer.
        let mut worker = self.desk.worker();
        if worker.end().is_none() {
            let why = ended.as_ref().err().map_or_else(String::new, ToString::to_string);
            worker.receive(self.desk.now(), ToWorker::Stopped(why), &mut Vec::new());
        }
        let is_complete = worker.end() == Some(&End::Finished { is_complete: true });
        drop(worker);
        self.desk.changed.notify_all();
        ended?;
        let report = self.server.as_ref().map(|server| {
            let mut report = server.report();
            report.resumed = self.deal.finished.len() as u32;
            (report.messages, report.bytes) = self.sent;
            report.end(self.desk.now().as_secs_f64());
            report
        });
        Ok(Dealt { is_complete, report })
    }

    fn carry(&mut self, said: Vec<ToServer>, told: &Receiver<Told>) -> Result<(), ClusterError> {
        self.say(said, &[])?;
        let mut is_working = true;
        loop {
            while is_working {
                match told.try_recv() {
                    Ok(told) => is_working = self.hear_own(told)?,
                    Err(TryRecvError::Empty) => break,
                    // It ended without a word.
                    Err(TryRecvError::Disconnected) if self.desk.worker().end().is_none() => {
                        is_working = self.hear_own(Told::Failed("it panicked".to_owned()))?;
                    }
                    Err(TryRecvError::Disconnected) => break,
                }
            }
            let mut within = LISTEN;
            while let Some((from, bytes)) = self.transport.receive(within)? {
                self.sent = (self.sent.0 + 1, self.sent.1 + bytes.len() as u64);
                self.hear(from, &bytes)?;
                if self.server.is_none() && self.desk.worker().end().is_some() {
                    // What rank 0 says next is not of this deal.
                    break;
                }
                within = Duration::ZERO;
            }
            let (now, mut said) = (self.desk.now(), Vec::new());
            self.desk.worker().tick(now, &mut said);
            self.say(said, &[])?;
            if self.deal.is_cancelled() {
                return Err(ClusterError::Cancelled);
            }
            if self.look_after_ranks()? {
                return Ok(());
            }
            match self.desk.worker().end() {
                // Rank 0 is told by itself.
                None => {}
                Some(End::Finished { .. }) => return Ok(()),
                Some(End::Refused(why)) => return Err(ClusterError::Refused(why.clone())),
                Some(End::Stopped(why)) => return Err(ClusterError::Stopped(why.clone())),
                Some(End::ServerLost(why)) => return Err(ClusterError::ServerLost(why.clone())),
            }
            if !is_working && self.server.is_none() {
                // The job's own error says why.
                return Ok(());
            }
        }
    }

    /// On rank 0: whether all is finished.
    fn look_after_ranks(&mut self) -> Result<bool, ClusterError> {
        let (now, mut out) = (self.desk.now(), Vec::new());
        let lost = self.transport.lost();
        let Some(server) = &mut self.server else {
            if let Some((_, why)) = lost.into_iter().find(|(rank, _)| *rank == 0) {
                self.desk.worker().lose_server(why);
                self.desk.changed.notify_all();
            }
            return Ok(false);
        };
        for (rank, why) in lost {
            server.lose(now, rank, why, &mut out);
        }
        server.tick(now, &mut out);
        if let Some(error) = server.nobody_left() {
            return Err(error);
        }
        let is_finished = server.is_finished();
        if is_finished {
            server.finish(now, &mut out);
        }
        self.tell(out)?;
        Ok(is_finished)
    }

    /// Takes what the computing thread tells; whether it goes on.
    fn hear_own(&mut self, told: Told) -> Result<bool, ClusterError> {
        match told {
            Told::Prices(prices) => {
                let mut said = Vec::new();
                self.desk.worker().priced(self.desk.now(), prices, &mut said);
                self.say(said, &[])?;
            }
            Told::Done(bytes, said) => self.say(said, &bytes)?,
            Told::Failed(why) => {
                self.say(vec![ToServer::Failed(why)], &[])?;
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Takes a message from outside.
    fn hear(&mut self, from: u32, bytes: &[u8]) -> Result<(), ClusterError> {
        let is_of_this_deal = round_of(from, bytes)? == self.deal.round;
        if self.server.is_some() {
            if is_of_this_deal {
                let (_, message, payload) = decode(from, bytes)?;
                self.serve(from, message, payload)?;
            }
            return Ok(());
        }
        if from == 0 {
            self.desk.worker().hear_of_server(self.desk.now());
        }
        if is_of_this_deal {
            let (_, message, _) = decode(from, bytes)?;
            let mut said = Vec::new();
            self.desk.worker().receive(self.desk.now(), message, &mut said);
            self.desk.changed.notify_all();
            self.say(said, &[])?;
        }
        Ok(())
    }

    /// On rank 0: takes what a rank says.
    fn serve(&mut self, from: u32, message: ToServer, payload: &[u8]) -> Result<(), ClusterError> {
        let Some(server) = &mut self.server else { return Ok(()) };
        let finished = match message {
            ToServer::Done { tile, seconds } => Some(Finished { tile, seconds, bytes: payload }),
            _ => None,
        };
        let mut out = Vec::new();
        if server.receive(self.desk.now(), from, message, &mut out)
            && let Some(finished) = finished
        {
            (self.take)(finished).map_err(ClusterError::Keep)?;
        }
        self.tell(out)
    }

    /// Says to rank 0 what this rank has to say; `payload` follows what is finished.
    fn say(&mut self, said: Vec<ToServer>, payload: &[u8]) -> Result<(), ClusterError> {
        for message in said {
            let payload = if matches!(message, ToServer::Done { .. }) { payload } else { &[] };
            if self.server.is_some() {
                self.serve(0, message, payload)?;
            } else {
                self.send(0, encode(self.deal.round, message, payload))?;
            }
        }
        Ok(())
    }

    /// Says to ranks what rank 0 has to say.
    fn tell(&mut self, mut out: Vec<(u32, ToWorker)>) -> Result<(), ClusterError> {
        out.reverse();
        while let Some((rank, message)) = out.pop() {
            if rank > 0 {
                self.send(rank, encode(self.deal.round, message, &[]))?;
                continue;
            }
            let mut said = Vec::new();
            self.desk.worker().receive(self.desk.now(), message, &mut said);
            self.desk.changed.notify_all();
            self.say(said, &[])?;
        }
        Ok(())
    }

    fn send(&mut self, to: u32, bytes: Vec<u8>) -> Result<(), ClusterError> {
        self.sent = (self.sent.0 + 1, self.sent.1 + bytes.len() as u64);
        Ok(self.transport.send(to, bytes)?)
    }
}
