//! Progress on a terminal, silence elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

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
