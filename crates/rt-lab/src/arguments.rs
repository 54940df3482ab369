//! Values on the command lines of programs that run experiments.

use rt_core::StreamKind;

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
    }
}
