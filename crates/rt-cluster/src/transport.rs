//! What carries messages between ranks.

use std::error::Error;
use std::fmt;
use std::time::Duration;

/// One rank's end of what carries messages between ranks: MPI, or threads of one process ([`crate::local`]).
///
/// Messages from one rank to another arrive in the order they were sent in, or not at all where one of the two is lost;
/// nothing is promised of messages of different ranks. A transport is used by one thread at a time.
pub trait Transport: Send {
    /// The number of this rank; rank 0 deals the tiles and keeps the results.
    fn rank(&self) -> u32;

    /// How many ranks there are.
    fn size(&self) -> u32;

    /// Sends a message, without waiting until it has arrived: two ranks may send to each other at the same time. What
    /// is sent to a lost rank goes nowhere.
    ///
    /// # Errors
    /// When this rank can send nothing at all any more.
    fn send(&mut self, to: u32, message: Vec<u8>) -> Result<(), TransportError>;

    /// The next message with its sender; `None` when none came within a time, about.
    ///
    /// # Errors
    /// When this rank can receive nothing at all any more.
    fn receive(&mut self, within: Duration) -> Result<Option<(u32, Vec<u8>)>, TransportError>;

    /// The ranks that are known to be lost, with the reason, since this was last asked. A transport that cannot tell
    /// says nothing: silence is noticed anyway.
    fn lost(&mut self) -> Vec<(u32, String)> {
        Vec::new()
    }

    /// Waits until what was sent has left, within a time; says how many messages have not.
    ///
    /// # Errors
    /// As of [`Transport::send`].
    fn flush(&mut self, within: Duration) -> Result<usize, TransportError> {
        let _ = within;
        Ok(0)
    }
}

/// This rank is cut off from all others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TransportError(pub String);

impl fmt::Display for TransportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no messages can be exchanged: {}", self.0)
    }
}

impl Error for TransportError {}
