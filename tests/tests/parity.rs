//! Every builder's trees, two-wide and eight-wide, give the exact reference's hits on real and built-in scenes.
//! Ambiguous rays are counted, and must still hit one of their candidates; at most one random ray in a thousand may be
//! one, but for ties in scenes that are listed for them.

use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use rt_bvh::{Builder, WideTree};
use rt_core::{Precision, Query};
use rt_report::print::note;
use rt_scene::{Model, builtin};
use rt_tests::parity::Exam;
use rt_tests::scenes;
use rt_verify::tree;

/// Rays for each real scene. The reference tests each with every triangle; the program `parity` takes more.
const RAYS: u32 = 2_000;

/// Rays for each built-in scene, which are there without any file.
const BUILTIN_RAYS: u32 = 500;

fn main() {
    let arguments = Arguments::from_args();
    let mut trials = vec![
        Trial::test("builtin:yard", || examine("yard", &builtin::yard(), BUILTIN_RAYS)),
        Trial::test("builtin:car", || examine("car", &builtin::car(), BUILTIN_RAYS)),
    ];
    match scenes::find() {
        Ok(scenes) => trials.extend(scenes.into_iter().map(|scene| {
            Trial::test(scene.name.clone(), move || {
                let model = scenes::load(&scene)?;
                examine(&scene.name, &model, RAYS)
            })
        })),
        Err(reason) => {
            trials.push(Trial::ignorable_test("real scenes", move || Ok(Completion::ignored_with(reason))));
        }
    }
    run(&arguments, trials).exit();
}

fn examine(name: &str, model: &Model, rays: u32) -> Result<(), Failed> {
    let triangles = scenes::triangles(model);
    let camera = model.view.map(|view| view.camera()).transpose()?;
    let exam = Exam::new(&triangles, camera.as_ref(), rays, 1);
    let ambiguity = exam.ambiguity();
    note(format_args!("{}: {rays} rays; left out: {ambiguity:?}", model.source));
    if !ambiguity.is_admissible(name) {
        return Err(format!("too many random rays are ambiguous: {ambiguity:?}").into());
    }
    for &builder in Builder::ALL {
        let tree = tree::build(&triangles, builder)?;
        let wide = WideTree::new(&tree);
        for precision in [Precision::Robust, Precision::Double] {
            for query in [Query::Closest, Query::Any] {
                let both =
                    [("two", exam.mark(&tree, query, precision)), ("eight", exam.mark_wide(&wide, query, precision))];
                for (width, marks) in both {
                    if let Some(first) = marks.first {
                        let wrong = marks.disagreements;
                        return Err(
                            format!("{builder}, {width}-wide: {wrong} wrong answers; the first: {first}").into()
                        );
                    }
                }
            }
        }
    }
    Ok(())
}
