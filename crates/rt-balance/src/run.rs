//! Runs a plan: two launches in flight on every device, every task finished exactly once.
//!
//! One thread decides, the caller's: it hears devices' threads through one channel, copies results, asks the queue what
//! comes next, and looks at the clock. So a queue, a callback or a slow device meets no other thread in here, nothing
//! is locked, and a device that does not answer costs the others nothing.
//!
//! A task is finished by the first answer that can be believed. Who else was asked for it, since the first was late,
//! answers for nothing. Tasks of a device that is not believed any more are open again, all of them.

use crate::device_state::{DeviceState, all_lost};
use crate::device_thread::{Answer, Call, Done};
use crate::estimate::{Finders, find_again};
use crate::limits::{Heard, Limits, OVERRUN, after, earlier, hear};
use crate::output::Output;
use crate::plan::Plan;
use crate::record::{LaunchDone, WalkDone};
use crate::{BalanceError, Control, Stream};
use rt_core::{Launch, Task, TaskId, TaskOutcome};
use rt_sched::queue::Pop;
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// What happened.
#[derive(Debug, Default)]
pub(crate) struct Ran {
    pub(crate) launches: Vec<LaunchDone>,
    /// Walks of rays whose hits were not believed.
    pub(crate) walks: Vec<WalkDone>,
}

/// Traces every task of the plan.
///
/// # Errors
/// When the caller cancels, every device failed, or the queue breaks its promises. Finished tasks are in `output` even
/// then.
pub(crate) fn run(
    members: &mut [DeviceState],
    stream: &Stream,
    plan: &Plan,
    finders: &[Finders],
    output: &mut Output<'_>,
    limits: &Limits,
    control: Control<'_>,
) -> Result<Ran, BalanceError> {
    let (to, answers) = channel();
    let run = Run {
        stream,
        plan,
        finders,
        limits,
        control,
        workers: plan.workers.iter().map(|&member| Worker::new(member, members[member].info.in_flight)).collect(),
        by: vec![None; stream.tasks.len()],
        open: stream.tasks.len(),
        again: Vec::new(),
        predicted_s: 0.0,
        measured_s: 0.0,
        rays_done: 0,
        repaired: Vec::new(),
        to,
        answers,
        ran: Ran::default(),
    };
    run.all(members, output)
}

/// A launch that a device was asked for.
#[derive(Debug)]
struct Flight {
    /// In the stream's order.
    tasks: Vec<TaskId>,
    /// Whether the queue handed them out; else they are done again.
    queued: bool,
    predicted_s: f64,
}

/// A device's part in the run. Its position among all is the queue's number for it.
#[derive(Debug)]
struct Worker {
    member: usize,
    /// How many launches may be in flight.
    capacity: usize,
    /// Oldest first.
    in_flight: VecDeque<Flight>,
    /// Whether it was asked for the results of the oldest.
    waiting: bool,
    /// Since when it may have been at the oldest.
    since: Instant,
    /// Whether its tasks were given to others, too.
    late: bool,
    /// Whether that ever was so: then the queue may take it for lost.
    was_late: bool,
    alive: bool,
}

impl Worker {
    fn new(member: usize, capacity: u32) -> Self {
        Self {
            member,
            capacity: capacity.max(1) as usize,
            in_flight: VecDeque::new(),
            waiting: false,
            since: Instant::now(),
            late: false,
            was_late: false,
            alive: true,
        }
    }

    const fn is_punctual(&self) -> bool {
        self.alive && !self.late
    }
}

struct Run<'a> {
    stream: &'a Stream,
    plan: &'a Plan,
    finders: &'a [Finders],
    limits: &'a Limits,
    control: Control<'a>,
    workers: Vec<Worker>,
    /// Which member finished each task.
    by: Vec<Option<usize>>,
    /// Tasks that are not finished.
    open: usize,
    /// Open tasks that the queue will not hand out any more, or not for certain.
    again: Vec<TaskId>,
    /// Predicted and measured seconds of all launches so far.
    predicted_s: f64,
    measured_s: f64,
    rays_done: u64,
    /// Devices that are not believed, whose answers are all replaced.
    repaired: Vec<usize>,
    to: Sender<Answer>,
    answers: Receiver<Answer>,
    ran: Ran,
}

