//! Cameras that move from frame to frame: about their target, or along the key frames of a file.

use crate::{View, view};
use glam::DVec3;
use rt_core::{Camera, CameraError};
use std::error::Error;
use std::fmt;
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// How a camera moves over the frames of an animation.
#[derive(Clone, Debug)]
pub enum CameraMotion {
    /// About its target ([`view::orbit`]).
    Orbit {
        /// What frame 0 shows.
        first: View,
        /// Degrees from one frame to the next.
        degrees_per_frame: f32,
    },
    /// Along key frames.
    Path {
        /// The key frames.
        path: CameraPath,
        /// [`crate::Model::offset`]: the path is in the coordinates of the scene's file.
        offset: DVec3,
    },
}

impl CameraMotion {
    /// What a frame shows.
    #[must_use]
    pub fn view(&self, frame: u32) -> View {
        match self {
            Self::Orbit { first, degrees_per_frame } => {
                view::orbit(first, (degrees_per_frame * frame as f32).to_radians())
            }
            Self::Path { path, offset } => path.shot(frame).view(*offset),
        }
    }

    /// The camera of a frame.
    ///
    /// # Errors
    /// When its view makes none; the message says which frame, and where in the file of a path that is.
    pub fn camera(&self, frame: u32) -> Result<Camera, NoCamera> {
        let place = || match self {
            Self::Orbit { .. } => None,
            Self::Path { path, .. } => Some(path.place(frame)),
        };
        self.view(frame).camera().map_err(|source| NoCamera { frame, place: place(), source })
    }

    /// Whether all these frames have a camera; so much can be said before any of them is rendered.
    ///
    /// # Errors
    /// As of [`CameraMotion::camera`], for the first frame that has none.
    pub fn check(&self, mut frames: Range<u32>) -> Result<(), NoCamera> {
        frames.try_for_each(|frame| self.camera(frame).map(drop))
    }
}

/// A frame has no camera.
#[derive(Clone, Debug, PartialEq)]
pub struct NoCamera {
    frame: u32,
    /// Where in a file.
    place: Option<String>,
    source: CameraError,
}

impl fmt::Display for NoCamera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some(place) => write!(f, "{place}: no camera for frame {}", self.frame),
            None => write!(f, "no camera for frame {}", self.frame),
        }
    }
}

impl Error for NoCamera {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        Some(&self.source)
    }
}

/// A camera as a row of a file gives it, in the coordinates of the scene's file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shot {
    eye: DVec3,
    target: DVec3,
    up: DVec3,
    fov_degrees: f64,
}

impl Shot {
    /// From eye, target, up and vertical field of view in degrees; coordinates are separated by blanks.
    pub(crate) fn parse([eye, target, up, fov]: [&str; 4]) -> Result<Self, String> {
        let point = |name, text: &str| {
            let numbers: Option<Vec<f64>> =
                text.split_whitespace().map(|n| n.parse().ok().filter(|n: &f64| n.is_finite())).collect();
            let point = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
            point.map(DVec3::from).ok_or_else(|| format!("{name} `{text}` is not three numbers with blanks between"))
        };
        let degrees = fov.trim().parse().ok().filter(|&degrees: &f64| degrees > 0.0 && degrees < 180.0);
        let wrong = || format!("the field of view `{fov}` is not above 0 and below 180 degrees");
        Ok(Self {
            eye: point("the eye", eye)?,
            target: point("the target", target)?,
            up: point("up", up)?,
            fov_degrees: degrees.ok_or_else(wrong)?,
        })
    }

    /// The view of a model whose coordinates are those of its file less `offset`.
    pub(crate) fn view(&self, offset: DVec3) -> View {
        View {
            eye: (self.eye - offset).as_vec3(),
            target: (self.target - offset).as_vec3(),
            up: self.up.as_vec3(),
            fov_degrees: self.fov_degrees as f32,
        }
    }

    fn numbers(&self) -> [f64; NUMBERS] {
        let Self { eye, target, up, fov_degrees } = self;
        [eye.x, eye.y, eye.z, target.x, target.y, target.z, up.x, up.y, up.z, *fov_degrees]
    }

