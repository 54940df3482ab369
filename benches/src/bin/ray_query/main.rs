//! Compares our kernels with the driver's own ray tracing on one Vulkan device: Mray/s of the time in kernels, and the
//! answers.
//!
//! `cargo run --release -p rt-benches --bin ray_query -- --help`
//!
//! The peer is the driver's acceleration structure, built for fast tracing, asked by `VK_KHR_ray_query` from a compute
//! kernel with a lane for each ray: the hardware's way of a ray-tracing pipeline without its shader tables. Both read
//! rays from a buffer and write four bytes a ray. The peer is not told which triangle a ray leaves: rays of bounces
//! start at 2⁻¹⁶ of the scene's largest coordinate instead.
#![deny(unsafe_code)]

mod peer;

use backend_vulkan::{GpuDevice, Options as Open, VulkanDevice};
use clap::Parser;
use peer::Peer;
use rt_balance::clock;
use rt_balance::stats::{Summary, median};
use rt_benches::options;
use rt_bvh::Builder;
use rt_core::{Device, Hit, Launch, Query, RaySource, StreamSpec, Tracer, tasks_of};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::print::Stdout;
use rt_scene::prepare::Prepared;
use std::error::Error;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

/// The longest a launch may take; a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(300);

/// Compare our kernels with the driver's own ray tracing on one Vulkan device.
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
}

fn main() -> ExitCode {
    exit::main(run)
}

fn run() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    let device = VulkanDevice::enumerate(Open::from_env()?)?;
    let device = device.into_iter().nth(options.devices).ok_or("there is no such device")??;
    let peer = Peer::open(options.devices)?;
    writeln!(Stdout, "{}", Provenance::now(1, [device.info().name.clone(), peer.name.clone()]))?;
    writeln!(Stdout, "ours: {} ({})\npeer: ray queries on {}\n", device.info().name, device.card().driver, peer.name)?;
    if device.card().model != peer.model {
        return Err("the two lists of devices differ: choose one of --devices that is the same card in both".into());
    }
    writeln!(
        Stdout,
        "Mray/s of the time in kernels, medians of {} interleaved repetitions; ours over the peer's pair by pair with its 95% \
         interval; rays per million with other answers (for any-hit rays: hit or not). Seconds to build the peer's \
         tree: on the device, upload included.\n",
        options.common.repeat
    )?;
    writeln!(
        Stdout,
        "| scene | rays | ours Mray/s | peer Mray/s | ours / peer | other answers ppm | ours built s | peer built s |"
    )?;
    writeln!(Stdout, "|---|---|---|---|---|---|---|---|")?;
    for name in &options.common.scenes {
        let prepared = rt_benches::open(name, Builder::default())?;
        compare(&prepared, (&device, &peer), &options)?;
    }
    Ok(())
}

/// Prints a line for each stream of a scene.
fn compare(
    prepared: &Prepared,
    (device, peer): (&VulkanDevice, &Peer),
    options: &Options,
) -> Result<(), Box<dyn Error>> {
    let ours_s = prepared.build_s;
    let tree = peer.build(&prepared.model)?;
    let mut tracer = device.tracer(Arc::clone(&prepared.built.scene), clock)?;
    for (kind, source, query) in rt_benches::streams(prepared, options.size)? {
        let rays = peer.load(&tree, &source, query);
        tracer.load_rays(source.clone(), StreamSpec { query, ..StreamSpec::default() })?;
        let (mut times, mut differing) = ([Vec::new(), Vec::new()], 0);
        // Once unmeasured: kernels are compiled when they are first wanted.
        for run in 0..=options.common.repeat {
            let ours = trace(&mut *tracer, &source)?;
            let theirs = peer.trace(&rays)?;
            if run > 0 {
                times[0].push(ours.span.in_kernel.as_secs_f64());
                times[1].push(theirs.seconds);
            } else {
                differing =
                    ours.hits.iter().zip(&theirs.found).filter(|(ours, theirs)| differ(ours, **theirs, query)).count();
            }
        }
        let speed = |times: &[f64]| f64::from(source.len()) / median(times) / 1e6;
        let Summary { median: ratio, low, high, .. } = Summary::of_ratios(&times[1], &times[0]);
        writeln!(
            Stdout,
            "| {} | {kind} | {:.2} | {:.2} | {:.2} ({low:.2} – {high:.2}) | {:.1} | {ours_s:.2} | {:.2} |",
            prepared.name,
            speed(&times[0]),
            speed(&times[1]),
            ratio,
            differing as f64 / f64::from(source.len().max(1)) * 1e6,
            tree.built_s,
        )?;
    }
    Ok(())
}

/// Whether the answers to a ray differ.
fn differ(ours: &Hit, theirs: u32, query: Query) -> bool {
    match query {
        Query::Closest | Query::All { .. } => ours.primitive != theirs,
        Query::Any => ours.is_hit() != (theirs != u32::MAX),
    }
}

fn trace(tracer: &mut dyn Tracer, source: &RaySource) -> Result<Launch, Box<dyn Error>> {
    let ticket = tracer.submit(&tasks_of(source.len(), u32::MAX), None)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok(launch)
}
