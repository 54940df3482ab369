//! What all scenes come to: the table of `docs/results/cpu.md`.

use rt_balance::stats::Summary;
use rt_report::print::Stdout;
use std::error::Error;
use std::io::Write;

/// Who a line is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Who {
    /// Embree by one of its interfaces.
    Embree(&'static str),
    Obvhs,
    /// This project with some instructions, and so many threads.
    Ours(String, usize),
}

/// How somebody traced a stream.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    pub(crate) who: Who,
    /// Mray/s, the median of all runs.
    pub(crate) speed: f64,
    /// Embree's best time over its own; nothing without Embree.
    pub(crate) ratio: Option<Summary>,
    /// In a million rays.
    pub(crate) missed: f64,
    pub(crate) phantom: f64,
}

/// A stream of a scene, traced by everybody.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub(crate) scene: String,
    pub(crate) rays: &'static str,
    pub(crate) lines: Vec<Line>,
}

/// A row for each cell and a column for each set of instructions, the fastest first; then means of all rows.
pub(crate) fn print(cells: &[Cell]) -> Result<(), Box<dyn Error>> {
    let Some(first) = cells.first() else { return Ok(()) };
    let mut ours: Vec<&str> = first.lines.iter().filter_map(|line| one_thread(&line.who)).collect();
    ours.reverse();
    write!(Stdout, "\n## All\n\n| scene | rays | Embree's best | obvhs |")?;
    ours.iter().try_for_each(|isa| write!(Stdout, " raybalance, {isa} |"))?;
    writeln!(Stdout, " Embree: missed / false | obvhs: missed / false |")?;
    writeln!(Stdout, "|---|---|---|---|{}---|---|", "---|".repeat(ours.len()))?;
    for cell in cells {
        row(cell, &ours)?;
    }
    writeln!(Stdout)?;
    for isa in ours {
        let ratios: Vec<f64> = cells
            .iter()
            .filter_map(|cell| cell.lines.iter().find(|line| one_thread(&line.who) == Some(isa)))
            .filter_map(|line| line.ratio.as_ref().map(|ratio| ratio.median))
            .collect();
        if ratios.is_empty() {
            continue;
        }
        let (low, high) = ratios.iter().fold((f64::MAX, 0.0_f64), |(low, high), &x| (low.min(x), high.max(x)));
        let ahead = ratios.iter().filter(|&&ratio| ratio >= 1.0).count();
        writeln!(
            Stdout,
            "* {isa}: geometric mean of the ratios {:.2} ({low:.2} to {high:.2}), {ahead} of {} at 1 or more",
            geometric(&ratios),
            ratios.len()
        )?;
        let scaling: Vec<f64> = cells.iter().filter_map(|cell| two_over_one(cell, isa)).collect();
        if !scaling.is_empty() {
            writeln!(Stdout, "* {isa}: two threads (wall time) over one: {:.2}", geometric(&scaling))?;
        }
    }
    Ok(())
}

fn row(cell: &Cell, ours: &[&str]) -> Result<(), Box<dyn Error>> {
    write!(Stdout, "| {} | {} |", cell.scene, cell.rays)?;
    let embree = || cell.lines.iter().filter(|line| matches!(line.who, Who::Embree(_)));
    match embree().max_by(|a, b| a.speed.total_cmp(&b.speed)) {
        Some(Line { who: Who::Embree(way), speed, .. }) => write!(Stdout, " {speed:.1} ({way}) |")?,
        _ => write!(Stdout, " – |")?,
    }
    let ratio = |line: &Line| line.ratio.as_ref().map_or(f64::NAN, |ratio| ratio.median);
    let obvhs = cell.lines.iter().find(|line| line.who == Who::Obvhs);
    match obvhs {
        Some(line) => write!(Stdout, " {:.1} · {:.2} |", line.speed, ratio(line))?,
        None => write!(Stdout, " – |")?,
    }
    for &isa in ours {
        let Some(line) = cell.lines.iter().find(|line| one_thread(&line.who) == Some(isa)) else { continue };
        write!(Stdout, " {:.1} · **{:.2}**", line.speed, ratio(line))?;
        if let Some(ratio) = &line.ratio {
            write!(Stdout, " [{:.2}, {:.2}]", ratio.low, ratio.high)?;
        }
        write!(Stdout, " |")?;
    }
    let worst = |of: fn(&Line) -> f64| embree().map(of).fold(0.0, f64::max);
    write!(Stdout, " {:.1} / {:.1} |", worst(|line| line.missed), worst(|line| line.phantom))?;
    match obvhs {
        Some(line) => writeln!(Stdout, " {:.1} / {:.1} |", line.missed, line.phantom)?,
        None => writeln!(Stdout, " – |")?,
    }
    Ok(())
}

/// The instructions of this project on one thread.
fn one_thread(who: &Who) -> Option<&str> {
    match who {
        Who::Ours(isa, 1) => Some(isa),
        _ => None,
    }
}

fn two_over_one(cell: &Cell, isa: &str) -> Option<f64> {
    let speed = |threads: usize| {
        let who = Who::Ours(isa.to_owned(), threads);
        cell.lines.iter().find(|line| line.who == who).map(|line| line.speed)
    };
    Some(speed(2)? / speed(1)?)
}

fn geometric(ratios: &[f64]) -> f64 {
    (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp()
}
