//! How long devices may take, and how a stream waits for them.

use crate::Control;
use crate::device_thread::Answer;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// How long devices may take.
///
/// A device that is late costs nothing but itself: the others do its work too, and whoever answers first is believed.
/// So the first two limits may be generous, and wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// How long the others wait for a device that gets ready: takes the scene or rays, compiles kernels. Then they
    /// begin without it, and it joins the next stream for which it is ready.
    pub ready: Duration,
    /// How long a launch or a walk may take beyond eight times its predicted time until others do it too.
    pub late: Duration,
    /// How long a device may be busy with one call until it is given up, for this stream and all later ones.
    pub lost: Duration,
}

impl Default for Limits {
    /// Compilers of graphics drivers have been seen to take half a minute; five seconds are beyond what a busy machine
    /// keeps a thread waiting; and a static queue of a slow device may be one launch of minutes.
    fn default() -> Self {
        Self { ready: Duration::from_secs(60), late: Duration::from_secs(5), lost: Duration::from_secs(600) }
    }
}

impl Limits {
    /// The default limits, none of them beyond `lost`.
    #[must_use]
    pub fn within(lost: Duration) -> Self {
        let Self { ready, late, .. } = Self::default();
        Self { ready: ready.min(lost), late: late.min(lost), lost }
    }
}

/// How many times its predicted time a call may take, beyond [`Limits::late`]: models fitted to other streams have been
/// wrong by a factor of five (cold caches, a machine that others use), and false alarms only cost work that idle
/// devices do.
pub(crate) const OVERRUN: f64 = 8.0;

/// By how much the driver waits longer than it told the device to: a backend that keeps its limit tells better than the
/// driver what is wrong, and its thread ends.
pub(crate) const GRACE: Duration = Duration::from_secs(1);

/// How often a caller's cancel flag is looked at while devices work: far below what people notice, and some hundred
/// wake-ups a second cost a tenth of a percent of a core.
const TICK: Duration = Duration::from_millis(10);

/// What a wait ended with.
#[expect(clippy::large_enum_variant, reason = "looked at once where it is made, and stored nowhere")]
#[derive(Debug)]
pub(crate) enum Heard {
    Answer(Answer),
    /// The deadline passed.
    Late,
    Cancelled,
}

/// Waits for an answer of any device until `deadline` (`None`: for ever), or until the caller cancels.
pub(crate) fn hear(answers: &Receiver<Answer>, deadline: Option<Instant>, control: Control<'_>) -> Heard {
    loop {
        if control.is_cancelled() {
            return Heard::Cancelled;
        }
        let left = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
        let wait = match (left, control.cancel) {
            (Some(left), None) => left,
            (Some(left), Some(_)) => left.min(TICK),
            (None, Some(_)) => TICK,
            (None, None) => Duration::MAX,
        };
        match answers.recv_timeout(wait) {
            Ok(answer) => return Heard::Answer(answer),
            Err(RecvTimeoutError::Timeout) if left.is_none_or(|left| left > wait) => {}
            Err(RecvTimeoutError::Timeout) => return Heard::Late,
            // Nobody is left who could answer; callers hold a sender of their own, so this does not come to pass.
            Err(RecvTimeoutError::Disconnected) => return Heard::Late,
        }
    }
}

/// `duration` after `since`; `None` where that is beyond what the clock can tell, which is never.
pub(crate) fn after(since: Instant, duration: Duration) -> Option<Instant> {
    since.checked_add(duration)
}

/// The earlier of two deadlines.
pub(crate) fn earlier(a: Option<Instant>, b: Option<Instant>) -> Option<Instant> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}
