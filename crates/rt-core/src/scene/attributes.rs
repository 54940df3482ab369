//! What a scene knows of its primitives beside where they are.
//!
//! It lies beside the tree, and no kernel reads it unless a stream's mask hides something: so scenes without masks, and
//! streams that see all of a scene, cost what they always did.

use super::{Scene, SceneError};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::Range;

/// Masks, and the geometries that primitives belong to.
#[derive(Clone, Debug, Default)]
pub(super) struct Attributes {
    masks: Option<Arc<Masks>>,
    /// First primitive of each geometry; none where all belong to one.
    firsts: Arc<[u32]>,
}

/// The masks of primitives.
#[derive(Debug)]
struct Masks {
    /// Of each.
    of: Vec<u32>,
    /// Which there are: few.
    distinct: Vec<u32>,
}

impl Scene {
    /// The same scene with a mask for each primitive, by its id: rays pass by a primitive whose mask has none of the
    /// bits of their own ([`StreamSpec::mask`](crate::StreamSpec::mask)). Without masks every primitive has all bits.
    ///
    /// # Errors
    /// [`SceneError::MaskCount`] where there are not as many masks as [`Scene::primitive_count`].
    pub fn with_masks(mut self, masks: Vec<u32>) -> Result<Self, SceneError> {
        if masks.len() != self.primitive_count as usize {
            return Err(SceneError::MaskCount { masks: masks.len(), primitives: self.primitive_count });
        }
        let mut distinct = masks.clone();
        distinct.sort_unstable();
        distinct.dedup();
        distinct.shrink_to_fit();
        self.attributes.masks = Some(Arc::new(Masks { of: masks, distinct }));
        Ok(self)
    }

    /// The masks of primitives by their ids; `None` where all have all bits.
    #[must_use]
    pub fn masks(&self) -> Option<&[u32]> {
        self.attributes.masks.as_ref().map(|masks| &masks.of[..])
    }

    /// Whether rays of this mask pass by some primitive for its mask.
    #[inline]
    #[must_use]
    pub fn hides(&self, mask: u32) -> bool {
        self.attributes.masks.as_ref().map_or(mask == 0, |masks| masks.distinct.iter().any(|other| other & mask == 0))
    }

    /// Whether rays of this mask may hit a primitive.
    #[inline]
    #[must_use]
    pub fn shows(&self, primitive: u32, mask: u32) -> bool {
        let masks = self.attributes.masks.as_ref();
        mask & masks.map_or(u32::MAX, |masks| masks.of.get(primitive as usize).copied().unwrap_or(u32::MAX)) != 0
    }

    /// The same scene made of several geometries, whose primitives follow each other: `firsts` are the ids of the first
    /// of each, from 0 on. A geometry may have none.
    ///
    /// # Errors
    /// [`SceneError::Geometries`] where the first is not 0, they are not in order, or one is beyond
    /// [`Scene::primitive_count`].
    pub fn with_geometries(mut self, firsts: Vec<u32>) -> Result<Self, SceneError> {
        let mut last = 0;
        for (geometry, &first) in firsts.iter().enumerate() {
            if first < last || first > self.primitive_count || geometry == 0 && first != 0 {
                return Err(SceneError::Geometries { geometry });
            }
            last = first;
        }
        self.attributes.firsts = firsts.into();
        Ok(self)
    }

    /// The primitives of each geometry; those of all, where none were told apart.
    #[must_use]
    pub fn geometries(&self) -> impl ExactSizeIterator<Item = Range<u32>> {
        let firsts = &*self.attributes.firsts;
        (0..firsts.len().max(1)).map(move |geometry| {
            let at = |geometry: usize| firsts.get(geometry).copied();
            at(geometry).unwrap_or(0)..at(geometry + 1).unwrap_or(self.primitive_count)
        })
    }

    /// Which geometry a primitive belongs to, and its number there; `None` beyond the last primitive, so of a miss.
    #[must_use]
    pub fn geometry_of(&self, primitive: u32) -> Option<(u32, u32)> {
        if primitive >= self.primitive_count {
            return None;
        }
        let firsts = &*self.attributes.firsts;
        // Of several that begin there, all but the last have no primitive.
        let geometry = firsts.partition_point(|&first| first <= primitive).saturating_sub(1);
        Some((geometry as u32, primitive - firsts.get(geometry).copied().unwrap_or(0)))
    }

