//! `raybalance bench`: how fast each device traces, and what reduced traversal costs beside full.

mod measure;
mod results;
mod streams;

use crate::{DEFAULT_SCENES, Lab};
use anyhow::{Context, Result};
use measure::Bench;
use results::{DeviceResult, PAPER, Results, SceneResult};
use rt_balance::cpu::Isa;
use rt_balance::devices::{CardOptions, Opened};
use rt_report::Provenance;
use rt_report::output::{self, Outputs};
use std::path::PathBuf;
use std::sync::Arc;
use streams::BenchScene;

/// Rays of a launch on a graphics card: enough that starting and ending it do not count.
const ON_CARDS: u32 = 1 << 22;

/// Rays of a launch on processors, a hundred times slower.
const ON_PROCESSORS: u32 = 1 << 18;

/// With `--quick`.
const QUICK_RAYS: u32 = 1 << 14;
const QUICK_REPEAT: u32 = 3;

/// The version of the JSON's layout.
const SCHEMA: u32 = 2;

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Built-in scenes or OBJ files, beside which a `cameras.tsv` is used; none: [`DEFAULT_SCENES`].
    pub scenes: Vec<PathBuf>,
    /// Devices, one after the other, as [`Opener::open_in_turn`](rt_balance::devices::Opener::open_in_turn) reads them.
    pub devices: String,
    /// How graphics cards are used.
    pub cards: CardOptions,
    /// Instructions that processors trace with; `None`: the best there are.
    pub isa: Option<Isa>,
    /// Rays of a launch; `None`: as many as suit the device.
    pub rays: Option<u32>,
    /// Repetitions that count.
    pub repeat: u32,
    /// Few rays, three repetitions: to see that it works.
    pub quick: bool,
    /// Seed of bounces and random rays.
    pub seed: u32,
    /// Whether JSON, with every single measurement, is printed instead of tables.
    pub json: bool,
    /// A file for that JSON.
    pub out: Option<PathBuf>,
}

/// Measures each device on each scene.
///
/// # Errors
/// When a scene cannot be prepared, a device not be opened or fails, or the file not be written.
pub fn run(lab: Lab<'_>, options: &Options) -> Result<()> {
    let scenes = match &options.scenes[..] {
        [] => DEFAULT_SCENES.map(PathBuf::from).to_vec(),
        named => named.to_vec(),
    };
    let outputs = options.out.iter().fold(Outputs::new(), |outputs, path| outputs.file("--out", path)).scenes(&scenes);
    outputs.check()?;
    let lab = lab.writing(&outputs);
    let devices = lab
        .opener()
        .with_cards(options.cards)
        .with_isa(options.isa)
        .open_in_turn(&options.devices)
        .context("--devices")?;
    let repeat = if options.quick { QUICK_REPEAT } else { options.repeat };
    let mut results = Results {
        schema: SCHEMA,
        provenance: Provenance::now(options.seed, devices.iter().map(|opened| opened.device.info().name.clone())),
        repeat,
        paper: PAPER,
        results: Vec::new(),
    };
    if !options.json {
        lab.show.print(results::introduction(repeat).trim_end())?;
    }
    for name in &scenes {
        let prepared = lab.prepare(name)?;
        let scene = BenchScene::new(&prepared);
        let described = SceneResult {
            source: prepared.model.source.clone(),
            triangles: prepared.model.indices.len(),
            builder: prepared.built.report.builder.to_string(),
            precision: prepared.precision.name(),
            bytes: scene.tree.bytes(),
        };
        let first = results.results.len();
        for named in &devices {
            let rays = rays_of(options, named);
            // The same for devices of one kind, so that they can be compared.
            let streams = scene.streams(rays, options.seed)?;
            let bench = Bench { lab, named, tree: Arc::clone(&scene.tree), precision: prepared.precision, repeat };
            let measured = DeviceResult::new(named, described.clone(), bench.run(&streams)?);
            if !options.json {
                lab.show.print(&format!("\n{}", results::table(&measured).trim_end()))?;
            }
            results.results.push(measured);
        }
        let on_scene = &results.results[first..];
        if on_scene.len() > 1 && !options.json {
            lab.show.print(&format!("\n{}", results::side_by_side(on_scene).trim_end()))?;
        }
    }
    if let Some(path) = &options.out {
        output::write_atomically(path, |file| Ok(serde_json::to_writer_pretty(file, &results)?))?;
    }
    if options.json {
        lab.show.print(&serde_json::to_string_pretty(&results)?)?;
    }
    Ok(())
}

fn rays_of(options: &Options, named: &Opened) -> u32 {
    let is_card = named.card.as_ref().is_some_and(|card| !card.software);
    match options.rays {
        Some(rays) => rays,
        None if options.quick => QUICK_RAYS,
        None if is_card => ON_CARDS,
        None => ON_PROCESSORS,
    }
}
