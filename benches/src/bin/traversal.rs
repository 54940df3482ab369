//! Times the traversal kernels on one thread: full, exact counts, both reduced walks, and the price of precision; and,
//! on the same rays, Embree (where its library is found) and obvhs.
//!
//! `cargo run --release -p rt-benches --bin traversal -- SCENE... [--builder NAME] [--runs 7] [--size 1024x1024]`
#![forbid(unsafe_code)]

use rt_balance::stats::median;
use rt_benches::peers::{Peer, Peers, Run};
use rt_benches::{BenchScene, options};
use rt_bvh::{BuildOptions, Builder, Mesh, Stack, build};
use rt_core::{Hit, Precision, Query, RaySource, ReducedWalk, Scene, StreamSpec, TestCounts, Walk};
use rt_report::print::{Stdout, note};
use rt_report::{Provenance, exit};
use std::error::Error;
use std::io::Write;
use std::process::ExitCode;
use std::time::Instant;

/// What is timed; the first one is what the others are compared with.
const KERNELS: [(&str, Kernel); 6] = [
    ("robust", Kernel::Trace(Precision::Robust, false)),
    ("fast", Kernel::Trace(Precision::Fast, false)),
    ("f64", Kernel::Trace(Precision::Double, false)),
    ("exact counts", Kernel::Trace(Precision::Robust, true)),
    ("leaf as hit", Kernel::Reduced(ReducedWalk::LeafAsHit)),
    ("unshortened", Kernel::Reduced(ReducedWalk::Unshortened)),
];

#[derive(Clone, Copy)]
enum Kernel {
    Trace(Precision, bool),
    Reduced(ReducedWalk),
}

struct Options {
    scenes: Vec<String>,
    builder: Builder,
    runs: usize,
    size: [u32; 2],
}

fn main() -> ExitCode {
    exit::main(run_all)
}

fn run_all() -> Result<(), Box<dyn Error>> {
    let options = Options::parse()?;
    writeln!(Stdout, "{}", Provenance::now(1, ["one thread"]))?;
    writeln!(
        Stdout,
        "Mray/s of robust closest (or any) hit on one thread; others as time over robust, medians of {} interleaved runs.\n\
         Behind a peer's time: by how many rays in a million it hits more than we do (+) or fewer.\n",
        options.runs
    )?;
    write!(Stdout, "| scene | rays | robust Mray/s |")?;
    KERNELS[1..].iter().try_for_each(|(name, _)| write!(Stdout, " {name} |"))?;
    Peer::ALL.iter().try_for_each(|peer| write!(Stdout, " {} |", peer.name()))?;
    writeln!(Stdout, "\n|---|---|---|{}", "---|".repeat(KERNELS.len() - 1 + Peer::ALL.len()))?;
    for name in &options.scenes {
        bench(name, &options)?;
    }
    Ok(())
}

fn bench(name: &str, options: &Options) -> Result<(), Box<dyn Error>> {
    let bench = BenchScene::open(name)?;
    let mesh = Mesh { positions: &bench.model.positions, indices: &bench.model.indices };
    let scene = build(mesh, &BuildOptions { builder: options.builder, ..BuildOptions::default() })?.scene;
    let mut peers = Peers::new(&bench.model, &scene)?;
    if let Some(reason) = peers.missing() {
        note(format_args!("{name}: left out: {reason}"));
    }
    let streams = bench.streams(&scene, options.size)?;
    for (kind, source, query) in streams.iter().filter(|(_, source, _)| !source.is_empty()) {
        let mut times = vec![Vec::new(); KERNELS.len()];
        let mut others = vec![Vec::<Run>::new(); Peer::ALL.len()];
        let mut hits = 0_usize;
        for _ in 0..options.runs {
            for (times, (_, kernel)) in times.iter_mut().zip(KERNELS) {
                times.push(run(&scene, source, *query, kernel, |_, _| ()));
            }
            for (runs, peer) in others.iter_mut().zip(Peer::ALL) {
                runs.extend(peers.run(peer, source, *query)?);
            }
        }
        run(&scene, source, *query, KERNELS[0].1, |_, hit| hits += usize::from(hit.is_hit()));
        // Pair by pair, so that a machine whose speed drifts compares neighbours in time.
        let over = |these: &mut dyn Iterator<Item = f64>| {
            median(&these.zip(&times[0]).map(|(a, b)| a / b).collect::<Vec<_>>())
        };
        write!(Stdout, "| {} | {kind} | {:.2} |", bench.name, f64::from(source.len()) / median(&times[0]) / 1e6)?;
        times[1..].iter().try_for_each(|times| write!(Stdout, " {:.2} |", over(&mut times.iter().copied())))?;
        for runs in &others {
            match runs.first() {
                Some(first) => {
                    let more = (first.hits as f64 - hits as f64) / f64::from(source.len()) * 1e6;
                    write!(Stdout, " {:.2} ({more:+.0}) |", over(&mut runs.iter().map(|run| run.seconds)))?;
                }
                None => write!(Stdout, " – |")?,
            }
        }
        writeln!(Stdout)?;
    }
    Ok(())
}

/// Runs a kernel over a stream, shows each hit with its number, and returns the seconds.
fn run(scene: &Scene, source: &RaySource, query: Query, kernel: Kernel, mut keep: impl FnMut(usize, Hit)) -> f64 {
    let mut stack = Stack::for_scene(scene);
    let mut index = 0;
    let sink = |hit: Hit, counts: TestCounts| {
        std::hint::black_box((hit, counts));
        keep(index, hit);
        index += 1;
    };
    let rays = (0..source.len()).map(|i| source.ray(i));
    let begin = Instant::now();
    match kernel {
        Kernel::Trace(precision, counts) => {
            rt_bvh::trace(scene, &mut stack, StreamSpec::new(query, precision, counts), rays, sink);
        }
        Kernel::Reduced(walk) => {
            rt_bvh::count(scene, &mut stack, Walk::Reduced(walk), Precision::Robust, rays, sink);
        }
    }
    begin.elapsed().as_secs_f64()
}

impl Options {
    fn parse() -> Result<Self, Box<dyn Error>> {
        let mut builder = Builder::Sah;
        let shared = options::Options::parse([1024, 1024], |name, value| {
            match name {
                "--builder" => builder = value()?.parse()?,
                _ => return Ok(false),
            }
            Ok(true)
        })?;
        let options::Options { scenes, runs, size } = shared;
        Ok(Self { scenes, runs, size, builder })
    }
}
