//! Work that processes share without a word between them: each finds out by itself what is its part.

use std::fmt;
use std::iter;
use std::str::FromStr;

/// One of several processes that share work and do not know of each other, as `3/8`: the third of eight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 1 on.
    number: u32,
    of: u32,
}

impl Shard {
    /// Most of them.
    pub const MOST: u32 = 1 << 20;

    /// The process that does all of it.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// All shards of so many.
    pub fn all(of: u32) -> impl Iterator<Item = Self> {
        (1..=of).map(move |number| Self { number, of })
    }

    /// How many there are.
    #[must_use]
    pub const fn of(self) -> u32 {
        self.of
    }

    /// The pieces of work that are this shard's, by their numbers and in their order, if they are expected to take so
    /// many seconds each, in so far as that is known.
    ///
    /// Most expensive first, each piece goes to the shard that has least so far: R. Graham, *Bounds on Multiprocessing
    /// Timing Anomalies* (1969). Of what is not known the mean of what is known is expected; where nothing is, that is
    /// round robin. Every shard that is told the same gets a part of the same deal.
    #[must_use]
    pub fn part(self, seconds: &[Option<f64>]) -> Vec<usize> {
        let good = |seconds: &f64| seconds.is_finite() && *seconds >= 0.0;
        let known = || seconds.iter().flatten().copied().filter(good);
        let mean = match known().count() {
            0 => 1.0,
            count => known().sum::<f64>() / count as f64,
        };
        let cost = |piece: &usize| seconds[*piece].filter(good).unwrap_or(mean);
        let mut pieces: Vec<usize> = (0..seconds.len()).collect();
        // Stable: of the same cost, the first one first.
        pieces.sort_by(|a, b| cost(b).total_cmp(&cost(a)));
        let mut loads = vec![(0.0_f64, 0_usize); self.of as usize];
        let mut own = Vec::new();
        for piece in pieces {
            // By number of pieces where they cost nothing; the first shard of those that have least.
            let least = iter::zip(0.., &mut loads).min_by(|(_, a), (_, b)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let Some((shard, (load, count))) = least else { break };
            (*load, *count) = (*load + cost(&piece), *count + 1);
            if shard == self.number - 1 {
                own.push(piece);
            }
        }
        own.sort_unstable();
        own
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = NoShard;

    fn from_str(text: &str) -> Result<Self, NoShard> {
        let (number, of) = text.split_once('/').ok_or(NoShard)?;
        let [number, of] = [number, of].map(|text| text.trim().parse::<u32>().map_err(|_| NoShard));
        let shard = Self { number: number?, of: of? };
        if (1..=shard.of).contains(&shard.number) && shard.of <= Self::MOST { Ok(shard) } else { Err(NoShard) }
    }
}

/// A text names no shard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoShard;

impl fmt::Display for NoShard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "write it as 1/8 to 8/8 for the first to the last of eight")
    }
}

impl std::error::Error for NoShard {}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn shards_are_read_as_they_are_written() {
        assert_eq!(Shard::all(3).map(|shard| shard.to_string()).collect::<Vec<_>>(), ["1/3", "2/3", "3/3"]);
        assert!(Shard::all(3).all(|shard| shard.to_string().parse() == Ok(shard)));
        for bad in ["0/3", "4/3", "1", "1/", "/3", "1/0", "a/b", "-1/3", "1/1048577"] {
            assert_eq!(bad.parse::<Shard>(), Err(NoShard), "{bad}");
        }
    }

    /// Fails when what is not known is dealt in blocks, or goes before or after all else.
    #[test]
    fn unknown_costs_are_dealt_in_turn_and_known_ones_evenly() {
        let parts = |seconds: &[Option<f64>]| Shard::all(3).map(|shard| shard.part(seconds)).collect::<Vec<_>>();
        assert_eq!(parts(&[None; 7]), [vec![0, 3, 6], vec![1, 4], vec![2, 5]]);
        assert_eq!(parts(&[Some(0.0); 4]), [vec![0, 3], vec![1], vec![2]]);
        let known = [1.0, 1.0, 6.0, 3.0, 2.0, 5.0].map(Some);
        assert_eq!(parts(&known), [vec![2], vec![0, 5], vec![1, 3, 4]]);
        // As expensive as the mean of 2 and 4.
        assert_eq!(parts(&[Some(2.0), None, Some(4.0)]), [vec![2], vec![1], vec![0]]);
        assert_eq!(parts(&[Some(f64::NAN), Some(-1.0), Some(f64::INFINITY)]), [vec![0], vec![1], vec![2]]);
    }

    proptest! {
        /// Guards: every piece is dealt once, and no shard has more than the least loaded one and its own cheapest
        /// piece. Fails when costs are dealt cheapest first or shards see different loads.
        #[test]
        fn every_piece_is_dealt_once_and_evenly(
            seconds in prop::collection::vec(prop::option::of(0.0..100.0_f64), 0..60), of in 1..9_u32,
        ) {
            let parts: Vec<Vec<usize>> = Shard::all(of).map(|shard| shard.part(&seconds)).collect();
            let mut dealt = parts.concat();
            dealt.sort_unstable();
            prop_assert_eq!(dealt, (0..seconds.len()).collect::<Vec<_>>());
            let known: Vec<f64> = seconds.iter().flatten().copied().collect();
            let mean = if known.is_empty() { 1.0 } else { known.iter().sum::<f64>() / known.len() as f64 };
            let costs = |part: &Vec<usize>| part.iter().map(|&piece| seconds[piece].unwrap_or(mean)).collect::<Vec<_>>();
            let loads: Vec<f64> = parts.iter().map(|part| costs(part).iter().sum()).collect();
            let least = loads.iter().copied().fold(f64::INFINITY, f64::min);
            for (part, load) in parts.iter().zip(&loads) {
                let cheapest = costs(part).into_iter().fold(f64::INFINITY, f64::min);
                prop_assert!(part.is_empty() || *load <= least + cheapest + 1e-6, "{load} beside {least}");
            }
        }
    }
}
