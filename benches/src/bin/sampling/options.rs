//! The command line.

use rt_core::StreamKind;
use rt_sched::sample::Fraction;
use std::error::Error;

#[derive(Debug)]
pub(crate) struct Options {
    pub(crate) scenes: Vec<String>,
    pub(crate) kinds: Vec<StreamKind>,
    pub(crate) fractions: Vec<Fraction>,
    pub(crate) size: [u32; 2],
    pub(crate) runs: usize,
    /// The Vulkan device in place of the processor, by its place in the system's list.
    pub(crate) vulkan: Option<usize>,
}

impl Options {
    pub(crate) fn parse() -> Result<Self, Box<dyn Error>> {
        let mut options = Self {
            scenes: Vec::new(),
            kinds: vec![StreamKind::Primary, StreamKind::Diffuse(0)],
            fractions: ["8", "64", "128"].into_iter().map(fraction).collect::<Result<_, _>>()?,
            size: [1024, 1024],
            runs: 7,
            vulkan: None,
        };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            match argument.as_str() {
                "--kinds" => options.kinds = value()?.split(',').map(kind).collect::<Result<_, _>>()?,
                "--one-of" => options.fractions = value()?.split(',').map(fraction).collect::<Result<_, _>>()?,
                "--size" => {
                    let text = value()?;
                    let (width, height) = text.split_once('x').ok_or("--size WIDTHxHEIGHT")?;
                    options.size = [width.parse()?, height.parse()?];
                }
                "--runs" => options.runs = value()?.parse::<usize>()?.max(1),
                "--device" => options.vulkan = device(&value()?)?,
                scene if !scene.starts_with('-') => options.scenes.push(scene.to_owned()),
                other => return Err(format!("unknown option {other}").into()),
            }
        }
        if options.scenes.is_empty() {
            options.scenes = vec!["yard".to_owned(), "car".to_owned()];
        }
        Ok(options)
    }
}

fn kind(name: &str) -> Result<StreamKind, String> {
    match name {
        "primary" => Ok(StreamKind::Primary),
        "diffuse" => Ok(StreamKind::Diffuse(0)),
        other => Err(format!("--kinds {other}: primary or diffuse")),
    }
}

/// A fraction by its denominator.
fn fraction(denominator: &str) -> Result<Fraction, String> {
    let fraction = denominator.parse().ok().and_then(|n: f64| Fraction::new(1.0 / n));
    fraction.ok_or_else(|| format!("--one-of {denominator}: numbers from 1 to 4096"))
}

fn device(name: &str) -> Result<Option<usize>, String> {
    match name.split_once(':') {
        Some(("cpu", "1")) => Ok(None),
        Some(("vulkan", place)) if place.parse::<usize>().is_ok() => Ok(place.parse().ok()),
        _ => Err(format!("--device {name}: cpu:1, or vulkan:0 and so on")),
    }
}
