//! Compares the two-wide and the eight-wide layout: size, tests and speed, on one processor thread and on Vulkan devices.
//!
//! `cargo run --release -p rt-benches --bin layouts -- SCENE... [--runs 7] [--size 512x512] [--vulkan 0,1]`
#![forbid(unsafe_code)]

use backend_vulkan::{GpuDevice, Layout, Layouts, VulkanDevice};
use rt_balance::stats::median;
use rt_benches::{BenchScene, options};
use rt_bvh::{BuildOptions, Mesh, Stack, WideTree, build};
use rt_core::{Device, Hit, Launch, Precision, Query, RaySource, Scene, StreamSpec, TestCounts, Tracer, tasks_of};
use std::error::Error;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// The longest a launch may take; a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(300);

struct Options {
    scenes: Vec<String>,
    runs: usize,
    size: [u32; 2],
    /// Positions in the order of the system's list.
    vulkan: Vec<usize>,
}

/// What traces a stream over both layouts, and how to read its name.
struct Subject {
    name: String,
    devices: Option<[VulkanDevice; 2]>,
}

/// One scene in both layouts.
struct Built {
    scene: Arc<Scene>,
    tree: WideTree,
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::parse()?;
    println!("command: {}\n", std::env::args().skip(1).collect::<Vec<_>>().join(" "));
    let subjects = subjects(&options)?;
    let mut rows = Vec::new();
    println!("| scene | triangles | two-wide nodes | MiB | depth | wide nodes | MiB | depth | made in ms |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for name in &options.scenes {
        let bench = BenchScene::open(name)?;
        let mesh = Mesh { positions: &bench.model.positions, indices: &bench.model.indices };
        let scene = build(mesh, &BuildOptions::default())?.scene;
        let begin = Instant::now();
        let tree = WideTree::new(&scene);
        let made = begin.elapsed().as_secs_f64() * 1e3;
        let boxes = tree.check()?;
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let (two, wide) = (scene.nodes().len(), tree.nodes().len());
        println!(
            "| {} | {} | {two} | {:.2} | {} | {wide} ({boxes} boxes checked) | {:.2} | {} | {made:.1} |",
            bench.name,
            scene.triangles().len(),
            mib(size_of_val(scene.nodes()) as u64),
            scene.depth(),
            mib(tree.bytes()),
            tree.depth(),
        );
        let built = Built { scene, tree };
        for (kind, source, query) in bench.streams(&built.scene, options.size)? {
            for subject in &subjects {
                let speed = compare(subject, &built, &source, query, options.runs)?;
                let name = &bench.name;
                rows.push(format!(
                    "| {name} | {kind} | {} | {speed} | {} |",
                    subject.name,
                    tests(&built, &source, query)
                ));
            }
        }
    }
    println!(
        "\nMray/s of robust closest or any hit, on a Vulkan device of the time in kernels; medians of {} interleaved runs. Tests \
         of a ray: boxes + triangles.\n",
        options.runs
    );
    println!("| scene | rays | device | two-wide Mray/s | wide Mray/s | wide/two | tests two-wide | tests wide |");
    println!("|---|---|---|---|---|---|---|---|");
    rows.iter().for_each(|row| println!("{row}"));
    Ok(())
}

/// The processor, and each device that was asked for, opened once for each layout.
fn subjects(options: &Options) -> Result<Vec<Subject>, Box<dyn Error>> {
    let mut subjects = vec![Subject { name: "one thread".to_owned(), devices: None }];
    for &index in &options.vulkan {
        let open = |trace| -> Result<VulkanDevice, Box<dyn Error>> {
            let layouts = Some(Layouts { trace, ..Layouts::default() });
            let found = VulkanDevice::enumerate(backend_vulkan::Options { layouts, ..Default::default() })?;
            Ok(found.into_iter().nth(index).ok_or_else(|| format!("there is no vulkan:{index}"))??)
        };
        let devices = [open(Layout::Two)?, open(Layout::Wide)?];
        let name = format!("vulkan:{index} {} ({})", devices[0].info().name, devices[0].card().driver);
        subjects.push(Subject { name, devices: Some(devices) });
    }
    Ok(subjects)
}

