//! Runs a plan: one host thread per device, two launches in flight, every task finished exactly once.

use crate::member::{Member, Outputs, all_lost};
use crate::plan::Plan;
use crate::record::LaunchDone;
use crate::{BalanceError, Control, Stream};
use rt_core::{DeviceError, DeviceErrorKind, Launch, Task, TaskId, TaskOutcome, Ticket, Tracer};
use rt_sched::queue::{Pop, TaskQueue};
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Longest sleep of a device that waits for others; the bell wakes it sooner, this only bounds a missed ring.
const NAP: Duration = Duration::from_millis(5);

/// What happened.
#[derive(Debug, Default)]
pub(crate) struct Ran {
    pub(crate) launches: Vec<LaunchDone>,
}

/// What the device threads share.
struct Shared<'a, 'o> {
    stream: &'a Stream,
    plan: &'a Plan,
    outputs: &'a Mutex<Outputs<'o>>,
    control: Control<'a>,
    limit: Duration,
    bell: Bell,
    /// Lanes that have taken their first launch.
    begun: AtomicUsize,
    rays_done: AtomicU64,
}

/// Longest wait of a device for the others to take their first launch: threads start within some 100 µs, and one that does
/// not must not hold up the rest.
const START: Duration = Duration::from_millis(1);

/// Wakes devices that wait for work when something changed.
#[derive(Default)]
struct Bell {
    rings: Mutex<u64>,
    changed: Condvar,
}

impl Bell {
    fn rings(&self) -> u64 {
        *self.rings.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn ring(&self) {
        *self.rings.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        self.changed.notify_all();
    }

    /// Waits until the bell has rung since `heard`, or a nap long.
    fn wait(&self, heard: u64) {
        let rings = self.rings.lock().unwrap_or_else(PoisonError::into_inner);
        // Waking early or late only costs another look at the queue.
        drop(self.changed.wait_timeout_while(rings, NAP, |rings| *rings == heard));
    }
}

pub(crate) fn run(
    members: &mut [Member],
    stream: &Stream,
    plan: &Plan,
    outputs: &Mutex<Outputs<'_>>,
    control: Control<'_>,
    limit: Duration,
) -> Result<Ran, BalanceError> {
    let shared = Shared {
        stream,
        plan,
        outputs,
        control,
        limit,
        bell: Bell::default(),
        begun: AtomicUsize::new(0),
        rays_done: AtomicU64::new(0),
    };
    let mut ran = Ran::default();
    std::thread::scope(|scope| {
        let shared = &shared;
        // Lanes are member positions in increasing order, so one pass hands out disjoint borrows.
        let mut rest = members.iter_mut().enumerate();
        let lanes = plan.lanes.iter().enumerate();
        let handles: Vec<_> = lanes
            .filter_map(|(lane, &index)| {
                let (_, member) = rest.find(|(i, _)| *i == index)?;
                Some(scope.spawn(move || Lane { lane, index, shared, in_flight: VecDeque::new() }.drive(member)))
            })
            .collect();
        for handle in handles {
            if let Ok(launches) = handle.join() {
                ran.launches.extend(launches);
            }
        }
    });
    let finished: usize = ran.launches.iter().map(|launch| launch.outcomes.len()).sum();
    match stream.tasks.len() - finished {
        0 => Ok(ran),
        unfinished if control.is_cancelled() => Err(BalanceError::Cancelled { unfinished }),
        unfinished => Err(all_lost(members, unfinished)),
    }
}

/// One device's thread.
struct Lane<'a, 'o> {
    /// The queue's number for the device.
    lane: usize,
    /// Its position among all members.
    index: usize,
    shared: &'a Shared<'a, 'o>,
    in_flight: VecDeque<(Ticket, Vec<TaskId>)>,
}

impl Lane<'_, '_> {
    fn drive(mut self, member: &mut Member) -> Vec<LaunchDone> {
        let mut launches = Vec::new();
        let capacity = member.info.in_flight.max(1) as usize;
        // A panic in one backend must not leave the others waiting for its tasks.
        let result = catch_unwind(AssertUnwindSafe(|| match &mut member.tracer {
            Some(tracer) => self.work(&mut **tracer, capacity, &mut member.buffers, &mut launches),
            None => Ok(()),
        }))
        .unwrap_or_else(|_| Err(DeviceError::new(DeviceErrorKind::Lost, "the backend panicked")));
        if let Err(error) = result {
            let unfinished: Vec<TaskId> = self.in_flight.drain(..).flat_map(|(_, tasks)| tasks).collect();
            self.shared.plan.queue.retire(self.lane, &unfinished);
            member.fail(&error);
            self.shared.bell.ring();
        }
        launches
    }

