//! Measures what a sampled ray costs in units of a traced one, by how the sample is walked, and how wrong it is: the
//! table of docs/results/sampling.md.
//!
//! `cargo run --release -p rt-benches --bin sampling -- --help`
//!
//! A scene is `yard`, `car` or an OBJ file; tasks are of 1,024 rays. Each repetition traces all rays, walks the sample
//! in each way, and divides: the price is seconds of a sampled ray over seconds of a traced one, the median over the
//! repetitions. Walks count exactly and keep hits; the trace is the one that renders. Errors are per task against
//! exact counts, after one common scale, averaged over eight seeds.
#![forbid(unsafe_code)]

mod options;
mod ways;

use backend_cpu::CpuDevice;
use backend_vulkan::VulkanDevice;
use clap::Parser;
use options::{Device as Chosen, Options};
use rt_balance::clock;
use rt_balance::stats::median;
use rt_bvh::{Builder, PlocQuality};
use rt_core::{
    Device, Hit, RaySource, ReducedWalk, Scene, StreamKind, StreamSpec, Task, TestCounts, Tracer, Walk, tasks_of,
};
use rt_report::print::Stdout;
use rt_report::{Provenance, exit};
use rt_sched::metrics::EstimateErrors;
use rt_sched::sample::Fraction;
use std::error::Error;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;
use ways::{Sample, Subject, Way};

/// Longest wait for a launch: a software rasteriser on a loaded machine is slow.
pub(crate) const LIMIT: Duration = Duration::from_secs(600);

/// Rays of a task: 32 × 32 pixels.
const TASK: u32 = 1024;

/// Samples that errors are averaged over.
const SEEDS: u32 = 8;

fn main() -> ExitCode {
    exit::main(run)
}

fn run() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    writeln!(
        Stdout,
        "{}",
        Provenance::now(
            1,
            [match options.devices {
                Chosen::Processor => "one thread".to_owned(),
                Chosen::Vulkan(place) => format!("vulkan:{place}"),
            }]
        )
    )?;
    writeln!(
        Stdout,
        "Price of a sampled ray in traced ones, medians of {} interleaved repetitions; in brackets the whole sample in % \
         of the trace. Before it, the prices of tracing all rays as single ones over the two-wide tree, of counting \
         them all exactly, and of the paper's reduced walk of all. Error per task in %.\n",
        options.common.repeat
    )?;
    write!(Stdout, "| scene | rays | traced Mray/s | as single rays | counted | reduced | sampled |")?;
    Way::ALL.iter().try_for_each(|(_, name)| write!(Stdout, " {name} |"))?;
    writeln!(
        Stdout,
        " error scattered | error whole packets |\n|---|---|---|---|---|---|---|{}---|---|",
        "---|".repeat(Way::ALL.len())
    )?;
    for name in &options.common.scenes {
        let prepared = rt_benches::open(name, Builder::Ploc(PlocQuality::Medium))?;
        let scene = Arc::clone(&prepared.built.scene);
        let mut subject = Subject {
            tracer: open(&options, &scene)?,
            scene: Arc::clone(&scene),
            is_processor: options.devices == Chosen::Processor,
        };
        for (stream, source, _) in rt_benches::streams(&prepared, options.size)? {
            if let Some(&kind) = options.kinds.iter().find(|kind| kind.to_string().starts_with(stream)) {
                for &fraction in &options.fractions {
                    row(&prepared.name, &mut subject, kind, &source, fraction, options.common.repeat)?;
                }
            }
        }
    }
    Ok(())
}

/// The scene on the device.
fn open(options: &Options, scene: &Arc<Scene>) -> Result<Box<dyn Tracer>, Box<dyn Error>> {
    let scene = Arc::clone(scene);
    if let Chosen::Vulkan(place) = options.devices {
        let found = VulkanDevice::enumerate(backend_vulkan::Options::default())?;
        let device = found.into_iter().nth(place).ok_or_else(|| format!("there is no vulkan:{place}"))??;
        return Ok(device.tracer(scene, clock)?);
    }
    let devices = CpuDevice::open_all(&[1])?;
    Ok(devices.first().ok_or("no CPU device")?.tracer(scene, clock)?)
}

