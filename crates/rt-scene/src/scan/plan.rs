//! How a model is traced, chosen from its numbers, with the reasons.

use super::Scan;
use rt_core::{Precision, Scene};
use serde::{Serialize, Serializer};

/// Share of unresolved triangles from which double precision throughout is the cheaper way.
///
/// While planning, a plain single-precision test was measured as 1, a watertight one as 1.2 and one in double precision
/// as 1.37. A robust test costs the second, and in doubtful cases the third as well: `1.2 + share · 1.37 > 1.37` from a
/// share of 0.12. The share of triangles stands for the share of tests, which no scan can know.
const UNRESOLVED_SHARE: f64 = 0.12;

/// Largest coordinate over extent, without a unit, from which double precision throughout is the cheaper way.
///
/// Beyond 10⁵ single precision leaves the coordinates less than eight binary digits within the extent. Vertices and
/// ray origins then lie on one coarse lattice, so that rays pass exactly through edges as a rule.
const OFFSET_RATIO: f64 = 1e5;

/// The plan of a scene, as written to `report.json` under `scene.plan`.
///
/// Precision is a matter of speed alone: [`Precision::Robust`] gives the same hits as [`Precision::Double`]. Both are
/// those of the file's own numbers, to the rounding that [`Model::offset`](crate::Model::offset) leaves: the numbers
/// that are scanned here are those after it. What only the tree can tell is `None` (null) until [`Plan::complete`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// How rays are tested.
    #[serde(serialize_with = "by_name")]
    pub precision: Precision,
    /// Bits per primitive id: 16 or 32.
    pub id_bits: u32,
    /// Whether triangles differ in colour, so that pictures need to know a hit's material.
    pub materials: bool,
    /// Levels of the tree: always 1, since no format that is read has instances.
    pub levels: u32,
    /// What a hit holds. Normals and texture coordinates are never stored: nothing needs them.
    pub hit_fields: [&'static str; 4],
    /// Why, one sentence for each choice.
    pub reasons: Vec<String>,
    /// Entries of the traversal stack: the depth of the tree.
    pub stack_entries: Option<u32>,
    /// Bytes of all nodes.
    pub node_bytes: Option<u64>,
    /// Bytes of all triangles.
    pub triangle_bytes: Option<u64>,
    /// Bytes of all primitive ids.
    pub id_bytes: Option<u64>,
    /// Bytes of the scene in total: what every device holds.
    pub scene_bytes: Option<u64>,
    /// Bytes of the scene over its number of triangles.
    pub bytes_per_triangle: Option<f64>,
}

impl Plan {
    /// Chooses from what the scan found.
    #[must_use]
    pub fn new(scan: &Scan) -> Self {
        let mut reasons = Vec::new();
        let precision = precision(scan, &mut reasons);
        let (id_bits, than) = if scan.triangles <= 1 << 16 { (16, "no more than") } else { (32, "more than") };
        reasons.push(format!("{id_bits}-bit primitive ids: {than} 65,536 triangles"));
        let materials = scan.colours > 1;
        reasons.push(if materials {
            format!("materials are looked up: {} colours", scan.colours)
        } else {
            "no material lookup: one colour".to_owned()
        });
        reasons.push("one level: nothing is instanced".to_owned());
        let left_out = scan.non_finite + scan.degenerate;
        if left_out > 0 {
            reasons.push(format!(
                "{left_out} triangles can be left out of the tree ({} without area, {} not finite): no ray hits them",
                scan.degenerate, scan.non_finite
            ));
        }
        Self {
            precision,
            id_bits,
            materials,
            levels: 1,
            hit_fields: ["t", "u", "v", "primitive"],
            reasons,
            stack_entries: None,
            node_bytes: None,
            triangle_bytes: None,
            id_bytes: None,
            scene_bytes: None,
            bytes_per_triangle: None,
        }
    }

    /// Fills in what the finished tree tells.
    pub fn complete(&mut self, scene: &Scene) {
        let (ids, triangles) = (scene.primitives(), scene.triangles().len());
        let id_bytes = ids.len() as u64 * u64::from(ids.bits() / 8);
        let node_bytes = size_of_val(scene.nodes()) as u64;
        self.id_bits = ids.bits();
        self.stack_entries = Some(scene.depth());
        self.node_bytes = Some(node_bytes);
        self.id_bytes = Some(id_bytes);
        self.triangle_bytes = Some(size_of_val(scene.triangles()) as u64);
        self.scene_bytes = Some(scene.bytes());
        self.bytes_per_triangle = (triangles > 0).then(|| scene.bytes() as f64 / triangles as f64);
    }
}

