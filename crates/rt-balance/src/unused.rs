//! What an estimate would have said of a stream that was traced without one.

use crate::report::{ErrorReport, StreamRun, UnusedReport};
use crate::{BalanceError, Balancer, Control, Estimate, Limits, Scheduling, Stream};
use rt_core::{Walk, Work};
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
