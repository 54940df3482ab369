//! What can go wrong in a run.

use rt_core::DeviceError;
use std::fmt;

/// Why a balancer could not be made or a stream not be traced.
#[derive(Debug)]
#[non_exhaustive]
pub enum BalanceError {
    /// No device was given.
    NoDevices,
    /// A device could not take the scene.
    Open {
        /// Name of the device.
        device: String,
        /// Why.
        source: DeviceError,
    },
    /// The mesh could not be built.
    Build(rt_bvh::BuildError),
    /// An output slice does not fit the stream.
    Length {
        /// Name of the argument.
        argument: &'static str,
        /// Its length.
        found: usize,
        /// Number of rays.
        rays: usize,
    },
    /// The output slice for hits does not fit a stream that asks for several of each ray.
    Hits {
        /// Its length.
        found: usize,
        /// Number of rays.
        rays: usize,
        /// Hits of each.
        most: usize,
    },
    /// A scene with masks or geometries cannot go on with another number of triangles, of which nothing is known.
    Attributes(rt_core::SceneError),
    /// The tasks are not consecutive ranges that cover the stream's rays.
    Tasks {
        /// First ray that is not where it should be.
        ray: u32,
    },
    /// A policy was chosen for a queue that takes none.
    PolicyUnused {
        /// Name of the policy.
        policy: &'static str,
        /// Name of the queue.
        queue: &'static str,
    },
    /// The caller's estimator asked or answered what makes no sense.
    Estimator {
        /// Its name.
        estimator: &'static str,
        /// What is wrong.
        mistake: String,
    },
    /// The caller's policy dealt other tasks, or to other devices, than it was given.
    Policy {
        /// Its name.
        policy: &'static str,
        /// What is wrong.
        mistake: String,
    },
    /// The queue broke one of its promises.
    Queue {
        /// Its name.
        queue: &'static str,
        /// What is wrong.
        mistake: String,
    },
    /// [`Scheduling::uninformed_excess`](crate::Scheduling::uninformed_excess) is no share.
    UninformedExcess(f64),
    /// The system cannot start a thread for a device.
    Thread {
        /// Name of the device, or its number.
        device: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// No device takes the stream: each refused it and is as it was.
    Refused {
        /// Name of the device.
        device: String,
        /// Why.
        source: DeviceError,
    },
    /// Every device failed. Hits of finished tasks are in the output.
    AllDevicesLost {
        /// Tasks that were not finished.
        unfinished: usize,
        /// Each device's failure.
        failures: Vec<(String, String)>,
    },
    /// The caller cancelled. Hits of finished tasks are in the output.
    Cancelled {
        /// Tasks that were not finished.
        unfinished: usize,
    },
}

impl BalanceError {
    /// The same error, of a stream with `tasks` unfinished tasks.
    #[must_use]
    pub(crate) fn with_unfinished(self, tasks: usize) -> Self {
        match self {
            Self::AllDevicesLost { failures, .. } => Self::AllDevicesLost { unfinished: tasks, failures },
            Self::Cancelled { .. } => Self::Cancelled { unfinished: tasks },
            other => other,
        }
    }
}

impl fmt::Display for BalanceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoDevices => write!(f, "no device was given: at least one is needed"),
            Self::Open { device, .. } => write!(f, "{device} cannot take the scene"),
            Self::Build(_) => write!(f, "the scene cannot be built"),
            Self::Length { argument, found, rays } => {
                write!(f, "argument `{argument}` has {found} entries but the stream has {rays} rays: make them equal")
            }
            Self::Attributes(_) => write!(
                f,
                "the masks and geometries of the scene are those of other triangles: give a scene of these to \
                 `replace_scene`"
            ),
            Self::Hits { found, rays, most } => write!(
                f,
                "argument `hits` has {found} entries, but {rays} rays with up to {most} hits each need {}",
                rays.saturating_mul(*most)
            ),
            Self::Tasks { ray } => {
                write!(f, "argument `tasks` must cover the stream's rays once and in order, which fails at ray {ray}")
            }
            Self::PolicyUnused { policy, queue } => {
                write!(f, "the {queue} queue takes no policy: leave {policy} out, or choose another queue")
            }
            Self::Estimator { estimator, mistake } => write!(f, "estimator {estimator}: {mistake}"),
            Self::Policy { policy, mistake } => write!(f, "policy {policy}: {mistake}"),
            Self::Queue { queue, mistake } => write!(f, "{queue} queue: {mistake}"),
            Self::UninformedExcess(found) => {
                write!(f, "uninformed_excess is {found}: give a share of the makespan, from 0 up, or None")
            }
            Self::Thread { device, .. } => {
                write!(
                    f,
                    "cannot start the threads of {device}: give fewer devices, or allow more threads (`ulimit -u`)"
                )
            }
            Self::Refused { device, .. } => write!(f, "{device} refused the stream"),
            Self::AllDevicesLost { unfinished, failures } => {
                write!(f, "every device failed, {unfinished} tasks are not finished:")?;
                failures.iter().try_for_each(|(device, why)| write!(f, " {device}: {why};"))
            }
            Self::Cancelled { unfinished } => write!(f, "cancelled with {unfinished} tasks not finished"),
        }
    }
}

impl std::error::Error for BalanceError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Open { source, .. } | Self::Refused { source, .. } => Some(source),
            Self::Build(source) => Some(source),
            Self::Attributes(source) => Some(source),
            Self::Thread { source, .. } => Some(source),
            _ => None,
        }
    }
}

impl From<rt_bvh::BuildError> for BalanceError {
    fn from(source: rt_bvh::BuildError) -> Self {
        Self::Build(source)
    }
}
