//! The page of `raybalance render`.

use super::{Page, measured};
use crate::ReportError;
use crate::chart::cost::CostMap;
use crate::report::{PictureReport, Report};
use rt_balance::report::StreamRun;
use std::path::Path;

/// What the page shows.
#[derive(Debug)]
pub struct Rendered<'a> {
    /// The numbers.
    pub report: &'a Report,
    /// The streams, in the order of the report.
    pub runs: &'a [StreamRun],
    /// What rays cost, frame by frame and kind by kind.
    pub maps: &'a [CostMap],
    /// The picture's file; of an animation the contact sheet's.
    pub picture: &'a Path,
    /// What else lies beside the page, and what it is.
    pub files: &'a [(&'a str, &'a str)],
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
        self.report.missing().iter().for_each(|missing| page.lead(&format!("Not all that was asked for: {missing}.")));
        page.lead(&self.report.headline.sentence);
        page.section("Picture");
        let told = self.report.picture.as_ref().map_or_else(String::new, |p| {
            let [width, height] = p.size;
            format!(" with {} rays per pixel, {width} × {height} pixels", p.samples)
        });
        page.picture(self.picture, &format!("{} rendered{told}", scene.source))?;
        measured::add_costs(&mut page, self.maps);
        measured::add_to(&mut page, self.report, self.runs)?;
        if let Some(picture) = &self.report.picture {
            describe(&mut page, picture);
        }
        page.section("Files beside this page");
        page.files(self.files);
        page.write(path)
    }
}

/// How the picture was made, so that it can be made again.
fn describe(page: &mut Page, picture: &PictureReport) {
    let PictureReport {
        size: [width, height],
        samples,
        samples_asked,
        bounces,
        frames,
        degrees_per_frame,
        camera_path,
        wind,
        seed,
        camera,
        ..
    } = picture;
    let of = if samples < samples_asked { format!(" of {samples_asked}") } else { String::new() };
    let wind = match wind {
        Some(1.0) => ", in the wind".to_owned(),
        Some(strength) => format!(", in wind of {strength} times a fresh breeze"),
        None => String::new(),
    };
    let turn = match camera_path {
        Some(file) => format!("; {frames} frames along `{file}`{wind}"),
        None if *frames > 1 => format!("; {frames} frames, {degrees_per_frame}° apart{wind}"),
        None => String::new(),
    };
    page.paragraph(&format!(
        "{width} × {height} pixels, {samples}{of} samples of each, diffuse bounces: {bounces}, seed {seed}{turn}. The \
         camera, in the coordinates of the file:"
    ));
    page.code(&camera.to_string());
}
