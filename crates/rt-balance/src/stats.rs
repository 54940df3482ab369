//! Statistics of repeated measurements: medians, intervals that assume no distribution, ratios of pairs.
//!
//! Times of programs on a shared machine are skewed to the right and drift: so the middle is a median, its interval is
//! between two of the measured values, and two things that are compared are measured in turn and compared pair by pair.

use serde::Serialize;

/// How sure an interval is wanted, as a share of all times that it is measured.
pub const CONFIDENCE: f64 = 0.95;

/// The middle of some measurements and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// How many measurements there were.
    pub count: usize,
    /// Their median; NaN (null) of none.
    pub median: f64,
    /// Lower end of the interval that holds the true median; NaN (null) of none.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Share of the times, from 0 to 1, that such an interval holds the true median. Fewer than six measurements cannot
    /// give [`CONFIDENCE`]: then the interval is all of them and this number says what that is worth.
    pub confidence: f64,
}

impl Summary {
    /// The summary of independent measurements. NaN counts as larger than all.
    #[must_use]
    pub fn new(values: &[f64]) -> Self {
        let sorted = sorted(values);
        let (rank, confidence) = rank(sorted.len());
        let at = |position: Option<usize>| position.and_then(|i| sorted.get(i).copied()).unwrap_or(f64::NAN);
        Self {
            count: sorted.len(),
            median: middle(&sorted),
            low: at(Some(rank)),
            high: at(sorted.len().checked_sub(rank + 1)),
            confidence,
        }
    }

    /// The summary of `a[i] / b[i]`: what was measured in turn is compared with its neighbour in time, so that a
    /// machine whose speed drifts does not spoil the comparison. The longer of the two is cut.
    #[must_use]
    pub fn of_ratios(a: &[f64], b: &[f64]) -> Self {
        Self::new(&ratios(a, b))
    }

    /// The ends of the interval; `None` of fewer than two measurements, which say nothing of how well the middle is
    /// known.
    #[must_use]
    pub fn interval(&self) -> Option<[f64; 2]> {
        (self.count > 1).then_some([self.low, self.high])
    }

    /// Of ratios: whether they are not 1, all of the interval on one side and the median by more than [`noise`].
    #[must_use]
    pub fn differs_by_more_than(&self, noise: f64) -> bool {
        let is_one_sided = self.low > 1.0 || self.high < 1.0;
        is_one_sided && self.median.ln().abs() > noise.ln_1p()
    }
}

/// How many standard errors the medians of two rows must be apart: with a dozen rows, all are told to be alike in 19 of
/// 20 measurements of what is alike.
const APART: f64 = 3.0;

/// Standard deviation of normal errors over their median absolute deviation.
const DEVIATION: f64 = 1.4826;

/// Standard error of a median over that of a mean, of normal errors.
const OF_MEDIAN: f64 = 1.2533;

/// By how much the medians of two rows must differ, as a share, to be told apart: what is less may be noise. `None`
/// where there are fewer than two rows, or three rounds.
///
/// `rows[i][round]` are times that were measured in turn. What a round has in common is the machine's drift, what a row
/// has in common is its own speed; what is left is noise, which all rows are taken to have alike. Its size is read from
/// the median of what is left, so that single disturbances do not count.
#[must_use]
pub fn noise(rows: &[&[f64]]) -> Option<f64> {
    let rounds = rows.iter().map(|row| row.len()).min()?;
    if rows.len() < 2 || rounds < 3 {
        return None;
    }
    let column = |round: usize| median(&rows.iter().map(|row| row[round].ln()).collect::<Vec<_>>());
    let drift: Vec<f64> = (0..rounds).map(column).collect();
    let left = rows.iter().flat_map(|row| {
        let own: Vec<f64> = row.iter().zip(&drift).map(|(time, drift)| time.ln() - drift).collect();
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        own.into_iter().map(move |time| (time - mean).abs())
    });
    let (rows, rounds) = (rows.len() as f64, rounds as f64);
    // What rows and columns were fitted with is not left any more.
    let fitted = (rounds * rows / ((rounds - 1.0) * (rows - 1.0))).sqrt();
    let deviation = DEVIATION * median(&left.collect::<Vec<_>>()) * fitted;
    Some((APART * OF_MEDIAN * deviation * (2.0 / rounds).sqrt()).exp_m1())
}

/// `a[i] / b[i]`, as many as the shorter has.
#[must_use]
pub fn ratios(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a / b).collect()
}

/// The middle value, or the mean of the two in the middle; NaN of none.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    middle(&sorted(values))
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

fn middle(sorted: &[f64]) -> f64 {
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[middle],
        _ => (sorted[middle - 1] + sorted[middle]) / 2.0,
    }
}

/// The greatest rank k, from 0, for which the median lies between the k-th smallest and the k-th largest of `count`
/// values with [`CONFIDENCE`], and with what confidence it does.
///
/// A value is below the true median with probability 1/2, so the number of those below it is binomial, whatever the
/// distribution (H. A. David and H. N. Nagaraja, *Order Statistics*, 3rd edition, 2003, section 7.1).
fn rank(count: usize) -> (usize, f64) {
    // Binomial coefficients relative to the middle one, which neither overflow nor vanish together.
    let half = count / 2;
    let mut below = vec![1.0; half + 1];
    for k in (0..half).rev() {
        below[k] = below[k + 1] * (k + 1) as f64 / (count - k) as f64;
    }
    let both = 2.0 * below.iter().sum::<f64>();
    // With an even count the middle coefficient stands alone.
    let total = if count.is_multiple_of(2) { both - 1.0 } else { both };
    let (mut best, mut tail) = ((0, 0.0), 0.0);
    for (k, coefficient) in below.iter().enumerate().take(count.div_ceil(2)) {
        tail += 2.0 * coefficient / total;
        if k == 0 || 1.0 - tail >= CONFIDENCE {
            best = (k, (1.0 - tail).max(0.0));
        }
    }
    best
}

