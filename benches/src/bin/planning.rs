//! Times scheduling alone: LPT and the making of a hybrid queue, on one core.
//!
//! `cargo run --release -p rt-benches --bin planning`
#![forbid(unsafe_code)]

use rt_balance::stats::median;
use rt_core::{CostModel, Work, random};
use rt_report::print::Stdout;
use rt_report::{Provenance, exit};
use rt_sched::policy::{Lpt, Policy};
use rt_sched::queue::HybridQueue;
use std::error::Error;
use std::hint::black_box;
use std::io::Write;
use std::process::ExitCode;
use std::time::Instant;

/// Repetitions, of which the median is shown.
const RUNS: usize = 11;

fn main() -> ExitCode {
    exit::main(run)
}

fn run() -> Result<(), Box<dyn Error>> {
    writeln!(Stdout, "{}", Provenance::now(1, ["one thread"]))?;
    writeln!(Stdout, "| tasks × devices | speeds | LPT ms (min) | hybrid queue ms (min) |")?;
    writeln!(Stdout, "|---|---|---|---|")?;
    for (tasks, devices) in [(4_096, 3), (65_536, 8), (1_000_000, 1_024)] {
        let work: Vec<Work> = (0..tasks).map(task).collect();
        for (label, speeds) in [("equal", &[1.0][..]), ("1:2:4", &[1.0, 2.0, 4.0])] {
            let models: Vec<CostModel> = (0..devices).filter_map(|d| model(speeds[d % speeds.len()])).collect();
            let schedule = Lpt.schedule(&work, &models);
            let lpt = time(|| drop(black_box(Lpt.schedule(black_box(&work), &models))));
            let queue = time(|| drop(black_box(HybridQueue::new(&schedule, black_box(&work), &models))));
            writeln!(Stdout, "| {tasks} × {devices} | {label} | {} | {} |", show(&lpt), show(&queue))?;
        }
    }
    Ok(())
}

/// Work like a picture's: most tasks cheap, some a hundred times as expensive.
fn task(index: u32) -> Work {
    let [a, b] = random::pair(1, index, 0);
    let tests = 1024.0 * (4.0 + 400.0 * a.powi(6));
    Work::new(1024.0, tests, tests * 0.3 * b)
}

fn model(speed: f64) -> Option<CostModel> {
    CostModel::new(1e-5, 5e-9 / speed, 1e-9 / speed, 2e-9 / speed)
}

fn time(work: impl Fn()) -> Vec<f64> {
    let once = |_| {
        let begin = Instant::now();
        work();
        begin.elapsed().as_secs_f64() * 1e3
    };
    (0..RUNS).map(once).collect()
}

fn show(milliseconds: &[f64]) -> String {
    let least = milliseconds.iter().copied().fold(f64::INFINITY, f64::min);
    format!("{:.3} ({least:.3})", median(milliseconds))
}
