//! Measures what estimating costs and how wrong it is: the tables of docs/results/estimation.md.
//!
//! `cargo run --release -p rt-lab --bin estimation -- SCENE... [--kinds primary,diffuse] [--size 1024x1024]
//! [--task-sizes 1024,64] [--repetitions 7] [--only NAME,...] [--quick] [--json FILE]`
//!
//! A scene is `yard`, `car` or an OBJ file. One CPU device of one thread; the kernel is the one that renders.
//!
//! * **Truth.** Exact counts of every task, from the layout that traces. Seconds of every task, one task per launch, thread
//!   time, the median of several passes. The task time's own repeatability stands beside: the same error measure between
//!   the medians of the even and of the odd passes.
//! * **Errors** per task after one common scale, against counts and against seconds. Seconds are predicted by prices fitted
//!   on the other half of the tasks. Averaged over repetitions, each with a seed of its own.
//! * **Excess** over the lower bound of a hybrid queue on m virtual devices, estimation included, replayed with task times of
//!   passes that no price was fitted to; `uniform` is the queue that knows nothing.
//! * **Net overhead** = (estimate + remaining trace − plain trace of all rays) / plain trace, hits of full walks kept, each
//!   repetition right after a plain trace of its own. From the processor time of the process, so that other programs count
//!   little; the wall's is in the JSON.
#![forbid(unsafe_code)]

mod measure;
mod options;
mod table;
mod truth;

use measure::{Case, Outcome};
use options::Options;
use rt_balance::clock;
use rt_balance::cpu::CpuDevice;
use rt_core::{Device, Launch, RaySource, StreamKind, StreamSpec, Tracer, tasks_of};
use rt_lab::DEFAULT_BUILDER;
use rt_report::exit;
use rt_report::print::{Stdout, note};
use rt_scene::prepare::{Options as Prepare, Prepared, prepare};
use rt_scene::streams::Wave;
use serde_json::{Value, json};
use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;
use truth::Truth;

/// Longest wait for a launch.
pub(crate) const LIMIT: Duration = Duration::from_secs(600);

fn main() -> ExitCode {
    exit::main(run)
}

fn run() -> Result<(), Box<dyn Error>> {
    let options = Options::parse()?;
    let mut results = Vec::new();
    writeln!(Stdout, "command: {}\n", std::env::args().skip(1).collect::<Vec<_>>().join(" "))?;
    for name in &options.scenes {
        let scene = prepare(Path::new(name), &Prepare::new(DEFAULT_BUILDER), &mut rt_scene::obj::unwatched)?;
        let devices = CpuDevice::open_all(&[1])?;
        let device = devices.first().ok_or("no CPU device")?;
        for &kind in &options.kinds {
            let mut tracer = device.tracer(Arc::clone(&scene.built.scene), clock)?;
            let source = rays(&scene, &options, kind, &mut *tracer)?;
            for &size in &options.task_sizes {
                results.push(one(&scene.name, &options, &mut *tracer, kind, &source, size)?);
            }
        }
    }
    if let Some(path) = &options.json {
        let command: Vec<String> = std::env::args().skip(1).collect();
        std::fs::write(path, serde_json::to_string_pretty(&json!({ "command": command, "results": results }))?)?;
    }
    Ok(())
}

/// All rays of one kind; diffuse ones start at the hits of the primary ones.
fn rays(
    scene: &Prepared,
    options: &Options,
    kind: StreamKind,
    tracer: &mut dyn Tracer,
) -> Result<RaySource, Box<dyn Error>> {
    let paths = scene.paths(&scene.view(), options.size, 1)?;
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
) -> Result<Value, Box<dyn Error>> {
    let tasks = tasks_of(source.len(), size);
    note(format_args!("{scene}, {kind}, {} rays in tasks of {size}", source.len()));
    let truth = Truth::measure(tracer, source, &tasks, options.passes)?;
    tracer.load_rays(source.clone(), StreamSpec::default())?;
    let mut cases = Case::list(options);
    let mut outcomes: Vec<Vec<Outcome>> = vec![Vec::new(); cases.len()];
    // The first repetition fills caches and teaches estimators that learn; it is not counted.
    for repetition in 0..=options.repetitions as u32 {
        for (case, outcomes) in cases.iter_mut().zip(&mut outcomes) {
            let outcome = case.run(tracer, source, kind, &tasks, repetition, &truth)?;
            if repetition > 0 {
                outcomes.push(outcome);
            }
        }
        note(format_args!("repetition {repetition} of {}", options.repetitions));
    }
    table::print(scene, kind, size, &tasks, &truth, &cases, &outcomes)?;
    Ok(table::json(scene, kind, size, source.len(), &truth, &cases, &outcomes))
}
