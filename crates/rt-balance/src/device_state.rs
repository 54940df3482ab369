//! The devices of a run.

use crate::answers::Checked;
use crate::contain::contain;
use crate::device_thread::{Answer, Call, DeviceThread, Done, Parting, Status};
use crate::limits::{GRACE, Heard, Limits, after, earlier, hear};
use crate::models::Models;
use crate::{BalanceError, Control};
use rt_core::{Device, DeviceError, DeviceErrorKind, DeviceInfo, Launch, Scene, Traffic, with_causes};
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// How long a balancer that is dropped waits for devices that only have to free their memory.
const PARTING: Duration = Duration::from_secs(10);

/// How long it waits for a device that is in the middle of something: short enough for a user who has interrupted it.
const PARTING_BUSY: Duration = Duration::from_millis(300);

/// How often late devices are looked at while there is nobody else.
const POLL: Duration = Duration::from_millis(10);

/// A device of the run.
#[derive(Debug)]
pub(crate) struct DeviceState {
    /// Its position among all.
    pub(crate) index: usize,
    pub(crate) info: DeviceInfo,
    /// Absent once the device has failed.
    thread: Option<DeviceThread>,
    /// Of a device that failed, but not because it does not answer: tells when its memory is free.
    parting: Option<Parting>,
    pub(crate) models: Models,
    failure: Option<Failure>,
    /// Results of the last launch, kept for their memory: a large launch would otherwise spend a twentieth of its time
    /// on fresh pages.
    pub(crate) buffers: Launch,
    /// Questions without an answer so far.
    pending: u32,
    /// When the oldest of them was put.
    since: Instant,
    /// Whether nobody waits for it for the time being.
    late: bool,
    /// Where it says that it is at rest: that it has the scene, or has ended what a stream did not wait for.
    rest: Option<Receiver<Answer>>,
    status: Status,
    /// What went to and fro before the current stream.
    before: Traffic,
    /// What was looked at of its answers in the current stream.
    pub(crate) checked: Checked,
    /// Whether its answers of the current stream are not believed.
    pub(crate) lied: bool,
    /// Whether it has no part in the current stream.
    out: bool,
    /// What people should know of its part in the current stream.
    pub(crate) remark: Option<String>,
}

impl DeviceState {
    /// Begins to bring the scene to a device. It is at rest when it has it: see [`settle`].
    pub(crate) fn open(index: usize, device: &Arc<dyn Device>, scene: &Arc<Scene>) -> io::Result<Self> {
        let (to, rest) = channel();
        let thread = DeviceThread::start(index, Arc::clone(device), Arc::clone(scene), to)?;
        Ok(Self {
            index,
            // Until it tells.
            info: DeviceInfo::new(format!("device {index}"), "unknown"),
            thread: Some(thread),
            parting: None,
            models: Models::default(),
            failure: None,
            buffers: Launch::default(),
            pending: 0,
            since: Instant::now(),
            late: false,
            rest: Some(rest),
            status: Status::default(),
            before: Traffic::default(),
            checked: Checked::default(),
            lied: false,
            out: false,
            remark: None,
        })
    }

    /// Takes over what was learnt of the device with another scene.
    pub(crate) fn inherit(&mut self, before: Self) {
        (self.info, self.models, self.buffers) = (before.info, before.models, before.buffers);
    }

    /// Whether the device has not failed.
    pub(crate) const fn is_alive(&self) -> bool {
        self.thread.is_some()
    }

    /// Whether it waits for something to do.
    pub(crate) const fn is_ready(&self) -> bool {
        self.thread.is_some() && self.pending == 0 && self.rest.is_none() && !self.out
    }

    /// Whether it may still have a part in the current stream.
    pub(crate) const fn may_come(&self) -> bool {
        self.thread.is_some() && !self.out
    }

    /// Asks for something; the answer goes to `to`.
    pub(crate) fn ask(&mut self, call: Call, to: &Sender<Answer>) {
        let Some(thread) = &self.thread else { return };
        if self.pending == 0 {
            self.since = Instant::now();
        }
        self.pending += 1;
        thread.ask(call, to);
    }

    /// Asks for something that has no answer of its own.
    pub(crate) fn tell(&self, call: Call) {
        if let Some(thread) = &self.thread {
            thread.tell(call);
        }
    }

