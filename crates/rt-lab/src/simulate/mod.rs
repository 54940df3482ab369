//! `raybalance simulate`: machines that are not there, played from task times that were measured.
//!
//! The queues, policies and decisions are those of real runs, on the virtual clock of [`rt_sched::simulate`]; between
//! nodes those of [`rt_cluster::simulate`].

mod machine;
mod recording;
mod strategies;
mod write;

use crate::Lab;
use crate::subject::Subject;
use anyhow::Result;
use machine::{Machine, Outcome};
use recording::Recording;
use rt_balance::Stream;
use rt_balance::cpu::CpuDevice;
use rt_core::Device;
use rt_report::Provenance;
use rt_report::output::Outputs;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use strategies::Strategy;

/// What to play.
#[derive(Clone, Debug)]
pub struct Options {
    /// A built-in scene or an OBJ file, whose streams are measured on one core.
    pub scene: PathBuf,
    /// A `report.json` of a run with a reference pass, whose task times are taken instead.
    pub from: Option<PathBuf>,
    /// Numbers of devices of a node; none: only the runs of the report are played again, or as suits a scene.
    pub devices: Vec<u32>,
    /// Speeds of the devices in turn, 1 being that of the device that was measured.
    pub speeds: Vec<f64>,
    /// Numbers of nodes.
    pub nodes: Vec<u32>,
    /// Seconds that a launch costs a device beside its tasks; `None`: as measured.
    pub launch_s: Option<f64>,
    /// Seconds until a claim is answered: of a launch on one node, which another one in flight hides; with several
    /// nodes that of a message.
    pub claim_s: f64,
    /// Rays of a task of the scene; `None`: as suits rays and devices.
    pub task_size: Option<u32>,
    /// Size of the scene's picture in pixels, one ray each.
    pub size: [u32; 2],
    /// Seed of samples, pixels and bounces.
    pub seed: u32,
    /// Folder of what is written.
    pub out: PathBuf,
}

/// Everything that was played: what simulate.json holds.
#[derive(Debug, Serialize)]
struct Results {
    /// Layout of the file; changes when a field changes its meaning or goes away.
    schema: u32,
    provenance: Provenance,
    /// The scene or report that task times are from.
    source: String,
    machines: Vec<Played>,
    /// Real runs played again, each beside what it took.
    checks: Vec<Check>,
}

/// All strategies on one machine.
#[derive(Debug, Serialize)]
struct Played {
    machine: Machine,
    /// What was traced, one entry for each stream.
    streams: Vec<StreamPlayed>,
    /// All streams together, one entry for each strategy.
    strategies: Vec<StrategyPlayed>,
}

/// A stream on a machine.
#[derive(Debug, Serialize)]
struct StreamPlayed {
    kind: String,
    frame: u32,
    tasks: usize,
    rays: u64,
    lower_bound_s: f64,
    /// In the order of the strategies; null where what one has to know was not measured.
    outcomes: Vec<Option<Outcome>>,
}

/// A strategy on a machine, over all streams.
#[derive(Debug, Serialize)]
struct StrategyPlayed {
    name: &'static str,
    /// `None` (null) where what it has to know was not measured.
    outcome: Option<Outcome>,
    /// Makespans over lower bounds − 1.
    excess: Option<f64>,
}

/// A real run that was played again.
#[derive(Debug, Serialize)]
struct Check {
    stream: String,
    frame: u32,
    devices: Vec<String>,
    real_s: f64,
    simulated_s: f64,
    /// Simulated over real − 1.
    error: f64,
}

/// Plays all machines that are asked for, and the runs of a report; prints and writes what came of it.
///
/// # Errors
/// When the scene or report cannot be read, the report holds no task times, the core fails, or an output cannot be
/// written.
pub fn run(lab: Lab<'_>, options: &Options) -> Result<()> {
    let outputs = Outputs::new().folder("--out", &options.out, write::FILES);
    let outputs = match &options.from {
        Some(report) => outputs.input("--from", report),
        None => outputs.scenes([&options.scene]),
    };
    outputs.check()?;
    let results = match &options.from {
        Some(report) => of_report(lab, options, report)?,
        None => of_scene(lab.writing(&outputs), options)?,
    };
    lab.show.finish();
    write::all(lab, &options.out, &results)
}

/// Numbers of devices where none is asked for and no real run is there to be played again.
const DEVICES: [u32; 3] = [3, 8, 64];

