//! What can go wrong in a deal.

use crate::TransportError;
use std::error::Error;
use std::fmt;

/// Why a deal did not come to its end.
#[derive(Debug)]
#[non_exhaustive]
pub enum ClusterError {
    /// This rank is cut off.
    Transport(TransportError),
    /// A rank sent what is no message: it runs another version of the program.
    Message {
        /// The rank.
        from: u32,
        /// What is wrong.
        source: postcard::Error,
    },
    /// This rank has another job before it than rank 0.
    Refused(String),
    /// Rank 0 is lost, and how that was noticed.
    ServerLost(String),
    /// Rank 0 says that all is to stop.
    Stopped(String),
    /// No rank is left that could compute the tiles.
    NobodyLeft {
        /// Tiles that are not finished.
        unfinished: u32,
        /// What became of each rank.
        ranks: Vec<(u32, String)>,
    },
    /// This rank cannot compute any more.
    Job(Box<dyn Error + Send + Sync>),
    /// What was computed could not be kept.
    Keep(std::io::Error),
    /// The caller cancelled.
    Cancelled,
}

impl fmt::Display for ClusterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Transport(_) => write!(f, "this rank is cut off from the others"),
            Self::Message { from, .. } => {
                write!(f, "rank {from} sent no message of this version: start the same program on all nodes")
            }
            Self::Refused(why) => write!(f, "rank 0 does not let this rank take part: {why}"),
            Self::ServerLost(why) => {
                write!(f, "rank 0 is lost ({why}), and with it the results that it did not keep: start again")
            }
            Self::Stopped(why) => write!(f, "rank 0 stopped: {why}"),
            Self::NobodyLeft { unfinished, ranks } => {
                write!(f, "no rank is left for {unfinished} unfinished tiles:")?;
                ranks.iter().try_for_each(|(rank, why)| write!(f, " rank {rank}: {why};"))
            }
            Self::Job(_) => write!(f, "this rank cannot compute any more"),
            Self::Keep(_) => write!(f, "what was computed could not be kept"),
            Self::Cancelled => write!(f, "cancelled"),
        }
    }
}

impl Error for ClusterError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Transport(source) => Some(source),
            Self::Message { source, .. } => Some(source),
            Self::Job(source) => Some(&**source),
            Self::Keep(source) => Some(source),
            _ => None,
        }
    }
}

impl From<TransportError> for ClusterError {
    fn from(source: TransportError) -> Self {
        Self::Transport(source)
    }
}
