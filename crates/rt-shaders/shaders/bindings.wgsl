// What a launch reads and writes, but for the tree at binding 0, of which each layout has its own, the rays at binding
// 4 and the list of them at binding 5. The layouts are those of `rt_core::Triangle` and `rt_core::TestCounts`; a test
// compares the offsets.

struct Triangle {
    // Three vertices. Not vectors: those would be padded to 16 bytes.
    vertices: array<f32, 9>,
}

struct Frame {
    // The scene's box.
    low: vec3<f32>,
    // What the root has: children on both sides, or only on side 0 or 1, or none.
    root: u32,
    high: vec3<f32>,
    // Always 0, which compilers do not know.
    zero: u32,
}

const ROOT_WHOLE: u32 = 2u;
const ROOT_EMPTY: u32 = 3u;

@group(0) @binding(1) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(2) var<storage, read> primitives: array<u32>;
@group(0) @binding(3) var<storage, read> frame: Frame;
// For each item of the list: the slot of the triangle that was hit, MISS, or DOUBTFUL.
@group(0) @binding(6) var<storage, read_write> found: array<u32>;
// For each item of the list: box tests and triangle tests.
@group(0) @binding(7) var<storage, read_write> counts: array<vec2<u32>>;

const MISS: u32 = 0xffffffffu;
// The host must decide this ray.
const DOUBTFUL: u32 = 0xfffffffeu;
