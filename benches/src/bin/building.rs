//! Times the tree builders on all cores beside Embree's default one, where its library is found, interleaved.
//!
//! `cargo run --release -p rt-benches --bin building -- [SCENE | large:TRIANGLES]... [--builders sah,ploc-medium] [--runs 7]`
//!
//! `RAYON_NUM_THREADS` and `taskset` limit ours and both. Ours is the whole call, from a mesh to a checked scene; Embree's
//! makes a device, copies the mesh and commits the scene.
#![forbid(unsafe_code)]

use embree4_sys::{RTCBuildQuality, RTCSceneFlags};
use rt_balance::stats::median;
use rt_benches::{BenchScene, large, options};
use rt_bvh::{BuildOptions, Builder, Mesh, TreeStats, build};
use rt_scene::Model;
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut builders = vec![Builder::default()];
    let options = options::Options::parse([1, 1], |name, value| {
        match name {
            "--builders" => builders = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?,
            _ => return Ok(false),
        }
        Ok(true)
    })?;
    println!("command: {}\n", std::env::args().skip(1).collect::<Vec<_>>().join(" "));
    println!(
        "Medians of {} interleaved runs; over Embree: its time divided by ours, above 1 where ours is faster.\n",
        options.runs
    );
    println!(
        "| scene | triangles | builder | ms | Mtriangles/s | over Embree | SAH cost |\n|---|---|---|---|---|---|---|"
    );
    for name in &options.scenes {
        bench(name, &builders, options.runs)?;
    }
    Ok(())
}

fn open(name: &str) -> Result<Model, Box<dyn Error>> {
    match name.strip_prefix("large:") {
        Some(triangles) => Ok(large::large(triangles.parse()?)),
        None => Ok(BenchScene::open(name)?.model),
    }
}

fn bench(name: &str, builders: &[Builder], runs: usize) -> Result<(), Box<dyn Error>> {
    let model = open(name)?;
    let mesh = Mesh { positions: &model.positions, indices: &model.indices };
    let vertices: Vec<[f32; 3]> = model.positions.iter().map(|p| p.to_array()).collect();
    let embree = || {
        let begin = Instant::now();
        embree4_sys::Mesh::new(&vertices, &model.indices, RTCSceneFlags::ROBUST, RTCBuildQuality::MEDIUM)
            .map(|_mesh| begin.elapsed().as_secs_f64())
    };
    let (mut theirs, mut ours) = (Vec::new(), vec![Vec::new(); builders.len()]);
    let mut costs = vec![0.0; builders.len()];
    for _ in 0..runs {
        theirs.push(embree());
        for (index, &builder) in builders.iter().enumerate() {
            let begin = Instant::now();
            let built = build(mesh, &BuildOptions { builder, ..BuildOptions::default() })?;
            ours[index].push(begin.elapsed().as_secs_f64());
            costs[index] = TreeStats::of(&built.scene).sah_cost;
        }
    }
    let theirs: Result<Vec<f64>, _> = theirs.into_iter().collect();
    let triangles = model.indices.len() as f64;
    let row = |builder: &str, seconds: f64, over: &str, cost: &str| {
        println!(
            "| {name} | {triangles} | {builder} | {:.0} | {:.2} | {over} | {cost} |",
            1e3 * seconds,
            triangles / seconds / 1e6
        );
    };
    match &theirs {
        Ok(seconds) => row("Embree", median(seconds), "1", ""),
        Err(reason) => eprintln!("{name}: left out: {reason}"),
    }
    for ((builder, seconds), cost) in builders.iter().zip(&ours).zip(&costs) {
        // Pair by pair, so that a machine whose speed drifts compares neighbours in time.
        let over = theirs.as_ref().map_or_else(
            |_| "–".to_owned(),
            |theirs| {
                format!("{:.2}", median(&theirs.iter().zip(seconds).map(|(them, us)| them / us).collect::<Vec<_>>()))
            },
        );
        row(builder.name(), median(seconds), &over, &format!("{cost:.2}"));
    }
    Ok(())
}
