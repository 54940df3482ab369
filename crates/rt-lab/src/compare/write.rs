//! What `compare` leaves behind: tables, chart, raw times, page.

use super::Options;
use super::results::{Results, WayResult};
use crate::Lab;
use anyhow::Result;
use rt_balance::stats::Summary;
use rt_report::chart::intervals::{Chart, Row, to_svg};
use rt_report::html::Page;
use rt_report::output::write_atomically;
use rt_report::table::{self, Table, grouped, percent, seconds};
use rt_report::terminal::{self, wrapped};
use std::fmt::Write as _;

/// Every file.
pub(super) const FILES: [&str; 5] = ["compare.json", "compare.csv", "compare.md", "compare.svg", "report.html"];

pub(super) fn all(lab: Lab<'_>, options: &Options, results: &Results) -> Result<()> {
    let out = |name: &str| options.out.join(name);
    let text = |name: &str, text: &str| write_atomically(&out(name), |file| file.write_all(text.as_bytes()));
    let json = serde_json::to_string_pretty(results)?;
    let svg = to_svg(&chart(results));
    text("compare.json", &json)?;
    text("compare.csv", &csv(results))?;
    text("compare.md", &markdown(results))?;
    text("compare.svg", &results.provenance.in_svg(&svg))?;
    page(results, &svg).write(&out("report.html"))?;
    if options.json {
        return Ok(lab.show.print(&json)?);
    }
    Ok(lab.show.print(&terminal(results, &options.out.display().to_string()))?)
}

/// What was compared, in a line.
fn subject(results: &Results) -> String {
    let [width, height] = results.size;
    let rays: u64 = results.ways[0].streams.iter().map(|stream| u64::from(stream.rays)).sum();
    format!(
        "{}: {width} x {height} pixels, {} a pixel, {}, {} rays in {}; devices {}",
        results.name,
        counted(results.samples, "ray"),
        counted(results.bounces, "bounce"),
        grouped(rays),
        counted(results.ways[0].streams.len(), "stream"),
        results.entries(),
    )
}

fn counted(count: impl TryInto<u64>, what: &str) -> String {
    let count = count.try_into().unwrap_or(u64::MAX);
    format!("{} {what}{}", grouped(count), if count == 1 { "" } else { "s" })
}

/// How it was measured, in sentences.
fn notes(results: &Results) -> Vec<String> {
    let Summary { count, confidence, .. } = results.ways[0].of_default;
    let measured = match count {
        1 => "one round counts, after one that does not, so there are no intervals".to_owned(),
        _ => format!(
            "medians of {}, after one that is not counted. Intervals of {:.0}% are of ratios within rounds",
            counted(count, "round"),
            100.0 * confidence
        ),
    };
    let mut notes = vec![
        format!(
            "Every round renders the picture by every way and by each kind of device alone, one after the other; \
             {measured}."
        ),
        "Estimators are new in every round, as for a first picture; those with \"later frames\" have seen the rounds \
         before. How fast devices are is known to all, from the round before."
            .to_owned(),
        "imbalance: how much longer the last device worked than all did on average; overhead: what the estimation took, \
         beside the trace; excess: beyond the least time of any schedule (--reference)."
            .to_owned(),
    ];
    if let Some(noise) = results.noise {
        notes.push(format!(
            "Noise: medians closer than {} cannot be told apart here, as far as times of one way scatter.",
            percent(Some(noise))
        ));
    }
    notes.extend(development(results));
    notes
}

/// A warning where times mean little.
fn development(results: &Results) -> Option<String> {
    let is_release = results.provenance.machine.build == "release";
    (!is_release).then(|| "This is a development build: its times are not those of a release build.".to_owned())
}

/// All ways, the fastest first.
fn ways(results: &Results) -> Table {
    let has_excess = results.ways.iter().any(|way| way.excess.is_some());
    let last = if has_excess { "excess" } else { "imbalance" };
    let of_default = results.ways[0].of_default;
    // One round has no interval.
    let sure = of_default.interval().map(|_| format!(" [{:.0}%]", 100.0 * of_default.confidence));
    let ratio = format!("% of default{}", sure.unwrap_or_default());
    let mut table = Table::new(&["queue", "policy", "estimate", "trace", &ratio, last, "overhead"]).with_keys(3);
    for way in results.ranked() {
        let median = 100.0 * way.of_default.median;
        let of_default = match way.of_default.interval() {
            _ if std::ptr::eq(way, &results.ways[0]) => "100".to_owned(),
            Some([low, high]) => format!("{median:.1} [{:.1}–{:.1}]", 100.0 * low, 100.0 * high),
            None => format!("{median:.1}"),
        };
        table.row(vec![
            way.queue.to_owned(),
            way.policy.to_owned(),
            way.estimate.clone(),
            seconds(way.trace.median),
            of_default,
            percent(if has_excess { way.excess } else { way.imbalance }),
            percent(Some(way.overhead)),
        ]);
    }
    table
}

/// Each device alone beside the way to use.
fn alone(results: &Results) -> Option<Table> {
    let mut table = Table::new(&["devices", "trace", "picture", "with loading, building, set-up"]);
    let once = results.prepare_s + results.setup_s;
    let mut row = |name: String, trace: &Summary, picture: &Summary| {
        table.row(vec![name, seconds(trace.median), seconds(picture.median), seconds(once + picture.median)]);
    };
    let together = &results.ways[results.verdict.way];
    row(format!("{} together", results.entries()), &together.trace, &together.picture);
    for alone in &results.alone {
        row(format!("{} alone: {}", alone.entry, alone.name), &alone.trace, &alone.picture);
    }
    (!results.alone.is_empty()).then_some(table)
}

