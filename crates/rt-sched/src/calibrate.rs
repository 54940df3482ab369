//! From measured launches to a device's cost model.

use alloc::vec::Vec;
use rt_core::{CostModel, Work};

/// Learns one device's seconds per launch, ray, box test and triangle test, and of divergence, from measured launches.
///
/// Non-negative least squares of relative errors (C. Lawson and R. Hanson, *Solving Least Squares Problems*, 1974, with
/// their active set found by trying all sets: there are 31). Observations are kept as sums only, so learning is cheap
/// and never ends; older ones fade.
///
/// Few or similar launches cannot tell five prices apart. Then fewer are fitted: divergence is free; then there is a
/// price per launch and one for every ray and test, then only the latter.
#[derive(Clone, Copy, Debug)]
pub struct Calibration {
    /// `Σ w · xᵢ · xⱼ` with `w = 1 / seconds²` and `x` = launches, rays, boxes, triangles, divergence.
    matrix: [Row; PRICES],
    /// `Σ w · xᵢ · seconds`.
    right: Row,
    /// Number of observations, older ones counting less.
    weight: f64,
    keep: f64,
}

/// Prices of a cost model: of a launch, a ray, a box test, a triangle test, and divergence.
const PRICES: usize = 5;

/// One number for each price.
type Row = [f64; PRICES];

/// What one or more launches of a device had to do, and how long that took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Number of launches.
    pub launches: f64,
    /// Number of rays.
    pub rays: f64,
    /// Number of box tests, estimated or exact.
    pub boxes: f64,
    /// Number of triangle tests, estimated or exact.
    pub triangles: f64,
    /// Divergence of the rays, in box tests: see [`Work::divergence`].
    pub divergence: f64,
    /// Seconds.
    pub seconds: f64,
}

impl Measured {
    /// Estimated work that took `seconds`, the launch left out.
    #[must_use]
    pub fn of(work: &Work, seconds: f64) -> Self {
        let [rays, boxes, triangles, divergence] = work.parts();
        Self { launches: 0.0, rays, boxes, triangles, divergence, seconds }
    }
}

/// A fitted cost model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// The model.
    pub model: CostModel,
    /// Root mean square of the relative errors of the observations, without a unit.
    pub relative_error: f64,
    /// How many prices were told apart: 5 when each has its own, fewer where something was not observed or divergence
    /// is free, 2 for launches and everything else, 1 for one price.
    pub prices: u32,
}

/// One price for every ray and test.
const ONE_PRICE: Row = [0.0, 1.0, 1.0, 1.0, 0.0];

/// Observations that are needed for each price that is fitted on its own, so that noise is
/// averaged over at least two each.
const ENOUGH: f64 = 2.0;

/// Share of its diagonal that a pivot must keep in elimination. Below it the launches are collinear to within the
/// noise of timers, about 0.1%, squared.
const LEAST_PIVOT: f64 = 1e-6;

/// Added to the diagonal, relative to it: far below any noise, it only keeps exactly collinear columns from dividing
/// by 0.
const RIDGE: f64 = 1e-12;

impl Default for Calibration {
    /// A calibration that remembers about 200 launches: ten streams of a hybrid queue, long enough to average noise
    /// and short enough to follow a processor that warms up.
    fn default() -> Self {
        Self::new(200.0)
    }
}

impl Calibration {
    /// A calibration in which an observation fades to 1/e after `memory` further ones. At least 1; `∞` never forgets.
    #[must_use]
    pub fn new(memory: f64) -> Self {
        let memory = if memory >= 1.0 { memory } else { 1.0 };
        Self { matrix: [[0.0; PRICES]; PRICES], right: [0.0; PRICES], weight: 0.0, keep: libm::exp(-1.0 / memory) }
    }

