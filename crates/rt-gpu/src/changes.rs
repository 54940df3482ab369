//! What of a scene on a device is to be written anew when its triangles have moved.
//!
//! Ids, slots and what the kernels are stay. Nodes, triangles and the box are compared with those that are there, run
//! by run: where only a part of the scene moves, only that crosses the bus.

use crate::{GpuScene, SceneImage};
use bytemuck::{NoUninit, bytes_of, cast_slice};
use rayon::iter::{IndexedParallelIterator, ParallelIterator};
use rayon::slice::ParallelSlice;

/// A buffer of a scene that changes when its triangles move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SceneBuffer {
    /// The two-wide tree: [`SceneImage::buffers`], 0.
    Tree,
    /// The triangles: 1.
    Triangles,
    /// The box: 3.
    Box,
    /// The wide tree: [`SceneImage::wide`].
    Wide,
}

/// Bytes that are to replace those of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change<'a> {
    /// The buffer.
    pub buffer: SceneBuffer,
    /// Where in it, in bytes: a multiple of 4, as is their number.
    pub offset: u64,
    /// What is to be there.
    pub bytes: &'a [u8],
}

/// Elements that are written together if one of them has changed: some tens of kilobytes, since each write costs too.
const RUN: usize = 1 << 9;

/// What is to be written where `before` is on the device and `image` is that of the same scene when it has moved.
pub(crate) fn changes<'a>(before: &GpuScene, image: &'a SceneImage<'_>) -> Vec<Change<'a>> {
    let (nodes, wide, triangles, frame) = image.moving();
    let (given, slots) = (before.given(), before.slots());
    let known = before.shape().map_or(&[][..], |shape| shape.nodes());
    let slot = |place: usize| slots.get(place).map_or(place, |&slot| slot as usize);
    let mut changes = vec![Change { buffer: SceneBuffer::Box, offset: 0, bytes: bytes_of(frame) }];
    // Where nodes lead is what it was.
    changes.extend(differing(SceneBuffer::Tree, nodes, |index, node| {
        cast_slice::<_, u8>(&node.bounds) == cast_slice(&given.nodes()[index].bounds)
    }));
    changes.extend(differing(SceneBuffer::Wide, wide, |index, node| *node == known[index]));
    changes.extend(differing(SceneBuffer::Triangles, triangles, |place, triangle| {
        bytes_of(triangle) == bytes_of(&given.triangles()[slot(place)])
    }));
    changes
}

/// Runs of elements of which one has changed; neighbours together.
fn differing<T: NoUninit + Sync>(
    buffer: SceneBuffer,
    all: &[T],
    is_same: impl Fn(usize, &T) -> bool + Sync,
) -> Vec<Change<'_>> {
    let changed: Vec<bool> = all
        .par_chunks(RUN)
        .enumerate()
        .map(|(run, elements)| !elements.iter().enumerate().all(|(i, element)| is_same(run * RUN + i, element)))
        .collect();
    let mut found = Vec::new();
    let mut run = 0;
    for group in changed.chunk_by(|a, b| a == b) {
        let elements = &all[run * RUN..((run + group.len()) * RUN).min(all.len())];
        if group[0] {
            let offset = (run * RUN * size_of::<T>()) as u64;
            found.push(Change { buffer, offset, bytes: cast_slice(elements) });
        }
        run += group.len();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Layouts;
    use glam::Vec3;
    use rt_bvh::{BuildOptions, Mesh, build, refit};
    use rt_core::Scene;
    use std::sync::Arc;

    const SIDE: u32 = 100;

    /// A sheet of which the part with x beyond `from` is `up`.
    fn positions(from: u32, up: f32) -> Vec<Vec3> {
        let point = |i: u32| {
            let (x, y) = (i % SIDE, i / SIDE);
            let waves = 0.1 * ((x * 7 + y * 3) % 11) as f32;
            Vec3::new(x as f32, y as f32, if x >= from { waves + up } else { waves })
        };
        (0..SIDE * SIDE).map(point).collect()
    }

    fn faces() -> Vec<[u32; 3]> {
        let corners = (0..SIDE * SIDE).filter(|i| i % SIDE < SIDE - 1 && i / SIDE < SIDE - 1);
        corners.flat_map(|i| [[i, i + 1, i + SIDE], [i + 1, i + SIDE + 1, i + SIDE]]).collect()
    }

    fn buffers(image: &SceneImage<'_>) -> [Vec<u8>; 4] {
        let [tree, triangles, _, frame] = image.buffers().map(|(_, bytes)| bytes.to_vec());
        [tree, triangles, frame, image.wide().1.to_vec()]
    }

    /// Mutants: a buffer, or its last run, left out; triangles compared in the given scene's order; everything written.
    #[test]
    fn what_has_changed_is_written_and_nothing_else_is() {
        let (faces, options) = (faces(), BuildOptions::default());
        let given = |positions: &[Vec3]| build(Mesh { positions, indices: &faces }, &options).expect("a sheet").scene;
        let scene = given(&positions(0, 0.0));
        let moved = |from: u32, up: f32| -> Arc<Scene> {
            let mesh = Mesh { positions: &positions(from, up), indices: &faces };
            refit(&scene, mesh, &options).expect("a sheet").expect("the same triangles")
        };
        for layouts in [Layouts::default(), Layouts::USUAL] {
            let mut held = GpuScene::new(Arc::clone(&scene), layouts);
            let mut on_device = buffers(&held.image());
            let all: usize = on_device.iter().map(Vec::len).sum();
            held = held.settled();
            let mut written = Vec::new();
            // Nothing, a strip at the end, the same again, all of it, and back.
            for (from, up) in [(SIDE, 0.0), (SIDE - 10, 0.5), (SIDE - 10, 0.5), (0, 40.0), (0, 0.0)] {
                let after = held.moved(moved(from, up)).expect("the same tree");
                let image = after.image();
                let changes = changes(&held, &image);
                for Change { buffer, offset, bytes } in &changes {
                    let to = match buffer {
                        SceneBuffer::Tree => 0,
                        SceneBuffer::Triangles => 1,
                        SceneBuffer::Box => 2,
                        SceneBuffer::Wide => 3,
                    };
                    on_device[to][*offset as usize..][..bytes.len()].copy_from_slice(bytes);
                }
                assert!(on_device == buffers(&image), "from {from} up by {up}");
                written.push(changes.iter().map(|change| change.bytes.len()).sum::<usize>());
                held = after.settled();
            }
            assert_eq!((written[0], written[2]), (32, 32), "the box alone");
            assert!(written[1] > 32 && written[1] < all / 2, "{written:?} of {all}");
            assert!(written[3] > all / 2 && written[3] <= all, "{written:?} of {all}");
        }
        let other = given(&positions(0, 0.0));
        assert!(GpuScene::new(scene, Layouts::USUAL).settled().moved(other).is_none());
    }
}
