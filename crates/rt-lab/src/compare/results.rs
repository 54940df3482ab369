//! What compare.json holds.

use super::Options;
use super::measure::{Picture, Round, Site};
use super::verdict::{Contestant, Loner, Verdict};
use super::ways::Way;
use rt_balance::stats::{Summary, median, noise};
use rt_report::Provenance;
use rt_report::report::SceneReport;
use serde::Serialize;

/// The version of the layout; it changes when a field changes its meaning or goes away.
const SCHEMA: u32 = 1;

/// Everything that was measured, and how. Described in docs/report.md.
#[derive(Debug, Serialize)]
pub(super) struct Results {
    schema: u32,
    kind: &'static str,
    pub(super) provenance: Provenance,
    pub(super) scene: SceneReport,
    #[serde(skip)]
    pub(super) name: String,
    pub(super) size: [u32; 2],
    pub(super) samples: u32,
    pub(super) bounces: u32,
    pub(super) devices: Vec<Named>,
    /// Seeds of the rounds.
    pub(super) seeds: Vec<u32>,
    /// Seconds of loading and building, and of bringing the scene to the devices; once for all that is compared.
    pub(super) prepare_s: f64,
    pub(super) setup_s: f64,
    /// By how much medians must differ, as a share, to be told apart.
    pub(super) noise: Option<f64>,
    /// The default first.
    pub(super) ways: Vec<WayResult>,
    pub(super) alone: Vec<AloneResult>,
    pub(super) verdict: Verdict,
}

/// A device.
#[derive(Debug, Serialize)]
pub(super) struct Named {
    entry: String,
    name: String,
}

/// One way.
#[derive(Debug, Serialize)]
pub(super) struct WayResult {
    pub(super) queue: &'static str,
    pub(super) policy: &'static str,
    pub(super) estimator: String,
    /// Whether it has seen the rounds before, as in later frames.
    pub(super) later_frames: bool,
    #[serde(skip)]
    pub(super) label: String,
    #[serde(skip)]
    pub(super) estimate: String,
    /// The options with which `render` takes it; empty for the default.
    #[serde(skip)]
    pub(super) options: String,
    /// Seconds of tracing, estimation included.
    pub(super) trace: Summary,
    /// Wall seconds of the picture: rays made, traced and shaded.
    pub(super) picture: Summary,
    /// `trace` over that of the default in the same round.
    pub(super) of_default: Summary,
    /// Medians over the rounds; shares.
    pub(super) overhead: f64,
    pub(super) imbalance: Option<f64>,
    pub(super) excess: Option<f64>,
    /// Whether anything was known of the tasks of a stream.
    pub(super) estimated: bool,
    pub(super) trace_s: Vec<f64>,
    pub(super) picture_s: Vec<f64>,
    pub(super) streams: Vec<StreamResult>,
}

/// A stream of one way.
#[derive(Debug, Serialize)]
pub(super) struct StreamResult {
    pub(super) kind: String,
    /// Of the last round: which rays there are depends on the seed.
    pub(super) rays: u32,
    pub(super) tasks: u32,
    pub(super) makespan: Summary,
    pub(super) makespan_s: Vec<f64>,
    pub(super) estimate_s: Vec<f64>,
}

/// A device alone, by raybalance's default.
#[derive(Debug, Serialize)]
pub(super) struct AloneResult {
    pub(super) entry: String,
    pub(super) name: String,
    pub(super) trace: Summary,
    pub(super) picture: Summary,
    pub(super) trace_s: Vec<f64>,
    pub(super) picture_s: Vec<f64>,
}