    fn of_numbers([ex, ey, ez, tx, ty, tz, ux, uy, uz, fov_degrees]: [f64; NUMBERS]) -> Self {
        let [eye, target, up] = [[ex, ey, ez], [tx, ty, tz], [ux, uy, uz]].map(DVec3::from);
        Self { eye, target, up, fov_degrees }
    }
}

/// Numbers of a [`Shot`]; the last is the field of view.
const NUMBERS: usize = 10;

/// A frame whose camera a line of a file gives.
#[derive(Clone, Copy, Debug)]
struct Key {
    line: usize,
    frame: u32,
    shot: Shot,
}

/// Key frames of a file: a line for each, with frame number, eye, target, up and vertical field of view in degrees,
/// separated by tabs, and coordinates by blanks. Lines that are empty or begin with `#` say nothing.
///
/// Each of the ten numbers goes through its key frames on the cubic curve of E. Catmull and R. Rom, *A Class of Local
/// Interpolating Splines* (1974), for frames that are any distance apart: at a key frame its slope is that from the key
/// before to the one after. Where a number is the same in two key frames that follow each other it stays so between
/// them. The field of view is kept between those of the two. Before the first key frame and after the last nothing
/// moves.
#[derive(Clone, Debug)]
pub struct CameraPath {
    file: PathBuf,
    /// At least one, in the order of their frames.
    keys: Vec<Key>,
}

/// What [`CameraPath`] has in a line, as messages say it.
const FIELDS: &str = "frame, eye, target, up and field of view, separated by tabs";

impl CameraPath {
    /// Reads a file.
    ///
    /// # Errors
    /// When it cannot be read or says something else; the message names file and line.
    pub fn read(file: &Path) -> Result<Self, CameraPathError> {
        let text = fs::read_to_string(file);
        Self::parse(
            file,
            &text.map_err(|source| CameraPathError { file: file.to_owned(), fault: Fault::Read(source) })?,
        )
    }

    /// The same from what a file contains; messages call it `file`.
    ///
    /// # Errors
    /// As of [`CameraPath::read`].
    pub fn parse(file: &Path, text: &str) -> Result<Self, CameraPathError> {
        Self::parse_keys(file, text).map_err(|fault| CameraPathError { file: file.to_owned(), fault })
    }

    fn parse_keys(file: &Path, text: &str) -> Result<Self, Fault> {
        let mut keys: Vec<Key> = Vec::new();
        for (line, row) in (1..).zip(text.lines()) {
            if row.trim().is_empty() || row.starts_with('#') {
                continue;
            }
            let wrong = |what: String| Fault::Line { line, what };
            let fields: Vec<&str> = row.split('\t').collect();
            let [frame, eye, target, up, fov] = fields[..] else {
                return Err(wrong(format!("it is to have {FIELDS}; it has {} fields", fields.len())));
            };
            let number = frame.trim().parse();
            let frame = number.map_err(|_| wrong(format!("the frame `{frame}` is not a whole number from 0 on")))?;
            if let Some(last) = keys.last().filter(|last| last.frame >= frame) {
                return Err(wrong(format!("frame {frame} follows frame {}: put frames in order", last.frame)));
            }
            keys.push(Key { line, frame, shot: Shot::parse([eye, target, up, fov]).map_err(wrong)? });
        }
        if keys.is_empty() { Err(Fault::Empty) } else { Ok(Self { file: file.to_owned(), keys }) }
    }

    /// How many of the key frames are not after a frame.
    fn passed(&self, frame: u32) -> usize {
        self.keys.partition_point(|key| key.frame <= frame)
    }

    /// Where the camera of a frame comes from.
    fn place(&self, frame: u32) -> String {
        let file = self.file.display();
        let line = |key: usize| self.keys[key].line;
        match self.passed(frame) {
            0 => format!("`{file}`, line {}", line(0)),
            passed if passed == self.keys.len() || self.keys[passed - 1].frame == frame => {
                format!("`{file}`, line {}", line(passed - 1))
            }
            passed => format!("`{file}`, between lines {} and {}", line(passed - 1), line(passed)),
        }
    }

