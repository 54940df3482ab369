//! `raybalance tradeoff precision`: what robust hits cost, and what fast ones get wrong.

mod write;

use super::streams::{Kind, STREAMS, launch, reference, streams};
use crate::intervals::worth;
use crate::time_budget::TimeBudget;
use crate::{DEFAULT_SCENES, Lab};
use anyhow::{Context, Result};
use rt_balance::clock;
use rt_balance::devices::Opened;
use rt_balance::stats::Summary;
use rt_core::{Device, Hit, Precision, Ray, RaySource, Scene, StreamSpec, Triangle};
use rt_report::Provenance;
use rt_report::chart::precision::{self as chart, Front, Point};
use rt_report::html::Page;
use rt_report::output;
use rt_scene::prepare::Prepared;
use rt_verify::accuracy::{self, Accuracy, Sampled};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// What is compared, in the order of the report.
const PRECISIONS: [Precision; 3] = [Precision::Fast, Precision::Robust, Precision::Double];

/// Rays on which the price of the exact reference is tried, one batch of it for each of a few cores.
const TRIED: u32 = 64;

/// What the precisions are on a graphics card.
const ONE_KERNEL: &str = "graphics cards have one kernel, that of robust. It answers fast and f64 as well, so the three differ \
    in time by chance alone; the precision asked for decides only how the host settles the rays that are left in doubt.";

/// Version of the report's layout.
const SCHEMA: u32 = 2;

/// What is written to `precision.json`; `docs/verify.md` describes it.
#[derive(Debug, Serialize)]
struct Report {
    schema: u32,
    provenance: Provenance,
    runs: u32,
    size: [u32; 2],
    builder: &'static str,
    rows: Vec<Row>,
}

/// One precision on one stream of one scene on one device.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scene: String,
    triangles: usize,
    device: String,
    /// As the command line names it.
    entry: String,
    backend: &'static str,
    rays: &'static str,
    precision: &'static str,
    /// The precision of the kernel that answered: of a device that lacks the one asked for, a stricter one.
    kernel: &'static str,
    /// Million rays per second.
    mray_s: Summary,
    /// Seconds over those of `fast`, run by run.
    time_over_fast: Summary,
    /// Compared with double precision, every ray.
    accuracy: Accuracy,
    /// Compared with the exact reference, some rays.
    exact: Sampled,
    /// Seconds of each run, in order.
    seconds: Vec<f64>,
}

/// Five kinds of rays, with each precision.
pub(super) fn passes(_: &super::Options) -> f64 {
    (STREAMS * PRECISIONS.len()) as f64
}

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Built-in scenes or OBJ files; none: [`DEFAULT_SCENES`].
    pub scenes: Vec<PathBuf>,
    /// Devices, one after the other, as [`Opener::open_in_turn`](rt_balance::devices::Opener::open_in_turn) reads them.
    pub devices: String,
    /// Fewer rays and repetitions: a look, not a measurement.
    pub quick: bool,
    /// Runs of each precision; `None`: as suits the extent.
    pub repeat: Option<u32>,
    /// Size of the picture whose rays are traced, in pixels; `None`: as suits the extent.
    pub size: Option<[u32; 2]>,
    /// Rays of each stream that the exact reference judges; `None`: as suits the extent.
    pub sample: Option<u32>,
    /// Seed of the rays.
    pub seed: u32,
    /// Folder of what is written.
    pub out: PathBuf,
}

impl Options {
    /// What suits the options of all trades together; `device` is measured unless another one is named.
    pub(super) fn of(all: &super::Options, device: &str) -> Self {
        Self {
            scenes: all.scenes.clone(),
            devices: all.devices.as_deref().unwrap_or(device).to_owned(),
            quick: all.quick,
            repeat: all.repeat,
            size: all.size,
            sample: None,
            seed: all.seed,
            out: all.out.clone(),
        }
    }

    /// Size of the picture, number of runs and of sampled rays.
    fn effort(&self) -> ([u32; 2], u32, u32) {
        let (size, runs, sample) = if self.quick { ([320, 200], 6, 200) } else { ([960, 600], 30, 2_000) };
        (self.size.unwrap_or(size), self.repeat.unwrap_or(runs), self.sample.unwrap_or(sample))
    }
}

/// Where the results come from.
pub(super) fn provenance(args: &Options, devices: &[Opened]) -> Provenance {
    let name = |opened: &Opened| format!("{}: {}", opened.entry, opened.device.info().name);
    Provenance::now(args.seed, devices.iter().map(name))
}

