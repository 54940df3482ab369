//! What does not fit.

use crate::hits::compare_rays;
use crate::{Found, LIMIT};
use backend_vulkan::{Layout, Layouts, Options, VulkanDevice};
use libtest_mimic::Failed;
use rt_bvh::Builder;
use rt_core::{Camera, CameraRays, Device, DeviceErrorKind, Launch, RaySource, StreamSpec, Task};
use rt_verify::clock;
use rt_verify::rays::RayMaker;
use rt_verify::{shapes, tree};
use std::sync::Arc;

/// More rays than the device binds at once, without a byte of host memory for them: one camera pixel, many samples.
pub(crate) fn too_many_rays_are_refused_with_their_size(found: &Found) -> Result<(), Failed> {
    let card = found.device.card();
    if !card.software {
        // Real cards bind 4 GiB, for which preparing rays would take long.
        return Ok(());
    }
    let scene = tree::build(&shapes::grid(2, 0.0, 0), Builder::Sah)?;
    let mut tracer = found.device.tracer(Arc::clone(&scene), clock)?;
    let camera = Camera::look_at(glam::Vec3::Y, glam::Vec3::ZERO, glam::Vec3::X, 40.0)?;
    let rays = |samples| {
        RaySource::Camera(Arc::new(CameraRays {
            camera,
            size: [1, 1],
            pixels: [0].into(),
            samples,
            first_sample: 0,
            all_samples: samples,
            seed: 1,
        }))
    };
    let error = tracer.load_rays(rays(1 << 30), StreamSpec::default());
    let sizes = [64_u64 << 30, card.binding].map(|size| size.to_string());
    let names = |text: String| sizes.iter().all(|size| text.contains(size));
    let refused = error.is_err_and(|e| e.kind() == DeviceErrorKind::OutOfMemory && names(e.to_string()));
    if !refused {
        return Err(format!("2^30 rays were not refused with the sizes {sizes:?}").into());
    }
    tracer.load_rays(rays(4), StreamSpec::default())?;
    let ticket = tracer.submit(&[Task { first: 0, rays: 4 }], None)?;
    Ok(tracer.wait(ticket, LIMIT, &mut Launch::default())?)
}

/// Where both trees do not fit, the two-wide one does all, and the tracer says so; but not where counts were to be of
/// the wide one. Fails without the second try, and when that is made whatever was asked for.
pub(crate) fn a_card_too_small_for_both_trees_holds_one(found: &Found) -> Result<(), Failed> {
    let open = |memory: u64, layouts: Layouts| -> Result<VulkanDevice, Failed> {
        let options = Options { memory: Some(memory), layouts: Some(layouts), ..Options::default() };
        Ok(VulkanDevice::enumerate(options)?.into_iter().nth(found.position).ok_or("the device is gone")??)
    };
    let triangles = shapes::grid(300, 0.2, 3);
    let scene = tree::build(&triangles, Builder::Sah)?;
    // What the two-wide tree and the backend's own buffers need.
    let takes = |memory, layouts| Ok::<_, Failed>(open(memory, layouts)?.tracer(Arc::clone(&scene), clock).is_ok());
    let (mut below, mut least) = (0, 4 * scene.bytes());
    while least - below > 1 << 16 {
        let middle = below.midpoint(least);
        if takes(middle, Layouts::default())? { least = middle } else { below = middle }
    }
    let device = open(least + (1 << 18), Layouts::USUAL)?;
    let tracer = device.tracer(Arc::clone(&scene), clock)?;
    let note = tracer.note().unwrap_or_default();
    if !(note.contains("two-wide") && note.contains("bytes")) {
        return Err(format!("with {least} bytes for a scene of {}: {note:?}", scene.bytes()).into());
    }
    drop(tracer);
    compare_rays(&device, &scene, &RayMaker::new(&triangles, 4).mixed(1_000))?;
    let all_wide = Layouts { trace: Layout::Wide, count: Layout::Wide };
    match open(least + (1 << 18), all_wide)?.tracer(Arc::clone(&scene), clock) {
        Err(error) if error.kind() == DeviceErrorKind::OutOfMemory => {}
        other => return Err(format!("counts of another tree than was asked for: {other:?}").into()),
    }
    let roomy = open(4 * scene.bytes(), Layouts::USUAL)?.tracer(scene, clock)?;
    if roomy.note().is_none() { Ok(()) } else { Err(format!("{:?}", roomy.note()).into()) }
}
