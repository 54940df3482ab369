//! Pictures from linear radiance.

use crate::ReportError;
use crate::output::write_atomically;
use glam::Vec3;
use png::EncodingError;
use rayon::prelude::*;
use std::fs::{self, File};
use std::io::{self, BufReader, Write};
use std::path::{Path, PathBuf};

/// Pixels that are encoded before they are written: enough to occupy every core, few beside any picture.
const BLOCK: usize = 1 << 18;

/// Writes linear radiance (Rec. 709 primaries, row by row from the upper left), times the `exposure` of each pixel, as
/// an 8-bit sRGB PNG.
///
/// It is encoded block by block, so that writing takes no memory that grows with the picture. Radiance up to about 0.8
/// keeps its colour; what is brighter is compressed towards white. Values that are negative or not numbers become
/// black, infinite ones white.
///
/// # Errors
/// When `radiance` does not have `width · height` entries, or the file cannot be written.
pub fn write_png(
    path: &Path,
    [width, height]: [u32; 2],
    radiance: &[Vec3],
    exposure: impl Fn(usize) -> f32 + Sync,
) -> Result<(), ReportError> {
    let pixels = u64::from(width) * u64::from(height);
    if radiance.len() as u64 != pixels {
        return Err(ReportError::Pixels { size: [width, height], found: radiance.len() });
    }
    // A picture is written after every pass, and its noise leaves little to compress.
    write(path, [width, height], png::Compression::Fast, |out| {
        let mut bytes: Vec<[u8; 3]> = Vec::new();
        for (first, block) in (0..).step_by(BLOCK).zip(radiance.chunks(BLOCK)) {
            let exposed = |(place, &pixel): (usize, &Vec3)| encode(pixel * exposure(first + place));
            block.par_iter().enumerate().map(exposed).collect_into_vec(&mut bytes);
            out.write_all(bytes.as_flattened())?;
        }
        Ok(())
    })
}

/// Writes 8-bit sRGB pixels, three bytes each, as a PNG.
pub(crate) fn write_rgb(path: &Path, width: u32, height: u32, bytes: &[u8]) -> Result<(), ReportError> {
    write(path, [width, height], png::Compression::Balanced, |out| out.write_all(bytes))
}

/// Writes a PNG whose pixels `pixels` writes, three bytes each.
fn write(
    path: &Path,
    size: [u32; 2],
    compression: png::Compression,
    pixels: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), ReportError> {
    write_atomically(path, |out| encode_png(out, size, compression, pixels))
}

fn encode_png(
    out: impl Write,
    [width, height]: [u32; 2],
    compression: png::Compression,
    pixels: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_compression(compression);
    let mut writer = encoder.write_header().map_err(unwrapped)?;
    let mut stream = writer.stream_writer().map_err(unwrapped)?;
    pixels(&mut stream)?;
    stream.finish().map_err(unwrapped)?;
    writer.finish().map_err(unwrapped)
}

/// A picture's file as a page has it.
pub(crate) struct Preview {
    pub(crate) png: Vec<u8>,
    /// How many pixels of the picture, in a row and in a column, became one; 1 for the file as it is.
    pub(crate) one_in: u32,
}

/// A PNG of at most `most` pixels (more by what rounding up adds) from one that [`write_png`] wrote: the file itself,
/// or each square of its pixels as their mean. Takes no memory that grows with the picture.
pub(crate) fn preview(path: &Path, most: u32) -> Result<Preview, ReportError> {
    scaled(path, most).map_err(|source| ReportError::read(path, source))
}

fn scaled(path: &Path, most: u32) -> io::Result<Preview> {
    let mut reader = open(path)?;
    let (width, height) = (reader.info().width, reader.info().height);
    let pixels = f64::from(width) * f64::from(height);
    let one_in = (pixels / f64::from(most)).sqrt().ceil().max(1.0) as u32;
    if one_in == 1 {
        return Ok(Preview { png: fs::read(path)?, one_in });
    }
    let mut png = Vec::new();
    let size = [width, height].map(|side| side.div_ceil(one_in));
    encode_png(&mut png, size, png::Compression::Balanced, |out| {
        shrink(&mut reader, one_in, &mut |row| out.write_all(row.as_flattened()))
    })?;
    Ok(Preview { png, one_in })
}

type Reader = png::Reader<BufReader<File>>;

/// A picture that [`write_png`] wrote.
fn open(path: &Path) -> io::Result<Reader> {
    let reader = png::Decoder::new(BufReader::new(File::open(path)?)).read_info()?;
    if reader.output_color_type() == (png::ColorType::Rgb, png::BitDepth::Eight) {
        Ok(reader)
    } else {
        Err(io::Error::other("its pixels are not those of this program"))
    }
}

