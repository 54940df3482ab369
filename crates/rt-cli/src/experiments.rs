//! The commands that measure: their options handed to rt-lab, what they find shown on the terminal.

use crate::args::{
    BenchArgs, CompareArgs, DiffArgs, Figure1Args, PrecisionTradeoffArgs, SceneArgs, SimulateArgs, TradeArg, TradeArgs,
    TradeoffArgs, opener,
};
use crate::memory::{BYTES_PER_MEASURED_RAY, Room};
use crate::{interrupt, progress, scene};
use anyhow::Result;
use indicatif::ProgressBar;
use rt_balance::devices::AUTO;
use rt_lab::tradeoff::{Chosen, precision};
use rt_lab::{Lab, Show, bench, compare, figure1, simulate, tradeoff};
use rt_render::TaskCut;
use rt_report::diff::Diff;
use rt_report::print::{Stdout, note};
use rt_scene::prepare::Prepared;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// How finely the bar is divided; it is 40 characters wide.
const WHOLE: f64 = 10_000.0;

/// A progress bar, and results on standard output.
struct Terminal {
    bar: ProgressBar,
}

impl Show for Terminal {
    fn print(&self, text: &str) -> io::Result<()> {
        self.bar.suspend(|| writeln!(Stdout, "{text}"))
    }

    fn note(&self, text: &str) {
        self.bar.suspend(|| note(format_args!("note: {text}")));
    }

    fn progress(&self, label: &str, done: f64) {
        if self.bar.message() != label {
            self.bar.set_message(label.to_owned());
        }
        self.bar.set_position((WHOLE * done) as u64);
    }

    fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Refuses streams of more rays than there is memory for. Sizes that the user does not choose fit every machine.
fn require_room(rays: Option<u64>, advice: &str) -> Result<()> {
    let Some(rays) = rays else { return Ok(()) };
    let bytes = rays.saturating_mul(BYTES_PER_MEASURED_RAY);
    Ok(Room::now().require(bytes, &format!("measuring streams of {rays} rays"), advice)?)
}

fn pixels(size: Option<[u32; 2]>) -> Option<u64> {
    size.map(|[width, height]| u64::from(width) * u64::from(height))
}

/// Runs an experiment on scenes that are prepared as the options say.
fn measure(scenes: &[PathBuf], source: &SceneArgs, experiment: impl FnOnce(Lab<'_>) -> Result<()>) -> Result<()> {
    scene::check(scenes)?;
    let show = Terminal { bar: progress::bar("", WHOLE as u64) };
    let scenes = |scene: &Path| -> Result<Prepared> { source.prepare(scene) };
    experiment(Lab::new(&scenes, &opener, interrupt::flag(), &show))
}

pub(crate) fn figure1(args: &Figure1Args) -> Result<()> {
    require_room(pixels(args.size), "choose a smaller --size")?;
    let options = figure1::Options {
        scenes: args.scenes.clone(),
        estimator: args.estimate.chosen()?,
        fraction: args.estimate.fraction,
        devices: args.devices.clone(),
        replay: args.replay,
        task_sizes: args.task_sizes.clone(),
        size: args.size,
        repeat: args.repeat,
        seed: args.seed,
        quick: args.quick,
        out: args.out.clone(),
    };
    measure(&args.scenes, &args.source, |lab| figure1::run(lab, &options))
}

pub(crate) fn compare(args: &CompareArgs) -> Result<()> {
    args.device.check(args.devices.as_deref())?;
    let options = compare::Options {
        scene: args.scene.clone(),
        devices: args.devices.as_deref().unwrap_or(AUTO).to_owned(),
        cards: args.device.cards(),
        isa: args.device.isa,
        queues: args.queue.clone(),
        policies: args.policy.clone(),
        estimators: args.estimator.clone(),
        fraction: args.fraction,
        cut: TaskCut::of_options(args.tasks, args.task_size),
        size: args.size,
        samples: args.spp,
        bounces: args.bounces,
        repeat: args.repeat,
        budget: args.budget,
        seed: args.seed,
        reference: args.reference,
        quick: args.quick,
        json: args.json,
        out: args.out.clone(),
    };
    require_room(Some(options.rays()), "choose a smaller --size or --spp")?;
    let scene = std::slice::from_ref(&args.scene);
    measure(scene, &args.source, |lab| compare::run(lab, &options))
}

pub(crate) fn diff(args: &DiffArgs) -> Result<()> {
    let diff = Diff::of(&args.before, &args.after)?;
    let text = if args.json { serde_json::to_string_pretty(&diff)? } else { diff.to_string() };
    Ok(writeln!(Stdout, "{text}")?)
}

pub(crate) fn simulate(args: &SimulateArgs) -> Result<()> {
    require_room(pixels(args.from.is_none().then_some(args.size)), "choose a smaller --size")?;
    let options = simulate::Options {
        scene: args.scene.clone(),
        from: args.from.clone(),
        devices: args.devices.clone(),
        speeds: args.speeds.clone(),
        nodes: args.nodes.clone(),
        launch_s: args.launch.map(|launch| launch.as_secs_f64()),
        claim_s: args.claim.as_secs_f64(),
        task_size: args.task_size,
        size: args.size,
        seed: args.seed,
        out: args.out.clone(),
    };
    measure(std::slice::from_ref(&args.scene), &args.source, |lab| simulate::run(lab, &options))
}

pub(crate) fn bench(args: &BenchArgs) -> Result<()> {
    args.device.check(args.devices.as_deref())?;
    require_room(args.rays.map(u64::from), "choose fewer --rays")?;
    let options = bench::Options {
        scenes: args.scenes.clone(),
        devices: args.devices.as_deref().unwrap_or(AUTO).to_owned(),
        cards: args.device.cards(),
        isa: args.device.isa,
        rays: args.rays,
        repeat: args.repeat,
        quick: args.quick,
        seed: args.seed,
        json: args.json,
        out: args.out.clone(),
    };
    measure(&args.scenes, &args.source, |lab| bench::run(lab, &options))
}

pub(crate) fn tradeoff(args: &TradeoffArgs) -> Result<()> {
    match &args.trade {
        Some(TradeArg::Precision(own)) => trade_of_precisions(own),
        None => trade(&args.common, None),
        Some(TradeArg::Sampling(common)) => trade(common, Some(Chosen::Sampling)),
        Some(TradeArg::Build(common)) => trade(common, Some(Chosen::Build)),
        Some(TradeArg::Layout(common)) => trade(common, Some(Chosen::Layout)),
    }
}

fn trade(args: &TradeArgs, chosen: Option<Chosen>) -> Result<()> {
    require_room(pixels(args.size), "choose a smaller --size")?;
    let options = tradeoff::Options {
        scenes: args.scenes.clone(),
        devices: args.devices.clone(),
        size: args.size,
        repeat: args.repeat,
        budget: args.budget,
        seed: args.seed,
        quick: args.quick,
        out: args.out.clone(),
    };
    measure(&args.scenes, &args.source, |lab| tradeoff::run(lab, &options, chosen))
}

fn trade_of_precisions(args: &PrecisionTradeoffArgs) -> Result<()> {
    require_room(pixels(args.size), "choose a smaller --size")?;
    let options = precision::Options {
        scenes: args.scenes.clone(),
        devices: args.devices.clone(),
        quick: args.quick,
        repeat: args.repeat,
        size: args.size,
        sample: args.sample,
        seed: args.seed,
        out: args.out.clone(),
    };
    let source = SceneArgs { drop_invalid: false, floor: false, builder: args.builder, precision: None };
    measure(&args.scenes, &source, |lab| tradeoff::run_precision(lab, &options))
}
