//! Ctrl-C: the first one asks the run to stop, files are written whole or not at all.

use rt_balance::Control;
use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Watches for Ctrl-C; the second one ends the process at once.
pub(crate) fn watch() {
    // Without a handler Ctrl-C simply ends the process, which loses nothing: files are renamed into place when whole.
    let _ = ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(super::INTERRUPTED));
        }
    });
}

/// What stops a run.
pub(crate) fn control() -> Control<'static> {
    Control { cancel: Some(flag()), progress: None }
}

/// The flag that a run looks at.
pub(crate) fn flag() -> &'static AtomicBool {
    &REQUESTED
}

/// Whether Ctrl-C was pressed.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
