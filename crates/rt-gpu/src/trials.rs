//! Whether a device makes the rays that the host makes: found out when the first are wanted, once.

use crate::bounce;
use rt_bvh::kernel_io::KernelRay;
use rt_core::DeviceError;
use rt_shaders::Purpose;
use std::sync::OnceLock;

/// Which of the kernels that make rays a device can be trusted with.
#[derive(Debug, Default)]
pub struct Trials {
    camera: OnceLock<bool>,
    bounce: OnceLock<bool>,
}

impl Trials {
    /// Whether the kernel for `purpose` makes rays, those of the host. `camera` and `bounces` are asked at most once,
    /// for what [`crate::camera::fault`] and [`crate::bounce::fault`] find.
    pub fn passed(
        &self,
        purpose: Purpose,
        camera: impl FnOnce() -> Result<Option<String>, DeviceError>,
        bounces: impl FnOnce(&[bounce::Trial]) -> Result<Option<String>, DeviceError>,
    ) -> bool {
        // A device that is lost will say so when it is used.
        match purpose {
            Purpose::Camera => *self.camera.get_or_init(|| matches!(camera(), Ok(None))),
            Purpose::Bounce => *self.bounce.get_or_init(|| matches!(bounces(&bounce::trials()), Ok(None))),
            _ => false,
        }
    }
}

/// The first ray that is neither the `expected` one nor left to the host, in words, or that more than the share
/// `left_out` are left; `None` if the device passes. `name_of` says which ray one is.
pub(crate) fn first_fault(
    expected: &[KernelRay],
    made: &[KernelRay],
    left_out: f64,
    name_of: impl Fn(usize) -> String,
) -> Option<String> {
    if made.len() != expected.len() {
        return Some(format!("it makes {} rays of {}", made.len(), expected.len()));
    }
    let mut left = 0;
    for (i, (expected, made)) in expected.iter().zip(made).enumerate() {
        if made.kind == KernelRay::HOST {
            left += 1;
        } else if bytemuck::bytes_of(expected) != bytemuck::bytes_of(made) {
            return Some(format!("it makes {} as {made:?}, not {expected:?}", name_of(i)));
        }
    }
    let share = f64::from(left) / made.len() as f64;
    (share > left_out).then(|| format!("it leaves {left} of {} rays to the host", made.len()))
}
