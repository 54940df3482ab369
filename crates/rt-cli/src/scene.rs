//! Scenes as the command line names them: a bar while a large file is loaded, warnings on standard error.

use crate::args::SceneArgs;
use crate::{interrupt, progress};
use anyhow::{Result, anyhow};
use indicatif::ProgressBar;
use rt_bvh::InvalidTriangles;
use rt_core::Precision;
use rt_report::print::note;
use rt_report::usage::usage;
use rt_scene::Model;
use rt_scene::obj::{Fault, LoadError, LoadProgress, LoadStage, Watch};
use rt_scene::prepare::{self, Options, PrepareError, Prepared};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

/// A bar appears when loading takes longer than this.
const PATIENCE: Duration = Duration::from_secs(1);

impl SceneArgs {
    /// As scenes are prepared.
    pub(crate) fn options(&self) -> Options {
        let invalid = if self.drop_invalid { InvalidTriangles::Drop } else { InvalidTriangles::Refuse };
        Options {
            invalid,
            precision: self.precision.map(Precision::from),
            floor: self.floor,
            ..Options::new(self.builder)
        }
    }

    /// Loads or generates the scene, scans it and builds its tree.
    pub(crate) fn prepare(&self, scene: &Path) -> Result<Prepared> {
        let prepared =
            with_bar(|show| prepare::prepare(scene, &self.options(), show)).map_err(|error| match error {
                // The library does not know the option's name.
                PrepareError::Load(LoadError { fault: Fault::Defect { .. }, .. }) => {
                    anyhow!("{error} (--drop-invalid)")
                }
                error => explained(error),
            })?;
        tell(&prepared.warnings, &prepared.notes);
        Ok(prepared)
    }
}

/// Whether all scenes are there, before any of them is worked on.
pub(crate) fn check<S: AsRef<Path>>(scenes: impl IntoIterator<Item = S>) -> Result<()> {
    scenes.into_iter().try_for_each(|scene| prepare::check(scene.as_ref()).map_err(explained))
}

/// Generates or loads a scene, whose triangles must be finite.
pub(crate) fn load(scene: &Path) -> Result<Model> {
    let named = with_bar(|show| prepare::load(scene, InvalidTriangles::Refuse, show)).map_err(explained)?;
    tell(&named.warnings, &named.notes);
    Ok(named.model)
}

/// Shows how far a scene is loaded and its tree built, if that takes long, and stops when the user asks for it.
fn with_bar<T>(load: impl FnOnce(&mut Watch<'_>) -> Result<T, PrepareError>) -> Result<T, PrepareError> {
    let start = Instant::now();
    let mut bar: Option<(LoadStage, ProgressBar)> = None;
    let mut watch = |at: LoadProgress| {
        if start.elapsed() > PATIENCE {
            if bar.as_ref().is_none_or(|(stage, _)| *stage != at.stage) {
                bar = Some((at.stage, progress::bar(label(at.stage), at.total)));
            }
            if let Some((_, bar)) = &bar {
                bar.set_position(at.done);
            }
        }
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let loaded = load(&mut watch);
    if let Some((_, bar)) = bar {
        bar.finish_and_clear();
    }
    loaded
}

/// What the command line knows better.
fn explained(error: PrepareError) -> anyhow::Error {
    match error {
        PrepareError::Unknown { .. } => usage(error.to_string()).into(),
        error => error.into(),
    }
}

const fn label(stage: LoadStage) -> &'static str {
    match stage {
        LoadStage::Reading => "reading",
        LoadStage::Parsing => "parsing",
        LoadStage::Placing => "placing",
        LoadStage::Scanning => "scanning",
        LoadStage::Building => "building",
    }
}

fn tell(warnings: &[String], notes: &[String]) {
    for warning in warnings {
        note(format_args!("warning: {warning}"));
    }
    for text in notes {
        note(format_args!("note: {text}"));
    }
}
