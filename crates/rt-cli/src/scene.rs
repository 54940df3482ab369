//! Scenes as the command line names them: a bar while a large file is loaded, warnings on standard error.

use crate::args::SceneArgs;
use crate::{interrupt, progress};
use anyhow::{Result, anyhow};
use indicatif::ProgressBar;
use rt_bvh::InvalidTriangles;
use rt_core::Precision;
use rt_scene::Model;
use rt_scene::obj::{Fault, LoadError, LoadProgress, LoadStage, Watch};
use rt_scene::prepare::{self, Options, PrepareError, Prepared};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// A bar appears when loading takes longer than this.
const PATIENCE: Duration = Duration::from_secs(1);

impl SceneArgs {
    /// As scenes are prepared.
    pub(crate) fn options(&self) -> Options {
        let invalid = if self.drop_invalid { InvalidTriangles::Drop } else { InvalidTriangles::Refuse };
        Options { invalid, precision: self.precision.map(Precision::from), ..Options::new(self.builder) }
    }

    /// Loads or generates the scene, scans it and builds its tree.
    pub(crate) fn prepare(&self, scene: &str) -> Result<Prepared> {
        let prepared = with_bar(|show| prepare::prepare(scene, &self.options(), show))?;
        tell(&prepared.warnings, &prepared.notes);
        Ok(prepared)
    }
}

/// Generates or loads a scene, whose triangles must be finite.
pub(crate) fn load(scene: &str) -> Result<Model> {
    let named = with_bar(|show| prepare::load(scene, InvalidTriangles::Refuse, show))?;
    tell(&named.warnings, &named.notes);
    Ok(named.model)
}

/// Shows how far a scene is loaded, if that takes long, and stops when the user asks for it.
fn with_bar<T>(load: impl FnOnce(&mut Watch<'_>) -> Result<T, PrepareError>) -> Result<T> {
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
    loaded.map_err(|error| {
        // The library does not know the option's name.
        let defect = matches!(&error, PrepareError::Load(LoadError { fault: Fault::Defect { .. }, .. }));
        let error = anyhow::Error::from(error);
        if defect { anyhow!("{error} (--drop-invalid)") } else { error }
    })
}

const fn label(stage: LoadStage) -> &'static str {
    match stage {
        LoadStage::Reading => "reading",
        LoadStage::Parsing => "parsing",
        LoadStage::Placing => "placing",
        LoadStage::Scanning => "scanning",
    }
}

fn tell(warnings: &[String], notes: &[String]) {
    for warning in warnings {
        eprintln!("warning: {warning}");
    }
    for note in notes {
        eprintln!("note: {note}");
    }
}
