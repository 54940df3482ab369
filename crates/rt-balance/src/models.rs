//! What was learned about each device's speed.

use crate::balancer::Member;
use crate::estimate::WalkRecord;
use crate::run::LaunchDone;
use rt_core::{CostModel, StreamKind, TaskId, Work};
use rt_sched::calibrate::{Calibration, Measured};

/// The measurements of one device.
#[derive(Debug, Default)]
pub(crate) struct Models {
    /// Launches, per class of stream: incoherent rays miss the caches that coherent ones hit.
    launches: [Calibration; CLASSES],
    /// Walks of samples: dearer per test than launches, since sparse rays share little, but alike on all devices, so
    /// they tell relative speeds before the first launch.
    walks: [Calibration; CLASSES],
}

/// Number of [`class`]es.
const CLASSES: usize = 4;

const fn class(kind: StreamKind) -> usize {
    match kind {
        StreamKind::Primary => 0,
        StreamKind::Shadow(_) => 1,
        StreamKind::Diffuse(_) => 2,
        _ => 3,
    }
}

impl Models {
    pub(crate) fn walked(&mut self, kind: StreamKind, walk: &WalkRecord) {
        self.walks[class(kind)].observe(Measured {
            launches: 1.0,
            rays: walk.rays.into(),
            boxes: walk.boxes as f64,
            triangles: walk.triangles as f64,
            seconds: walk.span.duration().as_secs_f64(),
        });
    }

    /// Adds a launch; `left` is the work that it was predicted to be.
    pub(crate) fn launched<'a>(&mut self, kind: StreamKind, launch: &LaunchDone, left: impl Fn(TaskId) -> &'a Work) {
        let calibration = &mut self.launches[class(kind)];
        let seconds = launch.span.duration().as_secs_f64();
        if launch.per_task {
            let mut inside = 0.0;
            for outcome in &launch.outcomes {
                calibration.observe(measured(0.0, left(outcome.task), outcome.measured_s));
                inside += outcome.measured_s;
            }
            calibration.observe(measured(1.0, &Work::default(), (seconds - inside).max(0.0)));
        } else {
            let sum = launch.outcomes.iter().fold(Work::default(), |sum, outcome| sum.plus(left(outcome.task)));
            calibration.observe(measured(1.0, &sum, seconds));
        }
    }

    /// Fitted seconds of a launch before its first ray; 0 before anything was measured.
    pub(crate) fn per_launch(&self, kind: StreamKind) -> f64 {
        self.launches[class(kind)].fit().map_or(0.0, |fit| fit.model.per_launch())
    }
}

/// An observation of estimated work.
pub(crate) fn measured(launches: f64, work: &Work, seconds: f64) -> Measured {
    let [rays, boxes, triangles] = [work.rays(), work.boxes(), work.triangles()].map(f64::from);
    Measured { launches, rays, boxes, triangles, seconds }
}

/// Devices whose models differ by less than this on the work at hand share one, fitted to the launches of all.
///
/// On a shared machine the fits of two equal cores differ by some percent from stream to stream; believing that would
/// unbalance a static schedule by half of it. Real differences below this are left to the queue.
const ALIKE: f64 = 1.15;

/// The cost model of each lane for `work` of a kind of stream: from launches where every lane has some, else from
/// walks, else one for all. Models from different sources must not meet in one schedule, since walks are dearer than
/// launches.
pub(crate) fn models_for(members: &[Member], lanes: &[usize], kind: StreamKind, work: &[Work]) -> Vec<CostModel> {
    let class = class(kind);
    let of = |calibrations: fn(&Models) -> &[Calibration; CLASSES]| -> Vec<Calibration> {
        lanes.iter().map(|&lane| calibrations(&members[lane].models)[class]).collect()
    };
    fitted(&of(|models| &models.launches), work)
        .or_else(|| fitted(&of(|models| &models.walks), work))
        .unwrap_or_else(|| vec![CostModel::default(); lanes.len()])
}

/// One model for each calibration, alike ones pooled; `None` when one of them has seen nothing.
fn fitted(calibrations: &[Calibration], work: &[Work]) -> Option<Vec<CostModel>> {
    let total = work.iter().fold(Work::default(), |sum, work| sum.plus(work));
    let fits: Option<Vec<CostModel>> = calibrations.iter().map(|c| Some(c.fit()?.model)).collect();
    let mut models = fits?;
    let seconds: Vec<f64> = models.iter().map(|model| model.seconds(&total)).collect();
    let mut order: Vec<usize> = (0..models.len()).collect();
    order.sort_by(|&a, &b| seconds[a].total_cmp(&seconds[b]));
    // From the fastest up; a group ends where the next device is not like the group's first.
    for group in order.chunk_by(|&a, &b| seconds[b] <= ALIKE * seconds[a]) {
        let pooled = group[1..].iter().fold(calibrations[group[0]], |pooled, &i| pooled.pooled(&calibrations[i]));
        if let Some(fit) = pooled.fit() {
            group.iter().for_each(|&i| models[i] = fit.model);
        }
    }
    Some(models)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device that needs `ns` nanoseconds for every ray and test, as measured in 20 launches.
    fn device(ns: f64) -> Calibration {
        let mut calibration = Calibration::default();
        for i in 1..=20_u16 {
            let work = Work::new(100.0, 1000.0 * f32::from(i % 7 + 1), 100.0 * f32::from(i % 3));
            let seconds = f64::from(work.rays() + work.tests()) * ns * 1e-9;
            calibration.observe(measured(0.0, &work, seconds));
        }
        calibration
    }

    #[test]
    fn alike_devices_share_a_model_and_others_do_not() {
        let work = [Work::new(1e6, 1e7, 1e6)];
        let models = fitted(&[device(1.0), device(2.0), device(1.05)], &work).expect("all were measured");
        assert_eq!(models[0], models[2]);
        let [slow, fast] = [1, 0].map(|i: usize| models[i].seconds(&work[0]));
        assert!((1.9..2.0).contains(&(slow / fast)), "{slow} {fast}");
        assert_eq!(fitted(&[device(1.0), Calibration::default()], &work), None);
    }
}
