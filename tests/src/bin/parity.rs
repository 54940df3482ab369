//! Compares this project's trees, Embree and obvhs with the exact reference on real scenes.
//!
//! `cargo run --release -p rt-tests --bin parity -- --help`, with the environment variable `RAYBALANCE_SCENES` naming
//! a folder of `.obj` files. The exit status is 1 when any answer of ours is wrong, 2 when an option is. Embree is
//! left out, with the reason, where its library is missing; `RT_REQUIRE=embree` forbids that.
//!
//! First line of a scene: rays that hit; rays that the exact reference calls ambiguous; how many rays are random, and
//! how many of these are ambiguous because of ties and for other reasons; ambiguous rays on which brute force gives
//! another of the admitted answers than a tree; wrong answers, over all builders, both layouts, both careful precisions
//! and both queries. Then, for each tracer that works in single precision: wrong answers to both queries by kind of ray
//! and by kind of error, and answers that are another one of tied hits. [`rt_tests::judge`] says what is wrong.
#![forbid(unsafe_code)]

use anyhow::{Context, Error, Result, bail};
use clap::Parser;
use rt_bvh::{Builder, WideTree};
use rt_conformance::is_required;
use rt_core::{Device, Precision, Query, StreamSpec};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::print::{Stdout, note};
use rt_tests::fake::FakeDevice;
use rt_tests::judge::Tally;
use rt_tests::parity::{Exam, Kind};
use rt_tests::scenes::{self, RealScene};
use rt_verify::tree;
use serde_json::{Value, json};
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

