//! Devices of all backends in one run.

use crate::{Backend, Found};
use backend_cpu::CpuDevice;
use libtest_mimic::{Completion, Failed, Trial};
use rt_balance::report::StreamRun;
use rt_balance::{
    Balancer, Control, Device, Hit, QueueKind, RaySource, Scheduling, Stream, StreamKind, StreamSpec, TestCounts,
    Updated,
};
use rt_bvh::{BuildOptions, Builder, build};
use rt_gpu::GpuDevice;
use rt_scene::builtin;
use rt_scene::wind::{Strength, Wind};
use rt_verify::rays::RayMaker;
use rt_verify::{shapes, tree};
use std::sync::Arc;

const RAYS: u32 = 20_000;

/// Runs on `cpu:1,vulkan:0,wgpu:1`, or on the last device of a backend that has fewer.
pub(crate) fn trials(devices: &[Found]) -> Vec<Trial> {
    let of = |backend, position| {
        let mut of_it = devices.iter().filter(|found| found.backend == backend).map(|found| found.device.clone());
        of_it.clone().nth(position).or_else(|| of_it.next_back())
    };
    let chosen = (of(Backend::Vulkan, 0), of(Backend::Wgpu, 1));
    let trial = |name: &str, test: Test| {
        let chosen = chosen.clone();
        let test = move || match chosen {
            (Some(vulkan), Some(wgpu)) => test(&[vulkan, wgpu]).map(|()| Completion::Completed),
            _ => Ok(Completion::ignored_with("needs a Vulkan and a wgpu device")),
        };
        Trial::ignorable_test(name, test).with_kind("cpu+vulkan+wgpu")
    };
    vec![
        trial("every_backend_in_one_run", every_backend_in_one_run),
        trial("every_backend_follows_a_scene", every_backend_follows_a_scene),
    ]
}

/// A test of cards of two backends.
type Test = fn(&[Arc<dyn GpuDevice>]) -> Result<(), Failed>;

/// A processor and the cards.
fn beside_a_processor(cards: &[Arc<dyn GpuDevice>]) -> Result<Vec<Arc<dyn Device>>, Failed> {
    let processors = CpuDevice::open_all(&[1])?.into_iter().map(|device| Arc::new(device) as Arc<dyn Device>);
    Ok(processors.chain(cards.iter().map(|card| card.clone() as Arc<dyn Device>)).collect())
}

/// The garden in the wind: hits are those of a scene built for each moment, and cards are sent what has changed.
///
/// Mutants: a card that keeps the trees' leaves, or only the nodes, where they were; one that is sent all of the scene,
/// or has to take it anew.
fn every_backend_follows_a_scene(cards: &[Arc<dyn GpuDevice>]) -> Result<(), Failed> {
    let yard = builtin::yard();
    let triangles: Vec<_> = (0..yard.indices.len() as u32).filter_map(|id| yard.triangle(id)).collect();
    let rays = RayMaker::new(&triangles, 6).mixed(RAYS);
    let mut wind = Wind::over(&yard, Strength::BREEZE)?;
    let scene = build(wind.after(0.0), &BuildOptions::default())?.scene;
    let whole = scene.bytes() * cards.len() as u64;
    let mut balancer = Balancer::new(scene, &beside_a_processor(cards)?)?;
    let (alone, origins): (Vec<_>, Vec<_>) = rays.iter().copied().unzip();
    let source = RaySource::Explicit { rays: alone.into(), origins: Some(origins.into()) };
    for (seconds, moves) in [(0.4, true), (1.3, true), (1.3, false), (0.0, true)] {
        let mesh = wind.after(seconds);
        let update = balancer.update(bytemuck::cast_slice(mesh.positions), mesh.indices)?;
        // At rest it is the scene's box alone, of 32 bytes.
        let is_right = if moves { (1 << 20..whole).contains(&update.sent_bytes) } else { update.sent_bytes == 64 };
        if update.tree != Updated::Fitted || !is_right {
            return Err(format!("after {seconds} s: {update:?}, of {whole} bytes").into());
        }
        let anew = build(mesh, &BuildOptions::default())?.scene;
        let (expected, _) = tree::trace(&anew, StreamSpec::default(), &rays);
        // The second time tests are counted, over the two-wide tree.
        for counts in [false, true] {
            let spec = StreamSpec { counts, ..StreamSpec::default() };
            let stream = Stream::new(source.clone(), StreamKind::Custom, spec).with_task_size(256);
            let (mut hits, mut tests) = (vec![Hit::MISS; RAYS as usize], vec![TestCounts::default(); RAYS as usize]);
            let mut scheduling = Scheduling { queue: Box::new(QueueKind::Static), ..Scheduling::default() };
            let run = balancer.trace(&stream, &mut scheduling, &mut hits, Some(&mut tests), Control::default())?;
            if let Some(i) = (0..hits.len()).find(|&i| bits(&hits[i]) != bits(&expected[i])) {
                return Err(format!("after {seconds} s, ray {i}: {:?}, not {:?}", hits[i], expected[i]).into());
            }
            check_shares(QueueKind::Static, &run)?;
        }
    }
    Ok(())
}

/// The processor's bits, whoever traced what. Fails when one backend breaks ties by another rule.
fn every_backend_in_one_run(cards: &[Arc<dyn GpuDevice>]) -> Result<(), Failed> {
    let triangles = [shapes::grid(40, 0.2, 1), shapes::soup(2_000, 0.1, 2), shapes::layers(10, 3)].concat();
    let rays = RayMaker::new(&triangles, 6).mixed(RAYS);
    let scene = tree::build(&triangles, Builder::Sah)?;
    let (expected, _) = tree::trace(&scene, StreamSpec::default(), &rays);
    let (rays, origins): (Vec<_>, Vec<_>) = rays.into_iter().unzip();
    let source = RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) };
    let mut balancer = Balancer::new(scene, &beside_a_processor(cards)?)?;
    for queue in [QueueKind::Static, QueueKind::Central, QueueKind::Hybrid] {
        let stream = Stream::new(source.clone(), StreamKind::Custom, StreamSpec::default()).with_task_size(256);
        let mut hits = vec![Hit::MISS; RAYS as usize];
        let mut scheduling = Scheduling { queue: Box::new(queue), ..Scheduling::default() };
        let run = balancer.trace(&stream, &mut scheduling, &mut hits, None, Control::default())?;
        if let Some(i) = (0..hits.len()).find(|&i| bits(&hits[i]) != bits(&expected[i])) {
            return Err(format!("{queue:?}, ray {i}: {:?}, not {:?}", hits[i], expected[i]).into());
        }
        check_shares(queue, &run)?;
    }
    Ok(())
}

/// A static queue gives every device its share.
fn check_shares(queue: QueueKind, run: &StreamRun) -> Result<(), Failed> {
    let tasks: Vec<u32> = run.report.devices.iter().map(|device| device.tasks).collect();
    let failed = run.report.devices.iter().any(|device| device.error.is_some());
    if failed || (queue == QueueKind::Static && tasks.contains(&0)) {
        return Err(format!("{queue:?}: devices traced {tasks:?} tasks; a failure: {failed}").into());
    }
    Ok(())
}

fn bits(hit: &Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive]
}
