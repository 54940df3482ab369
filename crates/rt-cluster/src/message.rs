//! What ranks say to each other.

use crate::{ClusterError, Lease, Machine};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// What a rank tells rank 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToServer {
    /// It is there.
    Hello {
        /// [`crate::Deal::fingerprint`]: what must be the same on all ranks.
        fingerprint: u64,
        /// Where it runs.
        machine: Machine,
    },
    /// What tiles are expected to cost.
    Prices(Vec<Lease>),
    /// It wants more tiles.
    Ask {
        /// Of this cost in total, one at least.
        cost: f32,
        /// Whether it has nothing left to do.
        is_idle: bool,
    },
    /// A tile is finished; its bytes follow the message.
    Done {
        /// The tile.
        tile: u32,
        /// Seconds that it took.
        seconds: f32,
    },
    /// Nothing, but it is there.
    Alive,
    /// It cannot compute any more, and why.
    Failed(String),
}

/// What rank 0 tells a rank.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToWorker {
    /// It may begin.
    Welcome,
    /// It has something else before it than rank 0, and what to do.
    Refused(String),
    /// Tiles that it is to compute, in this order.
    Lease(Vec<Lease>),
    /// Nothing, but rank 0 is there.
    Alive,
    /// All tiles are finished.
    Finished {
        /// Whether all ranks are there, so that they can leave in good order.
        is_complete: bool,
        /// What they were tiles of: a rank may hear nothing before this, if it is late.
        fingerprint: u64,
    },
    /// It is to stop, for this reason.
    Stopped(String),
}

/// What rank 0 says outside of deals.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) enum Word {
    /// Nothing, but it is there.
    Alive,
    /// A part of something large, which follows; passed on by others too.
    Part,
    /// Asks what time a rank has.
    Time(u32),
    /// Asks what a rank has to say.
    Say,
    /// Nothing more.
    Done,
}

/// In place of the round of a deal, for words and answers to them.
pub(crate) const NO_ROUND: u32 = u32::MAX;

/// A message with the number of the deal it belongs to: what comes late is for nobody.
#[derive(Debug, Serialize, Deserialize)]
struct Envelope<M> {
    round: u32,
    message: M,
}

/// A message as bytes, with what follows it.
pub(crate) fn encode<M: Serialize>(round: u32, message: M, payload: &[u8]) -> Vec<u8> {
    let mut bytes = postcard::to_allocvec(&Envelope { round, message }).expect("plain data in memory");
    bytes.extend_from_slice(payload);
    bytes
}

/// The round of a message, whatever is said in it.
pub(crate) fn round_of(from: u32, bytes: &[u8]) -> Result<u32, ClusterError> {
    // The first field of the envelope.
    postcard::take_from_bytes(bytes).map(|(round, _)| round).map_err(|source| ClusterError::Message { from, source })
}

/// The round of a message, the message, and what follows it.
pub(crate) fn decode<M: DeserializeOwned>(from: u32, bytes: &[u8]) -> Result<(u32, M, &[u8]), ClusterError> {
    match postcard::take_from_bytes(bytes) {
        Ok((Envelope { round, message }, payload)) => Ok((round, message, payload)),
        Err(source) => Err(ClusterError::Message { from, source }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_back_with_what_follows_them() {
        let done = ToServer::Done { tile: 70_000, seconds: 0.25 };
        let bytes = encode(3, &done, b"pixels");
        assert_eq!(decode(1, &bytes).expect("a message"), (3, done, &b"pixels"[..]));
        let lease = ToWorker::Lease(vec![Lease { tile: 1, cost: 2.5 }, Lease { tile: u32::MAX, cost: 0.0 }]);
        assert_eq!(decode(0, &encode(0, &lease, &[])).expect("a message"), (0, lease, &[][..]));
        for round in [0, 3, 1000, NO_ROUND] {
            assert_eq!(round_of(0, &encode(round, Word::Time(7), b"more")).expect("a message"), round);
        }
    }

    #[test]
    fn garbage_is_an_error_that_names_the_sender() {
        let error = decode::<ToServer>(5, &[1, 99, 0]).expect_err("no such message").to_string();
        assert!(error.contains("rank 5"), "{error}");
        assert!(decode::<ToWorker>(5, &[]).is_err());
    }
}
