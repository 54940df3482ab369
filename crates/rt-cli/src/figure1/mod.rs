//! `raybalance figure1`: the paper's Figure 1, measured here.

mod measure;
mod write;

use crate::args::{CardArgs, Figure1Args};
use crate::experiment::{Machine, Subject, command_line};
use crate::{interrupt, progress};
use anyhow::{Context, Result, bail, ensure};
use measure::{Devices, Panel};
use rt_balance::cpu::CpuDevice;
use rt_core::Device;
use serde::Serialize;
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
pub(crate) struct Results {
    /// Layout of the file; changes when a field changes its meaning or goes away.
    pub(crate) schema: u32,
    pub(crate) command: String,
    pub(crate) machine: Machine,
    /// `real`, or `replay` on virtual devices.
    pub(crate) mode: &'static str,
    /// Number of devices that the times are for.
    pub(crate) devices: usize,
    /// The real devices' names.
    pub(crate) measured_on: Vec<String>,
    /// Why a replay was chosen, where it was not asked for.
    pub(crate) note: Option<String>,
    pub(crate) estimator: &'static str,
    /// Share of the rays that the estimator was asked to sample; null where that is left to it.
    pub(crate) fraction: Option<f64>,
    pub(crate) size: [u32; 2],
    pub(crate) repetitions: u32,
    pub(crate) seed: u32,
    pub(crate) panels: Vec<Panel>,
}

/// Where the tasks run.
struct Setting {
    devices: Vec<Arc<dyn Device>>,
    /// Number of virtual devices; `None` to run on the real ones.
    replay: Option<usize>,
    note: Option<String>,
}

pub(crate) fn run(args: &Figure1Args) -> Result<()> {
    interrupt::watch();
    ensure!(args.task_sizes.is_sorted_by(|a, b| a < b), "--task-sizes must increase, such as 64,256,1024");
    let setting = setting(args)?;
    if let Some(note) = &setting.note {
        eprintln!("note: {note}");
    }
    let size = args.size.unwrap_or(if args.quick { QUICK_SIZE } else { SIZE });
    let repetitions = args.repeat.unwrap_or(if args.quick { QUICK_REPEAT } else { REPEAT });
    let mut results = Results {
        schema: 1,
        command: command_line(),
        machine: Machine::this(),
        mode: if setting.replay.is_some() { "replay" } else { "real" },
        devices: setting.replay.unwrap_or(setting.devices.len()),
        measured_on: Vec::new(),
        note: setting.note,
        estimator: args.estimate.estimator()?.name(),
        fraction: args.estimate.fraction,
        size,
        repetitions,
        seed: args.seed,
        panels: Vec::new(),
    };
    let where_to = match setting.replay {
        Some(count) => Devices::Virtual(count),
        None => Devices::Real,
    };
    let steps = args.scenes.len() * 2 * args.task_sizes.len() * (repetitions as usize + 1);
    let bar = progress::bar("measuring", steps as u64);
    for scene in &args.scenes {
        let mut subject = Subject::open(scene, &args.source, &setting.devices)?;
        results.measured_on = subject.devices();
        for stream in subject.streams(size, args.seed)? {
            if stream.source.is_empty() {
                eprintln!("note: no {} rays in {scene}: nothing was hit", stream.kind);
                continue;
            }
            let plan = measure::Plan {
                where_to,
                estimate: &args.estimate,
                task_sizes: &args.task_sizes,
                repetitions,
                seed: args.seed,
            };
            let panel = plan.measure(&mut subject, &stream, &|| bar.inc(1));
            results.panels.push(panel.with_context(|| format!("{scene}, {} rays", stream.kind))?);
        }
    }
    bar.finish_and_clear();
    write::all(&args.out, &results)
}

/// Real devices where there are enough cores for them, else a replay.
fn setting(args: &Figure1Args) -> Result<Setting> {
    let one = |list: Option<&str>| -> Result<Vec<Arc<dyn Device>>> {
        let devices = CardArgs::default().open(Some(list.unwrap_or("cpu:1")))?;
        if devices.len() != 1 {
            bail!("--replay measures on one device: name one in --devices, such as cpu:1");
        }
        Ok(devices)
    };
    if let Some(count) = args.replay {
        return Ok(Setting { devices: one(args.devices.as_deref())?, replay: Some(count as usize), note: None });
    }
    let cores = CpuDevice::cores();
    let Some(list) = &args.devices else {
        if (PAPER_DEVICES as usize) <= cores {
            let list = vec!["cpu:1"; PAPER_DEVICES as usize].join(",");
            return Ok(Setting { devices: CardArgs::default().open(Some(&list))?, replay: None, note: None });
        }
        let note = format!(
            "{PAPER_DEVICES} devices need {PAPER_DEVICES} cores and there are {cores}: {PAPER_DEVICES} virtual devices \
             are played from task times measured on one core; give --devices for real ones"
        );
        return Ok(Setting { devices: one(None)?, replay: Some(PAPER_DEVICES as usize), note: Some(note) });
    };
    let opened = CardArgs::default().open(Some(list))?;
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
