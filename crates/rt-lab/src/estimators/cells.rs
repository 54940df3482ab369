//! The cells of a cost field: hash tables of fixed size, coarse to fine.

use glam::Vec3;
use rt_core::Ray;

/// Where a ray starts and where it goes, as the map sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heading {
    /// Where it starts; for rays of one camera, which start at one point, where it goes.
    position: Vec3,
    /// Direction in octahedral coordinates (Z. Cigolle and others, *Survey of Efficient Representations for
    /// Independent Unit Vectors*, 2014), each in 0 ..= 255; 0 where the position says it already.
    direction: [u8; 2],
}

impl Heading {
    pub(super) fn of(ray: &Ray, coherent: bool) -> Self {
        let d = ray.direction;
        let flat = d / (d.x.abs() + d.y.abs() + d.z.abs()).max(f32::MIN_POSITIVE);
        if coherent {
            return Self { position: flat, direction: [0; 2] };
        }
        let folded = if flat.z >= 0.0 {
            [flat.x, flat.y]
        } else {
            [(1.0_f32 - flat.y.abs()).copysign(flat.x), (1.0_f32 - flat.x.abs()).copysign(flat.y)]
        };
        // Conversions saturate; NaN is 0.
        Self { position: ray.origin, direction: folded.map(|x| (x * 127.5 + 127.5) as u8) }
    }
}

/// A cell of the finest level; those of all others follow from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    position: [i32; 3],
    direction: [u8; 2],
}

/// How a level divides space: halvings of the longest side of the box around the first stream's rays, and of each
/// octahedral coordinate.
#[derive(Clone, Copy, Debug)]
struct Resolution {
    position: u32,
    direction: u32,
}

/// Coarse to fine: each level has about as many cells as a megapixel at one sample in 64 has samples, or fewer.
const RESOLUTIONS: [Resolution; Cells::LEVELS] = [
    Resolution { position: 4, direction: 0 },
    Resolution { position: 4, direction: 2 },
    Resolution { position: 6, direction: 0 },
    Resolution { position: FINEST, direction: 0 },
];

/// Halvings of the level that divides space most.
const FINEST: u32 = 7;

/// Cells of a level, a power of two: 512 kB a level, which the second-level cache of a processor core holds.
const CAPACITY: usize = 1 << 15;

/// Neighbouring slots that are tried before a cell is given up: with the tables at most half full, one in a hundred
/// cells is.
const PROBES: usize = 4;

/// Share of its weight that a sample keeps from stream to stream: the scene stays, but cameras and lights move.
pub(super) const KEPT: f32 = 0.5;

/// Samples below this weight are forgotten, and their cells free: four streams ago.
const FORGOTTEN: f32 = 0.1;

/// A cell's mean is believed half when this many samples were seen there. Means of one or two diffuse rays are mostly
/// noise.
const PRIOR: f32 = 2.0;

/// A cell: residuals of rays that were seen there. 16 bytes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cell {
    /// Which cell it is; 0: none.
    key: u32,
    weight: f32,
    sum: [f32; 2],
}

impl Cell {
    pub(super) fn mean(&self) -> [f32; 2] {
        self.sum.map(|sum| sum / (self.weight + PRIOR))
    }

    /// The mean without some of its samples, given as their number and sum.
    pub(super) fn mean_without(&self, (number, sum): (f32, [f32; 2])) -> [f32; 2] {
        let weight = (self.weight - number).max(0.0) + PRIOR;
        [(self.sum[0] - sum[0]) / weight, (self.sum[1] - sum[1]) / weight]
    }
}

/// All levels.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    corner: Vec3,
    /// One over the longest side of the box.
    scale: f32,
    levels: [Vec<Cell>; Self::LEVELS],
}

impl Cells {
    pub(super) const LEVELS: usize = 4;

