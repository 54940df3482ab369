//! The pictures of a run: their names in its folder, written with one exposure.

use crate::frames::{self, Frames, Rendered};
use crate::output::names;
use crate::report::Ahead;
use crate::{Provenance, ReportError, charts, exr, image};
use glam::Vec3;
use rt_cluster::Shard;
use std::collections::HashSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// All frames of an animation, small.
const SHEET: &str = "contact.png";

/// The name of a picture that is the only one.
const ALONE: &str = "image.png";

/// A frame as it is after a pass, or while one goes through it.
#[derive(Clone, Copy)]
pub struct Shot<'a> {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Sums of radiance in the order of [`image::write_png`].
    pub sums: &'a [Vec3],
    /// Of how many samples each of them is.
    pub samples_at: &'a (dyn Fn(usize) -> u32 + Sync),
    /// Computes its exposure, where it does not share that of all frames.
    pub exposure: &'a dyn Fn() -> f32,
    /// Samples that every pixel has.
    pub samples: u32,
    /// Those that some have already.
    pub ahead: Option<Ahead>,
}

impl fmt::Debug for Shot<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { size, samples, ahead, .. } = self;
        f.debug_struct("Shot")
            .field("size", size)
            .field("samples", samples)
            .field("ahead", ahead)
            .finish_non_exhaustive()
    }
}

/// A frame that was written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Written {
    /// Its number.
    pub frame: u32,
    /// Samples that every pixel has.
    pub samples: u32,
    /// Those that some have already.
    pub ahead: Option<Ahead>,
}

/// A picture, or the frames of an animation, in a folder.
#[derive(Clone, Debug)]
pub struct Pictures {
    folder: PathBuf,
    frames: Frames,
    /// Whether each is written in OpenEXR as well.
    with_exr: bool,
    /// That of all frames of an animation, and for each of everything that decides what it is.
    animation: Option<(f32, Vec<u64>)>,
    last: Option<Written>,
    /// Frames that were written, each counted once.
    written: u32,
    /// Whether the sheet is of these frames.
    has_sheet: bool,
    /// Seconds that writing took.
    pub seconds: f64,
}

impl Pictures {
    /// Frames, none of which is written yet.
    #[must_use]
    pub fn new(folder: &Path, frames: &Frames) -> Self {
        Self {
            folder: folder.to_owned(),
            frames: frames.clone(),
            with_exr: false,
            animation: None,
            last: None,
            written: 0,
            has_sheet: false,
            seconds: 0.0,
        }
    }

    /// The same of an animation, with one exposure for all frames, whichever are written and in whatever order, and for
    /// each a fingerprint of everything that decides what it is.
    #[must_use]
    pub fn of_animation(self, exposure: f32, fingerprints: Vec<u64>) -> Self {
        Self { animation: Some((exposure, fingerprints)), ..self }
    }

    /// The same with the radiance of each in a file of OpenEXR beside it, if that is asked for.
    #[must_use]
    pub fn with_exr(self, with_exr: bool) -> Self {
        Self { with_exr, ..self }
    }