    /// Adds an observation. One that is not finite, has negative parts or took no time is ignored.
    pub fn observe(&mut self, measured: Measured) {
        let Measured { launches, rays, boxes, triangles, divergence, seconds } = measured;
        let x = [launches, rays, boxes, triangles, divergence];
        // 1e-12 s is below the resolution of any clock, and its square still a normal number.
        if !(seconds.is_finite() && seconds > 1e-12 && x.iter().all(|x| x.is_finite() && (0.0..1e30).contains(x))) {
            return;
        }
        // Relative errors: everything divided by the seconds.
        let x = x.map(|x| x / seconds);
        for i in 0..PRICES {
            for j in 0..PRICES {
                self.matrix[i][j] = self.matrix[i][j] * self.keep + x[i] * x[j];
            }
            self.right[i] = self.right[i] * self.keep + x[i];
        }
        self.weight = self.weight * self.keep + 1.0;
    }

    /// Both calibrations as one, for devices that are taken to be alike.
    #[must_use]
    pub fn pooled(&self, other: &Self) -> Self {
        let mut pooled = *self;
        for i in 0..PRICES {
            for j in 0..PRICES {
                pooled.matrix[i][j] += other.matrix[i][j];
            }
            pooled.right[i] += other.right[i];
        }
        pooled.weight += other.weight;
        pooled
    }

    /// Number of observations, older ones counting less.
    #[must_use]
    pub const fn weight(&self) -> f64 {
        self.weight
    }

    /// The model that fits best; `None` before the first useful observation.
    #[must_use]
    pub fn fit(&self) -> Option<Fit> {
        // Columns of what is priced together: launches, rays, boxes, triangles, divergence.
        const SEPARATE: &[Row] = &[
            [1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0],
        ];
        const LAUNCH_AND_REST: &[Row] = &[[1.0, 0.0, 0.0, 0.0, 0.0], ONE_PRICE];
        const ONE: &[Row] = &[ONE_PRICE];
        [SEPARATE, &SEPARATE[..4], LAUNCH_AND_REST, ONE].into_iter().find_map(|tier| {
            // What was never observed has no price: launches, where single tasks were timed.
            let columns: Vec<Row> = tier.iter().copied().filter(|column| self.observed(column)).collect();
            // One price is better than none.
            let enough = columns.len() == 1 || self.weight >= ENOUGH * columns.len() as f64;
            if enough && self.independent(&columns) { self.best(&columns) } else { None }
        })
    }

    /// Whether anything was observed of what `column` prices.
    fn observed(&self, column: &Row) -> bool {
        (0..PRICES).any(|i| column[i] > 0.0 && self.matrix[i][i] > 0.0)
    }

    /// Whether the observations can tell the prices of `columns` apart.
    fn independent(&self, columns: &[Row]) -> bool {
        self.solve(columns, (1 << columns.len()) - 1, LEAST_PIVOT).is_some()
    }

    /// The best model among those that price some of `columns` and leave the others free of charge.
    fn best(&self, columns: &[Row]) -> Option<Fit> {
        let sets = 1..1_u32 << columns.len();
        let fits = sets.filter_map(|set| {
            let [launch, mut ray, boxed, triangle, divergence] = self.solve(columns, set, 0.0)?;
            if ray + boxed == 0.0 {
                // A valid model prices rays; a femtosecond is nothing.
                ray = 1e-15;
            }
            // Refuses negative prices.
            let model = CostModel::new(launch, ray, boxed, triangle)?.with_divergence(divergence)?;
            let error = self.mean_square([launch, ray, boxed, triangle, divergence]);
            Some(Fit { model, relative_error: libm::sqrt(error), prices: columns.len() as u32 })
        });
        fits.min_by(|a, b| a.relative_error.total_cmp(&b.relative_error))
    }

    /// Mean of the squared relative errors of the given prices: `Σ w (s − x·p)² / Σ 1`.
    fn mean_square(&self, prices: Row) -> f64 {
        let mut error = self.weight;
        for i in 0..PRICES {
            error -= 2.0 * prices[i] * self.right[i];
            for j in 0..PRICES {
                error += prices[i] * self.matrix[i][j] * prices[j];
            }
        }
        (error / self.weight).max(0.0)
    }

