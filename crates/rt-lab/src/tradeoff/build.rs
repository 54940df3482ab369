//! `raybalance tradeoff build`: build time against rays per second, for every builder.

use super::Options;
use super::{Setting, file_part};
use crate::Lab;
use crate::contenders::uninformed;
use crate::intervals::with_interval;
use crate::subject::{Subject, trace};
use crate::time_budget::TimeBudget;
use anyhow::{Context, Result};
use rt_balance::stats::Summary;
use rt_balance::{Balancer, QueueKind, Scheduling, Stream};
use rt_bvh::{BuildOptions, Builder, Mesh, TreeStats};
use rt_core::Hit;
use rt_report::chart::front::{self, Chart, Panel, Series};
use rt_report::html::Page;
use rt_report::table::{Table, quoted, seconds};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

/// One builder on one scene.
#[derive(Debug, Serialize)]
struct Row {
    scene: String,
    triangles: usize,
    builder: &'static str,
    /// Wall seconds on all cores, one for each round.
    build_s: Vec<f64>,
    /// Million rays per second on the device, for primary and diffuse rays.
    mrays: [Vec<f64>; 2],
    build: Summary,
    primary: Summary,
    diffuse: Summary,
    /// Expected cost of a ray by the surface area heuristic; no unit.
    sah_cost: f32,
    bytes: u64,
}

/// Builders, and two streams for each.
pub(super) fn passes(args: &Options) -> f64 {
    2.0 * builders(args.quick).len() as f64
}

/// The slowest takes as long as all others together.
fn builders(quick: bool) -> &'static [Builder] {
    &Builder::ALL[..Builder::ALL.len() - usize::from(quick)]
}

pub(super) fn run(setting: &Setting<'_>, page: &mut Page) -> Result<()> {
    let mut rows = Vec::new();
    page.section("Build time against rays per second");
    let scenes = &setting.args.scenes;
    for (index, scene) in scenes.iter().enumerate() {
        let measured = measure(setting, scene, &setting.time.equal_part(scenes.len(), index))?;
        let chart = chart(&measured);
        let Some(name) = measured.first().map(|row| row.scene.clone()) else { continue };
        let svg = front::to_svg(&chart)?;
        setting.write_svg(&format!("build-{}.svg", file_part(&name)), &svg)?;
        page.chart(
            &svg,
            "Build time against million rays per second, one point for each builder",
            "Upper left is best. The same rays through every tree; medians of interleaved rounds.",
        );
        rows.extend(measured);
    }
    let table = table(&rows);
    page.table("Builders: medians, intervals in brackets", &table);
    setting.write_markdown("build.md", &table.to_markdown())?;
    setting.write("build.csv", &csv(setting, &rows))?;
    setting.write_json("build.json", &rows)?;
    Ok(setting.time.print(&format!("\nbuild time against rays per second\n\n{table}"))?)
}

