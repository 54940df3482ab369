//! Rank 0's side of a deal: whom to give what.

use crate::{ClusterError, ClusterReport, Ledger, Patience, RankReport, ToServer, ToWorker};
use std::time::Duration;

/// Most tiles of one lease: its message stays below what transports send at once (4 KiB over shared memory).
const MOST: usize = 256;

/// Rank 0's side of a deal: decides what each rank is told. Does no I/O and knows no clock: times are since any moment
/// that stays the same.
#[derive(Debug)]
pub struct Server {
    ledger: Ledger,
    fingerprint: u64,
    patience: Patience,
    peers: Vec<Peer>,
    /// How many of them are present.
    present: usize,
    again: u32,
}

#[derive(Debug)]
struct Peer {
    standing: Standing,
    /// When it was last heard of, and last spoken to.
    heard: Duration,
    spoken: Duration,
    /// What it asked for and did not get yet.
    want: Option<Want>,
    report: RankReport,
}

#[derive(Clone, Copy, Debug)]
struct Want {
    cost: f32,
    is_idle: bool,
}

#[derive(Clone, Debug, PartialEq)]
enum Standing {
    /// Was not heard of yet.
    Awaited,
    Present,
    /// Is not heard of any more; it may come back.
    Lost(String),
    /// Said itself that it can do no more, or has another job.
    Gone(String),
}

impl Server {
    /// A deal of what `ledger` says is not finished, to ranks `0..ranks` that have the same `fingerprint`.
    #[must_use]
    pub fn new(ledger: Ledger, ranks: u32, fingerprint: u64, patience: Patience, now: Duration) -> Self {
        let peer =
            || Peer { standing: Standing::Awaited, heard: now, spoken: now, want: None, report: RankReport::default() };
        Self { ledger, fingerprint, patience, peers: (0..ranks).map(|_| peer()).collect(), present: 0, again: 0 }
    }

    /// Takes a message of rank `from`; what is to be said to whom is added to `out`. Returns whether the bytes that
    /// followed the message are the first result of a tile, which counts.
    pub fn receive(&mut self, now: Duration, from: u32, message: ToServer, out: &mut Vec<(u32, ToWorker)>) -> bool {
        let Some(peer) = self.peers.get_mut(from as usize) else { return false };
        peer.heard = now;
        if let Standing::Lost(_) = peer.standing {
            // It was late, not lost. What it asked for meanwhile still holds.
            self.stand(from, Standing::Present);
        }
        let peer = &mut self.peers[from as usize];
        let mut is_first = false;
        match message {
            ToServer::Hello { fingerprint, machine } => {
                (peer.report.host, peer.report.memory_bytes) = (machine.host, machine.memory);
                if fingerprint == self.fingerprint {
                    self.stand(from, Standing::Present);
                    self.say(now, from, ToWorker::Welcome, out);
                } else {
                    self.refuse(now, from, out);
                }
            }
            ToServer::Prices(prices) => prices.into_iter().for_each(|price| self.ledger.price(price)),
            ToServer::Ask { cost, is_idle } => peer.want = Some(Want { cost, is_idle }),
            ToServer::Done { tile, seconds } => {
                is_first = self.ledger.finish(tile);
                if is_first {
                    peer.report.tiles += 1;
                    peer.report.busy_s += f64::from(seconds);
                } else {
                    self.again += 1;
                }
            }
            ToServer::Alive => {}
            ToServer::Failed(why) => self.dismiss(now, from, Standing::Gone(why), out),
        }
        self.serve(now, from, out);
        is_first
    }

    /// Sends a rank away that has another job.
    fn refuse(&mut self, now: Duration, rank: u32, out: &mut Vec<(u32, ToWorker)>) {
        let [host, own] = [rank, 0].map(|rank| &self.peers[rank as usize].report.host);
        let why = format!(
            "scene, options or program of rank {rank} on {host} differ from those of rank 0 on {own}: start the same \
             command with the same files on all nodes"
        );
        self.say(now, rank, ToWorker::Refused(why), out);
        self.dismiss(now, rank, Standing::Gone("scene, options or program differ from rank 0's".to_owned()), out);
    }

    /// Notes that a rank is known to be lost.
    pub fn lose(&mut self, now: Duration, rank: u32, why: String, out: &mut Vec<(u32, ToWorker)>) {
        if self.peers.get(rank as usize).is_some_and(|peer| !matches!(peer.standing, Standing::Gone(_))) {
            self.dismiss(now, rank, Standing::Lost(why), out);
        }
    }

