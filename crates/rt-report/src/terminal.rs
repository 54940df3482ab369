//! What commands say of a run on a terminal, in lines that fit it.

use crate::report::{Report, Seconds};
use crate::table::{self, grouped, seconds};
use rt_balance::report::StreamRun;
use rt_cluster::ClusterReport;
use std::fmt::Write;
use std::io::{IsTerminal, stdout};
use std::path::Path;

/// Columns of text where there is no terminal, and the most that are used on a wide one: lines beyond that are hard to
/// follow.
const COLUMNS: usize = 100;

/// Least columns that are counted with: below that, nothing could be set well.
const FEWEST_COLUMNS: usize = 40;

/// How many columns standard output has: what the variable `COLUMNS` says, else its terminal, at most 100.
#[must_use]
pub fn columns() -> usize {
    let said = std::env::var("COLUMNS").ok().and_then(|text| text.parse().ok());
    let terminal =
        || stdout().is_terminal().then(terminal_size::terminal_size).flatten().map(|(width, _)| width.0.into());
    said.or_else(terminal).unwrap_or(COLUMNS).clamp(FEWEST_COLUMNS, COLUMNS)
}

/// Text broken between words into lines of at most `width` columns, all but the first indented by `indent`.
#[must_use]
pub fn wrapped(text: &str, indent: &str, width: usize) -> String {
    let words = text.trim_start();
    let mut lines = " ".repeat(text.len() - words.len());
    let mut used = lines.len();
    for (index, word) in words.split(' ').enumerate() {
        let own = word.chars().count();
        if index > 0 && used + 1 + own > width {
            lines.push('\n');
            lines.push_str(indent);
            used = indent.len();
        } else if index > 0 {
            lines.push(' ');
            used += 1;
        }
        lines.push_str(word);
        used += own;
    }
    lines
}

/// The scene, and how it is traced.
#[must_use]
pub fn scene(report: &Report, width: usize) -> String {
    let scene = &report.scene;
    let first = format!(
        "{}: {} triangles, tree of {:.1} MB by {} on {} thread{}, {:.2} million triangles/s, {} precision",
        scene.source,
        grouped(scene.triangles as u64),
        scene.bvh_bytes as f64 / 1e6,
        scene.builder,
        scene.build_threads,
        if scene.build_threads == 1 { "" } else { "s" },
        scene.triangles as f64 / report.seconds.build.max(1e-9) / 1e6,
        scene.precision
    );
    let mut text = wrapped(&first, "  ", width) + "\n";
    let fallback = scene.fallback.iter().map(|reason| format!("not by the builder asked for: {reason}"));
    for line in fallback.chain(scene.plan.reasons.iter().cloned()) {
        let _ = writeln!(text, "{}", wrapped(&format!("  {line}"), "    ", width));
    }
    text
}

/// Why each stream's estimate was made as it was, or none.
#[must_use]
pub fn reasons(runs: &[StreamRun], width: usize) -> String {
    table::reasons(runs).lines().map(|line| wrapped(line, "    ", width) + "\n").collect()
}

/// How each stream was balanced and what each device did.
#[must_use]
pub fn streams(runs: &[StreamRun], width: usize) -> String {
    let mut text =
        format!("{}\n{}", table::stream_table(runs).to_text(width), table::device_table(runs).to_text(width));
    for remark in table::device_remarks(runs) {
        let _ = writeln!(text, "{}", wrapped(&format!("  {remark}"), "    ", width));
    }
    text
}

/// How the scene was brought up to date before each frame; nothing where it did not move.
#[must_use]
pub fn updates(report: &Report, width: usize) -> String {
    let table = || table::update_table(&report.updates).to_text(width) + "\n";
    if report.updates.is_empty() { String::new() } else { table() }
}

/// All that is said of a picture whose files are in the folder `out`; with the reasons of estimates, where they are to
/// be explained.
#[must_use]
pub fn rendered(report: &Report, runs: &[StreamRun], explain: bool, out: &Path, width: usize) -> String {
    let mut text = scene(report, width);
    if explain {
        let _ = write!(text, "\n{}", reasons(runs, width));
    }
    let _ = writeln!(text, "\n{}", streams(runs, width));
    text += &updates(report, width);
    text += &wall(report, width);
    if let Some(missing) = report.missing() {
        let _ = writeln!(text, "{}", wrapped(&format!("  {missing}"), "    ", width));
    }
    let written =
        format!("  written to {}: image, cost, timeline, trace, tasks, report (.json and .html)", out.display());
    let _ = writeln!(text, "{}", wrapped(&written, "    ", width));
    text + "\n" + &headline(report, width)
}

/// What each of several processes did, and what they said to each other.
#[must_use]
pub fn ranks(deals: &[ClusterReport], width: usize) -> String {
    let makespan: f64 = deals.iter().map(|deal| deal.makespan_s).sum();
    let tiles: u32 = deals.iter().map(|deal| deal.tiles).sum();
    let messages: u64 = deals.iter().map(|deal| deal.messages).sum();
    let kilobytes = deals.iter().map(|deal| deal.bytes).sum::<u64>().div_ceil(1000);
    format!(
        "{}\n  {tiles} tiles in {makespan:.2} s, {messages} messages of {} kB together\n",
        table::rank_table(deals).to_text(width),
        grouped(kilobytes)
    )
}

/// Where the time went.
#[must_use]
pub fn wall(report: &Report, width: usize) -> String {
    let s = &report.seconds;
    let is_processor = |backend: &str| backend == "cpu";
    let devices = || report.streams.iter().flat_map(|stream| &stream.devices);
    let reason = if devices().all(|device| is_processor(&device.backend)) {
        " (the scene made ready: once per start)"
    } else {
        " (kernels compiled: once per start)"
    };
    let Seconds { load, build, setup, update, estimate, trace, reference, unused_estimate, shade, write, total } = *s;
    let parts = [
        ("load", load, ""),
        ("build", build, ""),
        ("set-up", setup, reason),
        ("moving", update, ""),
        ("estimate", estimate, ""),
        ("trace", trace, ""),
        ("reference", reference, ""),
        ("estimates not used", unused_estimate, " (for comparison)"),
        ("shade", shade, ""),
        ("write", write, ""),
        ("total", total, ""),
    ];
    let told = parts.into_iter().filter(|(_, s, _)| *s >= LEAST_TOLD_S);
    let told: Vec<String> = told.map(|(name, s, more)| format!("{name} {}{more}", seconds(s))).collect();
    wrapped(&format!("  wall: {}", told.join(", ")), "    ", width) + "\n"
}

/// Shorter parts of the wall time are left out.
const LEAST_TOLD_S: f64 = 5e-5;

/// The last word on a run.
#[must_use]
pub fn headline(report: &Report, width: usize) -> String {
    wrapped(&format!("  {}", report.headline.sentence), "  ", width) + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: the indent not counted; a break in a word; a word that is too long for any line lost.
    #[test]
    fn lines_are_broken_between_words() {
        assert_eq!(wrapped("  one two three", "    ", 9), "  one two\n    three");
        assert_eq!(wrapped("a bbbbbbbbbbbb c", "  ", 6), "a\n  bbbbbbbbbbbb\n  c");
        assert_eq!(wrapped("", "  ", 6), "");
    }
}
