//! Cameras: those listed beside a file, one for a model that brings none, and turning it for animations.

use crate::camera::{CameraPathError, Shot};
use crate::frame::frame;
use crate::{Model, View};
use glam::{DQuat, DVec3, Vec3};
use rt_core::{Hit, Ray};
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

/// Vertical field of view of an automatic camera in degrees: that of a 50 mm lens on 35 mm film, held upright.
const FOV_DEGREES: f32 = 40.0;

/// From the target to the camera: a three-quarter view from the front right, somewhat above. Along no axis, so that a
/// flat model is never seen edge-on.
const TOWARDS_EYE: DVec3 = DVec3::new(0.6, 0.45, 1.0);

/// How much larger the picture is than the model in it.
const MARGIN: f64 = 1.05;

/// How much farther the eye is than that, so that it is in front of the nearest vertex even of a needle that points at
/// it.
const CLEARANCE: f64 = 1.01;

/// A view that shows the model well: from the front right and above, `y` up, and as near as leaves all of it in a
/// picture `aspect` times as wide as high, or wider.
///
/// Where less than 1% of the triangles make the model many times larger, such as a ground plane to the horizon, the
/// frame holds the rest. Vertices that are not finite are ignored, and a model without extent, or without triangles,
/// gets a view too: [`View::camera`] never fails on the result.
#[must_use]
pub fn auto_view(model: &Model, aspect: f32) -> View {
    let (low, high) = frame(model).unwrap_or_default();
    let middle = (low + high) / 2.0;
    let back = TOWARDS_EYE.normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    let slope = libm::tan(f64::from(FOV_DEGREES).to_radians() / 2.0);
    let aspect = if aspect.is_finite() && aspect > 0.0 { f64::from(aspect) } else { 1.0 };
    // Each point must lie inside the pyramid of the picture. Along each axis of that the apex is as near as the two
    // planes allow that bound it, and in their middle.
    let apex = |axis: DVec3, slope: f64| {
        let (mut one, mut other) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        for point in substance(model, low, high) {
            let from = point - middle;
            let (across, towards) = (from.dot(axis) / slope, from.dot(back));
            (one, other) = (one.max(towards + across), other.max(towards - across));
        }
        let found = one.is_finite() && other.is_finite();
        if found { ((one + other) / 2.0, (one - other) / 2.0 * slope) } else { (0.0, 0.0) }
    };
    let slope = slope / MARGIN;
    let ((wide, across), (high, upward)) = (apex(right, slope * aspect), apex(up, slope));
    let target = middle + right * across + up * upward;
    let distance = CLEARANCE * wide.max(high);
    // Far enough for single precision to tell eye and target apart, and 1 away from a point at the origin.
    let least = if target == DVec3::ZERO { 0.0 } else { target.abs().max_element() * 1e-5 };
    let distance = match distance.max(least) {
        0.0 => 1.0,
        distance => distance.max(f64::from(f32::MIN_POSITIVE)),
    };
    // Models at the edge of single precision are seen from that edge.
    let most = DVec3::splat(f64::from(f32::MAX));
    let [eye, target] = [target + back * distance, target].map(|point| point.clamp(-most, most).as_vec3());
    View { eye, target, up: Vec3::Y, fov_degrees: FOV_DEGREES }
}

/// Corners of the model's triangles that lie in its frame.
fn substance(model: &Model, low: DVec3, high: DVec3) -> impl Iterator<Item = DVec3> {
    let corners = model.own().iter().flatten().filter_map(|&index| model.positions.get(index as usize));
    let inside = move |point: &DVec3| point.cmpge(low).all() && point.cmple(high).all();
    corners.map(|corner| corner.as_dvec3()).filter(inside)
}

/// Rays per side of the probe picture in [`interior_view`]: 24² rays tell a wall from a furnished room.
const PROBES: u32 = 24;

/// How many times more triangles a view from inside must show before it is preferred: models that look as good from
/// outside are expected to be seen from there.
const CLEARLY_MORE: usize = 2;

/// Directions in which an observer inside looks for walls.
const LOOKS: u32 = 256;

/// Share of them in which a room has some: five walls of a box that is open in front are more, as is a hall with
/// windows. Beside a thing that stands on the ground, or among its limbs, it is about half.
const ENCLOSED: f64 = 0.7;

