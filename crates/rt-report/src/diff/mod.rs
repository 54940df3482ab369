//! Two runs side by side: `raybalance diff A/report.json B/report.json`, or two compare.json.
//!
//! Files are read as JSON, not as the types that write them: they may come from another machine, or from a program that
//! knew more fields.

mod read;

use crate::ReportError;
use crate::report::SCHEMA;
use crate::table::{Table, percent, seconds};
use read::{At, File, WANTED};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

/// The version of a comparison's layout that can be read.
const COMPARISON_SCHEMA: f64 = 1.0;

/// Two runs side by side.
#[derive(Clone, Debug, Serialize)]
pub struct Diff {
    /// The files.
    pub files: [String; 2],
    /// `render` or `compare`.
    pub kind: &'static str,
    /// Why their seconds cannot be compared; empty where they can.
    pub not_comparable: Vec<String>,
    /// What else is not the same.
    pub differing: Vec<Difference>,
    /// Where the time went; of comparisons empty.
    pub stages: Vec<Pair>,
    /// Of each kind of stream, or of each way that both comparisons have.
    pub rows: Vec<Row>,
    /// Seconds in which each device was busy; of comparisons seconds of tracing alone.
    pub devices: Vec<Pair>,
}

/// Something that is not the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// What it is.
    pub what: String,
    /// In either file; null where it is not told.
    pub values: [Option<String>; 2],
}

/// Seconds of the same thing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// What it is.
    pub what: String,
    /// In either file; null where it is not there.
    pub seconds: [Option<f64>; 2],
    /// The second over the first; null where they cannot be compared.
    pub ratio: Option<f64>,
}

/// Seconds of tracing, and how close they are to the best possible.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The seconds.
    #[serde(flatten)]
    pub pair: Pair,
    /// Seconds beyond the least that any schedule needs, as a share; null where that was not measured.
    pub excess: [Option<f64>; 2],
    /// How much longer the last device worked than all did on average, as a share.
    pub imbalance: [Option<f64>; 2],
}

/// What must be the same for seconds to be comparable: what it is called, and where it is told.
const SAME: [(&str, &[&str]); 10] = [
    ("scene", &["scene.source"]),
    ("number of triangles", &["scene.triangles"]),
    ("size", &["size", "picture.size"]),
    ("rays a pixel", &["samples", "picture.samples"]),
    ("bounces", &["bounces", "picture.bounces"]),
    ("frames", &["picture.frames"]),
    ("wind", &["picture.wind"]),
    ("seed", &["provenance.seed"]),
    ("camera", &["camera", "picture.camera"]),
    ("precision", &["scene.precision"]),
];

/// What may differ, since that is what one compares.
const FREE: [(&str, &[&str]); 8] = [
    ("queue", &["queue"]),
    ("policy", &["policy"]),
    ("builder", &["scene.builder"]),
    ("devices", &["provenance.devices"]),
    ("machine", &["provenance.machine.processor"]),
    ("build", &["provenance.machine.build"]),
    ("commit", &["provenance.commit"]),
    ("command", &["provenance.command"]),
];

/// Wall seconds by what was done, in the order in which it is done.
const STAGES: [&str; 11] = [
    "load",
    "build",
    "setup",
    "update",
    "estimate",
    "trace",
    "reference",
    "unused_estimate",
    "shade",
    "write",
    "total",
];