    fn shot(&self, frame: u32) -> Shot {
        let passed = self.passed(frame);
        let Some(before) = passed.checked_sub(1) else { return self.keys[0].shot };
        if passed == self.keys.len() {
            return self.keys[before].shot;
        }
        let number = |which: usize| {
            let at = |key: usize| (f64::from(self.keys[key].frame), self.keys[key].shot.numbers()[which]);
            // At the ends of the path the slope is that of the one side there is.
            let slope = |key: usize| {
                let ((f0, n0), (f1, n1)) = (at(key.saturating_sub(1)), at((key + 1).min(self.keys.len() - 1)));
                let rests = at(key).1 == n0 && key > 0 || at(key).1 == n1 && key + 1 < self.keys.len();
                if rests { 0.0 } else { (n1 - n0) / (f1 - f0) }
            };
            let ((f0, n0), (f1, n1)) = (at(before), at(passed));
            let (length, u) = (f1 - f0, (f64::from(frame) - f0) / (f1 - f0));
            let between =
                n0 + (n1 - n0) * (u * u * (3.0 - 2.0 * u)) + slope(before) * length * (u * (1.0 - u) * (1.0 - u))
                    - slope(passed) * length * (u * u * (1.0 - u));
            if which == NUMBERS - 1 { between.clamp(n0.min(n1), n0.max(n1)) } else { between }
        };
        Shot::of_numbers(std::array::from_fn(number))
    }
}

/// A file is no camera path, or a line of `cameras.tsv` no camera.
#[derive(Debug)]
pub struct CameraPathError {
    file: PathBuf,
    fault: Fault,
}

impl CameraPathError {
    /// What is wrong in a line, counted from 1.
    pub(crate) const fn in_line(file: PathBuf, line: usize, what: String) -> Self {
        Self { file, fault: Fault::Line { line, what } }
    }
}

#[derive(Debug)]
enum Fault {
    Read(io::Error),
    Line { line: usize, what: String },
    Empty,
}

impl fmt::Display for CameraPathError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = self.file.display();
        match &self.fault {
            Fault::Read(_) => write!(f, "the camera path `{file}` cannot be read"),
            Fault::Line { line, what } => write!(f, "`{file}`, line {line}: {what}"),
            Fault::Empty => write!(f, "`{file}` has no key frame: write one in a line, as {FIELDS}"),
        }
    }
}

impl Error for CameraPathError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match &self.fault {
            Fault::Read(source) => Some(source),
            Fault::Line { .. } | Fault::Empty => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::fmt::Write;

    fn path(text: &str) -> Result<CameraPath, String> {
        CameraPath::parse(Path::new("path.tsv"), text).map_err(|error| error.to_string())
    }

    fn view(path: &CameraPath, frame: u32) -> View {
        CameraMotion::Path { path: path.clone(), offset: DVec3::ZERO }.view(frame)
    }

    /// Mutants: a line counted from 0; comments counted as no lines; any of the checks left out.
    #[test]
    fn what_is_wrong_in_a_path_is_named_with_its_line() {
        let good = "0\t0 1 5\t0 0 0\t0 1 0\t40";
        for (text, parts) in [
            ("", &["no key frame", "tabs"][..]),
            ("# nothing\n\n", &["no key frame"]),
            ("0 0 1 5 0 0 0 0 1 0 40", &["line 1", "1 fields"]),
            ("# frame\n\n0\t0 1 5\t0 0 0\t0 1 0", &["line 3", "4 fields"]),
            ("-1\t0 1 5\t0 0 0\t0 1 0\t40", &["line 1", "`-1`", "whole number"]),
            ("0\t0 1\t0 0 0\t0 1 0\t40", &["line 1", "the eye `0 1`"]),
            ("0\t0 1 5\t0 nan 0\t0 1 0\t40", &["line 1", "the target"]),
            ("0\t0 1 5\t0 0 0\t0 1 0 0\t40", &["line 1", "up `0 1 0 0`"]),
            ("0\t0 1 5\t0 0 0\t0 1 0\t180", &["line 1", "field of view `180`"]),
            (&format!("{good}\n{good}"), &["line 2", "frame 0 follows frame 0"]),
        ] {
            let error = path(text).expect_err(text);
            assert!(error.contains("path.tsv") && parts.iter().all(|part| error.contains(part)), "{error}");
        }
        let motion = |text: &str| CameraMotion::Path { path: path(text).unwrap(), offset: DVec3::ZERO };
        // Half-way the eye is at the target.
        let through = motion("# to and fro\n4\t0 0 -1\t0 0 0\t0 1 0\t40\n6\t0 0 1\t0 0 0\t0 1 0\t40\n");
        assert!(through.check(0..5).is_ok() && through.check(6..9).is_ok());
        let error = through.check(0..9).unwrap_err();
        assert_eq!(error.to_string(), "`path.tsv`, between lines 2 and 3: no camera for frame 5");
        assert!(error.source().unwrap().to_string().contains("same point"));
        let flat = motion("4\t0 0 1\t0 0 0\t0 0 2\t40\n");
        assert!(flat.check(3..4).unwrap_err().to_string().contains("line 1: no camera for frame 3"));
        assert!(CameraPath::read(Path::new("missing.tsv")).unwrap_err().to_string().contains("missing.tsv"));
    }

