//! The parts of the raybalance command, as a library so that they can be tested.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod args;
mod balance;
mod exit;
mod experiments;
mod film;
mod frame;
mod interrupt;
mod list;
mod memory;
mod progress;
mod render;
mod scene;
mod shade;
mod trace;
mod verify;

use anyhow::{Context, Result};
use args::{Cli, Command};
use clap::Parser;
use exit::Exit;
use rt_report::print::{Stdout, StdoutError, note};
use rt_report::{chart, html, output, report, table};
use std::io::Write;
use std::process::ExitCode;

/// Runs the command line; `--help` lists the exit codes.
#[must_use]
pub fn main() -> ExitCode {
    interrupt::watch();
    let exit = match Cli::try_parse() {
        Ok(cli) => end(run(cli)),
        // Help that was asked for is an output like any other.
        Err(help) if !help.use_stderr() => end(help.print().map_err(|error| StdoutError::wrap(error).into())),
        Err(wrong) => {
            let _ = wrong.print();
            Exit::Usage
        }
    };
    exit.into()
}

fn run(cli: Cli) -> Result<()> {
    let command = cli.command.unwrap_or_else(|| Command::Render(Box::default()));
    if !matches!(command, Command::Devices(_) | Command::Scenes(_)) {
        // Trees are built and pictures shaded on them. Where they cannot be started on first use, that is a panic.
        let threads = rayon::ThreadPoolBuilder::new().build_global();
        threads.context("cannot start a thread for each core: allow more, or set RAYON_NUM_THREADS to fewer")?;
    }
    match command {
        Command::Render(args) => render::run(&args),
        Command::Trace(args) => trace::run(&args),
        Command::Figure1(args) => experiments::figure1(&args),
        Command::Tradeoff(args) => experiments::tradeoff(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Bench(args) => experiments::bench(&args),
        Command::Devices(args) => list::devices(args.json),
        Command::Scenes(args) => list::scenes(args.json),
    }
}

/// Says what went wrong.
fn end(result: Result<()>) -> Exit {
    let Err(error) = result.and_then(|()| Ok(Stdout.flush()?)) else { return Exit::Success };
    if StdoutError::of(&*error).is_some_and(StdoutError::is_closed) {
        return Exit::ClosedPipe;
    }
    // Causes on one line: the chain ends with what to do.
    note(format_args!("error: {error:#}"));
    interrupt::exit().unwrap_or_else(|| Exit::of(&error))
}