    /// The same scene with the masks and geometries of another one of as many primitives.
    ///
    /// # Errors
    /// [`SceneError::MaskCount`] or [`SceneError::Geometries`] where that has some for another number of primitives.
    pub fn with_attributes_of(mut self, other: &Self) -> Result<Self, SceneError> {
        let Attributes { masks, firsts } = &other.attributes;
        if self.primitive_count != other.primitive_count {
            if masks.is_some() {
                return Err(SceneError::MaskCount {
                    masks: other.primitive_count as usize,
                    primitives: self.primitive_count,
                });
            }
            if let Some(geometry) = firsts.len().checked_sub(1) {
                return Err(SceneError::Geometries { geometry });
            }
        }
        self.attributes = other.attributes.clone();
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SceneParts;
    use crate::{Node, arguments};
    use alloc::vec;

    /// A scene of so many primitives, none of which has an area.
    fn scene(primitive_count: u32) -> Scene {
        let nodes = vec![Node::EMPTY];
        Scene::new(SceneParts { nodes, primitive_count, ..SceneParts::default() }).expect("valid")
    }

    /// Mutants: the first geometry that begins at a primitive instead of the last; a geometry for a miss; the number in
    /// the scene instead of that in the geometry.
    #[test]
    fn a_primitive_belongs_to_the_geometry_that_has_it() {
        let plain = scene(7);
        assert_eq!((plain.geometries().next(), plain.geometries().len()), (Some(0..7), 1));
        assert_eq!([0, 6, 7, u32::MAX].map(|id| plain.geometry_of(id)), [Some((0, 0)), Some((0, 6)), None, None]);
        let several = scene(7).with_geometries(vec![0, 0, 2, 2, 5, 7]).expect("valid");
        assert_eq!(several.geometries().collect::<Vec<_>>(), [0..0, 0..2, 2..2, 2..5, 5..7, 7..7]);
        for (geometry, range) in several.geometries().enumerate() {
            for (number, id) in range.enumerate() {
                assert_eq!(several.geometry_of(id), Some((geometry as u32, number as u32)));
            }
        }
        assert_eq!(several.geometry_of(7), None);
        for (firsts, geometry) in [(vec![1], 0), (vec![0, 3, 2], 2), (vec![0, 8], 1)] {
            assert_eq!(scene(7).with_geometries(firsts).err(), Some(SceneError::Geometries { geometry }));
        }
        assert_eq!(scene(0).with_geometries(vec![0, 0]).expect("valid").geometries().len(), 2);
    }

    /// Mutants: a scene without masks in which mask 0 sees something; bits that must all be there instead of one; a
    /// device without masks refused where nothing is hidden.
    #[test]
    fn masks_hide_what_shares_no_bit_with_a_ray() {
        let plain = scene(3);
        assert!(plain.hides(0) && !plain.hides(1) && !plain.hides(u32::MAX) && plain.shows(2, 4) && !plain.shows(2, 0));
        let masked = scene(3).with_masks(vec![0b001, 0b011, 0b110]).expect("valid");
        assert_eq!(
            [0b001, 0b010, 0b100, 0b101, 0b111].map(|mask| masked.hides(mask)),
            [true, true, true, false, false]
        );
        for (mask, shown) in [(0b001, [true, true, false]), (0b100, [false, false, true]), (0b010, [false, true, true])]
        {
            assert_eq!([0, 1, 2].map(|id| masked.shows(id, mask)), shown, "{mask:b}");
        }
        assert!(scene(2).with_masks(vec![0, 1]).expect("valid").hides(u32::MAX));
        assert_eq!(scene(3).with_masks(vec![1]).err(), Some(SceneError::MaskCount { masks: 1, primitives: 3 }));

        let (unable, able) = (crate::Capabilities::UNKNOWN, crate::Capabilities::UNKNOWN.with_masks());
        let spec = |mask| crate::StreamSpec { mask, ..crate::StreamSpec::default() };
        let check = |capabilities, mask| arguments::check_spec(capabilities, &masked, spec(mask));
        assert!(check(&unable, 0b111).is_ok() && check(&able, 0b001).is_ok());
        let refused = check(&unable, 0b001).expect_err("primitive 2 is hidden");
        assert_eq!(refused.kind(), crate::DeviceErrorKind::Unsupported);
        assert!(alloc::format!("{refused}").contains("choose a CPU device"), "{refused}");
    }

    /// Mutants: attributes lost, or taken over for other primitives.
    #[test]
    fn attributes_go_to_scenes_of_as_many_primitives() {
        let masked = scene(3).with_masks(vec![1, 2, 3]).expect("valid").with_geometries(vec![0, 1]).expect("valid");
        let other = scene(3).with_attributes_of(&masked).expect("as many");
        assert_eq!((other.masks(), other.geometry_of(2)), (Some(&[1, 2, 3][..]), Some((1, 1))));
        let fewer = scene(2).with_attributes_of(&masked).err();
        assert_eq!(fewer, Some(SceneError::MaskCount { masks: 3, primitives: 2 }));
        let parts = scene(3).with_geometries(vec![0, 1]).expect("valid");
        assert_eq!(scene(2).with_attributes_of(&parts).err(), Some(SceneError::Geometries { geometry: 1 }));
        assert!(scene(2).with_attributes_of(&scene(3)).is_ok(), "there is nothing to lose");
    }
}
