//! How good a run and an estimate were. All results are without a unit; those that have no value are `None`.

use alloc::vec::Vec;

/// How much longer a run took than if every device had been busy to its end:
/// `makespan / (Σ speed · busy / Σ speed) − 1`.
///
/// `speeds` in any common unit; devices without one count as speed 1. `None` when no device was busy.
#[must_use]
pub fn imbalance(makespan_s: f64, busy_s: &[f64], speeds: &[f64]) -> Option<f64> {
    let speed = |device: usize| speeds.get(device).copied().filter(|s| s.is_finite() && *s > 0.0).unwrap_or(1.0);
    let all: f64 = (0..busy_s.len()).map(speed).sum();
    let used: f64 = busy_s.iter().enumerate().map(|(device, busy)| busy * speed(device)).sum();
    ratio(makespan_s, used / all).map(|r| r - 1.0)
}

/// How much longer a run took than any schedule must: `makespan / lower bound − 1`; see [`crate::bound`].
#[must_use]
pub fn excess(makespan_s: f64, lower_bound_s: f64) -> Option<f64> {
    ratio(makespan_s, lower_bound_s).map(|r| r - 1.0)
}

/// Share that estimation adds to a run: `estimate / (makespan − estimate)`, where the makespan contains it.
#[must_use]
pub fn overhead(estimate_s: f64, makespan_s: f64) -> Option<f64> {
    ratio(estimate_s, makespan_s - estimate_s)
}

fn ratio(of: f64, to: f64) -> Option<f64> {
    Some(of / to).filter(|r| r.is_finite() && to > 0.0)
}

/// How far estimates lie from the truth per task, after one linear scale that makes their totals equal: only relative
/// costs matter for balancing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimateErrors {
    /// The scale, `Σ c / Σ ĉ`.
    pub scale: f64,
    /// Mean of `|ĉ − c| / c`.
    pub mean_relative: f64,
    /// `Σ |ĉ − c| / Σ c`: large tasks count more.
    pub weighted: f64,
    /// 95th percentile of `|ĉ − c| / c`: the least value that at least 95% of the tasks do not exceed.
    pub p95: f64,
    /// Mean of `(ĉ − c) / c`: above 0 when cheap tasks are overestimated.
    pub bias: f64,
    /// Number of tasks compared.
    pub tasks: usize,
}

impl EstimateErrors {
    /// Compares estimates with true costs, in any units. Tasks whose truth is not a positive number, or whose estimate
    /// is not finite, are left out; `None` if none is left or all estimates are 0.
    #[must_use]
    pub fn new(estimated: &[f64], truth: &[f64]) -> Option<Self> {
        let usable = |(e, c): &(f64, f64)| e.is_finite() && *e >= 0.0 && c.is_finite() && *c > 0.0;
        let pairs = || estimated.iter().copied().zip(truth.iter().copied()).filter(usable);
        let (estimates, costs) = pairs().fold((0.0, 0.0), |(e, c), pair| (e + pair.0, c + pair.1));
        let scale = ratio(costs, estimates)?;
        let mut relative: Vec<f64> = Vec::new();
        let (mut bias, mut absolute) = (0.0, 0.0);
        for (e, c) in pairs() {
            let error = e * scale - c;
            absolute += error.abs();
            bias += error / c;
            relative.push(error.abs() / c);
        }
        relative.sort_unstable_by(f64::total_cmp);
        let tasks = relative.len();
        let n = tasks as f64;
        Some(Self {
            scale,
            mean_relative: relative.iter().sum::<f64>() / n,
            weighted: absolute / costs,
            p95: relative[(tasks * 95).div_ceil(100) - 1],
            bias: bias / n,
            tasks,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_run_with_an_idle_half_is_imbalanced() {
        assert_eq!(imbalance(2.0, &[2.0, 1.0], &[1.0, 1.0]), Some(2.0 / 1.5 - 1.0));
        assert_eq!(imbalance(2.0, &[2.0, 1.0], &[3.0, 1.0]), Some(2.0 / 1.75 - 1.0));
        assert_eq!(imbalance(2.0, &[], &[]), None);
        assert_eq!(excess(1.1, 0.0), None);
        assert_eq!(excess(3.0, 2.0), Some(0.5));
        assert_eq!(overhead(1.0, 5.0), Some(0.25));
        assert_eq!(overhead(5.0, 5.0), None);
    }

    #[test]
    fn errors_are_those_after_one_scale() {
        let errors = EstimateErrors::new(&[1.0, 3.0, f64::NAN, 7.0], &[4.0, 4.0, 1.0, 0.0]).expect("two tasks");
        // Scaled by 2: 2 and 6 for 4 and 4.
        let wanted = EstimateErrors { scale: 2.0, mean_relative: 0.5, weighted: 0.5, p95: 0.5, bias: 0.0, tasks: 2 };
        assert_eq!(errors, wanted);
        assert_eq!(EstimateErrors::new(&[], &[]), None);
        assert_eq!(EstimateErrors::new(&[0.0], &[1.0]), None);
        let hundred: Vec<f64> = (1..=100).map(f64::from).collect();
        let off: Vec<f64> = hundred.iter().map(|c| if *c > 95.0 { c * 1.5 } else { *c }).collect();
        let errors = EstimateErrors::new(&off, &hundred).expect("hundred tasks");
        assert!((errors.p95 - (1.0 - errors.scale)).abs() < 1e-12, "the worst five are left out");
    }

    proptest! {
        /// Mutants: a scale of 1; a scale fitted per task.
        #[test]
        fn units_do_not_matter(
            costs in prop::collection::vec((0.1_f64..10.0, 0.1_f64..10.0), 1..50), exponent in -20_i32..20,
        ) {
            let (estimated, truth): (Vec<f64>, Vec<f64>) = costs.into_iter().unzip();
            let scaled: Vec<f64> = estimated.iter().map(|e| libm::ldexp(*e, exponent)).collect();
            let [a, b] = [&estimated, &scaled].map(|e| EstimateErrors::new(e, &truth).expect("positive"));
            prop_assert_eq!((a.mean_relative, a.weighted, a.p95, a.bias), (b.mean_relative, b.weighted, b.p95, b.bias));
            let perfect = EstimateErrors::new(&truth, &truth).expect("positive");
            prop_assert!(perfect.p95 < 1e-12 && perfect.scale == 1.0);
        }
    }
}