/// Each number of devices on each number of nodes.
fn machines(options: &Options, devices: &[u32]) -> Vec<Machine> {
    let each = options.nodes.iter().flat_map(|&nodes| devices.iter().map(move |&devices| (nodes, devices)));
    let machine = |(nodes, devices)| Machine {
        nodes,
        speeds: options.speeds.iter().copied().cycle().take(devices as usize).collect(),
        launch_s: options.launch_s,
        claim_s: options.claim_s,
    };
    each.map(machine).collect()
}

fn of_report(lab: Lab<'_>, options: &Options, path: &Path) -> Result<Results> {
    let report = recording::read(path)?;
    let checks = report.recordings.iter().filter_map(|recording| recording.check(options.claim_s)).collect();
    let mut played = Vec::new();
    for machine in machines(options, &options.devices) {
        lab.go_on()?;
        played.push(play(machine, &report.recordings));
    }
    let source = format!("{}, a run of {}", path.display(), report.scene);
    let provenance = Provenance::now(None, report.devices);
    Ok(Results { schema: 1, provenance, source, machines: played, checks })
}

fn of_scene(lab: Lab<'_>, options: &Options) -> Result<Results> {
    let core = CpuDevice::open_all(&[1])?.into_iter().map(|device| Arc::new(device) as Arc<dyn Device>);
    let mut subject = Subject::open(lab, &options.scene, &core.collect::<Vec<_>>())?;
    let seed = options.seed;
    let streams = subject.streams(options.size, seed)?.map(|stream| Stream { seed, ..stream });
    // Machines whose streams are cut alike need no other measurement.
    let mut measured: Vec<(Vec<u32>, Vec<Recording>)> = Vec::new();
    let mut played = Vec::new();
    let devices = if options.devices.is_empty() { &DEVICES[..] } else { &options.devices };
    let machines = machines(options, devices);
    for (index, machine) in machines.iter().enumerate() {
        lab.show.progress("measuring and playing", index as f64 / machines.len() as f64);
        let cut = |stream: &Stream| match options.task_size {
            Some(rays) => stream.clone().with_task_size(rays),
            None => stream.clone().with_tasks_for(machine.speeds.len()),
        };
        let cut: Vec<Stream> = streams.iter().filter(|stream| !stream.source.is_empty()).map(cut).collect();
        let sizes: Vec<u32> = cut.iter().map(|stream| stream.tasks[0].rays).collect();
        if !measured.iter().any(|(known, _)| *known == sizes) {
            let recordings: Result<Vec<Recording>> =
                cut.iter().map(|stream| Recording::measure(&mut subject, stream)).collect();
            measured.push((sizes.clone(), recordings?));
        }
        let recordings = measured.iter().find(|(known, _)| *known == sizes).map_or(&[][..], |(_, found)| found);
        played.push(play(machine.clone(), recordings));
    }
    let provenance = Provenance::now(seed, subject.devices());
    let source = format!("{}, measured on {}", subject.name(), subject.devices().join(", "));
    Ok(Results { schema: 1, provenance, source, machines: played, checks: Vec::new() })
}

/// Every strategy on one machine, stream after stream.
fn play(machine: Machine, recordings: &[Recording]) -> Played {
    let streams: Vec<StreamPlayed> = recordings
        .iter()
        .map(|recording| StreamPlayed {
            kind: recording.kind.to_string(),
            frame: recording.frame,
            tasks: recording.rays.len(),
            rays: recording.rays.iter().copied().map(u64::from).sum(),
            lower_bound_s: machine.lower_bound(recording),
            outcomes: Strategy::ALL.iter().map(|strategy| machine.play(recording, strategy)).collect(),
        })
        .collect();
    let bound: f64 = streams.iter().map(|stream| stream.lower_bound_s).sum();
    let strategies = Strategy::ALL.iter().enumerate().map(|(index, strategy)| {
        let add = |sum: Outcome, stream: &StreamPlayed| Some(sum.plus(&stream.outcomes[index]?));
        let outcome = streams.iter().try_fold(Outcome::default(), add);
        let excess = outcome.and_then(|outcome| rt_sched::metrics::excess(outcome.makespan_s, bound));
        StrategyPlayed { name: strategy.name, outcome, excess }
    });
    Played { strategies: strategies.collect(), machine, streams }
}