/// Measures and adds a section to the page.
pub(super) fn run(
    lab: Lab<'_>,
    args: &Options,
    devices: &[Opened],
    time: &TimeBudget<'_>,
    page: &mut Page,
) -> Result<()> {
    time.label("precision");
    let names = if args.scenes.is_empty() { DEFAULT_SCENES.map(PathBuf::from).to_vec() } else { args.scenes.clone() };
    let (size, runs, sample) = args.effort();
    let (mut rows, mut builder) = (Vec::new(), "");
    for (index, name) in names.iter().enumerate() {
        let time = time.equal_part(names.len(), index);
        let bench = Bench { lab, prepared: lab.prepare(name)?, size, runs, sample, seed: args.seed, time };
        bench.measure(devices, &mut rows)?;
        builder = bench.prepared.options.builder.name();
    }

    let report = Report { schema: SCHEMA, provenance: provenance(args, devices), runs, size, builder, rows };
    let json = args.out.join("precision.json");
    output::write_atomically(&json, |file| Ok(serde_json::to_writer_pretty(file, &report)?))?;
    output::write_atomically(&args.out.join("precision.csv"), |file| {
        file.write_all(report.provenance.csv().as_bytes())?;
        write::csv(file, &report.rows)
    })?;
    output::write_atomically(&args.out.join("precision.md"), |file| {
        writeln!(file, "{}", report.provenance)?;
        write::markdown(file, &report.rows)
    })?;
    let svg = chart::to_svg(&fronts(&report));
    output::write_atomically(&args.out.join("precision.svg"), |file| {
        file.write_all(report.provenance.in_svg(&svg).as_bytes())
    })?;
    page.section("Speed against wrong answers");
    page.chart(
        &svg,
        "Wrong answers per million rays against million rays per second, for three precisions and every kind of rays",
        "Wrong: misses, hits and triangles that are not those of double precision. Bars: intervals of the \
         medians, 95% bounds of wrong answers.",
    );
    let notes = notes(&report.rows, devices);
    notes.iter().for_each(|note| page.paragraph(note));
    for (title, table) in write::tables(&report.rows) {
        page.table(&title, &table);
        time.print(&format!("\n{title}\n\n{table}"))?;
    }
    Ok(notes.iter().try_for_each(|note| time.print(&format!("  {note}")))?)
}

/// What the tables do not say: how sure the intervals are, and what graphics cards make of a precision.
fn notes(rows: &[Row], devices: &[Opened]) -> Vec<String> {
    let least = rows.iter().map(|row| row.mray_s).min_by_key(|mray_s| mray_s.count);
    let runs = least.map(|least| {
        format!("Medians, all precisions in turn; runs of each: {} at least. {}", least.count, worth(&least))
    });
    let cards: Vec<&str> = devices.iter().filter(|named| named.card.is_some()).map(|named| &*named.entry).collect();
    let one_kernel = (!cards.is_empty()).then(|| format!("{}: {ONE_KERNEL}", cards.join(", ")));
    runs.into_iter().chain(one_kernel).collect()
}

/// One scene and how it is measured.
struct Bench<'a> {
    lab: Lab<'a>,
    prepared: Prepared,
    size: [u32; 2],
    runs: u32,
    /// Rays of each stream that the exact reference judges.
    sample: u32,
    seed: u32,
    time: TimeBudget<'a>,
}

