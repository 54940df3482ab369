//! `raybalance tradeoff layout`: what the layout of the tree costs in memory and in time to make it, and what it buys
//! in rays per second.
//!
//! Compared are the two-wide tree and the eight-wide compressed one that is made from it. Only graphics cards can trace
//! over either; processors walk the two-wide tree alone (`docs/results/layouts.md` says why).

mod measure;
mod write;

use super::Options;
use super::Setting;
use anyhow::{Context, Result};
use rt_balance::devices::{self, CardOptions, Opener};
use rt_balance::vulkan::{Layout, Layouts};
use rt_core::Device;
use rt_report::html::Page;
use std::sync::Arc;

/// The layouts, in the order of rows and of [`Card::devices`]: their names, and how a card is told to trace over them.
const LAYOUTS: [(&str, Layout); 2] = [("two-wide", Layout::Two), ("eight-wide", Layout::Wide)];

/// A graphics card, opened once for each of [`LAYOUTS`].
pub(super) struct Card {
    /// As the command line names it.
    entry: String,
    devices: [Arc<dyn Device>; 2],
}

/// Four kinds of rays, over both layouts.
pub(super) fn passes(_: &Options) -> f64 {
    4.0 * LAYOUTS.len() as f64
}

/// The cards of a list, without one every card but software rasterisers; and why what else is in the list is left out,
/// or there is none.
pub(super) fn cards(list: Option<&str>) -> Result<(Vec<Card>, Vec<String>)> {
    let list = match list {
        Some(list) => list.to_owned(),
        None => devices::card_entries().join(","),
    };
    if list.is_empty() {
        return Ok((Vec::new(), vec![no_card(devices::first_software_entry())]));
    }
    let open = |trace| {
        let layouts = Some(Layouts { trace, count: Layout::Two });
        Opener::new()
            .with_cards(CardOptions { layouts, ..CardOptions::default() })
            .open_in_turn(&list)
            .context("--devices")
    };
    let [(_, two), (_, wide)] = LAYOUTS;
    let (mut cards, mut left_out) = (Vec::new(), Vec::new());
    for (two, wide) in open(two)?.into_iter().zip(open(wide)?) {
        match two.card {
            Some(_) => cards.push(Card { entry: two.entry, devices: [two.device, wide.device] }),
            None => left_out.push(format!(
                "{} walks the two-wide tree alone: name a graphics card, such as vulkan:0, without a speed",
                two.entry
            )),
        }
    }
    Ok((cards, left_out))
}

/// Why nothing can be measured without a list, and what to do.
fn no_card(software: Option<String>) -> String {
    let what = "processors walk the two-wide tree alone, and no graphics card was found";
    match software {
        Some(entry) => format!(
            "{what}; software rasterisers are measured only when named: raybalance tradeoff layout --devices {entry}"
        ),
        None => format!("{what}; `raybalance devices` lists what there is, and why a card cannot be used"),
    }
}

/// Each card once.
pub(super) fn one_each(cards: &[Card]) -> Vec<Arc<dyn Device>> {
    cards.iter().map(|card| Arc::clone(&card.devices[0])).collect()
}

pub(super) fn run(setting: &Setting<'_>, page: &mut Page) -> Result<()> {
    let scenes = &setting.args.scenes;
    let mut rows = Vec::new();
    for (index, scene) in scenes.iter().enumerate() {
        rows.push(measure::measure(setting, scene, &setting.time.equal_part(scenes.len(), index))?);
    }
    write::all(setting, &rows, page)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processors_are_left_out_with_the_reason() {
        let (cards, left_out) = cards(Some("cpu:1,cpu:1@0.5")).unwrap();
        assert!(cards.is_empty());
        assert!(left_out[0].starts_with("cpu:1 ") && left_out[1].starts_with("cpu:1@0.5 "), "{left_out:?}");
        assert!(left_out.iter().all(|reason| reason.contains("name a graphics card")));
        assert!(super::cards(Some("gpu")).is_err());
        assert!(no_card(Some("wgpu:2".to_owned())).ends_with("--devices wgpu:2"));
        assert!(no_card(None).contains("raybalance devices"));
    }
}
