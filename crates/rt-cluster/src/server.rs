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
        Self { ledger, fingerprint, patience, peers: (0..ranks).map(|_| peer()).collect(), again: 0 }
    }

    /// Takes a message of rank `from`; what is to be said to whom is added to `out`. Returns whether the bytes that
    /// followed the message are the first result of a tile, which counts.
    pub fn receive(&mut self, now: Duration, from: u32, message: ToServer, out: &mut Vec<(u32, ToWorker)>) -> bool {
        let own_host = self.peers.first().map(|own| own.report.host.clone()).unwrap_or_default();
        let Some(peer) = self.peers.get_mut(from as usize) else { return false };
        peer.heard = now;
        if let Standing::Lost(_) = peer.standing {
            // It was late, not lost. What it asked for meanwhile still holds.
            peer.standing = Standing::Present;
        }
        let mut is_first = false;
        match message {
            ToServer::Hello { fingerprint, host } => {
                peer.report.host = host;
                if fingerprint == self.fingerprint {
                    peer.standing = Standing::Present;
                    self.say(now, from, ToWorker::Welcome, out);
                } else {
                    let why = format!(
                        "scene, options or program of rank {from} on {} differ from those of rank 0 on {own_host}: start \
                         the same command with the same files on all nodes",
                        peer.report.host
                    );
                    self.say(now, from, ToWorker::Refused(why), out);
                    self.dismiss(from, Standing::Gone("scene, options or program differ from rank 0's".to_owned()));
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
            ToServer::Failed(why) => self.dismiss(from, Standing::Gone(why)),
        }
        self.serve(now, out);
        is_first
    }

    /// Notes that a rank is known to be lost.
    pub fn lose(&mut self, now: Duration, rank: u32, why: String, out: &mut Vec<(u32, ToWorker)>) {
        if self.peers.get(rank as usize).is_some_and(|peer| !matches!(peer.standing, Standing::Gone(_))) {
            self.dismiss(rank, Standing::Lost(why));
            self.serve(now, out);
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
                self.dismiss(rank, Standing::Lost(format!("was not heard of for {} s", limit.as_secs_f64())));
            } else if now.saturating_sub(peer.spoken) > self.patience.heartbeat && peer.standing == Standing::Present {
                self.say(now, rank, ToWorker::Alive, out);
            }
        }
        self.serve(now, out);
    }

    /// Gives ranks that want tiles what there is.
    ///
    /// Tiles are let late and in small numbers: what is let is decided. So where there are fewer tiles than ranks only
    /// a rank that is idle gets one.
    fn serve(&mut self, now: Duration, out: &mut Vec<(u32, ToWorker)>) {
        let is_present = |peer: &Peer| peer.standing == Standing::Present;
        let ranks = self.peers.iter().filter(|peer| is_present(peer)).count().max(1);
        for rank in 0..self.peers.len() as u32 {
            let free = self.ledger.free();
            let peer = &mut self.peers[rank as usize];
            let Some(Want { cost, is_idle }) = peer.want.filter(|_| peer.standing == Standing::Present) else {
                continue;
            };
            if free == 0 || (free < ranks && !is_idle) {
                continue;
            }
            peer.want = None;
            let most = (free / (2 * ranks)).clamp(1, MOST);
            let leases = self.ledger.let_to(rank, cost, most);
            self.say(now, rank, ToWorker::Lease(leases), out);
        }
    }

    fn dismiss(&mut self, rank: u32, standing: Standing) {
        let freed = self.ledger.retire(rank);
        let peer = &mut self.peers[rank as usize];
        peer.standing = standing;
        peer.report.dealt_again += freed;
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
        self.tell_all(now, &ToWorker::Finished { is_complete }, out);
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
