//! GPU backends: the conformance suite, bit for bit the processor's hits and counts on real scenes, closed meshes that
//! do not leak, how many rays are left to the host, and what each backend does when things go wrong.
//!
//! Every device that a backend lists is tried, Vulkan's with the validation layer where it is installed; of a software
//! driver that is there several times the first, and the others with one scene and all together. Without a device the
//! tests are ignored with the reason, unless `RT_REQUIRE` names the backend: then device and layer must be there.

mod contraction;
mod hits;
mod limits;
mod mixed;
mod spirv;
mod visits;
mod vulkan;
mod wgpu;

use backend_vulkan::{OpenError, VulkanDevice};
use backend_wgpu::WgpuDevice;
use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use rt_conformance::{Subject, trials};
use rt_core::Device;
use rt_gpu::{FaultInjection, GpuDevice, Tuning};
use rt_report::print::note;
use rt_scene::builtin;
use rt_tests::cards::are_copies;
use rt_tests::scenes;
use std::fmt::Display;
use std::sync::Arc;
use std::time::Duration;

/// The longest a launch may take; a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(120);

/// A device, and the backend and position by which it can be opened again.
#[derive(Clone)]
struct Found {
    backend: Backend,
    position: usize,
    /// Such as `vulkan/llvmpipe/0`.
    label: String,
    device: Arc<dyn GpuDevice>,
}

/// A way to graphics cards.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Backend {
    Vulkan,
    Wgpu,
}

/// A device, or why it cannot be used.
type Opened = Result<Arc<dyn GpuDevice>, String>;

impl Backend {
    const fn name(self) -> &'static str {
        match self {
            Self::Vulkan => "vulkan",
            Self::Wgpu => "wgpu",
        }
    }

    /// Every device of the system, in its order; Vulkan's with the validation layer if it is there or required.
    fn enumerate(self) -> Result<Vec<Opened>, String> {
        self.enumerate_with(None, Tuning::default())
    }

    /// The same, opened with what a test wants of them.
    fn enumerate_with(self, fault: Option<FaultInjection>, tuning: Tuning) -> Result<Vec<Opened>, String> {
        fn all<T, D: GpuDevice + 'static, E: Display>(
            found: Result<Vec<Result<T, E>>, E>,
            tuned: impl Fn(T) -> D,
        ) -> Result<Vec<Opened>, String> {
            let upcast = |device| Arc::new(tuned(device)) as Arc<dyn GpuDevice>;
            let each = |found: Result<T, E>| found.map(upcast).map_err(|e| e.to_string());
            Ok(found.map_err(|e| e.to_string())?.into_iter().map(each).collect())
        }
        match self {
            Self::Vulkan => {
                let options = backend_vulkan::Options { fault, ..Default::default() };
                let open = |validation| VulkanDevice::enumerate(backend_vulkan::Options { validation, ..options });
                let found = match open(true) {
                    Err(OpenError::NoValidation) if !self.is_required() => open(false),
                    found => found,
                };
                all(found, |device| device.tuned(tuning))
            }
            Self::Wgpu => {
                let options = backend_wgpu::Options { fault, ..Default::default() };
                all(WgpuDevice::enumerate(options), |device| device.tuned(tuning))
            }
        }
    }

    /// Whether `RT_REQUIRE` names it.
    fn is_required(self) -> bool {
        std::env::var("RT_REQUIRE").is_ok_and(|list| list.split(',').any(|name| name.trim() == self.name()))
    }
}

impl Found {
    /// The same device opened anew, for tests that break it or look at its counters.
    fn again(&self) -> Opened {
        let position = self.position;
        self.backend.enumerate()?.into_iter().nth(position).ok_or("the device is gone")?
    }

    /// A test of this device.
    fn trial(&self, name: &str, test: impl FnOnce(&Self) -> Result<(), Failed> + Send + 'static) -> Trial {
        let found = self.clone();
        Trial::test(name, move || test(&found)).with_kind(self.label.clone())
    }

    /// The same for a test that may say why it was not run.
    fn ignorable(&self, name: &str, test: impl FnOnce(&Self) -> Result<Completion, Failed> + Send + 'static) -> Trial {
        let found = self.clone();
        Trial::ignorable_test(name, move || test(&found)).with_kind(self.label.clone())
    }
}

