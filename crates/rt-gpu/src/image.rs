//! A scene as the kernels read it.

use bytemuck::{Pod, Zeroable};
use rt_bvh::kernel_io::KernelIo;
use rt_bvh::{WideNode, WideTree};
use rt_core::{Child, Node, Scene, Triangle};

/// The shader's structure `Frame`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Frame {
    /// Lower corner of the scene's box.
    pub low: [f32; 3],
    /// What the root has: 2 children, with only one its side (0 or 1), with none 3.
    pub root: u32,
    /// Upper corner.
    pub high: [f32; 3],
    /// 0: kernels hide results from their compiler behind it.
    zero: u32,
}

/// The buffers that kernels read of a scene.
#[derive(Debug)]
pub struct SceneImage<'a> {
    scene: &'a Scene,
    wide: &'a [WideNode],
    primitives: Vec<u32>,
    frame: Frame,
}

impl<'a> SceneImage<'a> {
    /// The image of a scene.
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        let root = &scene.nodes()[0];
        let there: Vec<u32> = (0..2).filter(|&side| root.child(side as usize) != Child::Absent).collect();
        let bounds = KernelIo::new(scene).bounds();
        let frame = Frame {
            low: bounds.min.to_array(),
            root: match there[..] {
                [] => 3,
                [side] => side,
                _ => 2,
            },
            high: bounds.max.to_array(),
            zero: 0,
        };
        let primitives = (0..scene.primitives().len()).map(|slot| scene.primitives().get(slot)).collect();
        Self { scene, wide: &[], primitives, frame }
    }

    /// The image of a scene in both layouts, over the triangles in the wide one's order.
    #[must_use]
    pub fn with_wide(tree: &'a WideTree) -> Self {
        Self { wide: tree.nodes(), ..Self::new(tree.scene()) }
    }

    /// The wide tree, which kernels over that layout read at binding 0 in place of the two-wide one: its name in
    /// errors, and its bytes; none if there is none.
    #[must_use]
    pub fn wide(&self) -> (String, &[u8]) {
        let two = size_of_val(self.scene.nodes());
        (format!("the scene's wide tree, beside the two-wide one of {two} bytes,"), bytemuck::cast_slice(self.wide))
    }

    /// What is in the buffers that change when triangles move: the two trees' nodes, the triangles and the box.
    pub(crate) fn moving(&self) -> (&[Node], &[WideNode], &[Triangle], &Frame) {
        (self.scene.nodes(), self.wide, self.scene.triangles(), &self.frame)
    }

    /// What the buffer is called in errors, and its bytes: those of bindings 0 to 3 of `bindings.wgsl`.
    #[must_use]
    pub fn buffers(&self) -> [(&'static str, &[u8]); 4] {
        [
            ("the scene's tree", bytemuck::cast_slice(self.scene.nodes())),
            ("the scene's triangles", bytemuck::cast_slice(self.scene.triangles())),
            ("the scene's primitive ids", bytemuck::cast_slice(&self.primitives)),
            ("the scene's box", bytemuck::bytes_of(&self.frame)),
        ]
    }

    /// Bytes of all buffers.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        size_of_val(self.wide) as u64 + self.buffers().iter().map(|(_, bytes)| bytes.len() as u64).sum::<u64>()
    }
}
