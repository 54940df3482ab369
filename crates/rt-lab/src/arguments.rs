//! Values on command lines: of programs that run experiments, and of the command.

use glam::{DVec3, Vec3};
use rt_core::StreamKind;
use std::time::Duration;

/// A fraction of the rays: `1/64`, or a number.
///
/// # Errors
/// When it is none from 1/4096 to 1.
pub fn fraction(text: &str) -> Result<f64, String> {
    let number = |s: &str| s.trim().parse::<f64>().map_err(|_| format!("`{s}` is not a number"));
    let value = match text.split_once('/') {
        Some((over, under)) => number(over)? / number(under)?,
        None => number(text)?,
    };
    if (1.0 / 4096.0..=1.0).contains(&value) { Ok(value) } else { Err("must be from 1/4096 to 1".to_owned()) }
}

/// Width and height of a picture: `960x600`.
///
/// # Errors
/// When it is none of up to 65,536 pixels a side.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("write it as WIDTHxHEIGHT, such as 960x600")?;
    let side = |s: &str| match s.trim().parse::<u32>() {
        Ok(n @ 1..=65_536) => Ok(n),
        _ => Err(format!("`{s}` is not a whole number from 1 to 65536")),
    };
    Ok([side(width)?, side(height)?])
}

/// A kind of rays that experiments compare.
///
/// # Errors
/// When it is another word.
pub fn kind(text: &str) -> Result<StreamKind, String> {
    match text.trim() {
        "primary" => Ok(StreamKind::Primary),
        "diffuse" => Ok(StreamKind::Diffuse(0)),
        _ => Err("must be primary or diffuse".to_owned()),
    }
}

/// An angle of view in degrees: `40`.
///
/// # Errors
/// When it is none above 0 and below 180.
pub fn angle_of_view(text: &str) -> Result<f32, String> {
    match text.trim().parse::<f32>() {
        Ok(degrees) if degrees > 0.0 && degrees < 180.0 => Ok(degrees),
        _ => Err("must be above 0 and below 180 degrees, such as 40".to_owned()),
    }
}

/// An angle in degrees: `-90`.
///
/// # Errors
/// When it is no finite number.
pub fn degrees(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|degrees: &f32| degrees.is_finite()).ok_or_else(|| "write it as a number".to_owned())
}

/// A time: `0.5`.
///
/// # Errors
/// When it is no number of seconds above 0.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.trim().parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.filter(|seconds| !seconds.is_zero()).ok_or_else(|| "must be a number of seconds above 0".to_owned())
}

/// How many times as fast: `1` or `0.5`.
///
/// # Errors
/// When it is none from a millionth to a million.
pub fn speed(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(speed) if (1e-6..=1e6).contains(&speed) => Ok(speed),
        _ => Err("must be from 0.000001 to 1000000, such as 1 or 0.5".to_owned()),
    }
}

/// A point: `1,1.5,-4`.
///
/// # Errors
/// When it is not three finite numbers.
pub fn point(text: &str) -> Result<DVec3, String> {
    let parts: Result<Vec<f64>, _> = text.split(',').map(|s| s.trim().parse::<f64>()).collect();
    match parts.as_deref() {
        Ok(&[x, y, z]) if [x, y, z].iter().all(|c| c.is_finite()) => Ok(DVec3::new(x, y, z)),
        _ => Err("write it as three finite numbers, such as 1,1.5,-4".to_owned()),
    }
}

/// A direction in single precision.
///
/// # Errors
/// When it is not three numbers up to 3e38.
pub fn vector(text: &str) -> Result<Vec3, String> {
    let vector = point(text)?.as_vec3();
    if vector.is_finite() { Ok(vector) } else { Err("write it as three numbers up to 3e38".to_owned()) }
}

/// An amount of memory: `512M`.
///
/// # Errors
/// When it is no whole number of bytes from 1M on.
pub fn bytes(text: &str) -> Result<u64, String> {
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
        assert_eq!(fraction("1/64"), Ok(1.0 / 64.0));
        assert!(["0", "2", "1/0", "nan", "many", ""].iter().all(|text| fraction(text).is_err()));
        assert_eq!(size("640x400"), Ok([640, 400]));
        assert!(["640", "0x4", "4x70000", "x"].iter().all(|text| size(text).is_err()));
        assert_eq!(kind("diffuse"), Ok(StreamKind::Diffuse(0)));
        assert!(kind("shadow").is_err());
        assert_eq!(angle_of_view("40"), Ok(40.0));
        assert!(["0", "-1", "180", "nan", "inf", "wide", ""].iter().all(|text| angle_of_view(text).is_err()));
        assert_eq!(degrees("-90"), Ok(-90.0));
        assert!(["nan", "inf", "far"].iter().all(|text| degrees(text).is_err()));
        assert_eq!(seconds("0.5"), Ok(Duration::from_millis(500)));
        assert!(["0", "-1", "nan", "inf", "1e300", "soon"].iter().all(|text| seconds(text).is_err()));
        assert_eq!(speed(" 0.5"), Ok(0.5));
        assert!(["0", "-1", "nan", "inf", "1e300", "fast"].iter().all(|text| speed(text).is_err()));
        assert_eq!(vector("1,-2, .5"), Ok(Vec3::new(1.0, -2.0, 0.5)));
        assert!(vector("1,2").is_err() && vector("1,2,nan").is_err() && vector("1,2,1e39").is_err());
        assert_eq!(point("500000.05, 5412345.312,1e39"), Ok(DVec3::new(500_000.05, 5_412_345.312, 1e39)));
        assert_eq!(bytes("2G"), Ok(2 << 30));
        assert!(bytes("1K").is_err() && bytes("lots").is_err());
    }
}
