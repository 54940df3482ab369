//! Software Vulkan: Mesa's lavapipe in a folder of the project's own, as several devices.
//!
//! The system's configuration stays as it is. Debian's packages of the loader, the validation layers and the tools are
//! installed; the driver is only unpacked, because the release's own is too old and must not meet the loader.

use crate::apt;
use crate::command::{root, succeeds};
use crate::files::remove;
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// How many devices there are, to stand for as many GPUs.
///
/// Each manifest of the driver is a device of its own to the loader. Unlike several logical devices of one they run at
/// the same time. Three is the least at which losing one still leaves something to balance.
const DEVICES: usize = 3;

/// Oldest major version of Mesa that traces right: 22.3.6, which Debian 12 has, ends loops after 65,535 iterations.
const OLDEST_MESA: u32 = 25;

/// What is installed: the loader, the validation layers, `vulkaninfo`, and `spirv-val`.
const PACKAGES: &[&str] = &["libvulkan1", "vulkan-validationlayers", "vulkan-tools", "spirv-tools"];

/// The package with lavapipe, which is only unpacked.
const DRIVER: &str = "mesa-vulkan-drivers";

/// The layer that the tests turn on.
const VALIDATION_LAYER: &str = "VK_LAYER_KHRONOS_validation";

/// Where the system's own drivers are registered.
const SYSTEM_MANIFESTS: &str = "/usr/share/vulkan/icd.d";

/// Where the driver is unpacked to, in the repository.
const FOLDER: &str = ".setup/vulkan";

/// Where every device's manifest lies; `.cargo/config.toml` names it to the loader, for programs that cargo starts.
const MANIFESTS: &str = "icd.d";

/// Variables that tell the loader which drivers to load, and no others: today's name and that of loaders before
/// 1.3.207.
pub(crate) const DRIVER_VARIABLES: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

/// Variables under which programs find the devices and nothing else.
pub(crate) fn environment() -> Result<Vec<(&'static str, OsString)>> {
    let files = std::env::join_paths(manifests()).context("the path of this checkout has a `:` in it")?;
    Ok(DRIVER_VARIABLES.map(|name| (name, files.clone())).into())
}

/// What keeps the tests from using software Vulkan, or nothing.
pub(crate) fn defect() -> Result<Option<String>> {
    if !succeeds(Command::new("spirv-val").arg("--version")) {
        return Ok(Some("spirv-val cannot be started".to_owned()));
    }
    let mut info = Command::new("vulkaninfo");
    let Ok(output) = info.arg("--summary").envs(environment()?).output() else {
        return Ok(Some("vulkaninfo cannot be started".to_owned()));
    };
    let summary = String::from_utf8_lossy(&output.stdout);
    Ok(fault(&summary).map(|fault| format!("{fault}; vulkaninfo says:\n{}", String::from_utf8_lossy(&output.stderr))))
}

/// Puts the packages and the driver in place, and says where the driver is from.
pub(crate) fn install() -> Result<String> {
    apt::install(PACKAGES)?;
    if defect()?.is_none() {
        return Ok("installed packages; the driver was there".to_owned());
    }
    if let Some(manifest) = good_system_manifest()? {
        return Ok(format!("{DEVICES} devices of the system's driver, {}", manifest.display()));
    }
    let folder = folder();
    let staging = folder.with_extension("partial");
    recreate(&staging)?;
    let archive = apt::download_backport(DRIVER, &staging)
        .with_context(|| format!("no Mesa from version {OLDEST_MESA} on: install one, then try again"))?;
    let unpacked = staging.join("unpacked");
    apt::unpack(&archive, &unpacked)?;
    let mut needed = apt::dependencies(&archive)?;
    // Vulkan itself is above, and versions do not matter to lavapipe: `absent_libraries` has the last word.
    needed.retain(|package| !PACKAGES.contains(&package.as_str()));
    apt::install(&needed)?;

    // Renamed when it is whole, so that an interruption leaves nothing that looks finished.
    remove(&folder)?;
    fs::rename(&unpacked, &folder).with_context(|| format!("cannot create `{}`", folder.display()))?;
    remove(&staging)?;
    let library = unpacked_library(&folder)?;
    let absent = absent_libraries(&library)?;
    if !absent.is_empty() {
        bail!("`{}` needs libraries that are not here: {}", library.display(), absent.join(", "));
    }
    write_manifests(&lavapipe_manifest(&folder.join("usr/share/vulkan/icd.d"))?, Some(&library))?;
    if let Some(defect) = defect()? {
        bail!("installed, but {defect}");
    }
    Ok(format!("{DEVICES} devices of the driver in {}", folder.display()))
}

