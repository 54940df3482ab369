//! What was learned about each device's speed.

use crate::Stream;
use crate::device_state::DeviceState;
use crate::record::{LaunchDone, WalkDone};
use rt_core::{
    Coherence, CostEstimator, CostModel, CountedTree, CountsToken, DeviceInfo, StreamKind, StreamSpec, TaskId, Work,
};
use rt_sched::calibrate::{Calibration, Fit, Measured};
use rt_sched::estimate::Uniform;
use rt_sched::uninformed::Regime;
use std::collections::BTreeMap;

/// The measurements of one device.
#[derive(Debug, Default)]
pub(crate) struct Models {
    /// Launches. Prices fitted to one estimator's counts mean nothing for another's.
    launches: BTreeMap<Key, Calibration>,
    /// Walks of samples: more expensive per test than launches, since sparse rays share little, but alike on all
    /// devices, so they tell relative speeds before the first launch.
    walks: BTreeMap<Key, Calibration>,
}

/// What launches must have in common to be priced alike: the estimator that counted their tests, and whose those are,
/// and the kind of stream, since incoherent rays miss the caches that coherent ones hit, and several hits or masks take
/// other kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    counts: CountsToken,
    class: u8,
    coherence: Coherence,
    counted: CountedTree,
    hits_per_ray: usize,
    has_mask: bool,
}

impl Key {
    /// The key of a stream whose estimate has such counts.
    fn new(counts: CountsToken, stream: &Stream) -> Self {
        let class = match stream.kind {
            StreamKind::Primary => 0,
            StreamKind::Shadow(_) => 1,
            StreamKind::Diffuse(_) => 2,
            _ => 3,
        };
        let StreamSpec { coherence, counted, query, mask, .. } = stream.spec;
        let (hits_per_ray, has_mask) = (query.hits_per_ray(), mask != u32::MAX);
        Self { counts, class, coherence, counted, hits_per_ray, has_mask }
    }

    /// The key of a stream after its estimate.
    pub(crate) fn of(estimator: &dyn CostEstimator, stream: &Stream) -> Self {
        Self::new(estimator.counts(), stream)
    }

    /// The key of a stream of which nothing but its rays is known.
    fn of_rays(stream: &Stream) -> Self {
        Self::new(Uniform.counts(), stream)
    }
}

impl Models {
    pub(crate) fn walked(&mut self, key: Key, walk: &WalkDone) {
        self.walks.entry(key).or_default().observe(Measured {
            launches: 1.0,
            rays: walk.rays.into(),
            boxes: walk.boxes as f64,
            triangles: walk.triangles as f64,
            // Samples are not neighbours.
            divergence: 0.0,
            seconds: walk.span.busy().as_secs_f64(),
        });
    }

    /// Adds a launch; `left` is the work that it was predicted to be.
    pub(crate) fn launched<'a>(&mut self, key: Key, launch: &LaunchDone, left: impl Fn(TaskId) -> &'a Work) {
        let calibration = self.launches.entry(key).or_default();
        // What the host does for a launch is hidden by the one before, and no price of the device.
        let seconds = launch.span.busy().as_secs_f64();
        if launch.per_task {
            let mut inside = 0.0;
            for outcome in &launch.outcomes {
                calibration.observe(Measured::of(left(outcome.task), outcome.measured_s));
                inside += outcome.measured_s;
            }
            calibration.observe(Measured {
                launches: 1.0,
                seconds: (seconds - inside).max(0.0),
                ..Measured::default()
            });
        } else {
            let sum = launch.outcomes.iter().fold(Work::default(), |sum, outcome| sum.plus(left(outcome.task)));
            calibration.observe(Measured { launches: 1.0, ..Measured::of(&sum, seconds) });
        }
    }

    /// The prices of launches fitted so far.
    pub(crate) fn fit(&self, key: Key) -> Option<Fit> {
        self.launches.get(&key)?.fit()
    }

    /// Fitted seconds of a launch before its first ray, over all streams; 0 before anything was measured.
    pub(crate) fn per_launch(&self) -> f64 {
        let fits = self.launches.values().filter_map(|c| Some(c.fit()?.model.per_launch()));
        fits.reduce(f64::min).unwrap_or(0.0)
    }
}

