//! Scenes as the command line names them: a bar while a large file is loaded, warnings on standard error.

use crate::args::SceneArgs;
use crate::exit::usage;
use crate::output::Outputs;
use crate::progress;
use anyhow::Result;
use indicatif::ProgressBar;
use rt_bvh::InvalidTriangles;
use rt_core::Precision;
use rt_report::print::note;
use rt_scene::obj::{LoadError, LoadProgress};
use rt_scene::prepare::{self, Options, PrepareError, Prepared};
use rt_scene::{Model, scenes};
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

/// Adds the files of scenes to what must not be overwritten.
pub(crate) fn protect<S: AsRef<Path>>(outputs: Outputs, scenes: impl IntoIterator<Item = S>) -> Outputs {
    let is_built_in = |scene: &S| scene.as_ref().to_str().is_some_and(|name| scenes::find(name).is_some());
    let files = scenes.into_iter().filter(|scene| !is_built_in(scene));
    files.fold(outputs, |outputs, file| outputs.input("the scene", file.as_ref()))
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
    loaded.map_err(|error| {
        match error {
            PrepareError::Unknown { .. } => usage(error.to_string()),
            // The library does not know the option's name.
            PrepareError::Load(LoadError::NotFinite { .. }) => {
                anyhow::Error::from(error).context("give --drop-invalid to leave such triangles out")
            }
            error => error.into(),
        }
    })
}

fn warn(warnings: &[String]) {
    for warning in warnings {
        note(format_args!("warning: {warning}"));
    }
}
