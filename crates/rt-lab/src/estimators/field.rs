//! Costs from a map of where in the scene rays are expensive.

use super::cells::{Cell, Cells, Heading, NO_SLOT, Place};
use rt_core::{
    CostEstimator, Observation, RaySource, RayStream, Step, StreamKind, Task, TestCounts, Walk, Work, random, tasks_of,
};
use rt_sched::estimate::batch::{Asked, Batch, Divergence, scaled_up};
use rt_sched::sample::Fraction;
use std::ops::Range;

/// Learns where in the scene, and in which direction, rays are expensive, and corrects that by each task's own samples.
///
/// A task of few rays has one sample or none, and diffuse rays from one spot differ much: there the samples of
/// neighbours and of earlier streams say more than the task's own. The map is a hierarchy of cells of position and
/// direction that keep means of residuals. A task's estimate is what the map says of some of its rays
/// plus its own samples' mean residual, believed as far as tasks differ from the map at all: the empirical best linear
/// predictor of small area estimation (R. Fay and R. Herriot, *Estimates of Income for Small Places*, 1979), over a
/// regression estimator with two-phase sampling (W. Cochran, *Sampling Techniques*, 1977, 12.6). Its standard error is
/// that predictor's, from residuals of rays that the map had not seen.
///
/// Where rays are coherent and every task has a sample, the map is not asked: those samples are spread so evenly that
/// it only adds errors. With 4, 8 and 16 samples for each 1,024 primary rays of four scenes its mean error was 1.3 to
/// 3.8 times theirs when it was new and 1.1 to 2.1 times when it had seen two streams (`--bin coverage`); so these are
/// scaled up as by the estimator `exact`.
///
/// Price: the walks of its sample, whose hits are kept; on one thread of the host some 0.2 µs a sample to learn and
/// 0.05 µs for one ray in 32 to look up; 2 MB for each kind of stream.
#[derive(Clone, Debug)]
pub(crate) struct Field {
    fraction: Fraction,
    fields: Fields,
    asked: Asked,
}

impl Field {
    /// An estimator that walks `fraction` of the rays in full.
    pub(crate) fn new(fraction: Fraction) -> Self {
        Self { fraction, fields: Fields::default(), asked: Asked::default() }
    }
}

impl Default for Field {
    /// Exact counts of one ray in 64.
    fn default() -> Self {
        Self::new(Fraction::SIXTY_FOURTH)
    }
}

impl CostEstimator for Field {
    fn name(&self) -> &'static str {
        "field"
    }

    fn next(&mut self, stream: RayStream<'_>, seen: Observation<'_>) -> Step {
        if self.asked.is_answered(stream, seen) {
            return Step::Done(self.fields.estimate(&Batch { stream, seen }));
        }
        let rays = self.asked.choose(stream, blocks(stream, self.fraction).into_iter(), self.fraction);
        if rays.is_empty() {
            return Step::Done(stream.tasks.iter().map(|_| Work::default()).collect());
        }
        Step::Sample { rays, walk: Walk::Full }
    }
}

/// What to sample from: the tasks, or where those are so small that the fraction is less than a ray, blocks of
/// [`BLOCK`] samples. Some tasks then have no sample of their own.
pub(super) fn blocks(stream: RayStream<'_>, fraction: Fraction) -> Vec<Task> {
    const BLOCK: f64 = 16.0;
    let rays = stream.rays();
    let smallest = stream.tasks.iter().map(|task| task.rays).min().unwrap_or(0);
    if stream.source.is_none() || f64::from(smallest) * fraction.value() >= 1.0 {
        return stream.tasks.to_vec();
    }
    tasks_of(rays, (BLOCK / fraction.value()).min(f64::from(u32::MAX)) as u32)
}

/// One map for each kind of stream.
#[derive(Clone, Debug, Default)]
pub(super) struct Fields {
    fields: Vec<(Class, CostField)>,
}

/// Kinds of streams whose rays cost alike at one place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    Primary,
    Shadow,
    Diffuse,
    Other,
}

