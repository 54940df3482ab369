//! Deals between threads, over a network that delays messages and lets ranks die.

use proptest::prelude::*;
use rt_cluster::local::{LocalRank, Weather, network};
use rt_cluster::{ClusterError, Deal, Dealt, Finished, Job, Patience, deal};
use std::fmt;
use std::sync::{Mutex, mpsc};
use std::thread;
use std::time::Duration;

/// Tiles whose bytes are their number's square; from the `fails`th on, computing fails.
struct Squares {
    fails: usize,
}

#[derive(Debug)]
struct OutOfOrder;

impl fmt::Display for OutOfOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "out of order")
    }
}

impl std::error::Error for OutOfOrder {}

impl Job for Squares {
    type Error = OutOfOrder;

    fn price(&mut self, tile: u32) -> f32 {
        (tile % 7) as f32
    }

    fn compute(&mut self, tile: u32) -> Result<Vec<u8>, OutOfOrder> {
        self.fails = self.fails.checked_sub(1).ok_or(OutOfOrder)?;
        Ok((u64::from(tile) * u64::from(tile)).to_le_bytes().to_vec())
    }
}

/// Short where ranks die, so that it is noticed soon. Where the machine is busy that causes false alarms, which are to
/// do no harm either.
const SHORT: Patience = Patience {
    heartbeat: Duration::from_millis(10),
    rank: Duration::from_millis(60),
    server: Duration::from_secs(20),
    welcome: Duration::from_secs(20),
};

type Ended = Result<Dealt, ClusterError>;

/// How it ended for every rank, and how often each tile was taken; wrong bytes count a thousand times.
fn run(ranks: Vec<(LocalRank, Squares)>, about: &Deal<'_>) -> (Vec<Ended>, Vec<u32>) {
    let taken = Mutex::new(vec![0_u32; about.tiles as usize]);
    let ends = thread::scope(|threads| {
        let start = |(mut rank, mut job): (LocalRank, Squares)| {
            let taken = &taken;
            threads.spawn(move || {
                let mut take = |Finished { tile, bytes, .. }: Finished<'_>| {
                    let is_right = bytes == (u64::from(tile) * u64::from(tile)).to_le_bytes();
                    taken.lock().expect("no panic")[tile as usize] += if is_right { 1 } else { 1000 };
                    Ok(())
                };
                deal(&mut rank, about, &mut job, &mut take)
            })
        };
        let running: Vec<_> = ranks.into_iter().map(start).collect();
        running.into_iter().map(|rank| rank.join().expect("no panic")).collect()
    });
    (ends, taken.into_inner().expect("no panic"))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Guards: the thread between decisions and transport loses nothing. Fails when a message to rank 0 itself is
    /// dropped, when a tile's bytes go with another tile, or when a rank that computes nothing more keeps its tiles.
    #[test]
    fn every_tile_is_taken_once_with_its_own_bytes(
        tiles in 0..60_u32, seed: u32, delay in 0..4_u64,
        ranks in prop::collection::vec((prop::option::of(0..40_u32), prop::option::of(0..20_usize)), 1..5),
    ) {
        let weather = Weather { seed, delay: Duration::from_millis(delay) };
        let about = Deal { patience: SHORT, ..Deal::new(tiles, 7) };
        let network = network(ranks.len() as u32, weather).into_iter();
        let mut dying = Vec::new();
        let all = network.zip(&ranks).enumerate().map(|(number, (rank, &(life, fails)))| {
            let (life, fails) = if number == 0 { (None, None) } else { (life, fails) };
            dying.push(life.is_some() || fails.is_some());
            let rank = if let Some(life) = life { rank.dying_after(life) } else { rank };
            (rank, Squares { fails: fails.unwrap_or(usize::MAX) })
        });
        let (ends, taken) = run(all.collect(), &about);
        prop_assert!(taken.iter().all(|&count| count == 1), "{taken:?}");
        for (end, is_dying) in ends.iter().zip(dying) {
            prop_assert!(end.is_ok() || is_dying, "{end:?}");
        }
        let Ok(Dealt { report: Some(report), .. }) = &ends[0] else { panic!("{:?}", ends[0]) };
        prop_assert_eq!(report.ranks.iter().map(|rank| rank.tiles).sum::<u32>(), tiles);
    }
}

fn whole(ranks: u32) -> Vec<(LocalRank, Squares)> {
    network(ranks, Weather::CALM).into_iter().map(|rank| (rank, Squares { fails: usize::MAX })).collect()
}

#[test]
fn what_is_finished_already_is_not_done_again() {
    let finished = [3, 4, 5, 19];
    let about = Deal { finished: &finished, ..Deal::new(20, 0) };
    let (ends, taken) = run(whole(3), &about);
    assert!((0..).zip(&taken).all(|(tile, &count)| count == u32::from(!finished.contains(&tile))), "{taken:?}");
    assert_eq!(ends[0].as_ref().expect("all tiles").report.as_ref().map(|report| report.resumed), Some(4));
}

