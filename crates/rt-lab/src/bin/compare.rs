//! Compares queues and policies, each with and without cost initialisation, on one scene: the tables of
//! docs/results/balance.md.
//!
//! `cargo run --release -p rt-lab --bin compare -- --help`
#![forbid(unsafe_code)]

use anyhow::{Context, Result};
use clap::Parser;
use rt_balance::catalogue::{ESTIMATORS, find};
use rt_balance::cpu::CpuDevice;
use rt_balance::report::StreamRun;
use rt_balance::stats::{Summary, median};
use rt_balance::{Balancer, Control, Device, Hit, Limits, Reference, Scheduling, Stream, StreamKind, StreamSpec};
use rt_bvh::Builder;
use rt_lab::arguments;
use rt_lab::contenders::{CONTENDERS, HYBRID};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::output::{Outputs, write_atomically};
use rt_report::print::{Stdout, note};
use rt_scene::prepare::{Options as Prepare, Prepared, prepare};
use rt_scene::streams::{Paths, Wave};
use serde_json::json;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

/// Seed of pixels and bounces; those of samples are the numbers of the runs.
const SEED: u32 = 1;

/// Compare queues and policies, each with and without cost initialisation, on one scene.
#[derive(Debug, Parser)]
#[command(after_help = Exit::HELP)]
struct Options {
    /// A built-in scene (yard, car) or an OBJ file
    scene: PathBuf,
    /// Threads of each CPU device
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_value = "1,1")]
    devices: Vec<usize>,
    /// Tasks that the rays are cut into
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..))]
    tasks: u32,
    /// Interleaved runs; one that is not counted comes first
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    runs: u32,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1600x1000", value_parser = arguments::size)]
    size: [u32; 2],
    /// Rays of a pixel
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
    /// Share of the rays that is sampled where costs are initialised
    #[arg(long, value_name = "F", default_value = "1/64", value_parser = arguments::fraction)]
    fraction: f64,
    /// Take the diffuse rays from the hits of the primary ones
    #[arg(long)]
    diffuse: bool,
    /// Write the report of every run to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn main() -> ExitCode {
    exit::main(|| run(&Options::parse()))
}

fn run(options: &Options) -> Result<()> {
    let outputs = options.json.iter().fold(Outputs::new(), |outputs, path| outputs.file("--json", path));
    let outputs = outputs.scenes([&options.scene]);
    outputs.check()?;
    let scene = prepare(&options.scene, &Prepare::new(Builder::default()), &mut rt_scene::obj::unwatched)?;
    outputs.spare_materials(&scene.libraries)?;
    let devices: Vec<Arc<dyn Device>> =
        CpuDevice::open_all(&options.devices)?.into_iter().map(|device| Arc::new(device) as _).collect();
    let mut balancer = Balancer::new(Arc::clone(&scene.built.scene), &devices)?;
    let provenance = Provenance::now(SEED, balancer.devices().map(|device| device.name.clone()));
    let stream = stream(&scene, options, &mut balancer)?;
    let mut hits = vec![Hit::MISS; stream.source.len() as usize];

    // One uncounted round fills caches and calibrates the devices.
    let mut rounds: Vec<Vec<StreamRun>> = Vec::new();
    let mut references = Vec::new();
    let asked =
        find(ESTIMATORS, "exact").and_then(|entry| entry.with(options.fraction)).context("no such estimator")?;
    // Made once: estimators learn from round to round.
    let mut schedulings = CONTENDERS.each_ref().map(|contender| contender.scheduling(&asked));
    for round in 0..=options.runs {
        let mut runs = Vec::new();
        for scheduling in &mut schedulings {
            let seeded = Stream { seed: round, ..stream.clone() };
            runs.push(balancer.trace(&seeded, scheduling, &mut hits, None, Control::default())?);
        }
        if round > 0 {
            references.push(balancer.reference(&stream, 1, &Limits::default(), Control::default())?);
            rounds.push(runs);
        }
        note(format_args!("round {round} of {}", options.runs));
    }
    let reference = Reference::median(&references).context("no round was run")?;
    rounds.iter_mut().flatten().for_each(|run| reference.judge(run));
    print(&scene, options, &rounds, &reference, &provenance)?;
    if let Some(path) = &options.json {
        let reports: Vec<Vec<_>> =
            rounds.iter().map(|runs| runs.iter().map(|run| &run.report).collect::<Vec<_>>()).collect();
        let file = json!({ "schema": 2, "provenance": provenance, "runs": reports });
        write_atomically(path, |out| Ok(serde_json::to_writer_pretty(out, &file)?))?;
    }
    Ok(())
}