    /// Least squares over the columns in `set`: all prices, or `None` if a pivot falls below `least_pivot` times
    /// its diagonal. Prices may be negative. Cholesky's decomposition of the normal equations.
    fn solve(&self, columns: &[Row], set: u32, least_pivot: f64) -> Option<Row> {
        let mut a = [[0.0; PRICES]; PRICES];
        let mut b = [0.0; PRICES];
        let mut chosen = [[0.0; PRICES]; PRICES];
        let mut n = 0;
        for (_, column) in columns.iter().enumerate().filter(|(c, _)| set >> c & 1 == 1) {
            chosen[n] = *column;
            n += 1;
        }
        for i in 0..n {
            b[i] = dot(&chosen[i], &self.right);
            for j in 0..n {
                a[i][j] = dot(&chosen[i], &core::array::from_fn(|k| dot(&self.matrix[k], &chosen[j])));
            }
        }
        let diagonal: Row = core::array::from_fn(|i| a[i][i]);
        for i in 0..n {
            a[i][i] += RIDGE * diagonal[i];
        }
        for i in 0..n {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| a[i][k] * a[j][k]).sum();
                let rest = a[i][j] - known;
                if i > j {
                    a[i][j] = rest / a[j][j];
                } else if rest > least_pivot * diagonal[i] && rest > 0.0 {
                    a[i][i] = libm::sqrt(rest);
                } else {
                    return None;
                }
            }
        }
        for i in 0..n {
            let known: f64 = (0..i).map(|k| a[i][k] * b[k]).sum();
            b[i] = (b[i] - known) / a[i][i];
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| a[k][i] * b[k]).sum();
            b[i] = (b[i] - known) / a[i][i];
        }
        Some(core::array::from_fn(|i| (0..n).map(|c| b[c] * chosen[c][i]).sum()))
    }
}

/// Seconds of each task as predicted by prices that were fitted on other tasks: even ones predict odd ones and the
/// other way round. NaN where too little was measured.
///
/// `seconds` are the tasks' own, without the launch, one for each entry of `work`; entries that are not positive
/// numbers teach nothing.
#[must_use]
pub fn cross_predicted(work: &[Work], seconds: &[f64]) -> Vec<f64> {
    let fits = [0, 1].map(|parity| {
        let mut calibration = Calibration::new(f64::INFINITY);
        for (work, &seconds) in work.iter().zip(seconds).skip(parity).step_by(2) {
            calibration.observe(Measured::of(work, seconds));
        }
        calibration.fit()
    });
    let predict =
        |(task, work): (usize, &Work)| fits[1 - task % 2].as_ref().map_or(f64::NAN, |fit| fit.model.seconds(work));
    work.iter().enumerate().map(predict).collect()
}

