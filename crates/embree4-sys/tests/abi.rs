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
    let tests: [(&str, Check); 4] = [
        ("nothing_past_a_hit_is_written", nothing_past_a_hit_is_written),
        ("nothing_past_a_packet_is_written", nothing_past_a_packet_is_written),
        ("nearest_and_any_hits_are_found", nearest_and_any_hits_are_found),
        ("packets_and_single_rays_agree", packets_and_single_rays_agree),
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
/// Fails when `RTCRayHit` has the alignment 16.
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
    for i in 0..16 {
        let ray = along_z(i as f32 / 4.0);
        packet.ray.org_x[i] = ray.org_x;
        packet.ray.dir_z[i] = ray.dir_z;
        packet.ray.tfar[i] = ray.tfar;
        packet.ray.mask[i] = ray.mask;
    }
}

/// Fails when the filter looks at another field of the hit, or lets all through.
fn nearest_and_any_hits_are_found() -> Result<(), Failed> {
    for robust in [RTCSceneFlags::NONE, RTCSceneFlags::ROBUST] {
        let mesh = mesh(robust | RTCSceneFlags::FILTER_FUNCTION_IN_ARGUMENTS)?;
        let hit = mesh.closest(along_z(0.0)).ok_or("missed")?;
        ensure(hit.hit.primID == 1 && hit.ray.tfar == 3.0, &format!("{hit:?}"))?;
        ensure(mesh.closest(along_z(4.0)).is_none(), "hit beside the triangles")?;
        ensure(mesh.is_occluded(along_z(0.0)) && !mesh.is_occluded(along_z(4.0)), "occlusion is wrong")?;
        let occluder = |skip| mesh.occluder(along_z(0.0), skip).map(|o| (o.primitive, o.t, o.u, o.v));
        ensure(occluder(1) == Some((0, 5.0, 0.25, 0.25)), "the left-out triangle hides the other one")?;
        ensure(occluder(0) == Some((1, 3.0, 0.25, 0.25)), "the wrong triangle is left out")?;
        ensure(mesh.occluder(along_z(4.0), u32::MAX).is_none(), "occluded beside the triangles")?;
        let short = RTCRay { tfar: 4.0, ..along_z(0.0) };
        ensure(mesh.occluder(short, 1).is_none() && mesh.is_occluded(short), "the limit is not kept")?;
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
