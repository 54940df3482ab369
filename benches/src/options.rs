//! Options that the benchmarks share; each has its own beside them, and `--help`.

use clap::Args;

/// Which scenes, and how often.
// A group of its own: those that flatten it have one of the same name.
#[derive(Clone, Debug, Args)]
#[group(id = "common")]
pub struct Options {
    /// Built-in scenes (yard, car) or OBJ files, beside which a cameras.tsv is heeded
    #[arg(default_values = ["yard", "car"], value_name = "SCENE")]
    pub scenes: Vec<String>,
    /// Interleaved repetitions that count
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..), value_name = "N")]
    pub repeat: u32,
}

/// The place of a Vulkan device in the system's list, as lists of devices name it: `vulkan:0`.
///
/// # Errors
/// When it is another text.
pub fn vulkan(text: &str) -> Result<usize, String> {
    let place = text.trim().strip_prefix("vulkan:").and_then(|place| place.parse().ok());
    place.ok_or_else(|| format!("`{text}` is no Vulkan device, such as vulkan:0"))
}

/// A part of a whole, by the number of parts: `64` for 1/64, as [`rt_lab::arguments::fraction`] reads it.
pub use rt_lab::arguments::{fraction, kind, size};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vulkan_devices_are_named_as_everywhere() {
        assert_eq!(vulkan("vulkan:3"), Ok(3));
        assert!(["3", "vulkan", "vulkan:", "wgpu:0", "vulkan:0@0.5"].iter().all(|text| vulkan(text).is_err()));
    }
}
