//! Properties over random scenes: the exact reference, brute force and the trees agree.

use glam::Vec3;
use proptest::prelude::*;
use rt_bvh::Builder;
use rt_core::{Hit, Precision, Query, Ray, ReducedWalk, StreamSpec, Walk};
use rt_tests::strategy;
use rt_verify::rays::{Aim, RayMaker};
use rt_verify::reference::Reference;
use rt_verify::{brute, exact, shapes, tree};

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// Guards against: a wrong sign in `Shear::intersect` or in one of the reference's edge functions, a bound of
    /// either that is too small.
    #[test]
    fn brute_force_gives_the_right_answer((triangles, rays) in strategy::scene()) {
        let reference = Reference::new(&triangles);
        for ((verdict, found), (ray, origin)) in reference.answers(&rays).iter().zip(&rays) {
            let hit = brute::closest(&triangles, ray, *origin);
            prop_assert!(verdict.is_right(&hit), "{hit:?} but {verdict} for {ray:?}");
            prop_assert!(verdict.admits(hit.primitive, hit.t), "{hit:?} but {verdict:?} for {ray:?}");
            prop_assert_eq!(verdict.right().is_some(), brute::any(&triangles, ray, *origin));
            prop_assert_eq!(&hit, found, "the filter lost a triangle for {:?}", ray);
        }
    }

    /// Guards against: an error bound of the reference's filter that is too small.
    #[test]
    fn the_filter_keeps_all_that_is_not_clearly_missed((triangles, rays) in strategy::scene()) {
        let survivors = Reference::new(&triangles).survivors(&rays);
        for (survivors, (ray, _)) in survivors.iter().zip(&rays) {
            for (id, triangle) in triangles.iter().enumerate() {
                let kept = survivors.contains(&(id as u32));
                prop_assert!(kept || exact::contact(ray, triangle).is_none(), "lost {triangle:?} for {ray:?}");
            }
        }
    }

    /// Guards against: `<=` for `<` in the edge tests of `Shear::intersect`, edge functions that are not antisymmetric.
    #[test]
    fn closed_surfaces_do_not_leak(
        levels in 0_u32..3,
        offset in strategy::point(),
        from in strategy::point(),
        indices in prop::collection::vec(any::<u32>(), 1..60),
    ) {
        let triangles = shapes::moved(&shapes::icosphere(levels), offset);
        let scene = tree::build(&triangles, Builder::Sah).map_err(TestCaseError::fail)?;
        // Well inside: the icosahedron holds a sphere of radius 0.79.
        let from = offset + from * (0.7 / 4.0);
        let maker = RayMaker::new(&triangles, 1);
        let aims = [Aim::Vertex, Aim::Edge, Aim::Axis, Aim::Random];
        let inside = |(i, &index): (usize, &u32)| {
            let (ray, _) = maker.ray(aims[i % aims.len()], index);
            let target = if i % aims.len() < 2 { ray.origin + ray.direction - from } else { ray.direction };
            (Ray::new(from, if target == Vec3::ZERO { Vec3::X } else { target }), u32::MAX)
        };
        let rays: Vec<_> = indices.iter().enumerate().map(inside).collect();
        for precision in [Precision::Robust, Precision::Double] {
            let (hits, _) = tree::trace(&scene, StreamSpec { precision, ..StreamSpec::default() }, &rays);
            for (hit, (ray, _)) in hits.iter().zip(&rays) {
                prop_assert!(hit.is_hit(), "{precision:?}: {ray:?} leaks");
            }
        }
    }

    /// Guards against: reading limits or invalid rays as valid.
    #[test]
    fn invalid_rays_miss(triangles in strategy::triangles(), ray in strategy::invalid_ray()) {
        let verdict = Reference::new(&triangles).resolve(&ray, u32::MAX);
        prop_assert!(verdict.is_right(&Hit::MISS) && !verdict.is_ambiguous());
        prop_assert!(!brute::closest(&triangles, &ray, u32::MAX).is_hit());
        let scene = tree::build(&triangles, Builder::Sah).map_err(TestCaseError::fail)?;
        let (hits, _) = tree::trace(&scene, StreamSpec::default(), &[(ray, u32::MAX)]);
        prop_assert_eq!(hits, [Hit::MISS]);
    }

    /// Guards against: box tests without padding, the far child visited never or only before the near one, `<` for
    /// `<=` where a tie must still be looked at, ids of leaf order for ids of the caller.
    #[test]
    fn trees_of_every_builder_give_the_right_answer(
        (triangles, rays) in strategy::scene(),
        builder in prop::sample::select(Builder::ALL),
        precision in prop::sample::select(&[Precision::Robust, Precision::Double][..]),
    ) {
        let verdicts = Reference::new(&triangles).resolve_all(&rays);
        let scene = tree::build(&triangles, builder).map_err(TestCaseError::fail)?;
        for query in [Query::Closest, Query::Any] {
            let (hits, _) = tree::trace(&scene, StreamSpec::new(query, precision, false), &rays);
            prop_assert_eq!(hits.len(), rays.len());
            for ((hit, verdict), ray) in hits.iter().zip(&verdicts).zip(&rays) {
                let right = match query {
                    Query::Closest | Query::All { .. } => verdict.is_right(hit),
                    Query::Any => verdict.right().is_some() == hit.is_hit(),
                };
                prop_assert!(right, "{builder}, {query:?}: {hit:?} but {verdict} for {ray:?}");
            }
        }
    }

    /// Hits are a function of rays and triangles alone: not of the builder, of the precision, nor of counting.
    ///
    /// Guards against: a tie won by whoever was tested first, a builder that loses a triangle, a filter in single
    /// precision that is not conservative.
    #[test]
    fn hits_do_not_depend_on_the_tree((triangles, rays) in strategy::scene()) {
        let mut first: Option<Vec<Hit>> = None;
        for &builder in Builder::ALL {
            let scene = tree::build(&triangles, builder).map_err(TestCaseError::fail)?;
            for (precision, counts) in [(Precision::Robust, false), (Precision::Double, true)] {
                let (hits, _) = tree::trace(&scene, StreamSpec::new(Query::Closest, precision, counts), &rays);
                match &first {
                    None => first = Some(hits),
                    Some(first) => prop_assert_eq!(&hits, first, "{}, {:?}", builder, precision),
                }
            }
        }
    }

    /// Guards against: a reduced walk that prunes, counts a leaf's triangles twice, or is cut where it must not be.
    #[test]
    fn reduced_walks_bound_full_ones((triangles, rays) in strategy::scene()) {
        let scene = tree::build(&triangles, Builder::Sah).map_err(TestCaseError::fail)?;
        let spec = StreamSpec::default();
        let [full, cut, uncut] = [
            Walk::Full,
            Walk::Reduced(ReducedWalk::LeafAsHit),
            Walk::Reduced(ReducedWalk::Unshortened),
        ].map(|walk| tree::walk(&scene, walk, spec, &rays).1);
        for ((full, cut), uncut) in full.iter().zip(&cut).zip(&uncut) {
            prop_assert!(cut.boxes <= uncut.boxes && cut.triangles <= uncut.triangles, "{cut:?} > {uncut:?}");
            prop_assert!(full.boxes <= uncut.boxes && full.triangles <= uncut.triangles, "{full:?} > {uncut:?}");
        }
    }
}
