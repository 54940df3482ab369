//! What an experiment is handed by whoever runs it.

use anyhow::{Context, Result, bail};
use rt_balance::Control;
use rt_balance::devices::Opener;
use rt_core::Device;
use rt_report::output::Outputs;
use rt_scene::prepare::Prepared;
use std::fmt;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Where an experiment shows what it does.
pub trait Show {
    /// Results, for standard output.
    ///
    /// # Errors
    /// When they cannot be written. Nothing more is measured then, so what is kept in files comes first.
    fn print(&self, text: &str) -> io::Result<()>;

    /// What the user should know before the results are there.
    fn note(&self, text: &str);

    /// How far it is: what is measured, and the share that is done, from 0 to 1.
    fn progress(&self, label: &str, done: f64);

    /// There is no more progress to be shown; results follow.
    fn finish(&self);
}

/// What an experiment needs from outside.
#[derive(Clone, Copy)]
pub struct Lab<'a> {
    /// Loads or generates a scene and builds its tree.
    scenes: &'a dyn Fn(&Path) -> Result<Prepared>,
    /// Makes what opens devices, and knows the backends that lists may name.
    opener: &'a dyn Fn() -> Opener,
    /// Set (from any thread) to stop soon.
    pub stop: &'a AtomicBool,
    /// Shows progress and results.
    pub show: &'a dyn Show,
    /// What the experiment writes, once it is known.
    outputs: Option<&'a Outputs>,
}

impl<'a> Lab<'a> {
    /// A lab from its parts.
    #[must_use]
    pub const fn new(
        scenes: &'a dyn Fn(&Path) -> Result<Prepared>,
        opener: &'a dyn Fn() -> Opener,
        stop: &'a AtomicBool,
        show: &'a dyn Show,
    ) -> Self {
        Self { scenes, opener, stop, show, outputs: None }
    }

    /// The same for an experiment that writes these files.
    pub(crate) const fn writing(self, outputs: &'a Outputs) -> Self {
        Self { outputs: Some(outputs), ..self }
    }

    /// Loads or generates a scene and builds its tree. Files that turn out to belong to it must not be overwritten.
    pub(crate) fn prepare(&self, scene: &Path) -> Result<Prepared> {
        let prepared = (self.scenes)(scene)?;
        self.outputs.map_or(Ok(()), |outputs| outputs.spare_materials(&prepared.libraries))?;
        Ok(prepared)
    }

    /// What opens devices.
    pub(crate) fn opener(&self) -> Opener {
        (self.opener)()
    }

    /// Opens the devices of a list, to work at the same time.
    pub(crate) fn open(&self, list: &str) -> Result<Vec<Arc<dyn Device>>> {
        let opened = self.opener().open(list).context("--devices")?;
        Ok(opened.into_iter().map(|opened| opened.device).collect())
    }

    /// What stops a stream.
    pub(crate) fn control(&self) -> Control<'a> {
        Control { cancel: Some(self.stop), ..Control::default() }
    }

    /// An error once the experiment is to stop.
    pub(crate) fn go_on(&self) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) {
            bail!("interrupted");
        }
        Ok(())
    }
}

impl fmt::Debug for Lab<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Lab").field("stop", self.stop).finish_non_exhaustive()
    }
}
