//! Options that benchmarks of traversal share.

use std::error::Error;

/// Which scenes, how often, and how large a picture.
#[derive(Debug)]
pub struct Options {
    /// As [`crate::open`] names them.
    pub scenes: Vec<String>,
    /// Interleaved runs, at least one.
    pub runs: usize,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
}

impl Options {
    /// Reads the command line; the picture is of `size` where it says nothing. `own` is shown each other option with
    /// what gives its value, and says whether it knows it.
    ///
    /// # Errors
    /// When an option is unknown, or its value wrong or missing.
    pub fn parse(
        size: [u32; 2],
        mut own: impl FnMut(&str, &mut dyn FnMut() -> Result<String, String>) -> Result<bool, Box<dyn Error>>,
    ) -> Result<Self, Box<dyn Error>> {
        let mut options = Self { scenes: Vec::new(), runs: 7, size };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            match argument.as_str() {
                "--runs" => options.runs = value()?.parse::<usize>()?.max(1),
                "--size" => {
                    let text = value()?;
                    let (width, height) = text.split_once('x').ok_or("--size WIDTHxHEIGHT")?;
                    options.size = [width.parse()?, height.parse()?];
                }
                scene if !scene.starts_with('-') => options.scenes.push(scene.to_owned()),
                other if own(other, &mut value)? => {}
                other => return Err(format!("unknown option {other}").into()),
            }
        }
        if options.scenes.is_empty() {
            options.scenes = vec!["yard".to_owned(), "car".to_owned()];
        }
        Ok(options)
    }
}