/// Hands `take` the rows of a picture of which each square of so many pixels became their mean.
fn shrink(reader: &mut Reader, one_in: u32, take: &mut dyn FnMut(&[[u8; 3]]) -> io::Result<()>) -> io::Result<()> {
    let (width, height) = (reader.info().width, reader.info().height);
    let [columns, rows] = [width, height].map(|side| side.div_ceil(one_in));
    for row in 0..rows {
        let mut sums = vec![(Vec3::ZERO, 0.0); columns as usize];
        for _ in 0..one_in.min(height - row * one_in) {
            let line = reader.next_row()?.ok_or(io::ErrorKind::UnexpectedEof)?;
            for (pixel, column) in line.data().as_chunks::<3>().0.iter().zip(0..) {
                let (sum, count) = &mut sums[(column / one_in) as usize];
                *sum += Vec3::from(pixel.map(|channel| linear(f32::from(channel) / 255.0)));
                *count += 1.0;
            }
        }
        let mean = |(sum, count): (Vec3, f32)| (sum / count).to_array().map(|c| (srgb(c) * 255.0).round() as u8);
        take(&sums.into_iter().map(mean).collect::<Vec<_>>())?;
    }
    Ok(())
}

/// Most frames on a contact sheet; of more, as many are picked evenly.
const MOST_ON_SHEET: usize = 48;

/// Width of a frame on a contact sheet in pixels, about.
const ON_SHEET: u32 = 240;

/// Pixels between frames on a contact sheet.
const GAP: u32 = 8;

/// Writes a contact sheet of pictures of one size that [`write_png`] wrote: small, in order, row by row.
///
/// # Errors
/// When there is none, one of them cannot be read, or the file not be written.
pub fn write_contact_sheet(path: &Path, pictures: &[PathBuf]) -> Result<(), ReportError> {
    let shown = pictures.len().min(MOST_ON_SHEET);
    let picked = (0..shown).map(|index| &pictures[index * pictures.len() / shown]);
    let mut small: Vec<Vec<Vec<[u8; 3]>>> = Vec::new();
    for file in picked {
        let read = || {
            let mut reader = open(file)?;
            let one_in = reader.info().width.div_ceil(ON_SHEET).max(1);
            let mut rows = Vec::new();
            shrink(&mut reader, one_in, &mut |row| {
                rows.push(row.to_vec());
                Ok(())
            })?;
            Ok(rows)
        };
        small.push(read().map_err(|source| ReportError::read(file, source))?);
    }
    let size = |frame: &Vec<Vec<[u8; 3]>>| (frame.first().map_or(0, Vec::len) as u32, frame.len() as u32);
    let Some((width, height)) = small.first().map(size) else {
        return Err(ReportError::Nothing("a contact sheet of no pictures"));
    };
    // About as wide as high, for pictures that are wider than high.
    let columns = (shown as f64 * f64::from(height) / f64::from(width)).sqrt().ceil().max(1.0) as u32;
    let rows = (shown as u32).div_ceil(columns);
    let whole = [columns * (width + GAP) + GAP, rows * (height + GAP) + GAP];
    let mut bytes = vec![[255; 3]; whole[0] as usize * whole[1] as usize];
    for (index, frame) in (0..).zip(&small) {
        let (left, top) = (GAP + index % columns * (width + GAP), GAP + index / columns * (height + GAP));
        for (y, row) in (top..).zip(frame.iter().take(height as usize)) {
            let begin = (y * whole[0] + left) as usize;
            let own = row.len().min(width as usize);
            bytes[begin..begin + own].copy_from_slice(&row[..own]);
        }
    }
    write_rgb(path, whole[0], whole[1], bytes.as_flattened())
}

/// The error of whoever was written to, as it was: callers look at its kind.
fn unwrapped(error: EncodingError) -> io::Error {
    match error {
        EncodingError::IoError(error) => error,
        error => io::Error::other(error),
    }
}

/// Tone-mapped and encoded as 8-bit sRGB.
fn encode(radiance: Vec3) -> [u8; 3] {
    // Far above any white, and small enough for finite arithmetic; `max` drops NaN.
    let mapped = tone_map(radiance.max(Vec3::ZERO).min(Vec3::splat(1e6)));
    mapped.to_array().map(|channel| (srgb(channel.clamp(0.0, 1.0)) * 255.0).round() as u8)
}

