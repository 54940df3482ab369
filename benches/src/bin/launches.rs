//! Times what surrounds the kernels of a Vulkan device: persistent threads against a lane for each ray, camera rays
//! made there against rays sent, and what a ray of a bounce costs the host.
//!
//! `cargo run --release -p rt-benches --bin launches -- --help`
#![forbid(unsafe_code)]

use backend_vulkan::{GpuDevice, Options as Open, Tuning, VulkanDevice};
use clap::Parser;
use rt_balance::clock;
use rt_balance::stats::{median, ratios};
use rt_benches::options;
use rt_bvh::Builder;
use rt_core::{Device, Launch, RaySource, StreamSpec, Tracer, tasks_of};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::print::Stdout;
use rt_scene::streams::Wave;
use std::error::Error;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The longest a launch may take.
const LIMIT: Duration = Duration::from_secs(600);

/// Time what surrounds the kernels of a Vulkan device.
#[derive(Debug, Parser)]
#[command(after_help = Exit::HELP)]
struct Options {
    #[command(flatten)]
    common: options::Options,
    /// The Vulkan device
    #[arg(long, value_name = "DEVICE", default_value = "vulkan:0", value_parser = options::vulkan)]
    devices: usize,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", value_parser = options::size)]
    size: [u32; 2],
    /// Lanes of launches with persistent threads
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_value = "128,1024,16384")]
    lanes: Vec<u32>,
}

fn main() -> ExitCode {
    exit::main(run)
}

fn run() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    let device = open(options.devices, Tuning::default())?;
    writeln!(Stdout, "{}", Provenance::now(1, [device.info().name.clone()]))?;
    writeln!(
        Stdout,
        "device: {} ({}), makes rays: {}\n",
        device.info().name,
        device.card().driver,
        device.makes_rays()
    )?;
    writeln!(
        Stdout,
        "Mray/s in kernels of one launch with a lane for each ray; with fewer lanes as time over that; ns per ray to \
         load camera rays and have the device make them, and to load those that the host prepares and sends; to load \
         and to find the shadow and diffuse rays that leave; camera rays per million that the device does not make \
         but leaves to the host. Medians of {} interleaved repetitions.\n",
        options.common.repeat
    )?;
    write!(Stdout, "| scene | rays | Mray/s |")?;
    options.lanes.iter().try_for_each(|lanes| write!(Stdout, " {lanes} lanes |"))?;
    writeln!(
        Stdout,
        " made ns | sent ns | spawned ns | left ppm |\n|---|---|---|{}---|---|---|---|",
        "---|".repeat(options.lanes.len())
    )?;
    for name in &options.common.scenes {
        bench(name, &options)?;
    }
    Ok(())
}

fn open(index: usize, tuning: Tuning) -> Result<VulkanDevice, Box<dyn Error>> {
    let found = VulkanDevice::enumerate(Open::from_env()?)?;
    Ok(found.into_iter().nth(index).ok_or("there is no such device")??.tuned(tuning))
}

fn bench(name: &str, options: &Options) -> Result<(), Box<dyn Error>> {
    let prepared = rt_benches::open(name, Builder::default())?;
    let scene = &prepared.built.scene;
    let tracer = |tuning| -> Result<(VulkanDevice, Box<dyn Tracer>), Box<dyn Error>> {
        let device = open(options.devices, tuning)?;
        let tracer = device.tracer(Arc::clone(scene), clock)?;
        Ok((device, tracer))
    };
    let (device, mut first) = tracer(Tuning::default())?;
    let (sender, mut host) = tracer(Tuning { host_rays: true, ..Tuning::default() })?;
    let paths = prepared.paths(&prepared.view(), options.size, 1)?;
    let camera = paths.primary(&Wave::whole(options.size)?);
    let primary = camera.source.clone();
    load(&mut *first, &primary)?;
    let hits = trace(&mut *first, primary.len())?.hits;
    load(&mut *host, &primary)?;
    trace(&mut *host, primary.len())?;
    let [left, doubtful] = [&device, &sender].map(|device| device.counters().on_host());
    let left = (left as f64 - doubtful as f64) / f64::from(primary.len().max(1));
    let mut tracers = vec![first];
    for &lanes in &options.lanes {
        tracers.push(tracer(Tuning { persistent_lanes: Some(lanes), ..Tuning::default() })?.1);
    }
    let mut spawned_s = Vec::new();
    let mut diffuse = primary.clone();
    for _ in 0..options.common.repeat {
        let begin = Instant::now();
        // Shadow rays as well, as rendering makes them.
        let [shadow, rays] = paths.follow(&camera, &hits);
        let rays_made = (shadow.source.len() + rays.source.len()).max(1);
        spawned_s.push(begin.elapsed().as_secs_f64() / f64::from(rays_made));
        diffuse = rays.source;
    }
    for (kind, source) in [("primary", &primary), ("diffuse", &diffuse)] {
        if source.is_empty() {
            continue;
        }
        let rays = f64::from(source.len());
        let (mut kernels, mut made_s, mut sent_s) = (vec![Vec::new(); tracers.len()], Vec::new(), Vec::new());
        // Once unmeasured: kernels are compiled when they are first wanted.
        for run in 0..=options.common.repeat {
            // What a device makes it makes in the first launch.
            let begin = load(&mut *tracers[0], source)? + seconds(&mut *tracers[0], source.len())?;
            let made = (begin - seconds(&mut *tracers[0], source.len())?) / rays;
            let sent = load(&mut *host, source)? / rays;
            for tracer in &mut tracers[1..] {
                load(&mut **tracer, source)?;
                trace(&mut **tracer, source.len())?;
            }
            for (times, tracer) in kernels.iter_mut().zip(&mut tracers) {
                let seconds = trace(&mut **tracer, source.len())?.span.in_kernel.as_secs_f64();
                if run > 0 {
                    times.push(seconds);
                }
            }
            if run > 0 {
                made_s.push(made);
                sent_s.push(sent);
            }
        }
        let ratio = |k: usize| median(&ratios(&kernels[k], &kernels[0]));
        write!(Stdout, "| {} | {kind} | {:.2} |", prepared.name, rays / median(&kernels[0]) / 1e6)?;
        (1..kernels.len()).try_for_each(|k| write!(Stdout, " {:.2} |", ratio(k)))?;
        let ns = |seconds: &[f64]| format!("{:.0}", median(seconds) * 1e9);
        match kind {
            "primary" => writeln!(Stdout, " {} | {} | | {:.1} |", ns(&made_s), ns(&sent_s), left * 1e6)?,
            _ => writeln!(Stdout, " | {} | {} | |", ns(&sent_s), ns(&spawned_s))?,
        }
    }
    Ok(())
}

/// Seconds that loading takes.
fn load(tracer: &mut dyn Tracer, source: &RaySource) -> Result<f64, Box<dyn Error>> {
    let begin = Instant::now();
    tracer.load_rays(source.clone(), StreamSpec::default())?;
    Ok(begin.elapsed().as_secs_f64())
}

/// Seconds that a launch of all rays takes.
fn seconds(tracer: &mut dyn Tracer, rays: u32) -> Result<f64, Box<dyn Error>> {
    Ok(trace(tracer, rays)?.span.duration().as_secs_f64())
}

fn trace(tracer: &mut dyn Tracer, rays: u32) -> Result<Launch, Box<dyn Error>> {
    let ticket = tracer.submit(&tasks_of(rays, u32::MAX), None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok(launch)
}
