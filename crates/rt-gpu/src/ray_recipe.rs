//! Which rays a device is told to make: those of a kernel's that it did not make before.

use rayon::prelude::*;
use rt_bvh::kernel_io::{KernelBounce, KernelCamera};
use rt_core::bounce::Departure;
use rt_core::{BounceRays, CameraRays};
use rt_shaders::Purpose;

/// Least mean length of ranges. A range is two words, so from here on they are a quarter of a list, and kernels search
/// one range for as many items.
const RANGE: usize = 8;

/// Appends a table of a number for each of `items` items: the number of ranges and, for each, its first item and that
/// item's number; or 0 and a number for each item. `ranges` are those, in the order of their items.
pub(crate) fn append_table(words: &mut Vec<u32>, ranges: &[[u32; 2]], items: u32) {
    if ranges.len() * RANGE <= items as usize {
        words.push(ranges.len() as u32);
        words.extend_from_slice(ranges.as_flattened());
        return;
    }
    words.push(0);
    words.reserve(items as usize);
    let ends = ranges.iter().skip(1).map(|range| range[0]).chain([items]);
    words.extend(ranges.iter().zip(ends).flat_map(|(&[item, number], end)| number..number + (end - item)));
}

/// Consecutive rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Row {
    pub ray: u32,
    pub count: u32,
}

/// What a device is told of rays that it is to make: the words that the kernel for `purpose` reads, [`KernelCamera`] or
/// [`KernelBounce`] and behind it tables, pixels or departures.
#[derive(Clone, Debug)]
pub struct RayRecipe {
    purpose: Purpose,
    words: Vec<u32>,
    count: u32,
}

impl RayRecipe {
    /// [`Purpose::Camera`] or [`Purpose::Bounce`].
    #[must_use]
    pub const fn purpose(&self) -> Purpose {
        self.purpose
    }

    /// Read at binding 5.
    #[must_use]
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// How many rays it makes.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// Camera rays, which come at their number less `first` in the window.
    pub(crate) fn camera(block: &KernelCamera, rays: &CameraRays, rows: &[Row], first: u32) -> Self {
        let (count, mut words) = begun(rows, first);
        let mut pixels: Vec<u32> = Vec::new();
        let numbers = ranges(rows, |row| {
            let (begin, end) = (row.ray / rays.samples, (row.ray + row.count).div_ceil(rays.samples));
            // The first sample of the row's first pixel has the number that its place in the list says.
            let number = pixels.len() as u32 * rays.samples + row.ray % rays.samples;
            pixels.extend_from_slice(&rays.pixels[begin as usize..end as usize]);
            number
        });
        let mut block = *block;
        (block.count, block.numbers) = (count, behind_block(&words));
        append_table(&mut words, &numbers, count);
        block.pixels = behind_block(&words);
        words.append(&mut pixels);
        Self { purpose: Purpose::Camera, words: headed(words, &block), count }
    }

    /// Rays that leave surfaces, which come at their number less `first` in the window. `places` says for each slot of
    /// the scene where its triangle is on the device; nothing where that is its own place.
    pub(crate) fn bounce(block: &KernelBounce, rays: &BounceRays, rows: &[Row], first: u32, places: &[u32]) -> Self {
        let (count, mut words) = begun(rows, first);
        let departures = |row: &Row| &rays.departures[row.ray as usize..][..row.count as usize];
        let mut paths: Vec<[u32; 2]> = Vec::new();
        let (mut item, mut next) = (0, None);
        for from in rows.iter().flat_map(departures) {
            if next != Some(from.path) {
                paths.push([item, from.path]);
            }
            (item, next) = (item + 1, from.path.checked_add(1));
        }
        let place = |primitive: u32| {
            let slot = rays.surfaces.slot(primitive)?;
            Some(places.get(slot as usize).copied().unwrap_or(slot))
        };
        let told = |from: &Departure| [from.weights[0], from.weights[1], place(from.primitive).unwrap_or(u32::MAX)];
        let list: Vec<[u32; 3]> = rows.par_iter().flat_map_iter(|row| departures(row).iter().map(told)).collect();
        let mut block = *block;
        (block.count, block.paths) = (count, behind_block(&words));
        append_table(&mut words, &paths, count);
        block.departures = behind_block(&words);
        words.extend_from_slice(list.as_flattened());
        Self { purpose: Purpose::Bounce, words: headed(words, &block), count }
    }
}

/// Words of [`KernelCamera`], and of [`KernelBounce`].
const BLOCK: usize = size_of::<KernelCamera>() / size_of::<u32>();
const _: () = assert!(size_of::<KernelBounce>() == size_of::<KernelCamera>());

/// The number of rays, and the words with room for the block and the table of their places in the window.
fn begun(rows: &[Row], first: u32) -> (u32, Vec<u32>) {
    let count = rows.iter().map(|row| row.count).sum();
    let mut words = vec![0; BLOCK];
    append_table(&mut words, &ranges(rows, |row| row.ray - first), count);
    (count, words)
}

/// Where kernels find what is appended next: they count from the end of the block.
fn behind_block(words: &[u32]) -> u32 {
    (words.len() - BLOCK) as u32
}

/// The words with the block that there is room for.
fn headed(mut words: Vec<u32>, block: &impl bytemuck::NoUninit) -> Vec<u32> {
    bytemuck::cast_slice_mut(&mut words[..BLOCK]).copy_from_slice(bytemuck::bytes_of(block));
    words
}

