//! Lower bounds: seconds that no schedule can beat, however clever.
//!
//! Bounds are only as good as their costs: for a real run they need reference seconds of every task on every device,
//! from a pass that is not the run itself.

use alloc::vec;
use alloc::vec::Vec;

/// Least makespan of tasks of the given costs on devices of the given speeds (cost per second).
///
/// The greatest of three bounds. *Work*: `m` devices do at most `Σ speeds` per second, so all of it takes
/// `Σ costs / Σ speeds`. *Large tasks*: the `k` most expensive tasks use at most `k` devices, at best the `k` fastest,
/// for every `k < m`. *Sharing*, for equal speeds: of the `k·m + 1` most expensive tasks some device gets `k + 1`,
/// which cost at least as much as the `k + 1` cheapest of those.
///
/// Takes the time of a sort. Costs must be ≥ 0 and speeds > 0; others are left out. 0 without tasks, `∞` for tasks
/// without devices.
#[must_use]
pub fn related(costs: &[f64], speeds: &[f64]) -> f64 {
    let (mut costs, speeds) = (decreasing(costs), decreasing(speeds));
    let (Some(&highest), Some((&fastest, &slowest))) = (costs.first(), speeds.first().zip(speeds.last())) else {
        return if costs.is_empty() { 0.0 } else { f64::INFINITY };
    };
    // Sums of the most expensive ones, in their place: every sum of some that follow each other is a difference of two.
    let mut sum = 0.0;
    costs.iter_mut().for_each(|cost| {
        sum += *cost;
        *cost = sum;
    });
    let up_to = costs;
    let mut bound = (sum / speeds.iter().sum::<f64>()).max(highest / fastest);
    let mut speed = 0.0;
    for (cost, s) in up_to.iter().zip(&speeds) {
        speed += s;
        bound = bound.max(cost / speed);
    }
    if fastest == slowest {
        // The `count` cheapest of the `last + 1` most expensive.
        for (last, count) in (speeds.len()..up_to.len()).step_by(speeds.len()).zip(2..) {
            let before = (last + 1).checked_sub(count + 1).map_or(0.0, |end| up_to[end]);
            bound = bound.max((up_to[last] - before) / fastest);
        }
    }
    bound
}

/// Those that are positive, the greatest first.
fn decreasing(values: &[f64]) -> Vec<f64> {
    // The bits of positive numbers are in their order, and whole numbers are sorted twice as fast.
    let mut bits: Vec<u64> = values.iter().filter(|value| **value > 0.0).map(|value| !value.to_bits()).collect();
    bits.sort_unstable();
    bits.into_iter().map(|bits| f64::from_bits(!bits)).collect()
}

/// Least makespan when `seconds[d][j]` is what task `j` takes on device `d`, in any relation.
///
/// For prices `λ ≥ 0`, let `cⱼ = min_d λ_d · seconds[d][j]`. Then `seconds[d][j] ≥ cⱼ / λ_d`: no task is faster than
/// one of cost `cⱼ` on a device of speed `λ_d`, so every [`related`] bound of those is a bound here. The first of its
/// three is the Lagrangian dual of the linear program in which tasks may be split; it is maximised over `λ` by
/// multiplicative weights: a device that the cheapest assignment overloads becomes more expensive. `max_j min_d
/// seconds[d][j]` is a bound because every task runs somewhere.
///
/// Rows must have equal length; what is beyond the shortest is left out. Values are ≥ 0; `∞` means that a device cannot
/// run a task.
#[must_use]
pub fn unrelated(seconds: &[&[f64]]) -> f64 {
    let tasks = seconds.iter().map(|row| row.len()).min().unwrap_or(0);
    if tasks == 0 {
        return 0.0;
    }
    // One device does all, and nothing is to be found.
    if let [row] = seconds {
        return row.iter().sum();
    }
    let fastest = |task: usize| seconds.iter().map(|row| row[task]).fold(f64::INFINITY, f64::min);
    let mut bound = (0..tasks).map(fastest).fold(0.0, f64::max);
    // Nothing to gain where a task cannot run, or one device does everything in no time.
    if !bound.is_finite() || bound == 0.0 {
        return bound;
    }
    // Begin with speeds from each device's total: exact when devices differ by one factor. A total below the bound is
    // that of a device that cannot run every task.
    let total = |row: &&[f64]| row[..tasks].iter().filter(|s| s.is_finite()).sum::<f64>();
    let mut prices: Vec<f64> = seconds.iter().map(|row| 1.0 / total(row).max(bound)).collect();
    let mut costs = vec![0.0; tasks];
    let mut best = 0.0;
    let mut best_prices = prices.clone();
    for round in 0..rounds(tasks * seconds.len()) {
        let sum: f64 = prices.iter().sum();
        prices.iter_mut().for_each(|price| *price /= sum);
        let loads = cheapest(seconds, &prices, &mut costs);
        let dual: f64 = costs.iter().sum();
        if dual > best {
            best = dual;
            best_prices.copy_from_slice(&prices);
        }
        // λ · load sums to the dual, so a balanced assignment has loads equal to it.
        let step = STEP / libm::sqrt(1.0 + round as f64);
        for (price, load) in prices.iter_mut().zip(&loads) {
            let over = if dual > 0.0 { (load / dual - 1.0).clamp(-1.0, 1.0) } else { 0.0 };
            *price *= libm::exp(step * over);
        }
    }
    cheapest(seconds, &best_prices, &mut costs);
    bound = bound.max(related(&costs, &best_prices));
    bound
}

