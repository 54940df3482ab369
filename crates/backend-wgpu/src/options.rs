//! How devices are to be opened.

use rt_gpu::{BadVariable, Faults, Layouts};
#[cfg(feature = "test-support")]
use rt_shaders::Kernel;

/// How to open devices.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Whether kernels run without wgpu's checks of every access and its bounds on loops. They need none; wgpu does not
    /// know that.
    pub trusted: bool,
    /// The layouts of scenes' trees; `None`: [`Layouts::USUAL`]. Where a scene with both trees does not fit, the
    /// two-wide one alone does all, and [`rt_core::Tracer::note`] says so, unless tests are to be counted over the wide
    /// one.
    pub layouts: Option<Layouts>,
    /// WGSL in place of a kernel's own, for tests that want kernels to fail. Not with `trusted`.
    #[cfg(feature = "test-support")]
    pub kernels: Option<fn(&'static Kernel) -> String>,
    /// What goes wrong on purpose, for tests of this crate and of programs that use it.
    #[cfg(feature = "test-support")]
    pub fault: Option<rt_gpu::FaultInjection>,
}

impl Options {
    /// Trusted kernels if the environment variable `RAYBALANCE_WGPU_TRUSTED` is `1`.
    ///
    /// # Errors
    /// When the variable is neither `1` nor `0` nor empty.
    pub fn from_env() -> Result<Self, BadVariable> {
        Ok(Self { trusted: rt_gpu::switch("RAYBALANCE_WGPU_TRUSTED")?, ..Self::default() })
    }

    pub(crate) fn faults(&self) -> Faults {
        #[cfg(feature = "test-support")]
        return Faults::of(self.fault);
        #[cfg(not(feature = "test-support"))]
        return Faults::default();
    }
}
