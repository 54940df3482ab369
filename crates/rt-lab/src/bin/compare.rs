//! Compares queues and policies, each with and without cost initialisation, on one scene: the table of
//! docs/results/balance.md.
//!
//! `cargo run --release -p rt-lab --bin compare -- SCENE [--devices 1,1] [--tasks 256] [--runs 7]
//! [--size 1600x1000] [--spp 8] [--fraction 1/64] [--diffuse] [--json FILE]`
#![forbid(unsafe_code)]

use rt_balance::catalogue::{ESTIMATORS, find};
use rt_balance::cpu::CpuDevice;
use rt_balance::report::StreamRun;
use rt_balance::stats::{Summary, median};
use rt_balance::{Balancer, Control, Device, Hit, Limits, Reference, Scheduling, Stream, StreamKind, StreamSpec};
use rt_lab::DEFAULT_BUILDER;
use rt_lab::contenders::{CONTENDERS, HYBRID};
use rt_report::exit;
use rt_report::print::{Stdout, note};
use rt_scene::prepare::{Options as Prepare, Prepared, prepare};
use rt_scene::streams::{Paths, Wave};
use rt_sched::sample::Fraction;
use std::error::Error;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

struct Options {
    scene: String,
    devices: Vec<usize>,
    tasks: u32,
    runs: usize,
    size: [u32; 2],
    spp: u32,
    fraction: Fraction,
    diffuse: bool,
    json: Option<String>,
}

fn main() -> ExitCode {
    exit::main(run)
}

fn run() -> Result<(), Box<dyn Error>> {
    let options = Options::parse()?;
    let scene = prepare(Path::new(&options.scene), &Prepare::new(DEFAULT_BUILDER), &mut rt_scene::obj::unwatched)?;
    let devices: Vec<Arc<dyn Device>> =
        CpuDevice::open_all(&options.devices)?.into_iter().map(|device| Arc::new(device) as _).collect();
    let mut balancer = Balancer::new(Arc::clone(&scene.built.scene), &devices)?;
    let stream = stream(&scene, &options, &mut balancer)?;
    let mut hits = vec![Hit::MISS; stream.source.len() as usize];

    // One uncounted round fills caches and calibrates the devices.
    let mut rounds: Vec<Vec<StreamRun>> = Vec::new();
    let mut references = Vec::new();
    let asked =
        find(ESTIMATORS, "exact").and_then(|entry| entry.sampling(options.fraction)).ok_or("no such estimator")?;
    // Made once: estimators learn from round to round.
    let mut schedulings = CONTENDERS.each_ref().map(|contender| contender.scheduling(&asked));
    for round in 0..=options.runs {
        let mut runs = Vec::new();
        for scheduling in &mut schedulings {
            let seeded = Stream { seed: round as u32, ..stream.clone() };
            runs.push(balancer.trace(&seeded, scheduling, &mut hits, None, Control::default())?);
        }
        if round > 0 {
            references.push(balancer.reference(&stream, 1, &Limits::default(), Control::default())?);
            rounds.push(runs);
        }
        note(format_args!("round {round} of {}", options.runs));
    }
    let reference = Reference::median(&references).ok_or("no round was run")?;
    rounds.iter_mut().flatten().for_each(|run| reference.judge(run));
    print(&scene, &options, &rounds, &reference)?;
    if let Some(path) = &options.json {
        let reports: Vec<Vec<_>> =
            rounds.iter().map(|runs| runs.iter().map(|run| &run.report).collect::<Vec<_>>()).collect();
        std::fs::write(path, serde_json::to_string_pretty(&reports)?)?;
    }
    Ok(())
}

/// The primary rays, or the diffuse rays from their hits.
fn stream(scene: &Prepared, options: &Options, balancer: &mut Balancer) -> Result<Stream, Box<dyn Error>> {
    let paths = Paths { samples: options.spp, ..scene.paths(&scene.view(), options.size, 1)? };
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

fn print(scene: &Prepared, options: &Options, rounds: &[Vec<StreamRun>], reference: &Reference) -> io::Result<()> {
    let first = &rounds[0][0].report;
    writeln!(Stdout, "command: {}\n", std::env::args().skip(1).collect::<Vec<_>>().join(" "))?;
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

impl Options {
    fn parse() -> Result<Self, Box<dyn Error>> {
        let mut options = Self {
            scene: String::new(),
            devices: vec![1, 1],
            tasks: 256,
            runs: 7,
            size: [1600, 1000],
            spp: 8,
            fraction: Fraction::new(1.0 / 64.0).ok_or("1/64 is a fraction")?,
            diffuse: false,
            json: None,
        };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            match argument.as_str() {
                "--devices" => options.devices = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?,
                "--tasks" => options.tasks = value()?.parse::<u32>()?.max(1),
                "--runs" => options.runs = value()?.parse::<usize>()?.max(1),
                "--spp" => options.spp = value()?.parse::<u32>()?.max(1),
                "--size" => {
                    let text = value()?;
                    let (width, height) = text.split_once('x').ok_or("--size WIDTHxHEIGHT")?;
                    options.size = [width.parse()?, height.parse()?];
                }
                "--fraction" => {
                    let text = value()?;
                    let (over, under) = text.split_once('/').unwrap_or((&text, "1"));
                    let fraction = Fraction::new(over.parse::<f64>()? / under.parse::<f64>()?);
                    options.fraction = fraction.ok_or("--fraction from 1/4096 to 1")?;
                }
                "--diffuse" => options.diffuse = true,
                "--json" => options.json = Some(value()?),
                scene if !scene.starts_with('-') => options.scene = scene.to_owned(),
                other => return Err(format!("unknown option {other}").into()),
            }
        }
        if options.scene.is_empty() {
            return Err("name a scene: yard, car, or an OBJ file".into());
        }
        Ok(options)
    }
}
