//! The tables and the raw samples.

use super::measure::{Case, Outcome, Seconds};
use super::truth::Truth;
use rt_balance::stats::median;
use rt_core::{StreamKind, Task};
use rt_lab::contenders::MACHINES;
use rt_report::print::Stdout;
use rt_sched::metrics::EstimateErrors;
use serde_json::{Value, json};
use std::io::{self, Write};

fn percent(value: Option<f64>) -> String {
    value.filter(|v| v.is_finite()).map_or_else(|| "–".to_owned(), |v| format!("{:.2}", 100.0 * v))
}

/// Mean over the repetitions that have a value.
fn mean(outcomes: &[Outcome], of: impl Fn(&Outcome) -> Option<f64>) -> Option<f64> {
    let values: Vec<f64> = outcomes.iter().filter_map(of).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn middle(outcomes: &[Outcome], of: impl Fn(&Outcome) -> f64) -> f64 {
    median(&outcomes.iter().map(of).collect::<Vec<_>>())
}

/// What a sampled ray costs in traced ones; of walks alone.
fn price(outcome: &Outcome, rays: u32) -> Option<f64> {
    (outcome.walked > 0).then(|| (outcome.walk_s / outcome.walked as f64) / (outcome.plain.wall / f64::from(rays)))
}

pub(crate) fn print(
    scene: &str,
    kind: StreamKind,
    size: u32,
    tasks: &[Task],
    truth: &Truth,
    cases: &[Case],
    outcomes: &[Vec<Outcome>],
) -> io::Result<()> {
    let rays: u32 = tasks.iter().map(|task| task.rays).sum();
    let plain: Vec<f64> = outcomes.iter().flatten().map(|o| o.plain.cpu).collect();
    let of = |errors: &Option<EstimateErrors>| percent(errors.map(|e| e.mean_relative));
    writeln!(
        Stdout,
        "{scene}, {kind}: {rays} rays, {} tasks of {size}; plain trace {:.3} s of processor time ({:.2} Mray/s); task time \
         repeats to {}%; exact counts predict it to {}%, with a price of divergence to {}%\n",
        tasks.len(),
        median(&plain),
        f64::from(rays) / median(&plain) / 1e6,
        of(&truth.repeatability),
        of(&truth.counts_as_time),
        of(&truth.with_divergence),
    )?;
    writeln!(
        Stdout,
        "| estimator | sampled % | price of a sample | net overhead % (min – max) | counts: mean % | weighted % | p95 % | \
         bias % | time: mean % | weighted % | p95 % | bias % | in 95% interval % | excess %, {} |",
        MACHINES.map(|(name, _)| name).join(" | ")
    )?;
    writeln!(Stdout, "|{}", "---|".repeat(13 + MACHINES.len()))?;
    for (case, outcomes) in cases.iter().zip(outcomes) {
        let cpu = |s: &Seconds| s.cpu;
        let nets: Vec<f64> = outcomes.iter().map(|o| o.net(cpu)).collect();
        let [low, high] = [f64::min, f64::max].map(|pick| nets.iter().copied().reduce(pick));
        let columns = |errors: fn(&Outcome) -> Option<EstimateErrors>| {
            let value = |of: fn(&EstimateErrors) -> f64| percent(mean(outcomes, |o| errors(o).as_ref().map(of)));
            [value(|e| e.mean_relative), value(|e| e.weighted), value(|e| e.p95), value(|e| e.bias)].join(" | ")
        };
        let prices: Vec<f64> = outcomes.iter().filter_map(|o| price(o, rays)).collect();
        let chosen = outcomes.last().map_or("", |o| o.chosen);
        let name = if case.name == "auto" { format!("auto ({chosen})") } else { case.name.clone() };
        writeln!(
            Stdout,
            "| {name} | {} | {} | {} ({} – {}) | {} | {} | {} | {} |",
            percent(Some(middle(outcomes, |o| o.walked as f64) / f64::from(rays))),
            if prices.is_empty() { "–".to_owned() } else { format!("{:.2}", median(&prices)) },
            percent(Some(median(&nets))),
            percent(low),
            percent(high),
            columns(|o| o.counts),
            columns(|o| o.time),
            percent(mean(outcomes, |o| o.coverage)),
            std::array::from_fn::<_, { MACHINES.len() }, _>(|machine| percent(Some(
                middle(outcomes, |o| o.excess[machine])
            )))
            .join(" | "),
        )?;
    }
    writeln!(Stdout)
}

fn errors(errors: &Option<EstimateErrors>) -> Value {
    errors.as_ref().map_or(
        Value::Null,
        |e| json!({ "mean": e.mean_relative, "weighted": e.weighted, "p95": e.p95, "bias": e.bias, "tasks": e.tasks }),
    )
}

/// Everything that was measured of one scene, kind of rays and task size, repetition by repetition.
pub(crate) fn json(
    scene: &str,
    kind: StreamKind,
    size: u32,
    rays: u32,
    truth: &Truth,
    cases: &[Case],
    outcomes: &[Vec<Outcome>],
) -> Value {
    let seconds = |s: &Seconds| json!({ "wall_s": s.wall, "cpu_s": s.cpu });
    let run = |o: &Outcome| {
        json!({
            "seed": o.seed, "chosen": o.chosen, "walked": o.walked, "plain": seconds(&o.plain),
            "estimate": seconds(&o.estimate), "remaining": seconds(&o.remaining), "walk_s": o.walk_s,
            "net_wall": o.net(|s| s.wall), "net_cpu": o.net(|s| s.cpu),
            "errors_counts": errors(&o.counts), "errors_time": errors(&o.time), "coverage_95": o.coverage, "excess": o.excess,
        })
    };
    let case = |(case, outcomes): (&Case, &Vec<Outcome>)| json!({ "estimator": case.name, "repetitions": outcomes.iter().map(run).collect::<Vec<_>>() });
    json!({
        "scene": scene, "kind": kind.to_string(), "rays": rays, "task_size": size,
        "repeatability": errors(&truth.repeatability),
        "exact_counts_as_time": errors(&truth.counts_as_time),
        "exact_counts_and_divergence_as_time": errors(&truth.with_divergence),
        "task_seconds": truth.seconds,
        "task_tests": truth.tests,
        "cases": cases.iter().zip(outcomes).map(case).collect::<Vec<_>>(),
    })
}
