//! Has the device make the rays of a stream, each when it is first asked for.
//!
//! So a device is told only of the rays that it traces, and neither it nor the others wait for rays to be made that are
//! traced later, or elsewhere.

use crate::order::{Order, Row};
use crate::{Board, Work};
use rt_bvh::offload::{KernelBounce, KernelCamera, Offload};
use rt_core::{RayMask, RaySource};
use rt_shaders::Purpose;

/// What is known of a stream whose rays the device makes.
#[derive(Debug)]
pub(crate) struct Maker {
    block: Block,
    made: RayMask,
}

#[derive(Debug)]
enum Block {
    Camera(KernelCamera),
    Bounce(KernelBounce),
}

impl Maker {
    /// `None` where the host must prepare the rays.
    pub(crate) fn new(board: &mut impl Board, offload: &Offload<'_>, source: &RaySource) -> Option<Self> {
        let block = match source {
            RaySource::Camera(rays) if board.makes(Purpose::Camera) => Block::Camera(offload.camera(rays)?),
            RaySource::Bounce(rays) if board.makes(Purpose::Bounce) => Block::Bounce(offload.bounce(rays)?),
            _ => return None,
        };
        Some(Self { block, made: RayMask::new(source.len()) })
    }

    /// What the device is to make before it traces `work`, whose window begins with ray number `first`; `None` if nothing.
    /// `places` are those of the scene's triangles on the device.
    pub(crate) fn order<'a>(
        &self,
        source: &RaySource,
        work: &Work,
        first: u32,
        places: impl FnOnce() -> &'a [u32],
    ) -> Option<Order> {
        let rows = self.missing(work);
        match (&self.block, source) {
            _ if rows.is_empty() => None,
            (Block::Camera(block), RaySource::Camera(rays)) => Some(Order::camera(block, rays, &rows, first)),
            (Block::Bounce(block), RaySource::Bounce(rays)) => Some(Order::bounce(block, rays, &rows, first, places())),
            _ => None,
        }
    }

    /// Takes note that the rays of `work` are made.
    pub(crate) fn note(&mut self, work: &Work) {
        work.rows().for_each(|row| self.made.insert_all(row.ray..row.ray + row.count));
    }

    /// The work's rays that are not made, in rows as long as can be, in order.
    fn missing(&self, work: &Work) -> Vec<Row> {
        let mut rows = Vec::new();
        for Row { ray, count } in work.rows() {
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
