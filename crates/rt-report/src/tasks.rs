//! `tasks.csv`: what is known of every task, one a line.

use crate::output::write_atomically;
use crate::{Provenance, ReportError};
use rt_balance::report::StreamRun;
use rt_core::Work;
use std::io::{self, Write};
use std::path::Path;

/// The columns, described in docs/report.md.
const HEAD: &str = "stream,frame,wave,task,first_ray,rays,kept,device,estimated_tests,std_error,predicted_s,measured_s,\
                    unused_tests,unused_std_error,unused_predicted_s";

/// Writes the tasks of all streams.
///
/// # Errors
/// When the file cannot be written.
pub fn write_csv(path: &Path, runs: &[StreamRun], provenance: &Provenance) -> Result<(), ReportError> {
    write_atomically(path, |out| {
        writeln!(out, "{}{HEAD}", provenance.csv())?;
        runs.iter().try_for_each(|run| lines(run, out))
    })
}

fn lines(run: &StreamRun, out: &mut dyn Write) -> io::Result<()> {
    let report = &run.report;
    // Nothing was expected where every ray counted the same.
    let was_used = !report.estimate.is_uninformed();
    for (index, task) in run.tasks.iter().enumerate() {
        let used = was_used.then(|| (&run.work[index], run.predicted_s[index]));
        let unused = run.unused.as_ref().map(|unused| (&unused.work[index], unused.predicted_s[index]));
        let device = run.device_of.get(index).filter(|device| (**device as usize) < report.devices.len());
        writeln!(
            out,
            "{},{},{},{index},{},{},{},{},{},{},{}",
            report.kind,
            report.frame,
            report.wave,
            task.first,
            task.rays,
            run.kept[index],
            device.map_or_else(String::new, u32::to_string),
            expected(used),
            number(run.measured_s[index]),
            expected(unused),
        )?;
    }
    Ok(())
}

/// Tests, their standard error and predicted seconds.
fn expected(of: Option<(&Work, f64)>) -> String {
    let Some((work, seconds)) = of else { return ",,".to_owned() };
    let error = work.std_error().map_or_else(String::new, |error| error.to_string());
    format!("{},{error},{}", work.tests(), number(seconds))
}

/// Nothing where it is not known.
fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::samples::run;
    use rt_balance::UnusedEstimate;
    use rt_core::Task;

    /// Mutants: what every ray counted is written as an estimate; a column too many or too few; NaN.
    #[test]
    fn every_task_is_a_line_of_all_columns() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("tasks.csv");
        let mut run = run(1, Vec::new());
        run.tasks = vec![Task { first: 0, rays: 8 }, Task { first: 8, rays: 4 }];
        run.work = vec![Work::new(8.0, 8.0, 0.0); 2];
        (run.kept, run.device_of) = (vec![0, 1], vec![0, u32::MAX]);
        (run.predicted_s, run.measured_s) = (vec![0.5; 2], vec![0.25, f64::NAN]);
        let mut uninformed = run.clone();
        uninformed.report.estimate.chosen = "uniform".to_owned();
        let work = vec![Work::new(8.0, 100.0, 3.0).with_std_error(7.0); 2];
        uninformed.unused = Some(UnusedEstimate { work, predicted_s: vec![0.125, f64::NAN] });
        write_csv(&path, &[run, uninformed], &Provenance::now(1, ["cpu:1"])).unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
        assert_eq!(
            lines[1..],
            [
                "primary,0,0,0,0,8,0,0,8,,0.5,0.25,,,",
                "primary,0,0,1,8,4,1,,8,,0.5,,,,",
                "primary,0,0,0,0,8,0,0,,,,0.25,103,7,0.125",
                "primary,0,0,1,8,4,1,,,,,,103,7,",
            ]
        );
        let columns = lines[0].split(',').count();
        assert!(lines.iter().all(|line| line.split(',').count() == columns), "{text}");
    }
}
