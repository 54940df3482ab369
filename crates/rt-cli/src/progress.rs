//! Progress on a terminal, silence elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::cell::RefCell;

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
