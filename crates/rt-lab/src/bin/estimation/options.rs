//! The command line.

use clap::Parser;
use rt_core::StreamKind;
use rt_lab::arguments;
use rt_report::exit::Exit;
use std::path::PathBuf;

/// Measure what estimating costs and how wrong it is.
#[derive(Clone, Debug, Parser)]
#[command(after_help = Exit::HELP)]
pub(crate) struct Options {
    /// Built-in scenes (yard, car) or files (OBJ, PLY, STL, glTF)
    #[arg(required = true, value_name = "SCENE")]
    pub(crate) scenes: Vec<PathBuf>,
    /// Kinds of rays: primary, diffuse
    #[arg(long, value_name = "KIND,...", value_delimiter = ',', default_value = "primary,diffuse")]
    #[arg(value_parser = arguments::kind)]
    pub(crate) kinds: Vec<StreamKind>,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1024x1024", value_parser = arguments::size)]
    pub(crate) size: [u32; 2],
    /// Rays of a task
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_value = "1024,64")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) task_sizes: Vec<u32>,
    /// Repetitions that count, each with another seed
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) repeat: u32,
    /// Passes over all tasks, one per launch
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(2..))]
    pub(crate) passes: u32,
    /// Only these estimators, such as `exact` or `field 1/64`
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub(crate) only: Vec<String>,
    /// Only the estimators of docs/results/estimation.md
    #[arg(long, conflicts_with = "only")]
    pub(crate) published: bool,
    /// A look at the form: small pictures, few repetitions
    #[arg(long, conflicts_with_all = ["size", "task_sizes", "repeat", "passes"])]
    pub(crate) quick: bool,
    /// Write every measurement to this file
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write tables of all scenes side by side, in Markdown, to this file
    #[arg(long, value_name = "FILE", requires = "published")]
    pub(crate) summary: Option<PathBuf>,
}

impl Options {
    /// With what the shorthands stand for.
    pub(crate) fn adjusted(mut self) -> Self {
        if self.quick {
            (self.size, self.task_sizes) = ([512, 512], vec![1024]);
            (self.repeat, self.passes) = (3, 2);
        }
        if self.published {
            self.only = super::summary::published();
        }
        self
    }
}