/// Rank 0's job: its first tile takes as long as the other rank does.
struct Patient {
    other: mpsc::Receiver<()>,
}

impl Job for Patient {
    type Error = OutOfOrder;

    fn price(&mut self, _: u32) -> f32 {
        1.0
    }

    fn compute(&mut self, _: u32) -> Result<Vec<u8>, OutOfOrder> {
        // An error once the other has gone.
        let _ = self.other.recv();
        Ok(Vec::new())
    }
}

/// Fails when ranks with another job are dealt tiles, or wait for ever.
#[test]
fn a_rank_with_another_job_is_sent_away_by_name() {
    let mut ranks = network(2, Weather::CALM);
    let (mut other, mut own) = (ranks.pop().expect("rank 1"), ranks.pop().expect("rank 0"));
    let (tell, told) = mpsc::channel();
    let mut taken = 0;
    let mut take = |_: Finished<'_>| {
        taken += 1;
        Ok(())
    };
    let (report, refused) = thread::scope(|threads| {
        let other = threads.spawn(move || {
            let ended = deal(&mut other, &Deal::new(10, 1), &mut Squares { fails: 0 }, &mut |_| Ok(()));
            drop(tell);
            ended
        });
        let report = deal(&mut own, &Deal::new(10, 0), &mut Patient { other: told }, &mut take);
        (report.expect("all tiles").report.expect("a report"), other.join().expect("no panic"))
    });
    assert_eq!(taken, 10);
    let error = refused.expect_err("another job").to_string();
    assert!(error.contains("rank 1") && error.contains("same files"), "{error}");
    let lost: Vec<_> = report.lost().collect();
    assert!(matches!(&lost[..], [(1, why)] if why.contains("differ")), "{lost:?}");
}

/// Fails when a rank that comes when all is finished takes what others did for what it was to do.
#[test]
fn a_rank_with_another_job_is_sent_away_however_late() {
    let mut ranks = network(2, Weather::CALM);
    let (mut late, mut own) = (ranks.pop().expect("rank 1"), ranks.pop().expect("rank 0"));
    let job = || Squares { fails: usize::MAX };
    deal(&mut own, &Deal::new(10, 0), &mut job(), &mut |_| Ok(())).expect("all tiles, without the other");
    let error = deal(&mut late, &Deal::new(10, 1), &mut job(), &mut |_| Ok(())).expect_err("another job").to_string();
    assert!(error.contains("same files"), "{error}");
}

#[test]
fn when_all_fail_the_reason_is_told() {
    let ranks = network(2, Weather::CALM).into_iter().map(|rank| (rank, Squares { fails: 1 })).collect();
    let (ends, _) = run(ranks, &Deal { patience: SHORT, ..Deal::new(20, 0) });
    for end in ends {
        let error = end.expect_err("nobody is left");
        let ClusterError::Job(source) = error else { panic!("{error}") };
        assert_eq!(source.to_string(), "out of order");
    }
}

/// Fails when the others wait for a dead rank 0, or take its tiles for finished.
#[test]
fn the_loss_of_rank_0_is_an_error_that_says_so() {
    let patience = Patience { server: Duration::from_millis(200), welcome: Duration::from_millis(400), ..SHORT };
    let about = Deal { patience, ..Deal::new(200, 0) };
    // Rank 0 computes nothing, so that it has much to say before all is finished.
    let mut ranks = whole(3);
    let (own, _) = ranks.remove(0);
    ranks.insert(0, (own.dying_after(9), Squares { fails: 0 }));
    let (ends, _) = run(ranks, &about);
    assert!(ends[0].is_err(), "{:?}", ends[0]);
    for end in &ends[1..] {
        let error = end.as_ref().expect_err("rank 0 is dead").to_string();
        assert!(error.contains("rank 0") && error.contains("lost"), "{error}");
    }
}

/// Fails when what cannot be kept is taken for kept.
#[test]
fn what_cannot_be_kept_stops_all() {
    let ends: Vec<Ended> = thread::scope(|threads| {
        let start = |(mut rank, mut job): (LocalRank, Squares)| {
            threads.spawn(move || {
                let mut full = |_: Finished<'_>| Err(std::io::Error::other("the disk is full"));
                deal(&mut rank, &Deal::new(50, 0), &mut job, &mut full)
            })
        };
        let running: Vec<_> = whole(2).into_iter().map(start).collect();
        running.into_iter().map(|rank| rank.join().expect("no panic")).collect()
    });
    assert!(matches!(ends[0], Err(ClusterError::Keep(_))), "{:?}", ends[0]);
    assert!(matches!(&ends[1], Err(ClusterError::Stopped(why)) if why.contains("disk is full")), "{:?}", ends[1]);
}
