//! Devices of all backends in one run.

use crate::{Backend, Found};
use backend_cpu::CpuDevice;
use libtest_mimic::{Completion, Failed, Trial};
use rt_balance::report::StreamRun;
use rt_balance::{Balancer, Control, Device, Hit, QueueKind, RaySource, Scheduling, Stream, StreamKind, StreamSpec};
use rt_bvh::Builder;
use rt_verify::rays::RayMaker;
use rt_verify::{shapes, tree};
use std::sync::Arc;

const RAYS: u32 = 20_000;

/// One test: a run on `cpu:1,vulkan:0,wgpu:1`, or on the last device of a backend that has fewer.
pub(crate) fn trials(devices: &[Found]) -> Vec<Trial> {
    let of = |backend, position| {
        let mut of_it = devices.iter().filter(|found| found.backend == backend).map(|found| found.device.clone());
        of_it.clone().nth(position).or_else(|| of_it.next_back())
    };
    let chosen = (of(Backend::Vulkan, 0), of(Backend::Wgpu, 1));
    let test = move || match chosen {
        (Some(vulkan), Some(wgpu)) => every_backend_in_one_run(&[vulkan, wgpu]).map(|()| Completion::Completed),
        _ => Ok(Completion::ignored_with("needs a Vulkan and a wgpu device")),
    };
    vec![Trial::ignorable_test("every_backend_in_one_run", test).with_kind("cpu+vulkan+wgpu")]
}

/// The processor's bits, whoever traced what. Fails when one backend breaks ties by another rule.
fn every_backend_in_one_run(cards: &[Arc<dyn rt_gpu::GpuDevice>]) -> Result<(), Failed> {
    let triangles = [shapes::grid(40, 0.2, 1), shapes::soup(2_000, 0.1, 2), shapes::layers(10, 3)].concat();
    let rays = RayMaker::new(&triangles, 6).mixed(RAYS);
    let scene = tree::build(&triangles, Builder::Sah)?;
    let (expected, _) = tree::trace(&scene, StreamSpec::default(), &rays);
    let (rays, origins): (Vec<_>, Vec<_>) = rays.into_iter().unzip();
    let source = RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) };
    let mut devices: Vec<Arc<dyn Device>> = Vec::new();
    devices.extend(CpuDevice::open_all(&[1])?.into_iter().map(|device| Arc::new(device) as Arc<dyn Device>));
    devices.extend(cards.iter().map(|card| card.clone() as Arc<dyn Device>));
    let mut balancer = Balancer::new(scene, &devices)?;
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