/// Medians of each stream.
fn streams(results: &Results) -> Table {
    let kinds: Vec<&str> = results.ways[0].streams.iter().map(|stream| stream.kind.as_str()).collect();
    let mut table = Table::new(&[&["way"], &kinds[..]].concat());
    let rays = |stream: &super::results::StreamResult| {
        format!("{} in {}", grouped(stream.rays.into()), counted(stream.tasks, "task"))
    };
    table.row(["rays".to_owned()].into_iter().chain(results.ways[0].streams.iter().map(rays)).collect());
    for way in results.ranked() {
        let times = way.streams.iter().map(|stream| seconds(stream.makespan.median));
        table.row([way.label.clone()].into_iter().chain(times).collect());
    }
    table
}

fn terminal(results: &Results, out: &str) -> String {
    let width = terminal::columns();
    let mut text = format!("{}\n\n{}\n", wrapped(&subject(results), "", width), ways(results).to_text(width));
    if let Some(alone) = alone(results) {
        let _ = writeln!(text, "{}", alone.to_text(width));
    }
    for sentence in results.verdict.sentences.iter().chain(&development(results)) {
        let _ = writeln!(text, "  {}", wrapped(sentence, "  ", width - 2));
    }
    let options = &results.ways[results.verdict.way].options;
    if !options.is_empty() {
        let _ = writeln!(text, "\n{}", advised_command(results, options));
    }
    let _ = write!(text, "\n  written to {out}: compare.json, .csv, .md, .svg and report.html");
    text
}

/// What to paste, in two lines, since what the chosen parts are called may be long.
fn advised_command(results: &Results, options: &str) -> String {
    format!("  raybalance render {} --devices {} \\\n    {options}", results.scene.source, results.entries())
}

fn markdown(results: &Results) -> String {
    let mut text = format!("{}\n{}\n\n", results.provenance, subject(results));
    results.verdict.sentences.iter().for_each(|sentence| text.push_str(&format!("{sentence}\n")));
    for table in [Some(ways(results)), alone(results), Some(streams(results))].into_iter().flatten() {
        let _ = write!(text, "\n{}", table.to_markdown());
    }
    text.push('\n');
    notes(results).iter().for_each(|note| text.push_str(&format!("* {note}\n")));
    text
}

fn chart(results: &Results) -> Chart {
    let advised = &results.ways[results.verdict.way];
    let row = |way: &WayResult| Row {
        label: way.label.clone(),
        ratio: way.of_default.median,
        interval: way.of_default.interval(),
        is_advised: std::ptr::eq(way, advised),
    };
    Chart {
        title: format!("{} on {}: time of tracing, % of the default's", results.name, results.entries()),
        note: match advised.of_default.interval() {
            Some(_) => {
                "Less is better. Dot: median of the ratios within rounds; line: its interval; grey: noise. Orange: to \
                 use."
            }
            None => "Less is better. Dot: ratio within the only round. Orange: to use.",
        }
        .to_owned(),
        rows: results.ranked().into_iter().map(row).collect(),
        noise: results.noise,
    }
}

fn page(results: &Results, svg: &str) -> Page {
    let (first, last) = (results.seeds.first(), results.seeds.last());
    let seeds = match first.zip(last) {
        Some((first, last)) if first < last => format!("Seeds {first} to {last} of the rounds."),
        Some((only, _)) => format!("Seed {only} of the round."),
        None => String::new(),
    };
    let mut page = Page::new(&format!("raybalance compare: {}", results.name), &results.provenance, &seeds);
    page.section("What to use");
    page.paragraph(&format!("{}.", subject(results)));
    results.verdict.sentences.iter().for_each(|sentence| page.paragraph(sentence));
    page.chart(
        svg,
        "Dots with intervals: how long each way of scheduling takes, relative to the default. The table below holds the \
         same numbers.",
        "Ways are named by queue, policy and estimator.",
    );
    page.section("Every way");
    page.table("All ways to schedule, the fastest first", &ways(results));
    if let Some(alone) = alone(results) {
        page.section("Together and alone");
        page.table("All devices together, and each kind of them alone", &alone);
    }
    page.section("Streams");
    page.table("Seconds of each stream, medians", &streams(results));
    page.section("How it was measured");
    notes(results).iter().for_each(|note| page.paragraph(note));
    page.paragraph(&format!(
        "Loading and building took {}, bringing the scene to the devices {}.",
        seconds(results.prepare_s),
        seconds(results.setup_s)
    ));
    page.paragraph("Every single time is in compare.csv, with summaries in compare.json, both beside this page.");
    page
}

/// Every single time, one line each, under lines that say where it comes from.
fn csv(results: &Results) -> String {
    let mut text = results.provenance.csv();
    text.push_str("scene,stream,rays,tasks,round,seed,queue,policy,estimator,later_frames,total_s,estimate_s\n");
    let scene = table::quoted(&results.name);
    for way in &results.ways {
        let WayResult { queue, policy, estimator, later_frames, .. } = way;
        for stream in &way.streams {
            let times = results.seeds.iter().zip(&stream.makespan_s).zip(&stream.estimate_s);
            for (round, ((seed, total), estimate)) in (1..).zip(times) {
                let (kind, rays, tasks) = (&stream.kind, stream.rays, stream.tasks);
                let _ = writeln!(
                    text,
                    "{scene},{kind},{rays},{tasks},{round},{seed},{queue},{policy},{estimator},{later_frames},{total:e},\
                     {estimate:e}"
                );
            }
        }
    }
    text
}
