//! The command line.

use rt_core::StreamKind;
use std::error::Error;

/// What to measure.
#[derive(Debug)]
pub(crate) struct Options {
    pub(crate) scenes: Vec<String>,
    pub(crate) kinds: Vec<StreamKind>,
    pub(crate) size: [u32; 2],
    pub(crate) task_sizes: Vec<u32>,
    pub(crate) repetitions: usize,
    /// Passes over all tasks, one per launch.
    pub(crate) passes: usize,
    /// Names of cases, such as `exact` or `field 1/64`; empty: all.
    pub(crate) only: Vec<String>,
    pub(crate) json: Option<String>,
}

impl Options {
    pub(crate) fn parse() -> Result<Self, Box<dyn Error>> {
        let mut options = Self {
            scenes: Vec::new(),
            kinds: vec![StreamKind::Primary, StreamKind::Diffuse(0)],
            size: [1024, 1024],
            task_sizes: vec![1024, 64],
            repetitions: 7,
            passes: 6,
            only: Vec::new(),
            json: None,
        };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            match argument.as_str() {
                "--kinds" => options.kinds = value()?.split(',').map(kind).collect::<Result<_, _>>()?,
                "--size" => {
                    let text = value()?;
                    let (width, height) = text.split_once('x').ok_or("--size WIDTHxHEIGHT")?;
                    options.size = [width.parse()?, height.parse()?];
                }
                "--task-sizes" => options.task_sizes = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?,
                "--repetitions" => options.repetitions = value()?.parse::<usize>()?.max(1),
                "--passes" => options.passes = value()?.parse::<usize>()?.max(2),
                "--only" => options.only = value()?.split(',').map(str::to_owned).collect(),
                "--quick" => {
                    (options.size, options.task_sizes) = ([512, 512], vec![1024]);
                    (options.repetitions, options.passes) = (3, 2);
                }
                "--json" => options.json = Some(value()?),
                scene if !scene.starts_with('-') => options.scenes.push(scene.to_owned()),
                other => return Err(format!("unknown option {other}").into()),
            }
        }
        if options.scenes.is_empty() {
            return Err("name a scene: yard, car, or OBJ files".into());
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
