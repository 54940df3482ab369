//! The frames of an animation: which are rendered, and what lies beside each picture so that the next run can tell
//! whether it is whole.

use crate::output::write_atomically;
use crate::{Provenance, ReportError};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Most frames of an animation: their names have four digits.
const MOST: u32 = 10_000;

/// Which frames are rendered: a picture alone, or a range of an animation's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frames {
    range: Range<u32>,
    is_animation: bool,
}

impl Frames {
    /// A picture alone.
    pub const ALONE: Self = Self { range: 0..1, is_animation: false };

    /// The numbers of the frames.
    #[must_use]
    pub fn range(&self) -> Range<u32> {
        self.range.clone()
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.range.end - self.range.start
    }

    /// Whether they are frames of an animation, whose names have numbers, though there may be only one.
    #[must_use]
    pub const fn is_animation(&self) -> bool {
        self.is_animation
    }
}

/// As one writes them: `24`, or `8..16` for frames 8 to 15.
impl FromStr for Frames {
    type Err = NoFrames;

    fn from_str(text: &str) -> Result<Self, NoFrames> {
        let number = |text: &str| text.trim().parse::<u32>().map_err(|_| NoFrames);
        let range = match text.split_once("..") {
            Some((first, end)) => number(first)?..number(end)?,
            None => 0..number(text)?,
        };
        let is_animation = text.contains("..") || range.end > 1;
        if range.is_empty() || range.end > MOST { Err(NoFrames) } else { Ok(Self { range, is_animation }) }
    }
}

/// A text names no frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoFrames;

impl fmt::Display for NoFrames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "write 24 for frames 0 to 23, or 8..16 for frames 8 to 15, none above {}", MOST - 1)
    }
}

impl std::error::Error for NoFrames {}

/// Version of [`FrameReport`]'s layout.
const SCHEMA: u32 = 1;

/// What lies beside the picture of a frame. It is written after the picture, and both are there in full or not at all:
/// so a frame is whole if and only if its report is there and says what is right of its picture.
#[derive(Debug, Serialize)]
struct FrameReport<'a> {
    schema: u32,
    frame: u32,
    #[serde(flatten)]
    kept: Kept,
    provenance: &'a Provenance,
}

/// The part of it that is read again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Kept {
    /// Of everything that decides what the picture is.
    fingerprint: String,
    /// Samples of each pixel.
    samples: u32,
    /// Of the picture's file.
    #[serde(flatten)]
    picture: Checksum,
    /// Of the file with its radiance, if that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    exr: Option<Checksum>,
    /// Wall seconds that rendering it took.
    seconds: f64,
    /// The same of the frame that was there before, if one was.
    seconds_before: Option<f64>,
}

/// By which a file is known again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Checksum {
    bytes: u64,
    crc32: u32,
}

impl Checksum {
    fn of(file: &Path) -> io::Result<Self> {
        let bytes = fs::read(file)?;
        Ok(Self { bytes: bytes.len() as u64, crc32: crc32fast::hash(&bytes) })
    }

    fn is_of(self, file: &Path) -> bool {
        Self::of(file).is_ok_and(|found| found == self)
    }
}

fn written(fingerprint: u64) -> String {
    format!("{fingerprint:016x}")
}

/// The name of the report beside a picture.
pub(crate) fn beside(picture: impl AsRef<Path>) -> PathBuf {
    picture.as_ref().with_extension("json")
}

/// What was noted beside a picture. A report that cannot be read, or is none, says nothing.
fn kept(picture: &Path) -> Option<Kept> {
    serde_json::from_slice(&fs::read(beside(picture)).ok()?).ok()
}

/// Whether a picture is there as it is to be, and the file with its radiance if one is asked for, if everything that
/// decides what it is has this fingerprint.
pub(crate) fn is_whole(picture: &Path, exr: Option<&Path>, fingerprint: u64) -> bool {
    kept(picture).filter(|kept| kept.fingerprint == written(fingerprint)).is_some_and(|kept| {
        let is_radiance = |exr: &Path| kept.exr.is_some_and(|checksum| checksum.is_of(exr));
        kept.picture.is_of(picture) && exr.is_none_or(is_radiance)
    })
}

/// Wall seconds that the frame took in the run before the one whose frame has this fingerprint.
///
/// That is the same number whether or not this run has rendered it by now: so processes that begin at different times,
/// while others render, make of all of these the same deal.
pub(crate) fn seconds_before(picture: &Path, fingerprint: u64) -> Option<f64> {
    let kept = kept(picture)?;
    if kept.fingerprint == written(fingerprint) { kept.seconds_before } else { Some(kept.seconds) }
}

