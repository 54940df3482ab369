//! What does not fit.

use crate::{Found, LIMIT};
use libtest_mimic::Failed;
use rt_bvh::Builder;
use rt_core::{Camera, CameraRays, DeviceErrorKind, Launch, RaySource, StreamSpec, Task};
use rt_tests::conformance::clock;
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
        RaySource::Camera(Arc::new(CameraRays { camera, size: [1, 1], pixels: [0].into(), samples, seed: 1 }))
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