/// Total length of a union of intervals.
#[must_use]
pub fn union(mut spans: Vec<(f64, f64)>) -> f64 {
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut total, mut reached) = (0.0, f64::NEG_INFINITY);
    for (start, end) in spans {
        total += (end - start.max(reached)).max(0.0);
        reached = reached.max(end);
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_in_the_middle() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(&[]).is_nan());
    }

    /// 1 − 2 P(binomial(n, ½) ≤ k), from tables of the binomial distribution.
    #[test]
    fn ranks_are_those_of_the_tables() {
        for n in 1..6 {
            assert_eq!(rank(n), (0, 1.0 - 0.5_f64.powi(n as i32 - 1)), "{n}");
        }
        assert_eq!(rank(6), (0, 0.96875));
        for (n, k, confidence) in [(9, 1, 0.961), (15, 3, 0.965), (20, 5, 0.959), (100, 39, 0.9648)] {
            let (found, sure) = rank(n);
            assert!(found == k && (sure - confidence).abs() < 1e-3, "{n}: {found}, {sure}");
        }
        assert!(rank(100_000).1 >= CONFIDENCE);
        assert_eq!(rank(0).0, 0);
    }

    /// Fails when the interval is one rank too narrow: it would hold the median in 0.85 of the draws.
    #[test]
    fn intervals_hold_the_true_median_as_often_as_they_say() {
        const DRAWS: u32 = 4_000;
        let held = (0..DRAWS).filter(|&draw| {
            // Squares of uniform numbers: skewed, with median 1/4.
            let value = |i| f64::from(rt_core::random::pair(7, draw, i)[0]).powi(2);
            let summary = Summary::new(&(0..12).map(value).collect::<Vec<_>>());
            summary.low <= 0.25 && 0.25 <= summary.high
        });
        let share = held.count() as f64 / f64::from(DRAWS);
        // 0.9614 ± 4 standard deviations of 0.003.
        assert!((share - Summary::new(&[0.0; 12]).confidence).abs() < 0.0125, "{share}");
    }

    /// Times of `rows` ways in `rounds` rounds: row 1 takes `factor` of what the others do, noise is 3% and in one of
    /// twelve cases a disturbance, and rounds drift.
    fn made(seed: u32, rows: u32, rounds: u32, factor: f64) -> Vec<Vec<f64>> {
        let pair = |i: u32, j: u32| rt_core::random::pair(seed, i, j).map(f64::from);
        let time = |row: u32, round: u32| {
            let [drift, _] = pair(1_000, round);
            let cell = row * 64 + round;
            // A sum of four uniform numbers is as good as normal.
            let ([a, b], [c, d]) = (pair(cell, 1), pair(cell, 2));
            let [rare, large] = pair(cell, 3);
            let disturbed = if rare < 1.0 / 12.0 { 0.5 * large } else { 0.0 };
            let noise = 0.03 * (a + b + c + d - 2.0) / (4.0_f64 / 12.0).sqrt();
            (noise + disturbed + 0.1 * drift).exp() * if row == 1 { factor } else { 1.0 }
        };
        (0..rows).map(|row| (0..rounds).map(|round| time(row, round)).collect()).collect()
    }

    fn told_apart(times: &[Vec<f64>]) -> Vec<bool> {
        let rows: Vec<&[f64]> = times.iter().map(Vec::as_slice).collect();
        let noise = noise(&rows).unwrap();
        let apart = |row: &Vec<f64>| {
            let ratio = Summary::of_ratios(row, &times[0]);
            ratio.differs_by_more_than(noise)
        };
        times[1..].iter().map(apart).collect()
    }

    /// Mutants: `APART` of 1.5; drift left in; the mean of a row not taken off; `fitted` gone with three rounds.
    #[test]
    fn what_is_alike_is_seldom_told_apart_and_what_differs_is() {
        const TRIALS: u32 = 300;
        for (rows, rounds) in [(2, 7), (3, 3), (12, 3), (12, 5), (12, 7), (12, 12)] {
            let wrong = (0..TRIALS).filter(|&seed| told_apart(&made(seed, rows, rounds, 1.0)).contains(&true)).count();
            assert!(wrong as f64 <= 0.07 * f64::from(TRIALS), "{rows} rows, {rounds} rounds: {wrong} of {TRIALS}");
        }
        let right = (0..TRIALS).filter(|&seed| told_apart(&made(seed, 12, 9, 1.2))[0]).count();
        assert!(right as f64 >= 0.9 * f64::from(TRIALS), "{right} of {TRIALS}");
        assert!(noise(&[&[1.0, 2.0], &[1.0, 2.0]]).is_none() && noise(&[&[1.0; 9]]).is_none() && noise(&[]).is_none());
    }

    #[test]
    fn summaries_of_little_say_how_little() {
        let one = Summary::new(&[5.0]);
        assert_eq!((one.median, one.low, one.high, one.confidence), (5.0, 5.0, 5.0, 0.0));
        // Fails when one value is taken for an interval without width.
        assert_eq!((one.interval(), Summary::new(&[5.0, 6.0]).interval()), (None, Some([5.0, 6.0])));
        let none = Summary::new(&[]);
        assert!(none.median.is_nan() && none.low.is_nan() && none.high.is_nan() && none.count == 0);
        let pairs = Summary::of_ratios(&[2.0, 40.0, 6.0], &[1.0, 10.0, 2.0, 9.0]);
        assert_eq!((pairs.count, pairs.median, pairs.low, pairs.high), (3, 3.0, 2.0, 4.0));
    }
}
