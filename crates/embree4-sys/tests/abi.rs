//! The library writes where our types have room and nowhere else, and the safe calls answer right.
//!
//! Without a library the tests are ignored with the reason, unless `RT_REQUIRE` names `embree`: then it must be there.

use embree4_sys::*;
use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use std::ptr::{null, null_mut};

/// What memory that must not be written holds.
const SENTINEL: u32 = 0xa5a5_5a5a;

/// Bytes of a ray and its hit in Embree 4.2, whose headers the published `embree4-sys` 0.0.10 was made from.
const OLD_SIZE: usize = 80;

/// The version from which on hits are longer than that.
const LONGER_HITS: [u32; 3] = [4, 3, 0];

type Check = fn() -> Result<(), Failed>;

fn main() {
    let arguments = Arguments::from_args();
    let tests: [(&str, Check); 5] = [
        ("nothing_past_a_hit_is_written", nothing_past_a_hit_is_written),
        ("nothing_past_a_packet_is_written", nothing_past_a_packet_is_written),
        ("nearest_and_any_hits_are_found", nearest_and_any_hits_are_found),
        ("packets_and_single_rays_agree", packets_and_single_rays_agree),
        ("each_ray_of_a_packet_leaves_out_its_own", each_ray_of_a_packet_leaves_out_its_own),
    ];
    let must = std::env::var("RT_REQUIRE").is_ok_and(|list| list.split(',').any(|name| name.trim() == "embree"));
    let trial = |(name, test): (&str, Check)| {
        Trial::ignorable_test(name, move || match version() {
            Ok(_) => test().map(|()| Completion::Completed),
            Err(e) if must => Err(format!("required by RT_REQUIRE, but missing: {e}").into()),
            Err(e) => Ok(Completion::ignored_with(e.to_string())),
        })
    };
    let mut trials: Vec<Trial> = tests.into_iter().map(trial).collect();
    trials.push(Trial::test("a_wrong_index_is_refused_whether_there_is_a_library_or_not", || {
        let refused = Mesh::new(&[[0.0; 3]; 3], &[[0, 1, 3]], RTCSceneFlags::NONE, RTCBuildQuality::LOW);
        let expected = match version() {
            Ok(_) => MeshError::Vertex { triangle: 0, vertices: 3 },
            Err(e) => MeshError::Missing(e),
        };
        ensure(refused.is_err_and(|e| e == expected), "accepted")
    }));
    run(&arguments, trials).exit();
}

fn ensure(holds: bool, message: &str) -> Result<(), Failed> {
    if holds { Ok(()) } else { Err(message.into()) }
}

/// Two triangles across the z axis: 0 at distance 5, 1 at distance 3.
fn vertices() -> Vec<[f32; 3]> {
    let at = |z| [[-1.0, -1.0, z], [3.0, -1.0, z], [-1.0, 3.0, z]];
    [at(5.0), at(3.0)].concat()
}

/// Whether they differ by no more than Embree's quotients do on processors without AVX-512, which approximate them.
fn is_near(one: f32, other: f32) -> bool {
    (one - other).abs() <= 1e-6 * other.abs()
}

fn along_z(x: f32) -> RTCRay {
    RTCRay::new([x, 0.0, 0.0], [0.0, 0.0, 1.0], 0.0, f32::INFINITY)
}

fn mesh(flags: RTCSceneFlags) -> Result<Mesh, Failed> {
    Ok(Mesh::new(&vertices(), &[[0, 1, 2], [3, 4, 5]], flags, RTCBuildQuality::HIGH)?)
}