fn dot(a: &Row, b: &Row) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rt_core::random;

    const TRUE: Row = [2e-5, 3e-9, 1e-9, 2.5e-9, 4e-9];

    /// Launch `i` of a device with the prices `TRUE`, whose clock is off by up to `noise`.
    fn launch(i: u32, noise: f64) -> Measured {
        let [a, b] = random::pair(5, i, 0).map(f64::from);
        let [c, d] = random::pair(5, i, 1).map(f64::from);
        let rays = 1_000.0 + 50_000.0 * a;
        let (boxes, triangles) = (rays * (10.0 + 60.0 * b), rays * (2.0 + 10.0 * c));
        let divergence = rays * 10.0 * f64::from(random::pair(5, i, 2)[0]);
        let exact = dot(&TRUE, &[1.0, rays, boxes, triangles, divergence]);
        let seconds = exact * (1.0 + noise * (2.0 * d - 1.0));
        Measured { launches: 1.0, rays, boxes, triangles, divergence, seconds }
    }

    fn predicted(model: &CostModel, m: &Measured) -> f64 {
        model.per_launch() * m.launches
            + model.per_ray() * m.rays
            + model.per_box() * m.boxes
            + model.per_triangle() * m.triangles
            + model.per_divergence() * m.divergence
    }

    #[test]
    fn finds_the_prices_of_exact_launches() {
        let mut calibration = Calibration::default();
        (0..40).for_each(|i| calibration.observe(launch(i, 0.0)));
        let Fit { model, relative_error, prices } = calibration.fit().expect("40 launches");
        let found =
            [model.per_launch(), model.per_ray(), model.per_box(), model.per_triangle(), model.per_divergence()];
        for (found, wanted) in found.iter().zip(TRUE) {
            assert!((found / wanted - 1.0).abs() < 0.02, "{found} is not {wanted}");
        }
        assert_eq!(prices, 5);
        assert!(relative_error < 1e-4, "{relative_error}");
    }

    /// Mutants: tasks that predict themselves; a task predicted by the price of the wrong half.
    #[test]
    fn predictions_come_from_other_tasks() {
        let work: Vec<Work> = (0..40).map(|i| Work::new(100.0, 1_000.0 + 37.0 * (i * i % 11) as f32, 50.0)).collect();
        // Odd tasks run at half the speed: each half is predicted at the other's.
        let is_even = |i: usize| i.is_multiple_of(2);
        let price = |i: usize| if is_even(i) { 1e-9 } else { 2e-9 };
        let seconds: Vec<f64> = work.iter().enumerate().map(|(i, w)| price(i) * f64::from(w.tests())).collect();
        for (i, (predicted, own)) in cross_predicted(&work, &seconds).iter().zip(&seconds).enumerate() {
            let ratio = if is_even(i) { 2.0 } else { 0.5 };
            assert!((predicted / own / ratio - 1.0).abs() < 0.05, "{i}: {predicted} {own}");
        }
        assert!(cross_predicted(&work, &[f64::NAN; 40]).iter().all(|p| p.is_nan()));
        assert!(cross_predicted(&[], &[]).is_empty());
    }

    #[test]
    fn pooling_is_observing_both() {
        let [mut even, mut odd, mut both] = [Calibration::new(f64::INFINITY); 3];
        for i in 0..40 {
            let half = if i % 2 == 0 { &mut even } else { &mut odd };
            half.observe(launch(i, 0.1));
            both.observe(launch(i, 0.1));
        }
        let [pooled, both] = [even.pooled(&odd), both].map(|c| c.fit().expect("40 launches").model);
        for of in [CostModel::per_launch, CostModel::per_ray, CostModel::per_box, CostModel::per_triangle] {
            assert!((of(&pooled) - of(&both)).abs() <= 1e-6 * of(&both), "{pooled:?} is not {both:?}");
        }
        assert!((even.pooled(&odd).weight() - 40.0).abs() < 1e-9);
    }

    #[test]
    fn one_launch_gives_one_price_and_no_launch_none() {
        let mut calibration = Calibration::default();
        assert_eq!(calibration.fit(), None);
        calibration.observe(Measured::default());
        calibration.observe(Measured { rays: f64::NAN, seconds: 1.0, ..Measured::default() });
        assert_eq!(calibration.fit(), None, "useless observations");
        let m = launch(0, 0.0);
        calibration.observe(m);
        let fit = calibration.fit().expect("one launch");
        assert_eq!(fit.prices, 1);
        assert!((predicted(&fit.model, &m) / m.seconds - 1.0).abs() < 1e-9);
        let mut rays_only = Calibration::default();
        rays_only.observe(Measured { rays: 100.0, seconds: 2.0, ..Measured::default() });
        assert!((rays_only.fit().expect("rays are priced").model.per_ray() - 0.02).abs() < 1e-9);
    }

    #[test]
    fn collinear_launches_fall_back_to_fewer_prices() {
        let mut calibration = Calibration::default();
        for i in 1..50 {
            let rays = f64::from(i) * 1_000.0;
            calibration.observe(Measured {
                launches: 1.0,
                rays,
                boxes: 40.0 * rays,
                triangles: 5.0 * rays,
                divergence: 8.0 * rays,
                seconds: 1e-5 + 1e-7 * rays,
            });
        }
        let fit = calibration.fit().expect("49 launches");
        assert_eq!(fit.prices, 2);
        assert!((fit.model.per_launch() / 1e-5 - 1.0).abs() < 1e-3, "{fit:?}");
        assert!(fit.relative_error < 1e-4, "{fit:?}");
    }

    /// Mutant: `observed` that is always true, which falls back to one price for everything.
    #[test]
    fn prices_are_told_apart_where_launches_or_divergence_are_unknown() {
        let fit = |of: &dyn Fn(Measured) -> Measured| {
            let mut calibration = Calibration::default();
            (0..40).for_each(|i| calibration.observe(of(launch(i, 0.0))));
            calibration.fit().expect("40 launches")
        };
        let alike = fit(&|m| Measured { divergence: 0.0, seconds: m.seconds - TRUE[4] * m.divergence, ..m });
        assert_eq!((alike.prices, alike.model.per_divergence()), (4, 0.0));
        let tasks = fit(&|m| Measured { launches: 0.0, seconds: m.seconds - TRUE[0], ..m });
        assert_eq!((tasks.prices, tasks.model.per_launch()), (4, 0.0));
        for fit in [alike, tasks] {
            assert!(fit.relative_error < 1e-4, "{fit:?}");
        }
    }

    /// Mutant: a tier too few, so that divergence that follows the boxes leaves one price for everything.
    #[test]
    fn divergence_is_free_where_it_cannot_be_told_from_boxes() {
        let mut calibration = Calibration::default();
        (0..40).for_each(|i| {
            let m = launch(i, 0.0);
            let divergence = 0.1 * m.boxes;
            let seconds = m.seconds + TRUE[4] * (divergence - m.divergence);
            calibration.observe(Measured { divergence, seconds, ..m });
        });
        let fit = calibration.fit().expect("40 launches");
        assert_eq!((fit.prices, fit.model.per_divergence()), (4, 0.0));
        assert!(fit.relative_error < 1e-4, "{fit:?}");
    }

    #[test]
    fn follows_a_device_that_becomes_slower() {
        let mut calibration = Calibration::new(50.0);
        (0..200).for_each(|i| calibration.observe(launch(i, 0.01)));
        for i in 200..500 {
            let m = launch(i, 0.01);
            calibration.observe(Measured { seconds: 2.0 * m.seconds, ..m });
        }
        let model = calibration.fit().expect("500 launches").model;
        let m = launch(1_000, 0.0);
        assert!((predicted(&model, &m) / (2.0 * m.seconds) - 1.0).abs() < 0.05);
    }

    proptest! {
        /// Whatever was measured, the fit is a valid model, never worse than one common price.
        ///
        /// Mutants: `best` without its minimum; `solve` that lets negative prices pass and clamps them; `b` not divided
        /// by the pivot.
        #[test]
        fn fits_are_valid_and_no_worse_than_one_price(
            launches in prop::collection::vec(
                (0.0_f64..3.0, 0.0_f64..1e6, 0.0_f64..1e8, 0.0_f64..1e7, 0.0_f64..1e8, 1e-6_f64..10.0), 1..60
            ),
        ) {
            let mut calibration = Calibration::new(f64::INFINITY);
            for (launches, rays, boxes, triangles, divergence, seconds) in launches {
                calibration.observe(Measured { launches, rays, boxes, triangles, divergence, seconds });
            }
            let fit = calibration.fit().expect("rays cost something");
            let one = calibration.best(&[ONE_PRICE]).expect("one price always fits");
            prop_assert!(fit.relative_error <= one.relative_error * (1.0 + 1e-6));
        }

        /// With noisy clocks predictions are near the truth.
        ///
        /// Mutants: weights of 1 instead of `1 / seconds²`; a forgotten column.
        #[test]
        fn noisy_clocks_average_out(first in 0_u32..1_000_000, n in 30_u32..200) {
            let mut calibration = Calibration::default();
            (first..first + n).for_each(|i| calibration.observe(launch(i, 0.05)));
            let model = calibration.fit().expect("launches").model;
            let error = |i| {
                let m = launch(i, 0.0);
                (predicted(&model, &m) / m.seconds - 1.0).abs()
            };
            let mean = (2_000_000..2_000_020).map(error).sum::<f64>() / 20.0;
            prop_assert!(mean < 0.03, "{mean}");
        }
    }
}
