//! A device that remembers what it was asked.

use rt_core::{
    Clock, Device, DeviceError, DeviceInfo, Hit, Launch, RayMask, RaySource, Scene, Span, StreamSpec, Task, TestCounts,
    Ticket, Tracer, Traffic, Walk,
};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// One call that a [`Recorded`] device answered.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Record {
    /// Rays were loaded.
    Load {
        /// Number of rays.
        rays: u32,
    },
    /// Rays were walked.
    Walk {
        /// Number of rays.
        rays: usize,
    },
    /// A launch was submitted.
    Submit {
        /// Its tasks.
        tasks: Vec<Task>,
    },
    /// A launch's results were taken.
    Wait {
        /// Its ticket.
        ticket: Ticket,
    },
}

/// A device that writes down every call that succeeded, over all its tracers.
#[derive(Debug)]
pub struct Recorded {
    inner: Arc<dyn Device>,
    records: Arc<Mutex<Vec<Record>>>,
}

impl Recorded {
    /// Records what `inner` does.
    #[must_use]
    pub fn new(inner: Arc<dyn Device>) -> Self {
        Self { inner, records: Arc::default() }
    }

    /// Everything recorded so far, in order.
    #[must_use]
    pub fn records(&self) -> Vec<Record> {
        self.records.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Device for Recorded {
    fn info(&self) -> &DeviceInfo {
        self.inner.info()
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        let inner = self.inner.tracer(scene, clock)?;
        Ok(Box::new(RecordedTracer { inner, records: Arc::clone(&self.records) }))
    }
}

#[derive(Debug)]
struct RecordedTracer {
    inner: Box<dyn Tracer>,
    records: Arc<Mutex<Vec<Record>>>,
}

impl RecordedTracer {
    fn push(&self, record: Record) {
        self.records.lock().unwrap_or_else(PoisonError::into_inner).push(record);
    }
}

impl Tracer for RecordedTracer {
    fn prepare(&mut self, source: &RaySource, spec: StreamSpec, walk: Option<Walk>) {
        self.inner.prepare(source, spec, walk);
    }

    fn move_scene(&mut self, scene: Arc<Scene>) -> Result<(), DeviceError> {
        self.inner.move_scene(scene)
    }

    fn load_rays(&mut self, source: RaySource, spec: StreamSpec) -> Result<(), DeviceError> {
        let rays = source.len();
        self.inner.load_rays(source, spec)?;
        self.push(Record::Load { rays });
        Ok(())
    }

    fn walk(
        &mut self,
        rays: &[u32],
        walk: Walk,
        counts: &mut [TestCounts],
        hits: Option<&mut [Hit]>,
    ) -> Result<Span, DeviceError> {
        let span = self.inner.walk(rays, walk, counts, hits)?;
        self.push(Record::Walk { rays: rays.len() });
        Ok(span)
    }

    fn submit(&mut self, tasks: &[Task], done: Option<&Arc<RayMask>>) -> Result<Ticket, DeviceError> {
        let ticket = self.inner.submit(tasks, done)?;
        self.push(Record::Submit { tasks: tasks.to_vec() });
        Ok(ticket)
    }

    fn wait(&mut self, ticket: Ticket, limit: Duration, out: &mut Launch) -> Result<(), DeviceError> {
        self.inner.wait(ticket, limit, out)?;
        self.push(Record::Wait { ticket });
        Ok(())
    }

    fn traffic(&self) -> Traffic {
        self.inner.traffic()
    }

    fn note(&self) -> Option<&str> {
        self.inner.note()
    }
}