    /// Mutants: a slope by numbers of keys instead of frames; a camera that sways where it is to stand still; one that
    /// goes on beyond the last key frame.
    #[test]
    fn cameras_move_evenly_and_stand_still() {
        let even = path("10\t0 1 10\t0 0 0\t0 1 0\t40\n20\t10 1 10\t0 0 0\t0 1 0\t40\n50\t40 1 10\t0 0 0\t0 1 0\t40\n")
            .unwrap();
        for frame in 0..60 {
            let x = f64::from(frame.clamp(10, 50)) - 10.0;
            assert!((f64::from(view(&even, frame).eye.x) - x).abs() < 1e-5, "{frame}");
        }
        let rests = path(
            "0\t0 1 9\t0 0 0\t0 1 0\t40\n10\t7 1 9\t0 0 0\t0 1 0\t20\n20\t7 1 9\t0 0 0\t0 1 0\t20\n30\t-7 1 9\t0 0 0\t0 1 0\t60\n",
        )
        .unwrap();
        assert!((10..=20).all(|frame| view(&rests, frame) == view(&rests, 10)));
        assert!((0..=30).all(|frame| (20.0..=60.0).contains(&view(&rests, frame).fov_degrees)));
        // It begins and ends in good time.
        assert!(view(&rests, 21).eye.x > 6.5 && view(&rests, 29).eye.x < -5.0);
    }

    /// The same coordinates as those of the scene's file, with all their digits. Fails when they are rounded before
    /// the offset is subtracted.
    #[test]
    fn coordinates_are_those_of_the_file() {
        let path = path("0\t5000000.1 2 3\t5e6 0 -5e6\t0 1 0\t45").unwrap();
        let motion = CameraMotion::Path { path, offset: DVec3::new(5e6, 0.0, -5e6) };
        assert_eq!(motion.view(7).eye, glam::Vec3::new(0.1, 2.0, 5_000_003.0));
        assert_eq!(motion.view(7).target, glam::Vec3::ZERO);
    }

    proptest! {
        /// Guards: every key frame is met, whatever lies around it, and motion has no jumps. Fails when the weights of
        /// the curve do not sum up, or a slope has the wrong sign.
        #[test]
        fn key_frames_are_met_and_nothing_jumps(
            keys in prop::collection::vec((1..30_u32, -10.0..10.0_f64, 10.0..90.0_f64), 1..8),
        ) {
            let (mut text, mut frame, mut expected) = (String::new(), 0, Vec::new());
            for (step, x, fov) in keys {
                frame += step;
                writeln!(text, "{frame}\t{x} 1 20\t0 {x} 0\t0 1 0\t{fov}").unwrap();
                expected.push((frame, x as f32, fov as f32));
            }
            let path = path(&text).unwrap();
            for &(frame, x, fov) in &expected {
                let view = view(&path, frame);
                prop_assert_eq!((view.eye.x, view.target.y, view.fov_degrees), (x, x, fov));
            }
            // No slope is steeper than 20 a frame, nor a curve than twice its ends' and its own.
            for frame in 0..frame {
                prop_assert!((view(&path, frame).eye.x - view(&path, frame + 1).eye.x).abs() < 60.0);
            }
        }
    }
}
