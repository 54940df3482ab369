//! The triangles of a scene as its file gave them.

use rt_core::{Scene, Triangle};

/// Triangles with area in the coordinates of the file, in the order of their ids.
#[derive(Debug)]
pub(super) struct Soup {
    pub(super) triangles: Vec<Triangle>,
    ids: Vec<u32>,
    /// Whether ids are positions: every triangle has area.
    is_whole: bool,
}

impl Soup {
    /// Undoes the scaling and the leaf order of a scene.
    pub(super) fn of(scene: &Scene) -> Self {
        let mut order: Vec<usize> = (0..scene.triangles().len()).collect();
        order.sort_by_key(|&slot| scene.primitives().get(slot));
        // In double precision a power of two within the range of any scene is exact, and so is the product with it.
        let scale = 2.0_f64.powi(scene.scale_exponent());
        let given = |&slot: &usize| {
            let [a, b, c] = scene.triangles()[slot].vertices().map(|p| (p.as_dvec3() * scale).as_vec3());
            Triangle::new(a, b, c)
        };
        let triangles = order.iter().map(given).collect();
        let ids: Vec<u32> = order.iter().map(|&slot| scene.primitives().get(slot)).collect();
        let is_whole = ids.last().is_none_or(|&last| last as usize + 1 == ids.len());
        Self { triangles, ids, is_whole }
    }

    /// The id of the triangle at a position of [`Soup::triangles`]; `u32::MAX` beyond them.
    pub(super) fn id(&self, position: u32) -> u32 {
        self.ids.get(position as usize).copied().unwrap_or(u32::MAX)
    }

    /// The position of the triangle with this id; `u32::MAX` if it is not among them.
    pub(super) fn position(&self, id: u32) -> u32 {
        if self.is_whole {
            return if (id as usize) < self.ids.len() { id } else { u32::MAX };
        }
        self.ids.binary_search(&id).map_or(u32::MAX, |position| position as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_verify::{shapes, tree};

    // Guards against: a wrong sign of the exponent, ids of leaf order.
    #[test]
    fn scenes_come_back_bit_for_bit_whatever_their_scale() {
        for exponent in [-100, -7, 0, 3, 100] {
            let mut given: Vec<Triangle> =
                shapes::soup(50, 0.3, 4).iter().map(|t| t.scaled(2.0_f32.powi(exponent))).collect();
            // Without area, so that later ids are not positions.
            given[7].c = given[7].b;
            let scene = tree::build(&given, rt_bvh::Builder::Sah).expect("a good mesh");
            let soup = Soup::of(&scene);
            assert_eq!(soup.triangles.len(), 49);
            assert_eq!((soup.id(6), soup.id(7), soup.id(49)), (6, 8, u32::MAX));
            assert_eq!((soup.position(6), soup.position(7), soup.position(8)), (6, u32::MAX, 7));
            let whole = Soup::of(&tree::build(&given[8..], rt_bvh::Builder::Sah).expect("a good mesh"));
            assert_eq!((whole.id(41), whole.position(41), whole.position(42)), (41, 41, u32::MAX));
            assert!(soup.triangles.iter().enumerate().all(|(i, t)| *t == given[soup.id(i as u32) as usize]));
        }
    }
}
