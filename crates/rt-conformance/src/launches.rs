//! Cases about launches: order, times, wrong calls, and tracers beside each other.

use crate::Case;
use crate::fixtures;
use crate::need::{Need, counted, had, has};
use crate::session::{LIMIT, Session, ensure, refused, same_hits};
use rt_core::{
    Device, Hit, Launch, Precision, Query, RaySource, ReducedWalk, Span, StreamSpec, Task, TestCounts, Ticket, Walk,
    tasks_of,
};
use rt_verify::clock;
use std::iter;
use std::sync::mpsc;
use std::time::Duration;

pub(crate) const CASES: &[Case] = &[
    Case { name: "info_makes_sense", needs: &[], run: info_makes_sense },
    Case { name: "what_it_says_it_can_do_it_does", needs: &[], run: what_it_says_it_can_do_it_does },
    Case { name: "launches_run_in_order", needs: &[], run: launches_run_in_order },
    Case { name: "launches_can_be_awaited_in_any_order", needs: &[], run: launches_can_be_awaited_in_any_order },
    Case {
        name: "wrong_calls_are_refused_and_change_nothing",
        needs: &[],
        run: wrong_calls_are_refused_and_change_nothing,
    },
    Case {
        name: "calls_against_launches_in_flight_are_refused",
        needs: &[],
        run: calls_against_launches_in_flight_are_refused,
    },
    Case { name: "two_tracers_do_not_disturb_each_other", needs: &[], run: two_tracers_do_not_disturb_each_other },
    Case { name: "dropping_a_tracer_does_not_hang", needs: &[], run: dropping_a_tracer_does_not_hang },
];

fn info_makes_sense(device: &dyn Device) -> Result<(), String> {
    let info = device.info();
    ensure!(!info.name.is_empty() && !info.backend.is_empty(), "a device without a name: {info:?}");
    ensure!(info.in_flight >= 1 && info.units >= 1, "a device that does nothing: {info:?}");
    ensure!(info.capabilities.has_precision(Precision::Robust), "a device whose hits need not be right: {info:?}");
    Ok(())
}

/// Every walk, precision and count that the device says it has is answered, whatever the answer is worth.
fn what_it_says_it_can_do_it_does(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let capabilities = device.info().capabilities;
    let walks = iter::once(Walk::Full).chain(ReducedWalk::ALL.into_iter().map(Walk::Reduced));
    let mut session = Session::open(device, &fixture.scene)?;
    for precision in had(device, Precision::ALL) {
        let counting = [false, true].into_iter().filter(|counts| !counts || has(device, Need::Counts));
        for (counts, query) in counting.flat_map(|counts| [(counts, Query::Closest), (counts, Query::Any)]) {
            let spec = StreamSpec::new(query, precision, counts);
            session.load(&fixture.rays, spec)?;
            session.trace(&session.all(), None).map_err(|e| format!("{spec:?}: {e}"))?;
        }
        for walk in walks.clone().filter(|walk| capabilities.has_walk(*walk)) {
            session.walk(&[0, 7, 3], walk).map_err(|e| format!("{walk:?}: {e}"))?;
        }
    }
    Ok(())
}

/// One task for each launch that may be in flight, and everything traced at once for comparison.
fn start(device: &dyn Device) -> Result<(Session, Vec<Task>, Launch), String> {
    let fixture = fixtures::plain()?;
    let mut session = Session::open(device, &fixture.scene)?;
    session.load(&fixture.rays, StreamSpec::default())?;
    let whole = session.trace(&session.all(), None)?;
    let launches = device.info().in_flight.min(8);
    let tasks = tasks_of(fixture.rays.len() as u32, (fixture.rays.len() as u32).div_ceil(launches));
    Ok((session, tasks, whole))
}

fn part(whole: &Launch, task: Task) -> &[Hit] {
    &whole.hits[task.first as usize..][..task.rays as usize]
}

fn launches_run_in_order(device: &dyn Device) -> Result<(), String> {
    let (mut session, tasks, whole) = start(device)?;
    for _ in 0..20 {
        let before = clock();
        let tickets =
            tasks.iter().map(|task| session.submit(&[*task], None)).collect::<Result<Vec<Ticket>, String>>()?;
        let mut spans: Vec<Span> = Vec::new();
        for (ticket, task) in tickets.into_iter().zip(&tasks) {
            let launch = session.wait(ticket, &[*task])?;
            same_hits(&format!("{task:?}"), &launch.hits, part(&whole, *task))?;
            spans.push(launch.span);
        }
        let after = clock();
        ensure!(
            spans.iter().all(|s| before <= s.start && s.start <= s.end && s.end <= after),
            "{spans:?} outside {before:?} ..= {after:?}"
        );
        ensure!(
            spans.windows(2).all(|w| w[0].start <= w[1].start && w[0].end <= w[1].end),
            "launches out of order: {spans:?}"
        );
        // Spans may overlap where a device only knows when a launch was submitted; kernels may not.
        let mut busy = Duration::ZERO;
        let mut seen = Duration::ZERO;
        for span in &spans {
            busy += span.end.saturating_sub(span.start.max(seen));
            seen = seen.max(span.end);
        }
        let in_kernel: Duration = spans.iter().map(|s| s.in_kernel).sum();
        ensure!(in_kernel <= busy, "{in_kernel:?} in kernels within {busy:?}: {spans:?}");
    }
    Ok(())
}

