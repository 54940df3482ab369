//! Tables for people.

mod ranks;
mod runs;
mod updates;

pub use ranks::{lost_ranks, rank_table};
use runs::MOST_ROWS;
pub(crate) use runs::longest;
pub use runs::{device_remarks, device_table, meaning, reasons, stream_table};
pub use updates::update_table;

use std::fmt::Write;

/// Rows of cells under a header; every column as wide as its widest cell, words to the left and numbers to the right.
#[derive(Debug)]
pub struct Table {
    rows: Vec<Vec<String>>,
    /// How many of the columns say what a row is about.
    keys: usize,
}

impl Table {
    /// A table with nothing but its header.
    #[must_use]
    pub fn new(header: &[&str]) -> Self {
        Self { rows: vec![header.iter().map(|&h| h.to_owned()).collect()], keys: 1 }
    }

    /// The same of which the first `keys` columns, not the first one alone, say what a row is about.
    #[must_use]
    pub fn with_keys(self, keys: usize) -> Self {
        Self { keys: keys.max(1), ..self }
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
        let mut body = cells.filter(|cell| !["", DASH].contains(&cell.as_str())).peekable();
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

    /// The table without columns that say nothing: dashes or nothing in every row.
    #[must_use]
    pub fn without_empty_columns(&self) -> Self {
        let says = |column: &usize| {
            let cells = self.rows.iter().skip(1).filter_map(|row| row.get(*column));
            self.rows.len() < 2 || cells.into_iter().any(|cell| !["", DASH].contains(&cell.as_str()))
        };
        let kept: Vec<usize> = (0..self.rows.first().map_or(0, Vec::len)).filter(says).collect();
        let row = |row: &Vec<String>| kept.iter().map(|&c| row.get(c).cloned().unwrap_or_default()).collect();
        let keys = kept.iter().filter(|&&column| column < self.keys).count().max(1);
        Self { rows: self.rows.iter().map(row).collect(), keys }
    }

    /// The table as text of at most `width` columns: where it is wider, what is left of it follows below, with the
    /// columns that say what rows are about again. A single column wider than that stays as it is.
    #[must_use]
    pub fn to_text(&self, width: usize) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns).map(|column| self.width(column)).collect();
        let mut blocks: Vec<Vec<usize>> = Vec::new();
        let keys: Vec<usize> = (0..self.keys.min(columns)).collect();
        let keyed = MARGIN.len() + keys.iter().map(|&key| GAP.len() + widths[key]).sum::<usize>();
        let keyed = keyed.saturating_sub(GAP.len());
        let mut used = keyed;
        let mut block = keys.clone();
        for (column, own) in widths.iter().enumerate().skip(keys.len()) {
            let own = GAP.len() + own;
            if used + own > width && block.len() > keys.len() {
                blocks.push(std::mem::replace(&mut block, keys.clone()));
                used = keyed;
            }
            block.push(column);
            used += own;
        }
        blocks.push(block);
        let texts: Vec<String> = blocks.iter().map(|block| self.block(block)).collect();
        texts.join("\n")
    }

    /// Characters of the widest cell.
    fn width(&self, column: usize) -> usize {
        self.rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    }

    /// Some of the columns.
    fn block(&self, columns: &[usize]) -> String {
        let shapes: Vec<(usize, usize, bool)> =
            columns.iter().map(|&column| (column, self.width(column), self.is_words(column))).collect();
        let mut text = String::new();
        // Of what follows below, rows that say nothing more are left out.
        let own = columns.get(self.keys..).unwrap_or_default();
        let is_first = own.first().is_none_or(|&column| column == self.keys);
        let says = |row: &Vec<String>| own.iter().any(|&column| row.get(column).is_some_and(|cell| !cell.is_empty()));
        for row in self.rows.iter().filter(|row| is_first || says(row)) {
            let mut line = String::from(MARGIN);
            for (index, &(column, width, is_words)) in shapes.iter().enumerate() {
                let cell = row.get(column).map_or("", String::as_str);
                line.push_str(if index > 0 { GAP } else { "" });
                let _ = if is_words { write!(line, "{cell:<width$}") } else { write!(line, "{cell:>width$}") };
            }
            let _ = writeln!(text, "{}", line.trim_end());
        }
        text
    }
}

/// What a cell shows of what is not known.
const DASH: &str = "–";

const MARGIN: &str = "  ";
const GAP: &str = "  ";

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.to_text(usize::MAX))
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
    share.map_or_else(|| DASH.to_owned(), |share| format!("{:.1}%", 100.0 * share))
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

    /// Mutants: a column that is dropped with a number in it; a block without the first column; a line that is too
    /// long.
    #[test]
    fn tables_fit_and_lose_nothing_that_says_something() {
        let mut table = Table::new(&["device", "empty", "busy", "share", "rays"]);
        table.row(["a card", "–", "1.00 s", "50.0%", "1,024"].map(str::to_owned).to_vec());
        table.row(["all", "", "1.00 s", "", "1,024"].map(str::to_owned).to_vec());
        let table = table.without_empty_columns();
        assert_eq!(table.rows()[0], ["device", "busy", "share", "rays"]);
        let text = table.to_text(24);
        assert_eq!(
            text,
            "  device    busy  share\n  a card  1.00 s  50.0%\n  all     1.00 s\n\n  device   rays\n  a card  1,024\n  all     1,024\n"
        );
        assert!(text.lines().all(|line| line.chars().count() <= 24));
        // A row that has nothing in what is left is not repeated. Fails when it is, or goes everywhere.
        let mut sums = Table::new(&["device", "busy", "share"]);
        sums.row(["a card", "1.00 s", "50.0%"].map(str::to_owned).to_vec());
        sums.row(["all", "1.00 s", ""].map(str::to_owned).to_vec());
        assert_eq!(
            sums.to_text(20),
            "  device    busy\n  a card  1.00 s\n  all     1.00 s\n\n  device  share\n  a card  50.0%\n"
        );
        // Fails when what is left of a row does not say which it is.
        let mut ways = Table::new(&["queue", "policy", "time", "share"]).with_keys(2);
        ways.row(["static", "lpt", "1.00 s", "50.0%"].map(str::to_owned).to_vec());
        assert_eq!(
            ways.to_text(25),
            "  queue   policy    time\n  static  lpt     1.00 s\n\n  queue   policy  share\n  static  lpt     50.0%\n"
        );
        // What no width can hold is shown all the same.
        assert!(table.to_text(1).lines().count() > 6);
    }

    #[test]
    fn columns_line_up() {
        let mut table = Table::new(&["a", "bb"]);
        table.row(vec!["long".to_owned(), "1".to_owned()]);
        assert_eq!(table.to_string(), "  a     bb\n  long   1\n");
        assert_eq!(table.to_markdown(), "| a | bb |\n|---|---:|\n| long | 1 |\n");
    }
}
