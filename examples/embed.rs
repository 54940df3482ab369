//! A renderer's own vertices, rays and hit buffers, traced on two CPU devices, with progress and a way to stop.
//!
//! `cargo run --release -p rt-balance --example embed`

use rt_balance::cpu::CpuDevice;
use rt_balance::{Balancer, Control, Device, Hit, Ray, RaySource, Scheduling, Stream, StreamKind, StreamSpec};
use std::io::{Write, stderr, stdout};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The renderer's scene: a floor of 100 × 100 squares with a bump in one corner.
    let side = 100_u32;
    let height = |x: u32, z: u32| if x < 20 && z < 20 { f32::from((x * z % 7) as u8) * 0.3 } else { 0.0 };
    let positions: Vec<[f32; 3]> =
        (0..=side).flat_map(|z| (0..=side).map(move |x| [x as f32, height(x, z), z as f32])).collect();
    let at = |x: u32, z: u32| z * (side + 1) + x;
    let square = |x, z| [[at(x, z), at(x, z + 1), at(x + 1, z)], [at(x + 1, z), at(x, z + 1), at(x + 1, z + 1)]];
    let indices: Vec<[u32; 3]> = (0..side).flat_map(|z| (0..side).flat_map(move |x| square(x, z))).collect();

    // One device per core; any other backend's devices may stand in the same list.
    let devices: Vec<Arc<dyn Device>> =
        CpuDevice::open_all(&[1, 1])?.into_iter().map(|device| Arc::new(device) as _).collect();
    let mut balancer = Balancer::for_mesh(&positions, &indices, &devices)?;

    // The renderer's rays: straight down, a little off the grid.
    let rays: Arc<[Ray]> = (0..400_000_u32)
        .map(|i| {
            let (x, z) = ((i % 632) as f32 * 0.158 + 0.01, (i / 632) as f32 * 0.158 + 0.01);
            Ray::new([x, 50.0, z].into(), [0.0, -1.0, 0.0].into())
        })
        .collect();
    let mut hits = vec![Hit::MISS; rays.len()];

    let stop = AtomicBool::new(false);
    let progress = |done: u64, all: u64| {
        let _ = write!(stderr(), "\r{:3}%", done * 100 / all);
    };
    let control = Control { cancel: Some(&stop), progress: Some(&progress), ..Control::default() };
    let source = RaySource::Explicit { rays, origins: None };
    let stream = Stream::new(source, StreamKind::Custom, StreamSpec::default());
    let run = balancer.trace(&stream, &mut Scheduling::default(), &mut hits, None, control)?;

    let met = hits.iter().filter(|hit| hit.is_hit()).count();
    writeln!(stdout(), "\n{met} of {} rays hit, in {:.1} ms", hits.len(), run.report.makespan_s * 1e3)?;
    for device in &run.report.devices {
        writeln!(stdout(), "  {}: {} tasks in {} launches", device.name, device.tasks, device.launches)?;
    }
    assert_eq!(met, hits.len(), "the rays start above the floor and point down");
    Ok(())
}

#[cfg(test)]
#[test]
fn runs() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
