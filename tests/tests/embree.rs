//! Embree and this project's devices on the same rays: random meshes and real scenes; nearest and any hits.
//!
//! Where they differ, the exact reference says who is right. Our devices must never be wrong, in either careful
//! precision, with any number of threads and over either layout of trees. Errors of Embree and of our `fast` are
//! counted and printed; on random rays there may be few, or they were not asked the same. Without its library the tests
//! are ignored with the reason, unless `RT_REQUIRE` names `embree`. The program `parity` does the same with more rays.

use backend_cpu::{CpuDevice, Isa};
use backend_peers::{EmbreeDevice, EmbreeOptions};
use backend_vulkan::VulkanDevice;
use backend_wgpu::WgpuDevice;
use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestError, TestRunner};
use rt_bvh::Builder;
use rt_conformance::is_required;
use rt_core::{Device, Hit, Precision, Query, Ray, StreamSpec, Triangle};
use rt_gpu::Layouts;
use rt_report::print::note;
use rt_scene::{Model, builtin};
use rt_tests::fake::FakeDevice;
use rt_tests::judge::{Tally, judge};
use rt_tests::parity::{Exam, Kind, trace_all};
use rt_tests::{scenes, strategy};
use rt_verify::reference::Reference;
use rt_verify::tree;
use std::cell::RefCell;
use std::sync::Arc;

/// Rays for each real scene. The reference tests each with every triangle; the program `parity` takes more.
const RAYS: u32 = 300;

/// Random meshes, of some dozen rays each.
const MESHES: u32 = 60;

/// Share of random rays, which nothing aims near edges, that Embree or our `fast` may answer wrongly. Measured: below
/// 10⁻³. With wrong ids, limits or coordinates nearly all would be wrong.
const ERRORS: f64 = 0.005;

/// The careful precisions: those that must always be right.
const CAREFUL: [Precision; 2] = [Precision::Robust, Precision::Double];

/// Is given Embree with its robust flag and without.
type Test = Box<dyn FnOnce(&[EmbreeDevice; 2]) -> Result<(), Failed> + Send>;

/// Share of all rays on random meshes, most of them aimed at edges, vertices and planes, that Embree may answer
/// wrongly. Measured: 2 to 4%.
const ERRORS_AIMED: f64 = 0.1;

type Devices = Arc<Vec<(String, Arc<dyn Device>)>>;

fn main() {
    let arguments = Arguments::from_args();
    let devices = ours();
    let devices = || Arc::clone(&devices);
    let mut trials = Vec::new();
    let mut add = |name: &str, test: Test| {
        trials.push(Trial::ignorable_test(name, move || with_embree(test)));
    };
    let ours = devices();
    add("random meshes", Box::new(move |embree| random_meshes(embree, &ours)));
    for (name, model) in [("builtin:yard", builtin::yard as fn() -> Model), ("builtin:car", builtin::car)] {
        let ours = devices();
        add(name, Box::new(move |embree| compare(embree, &ours, name, &model())));
    }
    for scene in scenes::find().unwrap_or_default() {
        let ours = devices();
        let name = scene.name.clone();
        add(
            &name,
            Box::new(move |embree| {
                let model = scenes::load(&scene)?;
                compare(embree, &ours, &scene.name, &model)
            }),
        );
    }
    if let Err(reason) = scenes::find() {
        trials.push(Trial::ignorable_test("real scenes", move || Ok(Completion::ignored_with(reason))));
    }
    run(&arguments, trials).exit();
}

/// Runs a test with Embree, robust and not, or says why it cannot be run.
fn with_embree(test: impl FnOnce(&[EmbreeDevice; 2]) -> Result<(), Failed>) -> Result<Completion, Failed> {
    let open = |robust| EmbreeDevice::open(EmbreeOptions { robust, ..EmbreeOptions::default() });
    match (open(true), open(false)) {
        (Ok(robust), Ok(plain)) => test(&[robust, plain]).map(|()| Completion::Completed),
        (Err(e), _) | (_, Err(e)) if is_required("embree") => {
            Err(format!("required by RT_REQUIRE, but missing: {e}").into())
        }
        (Err(e), _) | (_, Err(e)) => Ok(Completion::ignored_with(e.to_string())),
    }
}

