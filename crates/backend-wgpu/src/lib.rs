//! GPU devices for raybalance through wgpu.
