//! The pictures of a run: their names in its folder, written one after the other with one exposure.

use crate::output::names;
use crate::{ReportError, image};
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// All frames of an animation, small.
const SHEET: &str = "contact.png";

/// The name of a picture that is the only one.
const ALONE: &str = "image.png";

/// A picture, or the frames of an animation, in a folder.
#[derive(Clone, Debug)]
pub struct Pictures {
    folder: PathBuf,
    frames: u32,
    exposure: f32,
    /// The frame that was written last, and how many samples it has.
    last: Option<(u32, u32)>,
    /// Seconds that writing took.
    pub seconds: f64,
}

impl Pictures {
    /// So many frames, none of which is written yet.
    #[must_use]
    pub fn new(folder: &Path, frames: u32) -> Self {
        Self { folder: folder.to_owned(), frames, exposure: 1.0, last: None, seconds: 0.0 }
    }

    /// The names of all frames.
    pub fn names(&self) -> impl Iterator<Item = String> {
        (0..self.frames).map(|frame| self.name(frame))
    }

    fn name(&self, frame: u32) -> String {
        if self.frames == 1 { ALONE.to_owned() } else { format!("image-{frame:04}.png") }
    }

    /// The name of the sheet with all frames, where there are several.
    #[must_use]
    pub fn sheet(&self) -> Option<&'static str> {
        (self.frames > 1).then_some(SHEET)
    }

    /// The picture that shows most: the sheet, or the only one.
    #[must_use]
    pub fn main(&self) -> PathBuf {
        self.folder.join(self.sheet().unwrap_or(ALONE))
    }

    /// Writes a frame: sums of the radiance of so many samples of each pixel, in the order of [`image::write_png`].
    /// Every frame has the exposure of the first, which `exposure` computes.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(
        &mut self,
        (size, sums): ([u32; 2], &[Vec3]),
        exposure: impl FnOnce() -> f32,
        frame: u32,
        samples: u32,
    ) -> Result<(), ReportError> {
        let begin = Instant::now();
        if frame == 0 {
            self.exposure = exposure();
        }
        image::write_png(&self.folder.join(self.name(frame)), size, sums, self.exposure / samples as f32)?;
        self.last = Some((frame, samples));
        self.seconds += begin.elapsed().as_secs_f64();
        Ok(())
    }

    /// Writes the sheet, where there are several frames.
    ///
    /// # Errors
    /// When a frame cannot be read or the file not be written.
    pub fn write_sheet(&self) -> Result<(), ReportError> {
        let Some(sheet) = self.sheet() else { return Ok(()) };
        let frames: Vec<PathBuf> = self.names().map(|name| self.folder.join(name)).collect();
        image::write_contact_sheet(&self.folder.join(sheet), &frames)
    }

    /// The frame that was written last, and how many samples of each pixel it has.
    #[must_use]
    pub const fn last(&self) -> Option<(u32, u32)> {
        self.last
    }

    /// What was written last, in words; `all` samples were asked for.
    #[must_use]
    pub fn told(&self, all: u32) -> String {
        let (frame, samples) = self.last.unwrap_or_default();
        format!("{} has {samples} of {all} samples of each pixel", self.folder.join(self.name(frame)).display())
    }

    /// Pictures of earlier runs that will lie beside these, in a sentence; `None` where there is none.
    #[must_use]
    pub fn leftovers(&self) -> Option<String> {
        let number = |name: &str| name.strip_prefix("image-")?.strip_suffix(".png")?.parse::<u32>().ok();
        let is_picture = |name: &str| name == SHEET || name == ALONE || number(name).is_some();
        let is_own = |name: &str| match number(name) {
            Some(frame) => self.frames > 1 && frame < self.frames,
            None => (name == SHEET) == (self.frames > 1),
        };
        let left = names(&self.folder, |name| is_picture(name) && !is_own(name));
        let first = left.first()?;
        let folder = self.folder.display();
        Some(match left.len() {
            1 => format!("{first} in {folder} will be of an earlier run"),
            count => format!("{count} pictures in {folder} will be of an earlier run: {first} and others"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: a frame with an exposure of its own; sums not divided by their samples; own pictures taken for others'.
    #[test]
    fn frames_share_an_exposure_and_others_pictures_are_told() {
        let dir = tempfile::tempdir().unwrap();
        let mut pictures = Pictures::new(dir.path(), 2);
        let grey = |value: f32| ([1, 1], vec![Vec3::splat(value)]);
        let (size, dark) = grey(0.5);
        pictures.write((size, &dark), || 0.25, 0, 1).unwrap();
        // Twice as bright, of twice as many samples.
        let (_, bright) = grey(1.0);
        pictures.write((size, &bright), || 100.0, 1, 2).unwrap();
        let [first, second] =
            ["image-0000.png", "image-0001.png"].map(|name| std::fs::read(dir.path().join(name)).unwrap());
        assert_eq!(first, second);
        assert_eq!(pictures.last(), Some((1, 2)));
        assert!(pictures.told(8).ends_with("image-0001.png has 2 of 8 samples of each pixel"));
        assert_eq!(pictures.leftovers(), None);
        pictures.write_sheet().unwrap();
        assert_eq!(pictures.main(), dir.path().join("contact.png"));
        let alone = Pictures::new(dir.path(), 1).leftovers().unwrap();
        assert!(alone.starts_with("3 pictures in ") && alone.ends_with("run: contact.png and others"), "{alone}");
        std::fs::write(dir.path().join("image.png"), "").unwrap();
        assert!(pictures.leftovers().unwrap().starts_with("image.png in "));
    }
}
