//! Compares the trees of every builder with the exact reference on real scenes and prints a table.
//!
//! `cargo run --release -p rt-tests --bin parity -- --rays 100000 [--scene NAME] [--seed N]`, with the environment
//! variable `RAYBALANCE_SCENES` naming a folder of `.obj` files. The exit status is 1 when any answer is wrong.
//!
//! Columns: rays that hit; rays that the exact reference calls ambiguous; how many rays are random, and how many of
//! these are ambiguous because of ties and for other reasons; ambiguous rays on which brute force gives another of the
//! admitted answers than a tree; wrong answers, over all builders, both careful precisions and both queries.
#![forbid(unsafe_code)]

use rt_bvh::Builder;
use rt_core::{Precision, Query};
use rt_tests::parity::Exam;
use rt_tests::scenes::{self, RealScene};
use rt_verify::tree;
use std::process::ExitCode;
use std::time::Instant;

const USAGE: &str = "usage: parity [--rays N] [--scene NAME] [--seed N]";

struct Arguments {
    rays: u32,
    scene: Option<String>,
    seed: u32,
}

fn main() -> ExitCode {
    match arguments().and_then(|arguments| run(&arguments)) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(wrong) => {
            eprintln!("{wrong} wrong answers");
            ExitCode::FAILURE
        }
        Err(message) => {
            eprintln!("{message}");
            ExitCode::from(2)
        }
    }
}

fn arguments() -> Result<Arguments, String> {
    let mut found = Arguments { rays: 100_000, scene: None, seed: 1 };
    let mut words = std::env::args().skip(1);
    while let Some(name) = words.next() {
        let value = words.next().ok_or_else(|| format!("{name}: a value is missing; {USAGE}"))?;
        let number = || value.parse::<u32>().map_err(|e| format!("{name} {value}: {e}; {USAGE}"));
        match name.as_str() {
            "--rays" => found.rays = number()?,
            "--seed" => found.seed = number()?,
            "--scene" => found.scene = Some(value),
            _ => return Err(format!("{name}: no such option; {USAGE}")),
        }
    }
    Ok(found)
}

/// Returns the number of wrong answers.
fn run(arguments: &Arguments) -> Result<usize, String> {
    let mut scenes = scenes::find()?;
    scenes.retain(|scene| arguments.scene.as_ref().is_none_or(|name| *name == scene.name));
    if scenes.is_empty() {
        return Err(format!("no scene of that name in the folder of {}", scenes::VARIABLE));
    }
    println!(
        "{:<14} {:>9} {:>8} {:>8} {:>9} {:>8} {:>8} {:>8} {:>8} {:>13} {:>8}",
        "scene",
        "triangles",
        "rays",
        "hits",
        "ambiguous",
        "random",
        "ties",
        "doubtful",
        "other",
        "disagreements",
        "seconds"
    );
    scenes.iter().map(|scene| examine(scene, arguments)).sum()
}

fn examine(scene: &RealScene, arguments: &Arguments) -> Result<usize, String> {
    let begin = Instant::now();
    let model = scene.load()?;
    let triangles = scenes::triangles(&model);
    let camera = scene.view.map(|view| view.camera()).transpose().map_err(|e| format!("{}: {e}", scene.name))?;
    let exam = Exam::new(&triangles, camera.as_ref(), arguments.rays, arguments.seed);
    let (mut hits, mut wrong, mut other) = (0, 0, 0);
    for &builder in Builder::ALL {
        let tree = tree::build(&triangles, builder)?;
        for precision in [Precision::Robust, Precision::Double] {
            for query in [Query::Closest, Query::Any] {
                let marks = exam.mark(&tree, query, precision);
                (hits, wrong, other) = (marks.hits, wrong + marks.disagreements, other.max(marks.other_choices));
                if let Some(first) = marks.first {
                    eprintln!("{}, {builder}: {first}", scene.name);
                }
            }
        }
    }
    let ambiguity = exam.ambiguity();
    println!(
        "{:<14} {:>9} {:>8} {:>8} {:>9} {:>8} {:>8} {:>8} {:>8} {:>13} {:>8.1}",
        scene.name,
        triangles.len(),
        exam.rays(),
        hits,
        ambiguity.all,
        ambiguity.random,
        ambiguity.random_ties,
        ambiguity.random_doubtful,
        other,
        wrong,
        begin.elapsed().as_secs_f64()
    );
    Ok(wrong)
}
