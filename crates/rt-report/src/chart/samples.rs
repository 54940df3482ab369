//! Made-up runs for tests.

use rt_balance::report::{Activity, ActivityKind, DeviceReport, EstimateReport, StreamReport, StreamRun};
use rt_core::StreamKind;

pub(crate) fn launch(device: usize, start_s: f64, end_s: f64) -> Activity {
    Activity {
        device,
        kind: ActivityKind::Launch,
        start_s,
        end_s,
        tasks: vec![3],
        rays: 1024,
        predicted_s: Some(end_s - start_s),
    }
}

pub(crate) fn run(devices: usize, activities: Vec<Activity>) -> StreamRun {
    let device = DeviceReport {
        name: "a <device>".to_owned(),
        backend: "cpu".to_owned(),
        busy_s: 1.0,
        kernel_share: Some(0.97),
        on_host: Some(0),
        uploaded_bytes: Some(0),
        downloaded_bytes: Some(0),
        launches: 1,
        tasks: 1,
        rays: 1024,
        error: None,
        ..DeviceReport::default()
    };
    let estimate = EstimateReport {
        estimator: "strided".to_owned(),
        chosen: "strided".to_owned(),
        fraction: 0.01,
        seconds: 0.1,
        overhead: Some(0.05),
        mre_counts: None,
        mre_time: None,
        ..EstimateReport::default()
    };
    let report = StreamReport {
        kind: "primary".to_owned(),
        frame: 0,
        wave: 0,
        rays: 1_048_576,
        tasks: 1024,
        estimate,
        setup_s: 0.0,
        makespan_s: 2.0,
        imbalance: Some(0.01),
        lower_bound_s: None,
        excess: None,
        devices: vec![device; devices],
        task_times: None,
    };
    StreamRun {
        report,
        kind: StreamKind::Primary,
        tasks: Vec::new(),
        work: Vec::new(),
        kept: Vec::new(),
        predicted_s: Vec::new(),
        measured_s: Vec::new(),
        device_of: Vec::new(),
        activities,
        reference_s: None,
        unused: None,
    }
}