impl Run<'_> {
    fn all(mut self, members: &mut [DeviceState], output: &mut Output<'_>) -> Result<Ran, BalanceError> {
        // Every device takes its first launch before any takes its second: queues hand out the most expensive tasks
        // first, and two of them on one device could be the makespan.
        for worker in 0..self.workers.len() {
            self.feed(worker, 1, members)?;
        }
        loop {
            for worker in 0..self.workers.len() {
                self.feed(worker, usize::MAX, members)?;
            }
            let is_busy = |worker: &Worker| !worker.in_flight.is_empty();
            if self.open == 0 {
                let liars = self.liars(members);
                if liars.is_empty() {
                    break;
                }
                // Whoever is to help is at rest first.
                if !self.workers.iter().any(|worker| is_busy(worker) && !worker.late) {
                    self.repair(&liars, members, output)?;
                    continue;
                }
            }
            if !self.workers.iter().any(is_busy) {
                if !self.workers.iter().any(|worker| worker.alive) {
                    return Err(all_lost(members, self.open));
                }
                self.revive(members)?;
                continue;
            }
            match hear(&self.answers, self.deadline(members), self.control) {
                Heard::Answer(answer) => self.take(answer, members, output)?,
                Heard::Late => self.look(members),
                Heard::Cancelled => return Err(BalanceError::Cancelled { unfinished: self.open }),
            }
        }
        for worker in self.workers.iter().filter(|worker| worker.late && !worker.in_flight.is_empty()) {
            members[worker.member].set_late();
        }
        Ok(self.ran)
    }

    /// Gives a device launches until it has `most`, or as many as it can have, or there is nothing for it.
    fn feed(&mut self, worker: usize, most: usize, members: &mut [DeviceState]) -> Result<(), BalanceError> {
        let most = most.min(self.workers[worker].capacity);
        while self.open > 0 && self.workers[worker].is_punctual() && self.workers[worker].in_flight.len() < most {
            let Some((tasks, queued)) = self.next(worker)? else { break };
            let ranges: Vec<Task> = tasks.iter().map(|&id| self.stream.tasks[id as usize]).collect();
            let predicted_s = tasks.iter().map(|&id| self.plan.seconds(worker, id)).sum();
            let Worker { member, in_flight, since, .. } = &mut self.workers[worker];
            if in_flight.is_empty() {
                *since = Instant::now();
            }
            // In flight before it is asked for: whatever becomes of that, its tasks are known.
            in_flight.push_back(Flight { tasks, queued, predicted_s });
            members[*member].tell(Call::Submit { tasks: ranges, done: self.plan.kept.clone() });
        }
        let Worker { member, in_flight, waiting, alive, .. } = &mut self.workers[worker];
        if *alive && !*waiting && !in_flight.is_empty() {
            let buffers = std::mem::take(&mut members[*member].buffers);
            members[*member].ask(Call::Wait { buffers }, &self.to);
            *waiting = true;
        }
        Ok(())
    }

    /// The tasks of a device's next launch, in the stream's order, and whether they come from the queue.
    fn next(&mut self, worker: usize) -> Result<Option<(Vec<TaskId>, bool)>, BalanceError> {
        let queue = &*self.plan.queue;
        let mut tasks = Vec::new();
        // A queue that keeps its promises hands out as many launches as there are tasks, at most, and each once again
        // where a device was late.
        for _ in 0..=2 * self.by.len() {
            if queue.pop(worker, &mut tasks) != Pop::Launch {
                return Ok(self.next_again());
            }
            self.check_popped(&tasks)?;
            // The most expensive first is for choosing them: in a launch neighbours belong together, for caches, and
            // since ranges of rays that follow each other are one.
            tasks.sort_unstable();
            tasks.dedup();
            let (open, finished): (Vec<TaskId>, Vec<TaskId>) =
                tasks.iter().partition(|&&task| self.by[task as usize].is_none());
            if !finished.is_empty() {
                queue.finish(worker, &finished);
            }
            if !open.is_empty() {
                return Ok(Some((open, true)));
            }
        }
        Err(self.mistake("it hands out tasks for ever that are finished".to_owned()))
    }

    fn check_popped(&self, tasks: &[TaskId]) -> Result<(), BalanceError> {
        let all = self.by.len();
        match tasks.iter().find(|&&task| task as usize >= all) {
            Some(task) => Err(self.mistake(format!("it hands out task {task}, but there are only {all}"))),
            None if tasks.is_empty() => Err(self.mistake("it hands out a launch without tasks".to_owned())),
            None => Ok(()),
        }
    }

    fn mistake(&self, mistake: String) -> BalanceError {
        BalanceError::Queue { queue: self.plan.queue_name, mistake }
    }

    /// Half of an equal share of the tasks that are to be done again.
    fn next_again(&mut self) -> Option<(Vec<TaskId>, bool)> {
        let by = &self.by;
        self.again.retain(|&task| by[task as usize].is_none());
        let punctual = self.workers.iter().filter(|worker| worker.is_punctual()).count();
        let share = self.again.len().div_ceil(2 * punctual.max(1));
        let mut tasks = self.again.split_off(self.again.len() - share);
        tasks.sort_unstable();
        tasks.dedup();
        (!tasks.is_empty()).then_some((tasks, false))
    }

    /// Nobody does anything, and some tasks are open: all that are goes round again, unless that is the queue's
    /// mistake.
    fn revive(&mut self, members: &[DeviceState]) -> Result<(), BalanceError> {
        let open = (0..).zip(&self.by).filter(|(_, by)| by.is_none()).map(|(task, _)| task);
        let open: Vec<TaskId> = open.collect();
        // Then the queue may take devices for lost that have come back.
        let misled = self.workers.iter().any(|worker| worker.was_late) || members.iter().any(|member| member.lied);
        match open.first() {
            Some(task) if !misled => {
                let (left, all) = (open.len(), self.by.len());
                Err(self.mistake(format!("it hands out no more, but {left} of {all} tasks are open, such as {task}")))
            }
            _ => {
                self.again = open;
                Ok(())
            }
        }
    }

    /// When the others are to do a device's tasks, too.
    fn late_at(&self, worker: &Worker) -> Option<Instant> {
        let others = self.workers.iter().filter(|worker| worker.is_punctual()).count();
        if worker.late || others < 2 {
            return None;
        }
        let flight = worker.in_flight.front()?;
        // Prices may not be known yet, or be those of another stream.
        let overrun = if self.predicted_s > 0.0 { (self.measured_s / self.predicted_s).max(1.0) } else { 1.0 };
        let expected = Duration::try_from_secs_f64(OVERRUN * overrun * flight.predicted_s).unwrap_or(Duration::MAX);
        after(worker.since, self.limits.late).and_then(|at| after(at, expected))
    }

    fn deadline(&self, members: &[DeviceState]) -> Option<Instant> {
        let waiting = self.workers.iter().filter(|worker| worker.waiting);
        waiting.fold(None, |deadline, worker| {
            earlier(deadline, earlier(self.late_at(worker), members[worker.member].lost_at(self.limits)))
        })
    }

    /// Looks for devices that are late.
    fn look(&mut self, members: &mut [DeviceState]) {
        let now = Instant::now();
        let passed = |at: Option<Instant>| at.is_some_and(|at| at <= now);
        for worker in 0..self.workers.len() {
            let Worker { member, waiting, .. } = self.workers[worker];
            if waiting && passed(members[member].lost_at(self.limits)) {
                members[member].give_up(self.limits);
                self.lose(worker, members);
            } else if waiting && passed(self.late_at(&self.workers[worker])) {
                self.give_back(worker);
                let worker = &mut self.workers[worker];
                (worker.late, worker.was_late) = (true, true);
                members[worker.member].remark = Some("it was late: others did its work, too".to_owned());
            }
        }
    }

    /// Has others do what a device has in flight.
    fn give_back(&mut self, worker: usize) {
        let open = |queued: bool| {
            let flights = self.workers[worker].in_flight.iter().filter(move |flight| flight.queued == queued);
            flights.flat_map(|flight| &flight.tasks).copied().collect::<Vec<TaskId>>()
        };
        self.plan.queue.retire(worker, &open(true));
        let again = open(false);
        self.again.extend(again);
    }

    /// Goes on without a device that has failed.
    fn lose(&mut self, worker: usize, members: &[DeviceState]) {
        self.give_back(worker);
        let Worker { member, in_flight, waiting, alive, .. } = &mut self.workers[worker];
        in_flight.clear();
        (*waiting, *alive) = (false, false);
        let member = *member;
        if members[member].lied {
            self.disbelieve(member);
        }
    }

    /// Opens the tasks again that a device has finished.
    fn disbelieve(&mut self, member: usize) {
        for (task, by) in (0..).zip(&mut self.by).filter(|(_, by)| **by == Some(member)) {
            *by = None;
            self.again.push(task);
            self.open += 1;
            self.rays_done -= u64::from(self.stream.tasks[task as usize].rays);
        }
        for launch in self.ran.launches.iter_mut().filter(|launch| launch.member == member) {
            launch.outcomes.clear();
            (launch.rays, launch.whole) = (0, false);
        }
    }

    /// Devices whose answers are not believed and not replaced yet.
    fn liars(&self, members: &[DeviceState]) -> Vec<usize> {
        let liars = members.iter().filter(|member| member.lied).map(|member| member.index);
        liars.filter(|liar| !self.repaired.contains(liar)).collect()
    }

    /// Replaces what devices brought that are not believed. It may be that another one is found out by that.
    fn repair(
        &mut self,
        liars: &[usize],
        members: &mut [DeviceState],
        output: &mut Output<'_>,
    ) -> Result<(), BalanceError> {
        self.repaired.extend(liars);
        liars.iter().for_each(|&liar| self.disbelieve(liar));
        let found = find_again(members, self.finders, liars, output, self.limits, self.control);
        self.ran.walks.extend(found.map_err(|error| error.with_unfinished(self.open))?);
        for worker in 0..self.workers.len() {
            if self.workers[worker].alive && !members[self.workers[worker].member].is_alive() {
                self.lose(worker, members);
            }
        }
        Ok(())
    }

    fn take(
        &mut self,
        answer: Answer,
        members: &mut [DeviceState],
        output: &mut Output<'_>,
    ) -> Result<(), BalanceError> {
        let Answer { member, result, status } = answer;
        let Some(worker) = self.workers.iter().position(|worker| worker.member == member) else { return Ok(()) };
        members[member].answered(&status);
        self.workers[worker].waiting = false;
        match result {
            Ok(Done::Launched(launch, checked)) => {
                members[member].checked.add(checked);
                self.keep(worker, &launch, output);
                members[member].buffers = launch;
                self.control.report(self.rays_done, u64::from(self.stream.source.len()));
            }
            // Nothing else was asked for.
            Ok(_) => {}
            Err(error) => {
                members[member].fail(error);
                self.lose(worker, members);
            }
        }
        Ok(())
    }

    /// Takes the results of a device's oldest launch, but for tasks that another was faster with.
    fn keep(&mut self, index: usize, launch: &Launch, output: &mut Output<'_>) {
        let worker = &mut self.workers[index];
        let Some(flight) = worker.in_flight.pop_front() else { return };
        let (member, back) = (worker.member, std::mem::replace(&mut worker.late, false));
        worker.since = Instant::now();
        let Plan { queue, kept, .. } = self.plan;
        let outcomes = self.outcomes(index, &flight, launch);
        let mut won = Vec::with_capacity(outcomes.len());
        let (mut from, mut rays) = (0, 0);
        for outcome in outcomes {
            let task = self.stream.tasks[outcome.task as usize];
            if self.by[outcome.task as usize].is_none() {
                output.write(task, launch, from, kept.as_deref());
                if let Some(finished) = self.control.finished {
                    finished(output.of(task));
                }
                self.by[outcome.task as usize] = Some(member);
                self.open -= 1;
                rays += task.rays;
                won.push(outcome);
            }
            from += task.rays as usize;
        }
        if flight.queued {
            queue.took(index, &flight.tasks, launch.span.busy().as_secs_f64());
            queue.finish(index, &flight.tasks);
        }
        if back {
            queue.readmit(index);
        }
        self.rays_done += u64::from(rays);
        self.predicted_s += flight.predicted_s;
        self.measured_s += launch.span.duration().as_secs_f64();
        self.ran.launches.push(LaunchDone {
            member,
            span: launch.span,
            rays,
            whole: won.len() == flight.tasks.len(),
            outcomes: won,
            per_task: launch.task_seconds.len() == flight.tasks.len(),
        });
    }

    /// What the tasks of a launch were predicted to take, and took.
    fn outcomes(&self, worker: usize, flight: &Flight, launch: &Launch) -> Vec<TaskOutcome> {
        let tasks = &flight.tasks;
        let per_task = launch.task_seconds.len() == tasks.len();
        let busy = launch.span.busy().as_secs_f64();
        let outcome = |(i, &task): (usize, &TaskId)| {
            let predicted_s = self.plan.seconds(worker, task);
            let measured_s = match launch.task_seconds.get(i) {
                Some(&seconds) if per_task => f64::from(seconds),
                _ if flight.predicted_s > 0.0 => busy * predicted_s / flight.predicted_s,
                _ => busy / tasks.len() as f64,
            };
            TaskOutcome { task, predicted_s, measured_s }
        };
        tasks.iter().enumerate().map(outcome).collect()
    }
}

impl std::fmt::Debug for Run<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Run").field("workers", &self.workers).field("open", &self.open).finish_non_exhaustive()
    }
}