    /// Looks at the time: who was silent for too long, and who was not spoken to for long.
    pub fn tick(&mut self, now: Duration, out: &mut Vec<(u32, ToWorker)>) {
        for rank in 0..self.peers.len() as u32 {
            let peer = &self.peers[rank as usize];
            let silent = now.saturating_sub(peer.heard);
            let limit = match peer.standing {
                Standing::Awaited => self.patience.welcome,
                // Rank 0 hears itself.
                Standing::Present if rank > 0 => self.patience.rank,
                _ => Duration::MAX,
            };
            if silent > limit {
                let why = format!("was not heard of for {} s", limit.as_secs_f64());
                self.dismiss(now, rank, Standing::Lost(why), out);
            } else if now.saturating_sub(peer.spoken) > self.patience.heartbeat && peer.standing == Standing::Present {
                self.say(now, rank, ToWorker::Alive, out);
            }
        }
    }

    /// Gives a rank what it wants, if there is something.
    ///
    /// Tiles are let late and in small numbers: what is let is decided. So where there are fewer tiles than ranks only
    /// a rank that is idle gets one.
    fn serve(&mut self, now: Duration, rank: u32, out: &mut Vec<(u32, ToWorker)>) {
        let (free, ranks) = (self.ledger.free(), self.present.max(1));
        let peer = &mut self.peers[rank as usize];
        let Some(Want { cost, is_idle }) = peer.want.filter(|_| peer.standing == Standing::Present) else { return };
        if free == 0 || (free < ranks && !is_idle) {
            return;
        }
        peer.want = None;
        let most = (free / (2 * ranks)).clamp(1, MOST);
        let leases = self.ledger.let_to(rank, cost, most);
        self.say(now, rank, ToWorker::Lease(leases), out);
    }

    /// Notes how a rank stands.
    fn stand(&mut self, rank: u32, standing: Standing) {
        let peer = &mut self.peers[rank as usize];
        self.present += usize::from(standing == Standing::Present);
        self.present -= usize::from(peer.standing == Standing::Present);
        peer.standing = standing;
    }

    /// Takes from a rank what it has, for the others.
    fn dismiss(&mut self, now: Duration, rank: u32, standing: Standing, out: &mut Vec<(u32, ToWorker)>) {
        self.stand(rank, standing);
        let freed = self.ledger.retire(rank);
        self.peers[rank as usize].report.dealt_again += freed;
        // Also where nothing came free: the last tiles are shared among fewer.
        (0..self.peers.len() as u32).for_each(|rank| self.serve(now, rank, out));
    }

    fn say(&mut self, now: Duration, rank: u32, message: ToWorker, out: &mut Vec<(u32, ToWorker)>) {
        self.peers[rank as usize].spoken = now;
        out.push((rank, message));
    }

    /// Whether all tiles are finished.
    #[must_use]
    pub const fn is_finished(&self) -> bool {
        self.ledger.unfinished() == 0
    }

    /// That no rank is left that could finish the tiles, if so.
    #[must_use]
    pub fn nobody_left(&self) -> Option<ClusterError> {
        let lost = self.peers.iter().map(|peer| match &peer.standing {
            Standing::Awaited | Standing::Present => None,
            Standing::Lost(why) | Standing::Gone(why) => Some(why.clone()),
        });
        let ranks = (0..).zip(lost).map(|(rank, why)| Some((rank, why?))).collect::<Option<Vec<_>>>()?;
        (!self.is_finished()).then_some(ClusterError::NobodyLeft { unfinished: self.ledger.unfinished(), ranks })
    }

    /// Tells every rank that might listen that all is finished.
    pub fn finish(&mut self, now: Duration, out: &mut Vec<(u32, ToWorker)>) {
        let is_complete = self.peers.iter().all(|peer| matches!(peer.standing, Standing::Present | Standing::Awaited));
        self.tell_all(now, &ToWorker::Finished { is_complete, fingerprint: self.fingerprint }, out);
    }

    /// Tells every rank that might listen to stop.
    pub fn stop(&mut self, now: Duration, why: &str, out: &mut Vec<(u32, ToWorker)>) {
        self.tell_all(now, &ToWorker::Stopped(why.to_owned()), out);
    }

    fn tell_all(&mut self, now: Duration, message: &ToWorker, out: &mut Vec<(u32, ToWorker)>) {
        for rank in 0..self.peers.len() as u32 {
            if !matches!(self.peers[rank as usize].standing, Standing::Gone(_)) {
                self.say(now, rank, message.clone(), out);
            }
        }
    }

    /// What was done so far, and by whom.
    #[must_use]
    pub fn report(&self) -> ClusterReport {
        let rank = |peer: &Peer| {
            let lost = match &peer.standing {
                Standing::Lost(why) | Standing::Gone(why) => Some(why.clone()),
                Standing::Awaited | Standing::Present => None,
            };
            RankReport { lost, ..peer.report.clone() }
        };
        let ranks = self.peers.iter().map(rank).collect();
        ClusterReport { tiles: self.ledger.tiles(), again: self.again, ranks, ..ClusterReport::default() }
    }
}
