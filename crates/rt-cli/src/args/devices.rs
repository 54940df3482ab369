//! How devices are used.

use super::heading;
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use rt_balance::Device;
use rt_balance::cpu::Isa;
use rt_balance::devices::{self, CardOptions, Opener};
use rt_balance::vulkan::{Layout, Layouts, Tuning};
use rt_report::usage::usage;
use std::sync::Arc;

/// What opens the devices of lists: this project's, and peers.
pub(crate) fn opener() -> Opener {
    Opener::new().with_backends(backend_peers::backends())
}

/// Choices about devices, none of which changes a nearest hit.
#[derive(Clone, Copy, Debug, Default, Args)]
#[command(next_help_heading = heading::DEVICES)]
pub(crate) struct DeviceArgs {
    /// Instructions that processors trace with: portable, avx2 or avx512 [default: the environment variable
    /// RAYBALANCE_ISA, else the best there are]
    #[arg(long, value_name = "NAME")]
    pub(crate) isa: Option<Isa>,
    /// Tree that graphics cards find hits over; tests are counted over the two-wide one
    #[arg(long, value_enum, default_value_t = LayoutArg::Auto)]
    pub(crate) layout: LayoutArg,
    /// Lanes of each launch on graphics cards, which take ray after ray until none is left (persistent threads): best
    /// as many as the card runs at once [default: a lane for each ray]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub(crate) persistent: Option<u32>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum LayoutArg {
    /// The wide one, unless it does not fit
    #[default]
    Auto,
    /// The scene's own, two children to a node
    Two,
    /// Eight children to a node, compressed; the two-wide one where it does not fit
    Wide,
}

impl DeviceArgs {
    /// Refuses what none of the devices of a list would heed.
    ///
    /// # Errors
    /// When an option is about processors or graphics cards alone, and the list names none.
    pub(crate) fn check(self, list: Option<&str>) -> Result<()> {
        let list = list.unwrap_or(devices::AUTO);
        let refuse = |option, what, example| {
            let message = format!("{option} is about {what}, and --devices {list} names none, such as {example}");
            Err(usage(message).into())
        };
        if self.isa.is_some() && !devices::names_cpu(list) {
            return refuse("--isa", "processors", "cpu:1");
        }
        for (option, is_given) in
            [("--layout", self.layout != LayoutArg::Auto), ("--persistent", self.persistent.is_some())]
        {
            if is_given && !devices::names_card(list) {
                return refuse(option, "graphics cards", "vulkan:0");
            }
        }
        Ok(())
    }

    /// Those about graphics cards.
    pub(crate) fn cards(self) -> CardOptions {
        let layouts = match self.layout {
            LayoutArg::Auto => None,
            LayoutArg::Two => Some(Layouts { trace: Layout::Two, count: Layout::Two }),
            LayoutArg::Wide => Some(Layouts { trace: Layout::Wide, count: Layout::Two }),
        };
        CardOptions { layouts, tuning: Tuning { persistent_lanes: self.persistent, ..Tuning::default() } }
    }

    /// Opens the devices of `--devices`, to work at the same time.
    pub(crate) fn open(self, list: Option<&str>) -> Result<Vec<Arc<dyn Device>>> {
        let mut opener = opener().with_cards(self.cards()).with_isa(self.isa);
        let opened = opener.open(list.unwrap_or(devices::AUTO)).context("--devices")?;
        Ok(opened.into_iter().map(|opened| opened.device).collect())
    }
}