/// Field of view inside a room, in degrees: as wide as pictures of rooms usually are.
const ROOM_FOV_DEGREES: f32 = 65.0;

/// Where in the frame an observer inside stands, as shares of its half-extents: near a corner, above eye height.
const CORNER: DVec3 = DVec3::new(0.8, 0.15, 0.8);

/// A view from inside the model where that is closed on most sides and shows clearly more than `outside` does: rooms,
/// of which the outside is a few bare walls. `probe` traces one ray and returns its nearest hit.
///
/// "More" is the number of different triangles that a coarse grid of rays meets.
#[must_use]
pub fn interior_view(model: &Model, outside: &View, probe: &mut dyn FnMut(&Ray) -> Hit) -> Option<View> {
    let (low, high) = frame(model)?;
    let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
    let corner = |i: u8| {
        let sign = |bit: u8| if i & bit == 0 { -1.0 } else { 1.0 };
        let eye = middle + half * CORNER * DVec3::new(sign(1), 1.0, sign(2));
        // A little below the middle, where rooms are furnished.
        let target = middle - DVec3::Y * (half.y * 0.3);
        View { eye: eye.as_vec3(), target: target.as_vec3(), up: Vec3::Y, fov_degrees: ROOM_FOV_DEGREES }
    };
    let mut seen = |view: &View| -> usize {
        let Ok(camera) = view.camera() else { return 0 };
        let at = |i: u32| (i as f32 + 0.5) / PROBES as f32;
        let rays = (0..PROBES * PROBES).map(|i| camera.ray(at(i % PROBES), at(i / PROBES), 1.0));
        rays.map(|ray| probe(&ray).primitive).filter(|&p| p != Hit::MISS.primitive).collect::<BTreeSet<_>>().len()
    };
    let views = (0..4).map(corner).map(|view| (seen(&view), view));
    let (count, best) = views.max_by_key(|(count, _)| *count)?;
    (count > CLEARLY_MORE * seen(outside) && is_enclosed(best.eye, probe)).then_some(best)
}

/// Whether there is something on most sides of a point.
fn is_enclosed(eye: Vec3, probe: &mut dyn FnMut(&Ray) -> Hit) -> bool {
    // Spread evenly over the sphere, along a spiral of the golden angle.
    let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    let direction = |i: u32| {
        let y = 1.0 - (2.0 * i as f32 + 1.0) / LOOKS as f32;
        let (sin, cos) = (golden * i as f32).sin_cos();
        Vec3::new(cos, 0.0, sin) * (1.0 - y * y).sqrt() + Vec3::Y * y
    };
    let walls = (0..LOOKS).filter(|&i| probe(&Ray::new(eye, direction(i))).is_hit()).count();
    walls as f64 >= ENCLOSED * f64::from(LOOKS)
}

/// Where [`listed`] looks for a scene's view.
#[must_use]
pub fn list_beside(path: &Path) -> PathBuf {
    path.with_file_name("cameras.tsv")
}

/// The view of `model` that the file `cameras.tsv` beside its file `path` gives, if there is one: in the first line
/// that begins with the file's name, or with that of the file that was packed.
///
/// # Errors
/// When that line says no camera.
pub fn listed(path: &Path, model: &Model) -> Result<Option<View>, CameraPathError> {
    let list = list_beside(path);
    let file = path.file_name().and_then(OsStr::to_str);
    let Some((table, file)) = fs::read_to_string(&list).ok().zip(file) else { return Ok(None) };
    let found = (1..).zip(table.lines()).find_map(|(line, row)| Some((line, shot(row, file)?)));
    let Some((line, shot)) = found else { return Ok(None) };
    match shot {
        Ok(shot) => Ok(Some(shot.view(model.offset))),
        Err(what) => Err(CameraPathError::in_line(list, line, what)),
    }
}

/// What a row of `cameras.tsv` says if it is about `file`: its name, eye, target, up and vertical field of view in
/// degrees, separated by tabs, and coordinates, which are those of the file, by blanks.
fn shot(row: &str, file: &str) -> Option<Result<Shot, String>> {
    let unpacked = file.strip_suffix(".xz").or_else(|| file.strip_suffix(".gz"));
    let is_about = |name: &str| name == file || Some(name) == unpacked;
    let fields: Vec<&str> = row.split('\t').collect();
    Some(match fields[..] {
        [name, eye, target, up, fov] if is_about(name) => Shot::parse([eye, target, up, fov]),
        [name, ..] if is_about(name) || row.split_whitespace().next().is_some_and(is_about) => Err(format!(
            "it is to have file, eye, target, up and field of view, separated by tabs; it has {} fields",
            fields.len()
        )),
        _ => return None,
    })
}

