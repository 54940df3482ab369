//! The parts of the raybalance command, as a library so that they can be tested.
#![forbid(unsafe_code)]

mod args;
mod balance;
mod bench;
mod devices;
mod exit;
mod experiment;
mod figure1;
mod frame;
mod interrupt;
mod list;
pub mod npy;
mod progress;
mod render;
mod scene_source;
mod shade;
mod trace;
mod tradeoff;
mod verify;

use args::{Cli, Command};
use clap::Parser;
use exit::Exit;
use rt_report::{chart, html, image, output, report, table};
use std::process::ExitCode;

/// Runs the command line; `--help` lists the exit codes.
#[must_use]
pub fn main() -> ExitCode {
    interrupt::watch();
    let cli = Cli::parse();
    let command = cli.command.unwrap_or_else(|| Command::Render(Box::default()));
    let result = match command {
        Command::Render(args) => render::run(&args),
        Command::Trace(args) => trace::run(&args),
        Command::Figure1(args) => figure1::run(&args),
        Command::Tradeoff(args) => tradeoff::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Devices(args) => list::devices(args.json),
        Command::Scenes(args) => list::scenes(args.json),
    };
    match result {
        Ok(()) => Exit::Success.into(),
        Err(error) => {
            // Causes on one line: the chain ends with what to do.
            eprintln!("error: {error:#}");
            if interrupt::requested() { Exit::Interrupted.into() } else { Exit::of(&error).into() }
        }
    }
}