impl Diff {
    /// Reads both files.
    ///
    /// # Errors
    /// When one cannot be read, is no such file or of another layout, or they are of two kinds.
    pub fn of(before: &Path, after: &Path) -> Result<Self, ReportError> {
        let (first, second) = (File::read(before)?, File::read(after)?);
        let (first, second) = (first.root(), second.root());
        let kind = match (kind(&first)?, kind(&second)?) {
            (one, other) if one == other => one,
            (one, other) => return Err(second.wrong(&format!("is of `{other}`, and the first file of `{one}`"))),
        };
        let both = [&first, &second];
        let mut not_comparable = reasons(both);
        let (measured, measured_too) = (Measured::read(&first, kind)?, Measured::read(&second, kind)?);
        if kind == RENDER && measured.rays() != measured_too.rays() && not_comparable.is_empty() {
            let [one, other] = [measured.rays(), measured_too.rays()];
            not_comparable.push(format!("other streams: {one}, and {other}"));
        }
        let mut differing: Vec<Difference> = FREE.iter().filter_map(|field| difference(both, field)).collect();
        let estimators = [&measured, &measured_too].map(|measured| measured.estimators.join(", "));
        if estimators[0] != estimators[1] {
            let values = estimators.map(|names| (!names.is_empty()).then_some(names));
            differing.insert(0, Difference { what: "estimator".to_owned(), values });
        }
        let is_comparable = not_comparable.is_empty();
        let pairs = |one: &[(String, f64)], other: &[(String, f64)]| pairs(one, other, is_comparable);
        Ok(Self {
            files: [before, after].map(|path| path.display().to_string()),
            kind,
            stages: pairs(&measured.stages, &measured_too.stages),
            rows: rows(&measured.rows, &measured_too.rows, is_comparable),
            devices: pairs(&measured.devices, &measured_too.devices),
            not_comparable,
            differing,
        })
    }
}

const RENDER: &str = "render";
const COMPARE: &str = "compare";

