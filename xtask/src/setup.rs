//! `cargo xtask setup`: what the tests need from outside this repository.

use crate::command::{cargo, root, succeeds};
use crate::{apt, scenes};
use anyhow::{Context, Result, bail};
use std::path::PathBuf;
use std::process::Command;

/// What `setup` put in place.
#[derive(Debug)]
pub(crate) struct Setup {
    /// Folder of unpacked scenes, if the caller named any.
    pub(crate) scenes: Option<PathBuf>,
}

/// What tests may demand through `RT_REQUIRE` on a machine where `setup` has run: the parts below and every device
/// that needs none.
pub(crate) const PROVIDED: &[&str] = &["cpu"];

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
    scenes: Option<scenes::Folders>,
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
        install: |_| apt::install("xz-utils").map(|()| "installed xz-utils".to_owned()),
    },
    Part {
        name: "scenes",
        state: |context| match &context.scenes {
            Some(folders) => Ok(present(folders.outdated()?.is_empty())),
            None => Ok(State::NotNeeded("RAYBALANCE_SCENES is not set")),
        },
        install: |context| context.scenes.as_ref().map_or_else(|| Ok(String::new()), scenes::Folders::update),
    },
];

/// Puts every part in place.
pub(crate) fn setup() -> Result<Setup> {
    let source = std::env::var_os("RAYBALANCE_SCENES").filter(|value| !value.is_empty());
    let target = root().join(".setup/scenes");
    let scenes = source.map(|source| scenes::Folders::new(source.into(), target)).transpose()?;
    let context = Wanted { scenes };
    for part in PARTS {
        let name = part.name;
        match (part.state)(&context).with_context(|| format!("looking for {name}"))? {
            State::Present => println!("setup: {name}: present"),
            State::NotNeeded(reason) => println!("setup: {name}: not needed ({reason})"),
            State::Missing => {
                let done = (part.install)(&context).with_context(|| format!("setting up {name}"))?;
                println!("setup: {name}: {done}");
            }
        }
    }
    Ok(Setup { scenes: context.scenes.map(scenes::Folders::into_target) })
}

fn present(yes: bool) -> State {
    if yes { State::Present } else { State::Missing }
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
