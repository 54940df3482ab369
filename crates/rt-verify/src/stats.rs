//! Statistics of rates and of errors: no distribution is assumed but the binomial of rates.

use statrs::function::beta::checked_beta_reg;

/// Share of all cases in which an interval of this module may miss the true value.
const ALPHA: f64 = 0.05;

/// Beyond this many successes and failures the series of the incomplete beta function does not converge; the score
/// interval of E. B. Wilson, *Probable Inference* (1927), then differs from the exact one by less than 1% of its width.
const EXACT_UP_TO: u64 = 2_000;

/// The 97.5% quantile of the normal distribution.
const NORMAL_QUANTILE: f64 = 1.959_963_984_540_054;

/// The 95% interval of a rate after `failures` in `trials`: C. Clopper and E. Pearson, *The Use of Confidence or
/// Fiducial Limits* (1934).
///
/// Where nothing failed (or everything did) only one end is open, and it gets all of the 5%: after 10⁸ trials without a
/// failure the rate is below 3·10⁻⁸. `[0, 1]` without trials.
#[must_use]
pub fn clopper_pearson(failures: u64, trials: u64) -> [f64; 2] {
    let (k, n) = (failures.min(trials), trials);
    match (k, n - k) {
        (_, 0) if n == 0 => [0.0, 1.0],
        (0, _) => [0.0, -(ALPHA.ln() / n as f64).exp_m1()],
        (_, 0) => [(ALPHA.ln() / n as f64).exp(), 1.0],
        (k, rest) if k.min(rest) > EXACT_UP_TO => wilson(k as f64, n as f64),
        (k, rest) => {
            let (k, rest) = (k as f64, rest as f64);
            // The lower end has k failures or more with probability ALPHA / 2, the upper end k or fewer.
            let low = solve(|p| beta(k, rest + 1.0, p), ALPHA / 2.0);
            let high = solve(|p| beta(k + 1.0, rest, p), 1.0 - ALPHA / 2.0);
            [low, high]
        }
    }
}

/// The regularised incomplete beta function; its arguments are in range by construction.
fn beta(a: f64, b: f64, p: f64) -> f64 {
    checked_beta_reg(a, b, p).unwrap_or(f64::NAN)
}

/// Where an increasing function of a probability reaches `value`: bisection of the logarithm, since rates of 10⁻⁸
/// matter.
fn solve(increasing: impl Fn(f64) -> f64, value: f64) -> f64 {
    let (mut low, mut high) = (-60.0_f64, 0.0_f64);
    // Each step halves an interval of 60: after 60 the rest is below the last place.
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if increasing(middle.exp()) < value {
            low = middle;
        } else {
            high = middle;
        }
    }
    f64::midpoint(low, high).exp()
}

fn wilson(k: f64, n: f64) -> [f64; 2] {
    let z2 = NORMAL_QUANTILE * NORMAL_QUANTILE;
    let (rate, scale) = (k / n, 1.0 + z2 / n);
    let middle = rate + z2 / (2.0 * n);
    let half = NORMAL_QUANTILE * (rate * (1.0 - rate) / n + z2 / (4.0 * n * n)).sqrt();
    [(middle - half) / scale, (middle + half) / scale]
}

/// The value below which the share `q` (0 to 1) of the values lies, of those between two neighbours the mean weighted
/// by distance; `None` without values.
#[must_use]
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = q.clamp(0.0, 1.0) * sorted.len().checked_sub(1)? as f64;
    let (below, part) = (place.floor() as usize, place.fract());
    let above = sorted[(below + 1).min(sorted.len() - 1)];
    // Not a sum of products: infinite values may stand beside each other.
    Some(if part == 0.0 { sorted[below] } else { sorted[below] + (above - sorted[below]) * part })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-3 * b.abs()
    }

    // Tables of exact binomial limits. Fails when k and k + 1 are exchanged or a tail gets the whole of 5%.
    #[test]
    fn bounds_of_rates_are_those_of_the_tables() {
        for (k, n, low, high) in
            [(1, 10, 0.002_529, 0.445_02), (5, 10, 0.187_09, 0.812_91), (50, 100, 0.398_32, 0.601_68)]
        {
            let [l, h] = clopper_pearson(k, n);
            assert!(close(l, low) && close(h, high), "{k} of {n}: {l} to {h}");
        }
        let [low, high] = clopper_pearson(0, 100_000_000);
        assert!(low == 0.0 && close(high, 2.9957e-8), "{high}");
        assert_eq!(clopper_pearson(10, 10)[1], 1.0);
        assert_eq!(clopper_pearson(0, 0), [0.0, 1.0]);
        let [low, high] = clopper_pearson(1, 1_000_000_000);
        assert!(close(low, 2.5318e-11) && close(high, 5.5716e-9), "{low} {high}");
    }

    // Fails when the two intervals part: a wrong sign or a forgotten square in Wilson's.
    #[test]
    fn bounds_go_on_where_the_series_ends() {
        for n in [1_000_000_u64, 1_000_000_000] {
            let [at, beyond] = [EXACT_UP_TO, EXACT_UP_TO + 1].map(|k| clopper_pearson(k, n));
            for (a, b) in at.into_iter().zip(beyond) {
                assert!((a / b - 1.0).abs() < 2e-3, "{at:?} {beyond:?}");
            }
        }
    }

    #[test]
    fn quantiles_lie_between_their_neighbours() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(quantile(&[1.0, 2.0, 3.0, 4.0, 5.0], 0.99), Some(4.96));
        assert_eq!(quantile(&[1.0, f64::INFINITY], 1.0), Some(f64::INFINITY));
        assert_eq!(quantile(&[], 0.5), None);
    }
}
