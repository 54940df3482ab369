//! The validation layer.

use crate::{Backend, Found, limits};
use backend_vulkan::{OpenError, Options, VulkanDevice};
use libtest_mimic::{Completion, Failed, Trial};

pub(crate) fn trials(found: &Found) -> Vec<Trial> {
    let mut all = vec![found.ignorable("the_validation_layer_is_at_work", the_validation_layer_is_at_work)];
    if found.position == 0 {
        let test = limits::a_card_too_small_for_both_trees_holds_one;
        all.push(found.trial("a_card_too_small_for_both_trees_holds_one", test));
    }
    all
}

/// A wrong call is objected to: else no message in the other tests would mean nothing.
fn the_validation_layer_is_at_work(found: &Found) -> Result<Completion, Failed> {
    // Opened anew, so that the message does not reach the other tests.
    let devices = match VulkanDevice::enumerate(Options { validation: true, ..Options::default() }) {
        Err(e @ OpenError::NoValidation) if !Backend::Vulkan.is_required() => {
            return Ok(Completion::ignored_with(e.to_string()));
        }
        devices => devices?,
    };
    let device = devices.into_iter().nth(found.position).ok_or("the device is gone")??;
    match device.provoke_validation() {
        Err(e) if e.to_string().contains("VUID") => Ok(Completion::Completed),
        other => Err(format!("a wrong copy was not objected to: {other:?}").into()),
    }
}
