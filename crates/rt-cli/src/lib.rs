//! The parts of the raybalance command, as a library so that they can be tested.
#![forbid(unsafe_code)]

mod args;
mod balance;
mod experiments;
mod interrupt;
mod list;
mod progress;
mod ranks;
mod render;
mod scene;
mod trace;
mod verify;

use anyhow::{Context, Result};
use args::{Cli, Command};
use clap::Parser;
use rt_balance::devices;
use rt_render::memory;
use rt_report::exit::Exit;
use rt_report::print::StdoutError;
use rt_report::usage::usage;
use rt_report::{html, output, report, table};
use std::process::ExitCode;

/// Runs the command line; `--help` lists the exit codes.
#[must_use]
pub fn main() -> ExitCode {
    interrupt::watch();
    let exit = match Cli::try_parse_from(args::with_command(std::env::args_os().collect())) {
        Ok(cli) => end(run(cli)),
        // Help that was asked for is an output like any other.
        Err(help) if !help.use_stderr() => end(help.print().map_err(|error| StdoutError::wrap(error).into())),
        Err(wrong) => {
            let _ = wrong.print();
            Exit::Usage
        }
    };
    interrupt::leave(exit)
}

fn run(cli: Cli) -> Result<()> {
    devices::check_environment().map_err(|bad| usage(bad.to_string()))?;
    let command = cli.command.unwrap_or_else(|| Command::Render(Box::default()));
    if !matches!(command, Command::Devices(_) | Command::Scenes(_) | Command::Diff(_)) {
        // Trees are built and pictures shaded on them. Where they cannot be started on first use, that is a panic.
        let threads = rayon::ThreadPoolBuilder::new().build_global();
        threads.context("cannot start a thread for each core: allow more, or set RAYON_NUM_THREADS to fewer")?;
    }
    match command {
        Command::Render(args) => render::run(&args),
        Command::Trace(args) => trace::run(&args),
        Command::Compare(args) => experiments::compare(&args),
        Command::Diff(args) => experiments::diff(&args),
        Command::Figure1(args) => experiments::figure1(&args),
        Command::Simulate(args) => experiments::simulate(&args),
        Command::Tradeoff(args) => experiments::tradeoff(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Bench(args) => experiments::bench(&args),
        Command::Devices(args) => list::devices(args.json),
        Command::Scenes(args) => list::scenes(args.json),
    }
}

/// What a run ends in; whoever sent a signal is told that it was heard.
fn end(result: Result<()>) -> Exit {
    match Exit::after(result) {
        quiet @ (Exit::Success | Exit::ClosedPipe) => quiet,
        failed => interrupt::exit().unwrap_or(failed),
    }
}
