// The rays that a launch reads.

@group(0) @binding(4) var<storage, read> rays: array<Ray>;

fn ray_at(index: u32) -> Ray {
    return rays[index];
}
