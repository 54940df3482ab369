//! Which device runs which tasks, in which order.

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use rt_core::{CostModel, TaskId, Work};

/// One list of tasks per device, each task of the stream in exactly one list.
///
/// A schedule over no devices has no lists and places no task; it still knows how many tasks there are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Schedule {
    lists: Vec<Vec<TaskId>>,
    seconds: Vec<f64>,
    tasks: usize,
}

impl Schedule {
    /// A schedule from one list per device, each in the order to be run.
    ///
    /// # Errors
    /// When there is not one list for each device, or a task of `work` is missing, named twice or unknown.
    pub fn new(lists: Vec<Vec<TaskId>>, work: &[Work], devices: &[CostModel]) -> Result<Self, ScheduleError> {
        if lists.len() != devices.len() {
            return Err(ScheduleError::Lists { lists: lists.len(), devices: devices.len() });
        }
        let mut seen = vec![false; work.len()];
        for &task in lists.iter().flatten() {
            let slot = seen.get_mut(task as usize).ok_or(ScheduleError::Unknown { task, tasks: work.len() })?;
            if core::mem::replace(slot, true) {
                return Err(ScheduleError::Twice { task });
            }
        }
        if let (Some(task), false) = (seen.iter().position(|&s| !s), devices.is_empty()) {
            return Err(ScheduleError::Missing { task: task as TaskId });
        }
        let seconds = lists.iter().zip(devices).map(|(list, model)| list_seconds(list, work, model)).collect();
        Ok(Self { lists, seconds, tasks: work.len() })
    }

    /// A schedule whose parts the policies of this crate have made right.
    pub(crate) const fn from_parts(lists: Vec<Vec<TaskId>>, seconds: Vec<f64>, tasks: usize) -> Self {
        Self { lists, seconds, tasks }
    }

    /// One list per device, in the order to be run.
    #[must_use]
    pub fn lists(&self) -> &[Vec<TaskId>] {
        &self.lists
    }

    /// Predicted seconds of each device: its tasks, and one launch where it has any. [`Lpt`](crate::policy::Lpt) rounds
    /// each task to about 2⁻¹⁹ of the most expensive.
    #[must_use]
    pub fn seconds(&self) -> &[f64] {
        &self.seconds
    }

    /// Number of tasks of the stream.
    #[must_use]
    pub const fn tasks(&self) -> usize {
        self.tasks
    }

    /// Predicted seconds until the last device is done; 0 without devices.
    #[must_use]
    pub fn makespan(&self) -> f64 {
        self.seconds.iter().copied().fold(0.0, f64::max)
    }
}

/// Predicted seconds of one launch of `list`; 0 for no tasks.
pub(crate) fn list_seconds(list: &[TaskId], work: &[Work], model: &CostModel) -> f64 {
    let launch = if list.is_empty() { 0.0 } else { model.per_launch() };
    launch + list.iter().map(|&task| model.seconds(&work[task as usize])).sum::<f64>()
}

/// Why [`Schedule::new`] refused its lists: always a defect of the policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ScheduleError {
    /// Lists and devices differ in number.
    Lists {
        /// Number of lists.
        lists: usize,
        /// Number of devices.
        devices: usize,
    },
    /// A task is in no list.
    Missing {
        /// The task.
        task: TaskId,
    },
    /// A task is listed twice.
    Twice {
        /// The task.
        task: TaskId,
    },
    /// A listed task is not one of the stream.
    Unknown {
        /// The task.
        task: TaskId,
        /// Number of tasks of the stream.
        tasks: usize,
    },
}

impl fmt::Display for ScheduleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lists { lists, devices } => write!(f, "{lists} lists for {devices} devices: give one for each"),
            Self::Missing { task } => write!(f, "task {task} is in no list"),
            Self::Twice { task } => write!(f, "task {task} is listed twice"),
            Self::Unknown { task, tasks } => write!(f, "task {task} is listed, but there are only {tasks} tasks"),
        }
    }
}

impl core::error::Error for ScheduleError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defective_lists_are_refused() {
        let work = [Work::new(1.0, 1.0, 0.0); 3];
        let devices = [CostModel::UNIT; 2];
        let new = |lists: &[&[TaskId]]| Schedule::new(lists.iter().map(|l| l.to_vec()).collect(), &work, &devices);
        assert_eq!(new(&[&[0, 1, 2]]), Err(ScheduleError::Lists { lists: 1, devices: 2 }));
        assert_eq!(new(&[&[0, 1], &[]]), Err(ScheduleError::Missing { task: 2 }));
        assert_eq!(new(&[&[0, 1], &[1, 2]]), Err(ScheduleError::Twice { task: 1 }));
        assert_eq!(new(&[&[0, 1], &[2, 3]]), Err(ScheduleError::Unknown { task: 3, tasks: 3 }));
        let good = new(&[&[0, 1], &[2]]).expect("each task once");
        assert_eq!((good.seconds(), good.makespan()), (&[4e-9, 2e-9][..], 4e-9));
    }
}
