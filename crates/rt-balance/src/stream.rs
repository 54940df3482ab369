//! What is traced, and how it is scheduled.

use crate::report::StreamRun;
use crate::{Audit, BalanceError, Limits};
use rt_core::{CostEstimator, Hit, RaySource, RayStream, StreamKind, StreamSpec, Task, TestCounts, tasks_of};
pub use rt_sched::cut::DEFAULT_TASK_SIZE;
use rt_sched::cut::cut_for;
use rt_sched::estimate::Auto;
use rt_sched::policy::{Lpt, Policy};
use rt_sched::queue::{Needs, QueueKind, QueueMaker};
use std::sync::atomic::{AtomicBool, Ordering};

/// A stream of rays, cut into tasks.
#[derive(Clone, Debug)]
pub struct Stream {
    /// Where the rays come from.
    pub source: RaySource,
    /// What made them.
    pub kind: StreamKind,
    /// What is asked of each.
    pub spec: StreamSpec,
    /// Consecutive ranges that cover all rays. Those that are too large for the devices to end together are cut finer
    /// where the queue says so ([`QueueMaker::cuts`]); what was traced is in [`StreamRun::tasks`].
    pub tasks: Vec<Task>,
    /// Seed of the estimator's samples.
    pub seed: u32,
    /// Frame of an animation, for the report.
    pub frame: u32,
    /// Wave of the frame, for the report.
    pub wave: u32,
}

impl Stream {
    /// A stream with tasks of [`DEFAULT_TASK_SIZE`] rays.
    #[must_use]
    pub fn new(source: RaySource, kind: StreamKind, spec: StreamSpec) -> Self {
        let tasks = tasks_of(source.len(), DEFAULT_TASK_SIZE);
        Self { source, kind, spec, tasks, seed: 0, frame: 0, wave: 0 }
    }

    /// The same stream cut into tasks of `rays` rays.
    #[must_use]
    pub fn with_task_size(mut self, rays: u32) -> Self {
        self.tasks = tasks_of(self.source.len(), rays);
        self
    }

    /// The same stream cut for so many devices: into tasks of [`DEFAULT_TASK_SIZE`] rays, or of half or a quarter of
    /// that where devices would have too few to balance.
    #[must_use]
    pub fn with_tasks_for(mut self, devices: usize) -> Self {
        self.tasks = cut_for(self.source.len(), devices);
        self
    }

    /// The same stream cut as `run` says that it was traced.
    #[must_use]
    pub fn cut_as(&self, run: &StreamRun) -> Self {
        Self { tasks: run.tasks.clone(), ..self.clone() }
    }

    /// The estimator's view of the stream, when `devices` devices trace it that are expected to lose
    /// `uninformed_excess` without an estimate; `moves` says whether tasks are moved while they run.
    #[must_use]
    pub fn view(&self, devices: usize, uninformed_excess: f64, moves: bool) -> RayStream<'_> {
        let devices = u32::try_from(devices).unwrap_or(u32::MAX);
        RayStream {
            coherence: self.spec.coherence,
            seed: self.seed,
            wave: self.wave,
            source: Some(&self.source),
            devices,
            uninformed_excess,
            moves,
            ..RayStream::new(self.kind, &self.tasks)
        }
    }

    /// Checks that the tasks cover the rays, and that every ray has an origin if any has.
    pub(crate) fn check(&self) -> Result<(), BalanceError> {
        if let RaySource::Explicit { rays, origins: Some(origins) } = &self.source
            && origins.len() != rays.len()
        {
            return Err(BalanceError::Length { argument: "origins", found: origins.len(), rays: rays.len() });
        }
        let mut next = 0_u32;
        for task in &self.tasks {
            if task.first != next {
                return Err(BalanceError::Tasks { ray: next });
            }
            next = task.first.checked_add(task.rays).ok_or(BalanceError::Tasks { ray: next })?;
        }
        if next == self.source.len() { Ok(()) } else { Err(BalanceError::Tasks { ray: next }) }
    }
}