/// For each row its first item, and that item's number.
fn ranges(rows: &[Row], mut number: impl FnMut(&Row) -> u32) -> Vec<[u32; 2]> {
    let mut item = 0;
    let mut range = |row: &Row| {
        let range = [item, number(row)];
        item += row.count;
        range
    };
    rows.iter().map(&mut range).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_bvh::kernel_io::KernelIo;
    use rt_bvh::{BuildOptions, Mesh, build};
    use rt_core::bounce::{Aim, Scatter, Surfaces};
    use rt_core::{Camera, random};
    use std::sync::Arc;

    /// What kernels make of a table.
    fn named(words: &[u32], table: u32, item: u32) -> u32 {
        let (ranges, rows) = (words[table as usize], &words[table as usize + 1..]);
        let of = |range: &[u32]| range[1] + item - range[0];
        let ranges = rows.chunks_exact(2).take(ranges as usize);
        ranges.take_while(|range| range[0] <= item).last().map_or_else(|| rows[item as usize], of)
    }

    #[test]
    fn tables_of_long_ranges_are_short() {
        let table = |ranges: &[[u32; 2]], items| {
            let mut words = vec![7];
            append_table(&mut words, ranges, items);
            words
        };
        assert_eq!(table(&[[0, 5]], 40), [7, 1, 0, 5]);
        assert_eq!(table(&[[0, 0], [20, 100]], 40), [7, 2, 0, 0, 20, 100]);
        assert_eq!(table(&[[0, 3], [2, 9]], 3), [7, 0, 3, 4, 9]);
        assert_eq!(table(&[], 0), [7, 0]);
    }

    /// Every ray is made of its own pixel and sample, or departure and path, and at its place. Fails when a row's
    /// number does not count the samples of its first pixel that come before, or places are counted from the stream's
    /// start.
    #[test]
    fn orders_name_each_ray_once() {
        let positions = [glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y];
        let mesh = Mesh { positions: &positions, indices: &[[0, 1, 2]] };
        let scene = build(mesh, &BuildOptions::default()).expect("valid").scene;
        let camera = Camera::look_at(glam::Vec3::splat(2.0), glam::Vec3::ZERO, glam::Vec3::Y, 40.0).expect("valid");
        for seed in 0..100 {
            let below = |bound, index| random::below(bound, seed, index, 1);
            let samples = 1 + below(4, 0);
            let pixels: Arc<[u32]> = (0..200).map(|i| i * 3).collect();
            let rays =
                CameraRays { camera, size: [600, 1], pixels, samples, first_sample: 0, all_samples: samples, seed };
            // Rows of 1 to 20 rays, some left out, in any order, behind the window's first ray.
            let first = below(30, 1);
            let (mut rows, mut ray) = (Vec::new(), first);
            while ray < rays.len() - 40 {
                let count = 1 + below(if seed % 2 == 0 { 20 } else { 3 }, ray + 10);
                rows.push(Row { ray, count });
                ray += count + below(2, ray + 1000);
            }
            rows.rotate_left(3);
            let all: Vec<u32> = rows.iter().flat_map(|row| row.ray..row.ray + row.count).collect();

            let block = KernelIo::new(&scene).camera(&rays).expect("ordinary");
            let recipe = RayRecipe::camera(&block, &rays, &rows, first);
            let block: KernelCamera = bytemuck::pod_read_unaligned(bytemuck::cast_slice(&recipe.words()[..BLOCK]));
            let words = &recipe.words()[BLOCK..];
            assert_eq!((recipe.count(), block.count as usize), (block.count, all.len()));
            for (item, &ray) in (0..).zip(&all) {
                let number = named(words, block.numbers, item);
                assert_eq!(words[(block.pixels + number / samples) as usize], rays.pixels[(ray / samples) as usize]);
                assert_eq!((number % samples, named(words, 0, item)), (ray % samples, ray - first));
            }

            let departure = |i: u32| Departure { weights: [i, 1], primitive: below(2, i), path: i * (1 + seed % 2) };
            let rays = BounceRays {
                surfaces: Arc::new(Surfaces::new(Arc::clone(&scene))),
                departures: (0..800).map(departure).collect(),
                scatter: Scatter { aim: Aim::Cosine, seed, samples: 1, first_group: 0, bounce: 0 },
            };
            let block = KernelIo::new(&scene).bounce(&rays).expect("ordinary");
            let recipe = RayRecipe::bounce(&block, &rays, &rows, first, &[5]);
            let block: KernelBounce = bytemuck::pod_read_unaligned(bytemuck::cast_slice(&recipe.words()[..BLOCK]));
            let words = &recipe.words()[BLOCK..];
            assert_eq!((recipe.count(), block.count as usize), (block.count, all.len()));
            for (item, &ray) in (0..).zip(&all) {
                let Departure { weights, primitive, path } = rays.departures[ray as usize];
                let told = &words[(block.departures + 3 * item) as usize..][..3];
                assert_eq!(told, [weights[0], weights[1], if primitive == 0 { 5 } else { u32::MAX }]);
                assert_eq!((named(words, block.paths, item), named(words, 0, item)), (path, ray - first));
            }
        }
    }
}