/// Chooses the precision and says why.
fn precision(scan: &Scan, reasons: &mut Vec<String>) -> Precision {
    let share = scan.unresolved as f64 / scan.valid().max(1) as f64;
    if share >= UNRESOLVED_SHARE {
        reasons.push(format!(
            "double precision: {:.0}% of the triangles are too thin for single precision to decide anything about, \
             so trying it first would only cost time (hits would be the same)",
            100.0 * share
        ));
        return Precision::Double;
    }
    if let Some(ratio) = scan.offset_ratio.filter(|&ratio| ratio > OFFSET_RATIO) {
        reasons.push(format!(
            "double precision: coordinates, which single precision holds, are {ratio:.1e} times the extent, so rays pass \
             exactly through edges as a rule, and trying single precision first would only cost time (hits would be the same)"
        ));
        return Precision::Double;
    }
    reasons.push(match scan.slivers {
        0 => "robust precision: single precision decides, double and exact arithmetic where it cannot".to_owned(),
        n => format!(
            "robust precision: single precision decides, double and exact arithmetic where it cannot ({n} slivers)"
        ),
    });
    Precision::Robust
}

// Serde passes fields by reference.
fn by_name<S: Serializer>(precision: &Precision, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(precision.name())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Model;
    use glam::Vec3;
    use rt_core::{Child, Node, SceneParts, Triangle};

    fn scan() -> Scan {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        Scan::new(&Model { positions, indices: vec![[0, 1, 2]], ..Model::default() })
    }

    #[test]
    fn plain_models_are_traced_robustly() {
        let plan = Plan::new(&scan());
        assert_eq!((plan.precision, plan.id_bits, plan.materials, plan.levels), (Precision::Robust, 16, false, 1));
        assert_eq!(plan.reasons.len(), 4, "{:?}", plan.reasons);
    }

    #[test]
    fn double_precision_is_chosen_where_the_filter_is_in_vain_and_said_why() {
        let plan = |change: fn(&mut Scan)| {
            let mut scan = Scan { triangles: 100, ..scan() };
            change(&mut scan);
            Plan::new(&scan)
        };
        for (change, expected) in [
            ((|s| s.unresolved = 11) as fn(&mut Scan), Precision::Robust),
            (|s| s.unresolved = 12, Precision::Double),
            (|s| (s.unresolved, s.degenerate) = (6, 50), Precision::Double),
            (|s| s.slivers = 100, Precision::Robust),
            (|s| s.offset_ratio = Some(1e5), Precision::Robust),
            (|s| s.offset_ratio = Some(2e5), Precision::Double),
            (|s| s.offset_ratio = None, Precision::Robust),
            (|s| s.non_finite = 100, Precision::Robust),
        ] {
            let plan = plan(change);
            assert_eq!(plan.precision, expected, "{:?}", plan.reasons);
            let word = if expected == Precision::Double { "double precision: " } else { "robust precision: " };
            assert!(plan.reasons[0].starts_with(word), "{:?}", plan.reasons);
        }
        let plan = plan(|s| (s.triangles, s.colours, s.degenerate) = (65_537, 3, 7));
        assert_eq!((plan.id_bits, plan.materials), (32, true));
        assert!(plan.reasons.contains(&"32-bit primitive ids: more than 65,536 triangles".to_owned()));
        assert!(plan.reasons.iter().any(|r| r.starts_with("7 triangles can be left out")), "{:?}", plan.reasons);
    }

    #[test]
    fn the_tree_completes_the_plan() {
        let triangle = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
        let mut root = Node::EMPTY;
        root.set(0, triangle.bounds(), Child::Leaf { first: 0, count: 1 });
        let parts = SceneParts {
            nodes: vec![root],
            triangles: vec![triangle],
            primitives: vec![70_000],
            primitive_count: 70_001,
            ..SceneParts::default()
        };
        let mut plan = Plan::new(&scan());
        assert_eq!(plan.bytes_per_triangle, None);
        plan.complete(&Scene::new(parts).unwrap());
        assert_eq!((plan.id_bits, plan.stack_entries, plan.node_bytes), (32, Some(1), Some(64)));
        assert_eq!((plan.triangle_bytes, plan.id_bytes, plan.scene_bytes), (Some(36), Some(4), Some(104)));
        assert_eq!(plan.bytes_per_triangle, Some(104.0));
        plan.complete(&Scene::new(SceneParts { nodes: vec![Node::EMPTY], ..SceneParts::default() }).unwrap());
        assert_eq!(plan.bytes_per_triangle, None);
    }
}