    /// Empty cells sized for these rays. Later ones may lie outside.
    pub(super) fn around(headings: &[Heading]) -> Self {
        let finite = headings.iter().map(|heading| heading.position).filter(|p| p.is_finite());
        let (min, max) = finite.fold((Vec3::MAX, Vec3::MIN), |(min, max), p| (min.min(p), max.max(p)));
        let side = (max - min).max_element();
        let scale = if side > 0.0 && side.is_finite() && (1.0 / side).is_finite() { 1.0 / side } else { 0.0 };
        let corner = if scale > 0.0 { min } else { Vec3::ZERO };
        Self { corner, scale, levels: std::array::from_fn(|_| vec![Cell::default(); CAPACITY]) }
    }

    /// Lets all that was learned count less.
    pub(super) fn fade(&mut self) {
        for cell in self.levels.iter_mut().flatten().filter(|cell| cell.key != 0) {
            cell.weight *= KEPT;
            cell.sum = cell.sum.map(|sum| sum * KEPT);
            if cell.weight < FORGOTTEN {
                *cell = Cell::default();
            }
        }
    }

    /// Where a ray is on the map.
    pub(super) fn place(&self, heading: &Heading) -> Place {
        let cells = (heading.position - self.corner) * (self.scale * (1_u32 << FINEST) as f32);
        // Rounded down. Conversions saturate, so that far places share the outermost cells; NaN is 0.
        let floor = |c: f32| (c as i32).saturating_sub(i32::from((c as i32) as f32 > c));
        Place { position: cells.to_array().map(floor), direction: heading.direction }
    }

    /// The key of the place's cell on a level, never 0.
    fn key(level: usize, place: &Place) -> u32 {
        let Resolution { position, direction } = RESOLUTIONS[level];
        let [x, y, z] = place.position.map(|c| (c >> (FINEST - position)) as u32);
        let [u, v] = place.direction.map(|d| u32::from(d) >> (8 - direction));
        // An odd multiplier for each coordinate, then the finalizer of MurmurHash3 (A. Appleby, 2011).
        let mut hash = x.wrapping_mul(0x9e37_79b1)
            ^ y.wrapping_mul(0x85eb_ca77)
            ^ z.wrapping_mul(0xc2b2_ae3d)
            ^ (u << direction | v).wrapping_mul(0x27d4_eb2f);
        hash = (hash ^ (hash >> 16)).wrapping_mul(0x85eb_ca6b);
        hash = (hash ^ (hash >> 13)).wrapping_mul(0xc2b2_ae35);
        (hash ^ (hash >> 16)).max(1)
    }

    /// Calls `found` with the place's cell on each level that has one.
    pub(super) fn visit(&self, place: &Place, mut found: impl FnMut(&Cell)) {
        for (level, cells) in self.levels.iter().enumerate() {
            let key = Self::key(level, place);
            if let Some(cell) = probes(key).map(|slot| &cells[slot]).find(|cell| cell.key == key) {
                found(cell);
            }
        }
    }

    /// Adds a sample's residual to its cell and returns the cell's slot; [`NO_SLOT`] where the table is full around it.
    pub(super) fn add(&mut self, level: usize, place: &Place, residual: [f32; 2]) -> u32 {
        let key = Self::key(level, place);
        let cells = &mut self.levels[level];
        let own = probes(key).find(|&slot| cells[slot].key == key);
        let Some(slot) = own.or_else(|| probes(key).find(|&slot| cells[slot].key == 0)) else { return NO_SLOT };
        let cell = &mut cells[slot];
        cell.key = key;
        cell.weight += 1.0;
        cell.sum = [cell.sum[0] + residual[0], cell.sum[1] + residual[1]];
        slot as u32
    }

    /// The cell of a slot; `None` for [`NO_SLOT`].
    pub(super) fn cell(&self, level: usize, slot: u32) -> Option<&Cell> {
        self.levels[level].get(slot as usize)
    }
}

/// No cell.
pub(super) const NO_SLOT: u32 = u32::MAX;

fn probes(key: u32) -> impl Iterator<Item = usize> {
    (0..PROBES).map(move |probe| (key as usize + probe) % CAPACITY)
}
