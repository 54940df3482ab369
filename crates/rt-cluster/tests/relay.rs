//! What rank 0 tells all others before they deal, and hears of each afterwards.

use proptest::prelude::*;
use rt_cluster::local::{LocalRank, Weather, network};
use rt_cluster::{ClusterError, Deal, Finished, Job, Patience, Relay, Transport, deal};
use std::convert::Infallible;
use std::sync::Mutex;
use std::thread;
use std::time::{Duration, Instant};

struct Numbers;

impl Job for Numbers {
    type Error = Infallible;

    fn price(&mut self, _: u32) -> f32 {
        1.0
    }

    fn compute(&mut self, tile: u32) -> Result<Vec<u8>, Infallible> {
        Ok(tile.to_le_bytes().to_vec())
    }
}

fn relay(rank: LocalRank, patience: Patience) -> Relay<'static> {
    Relay::new(Box::new(rank), patience, None).expect("a thread")
}

/// Seconds by which the clock of each rank is ahead of the one before.
const AHEAD_S: f64 = 100.0;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Guards: everybody gets every byte in its place, whatever the tree of ranks and however messages of the deal
    /// overtake them; and clocks are told as they are. Fails when a rank does not pass on, or when a message of the
    /// deal is lost or taken for a part of what is told.
    #[test]
    fn everybody_hears_what_rank_0_tells(
        size in prop::sample::select(vec![0_usize, 1, 1 << 20, (1 << 20) + 1, 2_500_000]),
        ranks in 1..9_u32, seed: u32, delay in 0..4_u64,
    ) {
        let content: Vec<u8> = (0..size).map(|i| (i as u32).wrapping_mul(2_654_435_761).to_le_bytes()[3]).collect();
        let taken = Mutex::new(vec![0_u32; 20]);
        let began = Instant::now();
        let weather = Weather { seed, delay: Duration::from_millis(delay) };
        thread::scope(|threads| {
            for rank in network(ranks, weather) {
                let (content, taken) = (&content, &taken);
                threads.spawn(move || {
                    let number = rank.rank();
                    // Short, so that a failure of one ends the others.
                    let patience = Patience { welcome: Duration::from_secs(60), ..Patience::default() };
                    let mut relay = relay(rank, patience);
                    if number == 0 {
                        relay.tell(&size).expect("all are there");
                        relay.send(content).expect("all are there");
                    } else {
                        let mut heard = vec![0; relay.hear::<usize>().expect("a number")];
                        relay.receive(&mut heard).expect("all of it");
                        assert!(heard == *content, "rank {number}");
                    }
                    let mut take = |done: Finished<'_>| {
                        taken.lock().expect("no panic")[done.tile as usize] += 1;
                        Ok(())
                    };
                    deal(&mut relay, &Deal::new(20, 7), &mut Numbers, &mut take).expect("a deal");
                    let clock = || began.elapsed() + Duration::from_secs_f64(AHEAD_S * f64::from(number));
                    if number > 0 {
                        relay.answer(&number.to_le_bytes(), &clock).expect("rank 0 asks");
                        return;
                    }
                    let others: Vec<u32> = (1..ranks).collect();
                    for (&other, heard) in others.iter().zip(relay.ask(&others, &clock).expect("all answer")) {
                        let heard = heard.expect("an answer");
                        assert_eq!(heard.bytes, other.to_le_bytes());
                        let wrong = (heard.clock_ahead_s - AHEAD_S * f64::from(other)).abs();
                        assert!(wrong <= heard.round_trip_s / 2.0 + 1e-6, "{heard:?}");
                    }
                });
            }
        });
        prop_assert!(taken.into_inner().expect("no panic").iter().all(|&times| times == 1));
    }
}

/// Fails when a rank waits for ever for one that passes nothing on, or those that hear are kept waiting.
#[test]
fn whoever_hears_nothing_says_of_whom() {
    let patience = Patience { welcome: Duration::from_millis(300), ..Patience::default() };
    let heard: Vec<Result<(), ClusterError>> = thread::scope(|threads| {
        let start = |rank: LocalRank| {
            threads.spawn(move || {
                let number = rank.rank();
                let mut relay = relay(rank, patience);
                match number {
                    0 => relay.send(b"a scene"),
                    // Dies before it has passed on anything.
                    1 => Ok(()),
                    _ => relay.receive(&mut [0; 7]),
                }
            })
        };
        let running: Vec<_> = network(4, Weather::CALM).into_iter().map(start).collect();
        running.into_iter().map(|rank| rank.join().expect("no panic")).collect()
    });
    assert!(heard[0].is_ok() && heard[2].is_ok(), "{heard:?}");
    let error = heard[3].as_ref().expect_err("rank 1 is dead").to_string();
    assert!(error.contains("rank 1 sent nothing"), "{error}");
}

/// Fails when the silence of a rank 0 that has much to do is taken for its death: while it reads a scene, between two
/// deals, and before it asks.
#[test]
fn a_busy_rank_0_is_waited_for() {
    let patience = Patience {
        heartbeat: Duration::from_millis(20),
        server: Duration::from_secs(2),
        welcome: Duration::from_secs(2),
        ..Patience::default()
    };
    let is_busy = || thread::sleep(Duration::from_secs(3));
    thread::scope(|threads| {
        for rank in network(4, Weather::CALM) {
            threads.spawn(move || {
                let number = rank.rank();
                let mut relay = relay(rank, patience);
                let mut take = |_: Finished<'_>| Ok(());
                if number > 0 {
                    relay.receive(&mut [0; 7]).expect("a scene");
                    deal(&mut relay, &Deal { patience, ..Deal::new(20, 7) }, &mut Numbers, &mut take).expect("a deal");
                    relay.answer(&[], &|| Duration::ZERO).expect("questions");
                    return;
                }
                is_busy();
                relay.send(b"a scene").expect("all are there");
                is_busy();
                deal(&mut relay, &Deal { patience, ..Deal::new(20, 7) }, &mut Numbers, &mut take).expect("a deal");
                is_busy();
                assert!(relay.ask(&[1, 2, 3], &|| Duration::ZERO).expect("all are there").iter().all(Option::is_some));
            });
        }
    });
}

/// Fails when a rank waits for a dead rank 0 as long as for one that it never heard of.
#[test]
fn a_dead_rank_0_is_noticed_wherever_one_waits_for_it() {
    let patience = Patience {
        heartbeat: Duration::from_millis(20),
        server: Duration::from_millis(300),
        welcome: Duration::from_secs(3600),
        ..Patience::default()
    };
    let ends: Vec<ClusterError> = thread::scope(|threads| {
        let start = |rank: LocalRank| {
            threads.spawn(move || {
                let number = rank.rank();
                let mut relay = relay(rank, patience);
                match number {
                    // Dies at once, having said that it is there.
                    0 => Ok(()),
                    1 => relay.receive(&mut [0; 7]),
                    2 => relay.answer(&[], &|| Duration::ZERO),
                    _ => deal(&mut relay, &Deal { patience, ..Deal::new(20, 7) }, &mut Numbers, &mut |_| Ok(()))
                        .map(drop),
                }
            })
        };
        let running: Vec<_> = network(4, Weather::CALM).into_iter().map(start).collect();
        running.into_iter().filter_map(|rank| rank.join().expect("no panic").err()).collect()
    });
    assert_eq!(ends.len(), 3);
    assert!(
        ends.iter().all(|end| end.to_string().contains("rank 0 is lost (it was not heard of for 0.3 s)")),
        "{ends:?}"
    );
}
