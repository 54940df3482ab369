//! How devices are to be opened.

use rt_gpu::{BadVariable, Faults, Layouts};
#[cfg(feature = "test-support")]
use rt_shaders::Kernel;

/// How to open devices.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Whether the validation layer checks every call, synchronisation included. What it objects to becomes an error of
    /// kind [`rt_core::DeviceErrorKind::Lost`] of the next launch that is waited for.
    pub validation: bool,
    /// The layouts of scenes' trees; `None`: [`Layouts::USUAL`]. Where a scene with both trees does not fit, the
    /// two-wide one alone does all, and [`rt_core::Tracer::note`] says so, unless tests are to be counted over the wide
    /// one.
    pub layouts: Option<Layouts>,
    /// Most bytes of the device's own memory that scenes and streams may take together; `None`: all that there is.
    /// Whatever does not fit is refused with [`rt_core::DeviceErrorKind::OutOfMemory`], as on a card that is too small.
    pub memory: Option<u64>,
    /// What goes wrong on purpose, for tests of this crate and of programs that use it.
    #[cfg(feature = "test-support")]
    pub fault: Option<rt_gpu::FaultInjection>,
    /// SPIR-V in place of kernels' own, for tests that want kernels to fail.
    #[cfg(feature = "test-support")]
    pub kernels: Option<Replacement>,
}

impl Options {
    /// Validation if the environment variable `RAYBALANCE_VULKAN_VALIDATION` is `1`.
    ///
    /// # Errors
    /// When the variable is neither `1` nor `0` nor empty.
    pub fn from_env() -> Result<Self, BadVariable> {
        Ok(Self { validation: rt_gpu::switch("RAYBALANCE_VULKAN_VALIDATION")?, ..Self::default() })
    }

    pub(crate) fn faults(&self) -> Faults {
        #[cfg(feature = "test-support")]
        return Faults::of(self.fault);
        #[cfg(not(feature = "test-support"))]
        return Faults::default();
    }
}

/// SPIR-V that runs in place of kernels' own. Drivers trust it, so to make one is unsafe.
#[cfg(feature = "test-support")]
#[derive(Clone, Copy, Debug)]
pub struct Replacement(pub(crate) fn(&'static Kernel) -> Vec<u32>);

#[cfg(feature = "test-support")]
impl Replacement {
    /// What runs in place of each kernel.
    ///
    /// # Safety
    /// For every kernel of `rt_shaders`, `words` must return valid SPIR-V that Vulkan 1.2 takes without features or
    /// extensions beyond those of [`Kernel::spirv_with`] for the device; with the kernel's entry point, workgroup and
    /// buffers; that accesses nothing that the kernel would not access; and that ends.
    #[must_use]
    pub const unsafe fn new(words: fn(&'static Kernel) -> Vec<u32>) -> Self {
        Self(words)
    }
}