    fn work(
        &mut self,
        tracer: &mut dyn Tracer,
        capacity: usize,
        buffers: &mut Launch,
        launches: &mut Vec<LaunchDone>,
    ) -> Result<(), DeviceError> {
        let queue: &dyn TaskQueue = &*self.shared.plan.queue;
        let mut begun = false;
        loop {
            let heard = self.shared.bell.rings();
            let mut last = Pop::Done;
            while self.in_flight.len() < capacity && !self.shared.control.is_cancelled() {
                let mut tasks = Vec::new();
                last = queue.pop(self.lane, &mut tasks);
                if last != Pop::Launch {
                    break;
                }
                // Dearest first is for choosing them: in a launch neighbours belong together, for caches, and since ranges of rays
                // that follow each other are one.
                tasks.sort_unstable();
                let ranges: Vec<Task> = tasks.iter().map(|&id| self.shared.stream.tasks[id as usize]).collect();
                let ticket = tracer.submit(&ranges, self.shared.plan.kept.as_ref());
                // In flight before the error is looked at, so that a failed submit's tasks are given back too.
                self.in_flight.push_back((ticket.as_ref().map_or(Ticket(u64::MAX), |t| *t), tasks));
                ticket?;
                if !std::mem::replace(&mut begun, true) {
                    self.begin();
                    self.others_begin();
                }
            }
            if !std::mem::replace(&mut begun, true) {
                self.begin();
            }
            let Some((ticket, _)) = self.in_flight.front() else {
                if last == Pop::Wait && !self.shared.control.is_cancelled() {
                    self.shared.bell.wait(heard);
                    continue;
                }
                return Ok(());
            };
            tracer.wait(*ticket, self.shared.limit, buffers)?;
            self.check(buffers)?;
            if let Some((_, tasks)) = self.in_flight.pop_front() {
                launches.push(self.take(&tasks, buffers));
                queue.finish(self.lane, &tasks);
                self.shared.bell.ring();
            }
        }
    }

    /// Says that this device has its first launch, or that there is none for it.
    fn begin(&self) {
        self.shared.begun.fetch_add(1, Ordering::AcqRel);
    }

    /// Lets every device take its first launch before any takes its second: queues hand out the dearest tasks first, and two
    /// of them on one device could be the makespan.
    fn others_begin(&self) {
        let Shared { begun, plan, .. } = self.shared;
        let start = Instant::now();
        while begun.load(Ordering::Acquire) < plan.lanes.len() && start.elapsed() < START {
            std::thread::yield_now();
        }
    }

    /// Refuses a launch that does not answer for every ray it was given, before any of it reaches the caller.
    fn check(&self, launch: &Launch) -> Result<(), DeviceError> {
        let Shared { stream, .. } = self.shared;
        let tasks = self.in_flight.front().map_or(&[][..], |(_, tasks)| tasks);
        let rays: usize = tasks.iter().map(|&id| stream.tasks[id as usize].rays as usize).sum();
        if launch.hits.len() == rays && (!stream.spec.counts || launch.counts.len() == rays) {
            return Ok(());
        }
        let message = format!("a launch of {rays} rays came back with {} hits", launch.hits.len());
        Err(DeviceError::new(DeviceErrorKind::Lost, message))
    }

    /// Copies a launch's results to the caller's slices and notes what it took.
    fn take(&self, tasks: &[TaskId], launch: &Launch) -> LaunchDone {
        let Shared { stream, plan, .. } = self.shared;
        let mut out = self.shared.outputs.lock().unwrap_or_else(PoisonError::into_inner);
        let mut at = 0;
        for &id in tasks {
            let task = stream.tasks[id as usize];
            let (from, to) = (at..at + task.rays as usize, task.first as usize..(task.first + task.rays) as usize);
            at = from.end;
            let masked = |ray: usize| plan.kept.as_ref().is_some_and(|mask| mask.contains(ray as u32));
            copy(&launch.hits[from.clone()], &mut out.hits[to.clone()], to.start, masked);
            if let (Some(counts), true) = (&mut out.counts, stream.spec.counts) {
                copy(&launch.counts[from], &mut counts[to.clone()], to.start, masked);
            }
        }
        drop(out);
        let rays = at as u64;
        let done = self.shared.rays_done.fetch_add(rays, Ordering::Relaxed) + rays;
        self.shared.control.report(done, u64::from(stream.source.len()));

        let predicted: Vec<f64> = tasks.iter().map(|&id| plan.seconds(self.lane, id)).collect();
        let per_task = launch.task_seconds.len() == tasks.len();
        let total: f64 = predicted.iter().sum();
        let busy = launch.span.in_kernel.as_secs_f64();
        let measured = |i: usize| match launch.task_seconds.get(i) {
            Some(&seconds) if per_task => f64::from(seconds),
            _ if total > 0.0 => busy * predicted[i] / total,
            _ => busy / tasks.len() as f64,
        };
        let outcome = |(i, &task)| TaskOutcome { task, predicted_s: predicted[i], measured_s: measured(i) };
        LaunchDone {
            member: self.index,
            span: launch.span,
            rays: at as u32,
            outcomes: tasks.iter().enumerate().map(outcome).collect(),
            per_task,
        }
    }
}

/// Copies the results of rays that were traced in this launch.
fn copy<T: Copy>(from: &[T], to: &mut [T], first: usize, masked: impl Fn(usize) -> bool) {
    for (offset, (from, to)) in from.iter().zip(to).enumerate() {
        if !masked(first + offset) {
            *to = *from;
        }
    }
}
