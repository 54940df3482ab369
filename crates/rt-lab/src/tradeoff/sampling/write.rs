//! Tables, fronts and raw numbers of the sweep.

use super::estimators::PAPERS;
use super::measure::{COUNTS, Cell, EXCESS_OF_3, METRICS, OVERHEAD, TIME};
use crate::tradeoff::{Setting, file_part};
use anyhow::Result;
use rt_balance::DEFAULT_TASK_SIZE;
use rt_report::chart::front::{self, Chart, Panel, Series};
use rt_report::html::Page;
use rt_report::table::{Table, grouped, quoted};
use std::fmt::Write as _;

/// What M. Rincón-Nigro and Z. Deng (2013) measured on three Tesla C1060 for coherent and diffuse rays, as shares.
/// 12.5% of the first row would be more than the second: each is as they measured it.
const PAPER_RATIO: [f64; 2] = [0.425, 0.435];
const PAPER_OVERHEAD: [f64; 2] = [0.032, 0.041];
const PAPER_ERROR: [f64; 2] = [0.032, 0.041];
const PAPER_FRACTION: f64 = 0.125;

pub(super) fn all(setting: &Setting<'_>, cells: &[Cell], missing: &[String], page: &mut Page) -> Result<()> {
    page.section("Samples against accuracy");
    let scenes = scenes(cells);
    for &scene in &scenes {
        let chart = chart(scene, cells);
        if chart.panels.is_empty() {
            continue;
        }
        let svg = front::to_svg(&chart)?;
        setting.write_svg(&format!("sampling-{}.svg", file_part(scene)), &svg)?;
        page.chart(
            &svg,
            "Estimation overhead against error and against the makespan's excess, one line for each estimator",
            &format!(
                "Tasks of {} rays, medians. Overhead is the estimation's share of a plain trace. Along a line the sampled \
                 fraction falls from right to left. The pale line is the front: what no other setting beats in both.",
                grouped(shown_size(cells).into())
            ),
        );
    }
    let paper = paper_table(&scenes, cells);
    let sweep = sweep_table(cells);
    page.table("The paper's numbers beside ours, in percent", &paper);
    page.paragraph(NOTES);
    let left_out = (!missing.is_empty()).then(|| {
        format!(
            "Left out, as {} has no kernel for their walks: {}.",
            setting.head.provenance.devices.join(", "),
            missing.join("; ")
        )
    });
    left_out.iter().for_each(|text| page.paragraph(text));
    page.folded_table("Every setting, medians in percent", &sweep);
    let markdown = format!(
        "## The paper's numbers beside ours, in percent\n\n{}\n{NOTES} {}\n\n## Every setting, medians in \
         percent\n\n{}",
        paper.to_markdown(),
        left_out.as_deref().unwrap_or_default(),
        sweep.to_markdown()
    );
    setting.write_markdown("sampling.md", &markdown)?;
    setting.write("sampling.csv", &csv(setting, cells))?;
    setting.write_json("sampling.json", &cells)?;
    setting.time.print(&format!("\nsamples against accuracy, in percent\n\n{paper}"))?;
    Ok(left_out.iter().try_for_each(|text| setting.time.print(&format!("  {text}")))?)
}

/// How to read the tables.
const NOTES: &str = "Overhead: seconds of estimating and planning over those of a plain trace of all rays right before it. \
    Net overhead: what the whole run took longer than that trace, so that kept hits count. Errors: per task, after one \
    scale that makes totals equal; against exact counts, and against each task's own time by prices fitted on the other half \
    of the tasks. Excess: makespan of a hybrid queue with its estimation over the lower bound, replayed on virtual devices \
    with task times to which nothing was fitted. The paper's overhead is not its ratio times its fraction: each as measured.";

fn scenes(cells: &[Cell]) -> Vec<&str> {
    let mut scenes: Vec<&str> = cells.iter().map(|cell| cell.scene.as_str()).collect();
    scenes.dedup();
    scenes
}

/// The task size that charts show: the default one, or the largest that was swept.
fn shown_size(cells: &[Cell]) -> u32 {
    let sizes = || cells.iter().map(|cell| cell.task_rays);
    if sizes().any(|size| size == DEFAULT_TASK_SIZE) { DEFAULT_TASK_SIZE } else { sizes().max().unwrap_or(0) }
}

