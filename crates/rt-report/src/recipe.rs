//! Scripts that start a process for each shard of an animation, on engines that sites have already.

use crate::provenance::quoted;
use crate::usage::{Usage, usage};
use rt_cluster::Shard;
use std::fmt::{self, Write};
use std::str::FromStr;

/// What starts the processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recipe {
    /// Slurm, by a task array: `sbatch SCRIPT`.
    Slurm,
    /// HyperQueue, by a task array: `hq submit SCRIPT`.
    Hq,
    /// Whatever takes a command a line: GNU parallel, xargs, a shell.
    Parallel,
}

impl Recipe {
    const ALL: [(&str, Self); 3] = [("slurm", Self::Slurm), ("hq", Self::Hq), ("parallel", Self::Parallel)];

    /// The script that starts `command`, words as a shell takes them, once for each of so many shards.
    #[must_use]
    pub fn script(self, command: &str, shards: u32) -> String {
        // Each process takes all of its machine's devices.
        let array =
            |head: &str, number: &str| format!("#!/bin/sh\n{head}exec {command} --shard \"${{{number}}}/{shards}\"\n");
        match self {
            Self::Slurm => array(
                &format!(
                    "#SBATCH --job-name=raybalance\n#SBATCH --array=1-{shards}\n#SBATCH --nodes=1\n#SBATCH --exclusive\n"
                ),
                "SLURM_ARRAY_TASK_ID",
            ),
            Self::Hq => {
                array(&format!("#HQ --name=raybalance\n#HQ --array=1-{shards}\n#HQ --cpus=all\n"), "HQ_TASK_ID")
            }
            Self::Parallel => Shard::all(shards).fold(String::new(), |mut lines, shard| {
                let _ = writeln!(lines, "{command} --shard {shard}");
                lines
            }),
        }
    }
}

impl FromStr for Recipe {
    type Err = NoRecipe;

    fn from_str(text: &str) -> Result<Self, NoRecipe> {
        Self::ALL.into_iter().find(|(name, _)| *name == text).map(|(_, recipe)| recipe).ok_or(NoRecipe)
    }
}

/// A text names no recipe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoRecipe;

impl fmt::Display for NoRecipe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = Recipe::ALL.map(|(name, _)| name);
        write!(f, "there are {}", names.join(", "))
    }
}

impl std::error::Error for NoRecipe {}

/// This program's command line as a shell takes it, without some of its options, each of which has a value. The program
/// is named by its whole path: others are started elsewhere.
///
/// # Errors
/// Of wrong usage, when a word of it is no text.
pub fn command_without(options: &[&str]) -> Result<String, Usage> {
    let no_text = |word: std::ffi::OsString| {
        usage(format!("`{}` is no text, and so cannot be put into a script", word.to_string_lossy()))
    };
    let mut words =
        std::env::args_os().map(|word| word.into_string().map_err(no_text)).collect::<Result<Vec<_>, _>>()?;
    if let (Ok(path), Some(program)) = (std::env::current_exe().map(|path| path.into_os_string()), words.first_mut()) {
        *program = path.into_string().map_err(no_text)?;
    }
    Ok(without(&words, options))
}

fn without(words: &[String], options: &[&str]) -> String {
    let mut kept: Vec<String> = Vec::new();
    let mut words = words.iter();
    while let Some(word) = words.next() {
        if options.contains(&word.as_str()) {
            words.next();
        } else if !options.iter().any(|option| word.strip_prefix(option).is_some_and(|rest| rest.starts_with('='))) {
            kept.push(quoted(word));
        }
    }
    kept.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: a value left behind; an option that only begins alike left out; words that are not quoted.
    #[test]
    fn a_command_is_left_without_some_options() {
        let words = ["/opt/ray balance", "room.obj", "--emit", "slurm", "--shards=8", "--emitter", "x", "--out", "a b"];
        let command = without(&words.map(str::to_owned), &["--emit", "--shards"]);
        assert_eq!(command, "'/opt/ray balance' room.obj --emitter x --out 'a b'");
    }

    #[test]
    fn recipes_are_scripts_that_start_every_shard() {
        let script = |name: &str| name.parse::<Recipe>().unwrap().script("render room.obj", 3);
        assert_eq!(
            script("slurm"),
            "#!/bin/sh\n#SBATCH --job-name=raybalance\n#SBATCH --array=1-3\n#SBATCH --nodes=1\n#SBATCH --exclusive\n\
             exec render room.obj --shard \"${SLURM_ARRAY_TASK_ID}/3\"\n"
        );
        assert_eq!(
            script("hq"),
            "#!/bin/sh\n#HQ --name=raybalance\n#HQ --array=1-3\n#HQ --cpus=all\n\
             exec render room.obj --shard \"${HQ_TASK_ID}/3\"\n"
        );
        assert_eq!(
            script("parallel"),
            "render room.obj --shard 1/3\nrender room.obj --shard 2/3\nrender room.obj --shard 3/3\n"
        );
        assert!("sge".parse::<Recipe>().unwrap_err().to_string().contains("slurm, hq, parallel"));
    }
}