/// The primary rays, or the diffuse rays from their hits.
fn stream(scene: &Prepared, options: &Options, balancer: &mut Balancer) -> Result<Stream> {
    let paths = Paths { samples: options.spp, ..scene.paths(&scene.view(), options.size, SEED)? };
    let camera = paths.primary(&Wave::whole(options.size)?);
    let primary = camera.source.clone();
    let cut = |source: rt_core::RaySource, kind| {
        let size = source.len().div_ceil(options.tasks);
        Stream::new(source, kind, StreamSpec::default()).with_task_size(size)
    };
    if !options.diffuse {
        return Ok(cut(primary, StreamKind::Primary));
    }
    let mut hits = vec![Hit::MISS; primary.len() as usize];
    let stream = cut(primary.clone(), StreamKind::Primary);
    balancer.trace(&stream, &mut Scheduling::default(), &mut hits, None, Control::default())?;
    let [_, diffuse] = paths.follow(&camera, &hits);
    Ok(cut(diffuse.source, diffuse.kind))
}

fn print(
    scene: &Prepared,
    options: &Options,
    rounds: &[Vec<StreamRun>],
    reference: &Reference,
    provenance: &Provenance,
) -> io::Result<()> {
    let first = &rounds[0][0].report;
    writeln!(Stdout, "{provenance}")?;
    writeln!(
        Stdout,
        "{}: {} rays ({}), {} tasks, {} devices, lower bound {:.3} s, medians of {} interleaved runs\n",
        scene.name,
        first.rays,
        first.kind,
        first.tasks,
        options.devices.len(),
        reference.lower_bound_s,
        rounds.len()
    )?;
    writeln!(
        Stdout,
        "| queue | makespan s (min – max) | % of {} [interval] | imbalance % | excess % | overhead % | error vs counts % | vs \
         time % |",
        HYBRID.name
    )?;
    writeln!(Stdout, "|---|---|---|---|---|---|---|---|")?;
    let rival = CONTENDERS.iter().position(|contender| contender.name == HYBRID.name).unwrap_or_default();
    let rival: Vec<f64> = rounds.iter().map(|runs| runs[rival].report.makespan_s).collect();
    for (index, config) in CONTENDERS.iter().enumerate() {
        let values = |of: &dyn Fn(&StreamRun) -> Option<f64>| -> Vec<f64> {
            rounds.iter().filter_map(|runs| of(&runs[index])).collect()
        };
        let percent = |of: &dyn Fn(&StreamRun) -> Option<f64>| format!("{:.2}", 100.0 * median(&values(of)));
        let makespan = values(&|run| Some(run.report.makespan_s));
        let [low, high] = [f64::min, f64::max].map(|pick| makespan.iter().copied().reduce(pick).unwrap_or(f64::NAN));
        let ratio = Summary::of_ratios(&makespan, &rival);
        writeln!(
            Stdout,
            "| {} | {:.3} ({low:.3} – {high:.3}) | {:.1} [{:.1} – {:.1}] | {} | {} | {} | {} | {} |",
            config.name,
            median(&makespan),
            100.0 * ratio.median,
            100.0 * ratio.low,
            100.0 * ratio.high,
            percent(&|run| run.report.imbalance),
            percent(&|run| run.report.excess),
            percent(&|run| run.report.estimate.overhead),
            percent(&|run| run.report.estimate.mre_counts),
            percent(&|run| run.report.estimate.mre_time),
        )?;
    }
    Ok(())
}