impl Bench<'_> {
    fn measure(&self, devices: &[Opened], rows: &mut Vec<Row>) -> Result<()> {
        let model = &self.prepared.model;
        let triangles: Vec<_> = (0..model.indices.len() as u32).filter_map(|i| model.triangle(i)).collect();
        let scene = Arc::clone(&self.prepared.built.scene);
        let kinds = streams(&self.prepared, &triangles, self.size, self.seed)?;
        let cells = kinds.len() * devices.len();
        for (index, kind) in kinds.iter().enumerate() {
            let right = reference(&scene, &kind.source, kind.query);
            for (on, named) in devices.iter().enumerate() {
                let device = named.device.as_ref();
                let time = self.time.equal_part(cells, index * devices.len() + on);
                let sample = self.affordable(kind, &triangles, &time);
                let timed = self.time(device, &scene, kind, &time.part(&[2.0, 1.0], 0))?;
                for (precision, timed) in PRECISIONS.into_iter().zip(&timed) {
                    let accuracy = Accuracy::of(
                        |i| kind.source.ray(i as u32).0,
                        kind.query,
                        &timed.hits,
                        &right,
                        |primitive| model.triangle(primitive),
                    );
                    let judged = self.judged(kind, timed, sample, &triangles);
                    rows.push(self.row(named, kind, precision, (timed, accuracy, judged)));
                }
                let from = rows.len() - PRECISIONS.len();
                let base = rows[from].seconds.clone();
                for row in &mut rows[from..] {
                    row.time_over_fast = Summary::of_ratios(&row.seconds, &base);
                }
            }
        }
        Ok(())
    }

    /// How many rays the exact reference can judge in a third of the time.
    fn affordable(&self, kind: &Kind, triangles: &[Triangle], time: &TimeBudget<'_>) -> u32 {
        let Some(left) = time.left() else { return self.sample };
        let (rays, _) = sampled(&kind.source, &[], TRIED.min(self.sample));
        let begin = Instant::now();
        // Whatever the hits are, it takes as long.
        std::hint::black_box(accuracy::sample(triangles, &rays, &[], kind.query));
        let per_ray = begin.elapsed().as_secs_f64() / rays.len().max(1) as f64;
        let most = left.as_secs_f64() / 3.0 / PRECISIONS.len() as f64 / per_ray.max(1e-9);
        self.sample.min((most as u32).max(TRIED))
    }

    /// Traces the stream with each precision in turn, as often as there are runs; the first round is not counted.
    fn time(&self, device: &dyn Device, scene: &Arc<Scene>, kind: &Kind, time: &TimeBudget<'_>) -> Result<[Timed; 3]> {
        let fails = || format!("{} on {}", kind.name, device.info().name);
        let mut tracer = device.tracer(Arc::clone(scene), clock).with_context(fails)?;
        let mut timed = [(); 3].map(|()| Timed::default());
        let time = time.clone().with_steps(PRECISIONS.len(), self.runs + 1);
        for round in time.rounds(self.runs) {
            let round = round as usize;
            for turn in 0..PRECISIONS.len() {
                self.lab.go_on()?;
                // Rotated, and every other round backwards: each precision follows each other one equally often.
                let place = if round.is_multiple_of(2) { turn } else { PRECISIONS.len() - 1 - turn };
                let which = (round / 2 + place) % PRECISIONS.len();
                let spec = StreamSpec::new(kind.query, PRECISIONS[which], false);
                let launch = launch(tracer.as_mut(), &kind.source, spec).with_context(fails)?;
                if round > 0 {
                    timed[which].seconds.push(launch.span.duration().as_secs_f64());
                }
                timed[which].hits = launch.hits;
                time.step();
            }
        }
        Ok(timed)
    }

    fn row(
        &self,
        named: &Opened,
        kind: &Kind,
        precision: Precision,
        (timed, accuracy, exact): (&Timed, Accuracy, Sampled),
    ) -> Row {
        let speeds: Vec<f64> = timed.seconds.iter().map(|s| f64::from(kind.source.len()) / s / 1e6).collect();
        let info = named.device.info();
        Row {
            scene: self.prepared.model.source.clone(),
            triangles: self.prepared.model.indices.len(),
            device: info.name.clone(),
            entry: named.entry.clone(),
            backend: info.backend,
            rays: kind.name,
            precision: precision.name(),
            kernel: if named.card.is_some() { Precision::Robust.name() } else { precision.name() },
            mray_s: Summary::new(&speeds),
            // Known when all three are.
            time_over_fast: Summary::new(&[]),
            accuracy,
            exact,
            seconds: timed.seconds.clone(),
        }
    }

    /// What the exact reference says of evenly spread rays.
    fn judged(&self, kind: &Kind, timed: &Timed, sample: u32, triangles: &[Triangle]) -> Sampled {
        let (rays, hits) = sampled(&kind.source, &timed.hits, sample);
        accuracy::sample(triangles, &rays, &hits, kind.query)
    }
}

/// Evenly spread rays and their hits, as far as there are any.
fn sampled(source: &RaySource, hits: &[Hit], sample: u32) -> (Vec<(Ray, u32)>, Vec<Hit>) {
    let count = sample.min(source.len());
    let index = |k: u32| (u64::from(k) * u64::from(source.len()) / u64::from(count.max(1))) as u32;
    let hit = |i: u32| hits.get(i as usize).copied().unwrap_or(Hit::MISS);
    (0..count).map(index).map(|i| (source.ray(i), hit(i))).unzip()
}

/// The runs of one precision.
#[derive(Debug, Default)]
struct Timed {
    seconds: Vec<f64>,
    hits: Vec<Hit>,
}

/// A panel for each scene and device.
fn fronts(report: &Report) -> Vec<Front> {
    let mut fronts: Vec<Front> = Vec::new();
    for row in &report.rows {
        let title = format!("{}, {}: {}", row.scene, row.entry, row.device);
        if fronts.last().is_none_or(|front| front.title != title) {
            fronts.push(Front { title, points: Vec::new() });
        }
        if let Some(front) = fronts.last_mut() {
            front.points.push(Point {
                kind: row.rays,
                setting: row.precision,
                wrong_ppm: row.accuracy.wrong.ppm,
                wrong_bounds: row.accuracy.wrong.bounds_ppm,
                mray_s: row.mray_s.median,
                mray_s_bounds: [row.mray_s.low, row.mray_s.high],
            });
        }
    }
    fronts
}
