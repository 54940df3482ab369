//! Scenes as the command line names them: a bar while a large file is loaded, warnings on standard error.

use crate::args::SceneArgs;
use crate::progress;
use anyhow::Result;
use indicatif::ProgressBar;
use rt_bvh::InvalidTriangles;
use rt_core::Precision;
use rt_scene::Model;
use rt_scene::obj::{LoadError, LoadProgress};
use rt_scene::prepare::{self, Options, PrepareError, Prepared};
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
        warn(&prepared.warnings);
        Ok(prepared)
    }
}

/// Generates or loads a scene, whose triangles must be finite.
pub(crate) fn load(scene: &str) -> Result<Model> {
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
    loaded.map_err(|error| {
        // The library does not know the option's name.
        let invalid = matches!(error, PrepareError::Load(LoadError::NotFinite { .. }));
        let error = anyhow::Error::from(error);
        if invalid { error.context("give --drop-invalid to leave such triangles out") } else { error }
    })
}

fn warn(warnings: &[String]) {
    for warning in warnings {
        eprintln!("warning: {warning}");
    }
}
