//! `raybalance figure1`: the paper's Figure 1, measured here.

mod measure;
mod write;

use crate::Lab;
use crate::subject::Subject;
use crate::time_budget::TimeBudget;
use anyhow::{Context, Result};
use measure::{Devices, Panel};
use rt_balance::catalogue::Estimator;
use rt_balance::cpu::CpuDevice;
use rt_core::Device;
use rt_report::Provenance;
use rt_report::output::Outputs;
use rt_report::usage::usage;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// Devices of the paper's machine.
const PAPER_DEVICES: u32 = 3;

/// Pictures of a measurement: 655,360 primary rays, of which 40 tasks of the largest size are made.
const SIZE: [u32; 2] = [1024, 640];
/// Pictures that trace in a tenth of a second.
const QUICK_SIZE: [u32; 2] = [320, 200];

/// Repetitions: nine give the interval between the second and the second last a confidence of 96%.
const REPEAT: u32 = 9;
const QUICK_REPEAT: u32 = 3;

/// Everything the command measured and how: what figure1.json holds.
#[derive(Debug, Serialize)]
struct Results {
    /// Layout of the file; changes when a field changes its meaning or goes away.
    schema: u32,
    provenance: Provenance,
    /// `real`, or `replay` on virtual devices.
    mode: &'static str,
    /// Number of devices that the times are for.
    devices: usize,
    /// Why a replay was chosen, where it was not asked for.
    note: Option<String>,
    estimator: &'static str,
    /// Share of the rays that the estimator was asked to sample; null where that is left to it.
    fraction: Option<f64>,
    size: [u32; 2],
    repetitions: u32,
    panels: Vec<Panel>,
}

/// Where the tasks run.
struct Setting {
    devices: Vec<Arc<dyn Device>>,
    /// Number of virtual devices; `None` to run on the real ones.
    replay: Option<usize>,
    note: Option<String>,
}

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Built-in scenes or OBJ files.
    pub scenes: Vec<PathBuf>,
    /// What initialises the costs.
    pub estimator: Estimator,
    /// Share of the rays that it was asked to sample, for the report.
    pub fraction: Option<f64>,
    /// Devices to trace on, or the one to measure for a replay; `None`: three cores.
    pub devices: Option<String>,
    /// Number of equal virtual devices that are played from task times measured on one; `None`: none, where the machine
    /// has as many cores as the devices want.
    pub replay: Option<u32>,
    /// Rays of a task, increasing.
    pub task_sizes: Vec<u32>,
    /// Size of the picture in pixels, one ray each; `None`: as suits the extent.
    pub size: Option<[u32; 2]>,
    /// Rounds that count; `None`: as suits the extent.
    pub repeat: Option<u32>,
    /// Seed of samples, pixels and bounces.
    pub seed: u32,
    /// Small pictures and few rounds: a look at the form, not a measurement.
    pub quick: bool,
    /// Folder of what is written.
    pub out: PathBuf,
}

/// Measures, draws and writes the figure.
///
/// # Errors
/// When a scene cannot be prepared, a device not be opened or fails, or a file not be written.
pub fn run(lab: Lab<'_>, options: &Options) -> Result<()> {
    if !options.task_sizes.is_sorted_by(|a, b| a < b) {
        return Err(usage("--task-sizes must increase, such as 64,256,1024").into());
    }
    let outputs = Outputs::new().folder("--out", &options.out, write::FILES).scenes(&options.scenes);
    outputs.check()?;
    let lab = lab.writing(&outputs);
    let setting = setting(lab, options)?;
    if let Some(note) = &setting.note {
        lab.show.note(note);
    }
    let size = options.size.unwrap_or(if options.quick { QUICK_SIZE } else { SIZE });
    let repetitions = options.repeat.unwrap_or(if options.quick { QUICK_REPEAT } else { REPEAT });
    let mut results = Results {
        schema: 2,
        provenance: Provenance::now(options.seed, Vec::<String>::new()),
        mode: if setting.replay.is_some() { "replay" } else { "real" },
        devices: setting.replay.unwrap_or(setting.devices.len()),
        note: setting.note,
        estimator: options.estimator.make().name(),
        fraction: options.fraction,
        size,
        repetitions,
        panels: Vec::new(),
    };
    let where_to = match setting.replay {
        Some(count) => Devices::Virtual(count),
        None => Devices::Real,
    };
    let steps = options.scenes.len() * 2 * options.task_sizes.len();
    let time = TimeBudget::whole(lab.show, None).with_steps(steps, repetitions + 1);
    time.label("measuring");
    for scene in &options.scenes {
        let mut subject = Subject::open(lab, scene, &setting.devices)?;
        results.provenance.devices = subject.devices();
        for stream in subject.streams(size, options.seed)? {
            if stream.source.is_empty() {
                lab.show.note(&format!("no {} rays in {}: nothing was hit", stream.kind, scene.display()));
                continue;
            }
            let plan = measure::Plan {
                where_to,
                estimate: &options.estimator,
                task_sizes: &options.task_sizes,
                repetitions,
                seed: options.seed,
            };
            let panel = plan.measure(&mut subject, &stream, &|| time.step());
            results.panels.push(panel.with_context(|| format!("{}, {} rays", scene.display(), stream.kind))?);
        }
    }
    time.finish();
    write::all(lab, &options.out, &results)
}

/// Real devices where there are enough cores for them, else a replay.
fn setting(lab: Lab<'_>, options: &Options) -> Result<Setting> {
    let one = |list: Option<&str>| -> Result<Vec<Arc<dyn Device>>> {
        let devices = lab.open(list.unwrap_or("cpu:1"))?;
        if devices.len() != 1 {
            return Err(usage("--replay measures on one device: name one in --devices, such as cpu:1").into());
        }
        Ok(devices)
    };
    if let Some(count) = options.replay {
        return Ok(Setting { devices: one(options.devices.as_deref())?, replay: Some(count as usize), note: None });
    }
    let cores = CpuDevice::cores();
    let Some(list) = &options.devices else {
        if (PAPER_DEVICES as usize) <= cores {
            let list = vec!["cpu:1"; PAPER_DEVICES as usize].join(",");
            return Ok(Setting { devices: lab.open(&list)?, replay: None, note: None });
        }
        let note = format!(
            "{PAPER_DEVICES} devices need {PAPER_DEVICES} cores and there are {cores}: {PAPER_DEVICES} virtual devices \
             are played from task times measured on one core; give --devices for real ones"
        );
        return Ok(Setting { devices: one(None)?, replay: Some(PAPER_DEVICES as usize), note: Some(note) });
    };
    let opened = lab.open(list)?;
    let threads: u32 = opened.iter().map(|d| d.info()).filter(|i| i.backend == "cpu").map(|i| i.units).sum();
    if threads as usize <= cores {
        return Ok(Setting { devices: opened, replay: None, note: None });
    }
    let count = opened.len();
    let first = list.split(',').next().unwrap_or("cpu:1");
    let note = format!(
        "--devices {list} needs {threads} cores and there are {cores}: {count} equal virtual devices are played from task \
         times measured on {first}"
    );
    Ok(Setting { devices: one(Some(first))?, replay: Some(count), note: Some(note) })
}