impl Class {
    const fn of(kind: StreamKind) -> Self {
        match kind {
            StreamKind::Primary => Self::Primary,
            StreamKind::Shadow(_) => Self::Shadow,
            StreamKind::Diffuse(_) => Self::Diffuse,
            _ => Self::Other,
        }
    }
}

impl Fields {
    /// The work of each task, after learning from the samples. Without the rays themselves, plain extrapolation.
    pub(super) fn estimate(&mut self, batch: &Batch<'_>) -> Vec<Work> {
        let Some(source) = batch.stream.source else { return batch.extrapolated() };
        if batch.stream.is_coherent() && reaches_all(batch) {
            return batch.extrapolated();
        }
        let class = Class::of(batch.stream.kind);
        let at = self.fields.iter().position(|(own, _)| *own == class).unwrap_or_else(|| {
            self.fields.push((class, CostField::default()));
            self.fields.len() - 1
        });
        self.fields[at].1.estimate(batch, source)
    }
}

/// Whether every task that has rays has a sample.
fn reaches_all(batch: &Batch<'_>) -> bool {
    batch.tasks().all(|(task, rays, _)| task.rays == 0 || !rays.is_empty())
}

/// Of so many rays of a task, one is looked up in the map beside the sampled ones; their mean stands for the task's.
/// Each costs some 0.05 µs of a host thread while the devices wait, so this is some 0.3% of tracing the rays on one
/// thread. Half as many would make errors a twentieth larger. What it leaves open is in the standard error.
const RAYS_PER_LOOKUP: u32 = 32;

/// Fewest lookups of a task.
const LEAST_LOOKUPS: u32 = 4;

/// Most lookups of a task for each sample that tasks have in the mean: where samples are few, their error is larger
/// than what more lookups could mend.
const LOOKUPS_PER_SAMPLE: u32 = 8;

/// A map from where a ray starts and where it goes to its expected tests, that learns from samples.
///
/// It knows nothing but means: of all rays, then of the residuals in ever smaller cells, each shrunk towards 0 while
/// few rays were seen there. Its memory is bounded; what it learned fades from stream to stream.
#[derive(Clone, Debug, Default)]
pub(super) struct CostField {
    cells: Option<Cells>,
    /// Box and triangle tests of a ray, over all.
    mean: [f32; 2],
    weight: f32,
}

/// What the map says of the samples it has just learned from.
struct Learned {
    /// Residual of each sample's box and triangle tests.
    residuals: Vec<[f32; 2]>,
    judges: Judges,
    /// Residual of each judge's tests from what the map says without the samples of its task.
    unseen: Vec<f32>,
}

/// How far tasks and rays differ from the map.
#[derive(Clone, Copy, Debug)]
struct Spread {
    /// Variance of a ray's tests within its task.
    within: f64,
    /// Variance of the tasks' means.
    between: f64,
}

impl CostField {
    fn estimate(&mut self, batch: &Batch<'_>, source: &RaySource) -> Vec<Work> {
        let learned = self.learn(batch, source);
        let spread = Spread::of(&learned);
        let unlike = Divergence::of(batch.seen.counts);
        let per_task = batch.seen.counts.len().div_ceil(batch.stream.tasks.len().max(1));
        let lookups = LOOKUPS_PER_SAMPLE.saturating_mul(per_task as u32);
        let mut at = 0;
        let work = batch.tasks().map(|(task, _, sample)| {
            let residuals = &learned.residuals[at..at + sample.len()];
            at += sample.len();
            let work = if sample.len() >= task.rays as usize {
                scaled_up(sample, task.rays).with_std_error(0.0)
            } else {
                self.task(batch.stream, source, (task, sample), residuals, spread, lookups)
            };
            work.with_divergence(unlike.scaled_up(sample, task.rays))
        });
        work.collect()
    }

