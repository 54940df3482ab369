//! Writes every kind of chart and picture from made-up data, to look at them:
//! `cargo run -p rt-report --example charts`.

use glam::Vec3;
use rt_balance::report::{Activity, ActivityKind, DeviceReport, EstimateReport, StreamReport, StreamRun};
use rt_core::{StreamKind, Task, Work};
use rt_report::Provenance;
use rt_report::chart::{cost, timeline, trace};
use rt_report::print::Stdout;
use std::io::Write;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "out/charts".to_owned());
    let folder = Path::new(&folder);
    let runs = [
        stream(StreamKind::Primary, 0.0, &[1.0, 2.0, 4.0], 14),
        stream(StreamKind::Shadow(0), 0.4, &[1.0, 2.0, 4.0], 700),
        with_lost_device(stream(StreamKind::Diffuse(0), 0.95, &[1.0, 2.0, 4.0], 40)),
        stream(StreamKind::Diffuse(1), 1.5, &[1.0; 64], 6),
    ];
    let provenance = Provenance::now(None, ["virtual"]);
    timeline::write_svg(&folder.join("timeline.svg"), &runs, &provenance)?;
    trace::write_json(&folder.join("trace.json"), &runs, &provenance)?;
    costs(&folder.join("cost-tasks.png"), 640, 400, 64)?;
    costs(&folder.join("cost-large.png"), 1920, 1080, 8)?;
    costs(&folder.join("cost-small.png"), 64, 96, 16)?;
    spheres(&folder.join("image.png"))?;
    writeln!(Stdout, "written to {}", folder.display())?;
    Ok(())
}

/// A number in `[0, 1)` that looks random.
fn noise(seed: u32) -> f64 {
    f64::from(rt_core::random::pair(seed, 0, 0)[0])
}

/// Each device estimates, then works off shrinking launches with small pauses between them.
fn stream(kind: StreamKind, start_s: f64, speeds: &[f64], launches: u32) -> StreamRun {
    let makespan_s = 0.25 + 0.3 * noise(launches);
    let mut activities = Vec::new();
    let mut devices = Vec::new();
    for (device, speed) in speeds.iter().enumerate() {
        let estimate_s = 0.004 + 0.003 * noise(device as u32);
        let mut now = start_s + 0.001;
        let mut bar = |kind, seconds: f64, pause: f64| {
            let (tasks, predicted_s) = match kind {
                ActivityKind::Estimate => (Vec::new(), None),
                ActivityKind::Launch => (vec![device as u32; 3], Some(seconds)),
            };
            activities.push(Activity {
                device,
                kind,
                start_s: now,
                end_s: now + seconds,
                tasks,
                rays: 4096,
                predicted_s,
            });
            now += seconds + pause;
        };
        bar(ActivityKind::Estimate, estimate_s, 0.002);
        let end = makespan_s * (1.0 - 0.03 * noise(device as u32 + launches)) - estimate_s - 0.003;
        let weights: Vec<f64> = (0..launches).map(|i| 1.0 / (1.0 + f64::from(i) * 6.0 / f64::from(launches))).collect();
        let sum: f64 = weights.iter().sum();
        for weight in weights {
            let seconds = end * weight / sum;
            bar(ActivityKind::Launch, seconds * 0.98, seconds * 0.02);
        }
        devices.push(DeviceReport {
            name: format!("AMD EPYC 9654 96-Core, cores {}", speed * 4.0),
            backend: "cpu".to_owned(),
            busy_s: end * 0.98 + estimate_s,
            kernel_share: Some(0.97),
            on_host: Some(0),
            uploaded_bytes: Some(0),
            downloaded_bytes: Some(0),
            launches,
            tasks: launches * 3,
            rays: u64::from(launches) * 4096,
            error: None,
            ..DeviceReport::default()
        });
    }
    let report = StreamReport {
        kind: kind.to_string(),
        frame: 0,
        wave: 0,
        rays: 1_048_576,
        tasks: 1024,
        estimate: EstimateReport {
            estimator: "strided".to_owned(),
            fraction: 1.0 / 64.0,
            seconds: 0.006,
            overhead: Some(0.01),
            mre_counts: Some(0.012),
            mre_time: Some(0.05),
            ..EstimateReport::default()
        },
        setup_s: 0.0,
        makespan_s,
        imbalance: Some(0.0172),
        lower_bound_s: Some(makespan_s * 0.99),
        excess: Some(0.0101),
        devices,
        task_times: None,
    };
    StreamRun {
        report,
        kind,
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

fn with_lost_device(mut run: StreamRun) -> StreamRun {
    let middle = run.activities[0].start_s + run.report.makespan_s / 2.0;
    run.activities.retain(|activity| activity.device != 1 || activity.end_s < middle);
    run.report.devices[1].error = Some("launch 18 failed: the device does not answer any more".to_owned());
    run
}

/// A smooth cost with a few expensive places, in square tasks.
fn costs(path: &Path, width: u32, height: u32, side: u32) -> Result<(), Box<dyn std::error::Error>> {
    let mut pixels = Vec::new();
    let mut tasks = Vec::new();
    let (mut estimated, mut measured) = (Vec::new(), Vec::new());
    for top in (0..height).step_by(side as usize) {
        for left in (0..width).step_by(side as usize) {
            let first = pixels.len() as u32;
            let mut cost = 0.0;
            for y in top..(top + side).min(height) {
                for x in left..(left + side).min(width) {
                    pixels.push(x | y << 16);
                    let (u, v) = (f64::from(x) / f64::from(width), f64::from(y) / f64::from(height));
                    let far = ((u - 0.6).powi(2) + (v - 0.4).powi(2)).sqrt();
                    cost += 120e-9 + 800e-9 * (-far * far * 30.0).exp() + 150e-9 * (v * 9.0).sin().abs();
                }
            }
            tasks.push(Task { first, rays: pixels.len() as u32 - first });
            estimated.push(cost);
            let known = tasks.len() % 97 != 0;
            measured.push(if known { cost * (0.9 + 0.25 * noise(tasks.len() as u32)) } else { f64::NAN });
        }
    }
    let count = tasks.len();
    let run = StreamRun {
        work: vec![Work::default(); count],
        kept: vec![0; count],
        device_of: vec![0; count],
        tasks,
        predicted_s: estimated,
        measured_s: measured,
        ..stream(StreamKind::Primary, 0.0, &[1.0], 1)
    };
    let mut map = cost::CostMap::new("primary", [width, height]);
    map.add(&run, cost::each_ray(|ray| pixels[ray as usize]));
    Ok(cost::write_png(path, &[map])?)
}

/// Coloured discs from dark to far too bright: highlights must fade to white without turning another colour.
fn spheres(path: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let (width, height) = (640_usize, 320_usize);
    let colors = [Vec3::new(0.9, 0.1, 0.05), Vec3::new(0.1, 0.7, 0.2), Vec3::new(0.1, 0.2, 0.9), Vec3::ONE];
    let mut image = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (column, row) = (x / 80, y / 80);
            let (dx, dy) = ((x % 80) as f32 / 40.0 - 1.0, (y % 80) as f32 / 40.0 - 1.0);
            let inside = (1.0 - dx * dx - dy * dy).max(0.0).sqrt();
            image.push(colors[row] * inside * 2.0_f32.powi(column as i32 - 3));
        }
    }
    Ok(rt_report::image::write_png(path, [width as u32, height as u32], &image, |_| 1.0)?)
}