/// What wrote a file.
fn kind(root: &At<'_>) -> Result<&'static str, ReportError> {
    let Some(schema) = root.known("schema") else { return Err(root.wrong(&format!("has no `schema`: {WANTED}"))) };
    let (kind, known) = match root.known("kind").map(|kind| kind.text()).transpose()? {
        Some(COMPARE) => (COMPARE, COMPARISON_SCHEMA),
        Some(other) => return Err(root.field("kind")?.wrong(&format!("is {other}: {WANTED}"))),
        None if root.known("streams").is_none() && root.known("seconds").is_none() => {
            return Err(root.wrong(&format!("has neither `streams` nor `seconds`: {WANTED}")));
        }
        None => (RENDER, f64::from(SCHEMA)),
    };
    let found = schema.number()?;
    if found == known {
        return Ok(kind);
    }
    let other = if found < known { "an older" } else { "a newer" };
    let what = format!("is {found}, of {other} program, and this one reads {known}: run it again by one of them");
    Err(schema.wrong(&what))
}

/// What is told of something in the first place that tells it.
fn told(root: &At<'_>, places: &[&str]) -> Option<String> {
    places.iter().find_map(|place| Some(root.path(place)?.shown()))
}

/// What differs of what must not.
fn reasons(both: [&At<'_>; 2]) -> Vec<String> {
    let same = |(what, places): &(&str, &[&str])| {
        let mut values = both.map(|root| told(root, places));
        if *what == "scene" {
            // Where a file lies does not matter.
            values =
                values.map(|value| value.map(|path| path.rsplit(['/', '\\']).next().unwrap_or_default().to_owned()));
        }
        match values {
            [Some(one), Some(other)] if one != other => Some(format!("other {what}: {one}, and {other}")),
            _ => None,
        }
    };
    SAME.iter().filter_map(same).collect()
}

fn difference(both: [&At<'_>; 2], (what, places): &(&str, &[&str])) -> Option<Difference> {
    let values = both.map(|root| told(root, places));
    (values[0] != values[1]).then(|| Difference { what: (*what).to_owned(), values })
}

/// What a file says of the time.
struct Measured {
    stages: Vec<(String, f64)>,
    rows: Vec<Timed>,
    devices: Vec<(String, f64)>,
    estimators: Vec<String>,
}

/// A kind of stream over all frames and waves, or a way.
#[derive(Debug, Default)]
struct Timed {
    what: String,
    rays: f64,
    seconds: f64,
    /// Least seconds; `None` where one is not known.
    bound_s: Option<f64>,
    /// Seconds if all devices had worked to the end, likewise.
    even_s: Option<f64>,
}

impl Timed {
    fn excess(&self) -> Option<f64> {
        self.bound_s.filter(|bound| *bound > 0.0).map(|bound| self.seconds / bound - 1.0)
    }

    fn imbalance(&self) -> Option<f64> {
        self.even_s.filter(|even| *even > 0.0).map(|even| self.seconds / even - 1.0)
    }
}

impl Measured {
    fn read(root: &At<'_>, kind: &str) -> Result<Self, ReportError> {
        if kind == COMPARE { Self::of_comparison(root) } else { Self::of_report(root) }
    }

    fn of_report(root: &At<'_>) -> Result<Self, ReportError> {
        let wall = root.field("seconds")?;
        let stage = |&name: &&str| Some(wall.known(name)?.number().map(|seconds| (name.to_owned(), seconds)));
        let stages = STAGES.iter().filter_map(stage).collect::<Result<Vec<_>, _>>()?;
        let (mut rows, mut devices, mut estimators): (Vec<Timed>, Vec<(String, f64)>, Vec<String>) = Default::default();
        for stream in root.field("streams")?.list()? {
            let kind = stream.field("kind")?.text()?;
            let seconds = stream.field("makespan_s")?.number()?;
            let bound_s = stream.known_number("lower_bound_s")?;
            let even_s = stream.known_number("imbalance")?.map(|imbalance| seconds / (1.0 + imbalance));
            let rays = stream.field("rays")?.number()?;
            match rows.iter_mut().find(|row| row.what == kind) {
                Some(row) => {
                    (row.rays, row.seconds) = (row.rays + rays, row.seconds + seconds);
                    row.bound_s = row.bound_s.zip(bound_s).map(|(a, b)| a + b);
                    row.even_s = row.even_s.zip(even_s).map(|(a, b)| a + b);
                }
                None => rows.push(Timed { what: kind.to_owned(), rays, seconds, bound_s, even_s }),
            }
            for device in stream.field("devices")?.list()? {
                let (name, busy) = (device.field("name")?.text()?, device.field("busy_s")?.number()?);
                match devices.iter_mut().find(|(known, _)| known == name) {
                    Some((_, seconds)) => *seconds += busy,
                    None => devices.push((name.to_owned(), busy)),
                }
            }
            let estimator = stream.field("estimate")?.field("estimator")?.text()?.to_owned();
            if !estimators.contains(&estimator) {
                estimators.push(estimator);
            }
        }
        Ok(Self { stages, rows, devices, estimators })
    }

    fn of_comparison(root: &At<'_>) -> Result<Self, ReportError> {
        let once = [("load and build", "prepare_s"), ("setup", "setup_s")];
        let stages = once.iter().map(|(name, field)| Ok(((*name).to_owned(), root.field(field)?.number()?)));
        let mut rows = Vec::new();
        for way in root.field("ways")?.list()? {
            let text = |field: &str| Ok::<_, ReportError>(way.field(field)?.text()?.to_owned());
            let later = way.field("later_frames")?.shown() == "true";
            let mut what = [text("queue")?, text("policy")?, text("estimator")?].join(", ");
            if later {
                what.push_str(", later frames");
            }
            let seconds = way.field("trace")?.field("median")?.number()?;
            let bound_s = way.known_number("excess")?.map(|excess| seconds / (1.0 + excess));
            let even_s = way.known_number("imbalance")?.map(|imbalance| seconds / (1.0 + imbalance));
            rows.push(Timed { what, rays: 0.0, seconds, bound_s, even_s });
        }
        let alone = root.field("alone")?.list()?;
        let device = |alone: &At<'_>| {
            let entry = alone.field("entry")?.text()?;
            Ok((format!("{entry} alone"), alone.field("trace")?.field("median")?.number()?))
        };
        Ok(Self {
            stages: stages.collect::<Result<_, ReportError>>()?,
            rows,
            devices: alone.iter().map(device).collect::<Result<_, ReportError>>()?,
            estimators: Vec::new(),
        })
    }

    /// How many rays there were of each kind.
    fn rays(&self) -> String {
        self.rows.iter().map(|row| format!("{} {}", row.rays, row.what)).collect::<Vec<_>>().join(", ")
    }
}

/// Everything that either has, in the order of the first.
fn joined<'a>(one: impl Iterator<Item = &'a str>, other: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for name in one.chain(other) {
        if all.iter().all(|known| known != name) {
            all.push(name.to_owned());
        }
    }
    all
}

fn pair(what: &str, seconds: [Option<f64>; 2], is_comparable: bool) -> Pair {
    let ratio = match seconds {
        [Some(one), Some(other)] if is_comparable && one > 0.0 => Some(other / one),
        _ => None,
    };
    Pair { what: what.to_owned(), seconds, ratio }
}

fn pairs(one: &[(String, f64)], other: &[(String, f64)], is_comparable: bool) -> Vec<Pair> {
    let (first, second): (BTreeMap<_, _>, BTreeMap<_, _>) =
        (one.iter().cloned().collect(), other.iter().cloned().collect());
    let names = joined(one.iter().map(|(name, _)| name.as_str()), other.iter().map(|(name, _)| name.as_str()));
    let of = |name: &String| pair(name, [first.get(name), second.get(name)].map(Option::<&f64>::copied), is_comparable);
    names.iter().map(of).collect()
}

fn rows(one: &[Timed], other: &[Timed], is_comparable: bool) -> Vec<Row> {
    let names = joined(one.iter().map(|row| row.what.as_str()), other.iter().map(|row| row.what.as_str()));
    let row = |name: &String| {
        let both = [one, other].map(|rows| rows.iter().find(|row| row.what == *name));
        Row {
            pair: pair(name, both.map(|row| row.map(|row| row.seconds)), is_comparable),
            excess: both.map(|row| row.and_then(Timed::excess)),
            imbalance: both.map(|row| row.and_then(Timed::imbalance)),
        }
    };
    names.iter().map(row).collect()
}

/// Most letters of a cell: two of them and a name fit a terminal of 100.
const CELL: usize = 36;

fn cut(text: &str) -> String {
    if text.chars().count() <= CELL {
        return text.to_owned();
    }
    text.chars().take(CELL - 1).chain(['…']).collect()
}

fn ratio(ratio: Option<f64>) -> String {
    ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{ratio:.3}"))
}

fn known(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), seconds)
}