/// Devices whose models differ by less than this on the work at hand share one, fitted to the launches of all.
///
/// On a shared machine the fits of two equal cores differ by some percent from stream to stream; believing that would
/// unbalance a static schedule by half of it. Real differences below this are left to the queue.
const ALIKE: f64 = 1.15;

/// The cost model of each worker for `work`: from launches where every worker has some, else from walks, else from
/// launches of other kinds with the same counts, by which at least speeds are known; else one for all. Models from
/// different sources must not meet in one schedule, since walks are more expensive than launches.
pub(crate) fn models_for(members: &[DeviceState], workers: &[usize], key: Key, work: &[Work]) -> Vec<CostModel> {
    let of = |calibrations: fn(&Models) -> &BTreeMap<Key, Calibration>, key: Key| {
        let all = workers.iter().map(|&worker| calibrations(&members[worker].models).get(&key).copied());
        fitted(&all.collect::<Option<Vec<Calibration>>>()?, work)
    };
    let launches = |key| of(|models| &models.launches, key);
    let elsewhere = || {
        let keys = members[*workers.first()?].models.launches.keys();
        keys.filter(|other| other.counts == key.counts).find_map(|&other| launches(other))
    };
    let found = launches(key).or_else(|| of(|models| &models.walks, key)).or_else(elsewhere);
    found.unwrap_or_else(|| vec![CostModel::default(); workers.len()])
}

/// What is known of a run of `stream` before anything is estimated.
pub(crate) fn regime(members: &[DeviceState], stream: &Stream) -> Regime {
    let workers: Vec<usize> = (0..members.len()).filter(|&i| members[i].is_ready()).collect();
    // As if every ray were a task: what it takes is the price of a test.
    let work = [Work::new(0.0, stream.source.len() as f32, 0.0)];
    let models = models_for(members, &workers, Key::of_rays(stream), &work);
    // Of each device its launch in its part of the stream; those with much of the stream count for as much.
    let launch = models.iter().map(|model| model.per_launch() / model.seconds(&work[0])).filter(|x| x.is_finite());
    Regime {
        tasks: stream.tasks.len(),
        devices: workers.len(),
        are_speeds_known: models.iter().any(|model| *model != CostModel::UNIT),
        are_alike: are_alike(workers.iter().map(|&worker| &members[worker].info)),
        launch: launch.sum(),
    }
}

/// Whether devices tell that they are of one kind: by their backends, their units, and their names but for whole
/// numbers, such as those of their cores. Where that is wrong they are taken for equal until they are measured.
fn are_alike<'a>(infos: impl Iterator<Item = &'a DeviceInfo>) -> bool {
    let is_number = |word: &&str| word.parse::<u32>().is_ok();
    let words = |name: &'a str| name.split(|c: char| !(c.is_alphanumeric() || c == '.')).filter(move |w| !is_number(w));
    let mut kinds = infos.map(|info| (info.backend, info.units, words(&info.name).collect::<Vec<_>>()));
    let first = kinds.next();
    kinds.all(|kind| Some(kind) == first)
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
            calibration.observe(Measured::of(&work, seconds));
        }
        calibration
    }

    /// Mutants: names as they are; numbers with a point left out; backends left out.
    #[test]
    fn cores_are_alike_and_slower_ones_are_not() {
        let info = |name: &str, backend| DeviceInfo::new(name, backend);
        let alike = |infos: &[DeviceInfo]| are_alike(infos.iter());
        let cores = [0, 1].map(|core| info(&format!("CPU {core} (core {core}, avx512)"), "cpu"));
        assert!(alike(&cores) && alike(&cores[..1]) && alike(&[]));
        let slow = ["CPU 2 (core 2, avx512) at speed 0.2", "CPU 2 (core 2, avx512) at speed 0.5"];
        let [slow, slower] = slow.map(|name| info(name, "cpu"));
        assert!(!alike(&[cores[0].clone(), slow.clone()]) && !alike(&[slow, slower]));
        assert!(!alike(&[info("one", "vulkan"), info("one", "wgpu")]));
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