    /// Takes notice of an answer.
    pub(crate) fn answered(&mut self, status: &Status) {
        self.pending = self.pending.saturating_sub(1);
        self.since = Instant::now();
        self.late = false;
        if !status.lost {
            self.status.clone_from(status);
        }
    }

    /// Takes notice of what it says when it is at rest.
    fn rested(&mut self, answer: Answer) {
        match answer.result {
            // The scene comes next.
            Ok(Done::Named(info)) => self.info = info,
            Ok(_) => {
                (self.pending, self.rest) = (0, None);
                self.answered(&answer.status);
            }
            Err(error) => self.fail(error),
        }
    }

    /// From now on nobody waits for its answer.
    pub(crate) const fn set_late(&mut self) {
        self.late = true;
    }

    /// When it is given up, should it not have answered by then.
    pub(crate) fn lost_at(&self, limits: &Limits) -> Option<Instant> {
        after(self.since, limits.lost).and_then(|at| after(at, GRACE))
    }

    /// To be called before a stream.
    pub(crate) fn begin(&mut self) {
        self.before = self.status.traffic;
        (self.checked, self.lied, self.out, self.remark) = (Checked::default(), false, false, None);
    }

    /// Leaves it out of the current stream, which it refused.
    pub(crate) fn leave_out(&mut self, error: &DeviceError) {
        self.out = true;
        self.remark = Some(format!("it refused this stream: {}", describe(error)));
    }

    /// What went to and fro since then; unknown of a device that failed.
    pub(crate) fn traffic(&self) -> Option<Traffic> {
        self.is_alive().then(|| self.status.traffic.since(&self.before))
    }

    /// What people should know of how it holds the scene, and of its part in the current stream.
    pub(crate) fn note(&self) -> Option<String> {
        let own = if self.is_alive() { self.status.note.clone() } else { None };
        match (own, &self.remark) {
            (Some(own), Some(remark)) => Some(format!("{own}; {remark}")),
            (own, remark) => own.or_else(|| remark.clone()),
        }
    }

    /// Why it failed, if it did, for people.
    pub(crate) fn failure(&self) -> Option<&str> {
        self.failure.as_ref().map(|failure| failure.text.as_str())
    }

    /// The same for programs.
    pub(crate) fn into_error(self) -> Option<DeviceError> {
        self.failure.map(|failure| failure.error)
    }

    /// Drops the device out of this and all later streams.
    pub(crate) fn fail(&mut self, error: DeviceError) {
        self.lied |= error.kind() == DeviceErrorKind::WrongAnswer;
        self.failure.get_or_insert_with(|| Failure { text: describe(&error), error });
        self.parting = self.thread.take().map(DeviceThread::dismiss);
        (self.pending, self.late, self.rest) = (0, false, None);
    }

    /// Drops out a device that does not answer. Its thread is left behind, with the tracer, until it does.
    pub(crate) fn give_up(&mut self, limits: &Limits) {
        let seconds = limits.lost.as_secs_f64();
        let message = format!("it hangs: it was given up after {seconds:.1} s without an answer");
        self.fail(DeviceError::new(DeviceErrorKind::Hung, message));
        self.parting = None;
    }
}

/// Why a device failed.
#[derive(Debug)]
struct Failure {
    /// The error and its causes.
    text: String,
    error: DeviceError,
}

/// What becomes of what devices still do when a stream has ended without them, and of the scene that they are to take.
///
/// Those that are not late are waited for. The others are left out of the stream, until they answer or are given up.
///
/// # Errors
/// When the caller cancels.
pub(crate) fn settle(members: &mut [DeviceState], limits: &Limits, control: Control<'_>) -> Result<(), BalanceError> {
    for member in members.iter_mut().filter(|member| member.pending > 0 && member.rest.is_none()) {
        let (to, rest) = channel();
        if let Some(thread) = &member.thread {
            thread.ask(Call::Rest, &to);
            member.rest = Some(rest);
        }
    }
    let patience = after(Instant::now(), limits.ready);
    loop {
        for member in members.iter_mut() {
            while let Some(Ok(answer)) = member.rest.as_ref().map(Receiver::try_recv) {
                member.rested(answer);
            }
            if member.rest.is_some() && member.lost_at(limits).is_some_and(|at| at <= Instant::now()) {
                member.give_up(limits);
            }
        }
        // Where all are late, there is nothing better to do than to wait for one of them.
        let any_ready = members.iter().any(DeviceState::is_ready);
        let waited_for = |member: &&mut DeviceState| member.rest.is_some() && !(member.late && any_ready);
        let Some(member) = members.iter_mut().find(waited_for) else { return Ok(()) };
        let Some(rest) = &member.rest else { return Ok(()) };
        let lost_at = member.lost_at(limits);
        let deadline = if member.late { after(Instant::now(), POLL) } else { patience };
        match hear(rest, earlier(deadline, lost_at), control) {
            Heard::Answer(answer) => member.rested(answer),
            // Looked at above.
            Heard::Late if lost_at.is_some_and(|at| at <= Instant::now()) => {}
            Heard::Late => member.late = true,
            Heard::Cancelled => return Err(cancelled()),
        }
    }
}