/// Step of the multiplicative weights in the first round, without a unit; later ones shrink with the root of their
/// number, with which the method converges for any matrix (S. Arora, E. Hazan and S. Kale, *The Multiplicative Weights
/// Update Method*, 2012).
const STEP: f64 = 0.2;

/// Rounds for a matrix of so many entries: up to 500 where that is cheap, and no more than about 10⁸ entries are read
/// (a tenth of a second), but at least 20.
fn rounds(entries: usize) -> usize {
    (100_000_000 / entries.max(1)).clamp(20, 500)
}

/// Gives each task to the device where its priced seconds are least. Fills the priced seconds, returns the loads.
fn cheapest(seconds: &[&[f64]], prices: &[f64], costs: &mut [f64]) -> Vec<f64> {
    let mut loads = vec![0.0; seconds.len()];
    for (task, cost) in costs.iter_mut().enumerate() {
        let mut choice = (f64::INFINITY, 0);
        for (device, (row, price)) in seconds.iter().zip(prices).enumerate() {
            let priced = row[task] * price;
            if priced < choice.0 {
                choice = (priced, device);
            }
        }
        *cost = choice.0;
        loads[choice.1] += seconds[choice.1][task];
    }
    loads
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Least makespan over all ways to deal the tasks.
    fn best_makespan(seconds: &[Vec<f64>], task: usize, loads: &mut Vec<f64>) -> f64 {
        if task == seconds[0].len() {
            return loads.iter().copied().fold(0.0, f64::max);
        }
        let mut best = f64::INFINITY;
        for device in 0..seconds.len() {
            let before = loads[device];
            loads[device] += seconds[device][task];
            best = best.min(best_makespan(seconds, task + 1, loads));
            loads[device] = before;
        }
        best
    }

    fn rows(seconds: &[Vec<f64>]) -> Vec<&[f64]> {
        seconds.iter().map(Vec::as_slice).collect()
    }

    #[test]
    fn simple_cases_are_tight() {
        assert_eq!(related(&[], &[1.0]), 0.0);
        assert_eq!(related(&[1.0], &[]), f64::INFINITY);
        assert_eq!(related(&[1.0, 1.0, 1.0], &[1.0, 1.0]), 2.0, "two of three share a device");
        assert_eq!(related(&[1.0; 5], &[1.0, 1.0]), 3.0, "three of five share a device");
        assert_eq!(related(&[9.0, 1.0], &[1.0, 2.0]), 4.5, "the large task on the fast device");
        assert_eq!(related(&[4.0, 4.0, 1.0], &[4.0, 1.0, 1.0]), 1.6, "two large tasks on the two fastest");
        // Each device is fast for one half of the tasks.
        let halves = [vec![1.0, 1.0, 5.0, 5.0], vec![5.0, 5.0, 1.0, 1.0]];
        assert!((unrelated(&rows(&halves)) - 2.0).abs() < 1e-9);
        let cannot = [vec![1.0, f64::INFINITY], vec![f64::INFINITY, 3.0]];
        assert_eq!(unrelated(&rows(&cannot)), 3.0);
        assert_eq!(unrelated(&[]), 0.0);
        assert_eq!(unrelated(&[&[1.0, 2.0, 4.0]]), 7.0, "one device does all");
    }

    #[test]
    fn the_dual_is_near_the_linear_program() {
        // Two kinds of tasks, three devices: as in a mix of processors and graphics cards. The split optimum is found
        // by giving every device one kind, with the rest shared.
        let n = 300;
        let first: Vec<f64> = (0..n).map(|j| if j % 2 == 0 { 1.0 } else { 4.0 }).collect();
        let second: Vec<f64> = (0..n).map(|j| if j % 2 == 0 { 4.0 } else { 1.0 }).collect();
        let third = vec![2.0; n];
        // With λ = (2, 2, 1)/5: kind by kind cost 0.4, so 300 · 0.4 = 120; reached by 120, 120 and 60 tasks.
        let bound = unrelated(&rows(&[first, second, third]));
        assert!((119.0..=120.0 + 1e-9).contains(&bound), "{bound}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(150))]

        /// No schedule beats a bound. Mutants: `cheapest` without its minimum; the sum of `k` speeds starting at the
        /// slowest; `before` with one task more or less; unequal speeds sharing.
        #[test]
        fn no_schedule_beats_a_bound(
            seconds in (1_usize..4, 1_usize..8).prop_flat_map(|(m, n)| {
                prop::collection::vec(prop::collection::vec(0.0_f64..10.0, n), m)
            }),
            speeds in prop::collection::vec(0.1_f64..5.0, 3), equal: bool,
        ) {
            let m = seconds.len();
            let best = best_makespan(&seconds, 0, &mut vec![0.0; m]);
            prop_assert!(unrelated(&rows(&seconds)) <= best * (1.0 + 1e-12));

            let costs = &seconds[0];
            let speeds: Vec<f64> = speeds[..m].iter().map(|s| if equal { 1.0 } else { *s }).collect();
            let scaled: Vec<Vec<f64>> = speeds.iter().map(|s| costs.iter().map(|c| c / s).collect()).collect();
            let best = best_makespan(&scaled, 0, &mut vec![0.0; m]);
            let bound = related(costs, &speeds);
            prop_assert!(bound <= best * (1.0 + 1e-12));
            let general = unrelated(&rows(&scaled));
            prop_assert!(general <= best * (1.0 + 1e-12));
            let work = costs.iter().sum::<f64>() / speeds.iter().sum::<f64>();
            prop_assert!(general >= work * (1.0 - 1e-9), "related devices lose nothing in the general bound");
        }
    }
}
