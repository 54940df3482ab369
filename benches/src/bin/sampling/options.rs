//! The command line.

use clap::Parser;
use rt_benches::options::{self, fraction, kind, size};
use rt_core::StreamKind;
use rt_report::exit::Exit;
use rt_sched::sample::Fraction;

/// Measure what a sampled ray costs in units of a traced one, by how the sample is walked, and how wrong it is.
#[derive(Debug, Parser)]
#[command(after_help = Exit::HELP)]
pub(crate) struct Options {
    #[command(flatten)]
    pub(crate) common: options::Options,
    /// The device: one thread of the processor, or a Vulkan device, such as vulkan:0
    #[arg(long, value_name = "DEVICE", default_value = "cpu:1", value_parser = device)]
    pub(crate) devices: Device,
    /// Kinds of rays: primary, diffuse
    #[arg(long, value_name = "KIND,...", value_delimiter = ',', default_value = "primary,diffuse", value_parser = kind)]
    pub(crate) kinds: Vec<StreamKind>,
    /// Shares of the rays that are sampled
    #[arg(long, value_name = "F,...", value_delimiter = ',', default_value = "1/8,1/64,1/128")]
    #[arg(value_parser = part)]
    pub(crate) fractions: Vec<Fraction>,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1024x1024", value_parser = size)]
    pub(crate) size: [u32; 2],
}

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Device {
    /// One thread of the processor.
    Processor,
    /// The Vulkan device at a place of the system's list.
    Vulkan(usize),
}

fn device(text: &str) -> Result<Device, String> {
    match text.trim() {
        "cpu:1" => Ok(Device::Processor),
        other => options::vulkan(other).map(Device::Vulkan).map_err(|wrong| format!("{wrong}, nor cpu:1")),
    }
}

fn part(text: &str) -> Result<Fraction, String> {
    Fraction::new(fraction(text)?).ok_or_else(|| "must be from 1/4096 to 1".to_owned())
}
