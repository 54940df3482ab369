//! Properties over random scenes: the exact reference, brute force and the trees agree.

use proptest::prelude::*;
use rt_tests::reference::{Reference, Verdict};
use rt_tests::{brute, strategy};

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// Guards against: a wrong sign in `Shear::intersect`, `<=` for `<` in its edge tests, an error bound of the
    /// reference's filter that is too small.
    #[test]
    fn brute_force_keeps_the_exact_reference((triangles, rays) in strategy::scene()) {
        let reference = Reference::new(&triangles);
        for (verdict, (ray, origin)) in reference.resolve_all(&rays).iter().zip(&rays) {
            let hit = brute::closest(&triangles, ray, *origin);
            prop_assert!(verdict.admits(hit.primitive, hit.t), "{hit:?} but {verdict:?} for {ray:?}");
            prop_assert!(reference.admits_any(ray, *origin, hit.primitive));
        }
    }

    /// Guards against: reading limits or invalid rays as valid.
    #[test]
    fn invalid_rays_miss(triangles in strategy::triangles(), ray in strategy::invalid_ray()) {
        prop_assert_eq!(Reference::new(&triangles).resolve(&ray, u32::MAX), Verdict::Unambiguous(None));
        prop_assert!(!brute::closest(&triangles, &ray, u32::MAX).is_hit());
    }
}
