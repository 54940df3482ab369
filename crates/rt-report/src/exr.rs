//! OpenEXR files (feature `exr`): numbers as they are, in single precision, for programs that go on with them.
//!
//! A picture has the mean radiance of each pixel: linear, without exposure and tone mapping, in the primaries of
//! Rec. 709, which the format takes for granted. A cost map has channels for each kind of rays, at the resolution of
//! `cost.png`. Both are compressed without loss, and the same bytes for the same numbers.

use crate::ReportError;
use crate::chart::cost::CostMap;
use glam::Vec3;
use std::path::Path;

/// Whether this build writes them.
///
/// # Errors
/// When it does not.
pub const fn check() -> Result<(), ReportError> {
    if cfg!(feature = "exr") { Ok(()) } else { Err(ReportError::NoExr) }
}

/// Writes the means of the radiances that were summed up for each pixel, row by row from the upper left; `samples_at`
/// says how many those are.
///
/// # Errors
/// When there are not as many sums as pixels, or the file cannot be written.
#[cfg(feature = "exr")]
pub fn write_picture(
    path: &Path,
    size: [u32; 2],
    sums: &[Vec3],
    samples_at: &(dyn Fn(usize) -> u32 + Sync),
) -> Result<(), ReportError> {
    use ::exr::prelude::{Image, SpecificChannels, WritableImage};
    let [width, height] = size.map(|side| side as usize);
    if sums.len() != width * height {
        return Err(ReportError::Pixels { size, found: sums.len() });
    }
    let channels = SpecificChannels::rgb(|at: ::exr::math::Vec2<usize>| -> (f32, f32, f32) {
        let place = at.1 * width + at.0;
        (sums[place] / samples_at(place).max(1) as f32).into()
    });
    let image = Image::from_layer(file::layer(size, channels, None));
    file::write(path, |out| image.write().to_buffered(out))
}

/// Writes what rays cost: for each map the channels `KIND.measured_ns` and, where there is an estimate,
/// `KIND.estimated_ns`, nanoseconds per ray and NaN where that is not known. Kinds have no blanks there: `shadow_0`; of
/// an animation the frame is in front: `frame_7.shadow_0`.
///
/// # Errors
/// When there is no map, or the file cannot be written.
#[cfg(feature = "exr")]
pub fn write_costs(path: &Path, maps: &[CostMap]) -> Result<(), ReportError> {
    use crate::chart::cost::Origin;
    use ::exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, WritableImage};
    let Some(size) = maps.first().map(CostMap::size).filter(|size| !size.contains(&0)) else {
        return Err(ReportError::Nothing("a cost map of no pixels"));
    };
    let mut channels = Vec::new();
    for map in maps {
        let cells = || (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y)));
        let sides = [("estimated_ns", map.origin() != Origin::Nowhere), ("measured_ns", true)];
        for (side, (name, _)) in sides.into_iter().enumerate().filter(|(_, (_, is_known))| *is_known) {
            let name = format!("{}.{name}", map.channel());
            let costs = cells().map(|(x, y)| map.costs_at(x, y)[side]).collect();
            channels.push(AnyChannel::new(name.as_str(), FlatSamples::F32(costs)));
        }
    }
    let told = "nanoseconds per ray on a device of mean speed, of each kind of rays; NaN where not known";
    let image = Image::from_layer(file::layer(size, AnyChannels::sort(channels.into()), Some(told)));
    file::write(path, |out| image.write().to_buffered(out))
}

/// Fails: such files are the feature `exr`.
///
/// # Errors
/// Always.
#[cfg(not(feature = "exr"))]
pub fn write_picture(_: &Path, _: [u32; 2], _: &[Vec3], _: &(dyn Fn(usize) -> u32 + Sync)) -> Result<(), ReportError> {
    check()
}

/// Fails: such files are the feature `exr`.
///
/// # Errors
/// Always.
#[cfg(not(feature = "exr"))]
pub fn write_costs(_: &Path, _: &[CostMap]) -> Result<(), ReportError> {
    check()
}

