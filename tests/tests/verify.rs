//! The suite that users run passes where promises are kept and fails where they are broken, each time in the right
//! case.

use backend_cpu::{CpuDevice, Isa};
use rt_core::{Device, Precision};
use rt_tests::fake::{FakeDevice, Flaw};
use rt_verify::{DeviceReport, Options, Row, Subject, Suite, Verdict, Watch};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Rays of each line: enough for every flaw and for the leaks of the fast mode, few enough for one thread.
const RAYS: u32 = 2_000;

fn suite() -> Suite {
    Suite::new(Options { rays: Some(RAYS), ..Options::default() }, Vec::new())
}

fn cpu(precision: Precision) -> Subject {
    cpu_with(None, precision)
}

fn cpu_with(isa: Option<Isa>, precision: Precision) -> Subject {
    let device = CpuDevice::open_all_with(&[0], isa).expect("threads").remove(0);
    Subject::new(Arc::new(device), precision)
}

fn failed(report: &DeviceReport) -> Vec<&Row> {
    report.rows.iter().filter(|row| row.verdict == Verdict::Fail).collect()
}

/// Whether a device with the flaw fails a case that an honest one passes.
fn finds(case: &str, flaw: Flaw) -> bool {
    let verdict = |device: FakeDevice| {
        let device: Arc<dyn Device> = Arc::new(device);
        let subject = Subject::new(device, Precision::Robust);
        let report = suite().run_case(case, &subject, Watch::default()).expect("nobody stops it");
        assert!(!report.rows.is_empty(), "no case {case}");
        !failed(&report).is_empty()
    };
    assert!(!verdict(FakeDevice::honest()), "an honest device fails {case}");
    verdict(FakeDevice::flawed(flaw))
}

/// Tries the whole suite with these instructions, if this processor has them; but for its best, which `cargo xtask
/// test` tries with more rays.
fn keeps_every_promise(isa: Isa) {
    let available = Isa::available();
    if !available.contains(&isa) || available.last() == Some(&isa) {
        return;
    }
    let report = suite().run(&cpu_with(Some(isa), Precision::Robust), Watch::default()).expect("nobody stops it");
    assert!(failed(&report).is_empty(), "{isa}: {:#?}", failed(&report));
    assert!(report.count(Verdict::Pass) > 60, "{} lines", report.count(Verdict::Pass));
}

// The longest ones, apart so that they run at the same time.
#[test]
fn portable_instructions_keep_every_promise() {
    keeps_every_promise(Isa::Portable);
}

#[test]
fn avx2_keeps_every_promise() {
    keeps_every_promise(Isa::Avx2);
}

#[test]
fn double_precision_keeps_every_promise() {
    // Trees are the same in every precision, and take longest.
    for case in Suite::case_names().filter(|case| *case != "trees") {
        let report = suite().run_case(case, &cpu(Precision::Double), Watch::default()).expect("nobody stops it");
        assert!(failed(&report).is_empty(), "{:#?}", failed(&report));
        assert!(!report.rows.is_empty() || case == "closed parts", "{case}");
    }
}

#[test]
fn fast_precision_leaks_where_it_is_known_to() {
    let report = suite().run_case("watertight", &cpu(Precision::Fast), Watch::default()).expect("nobody stops it");
    let fails = |what: &str| failed(&report).iter().any(|row| row.what == what);
    assert!(fails("edges, offset 0") && fails("vertices, offset 0") && fails("edges, offset 1"), "{report:#?}");
    let report = suite().run_case("scale", &cpu(Precision::Fast), Watch::default()).expect("nobody stops it");
    assert!(!failed(&report).is_empty());
}

#[test]
fn seeded_faults_fail_the_case_that_is_about_them() {
    for (case, flaw) in [
        ("watertight", Flaw::OpenEdge),
        ("agreement", Flaw::Imprecise),
        ("magnitudes", Flaw::TrustsRoundings),
        ("magnitudes", Flaw::LosesDetails),
        ("ties", Flaw::TrustsRoundings),
        ("ends", Flaw::SkipsZero),
        ("garbage", Flaw::LosesDetails),
        ("garbage", Flaw::TrustsRoundings),
        ("agreement", Flaw::FlippedSign),
        ("agreement", Flaw::LosesLastRay),
        ("scale", Flaw::AbsoluteEpsilon),
        ("powers of two", Flaw::AbsoluteEpsilon),
        ("direction length", Flaw::Normalizes),
        ("thin triangles", Flaw::FlippedSign),
        ("ties", Flaw::WrongTie),
        ("invalid rays", Flaw::AcceptsInvalid),
        ("ends", Flaw::IgnoresLimit),
        ("self-hits", Flaw::Thick),
        ("garbage", Flaw::AcceptsInvalid),
        ("trees", Flaw::Misses),
        ("ids", Flaw::RoundedIds),
    ] {
        assert!(finds(case, flaw), "{case} does not find {flaw:?}");
    }
}

#[test]
fn a_run_can_be_stopped_and_says_how_far_it_is() {
    let stop = AtomicBool::new(true);
    let watch = Watch { stop: Some(&stop), progress: None };
    assert!(suite().run(&cpu(Precision::Robust), watch).is_err());
    let last = std::cell::Cell::new(0.0);
    let show = |share: f64, _: &str| {
        assert!((last.get()..=1.0).contains(&share), "{share} after {}", last.get());
        last.set(share);
    };
    let watch = Watch { stop: None, progress: Some(&show) };
    suite().run_case("scale", &cpu(Precision::Robust), watch).expect("nobody stops it");
    assert!(last.get() > 0.8);
}
