//! Who has which tile, and which tiles are finished.

use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BTreeSet;

/// A tile and what it is expected to cost, in any unit that is the same for all tiles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lease {
    /// Number of the tile.
    pub tile: u32,
    /// Its expected cost.
    pub cost: f32,
}

/// The state of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Free,
    /// Let to this rank.
    Let(u32),
    Finished,
}

/// Who has which tile, and which are finished.
///
/// Tiles are let most expensive first (longest processing time first, R. L. Graham 1969; ties go to the lowest number),
/// and those without a price before all others, since any of them could be the longest. What a lost rank had is free
/// again; if it finishes a tile nonetheless, the first result counts.
#[derive(Clone, Debug)]
pub struct Ledger {
    states: Vec<State>,
    prices: Vec<Option<f32>>,
    /// The free tiles in the order they are let in.
    free: BTreeSet<(Reverse<u32>, u32)>,
    unfinished: u32,
}

impl Ledger {
    /// `tiles` tiles, none of which is let, finished or priced.
    #[must_use]
    pub fn new(tiles: u32) -> Self {
        let count = tiles as usize;
        let mut ledger = Self {
            states: vec![State::Free; count],
            prices: vec![None; count],
            free: BTreeSet::new(),
            unfinished: tiles,
        };
        ledger.free = (0..tiles).map(|tile| ledger.place(tile)).collect();
        ledger
    }

    /// Notes what a tile is expected to cost. A price that is no number, or below 0, and a tile that is none are passed
    /// over.
    pub fn price(&mut self, Lease { tile, cost }: Lease) {
        let Some(&state) = self.states.get(tile as usize) else { return };
        if !cost.is_finite() || cost < 0.0 {
            return;
        }
        let before = self.place(tile);
        self.prices[tile as usize] = Some(cost);
        if state == State::Free {
            self.free.remove(&before);
            self.free.insert(self.place(tile));
        }
    }

    /// Where a tile stands among the free ones. Floats that are not negative are in the order of their bits.
    fn place(&self, tile: u32) -> (Reverse<u32>, u32) {
        (Reverse(self.prices[tile as usize].map_or(u32::MAX, |price| (price + 0.0).to_bits())), tile)
    }

    /// Lets tiles of a total cost to a rank: at least one, if there is one, and at most `most`.
    pub fn let_to(&mut self, rank: u32, cost: f32, most: usize) -> Vec<Lease> {
        let mut leases = Vec::new();
        let mut sum = 0.0;
        while leases.is_empty() || (sum < cost && leases.len() < most) {
            let Some((_, tile)) = self.free.pop_first() else { break };
            self.states[tile as usize] = State::Let(rank);
            let cost = self.prices[tile as usize].unwrap_or(0.0);
            sum += cost;
            leases.push(Lease { tile, cost });
        }
        leases
    }

    /// Notes that a rank finished a tile; whether that is the first result of it, which counts.
    pub fn finish(&mut self, tile: u32) -> bool {
        let Some(&state) = self.states.get(tile as usize) else { return false };
        match state {
            State::Finished => return false,
            State::Free => {
                self.free.remove(&self.place(tile));
            }
            State::Let(_) => {}
        }
        self.states[tile as usize] = State::Finished;
        self.unfinished -= 1;
        true
    }

    /// Frees what a rank has; says how many tiles that is.
    pub fn retire(&mut self, rank: u32) -> u32 {
        let mut freed = 0;
        for tile in 0..self.states.len() as u32 {
            if self.states[tile as usize] == State::Let(rank) {
                self.states[tile as usize] = State::Free;
                self.free.insert(self.place(tile));
                freed += 1;
            }
        }
        freed
    }

    /// How many tiles there are.
    #[must_use]
    pub fn tiles(&self) -> u32 {
        self.states.len() as u32
    }

    /// How many tiles nobody has.
    #[must_use]
    pub fn free(&self) -> usize {
        self.free.len()
    }

    /// How many tiles are not finished.
    #[must_use]
    pub const fn unfinished(&self) -> u32 {
        self.unfinished
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tiles(leases: &[Lease]) -> Vec<u32> {
        leases.iter().map(|lease| lease.tile).collect()
    }

    #[test]
    fn the_most_expensive_come_first_and_those_without_a_price_before_them() {
        let mut ledger = Ledger::new(5);
        for (tile, cost) in [(0, 1.0), (1, 3.0), (2, 3.0), (4, 2.0), (4, f32::NAN), (4, -1.0), (99, 1.0)] {
            ledger.price(Lease { tile, cost });
        }
        assert_eq!(tiles(&ledger.let_to(0, 0.0, 9)), [3]);
        assert_eq!(tiles(&ledger.let_to(0, 5.0, 9)), [1, 2]);
        assert_eq!(tiles(&ledger.let_to(0, 9.0, 1)), [4]);
        assert_eq!(tiles(&ledger.let_to(0, 9.0, 9)), [0]);
        assert_eq!(ledger.let_to(0, 9.0, 9), []);
    }

    #[test]
    fn a_lost_rank_s_tiles_are_let_again_and_the_first_result_counts() {
        let mut ledger = Ledger::new(3);
        assert_eq!(ledger.let_to(1, f32::MAX, 2).len(), 2);
        assert!(ledger.finish(0));
        assert_eq!((ledger.retire(1), ledger.free(), ledger.unfinished()), (1, 2, 2));
        // It was not lost after all, and is faster than whoever has its tile now.
        assert_eq!(tiles(&ledger.let_to(2, 0.0, 1)), [1]);
        assert!(ledger.finish(1));
        assert!(!ledger.finish(1));
        // Even what nobody has can be finished.
        assert!(ledger.finish(2));
        assert_eq!((ledger.free(), ledger.unfinished()), (0, 0));
        assert!(!ledger.finish(3));
    }

    proptest! {
        /// Guards: whatever is let, lost and finished, every tile is free, let or finished, and counted once. Fails
        /// when `retire` frees finished tiles, or `finish` leaves a free one in the pool.
        #[test]
        fn tiles_are_neither_lost_nor_counted_twice(steps in prop::collection::vec((0..4_u8, 0..20_u32, 0..4_u32), 0..200)) {
            let mut ledger = Ledger::new(20);
            let mut counted = [0; 20];
            let mut let_to: Vec<(u32, u32)> = Vec::new();
            for (what, tile, rank) in steps {
                match what {
                    0 => ledger.price(Lease { tile, cost: rank as f32 }),
                    1 => let_to.extend(ledger.let_to(rank, 2.0, 3).iter().map(|lease| (rank, lease.tile))),
                    2 => {
                        ledger.retire(rank);
                    }
                    _ => counted[tile as usize] += u32::from(ledger.finish(tile)),
                }
                let finished = counted.iter().sum::<u32>();
                prop_assert_eq!(ledger.unfinished(), 20 - finished);
                prop_assert!(counted.iter().all(|&count| count <= 1));
            }
            (0..4).for_each(|rank| {
                ledger.retire(rank);
            });
            prop_assert_eq!(ledger.free() as u32, ledger.unfinished());
        }
    }
}