/// The processor with all its instructions, with two threads, and over the compressed eight-wide tree; every device of
/// Vulkan and of wgpu with its usual layout, and the first of each with the two-wide one. What is missing is another
/// test's business.
fn ours() -> Devices {
    let mut found: Vec<(String, Arc<dyn Device>)> = Vec::new();
    for (threads, isa) in Isa::available().into_iter().map(|isa| (1, Some(isa))).chain([(2, None)]) {
        for device in CpuDevice::open_all_with(&[threads], isa).unwrap_or_default() {
            found.push((device.info().name.clone(), Arc::new(device)));
        }
    }
    found.push(("cpu, eight-wide".to_owned(), Arc::new(FakeDevice::wide())));
    for (layout, layouts, most) in [("usual", Layouts::USUAL, usize::MAX), ("two-wide", Layouts::default(), 1)] {
        let options = backend_vulkan::Options { layouts: Some(layouts), ..Default::default() };
        let vulkan = VulkanDevice::enumerate(options).unwrap_or_default();
        for (i, device) in vulkan.into_iter().flatten().enumerate().take(most) {
            found.push((format!("vulkan {i}, {layout}: {}", device.info().name), Arc::new(device)));
        }
        let options = backend_wgpu::Options { layouts: Some(layouts), ..Default::default() };
        let wgpu = WgpuDevice::enumerate(options).unwrap_or_default();
        for (i, device) in wgpu.into_iter().flatten().enumerate().take(most) {
            found.push((format!("wgpu {i}, {layout}: {}", device.info().name), Arc::new(device)));
        }
    }
    Arc::new(found)
}

/// A mesh and rays with limits that Embree takes: it demands `tnear ≥ 0`.
fn mesh_and_rays() -> impl Strategy<Value = (Vec<Triangle>, Vec<(Ray, u32)>)> {
    strategy::scene().prop_map(|(triangles, mut rays)| {
        for (ray, _) in &mut rays {
            (ray.tmin, ray.tmax) = (ray.tmin.max(0.0), ray.tmax.abs());
        }
        (triangles, rays)
    })
}

/// Guards against: a box test of ours without padding, a triangle lost by a builder, a tie won by the higher id.
fn random_meshes(embree: &[EmbreeDevice; 2], ours: &Devices) -> Result<(), Failed> {
    let tallies = RefCell::new([const { Tally::new() }; 2]);
    let (gpus, cpus): (Vec<_>, Vec<_>) =
        ours.iter().partition(|(_, device)| ["vulkan", "wgpu"].contains(&device.info().backend));
    // Making a scene resident on a software GPU takes longer than all else: they take turns.
    let turns = RefCell::new(gpus.iter().cycle());
    let mut runner = TestRunner::new(Config { cases: MESHES, ..Config::default() });
    let outcome = runner.run(&mesh_and_rays(), |(triangles, rays)| {
        let verdicts = Reference::new(&triangles).resolve_all(&rays);
        let scene = tree::build(&triangles, Builder::Sah).map_err(TestCaseError::fail)?;
        let gpu = turns.borrow_mut().next();
        for query in [Query::Closest, Query::Any] {
            let mut first: Option<Vec<Hit>> = None;
            for (name, device) in cpus.iter().chain(gpu) {
                for precision in CAREFUL {
                    let spec = StreamSpec::new(query, precision, false);
                    let hits = trace_all(&**device, &scene, &rays, spec).map_err(TestCaseError::fail)?;
                    for ((hit, verdict), ray) in hits.iter().zip(&verdicts).zip(&rays) {
                        let right = match query {
                            Query::Closest | Query::All { .. } => verdict.is_right(hit),
                            Query::Any => verdict.right().is_some() == hit.is_hit(),
                        };
                        prop_assert!(right, "{name}, {query:?}, {precision:?}: {hit:?} but {verdict} for {ray:?}");
                    }
                    let first = first.get_or_insert_with(|| hits.clone());
                    prop_assert!(
                        agree(query, first, &hits),
                        "{name}, {query:?}, {precision:?}: not the first device's"
                    );
                }
            }
            for (device, tally) in embree.iter().zip(tallies.borrow_mut().iter_mut()) {
                let spec = StreamSpec { query, ..StreamSpec::default() };
                let hits = trace_all(device, &scene, &rays, spec).map_err(TestCaseError::fail)?;
                for ((hit, verdict), (ray, origin)) in hits.iter().zip(&verdicts).zip(&rays) {
                    let finding = judge(&triangles, ray, *origin, query, verdict, hit);
                    tally.add(finding, || format!("{query:?}, {ray:?}: {hit:?}, {finding:?}, but {verdict:?}"));
                }
            }
        }
        Ok(())
    });
    let tallies = tallies.into_inner();
    for (device, tally) in embree.iter().zip(&tallies) {
        note(format_args!("random meshes: {}: {tally}", device.info().name));
        note(format_args!("    {}", tally.first.as_deref().unwrap_or_default()));
    }
    let bad = |tally: &&Tally| tally.errors() as f64 > ERRORS_AIMED * tally.rays as f64;
    match outcome {
        Ok(()) => tallies.iter().find(bad).map_or(Ok(()), |tally| Err(format!("Embree: {tally}").into())),
        Err(TestError::Abort(reason)) => Err(reason.to_string().into()),
        Err(TestError::Fail(reason, (triangles, rays))) => {
            Err(format!("{reason}\nfor {triangles:?}\nand {rays:?}").into())
        }
    }
}

