//! Checks in rounds: those of one round run two at a time, since most wait now and then, for a chain of crates, a
//! browser, other processes or a device.

use crate::command::{run, say, shown};
use anyhow::{Context, Error, Result, bail};
use std::collections::VecDeque;
use std::io::{Read, pipe};
use std::process::{Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How many checks of a round run at a time.
const WORKERS: usize = 2;

/// A check, and what it is called.
pub(crate) struct Step {
    name: String,
    check: Check,
}

enum Check {
    /// A program that must succeed.
    Command(Box<Command>),
    /// A check of our own, which writes to the terminal as it goes.
    Function(fn() -> Result<()>),
    /// Cannot be done here, for this reason.
    Impossible(&'static str),
}

impl Step {
    pub(crate) fn command(name: &str, command: Command) -> Self {
        Self { name: name.to_owned(), check: Check::Command(Box::new(command)) }
    }

    pub(crate) fn function(name: &str, function: fn() -> Result<()>) -> Self {
        Self { name: name.to_owned(), check: Check::Function(function) }
    }

    pub(crate) fn impossible(name: &str, reason: &'static str) -> Self {
        Self { name: name.to_owned(), check: Check::Impossible(reason) }
    }
}

/// How a step ended.
enum Outcome {
    Passed(Duration),
    Failed(Duration, Error),
    NotRun(&'static str),
}

/// Runs the rounds in order, and none after one in which a step failed. The error is that of the first step that
/// failed.
pub(crate) fn run_all(rounds: Vec<Vec<Step>>, begin: Instant) -> Result<()> {
    let total = rounds.iter().map(Vec::len).sum();
    let mut ended = Vec::new();
    for round in rounds {
        let done = ended.len();
        ended.extend(run_round(round, done, total));
        if ended[done..].iter().any(|(_, outcome)| matches!(outcome, Outcome::Failed(..))) {
            break;
        }
    }
    summarise(&ended, total, begin.elapsed());
    let failure = ended.into_iter().find_map(|(name, outcome)| match outcome {
        Outcome::Failed(_, error) => Some(error.context(name)),
        _ => None,
    });
    failure.map_or(Ok(()), Err)
}

/// Starts the steps of a round in order, and none after one has failed; returns those that were started, in the order
/// in which they ended. Of programs the first one writes to the terminal as it goes; what others write beside it is
/// shown when they end. `done` of `total` steps were before.
fn run_round(steps: Vec<Step>, done: usize, total: usize) -> Vec<(String, Outcome)> {
    let waiting = Mutex::new(steps.into_iter().enumerate().collect::<VecDeque<_>>());
    let ended = Mutex::new(Vec::new());
    let work = || {
        loop {
            let next = locked(&waiting).pop_front();
            let Some((place, Step { name, check })) = next else { return };
            let number = done + place + 1;
            say(format_args!("\n[{number}/{total}] {name}"));
            let start = Instant::now();
            let result = match check {
                Check::Command(mut command) if place == 0 => run(&mut command),
                Check::Command(command) => run_beside(*command, &name),
                Check::Function(function) => function(),
                Check::Impossible(reason) => {
                    say(format_args!("not run: {reason}"));
                    locked(&ended).push((name, Outcome::NotRun(reason)));
                    continue;
                }
            };
            let spent = start.elapsed();
            say(format_args!("[{number}/{total}] {name}: {:.1} s", spent.as_secs_f64()));
            let outcome = result.map_or_else(|error| Outcome::Failed(spent, error), |()| Outcome::Passed(spent));
            if matches!(outcome, Outcome::Failed(..)) {
                locked(&waiting).clear();
            }
            locked(&ended).push((name, outcome));
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..WORKERS {
            scope.spawn(work);
        }
    });
    ended.into_inner().unwrap_or_else(PoisonError::into_inner)
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs a program that must succeed, then shows in one piece what it wrote.
fn run_beside(mut command: Command, name: &str) -> Result<()> {
    let line = shown(&command);
    say(format_args!("$ {line}"));
    let (mut output, writer) = pipe().context("the system makes no pipe")?;
    let errors = writer.try_clone().context("the system makes no pipe")?;
    command.stdin(Stdio::null()).stdout(writer).stderr(errors);
    let mut child = command.spawn().with_context(|| format!("cannot start `{line}`"))?;
    // It holds ends to write to: while there are such, there is no end to read.
    drop(command);
    let mut text = Vec::new();
    output.read_to_end(&mut text).with_context(|| format!("cannot read what `{line}` writes"))?;
    let status = child.wait().with_context(|| format!("cannot wait for `{line}`"))?;
    say(format_args!("\n{name} wrote:\n{}", String::from_utf8_lossy(&text).trim_end()));
    if !status.success() {
        bail!("`{line}` failed ({status})");
    }
    Ok(())
}

fn summarise(ended: &[(String, Outcome)], total: usize, spent: Duration) {
    say("\nsummary");
    for (name, outcome) in ended {
        match outcome {
            Outcome::Passed(spent) => say(format_args!("  passed   {:7.1} s  {name}", spent.as_secs_f64())),
            Outcome::Failed(spent, _) => say(format_args!("  FAILED   {:7.1} s  {name}", spent.as_secs_f64())),
            Outcome::NotRun(reason) => say(format_args!("  not run             {name}: {reason}")),
        }
    }
    let left = total - ended.len();
    if left > 0 {
        say(format_args!("  {left} later steps were not reached"));
    }
    say(format_args!("  total    {:7.1} s", spent.as_secs_f64()));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::cargo;

    fn passing() -> Step {
        Step::command("passes", cargo("--version"))
    }

    fn failing() -> Step {
        Step::command("fails", cargo("no-such-command-of-cargo"))
    }

    /// Mutants: a failure beside steps that pass is lost; a step is left out; one that cannot be done counts as failed.
    #[test]
    fn all_steps_run_and_a_failure_among_them_is_told() {
        let round = || vec![passing(), passing(), Step::impossible("elsewhere", "no such system"), passing()];
        let ended = run_round(round(), 0, 4);
        assert_eq!(ended.len(), 4);
        assert!(ended.iter().all(|(_, outcome)| !matches!(outcome, Outcome::Failed(..))));
        run_all(vec![round(), round()], Instant::now()).unwrap();
        let error = run_all(vec![vec![passing(), passing(), failing()]], Instant::now()).unwrap_err();
        assert!(format!("{error:#}").starts_with("fails: `cargo no-such-command-of-cargo` failed"), "{error:#}");
    }

    /// Mutants: the next round is run after a failure; steps go on being started after it.
    #[test]
    fn nothing_starts_after_a_failure() {
        let reached = || bail!("a later round was reached");
        let rounds = vec![vec![failing()], vec![Step::function("later", reached)]];
        let error = run_all(rounds, Instant::now()).unwrap_err();
        assert!(!format!("{error:#}").contains("reached"), "{error:#}");
        // What was started beside it ends; of a hundred steps that are left not all are.
        let steps = std::iter::once(failing()).chain((0..100).map(|_| passing())).collect();
        assert!(run_round(steps, 0, 101).len() < 101);
    }
}
