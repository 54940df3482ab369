//! The measurements: every way in turn, round after round, and every kind of device alone.

use super::Options;
use super::ways::Way;
use crate::Lab;
use crate::time_budget::TimeBudget;
use anyhow::{Context, Result, bail};
use rt_balance::devices::Opened;
use rt_balance::report::StreamReport;
use rt_balance::{Balancer, Limits, Scheduling};
use rt_core::Device;
use rt_render::{Part, Renderer, Session};
use rt_report::report::SceneReport;
use rt_scene::prepare::Prepared;
use rt_scene::streams::{Samples, Wave};
use std::sync::Arc;
use std::time::Instant;

/// A scene on all devices together, and on each kind of them alone.
pub(super) struct Site<'a> {
    lab: Lab<'a>,
    renderer: Renderer<'a>,
    camera: rt_core::Camera,
    wave: Wave,
    together: Holder,
    /// Short name of the scene.
    pub(super) name: String,
    pub(super) scene: SceneReport,
    /// As the command line names each, and what it calls itself.
    pub(super) devices: Vec<(String, String)>,
    pub(super) alone: Vec<Alone>,
    /// Seconds of loading and building.
    pub(super) prepare_s: f64,
    /// Seconds of bringing the scene to the devices, kernels compiled.
    pub(super) setup_s: f64,
    /// Whether the bound is measured.
    reference: bool,
}

/// Devices that hold the scene; nothing while they render.
struct Holder(Option<Balancer>);

/// One device alone, for all that are named alike.
pub(super) struct Alone {
    holder: Holder,
    pub(super) entry: String,
    pub(super) name: String,
    /// How many are named alike.
    pub(super) count: usize,
}

/// What a picture took.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// Wall seconds of all of it: rays made, traced and shaded.
    pub(super) wall_s: f64,
    pub(super) streams: Vec<StreamReport>,
}

impl Picture {
    /// Seconds of tracing, estimation included.
    pub(super) fn trace_s(&self) -> f64 {
        self.streams.iter().map(|stream| stream.makespan_s).sum()
    }

    /// Seconds of estimating.
    pub(super) fn estimate_s(&self) -> f64 {
        self.streams.iter().map(|stream| stream.estimate.seconds).sum()
    }

    /// Whether anything was known of the tasks of a stream.
    pub(super) fn is_estimated(&self) -> bool {
        self.streams.iter().any(|stream| !stream.estimate.is_uninformed())
    }

    /// How much longer the last device worked than all did on average, over all streams; `None` where one does not
    /// tell.
    pub(super) fn imbalance(&self) -> Option<f64> {
        let even: f64 = self.streams.iter().map(StreamReport::even_s).sum::<Option<f64>>()?;
        (even > 0.0).then(|| self.trace_s() / even - 1.0)
    }

    fn setup_s(&self) -> f64 {
        self.streams.iter().map(|stream| stream.setup_s).sum()
    }
}

/// One round.
#[derive(Debug)]
pub(super) struct Round {
    pub(super) seed: u32,
    /// One for each way.
    pub(super) ways: Vec<Picture>,
    /// One for each device that is measured alone.
    pub(super) alone: Vec<Picture>,
    /// Least seconds that any schedule needs for the picture, if that was measured.
    pub(super) lower_bound_s: Option<f64>,
}

impl Round {
    /// What the devices together needed once.
    pub(super) fn setup_s(&self) -> f64 {
        self.ways.iter().map(Picture::setup_s).sum()
    }
}