fn measure(setting: &Setting<'_>, scene: &Path, time: &TimeBudget<'_>) -> Result<Vec<Row>> {
    let mut subject = Subject::open(setting.lab, scene, setting.devices)?;
    let streams = subject.streams(setting.size, setting.args.seed)?;
    let model = subject.model();
    let mesh = Mesh { positions: &model.positions, indices: &model.indices };
    let mut rows: Vec<Row> = Vec::new();
    let mut balancers: Vec<Balancer> = Vec::new();
    let mut hits: Vec<Hit> = Vec::new();
    let builders = builders(setting.args.quick);
    let time = time.clone().with_steps(builders.len(), setting.repeat + 1);
    for round in time.rounds(setting.repeat) {
        for (index, &builder) in builders.iter().enumerate() {
            let begin = Instant::now();
            let options = BuildOptions { builder, ..subject.options().build() };
            let failed = || format!("building {} by {builder}", scene.display());
            let built = rt_bvh::build(mesh, &options).with_context(failed)?;
            let build_s = begin.elapsed().as_secs_f64();
            if round == 0 {
                rows.push(Row {
                    scene: subject.name().to_owned(),
                    triangles: model.indices.len(),
                    builder: builder.name(),
                    build_s: Vec::new(),
                    mrays: [Vec::new(), Vec::new()],
                    build: Summary::new(&[]),
                    primary: Summary::new(&[]),
                    diffuse: Summary::new(&[]),
                    sah_cost: TreeStats::of(&built.scene).sah_cost,
                    bytes: built.scene.bytes(),
                });
                balancers.push(Balancer::new(built.scene, setting.devices)?);
            }
            for (stream, mrays) in streams.iter().zip(&mut rows[index].mrays) {
                let speed = speed(setting.lab, &mut balancers[index], stream, &mut hits)?;
                if round > 0 {
                    mrays.push(speed);
                }
            }
            if round > 0 {
                rows[index].build_s.push(build_s);
            }
            time.step();
        }
    }
    for row in &mut rows {
        row.build = Summary::new(&row.build_s);
        [row.primary, row.diffuse] = row.mrays.each_ref().map(|mrays| Summary::new(mrays));
    }
    Ok(rows)
}

/// Million rays per second of a plain trace.
fn speed(lab: Lab<'_>, balancer: &mut Balancer, stream: &Stream, hits: &mut Vec<Hit>) -> Result<f64> {
    if stream.source.is_empty() {
        return Ok(f64::NAN);
    }
    let mut plain = Scheduling { estimator: uninformed(), queue: Box::new(QueueKind::Static), ..Scheduling::default() };
    let run = trace(lab, balancer, stream, &mut plain, hits)?;
    Ok(f64::from(run.report.rays) / run.report.makespan_s / 1e6)
}

fn chart(rows: &[Row]) -> Chart {
    let panel = |title: &str, of: fn(&Row) -> Summary| Panel {
        title: title.to_owned(),
        axes: ["build, ms".to_owned(), "Mray/s".to_owned()],
        series: rows
            .iter()
            .map(|row| Series {
                name: row.builder.to_owned(),
                points: vec![[row.build.median * 1e3, of(row).median]],
                intervals: vec![[of(row).low, of(row).high]],
            })
            .collect(),
        reference: None,
        levels: Vec::new(),
        front: Some([false, true]),
    };
    let scene = rows.first().map_or("", |row| &row.scene);
    Chart {
        title: format!("{scene}: build time against speed"),
        panels: vec![panel("primary rays", |row| row.primary), panel("diffuse rays", |row| row.diffuse)],
        columns: 3,
    }
}

fn table(rows: &[Row]) -> Table {
    let mut table =
        Table::new(&["scene", "builder", "triangles", "build", "primary Mray/s", "diffuse Mray/s", "SAH cost", "MB"]);
    for row in rows {
        let speed = |summary: &Summary| with_interval(summary, |speed| format!("{speed:.2}"));
        table.row(vec![
            row.scene.clone(),
            row.builder.to_owned(),
            rt_report::table::grouped(row.triangles as u64),
            with_interval(&row.build, seconds),
            speed(&row.primary),
            speed(&row.diffuse),
            format!("{:.1}", row.sah_cost),
            format!("{:.1}", row.bytes as f64 / 1e6),
        ]);
    }
    table
}

fn csv(setting: &Setting<'_>, rows: &[Row]) -> String {
    let mut text = setting.csv_head() + "scene,builder,round,build_s,primary_mray_s,diffuse_mray_s\n";
    for row in rows {
        for (round, build) in row.build_s.iter().enumerate() {
            let [primary, diffuse] = row.mrays.each_ref().map(|mrays| mrays.get(round).copied().unwrap_or(f64::NAN));
            let (scene, round) = (quoted(&row.scene), round + 1);
            let _ = writeln!(text, "{scene},{},{round},{build:e},{primary:e},{diffuse:e}", row.builder);
        }
    }
    text
}
