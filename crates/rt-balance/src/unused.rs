//! What an estimate would have said of a stream that was traced without one.

use crate::report::{ErrorReport, StreamRun, UnusedReport};
use crate::{BalanceError, Balancer, Control, Estimate, Limits, Scheduling, Stream};
use rt_core::{Task, Walk, Work};
use rt_sched::estimate::Sampled;
use rt_sched::metrics::EstimateErrors;
use rt_sched::sample::Fraction;

/// An estimate by which nothing was scheduled. It was made when the stream had been traced, outside everything that is
/// timed, so that it can be set beside what was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct UnusedEstimate {
    /// Expected work of each task.
    pub work: Vec<Work>,
    /// Predicted seconds of each task on the device that traced it; NaN where that device took no part in the estimate.
    pub predicted_s: Vec<f64>,
}

impl Balancer {
    /// Samples `fraction` of the rays of a stream that was just traced without an estimate, and notes in its record
    /// what that took and would have predicted. It changes nothing of how later streams are scheduled: samples have
    /// prices of their own.
    ///
    /// Where no device can walk, nothing is noted.
    ///
    /// # Errors
    /// When the caller cancels.
    pub fn estimate_unused(
        &mut self,
        stream: &Stream,
        run: &mut StreamRun,
        fraction: Fraction,
        limits: Limits,
        control: Control<'_>,
    ) -> Result<(), BalanceError> {
        let stream = &stream.cut_as(run);
        let estimator = Box::new(Sampled::new(Walk::Full, fraction));
        let mut scheduling = Scheduling { estimator, limits, ..Scheduling::default() };
        let Estimate { work, predicted_s, fraction, seconds } = match self.estimate(stream, &mut scheduling, control) {
            Ok(estimate) => estimate,
            Err(cancelled) if control.is_cancelled() => return Err(cancelled),
            Err(_) => return Ok(()),
        };
        let of_tracer = |(task, &device): (usize, &u32)| {
            let of_device = predicted_s.get(device as usize).and_then(Option::as_ref);
            of_device.map_or(f64::NAN, |seconds| seconds[task])
        };
        let predicted_s: Vec<f64> = run.device_of.iter().enumerate().map(of_tracer).collect();
        let predicted_s = priced(predicted_s, &work, &run.tasks);
        run.report.estimate.unused = Some(UnusedReport {
            estimator: scheduling.estimator.name().to_owned(),
            fraction,
            seconds,
            errors_time: EstimateErrors::new(&predicted_s, &run.measured_s).map(ErrorReport::from),
        });
        run.unused = Some(UnusedEstimate { work, predicted_s });
        Ok(())
    }
}

/// Seconds that no device traces a ray in.
const NOTHING_S: f64 = 1e-12;

/// About what a test takes, where prices say nothing of it.
const TEST_S: f64 = 1e-9;

/// What tasks are predicted to take. The first walks of a kind of rays are few and alike, and may tell nothing but that
/// a launch costs something: then tasks would seem to cost nothing, whatever was counted. They cost what tests do.
fn priced(predicted_s: Vec<f64>, work: &[Work], tasks: &[Task]) -> Vec<f64> {
    let rays: f64 = tasks.iter().map(|task| f64::from(task.rays)).sum();
    if predicted_s.iter().copied().filter(|seconds| seconds.is_finite()).sum::<f64>() > NOTHING_S * rays {
        return predicted_s;
    }
    let by_tests = |(seconds, work): (f64, &Work)| seconds + f64::from(work.tests()) * TEST_S;
    predicted_s.into_iter().zip(work).map(by_tests).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails when a price of nothing makes all tasks alike, or real prices are passed over.
    #[test]
    fn tasks_without_a_price_cost_what_their_tests_do() {
        let tasks = [Task { first: 0, rays: 8 }, Task { first: 8, rays: 8 }, Task { first: 16, rays: 8 }];
        let work = [10.0, 30.0, 20.0].map(|tests| Work::new(8.0, tests, 0.0));
        let [first, second, unknown] = priced(vec![8e-15, 8e-15, f64::NAN], &work, &tasks)[..] else { unreachable!() };
        assert!((second / first - 3.0).abs() < 1e-3 && unknown.is_nan(), "{first} {second} {unknown}");
        let real = vec![1e-6, 2e-6, 3e-6];
        assert_eq!(priced(real.clone(), &work, &tasks), real);
    }
}