/// The same view with the eye turned about the target by `angle` radians, around the up axis, to the right as seen
/// from the camera. A full turn in `n` equal steps makes an endless animation.
#[must_use]
pub fn orbit(view: &View, angle: f32) -> View {
    let Some(axis) = view.up.as_dvec3().try_normalize() else { return *view };
    let target = view.target.as_dvec3();
    let turn = DQuat::from_axis_angle(axis, f64::from(angle));
    View { eye: (target + turn * (view.eye.as_dvec3() - target)).as_vec3(), ..*view }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f32::consts::{FRAC_PI_2, TAU};

    fn soup(corners: Vec<[Vec3; 3]>) -> Model {
        let indices = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Model { positions: corners.concat(), indices, ..Model::default() }
    }

    /// The nearest hit with any triangle.
    fn brute(model: &Model) -> impl FnMut(&Ray) -> Hit {
        move |ray| {
            let hits = (0..model.indices.len() as u32)
                .filter_map(|id| rt_core::intersect::hit(ray, &model.triangle(id).unwrap(), id));
            hits.fold(Hit::MISS, |best, hit| if hit.is_before(&best) { hit } else { best })
        }
    }

    /// A box of 12 triangles around `inside`.
    fn boxed(mut inside: Vec<[Vec3; 3]>) -> Model {
        for axis in 0..3 {
            for sign in [-4.0, 4.0] {
                let corner = |a: f32, b: f32| {
                    let mut p = Vec3::splat(sign);
                    (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (a, b);
                    p
                };
                let [a, b, c, d] = [corner(-4.0, -4.0), corner(4.0, -4.0), corner(4.0, 4.0), corner(-4.0, 4.0)];
                inside.extend([[a, b, c], [a, c, d]]);
            }
        }
        soup(inside)
    }

    #[test]
    fn rooms_are_seen_from_inside_and_things_from_outside() {
        let small = |i: u16| {
            let p = Vec3::new(f32::from(i % 8) - 4.0, -3.0 + f32::from(i % 3) * 0.4, f32::from(i / 8) - 4.0);
            [p, p + Vec3::new(0.7, 0.1, 0.0), p + Vec3::new(0.1, 0.7, 0.7)]
        };
        let furniture: Vec<_> = (0..64).map(small).collect();
        let room = boxed(furniture.clone());
        let inside = interior_view(&room, &auto_view(&room, 1.0), &mut brute(&room)).expect("bare walls outside");
        assert!(inside.eye.abs().max_element() < 4.0, "{inside:?}");
        let things = soup(furniture);
        assert_eq!(interior_view(&things, &auto_view(&things, 1.0), &mut brute(&things)), None);
        let empty = Model::default();
        assert_eq!(interior_view(&empty, &auto_view(&empty, 1.0), &mut brute(&empty)), None);
    }

    /// A thing of which much is seen from among its limbs is no room. Fails when walls are not looked for.
    #[test]
    fn things_are_not_seen_from_among_their_limbs() {
        let small = |i: u16| {
            let p = Vec3::new(f32::from(i % 8) - 4.0, -3.0 + f32::from(i % 3) * 0.4, f32::from(i / 8) - 4.0);
            [p, p + Vec3::new(0.7, 0.1, 0.0), p + Vec3::new(0.1, 0.7, 0.7)]
        };
        let mut room = boxed((0..64).map(small).collect());
        // Without its ceiling and two of its walls.
        let walls = room.indices.len() - 12;
        for wall in [1, 3, 5] {
            for half in 0..2 {
                room.indices[walls + 2 * wall + half] = [0, 0, 0];
            }
        }
        assert!(!is_enclosed(Vec3::new(3.0, 0.5, 3.0), &mut brute(&room)));
        assert_eq!(interior_view(&room, &auto_view(&room, 1.0), &mut brute(&room)), None);
    }

    /// A long thing fills a wide picture. Fails when the picture is taken for a square.
    #[test]
    fn wide_pictures_are_filled() {
        let model = soup(vec![[Vec3::new(-4.0, 0.0, 0.0), Vec3::new(4.0, 0.0, 0.0), Vec3::new(0.0, 0.1, 0.1)]]);
        let [square, wide] = [1.0, 2.0].map(|aspect| auto_view(&model, aspect));
        let distance = |view: View| view.eye.distance(view.target);
        assert!(distance(wide) < 0.6 * distance(square), "{wide:?} {square:?}");
        assert!(largest_offset(&wide, &model.positions) > 1.5);
    }

    /// Position in the picture: the middle is (0, 0), the borders are at ±1.
    fn project(view: &View, point: Vec3) -> (f64, f64) {
        let camera = view.camera().unwrap();
        let p = point.as_dvec3() - camera.eye().as_dvec3();
        let forward = camera.forward().as_dvec3();
        let right = forward.cross(view.up.as_dvec3()).normalize();
        let depth = p.dot(forward) * libm::tan(f64::from(view.fov_degrees).to_radians() / 2.0);
        assert!(depth > 0.0, "{point} is behind {view:?}");
        (p.dot(right) / depth, p.dot(right.cross(forward)) / depth)
    }

    fn largest_offset(view: &View, points: &[Vec3]) -> f64 {
        let offset = |p: &Vec3| {
            let (x, y) = project(view, *p);
            x.abs().max(y.abs())
        };
        points.iter().map(offset).fold(0.0, f64::max)
    }

    fn vertex() -> impl Strategy<Value = Vec3> {
        let coordinate = || prop_oneof![3 => -1.0..1.0_f32, 1 => Just(0.0_f32)];
        [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
    }

    proptest! {
        /// Guards: the whole model is in the frame and not tiny in it, at every scale and off the origin. Fails when
        /// `corner.dot(back)` is left out of the distance.
        #[test]
        fn the_model_fills_the_frame(
            corners in prop::collection::vec([vertex(), vertex(), vertex()], 1..20),
            offset in vertex(), exponent in -30..=30_i32,
        ) {
            let scale = 10_f32.powi(exponent);
            let model = soup(corners.iter().map(|t| t.map(|p| (p + 10.0 * offset) * scale)).collect());
            prop_assume!(model.bounds().extent().length() > 1e-3 * scale);
            let view = auto_view(&model, 1.0);
            let offset = largest_offset(&view, &model.positions);
            prop_assert!(offset <= 1.0, "{offset}");
            // A corner that would lie at the border comes away from it by the clearance: by half where it is so near.
            let [eye, target] = [view.eye, view.target].map(|point| point.as_dvec3());
            let (forward, distance) = ((target - eye).normalize(), target.distance(eye));
            let nearest = model.positions.iter().map(|p| (p.as_dvec3() - eye).dot(forward)).fold(distance, f64::min);
            prop_assert!(offset > 0.5 || nearest < 0.025 * distance, "{offset}, {nearest} of {distance}");
        }

        /// Guards: whatever the vertices, there is a camera. Fails without the clamp of the eye or the least distance.
        #[test]
        fn any_model_gets_a_camera(values in prop::collection::vec(any::<f32>(), 0..5), twice in any::<bool>()) {
            let point = |i: usize| Vec3::splat(*values.get(i).unwrap_or(&0.0));
            let last = if twice { point(0) } else { point(4) };
            let model = soup(vec![[point(0), point(1), point(2)], [point(0), point(0), last]]);
            prop_assert!(auto_view(&model, 1.0).camera().is_ok(), "{:?}", auto_view(&model, 1.0));
        }

        /// Guards: distance to the target and height along the axis stay. Fails when the eye is turned about the
        /// origin.
        #[test]
        fn orbits_keep_distance_and_height(eye in vertex(), target in vertex(), angle in -10.0..10.0_f32) {
            let view = View { eye, target, up: Vec3::new(0.0, 2.0, 0.0), fov_degrees: 30.0 };
            let turned = orbit(&view, angle);
            prop_assert!((turned.eye.distance(target) - eye.distance(target)).abs() < 1e-5);
            prop_assert!((turned.eye.y - eye.y).abs() < 1e-6);
            prop_assert_eq!((turned.target, turned.up), (view.target, view.up));
        }
    }

    #[test]
    fn degenerate_models_get_a_camera() {
        let camera = |model: &Model| {
            auto_view(model, 1.0).camera().unwrap_or_else(|e| panic!("{e}: {:?}", auto_view(model, 1.0)))
        };
        camera(&Model::default());
        for p in [Vec3::ZERO, Vec3::ONE, Vec3::splat(1e-40), Vec3::splat(-3e38), Vec3::NAN, Vec3::X * 1e20] {
            camera(&soup(vec![[p; 3]]));
        }
        camera(&soup(vec![[Vec3::MIN, Vec3::MAX, Vec3::ZERO]]));
        camera(&Model { indices: vec![[0, 1, 2]], ..Model::default() });
    }

    #[test]
    fn a_huge_ground_does_not_shrink_the_subject() {
        let mut corners: Vec<_> = (0..1000)
            .map(|i| {
                let [a, b] = rt_core::random::pair(1, i, 0);
                let p = Vec3::new(a, b, rt_core::random::pair(1, i, 1)[0]);
                [p, p + Vec3::X * 0.01, p + Vec3::Y * 0.01]
            })
            .collect();
        let subject = corners.concat();
        let plain = auto_view(&soup(corners.clone()), 1.0);
        let far = 1000.0;
        let ground = [(-far, -far), (far, -far), (far, far), (-far, far)].map(|(x, z)| Vec3::new(x, 0.0, z));
        corners.extend([[ground[0], ground[1], ground[2]], [ground[0], ground[2], ground[3]]]);
        let view = auto_view(&soup(corners), 1.0);
        assert!(view.eye.distance(plain.eye) < 0.3, "{view:?} instead of {plain:?}");
        let offset = largest_offset(&view, &subject);
        assert!((0.5..1.1).contains(&offset), "{offset}");
    }

    #[test]
    fn a_quarter_turn_goes_to_the_right_and_a_whole_one_comes_back() {
        let view = View { eye: Vec3::new(1.0, 1.0, 3.0), target: Vec3::X, up: Vec3::Y, fov_degrees: 40.0 };
        assert!(orbit(&view, FRAC_PI_2).eye.abs_diff_eq(Vec3::new(4.0, 1.0, 0.0), 1e-6));
        assert!(orbit(&view, TAU).eye.abs_diff_eq(view.eye, 1e-6));
        assert_eq!(orbit(&View { up: Vec3::ZERO, ..view }, 1.0).eye, view.eye);
    }

    #[test]
    fn cameras_are_read_from_the_line_about_the_scene() {
        let folder = tempfile::tempdir().unwrap();
        let listed = |table: &str, scene: &str, offset: DVec3| {
            fs::write(folder.path().join("cameras.tsv"), table).unwrap();
            listed(&folder.path().join(scene), &Model { offset, ..Model::default() })
        };
        let table = "# a.obj\nb.obj\tnothing\na.obj\t1 2 3\t0 0 0\t0 1 0\t45\n";
        let found = listed(table, "a.obj", DVec3::ZERO).unwrap().expect("a camera");
        assert_eq!((found.eye.z, found.fov_degrees), (3.0, 45.0));
        // Fails when a packed file is another scene, or any end of a name.
        assert_eq!(["a.obj.xz", "a.obj.gz"].map(|name| listed(table, name, DVec3::ZERO).unwrap()), [Some(found); 2]);
        assert_eq!(["c.obj", "a.obj.zip"].map(|name| listed(table, name, DVec3::ZERO).unwrap()), [None; 2]);
        let far = "a.obj\t5000000.1 2 3\t5e6 0 -5e6\t0 1 0\t45";
        let found = listed(far, "a.obj", DVec3::new(5e6, 0.0, -5e6)).unwrap().expect("a camera");
        assert_eq!((found.eye, found.target), (Vec3::new(0.1, 2.0, 5_000_003.0), Vec3::ZERO));
        // Fails when a wrong line about the scene is passed over without a word.
        for (line, part) in [
            ("a.obj\t1 2\t0 0 0\t0 1 0\t45", "the eye `1 2`"),
            ("a.obj\t1 2 3", "2 fields"),
            ("a.obj 1 2 3 0 0 0 0 1 0 45", "1 fields"),
        ] {
            let error = listed(&format!("\n{line}"), "a.obj", DVec3::ZERO).unwrap_err().to_string();
            assert!(error.contains("cameras.tsv`, line 2: ") && error.contains(part), "{error}");
        }
    }
}
