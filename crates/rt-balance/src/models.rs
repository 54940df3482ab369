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

/// The cost model of each lane for a kind of stream: from launches where every lane has some, else from walks, else one
/// for all. Models from different sources must not meet in one schedule, since walks are dearer than launches.
pub(crate) fn models_for(members: &[Member], lanes: &[usize], kind: StreamKind) -> Vec<CostModel> {
    let class = class(kind);
    let all = |of: fn(&Models) -> &[Calibration; CLASSES]| -> Option<Vec<CostModel>> {
        lanes.iter().map(|&lane| Some(of(&members[lane].models)[class].fit()?.model)).collect()
    };
    all(|models| &models.launches)
        .or_else(|| all(|models| &models.walks))
        .unwrap_or_else(|| vec![CostModel::default(); lanes.len()])
}
