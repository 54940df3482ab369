//! Peers by name.

use rt_core::{Backend, Device, DeviceError, DeviceErrorKind};
use std::sync::Arc;

/// Most threads that a peer may be asked for.
const MOST_THREADS: usize = 4096;

/// A peer as lists name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Named {
    /// Embree with its robust flag.
    Embree,
    /// Embree without it, which may leak between triangles.
    EmbreeFast,
    /// obvhs over its two-wide tree.
    Obvhs,
    /// obvhs over its compressed eight-wide tree.
    ObvhsWide,
}

/// Every peer, the most careful first. An entry is the name and, after a colon, the number of threads; without it, all
/// cores: `embree:1`, `obvhs`.
#[must_use]
pub fn backends() -> Vec<Arc<dyn Backend>> {
    [Named::Embree, Named::EmbreeFast, Named::Obvhs, Named::ObvhsWide].map(|named| Arc::new(named) as _).into()
}

/// Every peer that is here, on one thread, the most careful first; and why others are not.
#[must_use]
pub fn all() -> (Vec<Arc<dyn Device>>, Vec<String>) {
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    for backend in backends() {
        match backend.open(Some("1")) {
            Ok(device) => found.push(device),
            Err(error) => missing.push(error.to_string()),
        }
    }
    // Several are missing for one reason.
    missing.dedup();
    (found, missing)
}

fn error(kind: DeviceErrorKind, message: impl Into<String>) -> DeviceError {
    DeviceError::new(kind, message)
}

/// The number of threads that follows a name.
fn threads(which: Option<&str>) -> Result<usize, DeviceError> {
    let Some(number) = which else { return Ok(std::thread::available_parallelism().map_or(1, usize::from)) };
    number.parse().ok().filter(|threads| (1..=MOST_THREADS).contains(threads)).ok_or_else(|| {
        let message = format!("the thread count must be a whole number from 1 to {MOST_THREADS}, such as embree:2");
        error(DeviceErrorKind::InvalidArgument, message)
    })
}

impl Backend for Named {
    fn name(&self) -> &str {
        match self {
            Self::Embree => "embree",
            Self::EmbreeFast => "embree-fast",
            Self::Obvhs => "obvhs",
            Self::ObvhsWide => "obvhs-wide",
        }
    }

    fn form(&self) -> &str {
        match (self, cfg!(feature = "peers")) {
            (Self::Embree, true) => "embree:THREADS",
            (Self::EmbreeFast, true) => "embree-fast:THREADS",
            (Self::Obvhs, true) => "obvhs:THREADS",
            (Self::ObvhsWide, true) => "obvhs-wide:THREADS",
            (_, false) => "with the feature peers",
        }
    }

    fn entries(&self) -> Vec<String> {
        if cfg!(feature = "peers") { vec![format!("{}:1", self.name())] } else { Vec::new() }
    }

    fn check(&self, which: Option<&str>) -> Result<(), DeviceError> {
        threads(which)?;
        are_built()
    }

    fn open(&self, which: Option<&str>) -> Result<Arc<dyn Device>, DeviceError> {
        let threads = threads(which)?;
        are_built()?;
        self.open_on(threads)
    }
}

#[cfg(feature = "peers")]
impl Named {
    fn open_on(self, threads: usize) -> Result<Arc<dyn Device>, DeviceError> {
        use crate::{EmbreeDevice, EmbreeOptions, ObvhsDevice, ObvhsLayout};
        let embree = |robust| -> Result<Arc<dyn Device>, DeviceError> {
            let opened = EmbreeDevice::open(EmbreeOptions { robust, threads, ..EmbreeOptions::default() });
            Ok(Arc::new(opened.map_err(|missing| error(DeviceErrorKind::Unsupported, missing.to_string()))?))
        };
        Ok(match self {
            Self::Embree => embree(true)?,
            Self::EmbreeFast => embree(false)?,
            Self::Obvhs => Arc::new(ObvhsDevice::new(ObvhsLayout::Bvh2, threads)),
            Self::ObvhsWide => Arc::new(ObvhsDevice::new(ObvhsLayout::CwBvh, threads)),
        })
    }
}

/// Whether there are tracers behind the names.
fn are_built() -> Result<(), DeviceError> {
    if cfg!(feature = "peers") { Ok(()) } else { Err(absent()) }
}

fn absent() -> DeviceError {
    let message = "this program was built without Embree and obvhs: build it with the feature peers, as in `cargo \
                   build --release -p rt-cli --features peers`";
    error(DeviceErrorKind::Unsupported, message)
}

#[cfg(not(feature = "peers"))]
impl Named {
    fn open_on(self, _threads: usize) -> Result<Arc<dyn Device>, DeviceError> {
        Err(absent())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: a bound moved; a word taken for no number, which means all cores.
    #[test]
    fn threads_are_read_or_explained() {
        assert_eq!((threads(Some("1")).unwrap(), threads(Some("4096")).unwrap()), (1, 4096));
        assert!(threads(None).unwrap() >= 1);
        for bad in ["", "0", "4097", "-1", "x", "1:1"] {
            assert!(threads(Some(bad)).is_err_and(|error| error.to_string().contains("whole number from 1")), "{bad}");
        }
    }

    /// Fails when a name cannot be an entry of a list, or what is built depends on the peer.
    #[test]
    fn each_has_a_name_of_its_own() {
        let mut names: Vec<String> = backends().iter().map(|backend| backend.name().to_owned()).collect();
        assert!(names.iter().all(|name| name.chars().all(|c| c.is_ascii_lowercase() || c == '-')), "{names:?}");
        names.dedup();
        assert_eq!(names.len(), 4);
        for backend in backends() {
            assert_eq!(backend.check(Some("1")).is_ok(), cfg!(feature = "peers"));
            assert!(absent().to_string().contains("--features peers"));
            assert!(backend.check(Some("0")).is_err_and(|error| error.to_string().contains("thread count")));
            assert_eq!(backend.entries().is_empty(), !cfg!(feature = "peers"));
        }
    }
}
