//! The canary: what becomes of the kernels on a driver that contracts a·b + c, which the software rasteriser does not
//! do.
//!
//! Products are fused by force with the sums they feed. The kernels for Vulkan, whose decoration forbids that and is
//! disregarded, must be found out: by the check at the start, and, where that is passed over, by other hits. The
//! kernels for wgpu, which cannot carry the decoration, must bear it. So for flushing denormal numbers to zero, which
//! that rasteriser does not either.

use crate::spirv::{Pattern, flattened, flushed, fused};
use crate::{Backend, Found, hits};
use backend_vulkan::{Options, Replacement, VulkanDevice};
use libtest_mimic::{Completion, Failed, Trial};
use naga::back::spv;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use rt_bvh::Builder;
use rt_core::{Ray, Scene};
use rt_report::print::note;
use rt_shaders::{Kernel, Purpose};
use rt_verify::rays::{Aim, RayMaker};
use rt_verify::{shapes, tree};
use std::process::Command;
use std::sync::Arc;

/// Rays at edges and vertices of closed meshes, for each pattern: kernels that are not mended fail on one in a hundred.
const RAYS: u32 = 20_000;

/// The patterns that kernels without defence do not bear. They bear it by luck when only left or only right operands
/// are fused: then two_product loses the rest of p where the next sum finds it again, being fused with p itself.
const BREAKING: [Pattern; 2] = [Pattern::Both, Pattern::Scattered];

/// A replacement of kernels, as the backend takes it: a function for each pattern.
type Replace = fn(&'static Kernel) -> Vec<u32>;

fn hidden(pattern: Pattern) -> Replace {
    match pattern {
        Pattern::Left => |kernel| contracted(kernel, true, Pattern::Left),
        Pattern::Right => |kernel| contracted(kernel, true, Pattern::Right),
        Pattern::Both => |kernel| contracted(kernel, true, Pattern::Both),
        Pattern::Scattered => |kernel| contracted(kernel, true, Pattern::Scattered),
    }
}

fn bare(pattern: Pattern) -> Replace {
    match pattern {
        Pattern::Left => |kernel| contracted(kernel, false, Pattern::Left),
        Pattern::Right => |kernel| contracted(kernel, false, Pattern::Right),
        Pattern::Both => |kernel| contracted(kernel, false, Pattern::Both),
        Pattern::Scattered => |kernel| contracted(kernel, false, Pattern::Scattered),
    }
}

pub(crate) fn trials(found: &Found) -> Vec<Trial> {
    let mut all = Vec::new();
    for pattern in Pattern::ALL {
        let name = format!("contraction_of_{pattern:?}_products_spares_kernels_for_wgpu").to_lowercase();
        all.push(found.ignorable(&name, move |found| if_there_are_tools(|| spares(found, hidden(pattern)))));
    }
    for pattern in BREAKING {
        let name = format!("contraction_of_{pattern:?}_products_breaks_kernels_without_defence").to_lowercase();
        all.push(found.ignorable(&name, move |found| if_there_are_tools(|| breaks(found, bare(pattern)))));
    }
    all.push(found.trial("flushed_denormal_numbers_change_nothing", flushed_denormal_numbers_change_nothing));
    let name = "a_device_that_contracts_is_refused";
    all.push(found.ignorable(name, |found| if_there_are_tools(|| is_refused(found))));
    all
}

fn if_there_are_tools(test: impl FnOnce() -> Result<(), Failed>) -> Result<Completion, Failed> {
    let there = Command::new("spirv-opt").arg("--version").output().is_ok_and(|out| out.status.success());
    if there || Backend::Vulkan.is_required() {
        return test().map(|()| Completion::Completed);
    }
    Ok(Completion::ignored_with("spirv-opt is not installed (Debian: spirv-tools)"))
}

/// The kernel for wgpu if `hidden`, else that for Vulkan, fused. The check at the start is left as
/// it is, so that the device is opened.
fn contracted(kernel: &'static Kernel, hidden: bool, pattern: Pattern) -> Vec<u32> {
    if kernel.purpose == Purpose::Arithmetic {
        return kernel.spirv();
    }
    contracted_always(kernel, hidden, pattern)
}

fn contracted_always(kernel: &'static Kernel, hidden: bool, pattern: Pattern) -> Vec<u32> {
    let plain = if hidden { compiled(kernel.wgsl) } else { kernel.spirv() };
    let name = format!("{:?}-{:?}-{}-{hidden}-{pattern:?}", kernel.layout, kernel.purpose, kernel.stack);
    let flat = flattened(&plain, &name).expect("spirv-opt takes what naga makes");
    let (words, count) = fused(&flat, pattern);
    // Filters and bounds are fused in kernels for wgpu too: they may be.
    assert!(count > 0 || (hidden && kernel.purpose == Purpose::Arithmetic), "{name}: nothing to fuse");
    words
}

/// As wgpu compiles it: without decorations.
fn compiled(wgsl: &str) -> Vec<u32> {
    let module = naga::front::wgsl::parse_str(wgsl).expect("checked when the kernels were built");
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module);
    let options = spv::Options { lang_version: (1, 3), flags: spv::WriterFlags::empty(), ..spv::Options::default() };
    spv::write_vec(&module, &info.expect("checked likewise"), &options, None).expect("likewise")
}

