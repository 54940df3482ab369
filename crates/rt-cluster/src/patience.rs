//! How long ranks wait for each other.

use std::time::Duration;

/// How long ranks wait for each other. None of it need be right: a false alarm costs work done twice, never a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// Whoever has said nothing for so long says that it is there.
    pub heartbeat: Duration,
    /// A rank that is not heard of for so long is taken for lost: its tiles are dealt again.
    pub rank: Duration,
    /// Ranks give up when rank 0, which cannot be replaced, is not heard of for so long.
    pub server: Duration,
    /// The same before it answers for the first time: it may be busy with what it has before.
    pub welcome: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self {
            heartbeat: Duration::from_millis(500),
            rank: Duration::from_secs(10),
            server: Duration::from_secs(30),
            welcome: Duration::from_secs(600),
        }
    }
}
