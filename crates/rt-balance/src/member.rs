//! The devices of a run, and the caller's slices that they fill.

use crate::BalanceError;
use crate::models::Models;
use rt_core::{DeviceInfo, Hit, Launch, TestCounts, Tracer, Traffic};

/// A device of the run.
#[derive(Debug)]
pub(crate) struct Member {
    pub(crate) info: DeviceInfo,
    /// Absent once the device has failed.
    pub(crate) tracer: Option<Box<dyn Tracer>>,
    pub(crate) models: Models,
    pub(crate) failure: Option<String>,
    /// Results of the last launch, kept for their memory: a large launch would otherwise spend a twentieth of its time
    /// on fresh pages.
    pub(crate) buffers: Launch,
    /// What went to and fro before the current stream.
    pub(crate) before: Traffic,
}

/// The caller's slices, shared by the device threads.
#[derive(Debug)]
pub(crate) struct Outputs<'a> {
    pub(crate) hits: &'a mut [Hit],
    pub(crate) counts: Option<&'a mut [TestCounts]>,
}

impl Member {
    /// To be called before a stream.
    pub(crate) fn begin(&mut self) {
        self.before = self.tracer.as_ref().map(|tracer| tracer.traffic()).unwrap_or_default();
    }

    /// What went to and fro since then; unknown of a device that failed.
    pub(crate) fn traffic(&self) -> Option<Traffic> {
        self.tracer.as_ref().map(|tracer| tracer.traffic().since(&self.before))
    }

    /// Drops the device out of this and all later streams.
    pub(crate) fn fail(&mut self, error: &rt_core::DeviceError) {
        self.tracer = None;
        self.failure = Some(describe(error));
    }
}

/// An error and its causes on one line.
pub(crate) fn describe(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(": ");
        text.push_str(&cause.to_string());
        source = cause.source();
    }
    text
}

pub(crate) fn all_lost(members: &[Member], unfinished: usize) -> BalanceError {
    let failures = members.iter().filter_map(|m| Some((m.info.name.clone(), m.failure.clone()?))).collect();
    BalanceError::AllDevicesLost { unfinished, failures }
}