/// Compare this project's trees, Embree and obvhs with the exact reference on real scenes.
///
/// Scenes are those of the folder that the environment variable RAYBALANCE_SCENES names.
#[derive(Debug, Parser)]
#[command(after_help = format!("{}; here 1 is also that an answer of ours is wrong.", Exit::HELP))]
struct Arguments {
    /// Rays of each scene
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    rays: u32,
    /// Only the scene of this name
    #[arg(long, value_name = "NAME")]
    scene: Option<String>,
    /// Seed of the rays
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u32,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Tracers in single precision: their names, devices and precisions.
type Peers = Vec<(String, Arc<dyn Device>, Precision)>;

fn main() -> ExitCode {
    exit::main(|| match run(&Arguments::parse())? {
        0 => Ok(()),
        wrong => bail!("{wrong} wrong answers of ours"),
    })
}

/// Returns the number of wrong answers of ours.
fn run(arguments: &Arguments) -> Result<usize> {
    let mut scenes = scenes::find().map_err(Error::msg)?;
    scenes.retain(|scene| arguments.scene.as_ref().is_none_or(|name| *name == scene.name));
    if scenes.is_empty() {
        bail!("no scene of that name in the folder of {}", scenes::VARIABLE);
    }
    let (found, missing) = backend_peers::all();
    if let Some(reason) = missing.first().filter(|_| is_required("embree")) {
        bail!("required by RT_REQUIRE, but missing: {reason}");
    }
    missing.iter().try_for_each(|reason| writeln!(Stdout, "left out: {reason}"))?;
    let named = |device: Arc<dyn Device>| (device.info().name.clone(), device, Precision::default());
    let mut peers: Peers = vec![("our fast".to_owned(), Arc::new(FakeDevice::honest()), Precision::Fast)];
    peers.extend(found.into_iter().map(named));
    let (mut wrong, mut reports) = (0, Vec::new());
    for scene in &scenes {
        let (errors, report) = examine(scene, arguments, &peers)?;
        wrong += errors;
        reports.push(report);
    }
    if let Some(path) = &arguments.json {
        let provenance = Provenance::now(arguments.seed, peers.iter().map(|(name, ..)| name.clone()));
        let report =
            json!({ "provenance": provenance, "rays": arguments.rays, "left_out": missing, "scenes": reports });
        std::fs::write(path, format!("{report:#}\n")).with_context(|| format!("--json {}", path.display()))?;
    }
    Ok(wrong)
}

fn examine(scene: &RealScene, arguments: &Arguments, peers: &Peers) -> Result<(usize, Value)> {
    let begin = Instant::now();
    let model = scenes::load(scene).map_err(Error::msg)?;
    let triangles = scenes::triangles(&model);
    let camera = model.view.map(|view| view.camera()).transpose().with_context(|| scene.name.clone())?;
    let exam = Exam::new(&triangles, camera.as_ref(), arguments.rays, arguments.seed);
    let (mut hits, mut wrong) = (0, 0);
    for &builder in Builder::ALL {
        let tree = tree::build(&triangles, builder).map_err(Error::msg)?;
        let wide = WideTree::new(&tree);
        for precision in [Precision::Robust, Precision::Double] {
            for query in [Query::Closest, Query::Any] {
                for marks in [exam.mark(&tree, query, precision), exam.mark_wide(&wide, query, precision)] {
                    (hits, wrong) = (marks.hits, wrong + marks.disagreements);
                    if let Some(first) = marks.first {
                        note(format_args!("{}, {builder}, {precision:?}: {first}", scene.name));
                    }
                }
            }
        }
    }
    let ambiguity = exam.ambiguity();
    writeln!(
        Stdout,
        "\n{}: {} triangles, {} rays: {hits} hit, {} ambiguous; of {} random ones {} ties, {} doubtful; \
         {wrong} WRONG answers of ours; {:.1} s",
        scene.name,
        triangles.len(),
        exam.rays(),
        ambiguity.all,
        ambiguity.random,
        ambiguity.random_ties,
        ambiguity.random_doubtful,
        begin.elapsed().as_secs_f64()
    )?;
    let scene_of_peers = tree::build(&triangles, Builder::Sah).map_err(Error::msg)?;
    header()?;
    let mut reports = Vec::new();
    for (name, device, precision) in peers {
        let judged = [Query::Closest, Query::Any].map(|query| {
            let spec = StreamSpec::new(query, *precision, false);
            exam.ask(&**device, &scene_of_peers, spec).map(|hits| exam.judge(&hits, query))
        });
        match judged {
            [Ok(closest), Ok(any)] => {
                row(name, &closest, &any)?;
                reports.push(json!({ "tracer": name, "closest": tallies(&closest), "any": tallies(&any) }));
            }
            [Err(reason), _] | [_, Err(reason)] => {
                writeln!(Stdout, "  {name:<22} failed: {reason}")?;
                reports.push(json!({ "tracer": name, "failed": reason }));
            }
        }
    }
    let report = json!({
        "scene": scene.name,
        "triangles": triangles.len(),
        "rays": exam.rays(),
        "hits": hits,
        "ambiguous": ambiguity.all,
        "random": ambiguity.random,
        "random_ties": ambiguity.random_ties,
        "random_doubtful": ambiguity.random_doubtful,
        "ours": { "trees": 2 * Builder::ALL.len(), "wrong": wrong },
        "single_precision": reports,
    });
    Ok((wrong, report))
}

fn header() -> io::Result<()> {
    write!(Stdout, "  {:<22} {:>8} {:>8}", "wrong answers of", "queries", "all")?;
    Kind::ALL.into_iter().try_for_each(|kind| write!(Stdout, " {:>11}", kind.name()))?;
    writeln!(Stdout, " | {:>8} {:>8} {:>8} {:>8} | {:>8}", "misses", "hits", "order", "distance", "ties")
}

fn row(name: &str, closest: &[Tally], any: &[Tally]) -> io::Result<()> {
    let mut all = Tally::new();
    closest.iter().chain(any).for_each(|tally| all.merge(tally.clone()));
    write!(Stdout, "  {name:<22} {:>8} {:>8}", all.rays, all.errors())?;
    closest
        .iter()
        .zip(any)
        .try_for_each(|(closest, any)| write!(Stdout, " {:>11}", closest.errors() + any.errors()))?;
    let Tally { false_misses, false_hits, order, distance, ties, .. } = all;
    writeln!(Stdout, " | {false_misses:>8} {false_hits:>8} {order:>8} {distance:>8} | {ties:>8}")
}

fn tallies(of: &[Tally]) -> Value {
    let tally = |(kind, tally): (Kind, &Tally)| {
        json!({
            "kind": kind.name(),
            "rays": tally.rays,
            "errors": tally.errors(),
            "false_misses": tally.false_misses,
            "false_hits": tally.false_hits,
            "order": tally.order,
            "distance": tally.distance,
            "ties": tally.ties,
            "first": tally.first,
        })
    };
    Kind::ALL.into_iter().zip(of).map(tally).collect()
}
