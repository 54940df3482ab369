//! Estimated beside measured cost of a stream's tasks, in numbers that can be compared.

use super::super::bars;
use rt_balance::report::{ActivityKind, StreamRun};

/// Devices whose speeds differ by less than this are taken for alike: as much as two equal cores of a shared machine
/// may seem to differ.
const ALIKE: f64 = 1.15;

/// Where an estimate comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Origin {
    /// The stream was scheduled by it.
    Used,
    /// It was made afterwards, for comparison.
    NotUsed,
    /// There is none: every ray counted the same.
    Nowhere,
}

/// What the tasks of a stream cost, one entry for each.
#[derive(Debug)]
pub(crate) struct TaskCosts {
    pub(crate) origin: Origin,
    /// Box and triangle tests that were expected, and their standard error; empty where nothing was.
    pub(crate) tests: Vec<(f32, Option<f32>)>,
    /// Predicted seconds on the device that traced the task, after one scale for each device that makes their total
    /// what it took: only relative costs matter for balancing, and a device's first prices come from sparse samples,
    /// which are more expensive than what follows. NaN where nothing was predicted.
    pub(crate) estimated_s: Vec<f64>,
    /// Seconds on the device that traced the task; NaN where unknown.
    pub(crate) measured_s: Vec<f64>,
    /// For each device, what turns its seconds into those of a device of mean speed; all 1 where devices are alike.
    pub(crate) factors: Vec<f64>,
}

impl TaskCosts {
    /// Of a stream that was traced.
    pub(crate) fn of(run: &StreamRun) -> Self {
        let (origin, work, predicted) = match &run.unused {
            Some(unused) => (Origin::NotUsed, &unused.work, &unused.predicted_s),
            None if run.report.estimate.is_uninformed() => (Origin::Nowhere, &run.work, &run.predicted_s),
            None => (Origin::Used, &run.work, &run.predicted_s),
        };
        let devices = run.report.devices.len();
        let sums = |values: &mut dyn Iterator<Item = f64>| {
            let mut sums = vec![0.0; devices];
            for (value, &device) in values.zip(&run.device_of) {
                if let Some(sum) = sums.get_mut(device as usize) {
                    *sum += value;
                }
            }
            sums
        };
        let measured = sums(&mut run.measured_s.iter().copied());
        let launched = launch_seconds(run, devices);
        // What is not known task by task is known of launches.
        let took: Vec<f64> = measured.iter().zip(launched).map(|(&m, l)| if m.is_finite() { m } else { l }).collect();
        let expected = sums(&mut predicted.iter().copied());
        let scales: Vec<f64> = took.iter().zip(expected).map(|(took, expected)| ratio(*took, expected)).collect();
        let tested = sums(&mut work.iter().map(|work| f64::from(work.tests())));
        let of_device = |task: usize| scales.get(run.device_of[task] as usize).copied().unwrap_or(1.0);
        let estimated = |(task, seconds): (usize, &f64)| seconds * of_device(task);
        let is_known = origin != Origin::Nowhere;
        Self {
            origin,
            tests: if is_known { work.iter().map(|w| (w.tests(), w.std_error())).collect() } else { Vec::new() },
            estimated_s: if is_known {
                predicted.iter().enumerate().map(estimated).collect()
            } else {
                vec![f64::NAN; run.tasks.len()]
            },
            measured_s: run.measured_s.clone(),
            factors: factors(&tested, &took),
        }
    }

    /// Estimated and measured seconds of each task on a device of mean speed.
    pub(crate) fn pairs<'a>(&'a self, run: &'a StreamRun) -> impl Iterator<Item = [f64; 2]> + 'a {
        let factor = |device: u32| self.factors.get(device as usize).copied().unwrap_or(1.0);
        let tasks = self.estimated_s.iter().zip(&self.measured_s).zip(&run.device_of);
        tasks.map(move |((estimated, measured), &device)| [estimated, measured].map(|s| s * factor(device)))
    }
}

/// Seconds that each device spent on launches.
fn launch_seconds(run: &StreamRun, devices: usize) -> Vec<f64> {
    let of = |row: &Vec<bars::Bar<'_>>| {
        let launches = row.iter().filter(|bar| bar.activity.kind == ActivityKind::Launch);
        launches.map(|bar| bar.end_s - bar.start_s).sum()
    };
    let mut seconds: Vec<f64> = bars::rows(run).iter().map(of).collect();
    seconds.resize(devices, 0.0);
    seconds
}

