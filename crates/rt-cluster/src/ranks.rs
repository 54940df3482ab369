//! The processes that work together, however many a launcher started.

use crate::{Transport, local};
use std::error::Error;
use std::fmt;

/// The processes that work together: one, unless a launcher started several.
#[derive(Debug)]
pub struct Ranks {
    #[cfg(feature = "mpi")]
    world: Option<std::sync::Arc<crate::mpi::World>>,
}

/// What launchers say of the number of processes.
const LAUNCHERS: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"];

impl Ranks {
    /// Joins the others, if a launcher started several.
    ///
    /// # Errors
    /// When there are several and they cannot reach each other.
    pub fn join() -> Result<Self, JoinError> {
        let launched = LAUNCHERS.into_iter().find(|name| std::env::var_os(name).is_some());
        #[cfg(feature = "mpi")]
        {
            let world = launched.map(|_| crate::mpi::World::join()).transpose().map_err(JoinError::Mpi)?;
            Ok(Self { world: world.map(std::sync::Arc::new) })
        }
        #[cfg(not(feature = "mpi"))]
        match launched {
            // Each of them would do all the work, and write over the others' results.
            Some(variable) if std::env::var(variable).is_ok_and(|size| size != "1") => {
                Err(JoinError::WithoutMpi { variable })
            }
            _ => Ok(Self {}),
        }
    }

    /// How many there are.
    #[must_use]
    pub fn size(&self) -> u32 {
        #[cfg(feature = "mpi")]
        if let Some(world) = &self.world {
            return world.size();
        }
        1
    }

    /// The number of this one.
    #[must_use]
    pub fn rank(&self) -> u32 {
        #[cfg(feature = "mpi")]
        if let Some(world) = &self.world {
            return world.rank();
        }
        0
    }

    /// What carries messages to the others. One of it at a time: two would take each other's messages.
    pub fn transport(&mut self) -> Box<dyn Transport> {
        #[cfg(feature = "mpi")]
        if let Some(world) = &self.world {
            return Box::new(crate::mpi::MpiRank::new(world));
        }
        Box::new(local::network(1, local::Weather::CALM).remove(0))
    }

    /// Leaves the others, in good order if `is_complete` says that they are all there and done. Otherwise they would be
    /// waited for for ever: the launcher then ends them all, unless it is told to go on without this one.
    pub fn leave(self, is_complete: bool) {
        #[cfg(feature = "mpi")]
        // A transport that is still there would use MPI after its end.
        if let Some(world) = self.world.and_then(std::sync::Arc::into_inner) {
            world.leave(is_complete);
        }
        let _ = is_complete;
    }
}

/// Why the other processes cannot be joined.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum JoinError {
    /// There are some, and this program was built without what they talk by.
    WithoutMpi {
        /// The variable that says so.
        variable: &'static str,
    },
    /// MPI cannot be used.
    #[cfg(feature = "mpi")]
    Mpi(crate::mpi::MpiError),
}

impl fmt::Display for JoinError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WithoutMpi { variable } => write!(
                f,
                "an MPI launcher started several of these, but this program was built without MPI ({variable} is set): \
                 build it with --features mpi"
            ),
            #[cfg(feature = "mpi")]
            Self::Mpi(error) => error.fmt(f),
        }
    }
}

impl Error for JoinError {}
