//! Times the trace of a file of rays in Rust, for `side_by_side.py`: `same_in_rust SCENE RAYS.npy DEVICES COHERENT`
//! waits for lines on standard input and answers each with the seconds of one trace, in the caller's own buffers.
#![forbid(unsafe_code)]

use rt_balance::devices::Opener;
use rt_balance::{
    Balancer, Coherence, Control, Device, Hit, Query, RaySource, Scheduling, Stream, StreamKind, StreamSpec,
};
use rt_scene::npy::RayFile;
use rt_scene::prepare::{Options, prepare};
use rt_scene::progress::unwatched;
use std::error::Error;
use std::io::{BufRead, Write, stdin, stdout};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, scene, rays, devices, coherent] = &arguments[..] else {
        return Err("SCENE RAYS.npy DEVICES COHERENT".into());
    };
    let prepared = prepare(Path::new(scene), &Options::new(Default::default()), &mut unwatched)?;
    let rays = RayFile::open(Path::new(rays))?.read(prepared.model.offset)?;
    let opened = Opener::new().open(devices)?;
    let devices: Vec<Arc<dyn Device>> = opened.into_iter().map(|opened| opened.device).collect();
    let mut balancer = Balancer::new(Arc::clone(&prepared.built.scene), &devices)?;
    let mut scheduling = Scheduling::default();
    let coherence = if coherent == "coherent" { Coherence::Coherent } else { Coherence::Unknown };
    let spec = StreamSpec { coherence, ..StreamSpec::new(Query::Closest, prepared.precision, false) };
    let mut hits = vec![Hit::MISS; rays.len()];
    for line in stdin().lock().lines() {
        line?;
        let start = Instant::now();
        let source = RaySource::Explicit { rays: rays[..].into(), origins: None };
        let stream = Stream::new(source, StreamKind::Custom, spec);
        balancer.trace(&stream, &mut scheduling, &mut hits, None, Control::default())?;
        writeln!(stdout(), "{}", start.elapsed().as_secs_f64())?;
    }
    Ok(())
}