/// How fast each device is beside the mean one, by the tests it made in so many seconds.
fn factors(tests: &[f64], seconds: &[f64]) -> Vec<f64> {
    let mean = ratio(tests.iter().sum(), seconds.iter().sum());
    let speeds: Vec<f64> = tests.iter().zip(seconds).map(|(&t, &s)| ratio(ratio(t, s), mean)).collect();
    let took_part = || speeds.iter().zip(seconds).filter(|(_, seconds)| **seconds > 0.0).map(|(speed, _)| *speed);
    let (least, most) =
        took_part().fold((f64::INFINITY, 0.0), |(least, most): (f64, f64), s| (least.min(s), most.max(s)));
    if most <= ALIKE * least { vec![1.0; speeds.len()] } else { speeds }
}

/// `of / to`; 1 where that says nothing.
fn ratio(of: f64, to: f64) -> f64 {
    let ratio = of / to;
    if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::super::samples::{launch, run};
    use super::*;
    use rt_balance::UnusedEstimate;
    use rt_core::{Task, Work};

    /// Four tasks, two for each of two devices: the second needs four times as long for the same.
    fn traced() -> StreamRun {
        let mut run = run(2, vec![launch(0, 0.0, 3.0), launch(1, 0.0, 12.0)]);
        run.tasks = (0..4).map(|task| Task { first: 8 * task, rays: 8 }).collect();
        run.work = vec![Work::new(8.0, 8.0, 0.0); 4];
        run.kept = vec![0; 4];
        run.predicted_s = vec![1.0; 4];
        run.measured_s = vec![1.0, 2.0, f64::NAN, f64::NAN];
        run.device_of = vec![0, 0, 1, 1];
        run.report.estimate.chosen = "uniform".to_owned();
        run
    }

    fn looked_at() -> StreamRun {
        let tests = [1.0, 2.0, 1.0, 2.0];
        let work = tests.map(|tests| Work::new(8.0, 100.0 * tests, 0.0)).to_vec();
        StreamRun { unused: Some(UnusedEstimate { work, predicted_s: vec![2.0, 4.0, 20.0, 40.0] }), ..traced() }
    }

    /// Mutants: one scale for all devices; the seconds of a launch left out where tasks have none of their own; a
    /// device's factor upside down.
    #[test]
    fn devices_are_scaled_each_by_itself_and_compared_by_their_speed() {
        let run = looked_at();
        let costs = TaskCosts::of(&run);
        assert_eq!(costs.origin, Origin::NotUsed);
        assert_eq!(costs.estimated_s, [1.0, 2.0, 4.0, 8.0]);
        let pairs: Vec<[f64; 2]> = costs.pairs(&run).collect();
        // 100 tests take 2.5 s on the mean of both.
        let estimated: Vec<f64> = pairs.iter().map(|pair| pair[0]).collect();
        assert_eq!(estimated, [2.5, 5.0, 2.5, 5.0]);
        assert_eq!(pairs[1][1], 5.0);
        assert!(pairs[2][1].is_nan());
    }

    /// Mutant: what every ray counted is taken for an estimate.
    #[test]
    fn what_nobody_estimated_is_unknown() {
        let costs = TaskCosts::of(&traced());
        assert_eq!(costs.origin, Origin::Nowhere);
        assert!(costs.tests.is_empty() && costs.estimated_s.iter().all(|s| s.is_nan()));
        let used = {
            let mut run = traced();
            run.report.estimate.chosen = "exact".to_owned();
            run
        };
        assert_eq!(TaskCosts::of(&used).origin, Origin::Used);
    }

    /// Mutant: equal cores are told apart by their noise.
    #[test]
    fn alike_devices_keep_their_seconds() {
        assert_eq!(factors(&[100.0, 100.0, 0.0], &[1.0, 1.1, 0.0]), [1.0; 3]);
        let far = factors(&[100.0, 100.0], &[1.0, 4.0]);
        assert_eq!(far, [2.5, 0.625]);
    }
}