#[cfg(feature = "exr")]
mod file {
    use crate::ReportError;
    use crate::output::{WriteSeek, write_seeking};
    use ::exr::error::{Error, UnitResult};
    use ::exr::image::write::channels::WritableChannels;
    use ::exr::meta::header::LayerAttributes;
    use ::exr::prelude::{Blocks, Compression, Encoding, Layer, LineOrder};
    use std::io;
    use std::path::Path;

    /// What all our files have in common.
    pub(super) fn layer<'a, C>([width, height]: [u32; 2], channels: C, comments: Option<&str>) -> Layer<C>
    where
        C: WritableChannels<'a> + 'a,
    {
        // Lines in order: whichever core compresses which of them, the file is the same.
        let encoding =
            Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
        let attributes = LayerAttributes {
            software_name: Some("raybalance".into()),
            comments: comments.map(Into::into),
            ..LayerAttributes::default()
        };
        Layer::new((width as usize, height as usize), attributes, encoding, channels)
    }

    pub(super) fn write(path: &Path, write: impl FnOnce(&mut dyn WriteSeek) -> UnitResult) -> Result<(), ReportError> {
        write_seeking(path, |out| {
            write(out).map_err(|error| match error {
                Error::Io(error) => error,
                error => io::Error::other(error),
            })
        })
    }
}

#[cfg(all(test, feature = "exr"))]
mod tests {
    use super::*;
    use crate::chart::cost::each_ray;
    use crate::chart::samples::run;
    use ::exr::prelude::{read_all_flat_layers_from_file, read_first_rgba_layer_from_file};
    use rt_core::{Task, Work};

    /// Mutants: sums instead of means; rows and columns exchanged; radiance cut at 1 or rounded to half precision.
    #[test]
    fn a_picture_is_read_back_bit_for_bit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("image.exr");
        let sums: Vec<Vec3> = (0..6).map(|i| Vec3::new(i as f32, 0.1 * i as f32, 1e9 * i as f32)).collect();
        write_picture(&path, [3, 2], &sums, &|_| 4).unwrap();
        let read = read_first_rgba_layer_from_file(
            &path,
            |size, _| vec![[0.0; 3]; size.0 * size.1],
            |pixels: &mut Vec<[f32; 3]>, at, (r, g, b, _): (f32, f32, f32, f32)| pixels[at.1 * 3 + at.0] = [r, g, b],
        )
        .unwrap();
        let means: Vec<[f32; 3]> = sums.iter().map(|&sum| (sum / 4.0).to_array()).collect();
        assert_eq!(read.layer_data.channel_data.pixels, means);
        let before = std::fs::read(&path).unwrap();
        write_picture(&path, [3, 2], &sums, &|_| 4).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), before, "the same bytes each time");
        assert!(matches!(write_picture(&path, [2, 2], &sums, &|_| 4), Err(ReportError::Pixels { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), before);
    }

    /// Mutants: estimated and measured exchanged; a channel for an estimate that there is not; 0 for what is not known.
    #[test]
    fn costs_are_read_back_by_their_names() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("cost.exr");
        let map = |kind: &str, chosen: &str| {
            let mut run = run(1, Vec::new());
            run.report.estimate.chosen = chosen.to_owned();
            run.tasks = vec![Task { first: 0, rays: 2 }];
            run.work = vec![Work::new(1.0, 1.0, 0.0)];
            (run.kept, run.device_of) = (vec![0], vec![0]);
            (run.predicted_s, run.measured_s) = (vec![6e-9], vec![8e-9]);
            let mut map = CostMap::new(kind, [2, 1]);
            map.add(&run, each_ray(|_| 0));
            map
        };
        write_costs(&path, &[map("primary", "uniform"), map("shadow 0", "exact")]).unwrap();
        let read = read_all_flat_layers_from_file(&path).unwrap();
        let channels: Vec<(String, Vec<f32>)> = read.layer_data[0]
            .channel_data
            .list
            .iter()
            .map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect()))
            .collect();
        let names: Vec<&str> = channels.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["primary.measured_ns", "shadow_0.estimated_ns", "shadow_0.measured_ns"]);
        for (name, costs) in &channels {
            // One scale takes the estimates of a device to what it took.
            assert!((costs[0] - 4.0).abs() < 1e-6 && costs[1].is_nan(), "{name}: {costs:?}");
        }
        assert!(matches!(write_costs(&path, &[]), Err(ReportError::Nothing(_))));
    }
}