    /// The names of all files: the pictures and, of an animation, what lies beside each and the sheet.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        let beside = self.frames.is_animation().then(|| self.names().map(frames::beside));
        let in_exr = self.with_exr.then(|| self.names().map(exr_beside));
        let beside = beside.into_iter().flatten().chain(in_exr.into_iter().flatten());
        self.names().map(PathBuf::from).chain(beside).chain(self.sheet().map(PathBuf::from))
    }

    fn names(&self) -> impl Iterator<Item = String> {
        self.frames.range().map(|frame| self.name(frame))
    }

    fn name(&self, frame: u32) -> String {
        if self.frames.is_animation() { format!("image-{frame:04}.png") } else { ALONE.to_owned() }
    }

    fn path(&self, frame: u32) -> PathBuf {
        self.folder.join(self.name(frame))
    }

    /// Where a frame's radiance is, if it is asked for.
    fn exr(&self, frame: u32) -> Option<PathBuf> {
        self.with_exr.then(|| exr_beside(self.path(frame)))
    }

    /// The name of the sheet with all frames, of an animation.
    fn sheet(&self) -> Option<&'static str> {
        self.frames.is_animation().then_some(SHEET)
    }

    /// What a shard is to render; with `anew` also what is whole. A picture alone is always rendered.
    ///
    /// Frames are dealt by the seconds that they took in the run before. They are the same numbers while others render
    /// frames of this run, so that all shards make the same deal, whenever they begin.
    #[must_use]
    pub fn part(&self, shard: Shard, anew: bool) -> Part {
        let frames: Vec<u32> = self.frames.range().collect();
        let seconds: Vec<Option<f64>> = frames.iter().map(|&frame| self.seconds_before(frame)).collect();
        let own = shard.part(&seconds).into_iter().map(|index| frames[index]);
        let (whole, missing): (Vec<u32>, Vec<u32>) = own.partition(|&frame| !anew && self.is_whole(frame));
        Part { missing, whole: whole.len() as u32 }
    }

    fn fingerprint(&self, frame: u32) -> Option<u64> {
        let (_, fingerprints) = self.animation.as_ref()?;
        fingerprints.get((frame - self.frames.range().start) as usize).copied()
    }

    fn is_whole(&self, frame: u32) -> bool {
        let exr = self.exr(frame);
        let is_whole = |fingerprint| frames::is_whole(&self.path(frame), exr.as_deref(), fingerprint);
        self.fingerprint(frame).is_some_and(is_whole)
    }

    fn seconds_before(&self, frame: u32) -> Option<f64> {
        frames::seconds_before(&self.path(frame), self.fingerprint(frame)?)
    }

    /// Notes beside a frame of an animation, which was written last and took so many seconds, that it is whole.
    ///
    /// # Errors
    /// When the picture cannot be read or the note not be written.
    pub fn note(&self, frame: u32, seconds: f64, provenance: &Provenance) -> Result<(), ReportError> {
        let (Some(fingerprint), Some(Written { samples, .. })) = (self.fingerprint(frame), self.last) else {
            return Ok(());
        };
        let seconds_before = self.seconds_before(frame);
        let exr = self.exr(frame);
        let exr = exr.as_deref();
        let rendered = Rendered { frame, samples, fingerprint, exr, seconds, seconds_before, provenance };
        frames::note(&self.path(frame), &rendered)
    }

    /// The picture that shows most: the only one, the sheet of all frames or, where that was not made, the frame that
    /// was written last.
    #[must_use]
    pub fn main(&self) -> PathBuf {
        match self.last {
            Some(Written { frame, .. }) if !self.has_sheet => self.path(frame),
            _ => self.folder.join(self.sheet().unwrap_or(ALONE)),
        }
    }

    /// Writes a frame, exposed as all of them or, where there is no such exposure, by its own.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&mut self, shot: Shot<'_>, frame: u32) -> Result<(), ReportError> {
        let begin = Instant::now();
        let Shot { size, sums, samples_at, exposure, samples, ahead } = shot;
        let exposure = self.animation.as_ref().map_or_else(exposure, |(exposure, _)| *exposure);
        let mean = |place| exposure / samples_at(place).max(1) as f32;
        image::write_png(&self.path(frame), size, sums, mean)?;
        if let Some(path) = self.exr(frame) {
            exr::write_picture(&path, size, sums, samples_at)?;
        }
        // Passes of a frame follow each other.
        self.written += u32::from(self.last.is_none_or(|last| last.frame != frame));
        self.last = Some(Written { frame, samples, ahead });
        self.seconds += begin.elapsed().as_secs_f64();
        Ok(())
    }

    /// Writes the sheet of an animation, if all of its frames are whole by now.
    ///
    /// # Errors
    /// When a frame cannot be read or the file not be written.
    pub fn write_sheet(&mut self) -> Result<(), ReportError> {
        let Some(sheet) = self.sheet().filter(|_| self.frames.range().all(|frame| self.is_whole(frame))) else {
            return Ok(());
        };
        let frames: Vec<PathBuf> = self.names().map(|name| self.folder.join(name)).collect();
        image::write_contact_sheet(&self.folder.join(sheet), &frames)?;
        self.has_sheet = true;
        Ok(())
    }

    /// How many frames were written.
    #[must_use]
    pub const fn written(&self) -> u32 {
        self.written
    }

    /// What was written last.
    #[must_use]
    pub const fn last(&self) -> Option<Written> {
        self.last
    }

    /// Pictures of earlier runs that will lie beside these, in a sentence; `None` where there is none.
    #[must_use]
    pub fn leftovers(&self) -> Option<String> {
        let ends_so = |name: &str| name.ends_with(".png") || name.ends_with(".exr");
        let is_numbered = |name: &str| {
            let number = name.strip_prefix("image-").and_then(|rest| rest.split_once('.')).map(|(number, _)| number);
            number.is_some_and(|number| number.parse::<u32>().is_ok())
        };
        let is_picture =
            |name: &str| ends_so(name) && (is_numbered(name) || name.starts_with("image.")) || name == SHEET;
        let mut own: HashSet<PathBuf> = self.files().collect();
        if self.with_exr {
            own.insert(charts::COSTS_EXR.into());
        }
        let is_left = |name: &str| (is_picture(name) || name == charts::COSTS_EXR) && !own.contains(Path::new(name));
        let left = names(&self.folder, is_left);
        let first = left.first()?;
        let folder = self.folder.display();
        Some(match left.len() {
            1 => format!("{first} in {folder} will be of an earlier run"),
            count => format!("{count} pictures in {folder} will be of an earlier run: {first} and others"),
        })
    }
}

/// The file of a picture's radiance.
fn exr_beside(picture: impl AsRef<Path>) -> PathBuf {
    picture.as_ref().with_extension("exr")
}