/// A row of three panels for each kind of rays: error against counts, against time, and excess.
fn chart(scene: &str, cells: &[Cell]) -> Chart {
    let size = shown_size(cells);
    let shown: Vec<&Cell> =
        cells.iter().filter(|c| c.scene == scene && c.task_rays == size && c.sampler.is_some()).collect();
    let mut streams: Vec<&str> = shown.iter().map(|cell| cell.stream.as_str()).collect();
    streams.dedup();
    // Regular tasks have an excess and no overhead.
    let levels = |stream: &str| {
        let regular = cells.iter().filter(|c| c.scene == scene && c.task_rays == size && c.sampler.is_none());
        let own = regular.filter(|cell| cell.stream == stream);
        own.map(|cell| (100.0 * cell.median(EXCESS_OF_3), cell.estimator.clone())).collect()
    };
    let panel = |stream: &str, what: &str, axis: &str, metric: usize| {
        let own: Vec<&&Cell> = shown.iter().filter(|cell| cell.stream == stream).collect();
        let mut names: Vec<&str> = own.iter().map(|cell| cell.estimator.as_str()).collect();
        names.dedup();
        let point = |cell: &&&Cell| [100.0 * cell.median(OVERHEAD), 100.0 * cell.median(metric)];
        let series = |name: &&str| Series {
            name: (*name).to_owned(),
            points: own.iter().filter(|cell| cell.estimator == *name).map(point).collect(),
            // Of a hundred points they would hide the fronts.
            intervals: Vec::new(),
        };
        let kind = usize::from(!own.first().is_some_and(|cell| cell.is_primary()));
        let paper = || ([100.0 * PAPER_OVERHEAD[kind], 100.0 * PAPER_ERROR[kind]], "paper, 2013".to_owned());
        Panel {
            title: format!("{}: {what}", stream.split(' ').next().unwrap_or(stream)),
            axes: ["overhead, % of a plain trace".to_owned(), format!("{axis}, %")],
            series: names.iter().map(series).collect(),
            reference: (metric == COUNTS).then(paper),
            levels: if metric == EXCESS_OF_3 { levels(stream) } else { Vec::new() },
            front: Some([false, false]),
        }
    };
    let panels = streams.iter().flat_map(|stream| {
        [
            panel(stream, "error against counts", "mean error", COUNTS),
            panel(stream, "error against time", "mean error", TIME),
            panel(stream, "makespan on 3 devices", "excess over the lower bound", EXCESS_OF_3),
        ]
    });
    Chart { title: format!("{scene}: samples against accuracy"), panels: panels.collect(), columns: 3 }
}

/// A share in percent; a dash where there is none.
fn percent(share: f64) -> String {
    if share.is_finite() { format!("{:.2}", 100.0 * share) } else { "–".to_owned() }
}

/// What the paper reports, and the same of ours: its own estimator, then exact counts at our default fraction.
fn paper_table(scenes: &[&str], cells: &[Cell]) -> Table {
    let mut table = Table::new(&[
        "",
        "rays",
        "estimator",
        "all rays/full trace",
        "fraction",
        "overhead",
        "error",
        "vs time",
        "net overhead",
    ]);
    for (index, rays) in ["coherent", "diffuse"].into_iter().enumerate() {
        table.row(vec![
            "paper".to_owned(),
            rays.to_owned(),
            "reduced".to_owned(),
            percent(PAPER_RATIO[index]),
            percent(PAPER_FRACTION),
            percent(PAPER_OVERHEAD[index]),
            percent(PAPER_ERROR[index]),
            "–".to_owned(),
            "–".to_owned(),
        ]);
    }
    let size = shown_size(cells);
    for &scene in scenes {
        for primary in [true, false] {
            let find = |estimator: &str, fraction: f64| {
                cells.iter().find(|c| {
                    c.scene == scene
                        && c.task_rays == size
                        && c.is_primary() == primary
                        && c.estimator == estimator
                        && c.fraction == fraction
                })
            };
            for (estimator, fraction) in [(PAPERS, PAPER_FRACTION), ("exact", PAPER_FRACTION), ("exact", 1.0 / 64.0)] {
                let Some(cell) = find(estimator, fraction) else { continue };
                table.row(vec![
                    scene.to_owned(),
                    if primary { "coherent" } else { "diffuse" }.to_owned(),
                    estimator.to_owned(),
                    percent(find(estimator, 1.0).map_or(f64::NAN, |every| every.median(OVERHEAD))),
                    percent(fraction),
                    percent(cell.median(OVERHEAD)),
                    percent(cell.median(COUNTS)),
                    percent(cell.median(TIME)),
                    percent(cell.median(OVERHEAD + 1)),
                ]);
            }
        }
    }
    table
}

fn sweep_table(cells: &[Cell]) -> Table {
    let header = ["scene", "rays", "task", "estimator", "sampler", "fraction"];
    let mut table = Table::new(&[&header[..], &METRICS].concat());
    for cell in cells {
        let fraction = match cell.fraction {
            f if f == 0.0 || f == 1.0 => format!("{f:.0}"),
            f => format!("1/{:.0}", 1.0 / f),
        };
        let mut row = vec![
            cell.scene.clone(),
            cell.stream.clone(),
            grouped(cell.task_rays.into()),
            cell.estimator.clone(),
            cell.sampler.unwrap_or("none").to_owned(),
            fraction,
        ];
        row.extend((0..METRICS.len()).map(|metric| percent(cell.median(metric))));
        table.row(row);
    }
    table
}

/// Every setting in every round, one line each; metrics are shares, empty where there is none.
fn csv(setting: &Setting<'_>, cells: &[Cell]) -> String {
    let mut text = setting.csv_head();
    text.push_str("scene,stream,task_rays,tasks,estimator,sampler,fraction,round,seed,estimate_s,total_s,plain_s");
    for name in METRICS {
        let _ = write!(text, ",\"{name}\"");
    }
    text.push('\n');
    for cell in cells {
        for (round, (seed, seconds)) in cell.seeds.iter().zip(&cell.seconds).enumerate() {
            let Cell { stream, task_rays, tasks, estimator, fraction, .. } = cell;
            let (scene, sampler) = (quoted(&cell.scene), cell.sampler.unwrap_or(""));
            let _ = write!(
                text,
                "{scene},{stream},{task_rays},{tasks},\"{estimator}\",{sampler},{fraction},{},{seed}",
                round + 1
            );
            let metrics = cell.samples.iter().map(|metric| metric.values.get(round).copied().unwrap_or(f64::NAN));
            for value in seconds.iter().copied().chain(metrics) {
                let _ = if value.is_finite() { write!(text, ",{value:e}") } else { write!(text, ",") };
            }
            text.push('\n');
        }
    }
    text
}
