//! Has the device make the rays of a stream, each when it is first asked for.
//!
//! So a device is told only of the rays that it traces, and neither it nor the others wait for rays to be made that are
//! traced later, or elsewhere.

use crate::ray_recipe::{RayRecipe, Row};
use crate::{GpuApi, RayList};
use rt_bvh::kernel_io::{KernelBounce, KernelCamera, KernelIo};
use rt_core::{RayMask, RaySource};
use rt_shaders::Purpose;

/// What is known of a stream whose rays the device makes.
#[derive(Debug)]
pub(crate) struct RayGeneration {
    block: Block,
    made: RayMask,
}

#[derive(Debug)]
enum Block {
    Camera(KernelCamera),
    Bounce(KernelBounce),
}

impl RayGeneration {
    /// `None` where the host must prepare the rays.
    pub(crate) fn new(api: &mut impl GpuApi, io: &KernelIo<'_>, source: &RaySource) -> Option<Self> {
        let block = match source {
            RaySource::Camera(rays) if api.makes(Purpose::Camera) => Block::Camera(io.camera(rays)?),
            RaySource::Bounce(rays) if api.makes(Purpose::Bounce) => Block::Bounce(io.bounce(rays)?),
            _ => return None,
        };
        Some(Self { block, made: RayMask::new(source.len()) })
    }

    /// What the device is to make before it traces `list`, whose window begins with ray number `first`; `None` if
    /// nothing. `places` are those of the scene's triangles on the device.
    pub(crate) fn recipe<'a>(
        &self,
        source: &RaySource,
        list: &RayList,
        first: u32,
        places: impl FnOnce() -> &'a [u32],
    ) -> Option<RayRecipe> {
        let rows = self.missing(list);
        match (&self.block, source) {
            _ if rows.is_empty() => None,
            (Block::Camera(block), RaySource::Camera(rays)) => Some(RayRecipe::camera(block, rays, &rows, first)),
            (Block::Bounce(block), RaySource::Bounce(rays)) => {
                Some(RayRecipe::bounce(block, rays, &rows, first, places()))
            }
            _ => None,
        }
    }

    /// Takes note that the rays of `list` are made.
    pub(crate) fn note(&mut self, list: &RayList) {
        list.rows().for_each(|row| self.made.insert_all(row.ray..row.ray + row.count));
    }

    /// The list's rays that are not made, in rows as long as can be, in order.
    fn missing(&self, list: &RayList) -> Vec<Row> {
        let mut rows = Vec::new();
        for Row { ray, count } in list.rows() {
            if self.made.count_in(ray..ray + count) == 0 {
                rows.push(Row { ray, count });
            } else {
                let rest = (ray..ray + count).filter(|&ray| !self.made.contains(ray));
                rows.extend(rest.map(|ray| Row { ray, count: 1 }));
            }
        }
        rows.sort_unstable_by_key(|row| row.ray);
        rows.dedup_by(|next, row| {
            // A walk may name a ray twice.
            let joins = next.ray <= row.ray + row.count;
            if joins {
                row.count = row.count.max(next.ray + next.count - row.ray);
            }
            joins
        });
        rows
    }
}