/// What one of several processes renders of an animation.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Part {
    /// The frames that it is to render, in their order.
    pub missing: Vec<u32>,
    /// How many others of its frames are whole already.
    pub whole: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of pixels in a column.
    fn shot<'a>(sums: &'a [Vec3], samples_at: &'a (dyn Fn(usize) -> u32 + Sync)) -> Shot<'a> {
        let size = [1, sums.len() as u32];
        Shot { size, sums, samples_at, exposure: &|| 1.0, samples: samples_at(0), ahead: None }
    }

    /// Fails when a pixel that is ahead of others is divided by their samples: it would be too bright.
    #[test]
    fn pixels_that_are_ahead_are_as_bright() {
        let dir = tempfile::tempdir().unwrap();
        let mut pictures = Pictures::new(dir.path(), &Frames::ALONE);
        let mut bytes = |sums: [f32; 2], samples_at: &(dyn Fn(usize) -> u32 + Sync)| {
            pictures.write(shot(&sums.map(Vec3::splat), samples_at), 0).unwrap();
            std::fs::read(pictures.main()).unwrap()
        };
        let even = bytes([0.25, 0.25], &|_| 1);
        assert_eq!(bytes([0.25, 1.0], &|place| [1, 4][place]), even);
        assert_ne!(bytes([0.25, 1.0], &|_| 1), even);
    }

    /// Mutants: a frame with an exposure of its own; sums not divided by their samples; own pictures taken for others'.
    #[test]
    fn frames_share_an_exposure_and_others_pictures_are_told() {
        let dir = tempfile::tempdir().unwrap();
        let mut pictures = Pictures::new(dir.path(), &"2".parse().unwrap()).of_animation(0.25, vec![7, 8]);
        pictures.write(shot(&[Vec3::splat(0.5)], &|_| 1), 0).unwrap();
        // Twice as bright, of twice as many samples.
        pictures.write(shot(&[Vec3::ONE], &|_| 2), 1).unwrap();
        let [first, second] =
            ["image-0000.png", "image-0001.png"].map(|name| std::fs::read(dir.path().join(name)).unwrap());
        assert_eq!(first, second);
        assert_eq!(pictures.last(), Some(Written { frame: 1, samples: 2, ahead: None }));
        assert_eq!(pictures.leftovers(), None);
        pictures.write_sheet().unwrap();
        assert_eq!(pictures.main(), dir.path().join("image-0001.png"), "no frame is known to be whole");
        let provenance = Provenance::now(1, ["cpu:1"]);
        pictures.note(0, 2.0, &provenance).unwrap();
        assert_eq!(pictures.part(Shard::WHOLE, false), Part { missing: vec![1], whole: 1 });
        assert_eq!(pictures.part(Shard::WHOLE, true), Part { missing: vec![0, 1], whole: 0 });
        pictures.note(1, 5.0, &provenance).unwrap();
        pictures.write_sheet().unwrap();
        assert_eq!(pictures.main(), dir.path().join("contact.png"));
        assert!(pictures.main().exists());
        let alone = Pictures::new(dir.path(), &Frames::ALONE).leftovers().unwrap();
        assert!(alone.starts_with("3 pictures in ") && alone.ends_with("run: contact.png and others"), "{alone}");
        std::fs::write(dir.path().join("image.png"), "").unwrap();
        assert!(pictures.leftovers().unwrap().starts_with("image.png in "));
    }

    /// Fails when a shard deals by what others of the same run have written by then: frames that nobody renders.
    #[test]
    fn shards_that_begin_late_make_the_same_deal() {
        let dir = tempfile::tempdir().unwrap();
        let provenance = Provenance::now(1, ["cpu:1"]);
        let run = |fingerprint: u64| {
            let frames = "4..10".parse().unwrap();
            Pictures::new(dir.path(), &frames).of_animation(1.0, (fingerprint..fingerprint + 6).collect())
        };
        let render = |pictures: &mut Pictures, frames: &[u32], seconds: f64| {
            for &frame in frames {
                pictures.write(shot(&[Vec3::ONE], &|_| 4), frame).unwrap();
                pictures.note(frame, seconds * f64::from(frame), &provenance).unwrap();
            }
        };
        let mut first = run(100);
        let deal = Shard::all(3).map(|shard| first.part(shard, false).missing).collect::<Vec<_>>();
        assert_eq!(deal, [[4, 7], [5, 8], [6, 9]]);
        render(&mut first, &[4, 5, 6, 7, 8, 9], 1.0);
        // The last frames were the most expensive ones.
        let mut second = run(200);
        let deal = Shard::all(3).map(|shard| second.part(shard, false).missing).collect::<Vec<_>>();
        assert_eq!(deal, [[4, 9], [5, 8], [6, 7]]);
        render(&mut second, &deal[1], 0.01);
        assert_eq!(second.part("2/3".parse().unwrap(), false), Part { missing: Vec::new(), whole: 2 });
        assert_eq!(second.part("1/3".parse().unwrap(), false).missing, deal[0]);
        assert_eq!(second.part("3/3".parse().unwrap(), false).missing, deal[2]);
    }
}
