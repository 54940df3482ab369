//! `raybalance bench`: how fast each device traces, and what reduced traversal costs beside full.

mod measure;
mod results;
mod streams;

use crate::args::BenchArgs;
use crate::{interrupt, output};
use anyhow::{Result, bail};
use measure::Bench;
use results::{DeviceResult, PAPER, Results, SceneResult};
use rt_balance::devices::Opened;
use std::path::Path;
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
const SCHEMA: u32 = 1;

pub(crate) fn run(args: &BenchArgs) -> Result<()> {
    interrupt::watch();
    let devices = args.cards.open_in_turn(args.devices.as_deref())?;
    let scenes = match &args.scenes[..] {
        [] => vec!["yard".to_owned(), "car".to_owned()],
        named => named.to_vec(),
    };
    let repeat = if args.quick { QUICK_REPEAT } else { args.repeat };
    let mut results = Results {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        command: std::env::args().skip(1).collect(),
        seed: args.seed,
        repeat,
        paper: PAPER,
        results: Vec::new(),
    };
    if !args.json {
        print!("{}", results::introduction(repeat));
    }
    for name in &scenes {
        let prepared = args.source.prepare(name)?;
        let scene = BenchScene::new(&prepared, Path::new(name))?;
        let described = SceneResult {
            source: prepared.model.source.clone(),
            triangles: prepared.model.indices.len(),
            builder: prepared.built.report.builder.to_string(),
            precision: prepared.precision.name(),
            bytes: scene.tree.bytes(),
        };
        for named in &devices {
            let rays = rays_of(args, named);
            // The same for devices of one kind, so that they can be compared.
            let streams = scene.streams(rays, args.seed)?;
            let bench = Bench { named, tree: Arc::clone(&scene.tree), precision: prepared.precision, repeat };
            let measured = DeviceResult::new(named, described.clone(), bench.run(&streams)?);
            if !args.json {
                print!("\n{}", results::table(&measured));
            }
            results.results.push(measured);
        }
    }
    if let Some(path) = &args.out {
        output::write_atomically(path, |file| Ok(serde_json::to_writer_pretty(file, &results)?))?;
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&results)?);
    }
    Ok(())
}

fn rays_of(args: &BenchArgs, named: &Opened) -> u32 {
    let is_card = named.card.as_ref().is_some_and(|card| !card.software);
    match args.rays {
        Some(rays) => rays,
        None if args.quick => QUICK_RAYS,
        None if is_card => ON_CARDS,
        None => ON_PROCESSORS,
    }
}

/// An error after Ctrl-C.
fn check_interrupt() -> Result<()> {
    if interrupt::requested() {
        bail!("interrupted");
    }
    Ok(())
}
