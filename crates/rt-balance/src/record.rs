//! What was measured of single calls to devices.

use crate::report::{Activity, ActivityKind};
use rt_core::{Span, TaskOutcome};
use std::time::Duration;

/// One call of [`rt_core::Tracer::walk`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct WalkDone {
    pub(crate) member: usize,
    pub(crate) span: Span,
    pub(crate) rays: u32,
    pub(crate) boxes: u64,
    pub(crate) triangles: u64,
}

impl WalkDone {
    /// The walk as a bar of the timeline that begins at `origin`.
    pub(crate) fn activity(&self, origin: Duration) -> Activity {
        Activity {
            device: self.member,
            kind: ActivityKind::Estimate,
            start_s: self.span.start.saturating_sub(origin).as_secs_f64(),
            end_s: self.span.end.saturating_sub(origin).as_secs_f64(),
            tasks: Vec::new(),
            rays: self.rays,
            predicted_s: None,
        }
    }
}

/// A launch whose hits are on the host.
#[derive(Debug)]
pub(crate) struct LaunchDone {
    /// Position of the device among all members.
    pub(crate) member: usize,
    pub(crate) span: Span,
    pub(crate) rays: u32,
    pub(crate) outcomes: Vec<TaskOutcome>,
    /// Whether all of the launch's tasks are among the outcomes: another device may have been faster with some.
    pub(crate) whole: bool,
    /// Whether the outcomes' seconds were measured per task, not apportioned.
    pub(crate) per_task: bool,
}

impl LaunchDone {
    /// The launch as a bar of the timeline that begins at `origin`.
    pub(crate) fn activity(&self, origin: Duration) -> Activity {
        Activity {
            device: self.member,
            kind: ActivityKind::Launch,
            start_s: self.span.start.saturating_sub(origin).as_secs_f64(),
            end_s: self.span.end.saturating_sub(origin).as_secs_f64(),
            tasks: self.outcomes.iter().map(|outcome| outcome.task).collect(),
            rays: self.rays,
            predicted_s: Some(self.outcomes.iter().map(|outcome| outcome.predicted_s).sum()),
        }
    }
}