    /// The work of one task that was not walked in full.
    fn task(
        &self,
        stream: RayStream<'_>,
        source: &RaySource,
        (task, sample): (Task, &[TestCounts]),
        residuals: &[[f32; 2]],
        spread: Option<Spread>,
        lookups: u32,
    ) -> Work {
        let coherent = stream.is_coherent();
        let count = (task.rays / RAYS_PER_LOOKUP).min(lookups).max(LEAST_LOOKUPS).min(task.rays);
        let start = u64::from(random::below(task.rays, stream.seed, task.first, LOOKUP_DIMENSION));
        let place = |i: u32| task.first + ((u64::from(i) * u64::from(task.rays) + start) / u64::from(count)) as u32;
        let (mut sum, mut squares) = ([0.0_f32; 2], 0.0);
        let mut add = |says: [f32; 2]| {
            sum = plus(sum, says);
            squares += f64::from(says[0] + says[1]) * f64::from(says[0] + says[1]);
        };
        for i in 0..count {
            add(self.predict(&Heading::of(&source.ray(place(i)).0, coherent)));
        }
        // What the map says of the samples is what they are without their residuals.
        for (counts, residual) in sample.iter().zip(residuals) {
            add([counts.boxes as f32 - residual[0], counts.triangles as f32 - residual[1]]);
        }
        let looked_up = (f64::from(count) + sample.len() as f64).max(1.0);
        let mean = f64::from(sum[0] + sum[1]) / looked_up;
        let map_variance = (squares / looked_up - mean * mean).max(0.0);
        let n = residuals.len() as f64;
        let believed = spread.map_or(0.0, |s| s.between * n / (s.between * n + s.within).max(f64::MIN_POSITIVE));
        let own = |part: usize| {
            let residual: f32 = residuals.iter().map(|r| r[part]).sum();
            let per_ray = f64::from(sum[part]) / looked_up + believed * f64::from(residual) / n.max(1.0);
            (per_ray * f64::from(task.rays)) as f32
        };
        let work = Work::new(task.rays as f32, own(0), own(1));
        let Some(Spread { within, between }) = spread else { return work };
        // Variance of the task's own mean around what is believed, and of the map's mean over the rays not looked up.
        let own_variance = if n > 0.0 { believed * within / n } else { between };
        let population = f64::from(task.rays);
        let unwalked = 1.0 - n / population;
        let looked = map_variance / looked_up * (1.0 - looked_up / population).max(0.0);
        work.with_std_error((population * ((own_variance + looked) * unwalked).sqrt()) as f32)
    }

    fn predict(&self, heading: &Heading) -> [f32; 2] {
        let mut says = self.mean;
        if let Some(cells) = &self.cells {
            cells.visit(&cells.place(heading), |cell| says = plus(says, cell.mean()));
        }
        says.map(|tests| tests.max(0.0))
    }

    /// Adds the samples to the map, level by level: each learns what those above it leave unexplained.
    fn learn(&mut self, batch: &Batch<'_>, source: &RaySource) -> Learned {
        let coherent = batch.stream.is_coherent();
        let headings: Vec<Heading> =
            batch.seen.rays.iter().map(|&ray| Heading::of(&source.ray(ray).0, coherent)).collect();
        match &mut self.cells {
            Some(cells) => cells.fade(),
            cells => *cells = Some(Cells::around(&headings)),
        }
        self.average(batch.seen.counts);
        let [boxes, triangles] = self.mean;
        let residual = |c: &TestCounts| [c.boxes as f32 - boxes, c.triangles as f32 - triangles];
        let mut residuals: Vec<[f32; 2]> = batch.seen.counts.iter().map(residual).collect();
        let judges = Judges::of(batch);
        let mut unseen: Vec<f32> = judges.all().map(|(judge, _)| residuals[judge][0] + residuals[judge][1]).collect();
        let Some(cells) = &mut self.cells else { return Learned { residuals, judges, unseen } };
        let places: Vec<Place> = headings.iter().map(|heading| cells.place(heading)).collect();
        let mut slots = vec![NO_SLOT; places.len()];
        for level in 0..Cells::LEVELS {
            for ((slot, place), residual) in slots.iter_mut().zip(&places).zip(&residuals) {
                *slot = cells.add(level, place, *residual);
            }
            for ((judge, own), unseen) in judges.all().zip(&mut unseen) {
                let Some(cell) = cells.cell(level, slots[judge]) else { continue };
                let same = |&(slot, _): &(&u32, &[f32; 2])| *slot == slots[judge];
                let same = slots[own.clone()].iter().zip(&residuals[own]).filter(same);
                let says = cell.mean_without(same.fold((0.0, [0.0; 2]), |(n, s), (_, r)| (n + 1.0, plus(s, *r))));
                *unseen -= says[0] + says[1];
            }
            for (residual, slot) in residuals.iter_mut().zip(&slots) {
                let says = cells.cell(level, *slot).map_or([0.0; 2], Cell::mean);
                *residual = [residual[0] - says[0], residual[1] - says[1]];
            }
        }
        Learned { residuals, judges, unseen }
    }

