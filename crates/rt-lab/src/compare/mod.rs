//! `raybalance compare`: which queue, policy and estimator to use for a scene and devices.
//!
//! Every way renders the same frame, round after round, so that a machine whose speed drifts slows all alike; so does
//! each kind of device alone. What is rendered is what `raybalance render` renders, shading included.

mod measure;
mod results;
mod verdict;
mod ways;
mod write;

use crate::Lab;
use crate::time_budget::TimeBudget;
use anyhow::{Context, Result};
use measure::Site;
use results::Results;
use rt_balance::catalogue::{Entry, Make, MakePolicy};
use rt_balance::cpu::Isa;
use rt_balance::devices::CardOptions;
use rt_balance::{QueueKind, Scheduling};
use rt_render::TaskCut;
use rt_report::output::Outputs;
use rt_report::usage::usage;
use std::path::PathBuf;
use std::time::Duration;
use ways::{leave_out, ways};

/// The picture of `raybalance render`, with fewer rays a pixel: a round has a dozen pictures.
const SIZE: [u32; 2] = [960, 600];
const SAMPLES: u32 = 4;

/// With `--quick`.
const QUICK_SIZE: [u32; 2] = [320, 200];
const QUICK_SAMPLES: u32 = 1;
const QUICK_REPEAT: u32 = 3;

/// Rounds that count: the least with which intervals are of 95% though one round was disturbed is nine, but seven give
/// 98% where none was.
const REPEAT: u32 = 7;

/// What to compare.
#[derive(Clone, Debug)]
pub struct Options {
    /// A built-in scene or an OBJ file.
    pub scene: PathBuf,
    /// Devices, as [`Opener::open`](rt_balance::devices::Opener::open) reads them.
    pub devices: String,
    /// How graphics cards are used.
    pub cards: CardOptions,
    /// Instructions that processors trace with; `None`: the best there are.
    pub isa: Option<Isa>,
    /// The queues to combine with the policies and estimators; none of all three: the useful ways and their rivals.
    pub queues: Vec<&'static Entry<QueueKind>>,
    /// Likewise.
    pub policies: Vec<&'static Entry<MakePolicy>>,
    /// Likewise.
    pub estimators: Vec<&'static Entry<Make>>,
    /// Share of the rays that is sampled; `None`: each estimator's own.
    pub fraction: Option<f64>,
    /// How streams are cut into tasks.
    pub cut: TaskCut,
    /// Size of the picture in pixels; `None`: as suits the extent.
    pub size: Option<[u32; 2]>,
    /// Rays of a pixel; `None`: as suits the extent.
    pub samples: Option<u32>,
    /// Diffuse bounces.
    pub bounces: u32,
    /// Rounds that count; `None`: as suits the extent.
    pub repeat: Option<u32>,
    /// Seconds that it may take; `None`: as long as it takes.
    pub budget: Option<u32>,
    /// Seed of the first round's samples, pixels and bounces; each round has the next one.
    pub seed: u32,
    /// Whether each round measures every task by itself, so that the excess over the best possible schedule is known.
    pub reference: bool,
    /// A small picture and few rounds: a look at the form, not a measurement.
    pub quick: bool,
    /// Whether JSON is printed instead of tables.
    pub json: bool,
    /// Folder of what is written.
    pub out: PathBuf,
}

impl Options {
    fn size(&self) -> [u32; 2] {
        self.size.unwrap_or(if self.quick { QUICK_SIZE } else { SIZE })
    }

    fn samples(&self) -> u32 {
        self.samples.unwrap_or(if self.quick { QUICK_SAMPLES } else { SAMPLES })
    }

    fn repeat(&self) -> u32 {
        self.repeat.unwrap_or(if self.quick { QUICK_REPEAT } else { REPEAT })
    }

    /// Rays of the camera, which are the most that are in flight.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.size().iter().map(|&side| u64::from(side)).product::<u64>() * u64::from(self.samples())
    }
}

/// Measures all ways, and says which to use.
///
/// # Errors
/// When an option has no meaning for what was chosen, the scene cannot be prepared, a device not be opened or fails, or
/// a file not be written.
pub fn run(lab: Lab<'_>, options: &Options) -> Result<()> {
    let mut ways = ways(options)?;
    if u32::try_from(options.rays()).is_err() {
        return Err(usage("--size, --spp: a picture has at most 2^32 rays here: choose fewer").into());
    }
    let outputs = Outputs::new().folder("--out", &options.out, write::FILES).scenes([&options.scene]);
    outputs.check()?;
    let lab = lab.writing(&outputs);
    let mut opener = lab.opener().with_cards(options.cards).with_isa(options.isa);
    let opened = opener.open(&options.devices).context("--devices")?;
    let left_out = leave_out(&mut ways, &opened);
    if !left_out.is_empty() {
        lab.show
            .note(&format!("left out, since no device counts tests that could be sampled: {}", left_out.join("; ")));
    }
    let prepared = lab.prepare(&options.scene)?;

    let mut site = Site::set(lab, options, prepared, opened)?;
    let budget = options.budget.map(|seconds| Duration::from_secs(seconds.into()));
    let steps = ways.len() + site.alone.len() + usize::from(options.reference);
    let time = TimeBudget::whole(lab.show, budget).with_steps(steps, options.repeat() + 1);
    time.label("comparing");
    // What learns from earlier pictures does so from the rounds before.
    let mut kept: Vec<Option<Scheduling>> = ways.iter().map(|way| way.later.then(|| way.scheduling())).collect();
    let mut rounds = Vec::new();
    for round in time.rounds(options.repeat()) {
        let measured = site.round(round, &ways, &mut kept, &time)?;
        if round == 0 {
            site.setup_s += measured.setup_s();
        } else {
            rounds.push(measured);
        }
    }
    time.finish();
    let results = Results::new(options, &site, &ways, &rounds);
    write::all(lab, options, &results)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nothing asked for but a scene and devices.
    pub(super) fn options() -> Options {
        Options {
            scene: "yard".into(),
            devices: "cpu:1,cpu:1".to_owned(),
            cards: CardOptions::default(),
            isa: None,
            queues: Vec::new(),
            policies: Vec::new(),
            estimators: Vec::new(),
            fraction: None,
            cut: TaskCut::Suited,
            size: None,
            samples: None,
            bounces: 1,
            repeat: None,
            budget: None,
            seed: 1,
            reference: false,
            quick: true,
            json: false,
            out: "out".into(),
        }
    }

    #[test]
    fn a_look_is_smaller_than_a_measurement() {
        let (quick, whole) = (options(), Options { quick: false, ..options() });
        assert!(quick.rays() < whole.rays() / 8 && quick.repeat() < whole.repeat());
        assert_eq!(Options { size: Some([10, 10]), samples: Some(3), ..options() }.rays(), 300);
    }
}
