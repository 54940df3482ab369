//! Scenes as the command line names them: a bar while a large file is loaded, warnings on standard error.

use crate::args::SceneArgs;
use crate::progress;
use anyhow::Result;
use indicatif::ProgressBar;
use rt_bvh::InvalidTriangles;
use rt_core::Precision;
use rt_report::print::note;
use rt_report::usage::usage;
use rt_scene::Model;
use rt_scene::obj::{LoadError, LoadProgress};
use rt_scene::prepare::{self, Options, PrepareError, Prepared};
use std::path::Path;
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
    pub(crate) fn prepare(&self, scene: &Path) -> Result<Prepared> {
        let prepared = with_bar(|show| prepare::prepare(scene, &self.options(), show))?;
        warn(&prepared.warnings);
        Ok(prepared)
    }
}

/// Whether all scenes are there, before any of them is worked on.
pub(crate) fn check<S: AsRef<Path>>(scenes: impl IntoIterator<Item = S>) -> Result<()> {
    scenes.into_iter().try_for_each(|scene| prepare::check(scene.as_ref()).map_err(explained))
}

/// Generates or loads a scene, whose triangles must be finite.
pub(crate) fn load(scene: &Path) -> Result<Model> {
    let named = with_bar(|show| prepare::load(scene, InvalidTriangles::Refuse, show))?;
    warn(&named.warnings);
    Ok(named.model)
}

/// Shows how far a file is loaded, if that takes long.
fn with_bar<T>(load: impl FnOnce(&mut dyn FnMut(LoadProgress)) -> Result<T, PrepareError>) -> Result<T> {
    let start = Instant::now();
    let mut bar: Option<ProgressBar> = None;
    let mut show = |at: LoadProgress| {
        if start.elapsed() > PATIENCE {
            let bar = bar.get_or_insert_with(|| progress::bar("loading", at.total_bytes));
            bar.set_length(at.total_bytes);
            bar.set_position(at.done_bytes);
        }
    };
    let loaded = load(&mut show);
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
    loaded.map_err(explained)
}

/// What the command line knows better.
fn explained(error: PrepareError) -> anyhow::Error {
    match error {
        PrepareError::Unknown { .. } => usage(error.to_string()),
        // The library does not know the option's name.
        PrepareError::Load(LoadError::NotFinite { .. }) => {
            anyhow::Error::from(error).context("give --drop-invalid to leave such triangles out")
        }
        error => error.into(),
    }
}

fn warn(warnings: &[String]) {
    for warning in warnings {
        note(format_args!("warning: {warning}"));
    }
}
