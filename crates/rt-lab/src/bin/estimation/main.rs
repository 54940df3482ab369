//! Measures what estimating costs and how wrong it is: the tables of docs/results/estimation.md.
//!
//! `cargo run --release -p rt-lab --bin estimation -- --help`
//!
//! One CPU device of one thread; the kernel is the one that renders.
//!
//! * **Truth.** Exact counts of every task, from the layout that traces. Seconds of every task, one task per launch,
//!   thread time, the median of several passes. The task time's own repeatability stands beside: the same error measure
//!   between the medians of the even and of the odd passes.
//! * **Errors** per task after one common scale, against counts and against seconds. Seconds are predicted by prices
//!   fitted on the other half of the tasks. Averaged over repetitions, each with a seed of its own.
//! * **Excess** over the lower bound of a hybrid queue on m virtual devices, estimation included, replayed with task
//!   times of passes that no price was fitted to; `uniform` is the queue that knows nothing.
//! * **Net overhead** = (estimate + remaining trace − plain trace of all rays) / plain trace, hits of full walks kept,
//!   each repetition right after a plain trace of its own. From the processor time of the process, so that other
//!   programs count little; the wall's is in the JSON.
#![forbid(unsafe_code)]

mod measure;
mod options;
mod summary;
mod table;
mod truth;

use anyhow::{Context, Result};
use clap::Parser;
use measure::{Case, Outcome};
use options::Options;
use rt_balance::clock;
use rt_balance::cpu::CpuDevice;
use rt_bvh::Builder;
use rt_core::{Device, Launch, RaySource, StreamKind, StreamSpec, Tracer, tasks_of};
use rt_report::Provenance;
use rt_report::exit;
use rt_report::output::{Outputs, write_atomically};
use rt_report::print::{Stdout, note};
use rt_scene::prepare::{Options as Prepare, Prepared, prepare};
use rt_scene::streams::Wave;
use serde_json::{Value, json};
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;
use truth::Truth;

/// Seed of pixels and bounces; those of samples are the numbers of the repetitions.
const SEED: u32 = 1;

/// Longest wait for a launch.
pub(crate) const LIMIT: Duration = Duration::from_secs(600);

fn main() -> ExitCode {
    exit::main(|| run(&Options::parse()))
}

fn run(options: &Options) -> Result<()> {
    let options = &options.clone().adjusted();
    let mut outputs = Outputs::new().scenes(&options.scenes);
    for (option, path) in [("--json", &options.json), ("--summary", &options.summary)] {
        outputs = path.iter().fold(outputs, |outputs, path| outputs.file(option, path));
    }
    outputs.check()?;
    Case::check(options)?;
    let mut results = Vec::new();
    let devices = CpuDevice::open_all(&[1])?;
    let device = devices.first().context("no CPU device")?;
    let provenance = Provenance::now(SEED, [device.info().name.clone()]);
    writeln!(Stdout, "{provenance}")?;
    for name in &options.scenes {
        let scene = prepare(name, &Prepare::new(Builder::default()), &mut rt_scene::obj::unwatched)?;
        outputs.spare_materials(&scene.libraries)?;
        for &kind in &options.kinds {
            let mut tracer = device.tracer(Arc::clone(&scene.built.scene), clock)?;
            let source = rays(&scene, options, kind, &mut *tracer)?;
            for &size in &options.task_sizes {
                results.push(one(&scene.name, options, &mut *tracer, kind, &source, size)?);
            }
        }
    }
    if let Some(path) = &options.json {
        let file = json!({ "schema": 2, "provenance": provenance, "results": results });
        write_atomically(path, |out| Ok(serde_json::to_writer_pretty(out, &file)?))?;
    }
    if let Some(path) = &options.summary {
        write_atomically(path, |out| Ok(write!(out, "{provenance}{}", summary::tables(&results))?))?;
    }
    Ok(())
}

/// All rays of one kind; diffuse ones start at the hits of the primary ones.
fn rays(scene: &Prepared, options: &Options, kind: StreamKind, tracer: &mut dyn Tracer) -> Result<RaySource> {
    let paths = scene.paths(&scene.view(), options.size, SEED)?;
    let camera = paths.primary(&Wave::whole(options.size)?);
    let primary = camera.source.clone();
    if kind == StreamKind::Primary {
        return Ok(primary);
    }
    tracer.load_rays(primary.clone(), StreamSpec::default())?;
    let mut launch = Launch::default();
    let ticket = tracer.submit(&tasks_of(primary.len(), 1024), None)?;
    tracer.wait(ticket, LIMIT, &mut launch)?;
    let [_, diffuse] = paths.follow(&camera, &launch.hits);
    Ok(diffuse.source)
}

/// One scene, kind of rays and task size.
fn one(
    scene: &str,
    options: &Options,
    tracer: &mut dyn Tracer,
    kind: StreamKind,
    source: &RaySource,
    size: u32,
) -> Result<Value> {
    let tasks = tasks_of(source.len(), size);
    note(format_args!("{scene}, {kind}, {} rays in tasks of {size}", source.len()));
    let truth = Truth::measure(tracer, source, &tasks, options.passes as usize)?;
    tracer.load_rays(source.clone(), StreamSpec::default())?;
    let mut cases = Case::list(options);
    let mut outcomes: Vec<Vec<Outcome>> = vec![Vec::new(); cases.len()];
    // The first repetition fills caches and teaches estimators that learn; it is not counted.
    for repetition in 0..=options.repeat {
        for (case, outcomes) in cases.iter_mut().zip(&mut outcomes) {
            let outcome = case.run(tracer, source, kind, &tasks, repetition, &truth)?;
            if repetition > 0 {
                outcomes.push(outcome);
            }
        }
        note(format_args!("repetition {repetition} of {}", options.repeat));
    }
    table::print(scene, kind, size, &tasks, &truth, &cases, &outcomes)?;
    Ok(table::json(scene, kind, size, source.len(), &truth, &cases, &outcomes))
}
