//! `raybalance tradeoff precision`: what robust hits cost, and what fast ones get wrong.

mod write;

use super::streams::{Kind, STREAMS, reference, streams};
use crate::args::{PrecisionTradeoffArgs, SceneArgs};
use crate::chart::precision::{self as chart, Front, Point};
use crate::html::Page;
use crate::scene_source::{Prepared, prepare};
use crate::table::seconds;
use crate::{devices, interrupt, output, progress};
use anyhow::{Context, Result, bail};
use rt_balance::stats::Summary;
use rt_core::{Device, Hit, Launch, Precision, Ray, RaySource, Scene, StreamSpec, Task, Tracer, tasks_of};
use rt_verify::accuracy::{self, Accuracy, Sampled};
use rt_verify::clock;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What is compared, in the order of the report.
const PRECISIONS: [Precision; 3] = [Precision::Fast, Precision::Robust, Precision::Double];

/// Rays of one task, as the balancer cuts them by default.
const TASK: u32 = rt_balance::DEFAULT_TASK_SIZE;

/// The longest a launch may take; a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(600);

/// Version of the report's layout.
const SCHEMA: u32 = 1;

/// What is written to `precision.json`; `docs/verify.md` describes it.
#[derive(Debug, Serialize)]
struct Report {
    schema: u32,
    version: &'static str,
    command: Vec<String>,
    seed: u32,
    runs: u32,
    size: [u32; 2],
    builder: String,
    rows: Vec<Row>,
}

/// One precision on one stream of one scene on one device.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scene: String,
    triangles: usize,
    device: String,
    backend: &'static str,
    rays: &'static str,
    precision: &'static str,
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

/// Measures and adds a section to the page; within `budget`, of which every stream gets the same share.
pub(super) fn run(args: &PrecisionTradeoffArgs, budget: Option<Duration>, page: &mut Page) -> Result<()> {
    let begin = Instant::now();
    let names = if args.scenes.is_empty() { vec!["yard".to_owned(), "car".to_owned()] } else { args.scenes.clone() };
    let devices = devices::open(Some(&args.backend))?;
    let (size, runs, sample) = args.effort();
    let bar = progress::bar("measuring", names.len() as u64);
    let mut rows = Vec::new();
    for name in &names {
        let source = SceneArgs { drop_invalid: false, builder: args.builder, precision: None };
        let share = budget.map(|budget| budget.div_f64((names.len() * devices.len() * STREAMS) as f64));
        let bench = Bench { prepared: prepare(name, &source)?, size, runs, sample, seed: args.seed, share };
        bench.measure(&devices, &mut rows)?;
        bar.inc(1);
    }
    bar.finish_and_clear();

    let report = Report {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        command: std::env::args().skip(1).collect(),
        seed: args.seed,
        runs,
        size,
        builder: args.builder.to_string(),
        rows,
    };
    let json = args.out.join("precision.json");
    output::write_atomically(&json, |file| Ok(serde_json::to_writer_pretty(file, &report)?))?;
    output::write_atomically(&args.out.join("precision.csv"), |file| write::csv(file, &report.rows))?;
    output::write_atomically(&args.out.join("precision.md"), |file| write::markdown(file, &report.rows))?;
    let svg = chart::to_svg(&fronts(&report))?;
    output::write_atomically(&args.out.join("precision.svg"), |file| Ok(file.write_all(svg.as_bytes())?))?;
    page.section("Speed against wrong answers");
    page.chart(
        &svg,
        "Wrong answers per million rays against million rays per second, for three precisions and every kind of rays",
        "Wrong: misses, hits and triangles that are not those of double precision. Bars are 95% intervals.",
    );
    for (title, table) in write::tables(&report.rows) {
        page.table(&title, &table);
        println!("\n{title}\n\n{table}");
    }
    let most = report.rows.iter().map(|row| row.seconds.len()).max().unwrap_or(0);
    println!(
        "  medians of up to {most} runs, all precisions in turn; {} in all",
        seconds(begin.elapsed().as_secs_f64())
    );
    Ok(())
}

/// One scene and how it is measured.
struct Bench {
    prepared: Prepared,
    size: [u32; 2],
    runs: u32,
    /// Rays of each stream that the exact reference judges.
    sample: u32,
    seed: u32,
    /// Time for each stream on each device, after which no further round is begun; one is always measured.
    share: Option<Duration>,
}

