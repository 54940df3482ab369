//! Values on the command line: names of the catalogue and devices, and what experiments take as well.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use rt_balance::catalogue::{self, Entry, Make, reduced_estimators};
use rt_balance::devices::{self, ListError};

pub(super) use rt_lab::arguments::{
    angle_of_view as parse_fov, bytes as parse_bytes, degrees as parse_degrees, fraction as parse_fraction,
    point as parse_point, seconds as parse_seconds, size as parse_size, speed as parse_speed, vector as parse_vec3,
};

/// The list stays text: opening it reads it again.
pub(super) fn parse_devices(text: &str) -> Result<String, ListError> {
    super::opener().check(text.trim())?;
    Ok(text.trim().to_owned())
}

/// The same for experiments on trees and precisions of this project.
pub(super) fn parse_own_devices(text: &str) -> Result<String, String> {
    let text = parse_devices(text).map_err(|error| error.to_string())?;
    let other = "peers have trees and precisions of their own, which are not traded: name cpu:1, or a graphics card";
    devices::check(&text).map_err(|_| other.to_owned())?;
    Ok(text)
}

/// Names of a list of the catalogue.
pub(super) fn named<T: Send + Sync>(entries: &'static [Entry<T>]) -> impl TypedValueParser<Value = &'static Entry<T>> {
    PossibleValuesParser::new(entries.iter().map(|entry| PossibleValue::new(entry.name).help(entry.what)))
        .map(|name| catalogue::find(entries, &name).expect("no other name passes the parser"))
}

/// What the walk of a reduced estimator does at a leaf: the estimator's name without what all have in common.
pub(super) fn reduced_walk() -> impl TypedValueParser<Value = &'static Entry<Make>> {
    let short = |entry: &'static Entry<Make>| entry.name.strip_prefix("reduced-").unwrap_or("leaf");
    PossibleValuesParser::new(reduced_estimators().map(|entry| PossibleValue::new(short(entry)).help(entry.what)))
        .map(move |name| reduced_estimators().find(|e| short(e) == name).expect("no other name passes the parser"))
}
