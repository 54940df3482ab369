//! Every builder's trees give the exact reference's hits on real scenes, for 2,000 rays each. Ambiguous rays are
//! counted, and must still hit one of their candidates; but for ties, at most one random ray in a thousand may be one.

use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use rt_bvh::Builder;
use rt_core::{Precision, Query};
use rt_tests::parity::Exam;
use rt_tests::scenes::{self, RealScene};
use rt_tests::tree;

/// Rays for each scene. The reference tests each with every triangle; the program `parity` takes more.
const RAYS: u32 = 2_000;

fn main() {
    let arguments = Arguments::from_args();
    let trials = match scenes::find() {
        Ok(scenes) => scenes
            .into_iter()
            .map(|scene| Trial::test(scene.name.clone(), move || examine(&scene)).with_kind("parity"))
            .collect(),
        Err(reason) => {
            vec![Trial::ignorable_test("real scenes", move || Ok(Completion::ignored_with(reason))).with_kind("parity")]
        }
    };
    run(&arguments, trials).exit();
}

fn examine(scene: &RealScene) -> Result<(), Failed> {
    let triangles = scenes::triangles(&scene.load()?);
    let camera = scene.view.map(|view| view.camera()).transpose()?;
    let exam = Exam::new(&triangles, camera.as_ref(), RAYS, 1);
    let ambiguity = exam.ambiguity();
    println!("{}: {} rays; left out: {ambiguity:?}", scene.name, exam.rays());
    let most = ambiguity.random / 1000 + 1;
    if ambiguity.random_doubtful > most {
        return Err(format!("more than {most} random rays are doubtful without a tie: {ambiguity:?}").into());
    }
    for &builder in Builder::ALL {
        let tree = tree::build(&triangles, builder)?;
        for precision in [Precision::Robust, Precision::Double] {
            for query in [Query::Closest, Query::Any] {
                let marks = exam.mark(&tree, query, precision);
                if let Some(first) = marks.first {
                    return Err(format!("{builder}: {} wrong answers; the first: {first}", marks.disagreements).into());
                }
            }
        }
    }
    Ok(())
}