impl Results {
    pub(super) fn new(options: &Options, site: &Site<'_>, ways: &[Way], rounds: &[Round]) -> Self {
        let default: Vec<f64> = rounds.iter().map(|round| round.ways[0].trace_s()).collect();
        let ways: Vec<WayResult> =
            ways.iter().enumerate().map(|(index, way)| WayResult::new(way, index, rounds, &default)).collect();
        let alone: Vec<AloneResult> = (0..site.alone.len())
            .map(|index| {
                let of =
                    |value: &dyn Fn(&Picture) -> f64| rounds.iter().map(|round| value(&round.alone[index])).collect();
                let (trace_s, picture_s): (Vec<f64>, Vec<f64>) = (of(&Picture::trace_s), of(&|picture| picture.wall_s));
                let (trace, picture) = (Summary::new(&trace_s), Summary::new(&picture_s));
                let (entry, name) = (site.alone[index].entry.clone(), site.alone[index].name.clone());
                AloneResult { entry, name, trace, picture, trace_s, picture_s }
            })
            .collect();
        let rows: Vec<&[f64]> = ways.iter().map(|way| &way.trace_s[..]).collect();
        let noise = noise(&rows);
        let contestants: Vec<Contestant<'_>> = ways.iter().map(WayResult::contestant).collect();
        let loners: Vec<Loner<'_>> = alone
            .iter()
            .zip(&site.alone)
            .map(|(result, alone)| Loner {
                entry: &result.entry,
                count: alone.count,
                trace_s: &result.trace_s,
                picture_s: &result.picture_s,
            })
            .collect();
        let once = site.prepare_s + site.setup_s;
        let verdict = Verdict::new(&contestants, noise, &loners, once);
        Self {
            schema: SCHEMA,
            kind: "compare",
            provenance: Provenance::now(options.seed, site.devices.iter().map(|(_, name)| name)),
            scene: site.scene.clone(),
            name: site.name.clone(),
            size: options.size(),
            samples: options.samples(),
            bounces: options.bounces,
            devices: site
                .devices
                .iter()
                .map(|(entry, name)| Named { entry: entry.clone(), name: name.clone() })
                .collect(),
            seeds: rounds.iter().map(|round| round.seed).collect(),
            prepare_s: site.prepare_s,
            setup_s: site.setup_s,
            noise,
            ways,
            alone,
            verdict,
        }
    }

    /// The ways, the fastest first.
    pub(super) fn ranked(&self) -> Vec<&WayResult> {
        let mut ranked: Vec<&WayResult> = self.ways.iter().collect();
        ranked.sort_by(|a, b| a.trace.median.total_cmp(&b.trace.median));
        ranked
    }

    /// The devices as the command line names them.
    pub(super) fn entries(&self) -> String {
        self.devices.iter().map(|device| device.entry.as_str()).collect::<Vec<_>>().join(",")
    }
}

impl WayResult {
    fn new(way: &Way, index: usize, rounds: &[Round], default: &[f64]) -> Self {
        let pictures: Vec<&Picture> = rounds.iter().map(|round| &round.ways[index]).collect();
        let of = |value: &dyn Fn(&Picture) -> f64| pictures.iter().map(|picture| value(picture)).collect::<Vec<f64>>();
        let (trace_s, picture_s) = (of(&Picture::trace_s), of(&|picture| picture.wall_s));
        let known = |values: Vec<Option<f64>>| values.into_iter().collect::<Option<Vec<f64>>>().map(|v| median(&v));
        let excess = |(round, picture): (&Round, &&Picture)| Some(picture.trace_s() / round.lower_bound_s? - 1.0);
        Self {
            queue: way.queue.name,
            policy: way.policy.name,
            estimator: way.estimator.label().to_owned(),
            later_frames: way.later,
            label: way.label(),
            estimate: way.estimate(),
            options: way.options(),
            trace: Summary::new(&trace_s),
            picture: Summary::new(&picture_s),
            of_default: Summary::of_ratios(&trace_s, default),
            overhead: median(&of(&|picture| picture.estimate_s() / (picture.trace_s() - picture.estimate_s()))),
            imbalance: known(pictures.iter().map(|picture| picture.imbalance()).collect()),
            excess: known(rounds.iter().zip(&pictures).map(excess).collect()),
            estimated: 2 * pictures.iter().filter(|picture| picture.is_estimated()).count() > pictures.len(),
            streams: StreamResult::all(&pictures),
            trace_s,
            picture_s,
        }
    }

    fn contestant(&self) -> Contestant<'_> {
        Contestant {
            label: &self.label,
            options: [self.queue, self.policy, &self.estimator],
            trace_s: &self.trace_s,
            picture_s: &self.picture_s,
            later: self.later_frames,
            estimated: self.estimated,
            overhead: self.overhead,
            imbalance: self.imbalance,
        }
    }
}

impl StreamResult {
    /// Every round has the same kinds of streams, but for those without a ray.
    fn all(pictures: &[&Picture]) -> Vec<Self> {
        let Some(last) = pictures.last() else { return Vec::new() };
        let of = |kind: &str| {
            let of_kind = |picture: &&Picture| picture.streams.iter().find(|stream| stream.kind == kind).cloned();
            pictures.iter().filter_map(of_kind).collect::<Vec<_>>()
        };
        let result = |kind: &String| {
            let streams = of(kind);
            let makespan_s: Vec<f64> = streams.iter().map(|stream| stream.makespan_s).collect();
            Self {
                kind: kind.clone(),
                rays: streams.last().map_or(0, |stream| stream.rays),
                tasks: streams.last().map_or(0, |stream| stream.tasks),
                makespan: Summary::new(&makespan_s),
                makespan_s,
                estimate_s: streams.iter().map(|stream| stream.estimate.seconds).collect(),
            }
        };
        last.streams.iter().map(|stream| result(&stream.kind)).collect()
    }
}
