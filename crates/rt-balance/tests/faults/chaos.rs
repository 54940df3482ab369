//! Random schedules of faults.

use crate::fixture::{QUEUES, cpus, fixture, sampling, trace, uniform};
use rt_balance::middleware::{Failure, Fault, Faulty, FaultyCall, Lie};
use rt_balance::{Audit, BalanceError, Balancer, Control, Device, Limits, Scheduling};
use rt_core::{DeviceErrorKind, random};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread;
use std::time::Duration;

/// Schedules that are tried when the variable `RAYBALANCE_CHAOS` says nothing else.
const SCHEDULES: u32 = 1_000;

/// Schedules at a time: most of their time is waiting.
const AT_A_TIME: usize = 8;

/// Numbers of one schedule.
struct Dice {
    schedule: u32,
    thrown: u32,
}

impl Dice {
    fn below(&mut self, bound: usize) -> usize {
        self.thrown += 1;
        random::below(bound as u32, 11, self.schedule, self.thrown) as usize
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }

    fn is_one_in(&mut self, number: usize) -> bool {
        self.below(number) == 0
    }

    fn fault(&mut self) -> Fault {
        use DeviceErrorKind::{Hung, InvalidArgument, Lost, OutOfMemory, Unsupported};
        let call = self.of(&FaultyCall::ALL);
        let failure = match self.below(10) {
            0..3 => Failure::Error(self.of(&[Hung, InvalidArgument, Lost, OutOfMemory, Unsupported])),
            3..5 => Failure::Panic,
            5 => Failure::Hang,
            6 => Failure::Delay(Duration::from_millis(5 << self.below(5))),
            _ => Failure::Lie(self.of(&Lie::ALL)),
        };
        Fault::new(call, self.below(5) as u32, failure)
    }
}

/// What came of the schedules.
#[derive(Debug, Default)]
struct Ends {
    right: AtomicU32,
    lost: AtomicU32,
    refused: AtomicU32,
    cancelled: AtomicU32,
    panicked: AtomicU32,
}

/// Traces three streams on devices with random faults, some of them cancelled, some with a callback that panics.
fn schedule(number: u32, ends: &Ends) {
    let mut dice = Dice { schedule: number, thrown: 0 };
    let devices = 1 + dice.below(4);
    let mut faults = Vec::new();
    let mut all: Vec<Arc<dyn Device>> = Vec::new();
    let mut bad: Vec<Arc<Faulty>> = Vec::new();
    for device in cpus(devices) {
        if dice.is_one_in(3) {
            all.push(device);
            continue;
        }
        let fault = dice.fault();
        faults.push(fault);
        let device = Arc::new(Faulty::new(device, fault));
        bad.push(Arc::clone(&device));
        all.push(device);
    }
    let what = format!("schedule {number} of {devices} devices, {faults:?}");
    let short = Duration::from_millis(15);
    let limits = Limits { ready: short, late: short, lost: Duration::from_millis(150) };
    let opened = Balancer::open(Arc::clone(&fixture().scene), &all, &limits, Control::default());
    let has_good = faults.len() < devices;
    match opened {
        Ok(mut balancer) => {
            for _ in 0..3 {
                let queue = dice.of(&QUEUES);
                let scheduling = if dice.is_one_in(2) { sampling(queue, limits) } else { uniform(queue, limits) };
                let mut scheduling = Scheduling { audit: Audit::ALL, ..scheduling };
                stream(&what, &mut dice, &mut balancer, &mut scheduling, has_good, ends);
            }
        }
        Err(error) => assert!(matches!(error, BalanceError::Open { .. }) && !has_good, "{what}: {error}"),
    }
    bad.iter().for_each(|device| device.release());
}

fn stream(
    what: &str,
    dice: &mut Dice,
    balancer: &mut Balancer,
    scheduling: &mut Scheduling,
    has_good: bool,
    ends: &Ends,
) {
    let cancel = AtomicBool::new(false);
    let (cancels, panics) = (dice.is_one_in(8), dice.is_one_in(8));
    let calls = AtomicU32::new(dice.below(4) as u32);
    let progress = |_, _| {
        if calls.fetch_sub(1, Ordering::Relaxed) == 0 {
            cancel.store(cancels, Ordering::Relaxed);
            assert!(!panics, "the caller's callback");
        }
    };
    let control = Control { cancel: Some(&cancel), progress: Some(&progress), ..Control::default() };
    let traced = catch_unwind(AssertUnwindSafe(|| trace(what, balancer, scheduling, control)));
    let end = match traced {
        Err(panic) => {
            let said = panic.downcast_ref::<&str>().copied().unwrap_or_default();
            assert!(panics && said == "the caller's callback", "{what}: {said:?}");
            &ends.panicked
        }
        Ok(Ok(_)) => &ends.right,
        Ok(Err(BalanceError::Cancelled { .. })) => {
            assert!(cancels, "{what}: nobody cancelled");
            &ends.cancelled
        }
        Ok(Err(BalanceError::AllDevicesLost { failures, .. })) => {
            assert!(!has_good, "{what}: a device without a fault was lost: {failures:?}");
            &ends.lost
        }
        Ok(Err(BalanceError::Refused { .. })) => &ends.refused,
        Ok(Err(error)) => panic!("{what}: {error:?}"),
    };
    end.fetch_add(1, Ordering::Relaxed);
}

/// A thousand schedules of one to four devices that fail, panic, hang, are late and lie: each stream ends with the hits
/// of one device, bit for bit, or in an error with a name that fits.
///
/// Mutants: most of those of the other tests; tasks of a device that was found out while another was late are lost.
#[test]
fn random_schedules_of_faults_end_right_or_in_a_named_error() {
    let number = std::env::var("RAYBALANCE_CHAOS").map_or(SCHEDULES, |number| match number.parse() {
        Ok(number) => number,
        Err(_) => panic!(
            "the environment variable RAYBALANCE_CHAOS is `{number}`: set it to a number of schedules, or unset it"
        ),
    });
    let (next, ends) = (AtomicU32::new(0), Ends::default());
    thread::scope(|scope| {
        for _ in 0..AT_A_TIME {
            scope.spawn(|| {
                loop {
                    match next.fetch_add(1, Ordering::Relaxed) {
                        schedule if schedule < number => self::schedule(schedule, &ends),
                        _ => break,
                    }
                }
            });
        }
    });
    println!("{ends:?}");
    let seen = |end: &AtomicU32| end.load(Ordering::Relaxed) > 0;
    let Ends { right, lost, refused: _, cancelled, panicked } = &ends;
    assert!(number < SCHEDULES || [right, lost, cancelled, panicked].into_iter().all(seen), "{ends:?}");
}