/// Has every device that is ready do something, which depends on its place, and waits for all of them; but not for ever
/// where others could begin.
/// Returns what devices have refused, being as they were.
///
/// # Errors
/// When the caller cancels.
pub(crate) fn ask_all(
    members: &mut [DeviceState],
    call: impl Fn(usize) -> Call,
    limits: &Limits,
    control: Control<'_>,
) -> Result<Vec<(usize, DeviceError)>, BalanceError> {
    let (to, answers) = channel();
    let mut open: Vec<usize> = Vec::new();
    for member in members.iter_mut().filter(|member| member.is_ready()) {
        member.ask(call(member.index), &to);
        open.push(member.index);
    }
    let patience = after(Instant::now(), limits.ready);
    let mut refused = Vec::new();
    while !open.is_empty() {
        let lost_at = open.iter().fold(None, |at, &index| earlier(at, members[index].lost_at(limits)));
        // Where nobody is ready, there is nothing better to do than to wait.
        let any_ready = members.iter().any(DeviceState::is_ready);
        let deadline = if any_ready { earlier(patience, lost_at) } else { lost_at };
        match hear(&answers, deadline, control) {
            Heard::Answer(Answer { member: index, result, status }) => {
                open.retain(|&member| member != index);
                members[index].answered(&status);
                match result {
                    Ok(_) => {}
                    Err(error) if status.lost => members[index].fail(error),
                    Err(error) => refused.push((index, error)),
                }
            }
            Heard::Late => {
                let now = Instant::now();
                let begin_without = any_ready && patience.is_some_and(|at| at <= now);
                open.retain(|&index| {
                    let member = &mut members[index];
                    let is_lost = member.lost_at(limits).is_some_and(|at| at <= now);
                    if is_lost {
                        member.give_up(limits);
                    } else if begin_without {
                        member.late = true;
                    }
                    !is_lost && !begin_without
                });
            }
            Heard::Cancelled => return Err(cancelled()),
        }
    }
    Ok(refused)
}

/// The caller cancelled before anything was traced; whoever knows how much there was says so.
pub(crate) const fn cancelled() -> BalanceError {
    BalanceError::Cancelled { unfinished: 0 }
}

/// Waits for the ends of the devices' threads, which free the scene there: for those that are at rest as long as that
/// takes, within reason, and hardly for the others.
pub(crate) fn dismiss<'a>(members: impl IntoIterator<Item = &'a mut DeviceState>) {
    let begin = Instant::now();
    let mut parting = Vec::new();
    for member in members {
        let patience = if member.pending == 0 && member.rest.is_none() { PARTING } else { PARTING_BUSY };
        let threads = [member.thread.take().map(DeviceThread::dismiss), member.parting.take()];
        parting.extend(threads.into_iter().flatten().map(|thread| (thread, patience)));
    }
    parting.iter().for_each(|(thread, patience)| thread.wait(begin + *patience));
}

/// An error and its causes on one line. The texts are the backend's.
pub(crate) fn describe(error: &dyn std::error::Error) -> String {
    let told = contain("fmt", || Ok(with_causes(error)));
    told.unwrap_or_else(|panic| panic.to_string())
}

pub(crate) fn all_lost(members: &[DeviceState], unfinished: usize) -> BalanceError {
    let failures = members.iter().filter_map(|m| Some((m.info.name.clone(), m.failure()?.to_owned()))).collect();
    BalanceError::AllDevicesLost { unfinished, failures }
}