/// A scene by the raw calls, which hands its handles to `query`.
fn with_scene<R>(query: impl FnOnce(RTCScene) -> R) -> R {
    let vertices = vertices();
    // SAFETY: the calls are made in the order that Embree's manual shows; buffers are as long as they are said to be.
    unsafe {
        let device = rtcNewDevice(null());
        let scene = rtcNewScene(device);
        let geometry = rtcNewGeometry(device, RTCGeometryType::TRIANGLE);
        let buffer = |kind, format, count| rtcSetNewGeometryBuffer(geometry, kind, 0, format, 12, count);
        let memory = buffer(RTCBufferType::VERTEX, RTCFormat::FLOAT3, vertices.len());
        memory.cast::<[f32; 3]>().copy_from_nonoverlapping(vertices.as_ptr(), vertices.len());
        let memory = buffer(RTCBufferType::INDEX, RTCFormat::UINT3, 2);
        memory.cast::<[u32; 3]>().copy_from_nonoverlapping([[0, 1, 2], [3, 4, 5]].as_ptr(), 2);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scene);
        let result = query(scene);
        rtcReleaseScene(scene);
        rtcReleaseDevice(device);
        result
    }
}

/// A hit, then words that must stay as they are.
#[repr(C)]
union Guarded {
    hit: RTCRayHit,
    words: [u32; HIT_WORDS + 64],
}

/// Words of a hit with the room behind it.
const HIT_WORDS: usize = size_of::<RTCRayHit>() / 4;

/// Also the proof that it would be noticed: libraries from 4.3 on do write past the end of the older, shorter type.
/// Fails when `RTCHit` has no `instPrimID`.
fn nothing_past_a_hit_is_written() -> Result<(), Failed> {
    let mut memory = Guarded { words: [SENTINEL; HIT_WORDS + 64] };
    // SAFETY: every bit pattern is a number, so either field may be read whatever was written.
    let words = with_scene(|scene| unsafe {
        memory.hit.ray = along_z(0.0);
        memory.hit.hit = RTCHit::default();
        rtcIntersect1(scene, &raw mut memory.hit, null_mut());
        memory.words
    });
    let primitive = words[17];
    ensure(primitive == 1, &format!("primitive {primitive}, not 1"))?;
    ensure(words[HIT_WORDS..].iter().all(|&word| word == SENTINEL), "memory past the hit was written")?;
    let longer = words[OLD_SIZE / 4] != SENTINEL;
    ensure(longer == (version()? >= LONGER_HITS), "hits are as long as in another version")
}

/// A packet, then words that must stay as they are.
#[repr(C)]
struct GuardedPacket {
    packet: RTCRayHit16,
    guard: [u32; 64],
}

fn nothing_past_a_packet_is_written() -> Result<(), Failed> {
    let mut memory = Box::new(GuardedPacket { packet: RTCRayHit16::default(), guard: [SENTINEL; 64] });
    fill(&mut memory.packet);
    let valid = Valid16([-1; 16]);
    // SAFETY: mask and rays are aligned by their types and live through the call.
    with_scene(|scene| unsafe { rtcIntersect16(valid.0.as_ptr(), scene, &raw mut memory.packet, null_mut()) });
    ensure(memory.packet.hit.primID[0] == 1, "the first ray missed")?;
    ensure(memory.guard == [SENTINEL; 64], "memory past the packet was written")
}

fn fill(packet: &mut RTCRayHit16) {
    (0..16).for_each(|i| packet.ray.set(i, &along_z(i as f32 / 4.0)));
}