fn main() {
    let arguments = Arguments::from_args();
    let mut all = Vec::new();
    let mut devices = Vec::new();
    for backend in [Backend::Vulkan, Backend::Wgpu] {
        let (found, mut subjects) = find(backend);
        let are_copies = are_copies(&found.iter().map(|found| found.device.card()).collect::<Vec<_>>());
        let own = || found.iter().zip(&are_copies).filter(|(_, is_copy)| !**is_copy).map(|(found, _)| found);
        subjects.extend(own().map(|found| {
            let name = format!("{}/", backend.name());
            let device: Arc<dyn Device> = found.device.clone();
            Subject::new(backend.name(), found.label.trim_start_matches(&name), Ok(device))
        }));
        all.extend(trials(subjects));
        let count = found.len();
        all.extend(own().flat_map(|found| of_device(found, count)));
        let copies = found.iter().zip(&are_copies).filter(|(_, is_copy)| **is_copy);
        all.extend(copies.map(|(found, _)| builtin_car(found)));
        all.extend(visits::trials(backend, &found));
        devices.extend(found);
    }
    all.extend(mixed::trials(&devices));
    run(&arguments, all).exit();
}

fn builtin_car(found: &Found) -> Trial {
    found.trial("builtin_car_is_the_processors", |found| hits::compare(&*found.device, &builtin::car()))
}

/// The tests of one of `count` devices of a backend.
fn of_device(found: &Found, count: usize) -> Vec<Trial> {
    let mut all = vec![
        found.trial("closed_meshes_do_not_leak", move |found| hits::closed_meshes_do_not_leak(found, count)),
        found.trial("few_random_rays_are_left_to_the_host", hits::few_random_rays_are_left_to_the_host),
        found
            .trial("tiny_triangles_close_by_are_the_processors", |found| hits::tiny_triangles_close_by(&*found.device)),
        found.trial("builtin_yard_is_the_processors", |found| hits::compare(&*found.device, &builtin::yard())),
        builtin_car(found),
        found.trial("too_many_rays_are_refused_with_their_size", limits::too_many_rays_are_refused_with_their_size),
    ];
    all.extend(match found.backend {
        Backend::Vulkan => vulkan::trials(found),
        Backend::Wgpu => wgpu::trials(found),
    });
    if found.position == 0 && found.backend == Backend::Vulkan {
        all.extend(contraction::trials(found));
    }
    match scenes::find() {
        Ok(scenes) => all.extend(scenes.into_iter().map(|scene| {
            let name = format!("{}_is_the_processors", scene.name);
            found.trial(&name, move |found| {
                let model = scenes::load(&scene)?;
                hits::compare(&*found.device, &model)
            })
        })),
        Err(reason) => all.push(found.ignorable("real_scenes", move |_| Ok(Completion::ignored_with(reason)))),
    }
    all
}

/// A backend's devices; and in place of missing ones, subjects that say why.
fn find(backend: Backend) -> (Vec<Found>, Vec<Subject>) {
    let missing = |reason: String| (Vec::new(), vec![Subject::new(backend.name(), "none", Err(reason))]);
    let opened = match backend.enumerate() {
        Ok(opened) => opened,
        Err(reason) => return missing(reason),
    };
    let (mut devices, mut reasons) = (Vec::new(), Vec::new());
    for (position, device) in opened.into_iter().enumerate() {
        match device {
            Ok(device) => {
                let name = device.info().name.to_lowercase();
                let name = name.split_whitespace().next().unwrap_or("device");
                let label = format!("{}/{name}/{}", backend.name(), devices.len());
                let card = device.card();
                note(format_args!("{label}: {} ({}; kernels: {})", card.name, card.driver, card.kernels));
                devices.push(Found { backend, position, label, device });
            }
            Err(reason) => reasons.push(reason),
        }
    }
    if devices.is_empty() {
        return missing(reasons.join("; "));
    }
    reasons.iter().for_each(|reason| note(format_args!("{}: {reason}", backend.name())));
    (devices, Vec::new())
}
