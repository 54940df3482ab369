//! What a stream brought: hits, and how the work was balanced.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use rt_balance::report::StreamRun;
use rt_balance::{Hit, TestCounts, with_causes};
use rt_report::Provenance;
use rt_report::headline::Headline;
use rt_report::html::measured::Traced;
use rt_report::output::write_atomically;
use rt_report::report::{Report, SCHEMA, SceneReport, Seconds};
use rt_scene::prepare::Prepared;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// All that tracing a stream brought.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) hits: Vec<Hit>,
    pub(crate) counts: Option<Vec<TestCounts>>,
    pub(crate) run: StreamRun,
    pub(crate) queue: &'static str,
    pub(crate) policy: Option<&'static str>,
    /// Wall seconds of the call.
    pub(crate) seconds: f64,
}

/// A traced stream.
#[pyclass(frozen, module = "raybalance._raybalance")]
#[derive(Debug)]
pub(crate) struct Run {
    /// Until Python takes them.
    hits: Mutex<Vec<Hit>>,
    counts: Mutex<Option<Vec<TestCounts>>>,
    run: StreamRun,
    report: Report,
}

impl Run {
    pub(crate) fn new(scene: Arc<Prepared>, devices: Vec<String>, seed: u32, outcome: Outcome) -> Self {
        let Outcome { hits, counts, run, queue, policy, seconds } = outcome;
        let of_stream = &run.report;
        let report = Report {
            schema: SCHEMA,
            scene: SceneReport::of(&scene),
            picture: None,
            queue,
            policy,
            streams: vec![of_stream.clone()],
            updates: Vec::new(),
            cluster: Vec::new(),
            headline: Headline::of(std::slice::from_ref(&run)),
            seconds: Seconds {
                load: scene.load_s,
                build: scene.build_s,
                setup: of_stream.setup_s,
                estimate: of_stream.estimate.seconds,
                trace: of_stream.makespan_s - of_stream.estimate.seconds,
                total: seconds,
                ..Seconds::default()
            },
            provenance: Provenance::now(seed, devices),
        };
        Self { hits: Mutex::new(hits), counts: Mutex::new(counts), run, report }
    }
}

#[pymethods]
impl Run {
    /// The hits, N × 4, or K for each ray where several were asked for: t, u, v and the bits of the primitive's id.
    /// They are handed over without a copy, once.
    fn take_hits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let hits = std::mem::take(&mut *self.hits.lock().unwrap_or_else(PoisonError::into_inner));
        let rays = hits.len();
        bytemuck::cast_vec::<Hit, f32>(hits).into_pyarray(py).reshape([rays, 4])
    }

    /// Box and triangle tests, N × 2, if they were asked for; likewise.
    fn take_counts<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<u32>>>> {
        let Some(counts) = self.counts.lock().unwrap_or_else(PoisonError::into_inner).take() else { return Ok(None) };
        let rays = counts.len();
        bytemuck::cast_vec::<TestCounts, u32>(counts).into_pyarray(py).reshape([rays, 2]).map(Some)
    }

    /// Of each task: first ray, rays, estimated tests, predicted seconds, measured seconds, device.
    fn tasks<'py>(&self, py: Python<'py>) -> Columns<'py> {
        let StreamRun { tasks, work, predicted_s, measured_s, device_of, .. } = &self.run;
        (
            tasks.iter().map(|task| task.first).collect::<Vec<_>>().into_pyarray(py),
            tasks.iter().map(|task| task.rays).collect::<Vec<_>>().into_pyarray(py),
            work.iter().map(|work| f64::from(work.tests())).collect::<Vec<_>>().into_pyarray(py),
            predicted_s.clone().into_pyarray(py),
            measured_s.clone().into_pyarray(py),
            device_of.clone().into_pyarray(py),
        )
    }

    /// The text of report.json.
    fn report(&self) -> PyResult<String> {
        serde_json::to_string_pretty(&self.report).map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// Writes report.json.
    fn write_json(&self, path: PathBuf) -> PyResult<()> {
        let written = write_atomically(&path, |file| Ok(serde_json::to_writer_pretty(file, &self.report)?));
        written.map_err(|error| PyOSError::new_err(with_causes(&error)))
    }

    /// Writes the page; with a cost map where rays are those of a picture of (width, height).
    fn write_html(&self, path: PathBuf, size: Option<[u32; 2]>) -> PyResult<()> {
        let page = Traced { report: &self.report, run: &self.run, size };
        page.write(&path).map_err(|error| PyOSError::new_err(with_causes(&error)))
    }
}

/// One array for each of them.
type Columns<'py> = (
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<u32>>,
);