/// How a stream is estimated and scheduled.
#[derive(Debug)]
pub struct Scheduling {
    /// Estimates the cost of each task.
    pub estimator: Box<dyn CostEstimator>,
    /// Deals tasks to devices, or orders them, as the queue needs; `None`: longest processing time first.
    pub policy: Option<Box<dyn Policy>>,
    /// Makes what hands tasks out: a [`QueueKind`], or one's own.
    pub queue: Box<dyn QueueMaker>,
    /// What a stream loses without an estimate, as a share of its makespan, for estimators that ask whether they pay;
    /// `None`: as expected from queue, tasks and devices ([`rt_sched::uninformed`]). With 1 an estimate always pays.
    pub uninformed_excess: Option<f64>,
    /// How long devices may take.
    pub limits: Limits,
    /// How many of the hits the host traces again, to see whether a device can be believed.
    pub audit: Audit,
}

impl Default for Scheduling {
    /// The hybrid queue over the estimator that chooses for itself.
    fn default() -> Self {
        Self {
            estimator: Box::<Auto>::default(),
            policy: None,
            queue: Box::<QueueKind>::default(),
            uninformed_excess: None,
            limits: Limits::default(),
            audit: Audit::default(),
        }
    }
}

impl Scheduling {
    /// Checks what a caller can get wrong.
    pub(crate) fn check(&self) -> Result<(), BalanceError> {
        self.policy()?;
        match self.uninformed_excess {
            Some(excess) if excess.is_nan() || excess < 0.0 => Err(BalanceError::UninformedExcess(excess)),
            _ => Ok(()),
        }
    }

    /// The policy that will deal the tasks.
    ///
    /// # Errors
    /// When a policy was chosen for a queue that needs none.
    pub fn policy(&self) -> Result<&dyn Policy, BalanceError> {
        const LPT: Lpt = Lpt;
        match (&self.policy, self.queue.needs()) {
            (None, _) => Ok(&LPT),
            (Some(policy), Needs::Lists | Needs::Order) => Ok(&**policy),
            (Some(policy), Needs::Nothing) => {
                Err(BalanceError::PolicyUnused { policy: policy.name(), queue: self.queue.name() })
            }
        }
    }

    /// Name of the policy that will deal the tasks; `None` for a queue that needs none.
    #[must_use]
    pub fn policy_name(&self) -> Option<&'static str> {
        (self.queue.needs() != Needs::Nothing).then(|| self.policy.as_ref().map_or(Lpt.name(), |policy| policy.name()))
    }
}

/// The caller's hand on a running trace.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// Set to `true` (from any thread) to stop at once. Devices end what they are at behind the caller's back; the next
    /// stream waits for them.
    pub cancel: Option<&'a AtomicBool>,
    /// Called with (rays done, rays of the stream), after every launch at most, by the thread that traces, which does
    /// nothing else meanwhile: it should be short. Rays done become fewer where a device is not believed any more. A
    /// panic in it stops the stream and is passed on when the devices are at rest; they are as good as before.
    pub progress: Option<&'a dyn Fn(u64, u64)>,
    /// Called with each task's results once they are in the output, by the thread that traces: a viewer can show them
    /// while others are traced. A task comes again where the device that traced it is not believed any more; what it
    /// was told last is right. Panics are as in `progress`.
    pub finished: Option<&'a dyn Fn(Finished<'_>)>,
}

/// A task whose results are there.
#[derive(Clone, Copy, Debug)]
pub struct Finished<'a> {
    /// The rays: a range of the stream.
    pub task: Task,
    /// Their hits, in order; as many for each as the stream asks for.
    pub hits: &'a [Hit],
    /// Their counts, if there is room for them and the stream counts.
    pub counts: Option<&'a [TestCounts]>,
}

impl Control<'_> {
    pub(crate) fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    pub(crate) fn report(&self, done: u64, total: u64) {
        if let Some(progress) = self.progress {
            progress(done, total);
        }
    }
}

impl std::fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Control")
            .field("cancel", &self.cancel)
            .field("progress", &self.progress.is_some())
            .field("finished", &self.finished.is_some())
            .finish()
    }
}