fn open(found: &Found, replace: Replace) -> Result<VulkanDevice, Failed> {
    // SAFETY: what this file puts in place is a kernel's own code with products fused into sums, numbers flushed to
    // zero, or compiled without decorations. So results are rounded otherwise, and another path is taken through a
    // finite tree and its leaves, whose indices are all valid; nothing else is accessed, and every step visits another
    // node.
    let kernels = unsafe { Replacement::new(replace) };
    let options = Options { kernels: Some(kernels), ..Options::default() };
    let devices = VulkanDevice::enumerate(options)?;
    Ok(devices.into_iter().nth(found.position).ok_or("the device is gone")??)
}

/// A closed mesh, and rays that kernels leak on.
struct Mesh {
    scene: Arc<Scene>,
    rays: Vec<(Ray, u32)>,
}

fn meshes() -> Result<Vec<Mesh>, Failed> {
    let offsets = [glam::Vec3::ZERO, glam::Vec3::new(1e3, -2e3, 7.0)];
    let mesh = |offset| {
        let triangles = shapes::moved(&shapes::icosphere(4), offset);
        let maker = RayMaker::new(&triangles, 12);
        let inner = (0..RAYS / 4).map(|i| hits::inner_ray(&triangles, offset, i));
        let outer = (0..RAYS / 4).map(|i| maker.ray(if i & 1 == 0 { Aim::Edge } else { Aim::Vertex }, i));
        Ok(Mesh { scene: tree::build(&triangles, Builder::Sah)?, rays: inner.chain(outer).collect() })
    };
    offsets.into_iter().map(mesh).collect()
}

/// Fails when the defence is in the source already, so that [`spares`] would show nothing.
fn breaks(found: &Found, replace: Replace) -> Result<(), Failed> {
    let device = open(found, replace)?;
    for Mesh { scene, rays } in meshes()? {
        if let Err(difference) = hits::compare_rays(&device, &scene, &rays) {
            note(format_args!("as it should: {}", difference.message().unwrap_or_default()));
            return Ok(());
        }
    }
    Err("fused kernels without defence give the processor's hits: the canary is blind".into())
}

/// Fails when the hidden `keep` returns its argument.
fn spares(found: &Found, replace: Replace) -> Result<(), Failed> {
    let device = open(found, replace)?;
    meshes()?.into_iter().try_for_each(|Mesh { scene, rays }| hits::compare_rays(&device, &scene, &rays))
}

/// Fails without the kernels' LEAST_SUM: distances to tiny triangles are then off by more than the kernels believe.
fn flushed_denormal_numbers_change_nothing(found: &Found) -> Result<(), Failed> {
    hits::tiny_triangles_close_by(&open(found, |kernel| flushed(&kernel.spirv()))?)
}

/// The check at the start finds a device out that fuses, but not one whose kernels bear it.
fn is_refused(found: &Found) -> Result<(), Failed> {
    let opened = open(found, |kernel| contracted_always(kernel, false, Pattern::Both));
    if !opened.as_ref().is_err_and(|error| error.message().is_some_and(|text| text.contains("IEEE 754"))) {
        return Err(format!("a device that contracts was opened: {opened:?}").into());
    }
    open(found, |kernel| contracted_always(kernel, true, Pattern::Both)).map(drop)
}
