//! Deals the tiles of a job to several processes ("ranks"), so that each tile is counted once whatever is delayed or
//! lost.
//!
//! A [`Job`] is a number of tiles, each of which any rank can compute from its number alone, to bytes that only rank 0
//! wants: pixels, or hits. [`deal`] is called by every rank with the same job and a [`Transport`] of its own:
//!
//! ```
//! use rt_cluster::{Deal, Finished, Job, deal, local};
//!
//! struct Squares;
//! impl Job for Squares {
//!     type Error = std::convert::Infallible;
//!     fn price(&mut self, tile: u32) -> f32 {
//!         tile as f32
//!     }
//!     fn compute(&mut self, tile: u32) -> Result<Vec<u8>, Self::Error> {
//!         Ok((tile * tile).to_le_bytes().to_vec())
//!     }
//! }
//!
//! let squares = std::sync::Mutex::new([0_u32; 10]);
//! std::thread::scope(|threads| {
//!     for mut rank in local::network(3, local::Weather::CALM) {
//!         let squares = &squares;
//!         threads.spawn(move || {
//!             let mut take = |done: Finished<'_>| {
//!                 let square = u32::from_le_bytes(done.bytes.try_into().unwrap());
//!                 squares.lock().unwrap()[done.tile as usize] = square;
//!                 Ok(())
//!             };
//!             deal(&mut rank, &Deal::new(10, 0), &mut Squares, &mut take).unwrap();
//!         });
//!     }
//! });
//! assert_eq!(squares.into_inner().unwrap()[7], 49);
//! ```
//!
//! Rank 0 holds the ledger ([`Ledger`]): who has which tile, and which are finished. The others ask it for tiles before
//! they have run out, most expensive first, and send what they computed. A rank that is not heard of is taken for lost:
//! its tiles are dealt again, and if it comes back, whichever result is first counts. The decisions of both sides
//! ([`Server`], [`Worker`]) do no I/O and know no clock, so that tests and simulations run them through millions of
//! orders of events; [`deal`] is a thread that carries messages between them and a [`Transport`].
//!
//! Before they deal rank 0 can tell all others something, such as the scene, and hear of each afterwards ([`Relay`]).
//! Over a relay the others hear that rank 0 is there whatever it does, and end half a minute after it is not.
//! Processes that know nothing of each other share work as a [`Shard`] says.
//!
//! The feature `mpi` adds the module `mpi`, the transport between machines; it needs an MPI library
//! and libclang to build.
//!
//! Current state and limits: rank 0 cannot be lost (the others say so and end); all messages are point to point.
#![deny(unsafe_code)]

mod checkpoint;
mod deal;
mod error;
mod ledger;
mod lifeline;
pub mod local;
mod machine;
mod message;
#[cfg(feature = "mpi")]
pub mod mpi;
mod patience;
mod ranks;
mod relay;
mod report;
mod server;
mod shard;
pub mod simulate;
mod transport;
mod worker;

pub use checkpoint::{Checkpoint, CheckpointError};
pub use deal::{Deal, Dealt, Finished, Job, Take, deal};
pub use error::ClusterError;
pub use ledger::{Lease, Ledger};
pub use machine::{Machine, host};
pub use message::{ToServer, ToWorker};
pub use patience::Patience;
pub use ranks::{JoinError, Ranks};
pub use relay::{Heard, Relay};
pub use report::{ClusterReport, RankReport};
pub use server::Server;
pub use shard::{NoShard, Shard};
pub use transport::{Transport, TransportError};
pub use worker::{End, Worker};