/// Mray/s over both layouts, and how much faster the wide one is, pair by pair: a machine whose speed drifts compares
/// neighbours in time.
fn compare(
    subject: &Subject,
    built: &Built,
    source: &RaySource,
    query: Query,
    runs: usize,
) -> Result<String, Box<dyn Error>> {
    let spec = StreamSpec { query, ..StreamSpec::default() };
    let mut times = [Vec::new(), Vec::new()];
    let mut tracers = match &subject.devices {
        None => None,
        Some(devices) => {
            let load = |device: &VulkanDevice| -> Result<Box<dyn Tracer>, Box<dyn Error>> {
                let mut tracer = device.tracer(Arc::clone(&built.scene), clock)?;
                tracer.load_rays(source.clone(), spec)?;
                // Compiles the kernel and makes the rays.
                launch(&mut *tracer, source.len())?;
                Ok(tracer)
            };
            Some([load(&devices[0])?, load(&devices[1])?])
        }
    };
    for _ in 0..runs {
        for (layout, times) in times.iter_mut().enumerate() {
            times.push(match &mut tracers {
                None => on_thread(built, layout == 1, spec, source).0,
                Some(tracers) => launch(&mut *tracers[layout], source.len())?,
            });
        }
    }
    let speed = |layout: usize| f64::from(source.len()) / median(&times[layout]) / 1e6;
    let ratio = median(&times[0].iter().zip(&times[1]).map(|(two, wide)| two / wide).collect::<Vec<_>>());
    Ok(format!("{:.2} | {:.2} | {ratio:.2}", speed(0), speed(1)))
}

/// Traces the first rays on a device and returns the seconds in kernels.
fn launch(tracer: &mut dyn Tracer, rays: u32) -> Result<f64, Box<dyn Error>> {
    let ticket = tracer.submit(&tasks_of(rays, u32::MAX), None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok(launch.span.in_kernel.as_secs_f64())
}

/// Traces a stream on this thread and returns the seconds, and the tests if they are counted.
fn on_thread(built: &Built, wide: bool, spec: StreamSpec, source: &RaySource) -> (f64, [u64; 2]) {
    let mut stack = Stack::for_scene(&built.scene);
    let mut tests = [0, 0];
    let sink = |hit: Hit, counts: TestCounts| {
        std::hint::black_box(hit);
        tests[0] += u64::from(counts.boxes);
        tests[1] += u64::from(counts.triangles);
    };
    let rays = (0..source.len()).map(|i| source.ray(i));
    let begin = Instant::now();
    if wide {
        rt_bvh::trace_wide(&built.tree, &mut stack, spec, rays, sink);
    } else {
        rt_bvh::trace(&built.scene, &mut stack, spec, rays, sink);
    }
    (begin.elapsed().as_secs_f64(), tests)
}

/// Mean tests of a ray over both layouts.
fn tests(built: &Built, source: &RaySource, query: Query) -> String {
    let spec = StreamSpec { query, precision: Precision::Robust, counts: true };
    let of = |wide| {
        let (_, tests) = on_thread(built, wide, spec, source);
        let [boxes, triangles] = tests.map(|tests| tests as f64 / f64::from(source.len()));
        format!("{boxes:.1} + {triangles:.1}")
    };
    format!("{} | {}", of(false), of(true))
}

fn clock() -> Duration {
    static ORIGIN: OnceLock<Instant> = OnceLock::new();
    ORIGIN.get_or_init(Instant::now).elapsed()
}

impl Options {
    fn parse() -> Result<Self, Box<dyn Error>> {
        let mut vulkan = Vec::new();
        let shared = options::Options::parse([512, 512], |name, value| {
            match name {
                "--vulkan" => vulkan = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?,
                _ => return Ok(false),
            }
            Ok(true)
        })?;
        let options::Options { scenes, runs, size } = shared;
        Ok(Self { scenes, runs, size, vulkan })
    }
}
