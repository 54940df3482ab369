//! Values on the command line: names of the catalogue, devices, points, amounts of memory.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use glam::{DVec3, Vec3};
use rt_balance::catalogue::{self, Entry, Make, reduced_estimators};
use rt_balance::devices::{self, ListError};
use std::time::Duration;

pub(super) use rt_lab::arguments::{fraction as parse_fraction, size as parse_size};

/// The list stays text: opening it reads it again.
pub(super) fn parse_devices(text: &str) -> Result<String, ListError> {
    devices::check(text.trim())?;
    Ok(text.trim().to_owned())
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

pub(super) fn parse_fov(text: &str) -> Result<f32, String> {
    match text.trim().parse::<f32>() {
        Ok(degrees) if degrees > 0.0 && degrees < 180.0 => Ok(degrees),
        _ => Err("must be above 0 and below 180 degrees, such as 40".to_owned()),
    }
}

pub(super) fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.trim().parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.filter(|seconds| !seconds.is_zero()).ok_or_else(|| "must be a number of seconds above 0".to_owned())
}

pub(super) fn parse_point(text: &str) -> Result<DVec3, String> {
    let parts: Result<Vec<f64>, _> = text.split(',').map(|s| s.trim().parse::<f64>()).collect();
    match parts.as_deref() {
        Ok(&[x, y, z]) if [x, y, z].iter().all(|c| c.is_finite()) => Ok(DVec3::new(x, y, z)),
        _ => Err("write it as three finite numbers, such as 1,1.5,-4".to_owned()),
    }
}

pub(super) fn parse_degrees(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|degrees: &f32| degrees.is_finite()).ok_or_else(|| "write it as a number".to_owned())
}

pub(super) fn parse_vec3(text: &str) -> Result<Vec3, String> {
    let vector = parse_point(text)?.as_vec3();
    if vector.is_finite() { Ok(vector) } else { Err("write it as three numbers up to 3e38".to_owned()) }
}

pub(super) fn parse_bytes(text: &str) -> Result<u64, String> {
    let (digits, factor) = match text.to_ascii_uppercase().strip_suffix(['K', 'M', 'G']) {
        Some(digits) => {
            let power = 1 + "KMG".find(text.to_ascii_uppercase().chars().next_back().unwrap_or('K')).unwrap_or(0);
            (digits.to_owned(), 1024_u64.pow(power as u32))
        }
        None => (text.to_owned(), 1),
    };
    match digits.parse::<u64>().ok().and_then(|n| n.checked_mul(factor)) {
        Some(bytes) if bytes >= 1 << 20 => Ok(bytes),
        Some(_) => Err("at least 1M is needed".to_owned()),
        None => Err("write it as a whole number with K, M or G, such as 512M".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_parsed_or_explained() {
        assert_eq!(parse_fov("40"), Ok(40.0));
        assert!(["0", "-1", "180", "nan", "inf", "wide", ""].iter().all(|text| parse_fov(text).is_err()));
        assert_eq!(parse_seconds("0.5"), Ok(Duration::from_millis(500)));
        assert!(["0", "-1", "nan", "inf", "1e300", "soon"].iter().all(|text| parse_seconds(text).is_err()));
        assert_eq!(parse_vec3("1,-2, .5"), Ok(Vec3::new(1.0, -2.0, 0.5)));
        assert!(parse_vec3("1,2").is_err() && parse_vec3("1,2,nan").is_err() && parse_vec3("1,2,1e39").is_err());
        assert_eq!(parse_point("500000.05, 5412345.312,1e39"), Ok(DVec3::new(500_000.05, 5_412_345.312, 1e39)));
        assert_eq!(parse_bytes("2G"), Ok(2 << 30));
        assert_eq!(parse_degrees("-90"), Ok(-90.0));
        assert!(["nan", "inf", "far"].iter().all(|text| parse_degrees(text).is_err()));
        assert!(parse_bytes("1K").is_err() && parse_bytes("lots").is_err());
    }
}