    /// Brings the mean of all rays up to date. Older streams count less, as in the cells.
    fn average(&mut self, counts: &[TestCounts]) {
        let sum = |of: fn(&TestCounts) -> u32| counts.iter().map(|c| f64::from(of(c))).sum::<f64>() as f32;
        self.weight *= super::cells::KEPT;
        let total = self.weight + counts.len() as f32;
        for (mean, sum) in self.mean.iter_mut().zip([sum(|c| c.boxes), sum(|c| c.triangles)]) {
            *mean = (*mean * self.weight + sum) / total.max(1.0);
        }
        self.weight = total;
    }
}

fn plus(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

/// The samples by which the map is judged: the first of some tasks, evenly spread over the stream.
#[derive(Clone, Debug)]
struct Judges {
    /// For each judging task its samples.
    tasks: Vec<Range<usize>>,
}

/// Samples of a task that judge the map, and of all tasks together: enough for variances, and few, since each is
/// compared with all samples of its task on every level.
const JUDGES: usize = 16;
const ALL_JUDGES: usize = 4096;

impl Judges {
    fn of(batch: &Batch<'_>) -> Self {
        let mut at = 0;
        let samples = batch.tasks().map(|(_, _, sample)| {
            at += sample.len();
            at - sample.len()..at
        });
        let samples: Vec<Range<usize>> = samples.filter(|own| !own.is_empty()).collect();
        let able: usize = samples.iter().map(|own| own.len().min(JUDGES)).sum();
        Self { tasks: samples.into_iter().step_by(able.div_ceil(ALL_JUDGES).max(1)).collect() }
    }

    /// How many of each task judge.
    fn counts(&self) -> impl Iterator<Item = usize> {
        self.tasks.iter().map(|own| own.len().min(JUDGES))
    }

    /// Each judge, and all samples of its task.
    fn all(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        self.tasks.iter().flat_map(|own| own.clone().take(JUDGES).map(move |judge| (judge, own.clone())))
    }
}

/// Keeps the rays looked up apart from those sampled.
const LOOKUP_DIMENSION: u32 = 0x10_0c09;

impl Spread {
    /// From residuals of rays that the map had not seen; `None` below two dozen samples, and where tasks have one each:
    /// these cannot tell how far rays and how far tasks are off.
    fn of(learned: &Learned) -> Option<Self> {
        const LEAST: usize = 24;
        if learned.unseen.len() < LEAST {
            return None;
        }
        let (mut inside, mut freedom) = (0.0, 0.0);
        let (mut means, mut shares, mut tasks) = (0.0, 0.0, 0.0);
        let mut rest = &learned.unseen[..];
        for n in learned.judges.counts() {
            let (own, others) = rest.split_at(n);
            rest = others;
            let n = n as f64;
            let mean = own.iter().copied().map(f64::from).sum::<f64>() / n;
            inside += own.iter().map(|&e| (f64::from(e) - mean) * (f64::from(e) - mean)).sum::<f64>();
            freedom += n - 1.0;
            (means, shares, tasks) = (means + mean * mean, shares + 1.0 / n, tasks + 1.0);
        }
        if freedom < LEAST as f64 / 2.0 {
            return None;
        }
        let within = inside / freedom;
        Some(Self { within, between: (means / tasks - within * shares / tasks).max(0.0) })
    }
}
