//! Times what masks and several hits of a ray cost beside the nearest hit, on one processor core.
//!
//! `cargo run --release -p rt-benches --bin masks -- --help`
//!
//! Every other triangle has the one mask, the rest another. Each repetition traces all rays in each way, in turns; a
//! way's time is the thread's own, and divided by that of the nearest hit in the same repetition. Rays that go alone
//! walk the scene's two-wide tree, one after the other, as those do that want several hits.
#![forbid(unsafe_code)]

use backend_cpu::CpuDevice;
use clap::Parser;
use rt_balance::clock;
use rt_balance::stats::median;
use rt_benches::options::{self, size};
use rt_bvh::Builder;
use rt_core::{CountedTree, Device, Launch, Precision, Query, RaySource, Scene, StreamSpec, Task, Tracer, tasks_of};
use rt_report::Provenance;
use rt_report::exit::{self, Exit};
use rt_report::print::Stdout;
use std::error::Error;
use std::io::Write;
use std::num::NonZero;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time what masks and several hits of a ray cost beside the nearest hit, on one core.
#[derive(Debug, Parser)]
#[command(after_help = Exit::HELP)]
struct Options {
    #[command(flatten)]
    common: options::Options,
    /// Size of the picture whose rays are traced
    #[arg(long, value_parser = size, default_value = "512x512", value_name = "WxH")]
    size: [u32; 2],
}

/// Rays of a task: 32 × 32 pixels.
const TASK: u32 = 1024;

/// Longest wait for a launch.
const LIMIT: Duration = Duration::from_secs(600);

/// Places of a ray that wants several hits.
const PLACES: [u32; 3] = [1, 4, 16];

/// What a primitive shows to: one or the other of two bits.
const BITS: [u32; 2] = [0b01, 0b10];

fn main() -> ExitCode {
    exit::main(run)
}

fn run() -> Result<(), Box<dyn Error>> {
    let Options { common, size } = Options::parse();
    write!(Stdout, "{}", Provenance::now(1, ["one thread"]))?;
    writeln!(
        Stdout,
        "\nNearest hits in Mray/s, and how many times as long the others take: medians of {} repetitions in turns.\n",
        common.repeat
    )?;
    write!(
        Stdout,
        "| scene | rays | nearest hit | masks, nothing hidden | half hidden | half hidden, alone | alone |"
    )?;
    PLACES.iter().try_for_each(|most| write!(Stdout, " up to {most} |"))?;
    writeln!(Stdout, " tree without the half, ms |\n|---|---|---|---|---|---|---|{}---|", "---|".repeat(PLACES.len()))?;
    for name in &common.scenes {
        let prepared = rt_benches::open(name, Builder::Sah)?;
        let mut subject = Subject::new(&prepared.built.scene)?;
        for (kind, source, _) in rt_benches::streams(&prepared, size)? {
            if kind != "shadow" {
                subject.row(&prepared.name, kind, &source, common.repeat)?;
            }
        }
    }
    Ok(())
}

/// A scene without masks and the same with some, on one core.
struct Subject {
    plain: Box<dyn Tracer>,
    masked: Box<dyn Tracer>,
    /// Streams so far, each of which has a mask of its own.
    streams: u32,
}

impl Subject {
    fn new(scene: &Arc<Scene>) -> Result<Self, Box<dyn Error>> {
        let devices = CpuDevice::open_all(&[1])?;
        let device = devices.first().ok_or("no CPU device")?;
        let masks = (0..scene.primitive_count()).map(|id| BITS[(id % 2) as usize]).collect();
        let masked = Arc::new(Scene::clone(scene).with_masks(masks)?);
        let plain = device.tracer(Arc::clone(scene), clock)?;
        Ok(Self { plain, masked: device.tracer(masked, clock)?, streams: 0 })
    }

    /// Measures one stream in every way, and prints it.
    fn row(&mut self, scene: &str, kind: &str, source: &RaySource, repeat: u32) -> Result<(), Box<dyn Error>> {
        let tasks = tasks_of(source.len(), TASK);
        let nearest = StreamSpec::new(Query::Closest, Precision::Robust, false);
        // What is counted over the scene's own tree is traced so.
        let alone = StreamSpec { counts: true, counted: CountedTree::Scene, ..nearest };
        let several = PLACES.map(|most| StreamSpec { query: all(most), ..nearest });
        let (mut rates, mut making, mut ratios) = (Vec::new(), Vec::new(), vec![Vec::new(); 4 + several.len()]);
        // The first repetition fills caches and is not counted.
        for turn in 0..=repeat {
            self.streams += 1;
            // Bits that no primitive has: so the tree is made anew.
            let half = BITS[0] | self.streams << BITS.len();
            let base = traced(&mut *self.plain, source, nearest, &tasks)?.0;
            let (masked, with) = (&mut *self.masked, |mask: u32, spec: StreamSpec| StreamSpec { mask, ..spec });
            let (hidden, seconds) = traced(masked, source, with(half, nearest), &tasks)?;
            let others = [
                traced(masked, source, with(BITS[0] | BITS[1], nearest), &tasks)?.0,
                hidden,
                traced(masked, source, with(half, alone), &tasks)?.0,
                traced(&mut *self.plain, source, alone, &tasks)?.0,
            ];
            let several = several.iter().map(|&spec| Ok(traced(&mut *self.plain, source, spec, &tasks)?.0));
            let several: Vec<f64> = several.collect::<Result<_, Box<dyn Error>>>()?;
            if turn > 0 {
                rates.push(f64::from(source.len()) / base);
                making.push(seconds);
                let all = others.into_iter().chain(several);
                ratios.iter_mut().zip(all).for_each(|(ratios, seconds)| ratios.push(seconds / base));
            }
        }
        write!(Stdout, "| {scene} | {kind} | {:.2} |", 1e-6 * median(&rates))?;
        ratios.iter().try_for_each(|ratios| write!(Stdout, " {:.2} |", median(ratios)))?;
        writeln!(Stdout, " {:.1} |", 1e3 * median(&making))?;
        Ok(())
    }
}

fn all(most: u32) -> Query {
    Query::All { most: NonZero::new(most).unwrap_or(NonZero::<u32>::MIN) }
}

/// Seconds of the thread that traces all rays, and of loading them.
fn traced(
    tracer: &mut dyn Tracer,
    source: &RaySource,
    spec: StreamSpec,
    tasks: &[Task],
) -> Result<(f64, f64), Box<dyn Error>> {
    let begin = Instant::now();
    tracer.load_rays(source.clone(), spec)?;
    let loading = begin.elapsed().as_secs_f64();
    let mut launch = Launch::default();
    let ticket = tracer.submit(tasks, None)?;
    tracer.wait(ticket, LIMIT, &mut launch)?;
    Ok((launch.task_seconds.iter().map(|&seconds| f64::from(seconds)).sum(), loading))
}