/// Khronos PBR Neutral tone mapper (Khronos Group, specification 2024): leaves colours below the highlights as they
/// are, compresses the brightest channel into the range above, and fades to white as it does.
fn tone_map(color: Vec3) -> Vec3 {
    /// Reflectance of a dielectric seen head-on, which the mapper takes off every colour.
    const FRESNEL: f32 = 0.04;
    const START_COMPRESSION: f32 = 0.8 - FRESNEL;
    const DESATURATION: f32 = 0.15;

    let low = color.min_element();
    let color = color - if low < 2.0 * FRESNEL { low - low * low / (4.0 * FRESNEL) } else { FRESNEL };
    let peak = color.max_element();
    if peak < START_COMPRESSION {
        return color;
    }
    let d = 1.0 - START_COMPRESSION;
    let new_peak = 1.0 - d * d / (peak + d - START_COMPRESSION);
    let white = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    (color * (new_peak / peak)).lerp(Vec3::splat(new_peak), white)
}

/// The sRGB transfer function (IEC 61966-2-1, 1999), of a value in `[0, 1]`.
fn srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Back from the sRGB transfer function.
fn linear(srgb: f32) -> f32 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_is_black_and_everything_odd_has_a_colour() {
        assert_eq!(encode(Vec3::ZERO), [0; 3]);
        assert_eq!(encode(Vec3::NAN), [0; 3]);
        assert_eq!(encode(Vec3::splat(-1.0)), [0; 3]);
        assert_eq!(encode(Vec3::INFINITY), [255; 3]);
    }

    #[test]
    fn brighter_is_never_darker() {
        let mut last = [0; 3];
        for step in 0..2_000 {
            let pixel = encode(Vec3::new(1.0, 0.7, 0.2) * step as f32 * 0.01);
            assert!(pixel.iter().zip(last).all(|(&now, before)| now >= before), "{last:?} then {pixel:?}");
            last = pixel;
        }
    }

    #[test]
    fn a_picture_can_be_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("image.png");
        write_png(&path, [2, 1], &[Vec3::ZERO, Vec3::splat(25.0)], |_| 4.0).unwrap();
        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut pixels = [0; 6];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (2, 1, png::ColorType::Rgb));
        assert_eq!(pixels[..3], [0; 3]);
        assert!(pixels[3..].iter().all(|&channel| channel > 250));
        assert!(write_png(&path, [2, 2], &[Vec3::ZERO], |_| 1.0).is_err());
    }

    /// Mutants: frames on top of each other, out of order, or beyond the sheet.
    #[test]
    fn a_contact_sheet_has_every_frame_in_order() {
        let dir = tempfile::tempdir().unwrap();
        let frame = |grey: u8| {
            let path = dir.path().join(format!("{grey}.png"));
            write_rgb(&path, 4, 3, &[grey; 36]).unwrap();
            path
        };
        let path = dir.path().join("contact.png");
        write_contact_sheet(&path, &[10, 20, 30, 40, 50].map(frame)).unwrap();
        let mut reader = open(&path).unwrap();
        // Two columns of 4 pixels, three rows of 3, and gaps of 8.
        assert_eq!((reader.info().width, reader.info().height), (32, 41));
        let mut bytes = vec![0; 32 * 41 * 3];
        reader.next_frame(&mut bytes).unwrap();
        let at = |x: usize, y: usize| bytes[(y * 32 + x) * 3];
        assert_eq!([at(8, 8), at(20, 8), at(8, 19), at(23, 21), at(11, 32)], [10, 20, 30, 40, 50]);
        assert_eq!([at(7, 8), at(12, 8), at(20, 30)], [255; 3]);
        assert!(write_contact_sheet(&path, &[]).is_err());
        let many: Vec<PathBuf> = (0..100).map(frame).collect();
        write_contact_sheet(&path, &many).unwrap();
    }

    /// Mutants: means of what is encoded; the last row or column, of fewer pixels, lost or darkened; a small picture
    /// scaled.
    #[test]
    fn a_preview_is_the_mean_of_squares() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("image.png");
        // Black and white in turn, and one white pixel beyond the whole squares.
        let bytes: Vec<u8> =
            (0..5 * 3).flat_map(|i| [if i % 5 == 4 || (i + i / 5) % 2 == 0 { 255 } else { 0 }; 3]).collect();
        write_rgb(&path, 5, 3, &bytes).unwrap();
        let whole = preview(&path, 15).unwrap();
        assert_eq!((whole.one_in, whole.png), (1, fs::read(&path).unwrap()));
        let half = preview(&path, 6).unwrap();
        assert_eq!(half.one_in, 2);
        let mut reader = png::Decoder::new(std::io::Cursor::new(half.png)).read_info().unwrap();
        let mut pixels = [0; 18];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (3, 2));
        // Half the light is not half of 255 in sRGB.
        assert!(pixels[0].abs_diff(188) <= 1 && pixels[3].abs_diff(188) <= 1, "{pixels:?}");
        assert_eq!([pixels[6], pixels[15]], [255; 2], "{pixels:?}");
        assert!((0..256).all(|i| (srgb(linear(i as f32 / 255.0)) * 255.0).round() as i32 == i));
    }
}