fn launches_can_be_awaited_in_any_order(device: &dyn Device) -> Result<(), String> {
    let (mut session, tasks, whole) = start(device)?;
    let tickets = tasks.iter().map(|task| session.submit(&[*task], None)).collect::<Result<Vec<Ticket>, String>>()?;
    for (ticket, task) in tickets.into_iter().zip(&tasks).rev() {
        let launch = session.wait(ticket, &[*task])?;
        same_hits(&format!("{task:?}"), &launch.hits, part(&whole, *task))?;
    }
    Ok(())
}

fn wrong_calls_are_refused_and_change_nothing(device: &dyn Device) -> Result<(), String> {
    let fixture = fixtures::plain()?;
    let mut session = Session::open(device, &fixture.scene)?;
    refused("a task before any rays", session.tracer().submit(&[Task { first: 0, rays: 1 }], None))?;
    session.load(&fixture.rays, StreamSpec::default())?;
    let whole = session.trace(&session.all(), None)?;
    let rays = fixture.rays.len() as u32;
    let good = Task { first: 0, rays: 4 };
    for (first, count) in [(0, rays + 1), (rays, 1), (rays - 1, 2), (u32::MAX, 1), (u32::MAX, u32::MAX), (1, u32::MAX)]
    {
        let bad = Task { first, rays: count };
        refused(&format!("{bad:?} of {rays} rays"), session.tracer().submit(&[good, bad], None))?;
    }
    if has(device, Need::Counts) {
        wrong_walks_are_refused(&mut session, rays)?;
    }
    let ticket = Ticket(u64::MAX - 5);
    refused("an unknown ticket", session.tracer().wait(ticket, LIMIT, &mut Launch::default()))?;
    let few: Vec<_> = fixture.rays[..3].iter().map(|(ray, _)| *ray).collect();
    let source = RaySource::Explicit { rays: few.into(), origins: Some([u32::MAX; 2].into()) };
    refused("3 rays, 2 origins", session.tracer().load_rays(source, StreamSpec::default()))?;
    let again = session.trace(&session.all(), None)?;
    same_hits("after wrong calls", &again.hits, &whole.hits)
}

fn wrong_walks_are_refused(session: &mut Session, rays: u32) -> Result<(), String> {
    for bad in [rays, u32::MAX] {
        let mut counts = [TestCounts::default(); 2];
        let walked = session.tracer().walk(&[0, bad], Walk::Full, &mut counts, None);
        refused(&format!("a walk of ray {bad} of {rays}"), walked)?;
    }
    let mut counts = [TestCounts::default(); 3];
    let mut hits = [Hit::MISS; 3];
    refused("2 rays, 3 counts", session.tracer().walk(&[0, 1], Walk::Full, &mut counts, None))?;
    let walked = session.tracer().walk(&[0, 1], Walk::Full, &mut counts[..2], Some(&mut hits));
    refused("2 rays, 3 hits", walked)
}

fn calls_against_launches_in_flight_are_refused(device: &dyn Device) -> Result<(), String> {
    let (mut session, tasks, whole) = start(device)?;
    let task = tasks[0];
    let tickets: Vec<Ticket> =
        (0..device.info().in_flight).map(|_| session.submit(&[task], None)).collect::<Result<_, String>>()?;
    refused("one launch too many", session.tracer().submit(&[task], None))?;
    let none = RaySource::Explicit { rays: [].into(), origins: None };
    refused("load_rays with launches in flight", session.tracer().load_rays(none, StreamSpec::default()))?;
    for ticket in &tickets {
        let launch = session.wait(*ticket, &[task])?;
        same_hits("after refused calls", &launch.hits, part(&whole, task))?;
    }
    refused("a ticket twice", session.tracer().wait(tickets[0], LIMIT, &mut Launch::default()))
}

fn two_tracers_do_not_disturb_each_other(device: &dyn Device) -> Result<(), String> {
    let [one, two] = [fixtures::plain()?, fixtures::named("sphere")?];
    let spec = counted(device);
    let alone =
        [Session::whole(device, &one.scene, &one.rays, spec)?, Session::whole(device, &two.scene, &two.rays, spec)?];
    let run = |fixture: &'static fixtures::Fixture, expected: &Launch| -> Result<(), String> {
        let mut session = Session::open(device, &fixture.scene)?;
        session.load(&fixture.rays, spec)?;
        for _ in 0..10 {
            let launch = session.trace(&tasks_of(fixture.rays.len() as u32, 50), None)?;
            same_hits(&format!("{} beside another tracer", fixture.name), &launch.hits, &expected.hits)?;
            ensure!(launch.counts == expected.counts, "{}: other counts beside another tracer", fixture.name);
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let other = scope.spawn(|| run(two, &alone[1]));
        run(one, &alone[0])?;
        other.join().map_err(|_| "the second tracer's thread panicked".to_owned())?
    })
}

fn dropping_a_tracer_does_not_hang(device: &dyn Device) -> Result<(), String> {
    for _ in 0..5 {
        let (mut session, tasks, _) = start(device)?;
        for task in &tasks {
            session.submit(&[*task], None)?;
        }
        let tracer = session.into_tracer();
        let (done, finished) = mpsc::channel();
        // Not a scoped thread: one that hangs must not take the suite with it.
        std::thread::spawn(move || {
            drop(tracer);
            // The receiver is gone only when the limit has passed already.
            let _ = done.send(());
        });
        ensure!(finished.recv_timeout(LIMIT).is_ok(), "dropping a tracer with launches in flight took over {LIMIT:?}");
    }
    let fixture = fixtures::plain()?;
    Session::whole(device, &fixture.scene, &fixture.rays, StreamSpec::default()).map(|_| ())
}
