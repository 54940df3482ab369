//! This project beside Embree and obvhs: the same rays, in one process, in turns.
//!
//! `cargo run --release -p rt-benches --bin peers -- --help`
//!
//! Scenes are `yard`, `car` or OBJ files. Their rays are those of a picture: camera rays, shadow rays and diffuse
//! bounces; with `--rays` those of a file, as `raybalance trace` reads it, asked for nearest hits. Nobody says whether
//! they are coherent, but to Embree, which is asked both ways.
//!
//! Times of one thread are processor time, which others on the machine disturb less; those of several are wall time.
//! What Embree is given is laid out before the clock starts; what this project does to rays that a caller has in memory
//! is part of its time.
#![forbid(unsafe_code)]

mod contender;
mod judge;
mod page;

use clap::Parser;
use contender::{Contender, Run, Traced};
use judge::Judge;
use page::{Cell, Line, Who};
use rt_balance::stats::Summary;
use rt_benches::{NamedStream, options};
use rt_bvh::Builder;
use rt_core::{Query, Ray, RaySource};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::print::Stdout;
use rt_report::usage::usage;
use rt_scene::npy::RayFile;
use rt_scene::prepare::Prepared;
use std::error::Error;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

/// Trace the same rays as Embree and obvhs, in turns.
#[derive(Debug, Parser)]
#[command(after_help = Exit::HELP)]
struct Options {
    #[command(flatten)]
    common: options::Options,
    /// Tree builder: sah, sah-slow, or ploc-fastest, -very-fast, -fast, -medium, -slow, -very-slow
    #[arg(long, value_name = "NAME", default_value_t = Builder::Sah)]
    builder: Builder,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1024x1024", value_parser = options::size)]
    size: [u32; 2],
    /// Numbers of threads, 1 among them: what is measured in processor time stands for this project
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_value = "1,2")]
    threads: Vec<usize>,
    /// Rays to trace instead of a picture's, as `raybalance trace` reads them
    #[arg(long, value_name = "FILE", conflicts_with = "size")]
    rays: Option<PathBuf>,
}

fn main() -> ExitCode {
    exit::main(run_all)
}

fn run_all() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    write!(Stdout, "{}", Provenance::now(1, ["one thread"]))?;
    writeln!(Stdout, "* load of the machine at the start and the end: {}", load())?;
    if options.threads.contains(&0) || !options.threads.contains(&1) {
        return Err(usage("--threads: numbers from 1 on, 1 among them").into());
    }
    let mut cells = Vec::new();
    for name in &options.common.scenes {
        bench(name, &options, &mut cells)?;
    }
    page::print(&cells)?;
    writeln!(Stdout, "\nLoad at the end: {}", load())?;
    Ok(())
}

/// How many threads wanted to run in the last minutes, as Linux says it.
fn load() -> String {
    std::fs::read_to_string("/proc/loadavg").map_or_else(|_| "unknown".to_owned(), |text| text.trim().to_owned())
}

fn bench(name: &str, options: &Options, cells: &mut Vec<Cell>) -> Result<(), Box<dyn Error>> {
    let prepared = rt_benches::open(name, options.builder)?;
    let (model, scene) = (&prepared.model, &prepared.built.scene);
    writeln!(
        Stdout,
        "\n## {}\n\n{} triangles, tree {} in {:.2} s",
        prepared.name,
        scene.triangles().len(),
        options.builder,
        prepared.build_s
    )?;
    let (mut contenders, missing) = contender::all(model, scene, &options.threads)?;
    missing.iter().try_for_each(|reason| writeln!(Stdout, "\nLeft out: {reason}"))?;
    writeln!(Stdout, "\n| rays | tracer | Mray/s, median | best | over Embree's best [95%] | missed /M | false /M |")?;
    writeln!(Stdout, "|---|---|---|---|---|---|---|")?;
    for (kind, source, query) in streams(&prepared, options)? {
        let lines =
            compare(kind, &explicit(&source), query, &mut contenders, &Judge::new(model), options.common.repeat)?;
        cells.push(Cell { scene: prepared.name.clone(), rays: kind, lines });
    }
    Ok(())
}

fn streams(prepared: &Prepared, options: &Options) -> Result<Vec<NamedStream>, Box<dyn Error>> {
    match &options.rays {
        None => rt_benches::streams(prepared, options.size),
        Some(path) => {
            let rays = RayFile::open(path)?.read(prepared.model.offset)?;
            Ok(vec![("file", RaySource::Explicit { rays: rays.into(), origins: None }, Query::Closest)])
        }
    }
}

/// The rays in memory, without the primitives that they start on, which peers would need callbacks for.
fn explicit(source: &RaySource) -> Arc<[Ray]> {
    (0..source.len()).map(|i| source.ray(i).0).collect()
}

/// Has everybody trace the rays in turns, and prints and returns a line for each.
fn compare(
    kind: &str,
    rays: &Arc<[Ray]>,
    query: Query,
    contenders: &mut [Contender],
    judge: &Judge,
    repeat: u32,
) -> Result<Vec<Line>, Box<dyn Error>> {
    let mut traced: Vec<Vec<Traced>> = Vec::new();
    let mut seconds = vec![Vec::new(); contenders.len()];
    // The first run warms caches up, and its answers are looked at.
    for run in 0..=repeat {
        for (contender, seconds) in contenders.iter_mut().zip(&mut seconds) {
            let Run { seconds: took, traced: found } = contender.run(rays, query, run == 0)?;
            if run == 0 {
                traced.push(found);
            } else {
                seconds.push(took);
            }
        }
    }
    let middle = |i: usize| Summary::new(&seconds[i]).median;
    let peers = (0..contenders.len()).filter(|&i| matches!(contenders[i].who, Who::Embree(_)));
    let best = peers.min_by(|&a, &b| middle(a).total_cmp(&middle(b)));
    let ours = contenders
        .iter()
        .rposition(|contender| matches!(contender.who, Who::Ours(_, 1)))
        .ok_or("this project is among the contenders")?;
    let found = judge.judge(rays, query, &traced, ours);
    let speed = |seconds: f64| rays.len() as f64 / seconds / 1e6;
    let per_million = |count: usize| count as f64 / rays.len() as f64 * 1e6;
    let mut lines = Vec::new();
    for (i, contender) in contenders.iter().enumerate() {
        let least = seconds[i].iter().copied().fold(f64::INFINITY, f64::min);
        let line = Line {
            who: contender.who.clone(),
            speed: speed(middle(i)),
            ratio: best.map(|best| Summary::of_ratios(&seconds[best], &seconds[i])),
            missed: per_million(found[i].missed),
            phantom: per_million(found[i].phantom),
        };
        let ratio = line
            .ratio
            .as_ref()
            .map_or_else(String::new, |ratio| format!("{:.2} [{:.2}, {:.2}]", ratio.median, ratio.low, ratio.high));
        writeln!(
            Stdout,
            "| {kind} | {} | {:.2} | {:.2} | {ratio} | {:.1} | {:.1} |",
            contender.name,
            line.speed,
            speed(least),
            line.missed,
            line.phantom,
        )?;
        lines.push(line);
    }
    Ok(lines)
}
