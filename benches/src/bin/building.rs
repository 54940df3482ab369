//! Times the tree builders on all cores beside Embree's default one, where its library is found, in turns.
//!
//! `cargo run --release -p rt-benches --bin building -- --help`
//!
//! `large:` makes a scene of so many triangles. `RAYON_NUM_THREADS` limits our threads, `taskset` both's. Ours is the
//! whole call, from a mesh to a checked scene; Embree's makes a device, copies the mesh and commits the scene.
//! Processor time stands beside wall time, since others on the machine disturb it less.
#![forbid(unsafe_code)]

use clap::Parser;
use embree4_sys::{RTCBuildQuality, RTCSceneFlags};
use rt_balance::stats::median;
use rt_benches::{large, options};
use rt_bvh::{BuildOptions, Builder, Mesh, TreeStats, build};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::print::{Stdout, note};
use std::error::Error;
use std::io::Write;
use std::process::ExitCode;
use std::time::Instant;

/// Time the tree builders on all cores beside Embree's default one.
///
/// A scene may be large:TRIANGLES, which makes one of so many.
#[derive(Debug, Parser)]
#[command(after_help = Exit::HELP)]
struct Options {
    #[command(flatten)]
    common: options::Options,
    /// Tree builders: sah, or ploc-fastest, -very-fast, -fast, -medium, -slow, -very-slow
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', default_values_t = [Builder::default()])]
    builders: Vec<Builder>,
}

fn main() -> ExitCode {
    exit::main(run_all)
}

fn run_all() -> Result<(), Box<dyn Error>> {
    let Options { common, builders } = Options::parse();
    write!(Stdout, "{}", Provenance::now(1, ["all threads"]))?;
    writeln!(Stdout, "\nMedians of {} repetitions in turns; over Embree: its time divided by ours.\n", common.repeat)?;
    writeln!(
        Stdout,
        "| scene | triangles | builder | threads | ms | Mtriangles/s | over Embree | processor ms | over Embree | \
         expected cost |\n|---|---|---|---|---|---|---|---|---|---|"
    )?;
    for name in &common.scenes {
        bench(name, &builders, common.repeat)?;
    }
    Ok(())
}

/// Wall and processor seconds of each run.
#[derive(Default)]
struct Times([Vec<f64>; 2]);

impl Times {
    fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (begin, used) = (Instant::now(), processor_s());
        let done = work();
        self.0[0].push(begin.elapsed().as_secs_f64());
        self.0[1].push(processor_s() - used);
        done
    }

    /// How often these go into those of another, pair by pair, so that a machine whose speed drifts compares neighbours
    /// in time.
    fn under(&self, others: &Self) -> [f64; 2] {
        [0, 1].map(|i| median(&others.0[i].iter().zip(&self.0[i]).map(|(them, us)| them / us).collect::<Vec<_>>()))
    }

    fn medians(&self) -> [f64; 2] {
        [0, 1].map(|i| median(&self.0[i]))
    }
}

fn bench(name: &str, builders: &[Builder], repeat: u32) -> Result<(), Box<dyn Error>> {
    let model = large::open(name)?;
    let mesh = Mesh { positions: &model.positions, indices: &model.indices };
    let vertices: Vec<[f32; 3]> = model.positions.iter().map(|p| p.to_array()).collect();
    let embree =
        || embree4_sys::Mesh::new(&vertices, &model.indices, RTCSceneFlags::ROBUST, RTCBuildQuality::MEDIUM).map(drop);
    let missing = embree().err();
    if let Some(reason) = &missing {
        note(format_args!("{name}: without Embree: {reason}"));
    }
    let mut theirs = Times::default();
    let mut ours: Vec<_> = builders.iter().map(|_| (Times::default(), 0.0, 0)).collect();
    for _ in 0..repeat {
        if missing.is_none() {
            theirs.time(embree)?;
        }
        for ((times, cost, threads), &builder) in ours.iter_mut().zip(builders) {
            let built = times.time(|| build(mesh, &BuildOptions { builder, ..BuildOptions::default() }))?;
            (*cost, *threads) = (TreeStats::of(&built.scene).sah_cost, built.report.threads);
        }
    }
    let triangles = model.indices.len() as f64;
    let row = |builder: &str, threads: &str, times: &Times, over: [String; 2], cost: &str| {
        let ([wall, processor], [over, over_processor]) = (times.medians(), over);
        writeln!(
            Stdout,
            "| {name} | {triangles} | {builder} | {threads} | {:.0} | {:.2} | {over} | {:.0} | {over_processor} | {cost} |",
            1e3 * wall,
            triangles / wall / 1e6,
            1e3 * processor,
        )
    };
    let none = || [String::new(), String::new()];
    if missing.is_none() {
        row("Embree", "", &theirs, none(), "")?;
    }
    for (builder, (times, cost, threads)) in builders.iter().zip(&ours) {
        let over = missing.as_ref().map_or_else(|| times.under(&theirs).map(|over| format!("{over:.2}")), |_| none());
        row(builder.name(), &threads.to_string(), times, over, &format!("{cost:.2}"))?;
    }
    Ok(())
}

/// Processor seconds of all threads so far.
#[cfg(unix)]
fn processor_s() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

#[cfg(not(unix))]
fn processor_s() -> f64 {
    f64::NAN
}