fn folder() -> PathBuf {
    root().join(FOLDER)
}

fn manifests() -> [PathBuf; DEVICES] {
    std::array::from_fn(|index| folder().join(MANIFESTS).join(format!("lvp_{index}.json")))
}

/// What is wrong with the devices and layers in a summary by `vulkaninfo`.
fn fault(summary: &str) -> Option<String> {
    let values = |key: &str| {
        let pairs = summary.lines().filter_map(|line| line.split_once('='));
        pairs.filter(|(name, _)| name.trim() == key).map(|(_, value)| value.trim()).collect::<Vec<_>>()
    };
    let (names, versions) = (values("driverName"), values("driverInfo"));
    if names != ["llvmpipe"; DEVICES] || versions.len() != DEVICES {
        return Some(format!("{DEVICES} devices of llvmpipe are needed, there are {names:?}"));
    }
    let old = |version: &&&str| mesa_major(version).is_none_or(|major| major < OLDEST_MESA);
    if let Some(version) = versions.iter().find(old) {
        return Some(format!("Mesa {OLDEST_MESA} is needed, this is `{version}`"));
    }
    let layer = |line: &str| line.split_whitespace().next() == Some(VALIDATION_LAYER);
    (!summary.lines().any(layer)).then(|| format!("{VALIDATION_LAYER} is missing"))
}

/// Major version in a driver's own words, such as `Mesa 25.0.7-2 (LLVM 15.0.6)`.
fn mesa_major(version: &str) -> Option<u32> {
    version.strip_prefix("Mesa ")?.split('.').next()?.parse().ok()
}

/// Points the devices at the system's own lavapipe, if it is there and new enough.
fn good_system_manifest() -> Result<Option<PathBuf>> {
    let Ok(manifest) = lavapipe_manifest(Path::new(SYSTEM_MANIFESTS)) else { return Ok(None) };
    write_manifests(&manifest, None)?;
    Ok(defect()?.is_none().then_some(manifest))
}

/// The manifest of lavapipe in a folder: `lvp_icd.json`, or with the processor's name in it.
fn lavapipe_manifest(folder: &Path) -> Result<PathBuf> {
    let is_lavapipe = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("lvp_icd.") && name.ends_with("json")
    };
    let files = fs::read_dir(folder).with_context(|| format!("cannot list `{}`", folder.display()))?;
    let mut files = files.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    files.find(is_lavapipe).with_context(|| format!("no lavapipe in `{}`", folder.display()))
}

/// The driver among a package's files, whose folder has the processor's name in it.
fn unpacked_library(folder: &Path) -> Result<PathBuf> {
    let libraries = folder.join("usr/lib");
    let folders = fs::read_dir(&libraries).with_context(|| format!("cannot list `{}`", libraries.display()))?;
    let mut files = folders.filter_map(|entry| entry.ok().map(|entry| entry.path().join("libvulkan_lvp.so")));
    files.find(|file| file.exists()).with_context(|| format!("no lavapipe in `{}`", libraries.display()))
}

