//! What `figure1` leaves behind: figure, raw times, tables.

use super::Results;
use super::measure::{
    BLOCKS, CENTRAL, CENTRAL_COST, CONFIGS, HYBRID, HYBRID_COST, LIFELINES, PERMUTED, Panel, ROUND_ROBIN, STATIC_COST,
    Series, Size,
};
use crate::Lab;
use crate::intervals::with_interval;
use anyhow::Result;
use rt_report::chart::figure1::{self, Bar, Figure, Group};
use rt_report::html::Page;
use rt_report::output::write_atomically;
use rt_report::table::{self, Table, grouped, quoted};
use std::fmt::Write as _;
use std::path::Path;

/// Every file.
pub(super) const FILES: [&str; 5] = ["figure1.svg", "figure1.png", "figure1.csv", "figure1.json", "report.html"];

pub(super) fn all(lab: Lab<'_>, out: &Path, results: &Results) -> Result<()> {
    let figure = figure(results);
    figure1::write(&out.join("figure1.svg"), &out.join("figure1.png"), &figure, &results.provenance)?;
    let csv = csv(results);
    write_atomically(&out.join("figure1.csv"), |file| file.write_all(csv.as_bytes()))?;
    write_atomically(&out.join("figure1.json"), |file| Ok(serde_json::to_writer_pretty(file, results)?))?;
    page(results, &figure)?.write(&out.join("report.html"))?;
    let mut text = format!("{}\n", figure.title);
    for note in &figure.notes {
        let _ = writeln!(text, "  {note}");
    }
    for panel in &results.panels {
        let _ = writeln!(text, "\n{}\n{}", panel.title(), panel.table());
    }
    let _ = write!(text, "  written to {}: figure1.svg, .png, .csv, .json and report.html", out.display());
    Ok(lab.show.print(&text)?)
}

/// The figure with everything a reader must know to trust it.
pub(super) fn figure(results: &Results) -> Figure {
    let kind = if results.mode == "replay" { "virtual devices (replay)" } else { "devices" };
    let title = format!("Tracing time against task size on {} {kind}", results.devices);
    let fraction = results.fraction.map_or_else(String::new, |f| format!(", 1 ray in {:.0} sampled", 1.0 / f));
    let mut notes = vec![if results.mode == "replay" {
        format!(
            "Replay: queues on a virtual clock, driven by task times measured on {} in a pass that nothing was fitted \
             to; not a run on {} devices.",
            results.provenance.devices.join(", "),
            results.devices
        )
    } else {
        format!("Real runs on {}.", results.provenance.devices.join(", "))
    }];
    let sure = match results.repetitions {
        1 => "One round, so no intervals".to_owned(),
        rounds => format!(
            "Medians of {rounds} interleaved rounds, whiskers: {:.0}% intervals between order statistics",
            100.0 * confidence(results)
        ),
    };
    notes.push(format!(
        "Estimator {}{fraction}, new in every run. {sure}. Seeds {}–{}.",
        results.estimator,
        seed(results) + 1,
        seed(results) + u64::from(results.repetitions),
    ));
    notes.push(results.provenance.machine.to_string());
    let panels = results
        .panels
        .iter()
        .map(|panel| figure1::Panel { title: panel.title(), groups: panel.sizes.iter().map(group).collect() });
    Figure { title, notes, panels: panels.collect() }
}

fn page(results: &Results, figure: &Figure) -> Result<Page> {
    let mut page = Page::new(&figure.title, &results.provenance, &seeds(results));
    page.section("Figure");
    page.chart(
        &figure1::to_svg(figure)?,
        "Bars: tracing time of static, central and hybrid queues, regular and cost-initialised, and of two rivals, for \
         every task size; one panel for each scene and kind of rays. The tables below hold the same numbers.",
        "After Figure 1 of M. Rincón-Nigro and Z. Deng (2013). Grey bars in the background: regular queues, which know no \
         costs. Coloured bars: the same queues initialised by estimated costs, the estimation stacked on the tracing. \
         Added are the hybrid queue and two rivals that know no costs: permuted regions (van Antwerpen, Seibert, \
         Keller 2019) and work stealing with lifelines (Saraswat and others 2011).",
    );
    page.section("How it was measured");
    for note in figure.notes.iter().chain(&results.note) {
        page.paragraph(note);
    }
    page.paragraph(
        "Every round runs all task sizes and queues in turn; a round that is not counted comes first. Ratios compare \
         within a round. All times: figure1.csv; with summaries: figure1.json.",
    );
    page.section("Numbers");
    for panel in &results.panels {
        page.table(
            &format!("{}: medians of the whole time; ratios with their intervals", panel.title()),
            &panel.table(),
        );
    }
    Ok(page)
}

