//! `raybalance tradeoff`: what one knob costs and buys, measured on this machine.
//!
//! Statistics of repeated measurements are in [`rt_verify::stats`], comparisons of hits in [`rt_verify::accuracy`].

mod precision;
mod streams;

use crate::args::TradeoffCommand;
use anyhow::Result;

pub(crate) fn run(command: &TradeoffCommand) -> Result<()> {
    match command {
        TradeoffCommand::Precision(args) => precision::run(args),
    }
}
