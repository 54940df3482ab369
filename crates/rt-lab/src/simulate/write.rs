//! What `simulate` leaves behind: tables, a chart, every number.

use super::strategies::Strategy;
use super::{Check, Played, Results, StrategyPlayed};
use crate::Lab;
use anyhow::Result;
use rt_balance::stats::median;
use rt_report::chart::front::{self, Chart, Panel, Series};
use rt_report::output::write_atomically;
use rt_report::table::{Table, grouped, percent, seconds};
use std::fmt::Write as _;
use std::path::Path;

/// Every file.
pub(super) const FILES: [&str; 2] = ["simulate.svg", "simulate.json"];

pub(super) fn all(lab: Lab<'_>, out: &Path, results: &Results) -> Result<()> {
    let mut text = format!("Played from task times of {}\n", results.source);
    if !results.machines.is_empty() {
        let svg = results.provenance.in_svg(&front::to_svg(&chart(results))?);
        write_atomically(&out.join("simulate.svg"), |file| file.write_all(svg.as_bytes()))?;
        let kinds: Vec<String> = results.machines[0].streams.iter().map(|stream| stream.kind.clone()).collect();
        let _ = writeln!(
            text,
            "Streams one after the other: {}.\nWhat devices share (memory, power) is not simulated.\n\n{}",
            kinds.join(", "),
            machines(&results.machines)
        );
    }
    write_atomically(&out.join("simulate.json"), |file| Ok(serde_json::to_writer_pretty(file, results)?))?;
    if !results.checks.is_empty() {
        let off: Vec<f64> = results.checks.iter().map(|check| check.error.abs()).collect();
        let worst = off.iter().copied().fold(0.0, f64::max);
        let _ = writeln!(
            text,
            "Real runs, played again: off by {} in the median, by {} at most\n\n{}",
            percent(Some(median(&off))),
            percent(Some(worst)),
            checks(&results.checks)
        );
    }
    let files = if results.machines.is_empty() { "simulate.json" } else { "simulate.svg and simulate.json" };
    let _ = write!(text, "  written to {}: {files}", out.display());
    Ok(lab.show.print(&text)?)
}

/// Every strategy on every machine.
fn machines(machines: &[Played]) -> Table {
    let are_nodes = machines.iter().any(|played| played.machine.nodes > 1);
    let nodes = if are_nodes { &["nodes"][..] } else { &[] };
    let columns = ["devices", "strategy", "makespan", "of it estimate", "excess", "launches a device"];
    let mut table = Table::new(&[nodes, &columns].concat());
    for Played { machine, strategies, .. } in machines {
        for StrategyPlayed { name, outcome, excess } in strategies {
            let Some(outcome) = outcome else { continue };
            let mut row = Vec::new();
            row.extend(are_nodes.then(|| grouped(machine.nodes.into())));
            row.extend([
                grouped(machine.speeds.len() as u64),
                (*name).to_owned(),
                seconds(outcome.makespan_s),
                seconds(outcome.estimate_s),
                percent(*excess),
                format!("{:.1}", outcome.launches),
            ]);
            table.row(row);
        }
    }
    table
}

fn checks(checks: &[Check]) -> Table {
    let mut table = Table::new(&["frame", "rays", "devices", "real", "simulated", "error"]);
    for check in checks {
        table.row(vec![
            check.frame.to_string(),
            check.stream.clone(),
            check.devices.len().to_string(),
            seconds(check.real_s),
            seconds(check.simulated_s),
            format!("{:+.1}%", 100.0 * check.error),
        ]);
    }
    table
}

/// Excess, makespan and launches of each strategy against the number of all devices.
fn chart(results: &Results) -> Chart {
    let panel = |title: &str, unit: &str, value: fn(&StrategyPlayed) -> Option<f64>| {
        let series = |(index, strategy): (usize, &Strategy)| {
            let point = |played: &Played| {
                let devices = played.machine.speeds.len() * played.machine.nodes as usize;
                Some([devices as f64, value(&played.strategies[index])?])
            };
            let points = results.machines.iter().filter_map(point).collect();
            Series { name: strategy.name.to_owned(), points, intervals: Vec::new() }
        };
        Panel {
            title: title.to_owned(),
            axes: ["devices".to_owned(), unit.to_owned()],
            series: Strategy::ALL.iter().enumerate().map(series).collect(),
            reference: None,
            levels: Vec::new(),
            front: None,
        }
    };
    Chart {
        title: format!("Simulated from task times of {}", results.source),
        panels: vec![
            panel("Excess over the lower bound", "percent", |played| Some(100.0 * played.excess?)),
            panel("Makespan", "seconds", |played| Some(played.outcome?.makespan_s)),
            panel("Launches of a device", "launches", |played| Some(played.outcome?.launches)),
        ],
        columns: 3,
    }
}