/// Fails when the filter looks at another field of the hit, or lets all through.
fn nearest_and_any_hits_are_found() -> Result<(), Failed> {
    for robust in [RTCSceneFlags::NONE, RTCSceneFlags::ROBUST] {
        let mesh = mesh(robust | RTCSceneFlags::FILTER_FUNCTION_IN_ARGUMENTS)?;
        let hit = mesh.closest(along_z(0.0)).ok_or("missed")?;
        ensure(hit.hit.primID == 1 && is_near(hit.ray.tfar, 3.0), &format!("{hit:?}"))?;
        ensure(mesh.closest(along_z(4.0)).is_none(), "hit beside the triangles")?;
        ensure(mesh.is_occluded(along_z(0.0)) && !mesh.is_occluded(along_z(4.0)), "occlusion is wrong")?;
        let finds = |left_out, primitive, t| {
            let found = mesh.occluder(along_z(0.0).leaving_out(left_out));
            let near = |o: &Occluder| is_near(o.t, t) && is_near(o.u, 0.25) && is_near(o.v, 0.25);
            found.is_some_and(|o| o.primitive == primitive && near(&o))
        };
        ensure(finds(1, 0, 5.0), "the left-out triangle hides the other one")?;
        ensure(finds(0, 1, 3.0), "the wrong triangle is left out")?;
        ensure(mesh.occluder(along_z(4.0)).is_none(), "occluded beside the triangles")?;
        let behind = mesh.closest_filtered(along_z(0.0).leaving_out(1)).ok_or("the other one is not found")?;
        ensure(behind.hit.primID == 0 && is_near(behind.ray.tfar, 5.0), &format!("{behind:?}"))?;
        let short = RTCRay { tfar: 4.0, ..along_z(0.0) };
        ensure(mesh.occluder(short.leaving_out(1)).is_none() && mesh.is_occluded(short), "the limit is not kept")?;
    }
    let empty = Mesh::new(&[], &[], RTCSceneFlags::NONE, RTCBuildQuality::MEDIUM)?;
    ensure(empty.closest(along_z(0.0)).is_none() && !empty.is_occluded(along_z(0.0)), "hit in an empty scene")
}

fn packets_and_single_rays_agree() -> Result<(), Failed> {
    let mesh = mesh(RTCSceneFlags::ROBUST)?;
    let mut packet = Box::new(RTCRayHit16::default());
    fill(&mut packet);
    mesh.closest_16(&mut packet, RTCRayQueryFlags::INCOHERENT);
    let mut hits = 0;
    for i in 0..16 {
        let single = mesh.closest(along_z(i as f32 / 4.0)).map(|hit| hit.hit.primID);
        let packed = (packet.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID).then_some(packet.hit.primID[i]);
        ensure(single == packed, &format!("ray {i}: {single:?} alone, {packed:?} in the packet"))?;
        hits += usize::from(single.is_some());
    }
    ensure(hits > 4 && hits < 16, "all rays do alike")
}

/// Fails when the filter of a packet takes a ray's field for another's, or what one ray leaves out is left out of all.
fn each_ray_of_a_packet_leaves_out_its_own() -> Result<(), Failed> {
    let mesh = mesh(RTCSceneFlags::ROBUST | RTCSceneFlags::FILTER_FUNCTION_IN_ARGUMENTS)?;
    let rays: Vec<RTCRay> = (0..16).map(|i| along_z(i as f32 / 4.0).leaving_out(i % 3)).collect();
    for flags in [RTCRayQueryFlags::INCOHERENT, RTCRayQueryFlags::COHERENT] {
        let mut packet = Box::new(RTCRay16::default());
        rays.iter().enumerate().for_each(|(slot, ray)| packet.set(slot, ray));
        let packed = mesh.occluders_16(&mut packet, flags);
        for (i, (ray, packed)) in rays.iter().zip(packed).enumerate() {
            let is_right = match (packed, ray.id) {
                // Either triangle.
                (Some(found), 2) => mesh.is_occluded(*ray) && found.primitive < 2,
                (packed, _) => match (packed, mesh.occluder(*ray)) {
                    (Some(packed), Some(alone)) => {
                        packed.primitive == alone.primitive && is_near(packed.u, alone.u) && is_near(packed.t, alone.t)
                    }
                    (packed, alone) => packed == alone,
                },
            };
            ensure(is_right, &format!("ray {i}: {packed:?} in the packet"))?;
        }
        ensure(packed.iter().flatten().count() > 4 && packed[15].is_none(), "all rays do alike")?;
    }
    let mut packet = Box::new(RTCRay16::default());
    (0..16).for_each(|slot| packet.set(slot, &RTCRay::NOTHING));
    ensure(mesh.occluders_16(&mut packet, RTCRayQueryFlags::COHERENT) == [None; 16], "nothing hits")
}