/// A frame that was rendered, and how long that took.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rendered<'a> {
    /// Its number.
    pub(crate) frame: u32,
    /// Samples of each pixel.
    pub(crate) samples: u32,
    /// Of everything that decides what the picture is.
    pub(crate) fingerprint: u64,
    /// The file with its radiance, if that was written too.
    pub(crate) exr: Option<&'a Path>,
    /// Wall seconds that it took.
    pub(crate) seconds: f64,
    /// Those of the run before.
    pub(crate) seconds_before: Option<f64>,
    /// Where it comes from.
    pub(crate) provenance: &'a Provenance,
}

/// Notes that a picture is whole.
pub(crate) fn note(picture: &Path, rendered: &Rendered<'_>) -> Result<(), ReportError> {
    let Rendered { frame, samples, fingerprint, exr, seconds, seconds_before, provenance } = *rendered;
    let checksum = |file: &Path| Checksum::of(file).map_err(|source| ReportError::read(file, source));
    let kept = Kept {
        fingerprint: written(fingerprint),
        samples,
        picture: checksum(picture)?,
        exr: exr.map(checksum).transpose()?,
        seconds,
        seconds_before,
    };
    let report = FrameReport { schema: SCHEMA, frame, kept, provenance };
    write_atomically(&beside(picture), |file| Ok(serde_json::to_writer_pretty(file, &report)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_read_as_they_are_written() {
        assert_eq!("1".parse(), Ok(Frames::ALONE));
        let frames: Frames = "24".parse().unwrap();
        assert_eq!((frames.range(), frames.is_animation()), (0..24, true));
        let frames: Frames = "8..9".parse().unwrap();
        assert_eq!((frames.range(), frames.count(), frames.is_animation()), (8..9, 1, true));
        for bad in ["0", "", "8..8", "9..8", "8..", "..8", "-1", "0..10001", "1...3", "eight"] {
            assert_eq!(bad.parse::<Frames>(), Err(NoFrames), "{bad}");
        }
    }

    /// What is known of frame 3 of a first run.
    fn rendered(provenance: &Provenance) -> Rendered<'_> {
        Rendered { frame: 3, samples: 16, fingerprint: 7, exr: None, seconds: 2.5, seconds_before: None, provenance }
    }

    /// Mutants: a frame taken for whole whose radiance was never written, or changed, or is an earlier run's.
    #[test]
    fn radiance_belongs_to_a_frame_where_it_is_asked_for() {
        let dir = tempfile::tempdir().unwrap();
        let [picture, exr] = ["image-0003.png", "image-0003.exr"].map(|name| dir.path().join(name));
        [&picture, &exr].iter().for_each(|file| fs::write(file, "pixels").unwrap());
        let provenance = Provenance::now(1, ["cpu:1"]);
        let rendered = rendered(&provenance);
        let known = || [None, Some(&*exr)].map(|exr| is_whole(&picture, exr, 7));
        note(&picture, &rendered).unwrap();
        assert_eq!(known(), [true, false]);
        note(&picture, &Rendered { exr: Some(&exr), ..rendered }).unwrap();
        assert_eq!(known(), [true, true]);
        fs::write(&exr, "pixelz").unwrap();
        assert_eq!(known(), [true, false]);
        fs::remove_file(&exr).unwrap();
        assert_eq!(known(), [true, false]);
        assert!(note(&picture, &Rendered { exr: Some(&exr), ..rendered }).is_err());
    }

    /// Mutants: a picture that was changed, or is another one's, taken for whole; seconds of this run in place of those
    /// of the one before.
    #[test]
    fn a_frame_is_whole_only_as_it_was_written() {
        let dir = tempfile::tempdir().unwrap();
        let picture = dir.path().join("image-0003.png");
        let provenance = Provenance::now(1, ["cpu:1"]);
        let known = |fingerprint: u64| (is_whole(&picture, None, fingerprint), seconds_before(&picture, fingerprint));
        assert_eq!(known(7), (false, None));
        fs::write(&picture, "pixels").unwrap();
        assert_eq!(known(7), (false, None));
        let first = rendered(&provenance);
        note(&picture, &first).unwrap();
        assert_eq!((known(7), known(8)), ((true, None), (false, Some(2.5))));
        // The next run: the seconds before stay those before.
        note(&picture, &Rendered { fingerprint: 8, seconds: 9.0, seconds_before: Some(2.5), ..first }).unwrap();
        assert_eq!((known(7), known(8)), ((false, Some(9.0)), (true, Some(2.5))));
        for changed in ["pixelz", "pixel", ""] {
            fs::write(&picture, changed).unwrap();
            assert_eq!(known(8), (false, Some(2.5)), "{changed}");
        }
        fs::remove_file(&picture).unwrap();
        assert_eq!(known(8), (false, Some(2.5)));
        let report = dir.path().join("image-0003.json");
        let text = fs::read_to_string(&report).unwrap();
        assert!(text.contains("\"frame\": 3") && text.contains("\"samples\": 16"), "{text}");
        fs::write(&report, &text[..text.len() / 2]).unwrap();
        assert_eq!(known(8), (false, None));
    }
}
