//! Tables for people.

use rt_balance::report::{StreamReport, StreamRun};
use std::fmt::Write;

/// Rows of cells under a header; every column as wide as its widest cell, words to the left and numbers to the right.
#[derive(Debug)]
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with nothing but its header.
    #[must_use]
    pub fn new(header: &[&str]) -> Self {
        Self { rows: vec![header.iter().map(|&h| h.to_owned()).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// The header, then the rows.
    #[must_use]
    pub fn rows(&self) -> &[Vec<String>] {
        &self.rows
    }

    /// Whether a column holds words, which are set to the left.
    #[must_use]
    pub fn is_words(&self, column: usize) -> bool {
        let cells = self.rows.iter().skip(1).filter_map(|row| row.get(column));
        let mut body = cells.filter(|cell| !cell.is_empty()).peekable();
        body.peek().is_some() && body.all(|cell| cell.starts_with(char::is_alphabetic))
    }
}

impl Table {
    /// The table in Markdown.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = String::new();
        for (index, row) in self.rows.iter().enumerate() {
            // A bar would end the cell.
            let cells: Vec<String> = row.iter().map(|cell| cell.replace('|', "\\|")).collect();
            let _ = writeln!(text, "| {} |", cells.join(" | "));
            if index == 0 {
                let rule = |column| if self.is_words(column) { "---" } else { "---:" };
                let _ = writeln!(text, "|{}|", (0..row.len()).map(rule).collect::<Vec<_>>().join("|"));
            }
        }
        text
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |c: usize| self.rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max().unwrap_or(0);
        let widths: Vec<(usize, bool)> = (0..columns).map(|c| (width(c), self.is_words(c))).collect();
        for row in &self.rows {
            let mut line = String::from(" ");
            for (column, (cell, &(width, is_words))) in row.iter().zip(&widths).enumerate() {
                if column > 0 {
                    line.push(' ');
                }
                if is_words {
                    write!(line, " {cell:<width$}")?;
                } else {
                    write!(line, " {cell:>width$}")?;
                }
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// Seconds in the unit that reads best.
#[must_use]
pub fn seconds(s: f64) -> String {
    match s {
        s if s >= 10.0 => format!("{s:.1} s"),
        s if s >= 1.0 => format!("{s:.2} s"),
        s if s >= 1e-3 => format!("{:.1} ms", s * 1e3),
        s => format!("{:.0} µs", s * 1e6),
    }
}

/// A share as a percentage; a dash where unknown.
#[must_use]
pub fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "–".to_owned(), |share| format!("{:.1}%", 100.0 * share))
}

/// A text as a field of a CSV file: it may hold commas, and quotes are doubled (RFC 4180).
#[must_use]
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// A whole number with thin groups of three.
#[must_use]
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// What was balanced, stream by stream, and what each device did.
#[must_use]
pub fn streams(runs: &[StreamRun]) -> String {
    format!("{}\n{}", stream_table(runs), device_table(runs))
}

/// Why each stream's estimate was made as it was, a line for each; streams of estimators that have no choice are left
/// out.
#[must_use]
pub fn reasons(runs: &[StreamRun]) -> String {
    let name = Naming::of(runs);
    let shown = longest(runs, MOST_STREAMS);
    let lines = shown.iter().filter_map(|run| {
        let estimate = &run.report.estimate;
        let reason = estimate.reason.as_ref()?;
        Some(format!("  {}: {}, since {reason}\n", name.of_stream(&run.report), estimate.chosen))
    });
    lines.collect()
}

/// Most streams that a table lists: more than that nobody reads. The longest are kept.
const MOST_STREAMS: usize = 64;

/// How each stream was balanced.
#[must_use]
pub fn stream_table(runs: &[StreamRun]) -> Table {
    let mut streams = Table::new(&[
        "stream",
        "rays",
        "tasks",
        "Mray/s",
        "estimate",
        "of trace",
        "by",
        "±counts",
        "err counts",
        "err time",
        "makespan",
        "imbalance",
        "excess",
    ]);
    let name = Naming::of(runs);
    let shown = longest(runs, MOST_STREAMS);
    for report in shown.iter().map(|run| &run.report) {
        let estimate = &report.estimate;
        streams.row(vec![
            name.of_stream(report),
            grouped(report.rays.into()),
            grouped(report.tasks.into()),
            format!("{:.2}", f64::from(report.rays) / report.makespan_s.max(f64::MIN_POSITIVE) / 1e6),
            seconds(estimate.seconds),
            percent(estimate.overhead),
            estimate.chosen.clone(),
            percent(estimate.std_error),
            percent(estimate.mre_counts),
            percent(estimate.mre_time),
            seconds(report.makespan_s),
            percent(report.imbalance),
            percent(report.excess),
        ]);
    }
    if shown.len() < runs.len() {
        streams.row(vec![format!("(the {} longest of {})", shown.len(), grouped(runs.len() as u64))]);
    }
    streams
}

/// The streams with the longest makespans, in their own order.
pub(crate) fn longest(runs: &[StreamRun], most: usize) -> Vec<&StreamRun> {
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by(|&a, &b| runs[b].report.makespan_s.total_cmp(&runs[a].report.makespan_s));
    order.truncate(most);
    order.sort_unstable();
    order.into_iter().map(|index| &runs[index]).collect()
}

/// Sums over all streams for each device.
#[must_use]
pub fn device_table(runs: &[StreamRun]) -> Table {
    let mut table =
        Table::new(&["device", "busy", "share", "in kernels", "launches", "tasks", "rays", "on host", "model error"]);
    let count = runs.first().map_or(0, |run| run.report.devices.len());
    let total: f64 = runs.iter().flat_map(|run| &run.report.devices).map(|device| device.busy_s).sum();
    for index in 0..count {
        let parts: Vec<_> = runs.iter().filter_map(|run| run.report.devices.get(index)).collect();
        let Some(last) = parts.last() else { continue };
        let busy: f64 = parts.iter().map(|part| part.busy_s).sum();
        let in_kernels: f64 = parts.iter().map(|part| part.busy_s * part.kernel_share.unwrap_or_default()).sum();
        let mut cells = vec![
            last.name.clone(),
            seconds(busy),
            percent((total > 0.0).then(|| busy / total)),
            percent((busy > 0.0).then(|| in_kernels / busy)),
            grouped(parts.iter().map(|part| u64::from(part.launches)).sum()),
            grouped(parts.iter().map(|part| u64::from(part.tasks)).sum()),
            grouped(parts.iter().map(|part| part.rays).sum()),
            grouped(parts.iter().filter_map(|part| part.on_host).sum()),
            // What the last stream's prices leave unexplained.
            percent(last.model.map(|model| model.residual)),
        ];
        if let Some(note) = &last.note {
            cells.push(note.clone());
        }
        if let Some(error) = &last.error {
            cells.push(format!("failed: {error}"));
        }
        table.row(cells);
    }
    table
}

/// What streams are called: their kind, with frame and wave where there is more than one.
struct Naming {
    frames: bool,
    waves: bool,
}

impl Naming {
    fn of(runs: &[StreamRun]) -> Self {
        Self { frames: runs.iter().any(|run| run.report.frame > 0), waves: runs.iter().any(|run| run.report.wave > 0) }
    }

    fn of_stream(&self, report: &StreamReport) -> String {
        let mut name = report.kind.clone();
        if self.frames {
            let _ = write!(name, ", frame {}", report.frame);
        }
        if self.waves {
            let _ = write!(name, ", wave {}", report.wave);
        }
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(seconds(0.000_42), "420 µs");
        assert_eq!(seconds(1.5), "1.50 s");
        assert_eq!(grouped(1_234_567), "1,234,567");
        assert_eq!(percent(None), "–");
        assert_eq!(percent(Some(0.0123)), "1.2%");
    }

    #[test]
    fn columns_line_up() {
        let mut table = Table::new(&["a", "bb"]);
        table.row(vec!["long".to_owned(), "1".to_owned()]);
        assert_eq!(table.to_string(), "  a     bb\n  long   1\n");
        assert_eq!(table.to_markdown(), "| a | bb |\n|---|---:|\n| long | 1 |\n");
    }
}
