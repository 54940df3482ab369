//! The page of `raybalance render`.

use super::{Page, measured};
use crate::ReportError;
use crate::chart::cost::CostMap;
use crate::report::Report;
use rt_balance::report::StreamRun;
use std::path::Path;

/// What the page shows.
#[derive(Debug)]
pub struct Rendered<'a> {
    /// The numbers.
    pub report: &'a Report,
    /// The streams, in the order of the report.
    pub runs: &'a [StreamRun],
    /// What the first frame's rays cost, kind by kind.
    pub maps: &'a [CostMap],
    /// The picture's file: the first frame's.
    pub picture: &'a Path,
}

impl Rendered<'_> {
    /// Writes the page.
    ///
    /// # Errors
    /// When the picture cannot be read or the page not be written.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        let scene = &self.report.scene;
        let seed = self.report.provenance.seed.unwrap_or_default();
        let seeds = format!("Seed {seed} of samples, pixels and bounces.");
        let title = format!("raybalance: {}", scene.source);
        let mut page = Page::new(&title, &self.report.provenance, &seeds);
        page.lead(&self.report.headline.sentence);
        page.section("Picture");
        let told = self.report.picture.as_ref().map_or_else(String::new, |p| {
            let [width, height] = p.size;
            format!(" with {} rays per pixel, {width} × {height} pixels", p.samples)
        });
        page.picture(self.picture, &format!("{} rendered{told}", scene.source))?;
        measured::add_costs(&mut page, self.maps);
        measured::add_to(&mut page, self.report, self.runs)?;
        page.paragraph(
            "Beside this page: cost.png shows the cost of every pixel, trace.json has the timeline to zoom into, and \
             report.json has all numbers.",
        );
        page.write(path)
    }
}
