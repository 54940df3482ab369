//! Progress on a terminal, silence elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rt_render::Progress;
use std::cell::{Cell, RefCell};

/// How often a bar is redrawn.
const REFRESH_HZ: u8 = 10;

/// A bar that counts to `total`; invisible unless standard error is a terminal.
pub(crate) fn bar(label: &'static str, total: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr_with_hz(REFRESH_HZ));
    if let Ok(style) = ProgressStyle::with_template("{msg:12} {bar:40} {percent:>3}% {eta}") {
        bar.set_style(style);
    }
    bar.set_message(label);
    bar
}

/// What shows how far each of several streams is: a bar that comes with the stream and goes when it is done.
pub(crate) fn of_streams(label: &'static str) -> impl Fn(u64, u64) {
    let shown: RefCell<Option<ProgressBar>> = RefCell::new(None);
    move |done, total| {
        let mut shown = shown.borrow_mut();
        let bar = shown.get_or_insert_with(|| bar(label, total));
        bar.set_position(done);
        if done >= total {
            bar.finish_and_clear();
            *shown = None;
        }
    }
}

/// What shows how far a whole render is: one bar, over all frames, passes and kinds of rays.
pub(crate) struct Whole {
    bar: ProgressBar,
    /// Paths of streams that are done.
    before: Cell<u64>,
}

impl Whole {
    /// Of so many paths, each with so many streams at most.
    pub(crate) fn new(paths: u64, streams: u64) -> Self {
        Self { bar: bar("tracing", paths.saturating_mul(streams)), before: Cell::new(0) }
    }

    /// Shows how far the stream at hand is.
    pub(crate) fn show(&self, at: Progress) {
        if at.is_done {
            self.before.set(self.before.get() + at.paths);
            self.bar.set_position(self.before.get());
        } else {
            self.bar.set_message(at.kind.to_string());
            self.bar.set_position(self.before.get() + (at.share * at.paths as f64) as u64);
        }
    }

    /// Shows what comes when all is traced.
    pub(crate) fn stage(&self, name: &'static str) {
        self.bar.set_message(name);
        self.bar.tick();
    }
}

impl Drop for Whole {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
