//! Where results come from: what every file of them carries.
//!
//! It is made here alone, when the results are. Programs that compare files leave it out: it is the field `provenance`
//! of JSON files, lines that begin with `#` in front of CSV, the element `metadata` of SVG.

use crate::Machine;
use crate::html::escaped;
use rt_core::Device;
use serde::Serialize;
use std::fmt::{self, Write};
use std::sync::Arc;
use std::time::SystemTime;

/// The commit that this program was built from, as the build script found it.
const COMMIT: &str = env!("RAYBALANCE_COMMIT");

/// Where results come from.
#[derive(Clone, Debug, Serialize)]
pub struct Provenance {
    /// The commit that the program was built from, `+changes` behind it where files had been changed since; `unknown`
    /// where it was not built in a repository.
    pub commit: &'static str,
    /// When it was made: the universal time, as RFC 3339 writes it.
    pub date: String,
    /// The machine and the program.
    pub machine: Machine,
    /// Names of the devices that took part.
    pub devices: Vec<String>,
    /// What random numbers were made from; null where there were none.
    pub seed: Option<u32>,
    /// The command line as one would type it.
    pub command: String,
}

impl Provenance {
    /// Of results that are made now.
    #[must_use]
    pub fn now(seed: impl Into<Option<u32>>, devices: impl IntoIterator<Item = impl Into<String>>) -> Self {
        Self {
            commit: COMMIT,
            date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            machine: Machine::this(),
            devices: devices.into_iter().map(Into::into).collect(),
            seed: seed.into(),
            command: command_line(),
        }
    }

    /// Of results that these devices make now.
    #[must_use]
    pub fn of(seed: u32, devices: &[Arc<dyn Device>]) -> Self {
        Self::now(seed, devices.iter().map(|device| device.info().name.clone()))
    }

    /// Every part with its name.
    fn parts(&self) -> [(&'static str, String); 6] {
        [
            ("command", self.command.clone()),
            ("commit", self.commit.to_owned()),
            ("date", self.date.clone()),
            ("machine", self.machine.to_string()),
            ("devices", self.devices.join("; ")),
            ("seed", self.seed.map_or_else(|| "none".to_owned(), |seed| seed.to_string())),
        ]
    }

    /// Lines that open a CSV file: a comment for each part.
    #[must_use]
    pub fn csv(&self) -> String {
        self.parts().iter().fold(String::new(), |mut text, (name, value)| {
            let _ = writeln!(text, "# {name}: {}", value.replace('\n', " "));
            text
        })
    }

    /// The drawing with the same as its metadata.
    #[must_use]
    pub fn in_svg(&self, svg: &str) -> String {
        let mut metadata = "<metadata>\n".to_owned();
        for (name, value) in self.parts() {
            let _ = writeln!(metadata, "{name}: {}", escaped(&value));
        }
        metadata.push_str("</metadata>\n");
        // Behind the tag that opens the drawing.
        match svg.split_once(">\n") {
            Some((open, rest)) => format!("{open}>\n{metadata}{rest}"),
            None => svg.to_owned(),
        }
    }
}

/// A list in Markdown, which is easy to read as plain text, too.
impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.parts().iter().try_for_each(|(name, value)| match *name {
            "command" => writeln!(f, "* {name}: `{value}`"),
            _ => writeln!(f, "* {name}: {value}"),
        })
    }
}

/// The command line as one would type it; where words are no text, as near to it as can be shown.
fn command_line() -> String {
    let mut words = std::env::args_os();
    let program = words.next().unwrap_or_default();
    let program = std::path::Path::new(&program).file_stem().unwrap_or_default().to_owned();
    let words = std::iter::once(program).chain(words).map(|word| quoted(&word.to_string_lossy()));
    words.collect::<Vec<_>>().join(" ")
}

/// A word as a shell takes it.
pub(crate) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./,:@=+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Provenance {
        Provenance { command: "raybalance render 'a <b>.obj'".to_owned(), ..Provenance::now(7, ["cpu:1", "a card"]) }
    }

    // Mutants: a part left out of one of the forms; text that is not escaped; metadata in front of the drawing.
    #[test]
    fn every_form_has_every_part() {
        let own = sample();
        let json = serde_json::to_string(&own).unwrap();
        let svg = own.in_svg("<svg width=\"1\">\n<rect/>\n</svg>\n");
        assert!(svg.starts_with("<svg width=\"1\">\n<metadata>\n") && svg.ends_with("</metadata>\n<rect/>\n</svg>\n"));
        assert!(svg.contains("a &lt;b&gt;.obj"), "{svg}");
        assert!(own.csv().lines().all(|line| line.starts_with("# ")), "{}", own.csv());
        for form in [json, svg, own.csv(), own.to_string()] {
            for (name, _) in own.parts() {
                assert!(form.contains(name), "{name} is missing in {form}");
            }
            for value in [COMMIT, &own.date, "a card", "7", own.machine.build, "raybalance render"] {
                assert!(form.contains(value), "{value} is missing in {form}");
            }
        }
    }

    #[test]
    fn a_command_can_be_typed_again() {
        assert_eq!(quoted("--size=8x8"), "--size=8x8");
        assert_eq!(quoted("it's a scene.obj"), r"'it'\''s a scene.obj'");
        assert_eq!(quoted(""), "''");
    }

    #[test]
    fn the_date_is_one() {
        let date = sample().date;
        assert!(date.len() == 20 && date.ends_with('Z') && date.as_bytes()[10] == b'T', "{date}");
    }
}