/// Measures one fraction of one stream, and prints it.
fn row(
    scene: &str,
    subject: &mut Subject,
    kind: StreamKind,
    source: &RaySource,
    fraction: Fraction,
    repeat: u32,
) -> Result<(), Box<dyn Error>> {
    let tasks = tasks_of(source.len(), TASK);
    subject.tracer.load_rays(source.clone(), StreamSpec::default())?;
    let exact = exact(&mut *subject.tracer, source.len())?;
    let (mut traced, mut alone) = (Vec::new(), Vec::new());
    let every: Vec<u32> = (0..source.len()).collect();
    let walks = [Walk::Full, Walk::Reduced(ReducedWalk::LeafAsHit)];
    let mut of_all = walks.map(|_| Vec::new());
    let mut prices = [const { Vec::new() }; Way::ALL.len()];
    // The first repetition fills caches and is not counted.
    for run in 0..=repeat {
        let sample = Sample::new(source, kind, &tasks, fraction, run);
        let full = subject.trace(&tasks, None)? / f64::from(source.len());
        for (prices, (way, _)) in prices.iter_mut().zip(Way::ALL) {
            if let Some((seconds, rays)) = subject.run(way, &sample, source, &tasks)?
                && run > 0
            {
                prices.push(seconds / rays as f64 / full);
            }
        }
        for (prices, walk) in of_all.iter_mut().zip(walks) {
            let price = subject.walk(&every, walk)? / f64::from(source.len()) / full;
            if run > 0 {
                prices.push(price);
            }
        }
        if run > 0 {
            traced.push(full);
        }
        if run > 0 && subject.is_processor {
            let seconds = subject.trace_alone(source, 0..source.len(), StreamSpec::default())?;
            alone.push(seconds / f64::from(source.len()) / full);
        }
    }
    write!(Stdout, "| {scene} | {kind} | {:.2} |", 1e-6 / median(&traced))?;
    match alone.is_empty() {
        true => write!(Stdout, " – |")?,
        false => write!(Stdout, " {:.2} |", median(&alone))?,
    }
    of_all.iter().try_for_each(|prices| write!(Stdout, " {:.2} |", median(prices)))?;
    write!(Stdout, " 1/{:.0} |", 1.0 / fraction.value())?;
    for prices in prices {
        match prices.is_empty() {
            true => write!(Stdout, " – |")?,
            false => write!(Stdout, " {:.2} ({:.1}) |", median(&prices), 100.0 * median(&prices) * fraction.value())?,
        }
    }
    let samples: Vec<Sample> = (0..SEEDS).map(|seed| Sample::new(source, kind, &tasks, fraction, seed)).collect();
    let error = |rays: fn(&Sample) -> &[u32]| {
        let errors: Vec<f64> = samples.iter().filter_map(|sample| error(&exact, &tasks, rays(sample))).collect();
        100.0 * errors.iter().sum::<f64>() / errors.len() as f64
    };
    writeln!(Stdout, " {:.1} | {:.1} |", error(|sample| &sample.scattered), error(|sample| &sample.packets))?;
    Ok(())
}

/// Tests of every ray of the loaded stream.
fn exact(tracer: &mut dyn Tracer, rays: u32) -> Result<Vec<u32>, Box<dyn Error>> {
    let every: Vec<u32> = (0..rays).collect();
    let mut counts = vec![TestCounts::default(); every.len()];
    tracer.walk(&every, Walk::Full, &mut counts, None::<&mut [Hit]>)?;
    Ok(counts.iter().map(|counts| counts.boxes + counts.triangles).collect())
}

/// Mean relative error per task of a sample's mean tests against all rays' mean tests.
fn error(exact: &[u32], tasks: &[Task], sample: &[u32]) -> Option<f64> {
    let of = |task: &Task| &exact[task.first as usize..(task.first + task.rays) as usize];
    let truth: Vec<f64> = tasks.iter().map(|task| of(task).iter().map(|&t| f64::from(t)).sum()).collect();
    let estimate: Vec<f64> = tasks
        .iter()
        .map(|task| {
            let begin = sample.partition_point(|&ray| ray < task.first);
            let own = sample[begin..].iter().take_while(|&&ray| ray < task.first + task.rays);
            let (sum, n) = own.fold((0.0, 0.0), |(sum, n), &ray| (sum + f64::from(exact[ray as usize]), n + 1.0));
            sum / n * f64::from(task.rays)
        })
        .collect();
    EstimateErrors::new(&estimate, &truth).map(|errors| errors.mean_relative)
}
