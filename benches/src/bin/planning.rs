//! Times scheduling alone: LPT, the making of a hybrid queue, its operations, and the lower bound, on one core.
//!
//! `cargo run --release -p rt-benches --bin planning -- --help`
#![forbid(unsafe_code)]

use clap::Parser;
use rt_balance::stats::median;
use rt_core::{CostModel, Work, random};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::print::Stdout;
use rt_sched::bound;
use rt_sched::policy::{Lpt, Policy};
use rt_sched::queue::{HybridQueue, Pop, TaskQueue};
use std::error::Error;
use std::hint::black_box;
use std::io::Write;
use std::process::ExitCode;
use std::time::Instant;

/// Time scheduling alone, on one core: LPT, hybrid queues and their operations, the lower bound.
#[derive(Debug, Parser)]
#[command(after_help = Exit::HELP)]
struct Options {
    /// Repetitions, of which medians are shown
    #[arg(long, default_value_t = 11, value_parser = clap::value_parser!(u32).range(1..), value_name = "N")]
    repeat: u32,
}

fn main() -> ExitCode {
    exit::main(run)
}

fn run() -> Result<(), Box<dyn Error>> {
    let Options { repeat } = Options::parse();
    writeln!(Stdout, "{}", Provenance::now(1, ["one thread"]))?;
    writeln!(Stdout, "| tasks × devices | speeds | LPT ms (min) | hybrid queue ms (min) |")?;
    writeln!(Stdout, "|---|---|---|---|")?;
    for (tasks, devices) in [(4_096, 3), (65_536, 8), (1_000_000, 1_024)] {
        let work: Vec<Work> = (0..tasks).map(task).collect();
        for (label, speeds) in [("equal", &[1.0][..]), ("1:2:4", &[1.0, 2.0, 4.0])] {
            let models: Vec<CostModel> = (0..devices).filter_map(|d| model(speeds[d % speeds.len()])).collect();
            let schedule = Lpt.schedule(&work, &models);
            let lpt = time(repeat, || drop(black_box(Lpt.schedule(black_box(&work), &models))));
            let queue = time(repeat, || drop(black_box(HybridQueue::new(&schedule, black_box(&work), &models))));
            writeln!(Stdout, "| {tasks} × {devices} | {label} | {} | {} |", show(&lpt), show(&queue))?;
        }
    }
    writeln!(Stdout, "\n| devices | µs for a pop |\n|---|---|")?;
    for devices in [3, 64, 1_024, 10_000] {
        let runs: Vec<f64> = (0..repeat).map(|_| pop_us(devices)).collect();
        writeln!(Stdout, "| {devices} | {:.3} |", median(&runs))?;
    }
    let costs: Vec<f64> = (0..1_000_000).map(|i| f64::from(task(i).tests())).collect();
    let bound = time(repeat, || _ = black_box(bound::related(&costs, &[1.0; 8])));
    writeln!(Stdout, "\nbound of 1,000,000 tasks on 8 devices: {} ms", show(&bound))?;
    Ok(())
}

/// Mean microseconds of a `pop`, over a run in which devices take turns.
fn pop_us(devices: usize) -> f64 {
    let work: Vec<Work> = (0..100_000).map(|index| task(index).with_std_error(0.0)).collect();
    let models: Vec<CostModel> = (0..devices).filter_map(|_| model(1.0)).collect();
    let queue = HybridQueue::new(&Lpt.schedule(&work, &models), &work, &models);
    let (mut pops, mut seconds, mut left) = (0_u32, 0.0, work.len());
    let mut out = Vec::new();
    for device in (0..devices).cycle() {
        let begin = Instant::now();
        let launch = queue.pop(device, &mut out) == Pop::Launch;
        seconds += begin.elapsed().as_secs_f64();
        pops += 1;
        if launch {
            queue.finish(device, &out);
            left -= out.len();
        } else if left == 0 {
            break;
        }
    }
    seconds * 1e6 / f64::from(pops)
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

fn time(repeat: u32, work: impl Fn()) -> Vec<f64> {
    let once = |_| {
        let begin = Instant::now();
        work();
        begin.elapsed().as_secs_f64() * 1e3
    };
    (0..repeat).map(once).collect()
}

fn show(milliseconds: &[f64]) -> String {
    let least = milliseconds.iter().copied().fold(f64::INFINITY, f64::min);
    format!("{:.3} ({least:.3})", median(milliseconds))
}
