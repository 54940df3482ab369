//! Finding and loading the library, once in a process.

use crate::enums::RTCDeviceProperty;
use crate::functions::Functions;
use core::fmt;
use libloading::Library;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The environment variable that names the library's file. If it is set, no other is looked for.
pub const VARIABLE: &str = "RAYBALANCE_EMBREE";

/// Where `cargo xtask setup` puts the library, from this package's folder.
const SETUP: &str = "../../.setup/embree/embreex.libs";

/// Names of the system's own library.
const SYSTEM: [&str; 5] = ["libembree4.so.4", "libembree4.so", "libembree4.4.dylib", "libembree4.dylib", "embree4.dll"];

/// The major version whose interface this is.
const MAJOR: u32 = 4;

/// A loaded library.
struct Loaded {
    functions: Functions,
    version: [u32; 3],
}

/// Why there is no Embree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoadError {
    /// What was tried, and what became of it.
    attempts: Vec<String>,
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "no Embree 4: {}; run `cargo xtask setup`, or name the library in {VARIABLE}",
            self.attempts.join("; ")
        )
    }
}

impl std::error::Error for LoadError {}

/// The version of the library, which is loaded if it was not.
///
/// # Errors
/// When there is none that can be used.
pub fn version() -> Result<[u32; 3], LoadError> {
    loaded().as_ref().map(|loaded| loaded.version).map_err(Clone::clone)
}

/// The functions of the library, which is loaded if it was not.
#[inline]
pub(crate) fn functions() -> Result<&'static Functions, &'static LoadError> {
    loaded().as_ref().map(|loaded| &loaded.functions)
}

fn loaded() -> &'static Result<Loaded, LoadError> {
    static LOADED: OnceLock<Result<Loaded, LoadError>> = OnceLock::new();
    LOADED.get_or_init(|| {
        let mut attempts = Vec::new();
        for place in places(std::env::var_os(VARIABLE)) {
            match load(&place) {
                Ok(loaded) => return Ok(loaded),
                Err(reason) => attempts.push(reason),
            }
        }
        Err(LoadError { attempts })
    })
}

/// Where to look, in this order.
fn places(named: Option<OsString>) -> Vec<PathBuf> {
    if let Some(named) = named.filter(|named| !named.is_empty()) {
        return vec![named.into()];
    }
    let mut places = libraries_in(&Path::new(env!("CARGO_MANIFEST_DIR")).join(SETUP));
    places.extend(SYSTEM.map(PathBuf::from));
    places
}

/// Files of a folder that are named as the library is, in order of their names; none where there is no folder.
fn libraries_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let named = |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("libembree4"));
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).filter(named).collect();
    files.sort();
    files
}

fn load(place: &Path) -> Result<Loaded, String> {
    // SAFETY: Embree's initialisers do nothing but set up its own state.
    let library = unsafe { Library::new(place) }.map_err(|e| e.to_string())?;
    let functions = Functions::find(&library).map_err(|e| format!("{}: {e}", place.display()))?;
    // Never unloaded: its threads may outlive every device.
    core::mem::forget(library);
    let version = version_of(&functions).ok_or_else(|| format!("{}: it makes no device", place.display()))?;
    if version[0] != MAJOR {
        return Err(format!("{}: version {version:?}, not {MAJOR}", place.display()));
    }
    Ok(Loaded { functions, version })
}

/// The version that the library says it is; `None` where it cannot make a device.
fn version_of(functions: &Functions) -> Option<[u32; 3]> {
    // SAFETY: a null configuration is the default one.
    let device = unsafe { (functions.rtcNewDevice)(core::ptr::null()) };
    if device.is_null() {
        return None;
    }
    let parts = [RTCDeviceProperty::VERSION_MAJOR, RTCDeviceProperty::VERSION_MINOR, RTCDeviceProperty::VERSION_PATCH];
    // SAFETY: the device is alive.
    let version = parts.map(|part| unsafe { (functions.rtcGetDeviceProperty)(device, part) });
    // SAFETY: it is not used any more.
    unsafe { (functions.rtcReleaseDevice)(device) };
    Some(version.map(|part| u32::try_from(part).unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_named_library_is_the_only_one_looked_for() {
        assert_eq!(places(Some("/a/b.so".into())), [PathBuf::from("/a/b.so")]);
        assert!(places(Some(OsString::new())).len() >= SYSTEM.len());
        assert!(places(None).contains(&PathBuf::from("libembree4.so.4")));
    }

    #[test]
    fn what_is_no_embree_is_refused_with_its_name() {
        let missing = load(Path::new("/no/such/library.so"));
        assert!(missing.is_err_and(|reason| reason.contains("/no/such/library.so")));
        // A library that is no Embree: the C library, where it is called so.
        for other in ["libc.so.6", "libm.so.6"] {
            assert!(load(Path::new(other)).is_err_and(|reason| reason.contains(other)));
        }
        let error = LoadError { attempts: vec!["a: b".to_owned()] };
        assert!(error.to_string().contains("a: b") && error.to_string().contains("cargo xtask setup"));
    }
}
