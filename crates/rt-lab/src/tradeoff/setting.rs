//! How the trades are measured, and how what they find is written.

use super::Options;
use super::layout::Card;
use crate::Lab;
use crate::time_budget::TimeBudget;
use anyhow::Result;
use rt_core::Device;
use rt_report::Provenance;
use rt_report::output::write_atomically;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;

/// How a trade is measured.
pub(super) struct Setting<'a> {
    pub(super) lab: Lab<'a>,
    pub(super) args: &'a Options,
    /// What is measured by the trades that need one device.
    pub(super) devices: &'a [Arc<dyn Device>],
    /// What is measured by the trade that needs a choice of layouts.
    pub(super) cards: &'a [Card],
    pub(super) size: [u32; 2],
    pub(super) repeat: u32,
    /// The trade's part of the time and of the bar.
    pub(super) time: TimeBudget<'a>,
    pub(super) head: Head,
}

/// What every file says of its origin.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Head {
    /// Layout of the file; changes when a field changes its meaning or goes away.
    pub(super) schema: u32,
    pub(super) provenance: Provenance,
    pub(super) size: [u32; 2],
}

impl Setting<'_> {
    /// Writes a text file into the output folder.
    pub(super) fn write(&self, name: &str, text: &str) -> Result<()> {
        Ok(write_atomically(&self.args.out.join(name), |out| out.write_all(text.as_bytes()))?)
    }

    /// Writes a drawing into the output folder.
    pub(super) fn write_svg(&self, name: &str, svg: &str) -> Result<()> {
        self.write(name, &self.head.provenance.in_svg(svg))
    }

    /// Writes a text in Markdown, under where it comes from, into the output folder.
    pub(super) fn write_markdown(&self, name: &str, text: &str) -> Result<()> {
        self.write(name, &format!("{}\n{text}", self.head.provenance))
    }

    /// Writes a JSON file: the head, and what was measured.
    pub(super) fn write_json(&self, name: &str, results: &impl Serialize) -> Result<()> {
        #[derive(Serialize)]
        struct File<'a, T> {
            #[serde(flatten)]
            head: &'a Head,
            results: &'a T,
        }
        let file = File { head: &self.head, results };
        Ok(write_atomically(&self.args.out.join(name), |out| Ok(serde_json::to_writer_pretty(out, &file)?))?)
    }

    /// Lines that open a CSV file.
    pub(super) fn csv_head(&self) -> String {
        self.head.provenance.csv()
    }
}

/// A scene's name as part of a file's.
pub(super) fn file_part(scene: &str) -> String {
    Path::new(scene).file_name().map_or_else(|| "scene".to_owned(), |name| name.to_string_lossy().replace(' ', "-"))
}