/// Whether two of our devices answer alike: to the bit where the nearest hit is wanted. Of several triangles on a ray,
/// layouts may report any where any hit will do.
fn agree(query: Query, one: &[Hit], other: &[Hit]) -> bool {
    match query {
        Query::Closest | Query::All { .. } => one == other,
        Query::Any => one.iter().map(Hit::is_hit).eq(other.iter().map(Hit::is_hit)),
    }
}

fn compare(embree: &[EmbreeDevice; 2], ours: &Devices, name: &str, model: &Model) -> Result<(), Failed> {
    let triangles = scenes::triangles(model);
    let camera = model.view.map(|view| view.camera()).transpose()?;
    let exam = Exam::new(&triangles, camera.as_ref(), RAYS, 2);
    let scene = tree::build(&triangles, Builder::Sah)?;
    let ambiguity = exam.ambiguity();
    note(format_args!("{name}: {ambiguity:?}"));
    if !ambiguity.is_admissible(name) {
        return Err(format!("too many random rays are ambiguous: {ambiguity:?}").into());
    }
    for query in [Query::Closest, Query::Any] {
        let mut first: Option<Vec<Hit>> = None;
        for (label, device) in ours.iter() {
            for precision in CAREFUL {
                let hits = exam.ask(&**device, &scene, StreamSpec::new(query, precision, false))?;
                let marks = exam.mark_hits(&hits, query);
                if let Some(wrong) = marks.first {
                    return Err(
                        format!("{label}, {precision:?}: {} wrong answers: {wrong}", marks.disagreements).into()
                    );
                }
                if !agree(query, first.get_or_insert_with(|| hits.clone()), &hits) {
                    return Err(format!("{label}, {precision:?}, {query:?}: other hits than the first device's").into());
                }
            }
        }
        let fast = ours.first().map(|(label, device)| (format!("{label}, fast"), &**device, Precision::Fast));
        let named = |device: &'_ EmbreeDevice| device.info().name.clone();
        let single = embree.iter().map(|device| (named(device), device as &dyn Device, Precision::default()));
        for (name, device, precision) in single.chain(fast) {
            let spec = StreamSpec::new(query, precision, false);
            let (mut all, mut random) = (Tally::new(), Tally::new());
            for (kind, tally) in Kind::ALL.into_iter().zip(exam.judge(&exam.ask(device, &scene, spec)?, query)) {
                if kind.is_random() {
                    random.merge(tally.clone());
                }
                all.merge(tally);
            }
            note(format_args!("    {name}, {query:?}: {all}"));
            note(format_args!("    {}", all.first.as_deref().unwrap_or_default()));
            if random.errors() as f64 > ERRORS * random.rays as f64 {
                return Err(format!("{name}: {random}: it is not asked what the others are").into());
            }
        }
    }
    Ok(())
}