/// The seed of pixels and bounces.
fn seed(results: &Results) -> u64 {
    results.provenance.seed.map_or(0, u64::from)
}

fn seeds(results: &Results) -> String {
    let (first, last) = (seed(results) + 1, seed(results) + u64::from(results.repetitions));
    format!("Seed {} of pixels and bounces, {first}–{last} of the samples of each round.", seed(results))
}

/// How sure the whiskers are, from 0 to 1.
fn confidence(results: &Results) -> f64 {
    let series = results.panels.iter().flat_map(|panel| &panel.sizes).flat_map(|size| &size.series).next();
    series.map_or(0.0, |series| series.total.confidence)
}

fn group(size: &Size) -> Group {
    let bar = |index: usize| {
        let series: &Series = &size.series[index];
        Bar {
            median_s: series.total.median,
            interval_s: [series.total.low, series.total.high],
            estimate_s: series.estimate.median,
        }
    };
    // Regular queues estimate nothing; what little planning they do belongs to their time.
    let whole = |index| Bar { estimate_s: 0.0, ..bar(index) };
    Group {
        label: grouped(size.task_rays.into()),
        blocks: whole(BLOCKS),
        round_robin: whole(ROUND_ROBIN),
        static_cost: bar(STATIC_COST),
        central: whole(CENTRAL),
        central_cost: bar(CENTRAL_COST),
        hybrid: whole(HYBRID),
        hybrid_cost: bar(HYBRID_COST),
        permuted: whole(PERMUTED),
        lifelines: whole(LIFELINES),
    }
}

impl Panel {
    pub(super) fn title(&self) -> String {
        let coherence = if self.stream == "primary" { "coherent" } else { "incoherent" };
        let kind = self.stream.split(' ').next().unwrap_or(&self.stream);
        format!("{}, {kind} rays ({coherence}): {}", self.scene, grouped(self.rays.into()))
    }

    /// Medians, and what cost initialisation does to each queue.
    pub(super) fn table(&self) -> Table {
        let mut table = Table::new(&[
            "task",
            "tasks",
            "blocks",
            "round robin",
            "LPT",
            "estimate",
            "central",
            "central+cost",
            "hybrid",
            "hybrid+cost",
            "permuted",
            "lifelines",
            "LPT/round robin",
            "central+cost/central",
            "hybrid+cost/hybrid",
        ]);
        for size in &self.sizes {
            let total = |index: usize| table::seconds(size.series[index].total.median);
            let ratio = |index: usize| {
                let last = size.series[index].ratios.last();
                last.map_or_else(String::new, |r| with_interval(&r.ratio, |ratio| format!("{ratio:.3}")))
            };
            table.row(vec![
                grouped(size.task_rays.into()),
                grouped(size.tasks as u64),
                total(BLOCKS),
                total(ROUND_ROBIN),
                total(STATIC_COST),
                table::seconds(size.series[STATIC_COST].estimate.median),
                total(CENTRAL),
                total(CENTRAL_COST),
                total(HYBRID),
                total(HYBRID_COST),
                total(PERMUTED),
                total(LIFELINES),
                ratio(STATIC_COST),
                ratio(CENTRAL_COST),
                ratio(HYBRID_COST),
            ]);
        }
        table
    }
}

/// Every single time, one line each, under lines that say where it comes from.
fn csv(results: &Results) -> String {
    let mut text = format!(
        "{}# {} on {} devices\n# estimator {}{}\n",
        results.provenance.csv(),
        results.mode,
        results.devices,
        results.estimator,
        results.fraction.map_or_else(String::new, |fraction| format!(", fraction {fraction}"))
    );
    text.push_str("scene,stream,rays,task_rays,tasks,round,seed,configuration,total_s,estimate_s\n");
    for panel in &results.panels {
        for size in &panel.sizes {
            for (config, series) in CONFIGS.iter().zip(&size.series) {
                let rows = size.seeds.iter().zip(&series.total_s).zip(&series.estimate_s);
                for (round, ((seed, total), estimate)) in (1..).zip(rows) {
                    let Panel { scene, stream, rays, .. } = panel;
                    let (task_rays, tasks, name) = (size.task_rays, size.tasks, config.name);
                    let scene = quoted(scene);
                    let _ = writeln!(
                        text,
                        "{scene},{stream},{rays},{task_rays},{tasks},{round},{seed},\"{name}\",{total:e},{estimate:e}"
                    );
                }
            }
        }
    }
    text
}
