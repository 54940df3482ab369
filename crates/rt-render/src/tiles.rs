//! Pictures dealt to several processes: each renders tiles, and one gathers their pixels.
//!
//! A tile is a part of the Z-curve through the picture, with all samples and bounces of its pixels. So rays that follow
//! from others stay where those are, only pixels travel, and a pixel's sum is added up in one place, in the order it
//! always has: the picture is the same bits however many processes there are. Samples of one pixel are never split,
//! since sums of floats depend on their order.

use crate::{Film, Part, RenderError, Renderer, Session};
use glam::Vec3;
use rt_cluster::Job;
use rt_core::Scene;
use rt_scene::streams::{PathStream, Paths, Samples, Wave, Waves};
use std::hash::{DefaultHasher, Hash, Hasher};

/// Tiles of each process, where the picture is large enough: the most expensive come first, so what is left over in the
/// end is a small part of one.
const PER_RANK: u64 = 64;

/// Least paths of a tile: each is some streams of its own, and what a stream costs beside its rays should not count.
const LEAST_PATHS: u64 = 1 << 12;

/// Paths of a tile that are walked for its price.
const SAMPLES: u64 = 16;

/// What making a ray and shading its hit costs, in box and triangle tests.
const TESTS_PER_RAY: u64 = 16;

/// Cuts a picture into tiles for `ranks` processes, none larger than a wave.
#[must_use]
pub fn cut(waves: Waves, samples: u32, ranks: u32) -> Waves {
    let paths = waves.pixels() * u64::from(samples.max(1));
    waves.split(count(paths, ranks))
}

/// Into how many tiles so many paths are cut for `ranks` processes; 0 where they are fewer than a tile has.
#[must_use]
pub fn count(paths: u64, ranks: u32) -> u64 {
    (PER_RANK * u64::from(ranks)).min(paths / LEAST_PATHS)
}

/// The tiles of one frame, as a process renders them.
#[derive(Debug)]
pub struct FrameTiles<'a, 's> {
    /// What stays the same over all frames.
    pub renderer: &'a Renderer<'a>,
    /// The devices of this process.
    pub session: &'a mut Session<'s>,
    /// The paths of the frame.
    pub paths: &'a Paths,
    /// Number of the frame.
    pub frame: u32,
    /// The cut.
    pub tiles: Waves,
}

impl Job for FrameTiles<'_, '_> {
    type Error = RenderError;

    fn price(&mut self, tile: u32) -> f32 {
        price(self.renderer, self.paths, &self.tiles.wave(tile.into()))
    }

    fn compute(&mut self, tile: u32) -> Result<Vec<u8>, RenderError> {
        let wave = self.tiles.wave(tile.into());
        let samples = Samples::all(self.paths.samples);
        let part = Part { paths: self.paths, frame: self.frame, number: tile, wave: &wave, samples };
        let mut sums = vec![Vec3::ZERO; wave.pixels.len()];
        self.renderer.part(self.session, part, &mut sums)?;
        Ok(pack(&sums))
    }
}

/// Of a scene's tree, triangles and colours. Takes linear time.
///
/// Like [`fingerprint`] it is made by the standard library's hash, and so differs between programs of different
/// compilers, too.
#[must_use]
pub fn fingerprint_of_scene(renderer: &Renderer<'_>) -> u64 {
    let mut hash = DefaultHasher::new();
    let scene = renderer.surfaces.scene();
    hash_tree(scene, &mut hash);
    for primitive in 0..scene.primitive_count() {
        hash.write(bytemuck::bytes_of(&renderer.colours.of(primitive)));
    }
    hash.finish()
}

/// Adds what decides hits: a scene's tree, its triangles and their ids.
pub fn hash_tree(scene: &Scene, hash: &mut impl Hasher) {
    hash.write(bytemuck::cast_slice(scene.nodes()));
    hash.write(bytemuck::cast_slice(scene.triangles()));
    for slot in 0..scene.primitives().len() {
        hash.write_u32(scene.primitives().get(slot));
    }
}

/// Of everything that decides what the pixels of a tile are, the scene's fingerprint among it: processes whose numbers
/// differ render different pictures.
#[must_use]
pub fn fingerprint(scene: u64, renderer: &Renderer<'_>, paths: &Paths, tiles: &Waves) -> u64 {
    hashed(&format!("{} {}", described(scene, renderer, paths), tiles.count()))
}

/// Of everything that decides what a frame's picture is, however it is cut and whoever renders it.
pub(crate) fn fingerprint_of_picture(scene: u64, renderer: &Renderer<'_>, paths: &Paths, exposure: f32) -> u64 {
    hashed(&format!("{} {exposure:?}", described(scene, renderer, paths)))
}

/// What decides what pixels are; floats are written so that they can be read back to the bit.
fn described(scene: u64, renderer: &Renderer<'_>, paths: &Paths) -> String {
    let Paths { camera, size, samples, seed, sun, .. } = paths;
    let Renderer { bounces, precision, light, wind, .. } = renderer;
    let version = env!("CARGO_PKG_VERSION");
    format!("{version} {scene} {wind:?} {camera:?} {size:?} {samples} {seed} {sun:?} {bounces} {precision:?} {light:?}")
}

fn hashed(text: &str) -> u64 {
    let mut hash = DefaultHasher::new();
    text.hash(&mut hash);
    hash.finish()
}

/// Tests of a few paths of a tile, with what else their rays cost, for all of its paths.
fn price(renderer: &Renderer<'_>, paths: &Paths, wave: &Wave) -> f32 {
    let _environment = rt_fenv::Environment::enter();
    let pixels = wave.pixels.len() as u64;
    let count = SAMPLES.min(pixels);
    let picked = (0..count).map(|sample| wave.pixels[((2 * sample + 1) * pixels / (2 * count)) as usize]).collect();
    // Their random numbers are not those of the picture, but as good for this.
    let picked = Wave { first: wave.first, pixels: picked };
    let paths = Paths { samples: 1, ..paths.clone() };
    let mut tests = 0_u64;
    let mut trace = |stream: &PathStream| {
        renderer.walk(stream, |counts| {
            tests += u64::from(counts.boxes) + u64::from(counts.triangles) + TESTS_PER_RAY;
        })
    };
    let mut front = paths.primary(&picked);
    for bounce in 0..=renderer.bounces {
        let hits = trace(&front);
        if bounce == renderer.bounces {
            trace(&paths.end(&front, &hits));
            break;
        }
        let [shadow, diffuse] = paths.follow(&front, &hits);
        trace(&shadow);
        front = diffuse;
    }
    tests as f32 * pixels as f32 / count.max(1) as f32
}

/// The sums of a tile's pixels as bytes.
fn pack(sums: &[Vec3]) -> Vec<u8> {
    sums.iter().flat_map(|sum| sum.to_array()).flat_map(f32::to_le_bytes).collect()
}

/// The sums of a tile's pixels.
///
/// # Errors
/// When these are not the bytes of `pixels` pixels.
pub fn unpack(tile: u32, pixels: usize, bytes: &[u8]) -> Result<Vec<Vec3>, RenderError> {
    let expected = pixels * Film::BYTES_PER_PIXEL as usize;
    if bytes.len() != expected {
        return Err(RenderError::Tile { tile, found: bytes.len(), expected });
    }
    let floats = bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect::<Vec<_>>();
    Ok(floats.as_chunks::<3>().0.iter().map(|sum| Vec3::from_array(*sum)).collect())
}