/// What the terminal calls a stage of `report.json`.
fn stage_name(what: &str) -> &str {
    match what {
        "setup" => "set-up",
        "update" => "moving",
        "unused_estimate" => "estimates not used",
        what => what,
    }
}

impl fmt::Display for Diff {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "A: {}\nB: {}", self.files[0], self.files[1])?;
        match &self.not_comparable[..] {
            [] => writeln!(f, "\nSame scene, picture and seed: ratios are B over A, below 1 where B is faster.")?,
            reasons => {
                writeln!(f, "\nNot comparable, so no ratios:")?;
                reasons.iter().try_for_each(|reason| writeln!(f, "  {reason}"))?;
            }
        }
        let mut table = Table::new(&["differs", "A", "B"]);
        for Difference { what, values } in &self.differing {
            let shown = |value: &Option<String>| cut(value.as_deref().unwrap_or("–"));
            table.row(vec![what.clone(), shown(&values[0]), shown(&values[1])]);
        }
        if table.rows().len() > 1 {
            write!(f, "\n{table}")?;
        }
        let has =
            |value: fn(&Row) -> &[Option<f64>; 2]| self.rows.iter().any(|row| value(row).iter().any(Option::is_some));
        let (has_excess, has_imbalance) = (has(|row| &row.excess), has(|row| &row.imbalance));
        let mut head = vec![if self.kind == COMPARE { "way" } else { "stream" }, "A", "B", "B/A"];
        head.extend(has_imbalance.then_some(["imbalance A", "B"]).into_iter().flatten());
        head.extend(has_excess.then_some(["excess A", "B"]).into_iter().flatten());
        let mut table = Table::new(&head);
        for Row { pair, excess, imbalance } in &self.rows {
            let mut cells = vec![cut(&pair.what), known(pair.seconds[0]), known(pair.seconds[1]), ratio(pair.ratio)];
            let shares = [(has_imbalance, imbalance), (has_excess, excess)];
            cells.extend(shares.into_iter().filter(|(has, _)| *has).flat_map(|(_, shares)| shares.map(percent)));
            table.row(cells);
        }
        write!(f, "\n{table}")?;
        let name = if self.kind == COMPARE { "alone" } else { "busy" };
        for (title, pairs) in [("stage", &self.stages), (name, &self.devices)] {
            let mut table = Table::new(&[title, "A", "B", "B/A"]);
            // What neither run did is no difference.
            for pair in pairs.iter().filter(|pair| pair.seconds.iter().flatten().any(|seconds| *seconds > 0.0)) {
                let cells =
                    [cut(stage_name(&pair.what)), known(pair.seconds[0]), known(pair.seconds[1]), ratio(pair.ratio)];
                table.row(cells.to_vec());
            }
            if table.rows().len() > 1 {
                write!(f, "\n{table}")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
