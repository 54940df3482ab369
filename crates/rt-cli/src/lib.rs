//! The parts of the raybalance command, as a library so that they can be tested.
#![forbid(unsafe_code)]

mod args;
mod balance;
mod experiments;
mod film;
mod frame;
mod interrupt;
mod list;
mod memory;
pub mod npy;
mod progress;
mod render;
mod scene;
mod shade;
mod trace;
mod verify;

use args::{Cli, Command};
use clap::Parser;
use rt_report::{chart, html, output, report, table};
use std::process::ExitCode;

/// Exit code after Ctrl-C, as shells use it: 128 + SIGINT.
const INTERRUPTED: u8 = 130;

/// Runs the command line; the exit code is 0 on success, 1 on failure, 2 on wrong usage and 130 after Ctrl-C.
#[must_use]
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let command = cli.command.unwrap_or_else(|| Command::Render(Box::default()));
    let result = match command {
        Command::Render(args) => render::run(&args),
        Command::Trace(args) => trace::run(&args),
        Command::Figure1(args) => experiments::figure1(&args),
        Command::Tradeoff(args) => experiments::tradeoff(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Bench(args) => experiments::bench(&args),
        Command::Devices(args) => list::devices(args.json),
        Command::Scenes(args) => list::scenes(args.json),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Causes on one line: the chain ends with what to do.
            eprintln!("error: {error:#}");
            if interrupt::requested() { ExitCode::from(INTERRUPTED) } else { ExitCode::FAILURE }
        }
    }
}
