//! Times fitting trees to triangles that have moved beside building them, on all cores, in turns.
//!
//! `cargo run --release -p rt-benches --bin refitting -- --help`
//!
//! `large:` makes a scene of so many triangles. `RAYON_NUM_THREADS` limits the threads. Every vertex moves by a wave
//! through the scene. Both ways are the whole call: from a mesh, or for the other layouts from the scene that was
//! fitted or built, to what can be traced. Left out are triangles so thin that single precision makes lines of them
//! wherever the wave has them: with those the tree of one moment is not that of another, and would be built each time.
#![forbid(unsafe_code)]

use clap::Parser;
use glam::Vec3;
use rt_balance::stats::median;
use rt_benches::{large, options};
use rt_bvh::{BlockTree, BuildOptions, Mesh, TreeStats, WideTree, build, refit};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::print::Stdout;
use rt_scene::Model;
use std::error::Error;
use std::io::Write;
use std::process::ExitCode;
use std::time::Instant;

/// Time fitting trees to triangles that have moved beside building them, on all cores.
///
/// A scene may be large:TRIANGLES, which makes one of so many.
#[derive(Debug, Parser)]
#[command(after_help = Exit::HELP)]
struct Options {
    #[command(flatten)]
    common: options::Options,
}

/// What is fitted or built.
const TREES: [&str; 3] = ["two-wide", "for processors", "for graphics cards"];

fn main() -> ExitCode {
    exit::main(run_all)
}

fn run_all() -> Result<(), Box<dyn Error>> {
    let Options { common } = Options::parse();
    write!(Stdout, "{}", Provenance::now(1, ["all threads"]))?;
    writeln!(
        Stdout,
        "\nMedians of {} repetitions in turns; the cost is the fitted tree's over the built one's.\n",
        common.repeat
    )?;
    writeln!(
        Stdout,
        "| scene | triangles | tree | build, ms | fit, ms | build over fit | cost |\n|---|---|---|---|---|---|---|"
    )?;
    for name in &common.scenes {
        bench(name, common.repeat)?;
    }
    Ok(())
}

fn bench(name: &str, repeat: u32) -> Result<(), Box<dyn Error>> {
    let model = large::open(name)?;
    let options = BuildOptions::default();
    let extent = model.bounds().extent().max_element();
    let moved = |turn: u32| -> Vec<Vec3> {
        let wave = |p: Vec3| 0.01 * extent * (p / extent * 9.0 + turn as f32).map(f32::sin);
        model.positions.iter().map(|&p| p + wave(p)).collect()
    };
    let indices = &kept(&model, &options, (0..repeat).map(&moved))?[..];
    let first = build(Mesh { positions: &model.positions, indices }, &options)?.scene;
    let blocks = BlockTree::new(&first).ok_or("too many triangles for processors")?;
    let shape = WideTree::new(&first).into_shape();
    let mut times = TREES.map(|_| [Vec::new(), Vec::new()]);
    let mut growth = 1.0;
    for turn in 0..repeat {
        let moved = moved(turn);
        let mesh = Mesh { positions: &moved, indices };
        let built = time(&mut times[0][0], || build(mesh, &options))?.scene;
        let fitted = time(&mut times[0][1], || refit(&first, mesh, &options))?.ok_or("other triangles")?;
        let _ = time(&mut times[1][0], || BlockTree::new(&built)).ok_or("too many triangles for processors")?;
        let _ = time(&mut times[1][1], || blocks.refit(&fitted)).ok_or("other triangles")?;
        let _ = time(&mut times[2][0], || WideTree::new(&built));
        let _ = time(&mut times[2][1], || shape.refit(&fitted));
        growth = TreeStats::of(&fitted).sah_cost / TreeStats::of(&built).sah_cost;
    }
    let triangles = indices.len();
    for (tree, [built, fitted]) in TREES.into_iter().zip(&times) {
        let (built, fitted) = (median(built), median(fitted));
        let cost = if tree == TREES[0] { format!("{growth:.3}") } else { String::new() };
        writeln!(
            Stdout,
            "| {name} | {triangles} | {tree} | {:.1} | {:.1} | {:.1} | {cost} |",
            1e3 * built,
            1e3 * fitted,
            built / fitted
        )?;
    }
    Ok(())
}

/// The triangles of a model that can be hit as it is and wherever its vertices are.
fn kept(
    model: &Model,
    options: &BuildOptions,
    moments: impl Iterator<Item = Vec<Vec3>>,
) -> Result<Vec<[u32; 3]>, Box<dyn Error>> {
    let mut kept = model.indices.clone();
    for positions in std::iter::once(model.positions.clone()).chain(moments) {
        let scene = build(Mesh { positions: &positions, indices: &kept }, options)?.scene;
        let mut can_be_hit = vec![false; kept.len()];
        (0..scene.primitives().len()).for_each(|slot| can_be_hit[scene.primitives().get(slot) as usize] = true);
        let mut each = can_be_hit.into_iter();
        kept.retain(|_| each.next().unwrap_or(false));
    }
    Ok(kept)
}

fn time<T>(seconds: &mut Vec<f64>, work: impl FnOnce() -> T) -> T {
    let begin = Instant::now();
    let done = work();
    seconds.push(begin.elapsed().as_secs_f64());
    done
}