/// Writes every device's manifest after the driver's own, with another place of the library if given.
fn write_manifests(original: &Path, library: Option<&Path>) -> Result<()> {
    let context = || format!("cannot read `{}`", original.display());
    let text = fs::read_to_string(original).with_context(context)?;
    let mut manifest: Value = serde_json::from_str(&text).with_context(context)?;
    if let Some(library) = library {
        let library = library.to_str().context("the path of this checkout is not UTF-8")?;
        manifest["ICD"]["library_path"] = library.into();
    }
    for path in manifests() {
        let folder = path.parent().context("manifests lie in a folder")?;
        fs::create_dir_all(folder).with_context(|| format!("cannot create `{}`", folder.display()))?;
        fs::write(&path, format!("{manifest:#}\n")).with_context(|| format!("cannot write `{}`", path.display()))?;
    }
    Ok(())
}

/// Libraries that the dynamic linker does not find for this one.
fn absent_libraries(library: &Path) -> Result<Vec<String>> {
    let output = Command::new("ldd").arg(library).env("LC_ALL", "C").output().context("cannot start ldd")?;
    let text = String::from_utf8_lossy(&output.stdout);
    let absent = text.lines().filter_map(|line| line.trim().strip_suffix("=> not found"));
    Ok(absent.map(|name| name.trim().to_owned()).collect())
}

fn recreate(folder: &Path) -> Result<()> {
    remove(folder)?;
    fs::create_dir_all(folder).with_context(|| format!("cannot create `{}`", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYER: &str = "VK_LAYER_KHRONOS_validation Khronos Validation Layer 1.3.239  version 1\n";

    fn device(name: &str, info: &str) -> String {
        format!("GPU:\n\tdriverID           = ANY\n\tdriverName         = {name}\n\tdriverInfo         = {info}\n")
    }

    #[test]
    fn three_new_devices_with_the_layer_will_do_and_nothing_less() {
        let new = device("llvmpipe", "Mesa 25.0.7-2~bpo12+1 (LLVM 15.0.6)");
        let old = device("llvmpipe", "Mesa 22.3.6 (LLVM 15.0.6)");
        let other = device("radv", "Mesa 25.0.7");
        assert_eq!(fault(&format!("{LAYER}{new}{new}{new}")), None);
        for (summary, reason) in [
            (String::new(), "3 devices"),
            (format!("{LAYER}{new}{new}"), "3 devices"),
            (format!("{LAYER}{new}{other}{new}"), "3 devices"),
            (format!("{LAYER}{new}{new}{old}"), "Mesa 22.3.6"),
            (format!("{new}{new}{new}"), VALIDATION_LAYER),
        ] {
            let fault = fault(&summary).unwrap();
            assert!(fault.contains(reason), "{fault}");
        }
    }

    /// Programs that cargo starts see the devices beside the machine's own drivers, unless the caller says otherwise.
    ///
    /// Mutants: another folder; `VK_DRIVER_FILES`, which hides all other drivers; a value that overrules the caller's.
    #[test]
    fn cargo_names_the_manifests_to_the_loader() {
        let config = fs::read_to_string(root().join(".cargo/config.toml")).unwrap();
        let line = format!("VK_ADD_DRIVER_FILES = {{ value = \"{FOLDER}/{MANIFESTS}\", relative = true }}");
        assert!(config.lines().any(|found| found == line), "{line}");
        assert!(DRIVER_VARIABLES.iter().all(|name| !config.contains(name)));
    }

    #[test]
    fn a_version_is_read_only_from_mesas_own_words() {
        assert_eq!(mesa_major("Mesa 25.0.7-2~bpo12+1 (LLVM 15.0.6)"), Some(25));
        assert_eq!(mesa_major("Mesa 26.1.0-devel (git-0)"), Some(26));
        assert_eq!(mesa_major("535.183.01"), None);
    }

    #[test]
    fn lavapipe_is_found_under_both_of_its_names_and_nothing_else_is() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("intel_icd.x86_64.json"), "").unwrap();
        assert!(lavapipe_manifest(dir.path()).is_err());
        for name in ["lvp_icd.json", "lvp_icd.x86_64.json"] {
            let path = dir.path().join(name);
            fs::write(&path, r#"{"ICD": {"library_path": "/driver.so"}}"#).unwrap();
            assert_eq!(lavapipe_manifest(dir.path()).unwrap(), path);
            fs::remove_file(path).unwrap();
        }
    }
}