impl<'a> Site<'a> {
    /// Brings the scene to the devices.
    pub(super) fn set(lab: Lab<'a>, options: &Options, prepared: Prepared, opened: Vec<Opened>) -> Result<Self> {
        let view = prepared.view();
        let camera = view.camera().context("the scene's camera")?;
        let described = SceneReport::of(&prepared);
        let tree = Arc::clone(&prepared.built.scene);
        let on = |devices: &[Arc<dyn Device>]| {
            Balancer::open(Arc::clone(&tree), devices, &Limits::default(), lab.control()).map(|b| Holder(Some(b)))
        };
        let all: Vec<Arc<dyn Device>> = opened.iter().map(|opened| Arc::clone(&opened.device)).collect();
        let begin = Instant::now();
        let together = on(&all)?;
        let setup_s = begin.elapsed().as_secs_f64();
        let devices: Vec<(String, String)> =
            opened.iter().map(|opened| (opened.entry.clone(), opened.device.info().name.clone())).collect();
        let mut alone: Vec<Alone> = Vec::new();
        for (Opened { entry, device, .. }, (_, name)) in opened.iter().zip(&devices).filter(|_| devices.len() > 1) {
            match alone.iter_mut().find(|known| known.entry == *entry) {
                Some(known) => known.count += 1,
                None => {
                    let holder = on(std::slice::from_ref(device))?;
                    alone.push(Alone { holder, entry: entry.clone(), name: name.clone(), count: 1 });
                }
            }
        }
        let (name, prepare_s) = (prepared.name.clone(), prepared.load_s + prepared.build_s);
        let renderer = Renderer {
            size: options.size(),
            samples: options.samples(),
            bounces: options.bounces,
            cut: options.cut,
            seed: options.seed,
            ..Renderer::of(prepared, &view, lab.stop)
        };
        let wave = Wave::whole(options.size())?;
        Ok(Self {
            lab,
            renderer,
            camera,
            wave,
            together,
            name,
            scene: described,
            devices,
            alone,
            prepare_s,
            setup_s,
            reference: options.reference,
        })
    }

    /// Every way and every device once; each round begins with another one, so that none is always first.
    pub(super) fn round(
        &mut self,
        round: u32,
        ways: &[Way],
        kept: &mut [Option<Scheduling>],
        time: &TimeBudget<'_>,
    ) -> Result<Round> {
        let seed = self.renderer.seed;
        let all = ways.len() + self.alone.len();
        let mut pictures: Vec<Option<Picture>> = vec![None; all];
        for step in 0..all {
            let index = (round as usize + step) % all;
            let picture = if let Some(way) = ways.get(index) {
                let mut fresh = None;
                let scheduling = kept[index].as_mut().unwrap_or_else(|| fresh.insert(way.scheduling()));
                self.take(None, scheduling).with_context(|| way.label())
            } else {
                let alone = index - ways.len();
                // A new one, as for every first picture.
                let picture = self.take(Some(alone), &mut Scheduling::default());
                picture.with_context(|| format!("{} alone", self.alone[alone].entry))
            };
            pictures[index] = Some(picture?);
            time.step();
        }
        let lower_bound_s = self.lower_bound(time)?;
        self.renderer.seed = seed.wrapping_add(1);
        let mut pictures: Vec<Picture> = pictures.into_iter().flatten().collect();
        let alone = pictures.split_off(ways.len());
        Ok(Round { seed, ways: pictures, alone, lower_bound_s })
    }

    /// Least seconds of the round's picture, from a pass in which every task is traced alone.
    fn lower_bound(&mut self, time: &TimeBudget<'_>) -> Result<Option<f64>> {
        if !self.reference {
            return Ok(None);
        }
        self.renderer.reference = true;
        let measured = self.take(None, &mut Scheduling::default()).context("the reference");
        self.renderer.reference = false;
        time.step();
        Ok(measured?.streams.iter().map(|stream| stream.lower_bound_s).sum())
    }

    /// Renders the picture once, by all devices or by one alone.
    fn take(&mut self, alone: Option<usize>, scheduling: &mut Scheduling) -> Result<Picture> {
        self.lab.go_on()?;
        let Holder(place) = alone.map_or(&mut self.together, |index| &mut self.alone[index].holder);
        let balancer = place.take().context("the picture before did not end")?;
        let mut streams: Vec<StreamReport> = Vec::new();
        let mut record = |traced: rt_render::Traced<'_>| streams.push(traced.run.report);
        let scheduling_of = std::mem::take(scheduling);
        let mut session = Session { balancer, scheduling: scheduling_of, show: &|_| {}, record: &mut record };
        let begin = Instant::now();
        let paths = self.renderer.paths(self.camera, 0);
        let samples = Samples::all(self.renderer.samples);
        let part = Part { paths: &paths, frame: 0, number: 0, wave: &self.wave, samples };
        let mut sums = vec![glam::Vec3::ZERO; self.wave.pixels.len()];
        let rendered = self.renderer.part(&mut session, part, &mut sums);
        let wall_s = begin.elapsed().as_secs_f64();
        let Session { balancer, scheduling: used, .. } = session;
        (*place, *scheduling) = (Some(balancer), used);
        rendered?;
        // What is compared would be another set of devices from then on.
        for device in streams.iter().flat_map(|stream| &stream.devices) {
            if let Some(error) = &device.error {
                bail!("{} failed, and there is nothing to compare without it: {error}", device.name);
            }
        }
        Ok(Picture { wall_s, streams })
    }
}