impl Bench {
    fn measure(&self, devices: &[Arc<dyn Device>], rows: &mut Vec<Row>) -> Result<()> {
        let model = &self.prepared.model;
        let triangles: Vec<_> = (0..model.indices.len() as u32).filter_map(|i| model.triangle(i)).collect();
        let scene = Arc::new(self.prepared.built.scene.clone());
        for kind in streams(&self.prepared, &triangles, self.size, self.seed)? {
            let right = reference(&scene, &kind.source, kind.query);
            for device in devices {
                let timed = self.time(device.as_ref(), &scene, &kind)?;
                for (precision, timed) in PRECISIONS.into_iter().zip(&timed) {
                    let accuracy = Accuracy::of(
                        |i| kind.source.ray(i as u32).0,
                        kind.query,
                        &timed.hits,
                        &right,
                        |primitive| model.triangle(primitive),
                    );
                    rows.push(self.row(device.as_ref(), &kind, precision, timed, accuracy, &triangles)?);
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

    /// Traces the stream with each precision in turn, as often as there are runs; the first round is not counted.
    fn time(&self, device: &dyn Device, scene: &Arc<Scene>, kind: &Kind) -> Result<[Timed; 3]> {
        let fails = || format!("{} on {}", kind.name, device.info().name);
        let mut tracer = device.tracer(Arc::clone(scene), clock).with_context(fails)?;
        let tasks = tasks_of(kind.source.len(), TASK);
        let mut timed = [(); 3].map(|()| Timed::default());
        let begin = Instant::now();
        for round in 0..=self.runs as usize {
            if round > 1 && self.share.is_some_and(|share| begin.elapsed() > share) {
                break;
            }
            for turn in 0..PRECISIONS.len() {
                if interrupt::requested() {
                    bail!("interrupted");
                }
                // Rotated, and every other round backwards: each precision follows each other one equally often.
                let place = if round % 2 == 0 { turn } else { PRECISIONS.len() - 1 - turn };
                let which = (round / 2 + place) % PRECISIONS.len();
                let spec = StreamSpec { query: kind.query, precision: PRECISIONS[which], counts: false };
                let launch = launch(tracer.as_mut(), &kind.source, spec, &tasks).with_context(fails)?;
                if round > 0 {
                    timed[which].seconds.push(launch.span.duration().as_secs_f64());
                }
                timed[which].hits = launch.hits;
            }
        }
        Ok(timed)
    }

    fn row(
        &self,
        device: &dyn Device,
        kind: &Kind,
        precision: Precision,
        timed: &Timed,
        accuracy: Accuracy,
        triangles: &[rt_core::Triangle],
    ) -> Result<Row> {
        let speeds: Vec<f64> = timed.seconds.iter().map(|s| f64::from(kind.source.len()) / s / 1e6).collect();
        let (rays, hits) = self.sampled(&kind.source, &timed.hits);
        Ok(Row {
            scene: self.prepared.model.source.clone(),
            triangles: triangles.len(),
            device: device.info().name.clone(),
            backend: device.info().backend,
            rays: kind.name,
            precision: precision.name(),
            mray_s: Summary::new(&speeds),
            // Known when all three are.
            time_over_fast: Summary::new(&[]),
            accuracy,
            exact: accuracy::sample(triangles, &rays, &hits, kind.query),
            seconds: timed.seconds.clone(),
        })
    }

    /// Evenly spread rays and their hits.
    fn sampled(&self, source: &RaySource, hits: &[Hit]) -> (Vec<(Ray, u32)>, Vec<Hit>) {
        let count = self.sample.min(source.len());
        let index = |k: u32| (u64::from(k) * u64::from(source.len()) / u64::from(count.max(1))) as u32;
        (0..count).map(index).map(|i| (source.ray(i), hits[i as usize])).unzip()
    }
}

/// The runs of one precision.
#[derive(Debug, Default)]
struct Timed {
    seconds: Vec<f64>,
    hits: Vec<Hit>,
}

fn launch(tracer: &mut dyn Tracer, source: &RaySource, spec: StreamSpec, tasks: &[Task]) -> Result<Launch> {
    tracer.load_rays(source.clone(), spec)?;
    let ticket = tracer.submit(tasks, None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok(launch)
}

/// A panel for each scene and device.
fn fronts(report: &Report) -> Vec<Front> {
    let mut fronts: Vec<Front> = Vec::new();
    for row in &report.rows {
        let title = format!("{}, {}", row.scene, row.device);
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
