//! The conformance suite on the devices of this workspace.

use backend_cpu::{CpuDevice, Isa};
use libtest_mimic::{Arguments, run};
use rt_balance::middleware::{Failure, Fault, Faulty, FaultyCall, Recorded, Throttled};
use rt_conformance::{Subject, trials};
use rt_core::Device;
use rt_tests::fake::FakeDevice;
use std::sync::Arc;

fn main() {
    let arguments = Arguments::from_args();
    let mut subjects = vec![Subject::new("fake", "honest", Ok(Arc::new(FakeDevice::honest())))];
    // With all instructions that the processor has.
    for isa in Isa::available() {
        subjects.extend(cpu(&format!("1-thread-{isa}"), &[1], Some(isa)));
    }
    subjects.extend(cpu("4-threads", &[4], None));
    // Two devices opened together, as the balancer uses them.
    subjects.extend(cpu("pair", &[1, 1], None));
    // Middleware keeps a device's promises, but for its speed.
    let honest = || Arc::new(FakeDevice::honest());
    let throttled = Throttled::new(honest(), 0.5).map(|device| Arc::new(device) as Arc<dyn Device>);
    subjects.push(Subject::new("fake", "throttled", throttled.ok_or_else(|| "no such speed".to_owned())));
    subjects.push(Subject::new("fake", "recorded", Ok(Arc::new(Recorded::new(honest())))));
    let not_yet = Fault::new(FaultyCall::Submit, u32::MAX, Failure::Panic);
    subjects.push(Subject::new("fake", "not yet faulty", Ok(Arc::new(Faulty::new(honest(), not_yet)))));
    run(&arguments, trials(subjects)).exit();
}

fn cpu(label: &str, threads: &[usize], isa: Option<Isa>) -> Vec<Subject> {
    match CpuDevice::open_all_with(threads, isa) {
        Ok(devices) => {
            let subject = |(i, device): (usize, CpuDevice)| {
                let label = if threads.len() == 1 { label.to_owned() } else { format!("{label}-{i}") };
                Subject::new("cpu", &label, Ok(Arc::new(device) as Arc<dyn Device>))
            };
            devices.into_iter().enumerate().map(subject).collect()
        }
        Err(e) => vec![Subject::new("cpu", label, Err(e.to_string()))],
    }
}
