//! SIGINT and SIGTERM while a driver is at work that nobody can stop: it compiles kernels.

use super::Outcome;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Far more than a loaded machine needs for what is to take a second.
const LIMIT: Duration = Duration::from_secs(60);

/// When the signals come, in seconds: kernels are compiled from about the second one on.
const MOMENTS: [f64; 8] = [0.05, 0.2, 0.4, 0.7, 1.0, 1.5, 2.2, 3.0];

/// The signal comes before, while and after kernels are compiled anew, since no cache is used.
///
/// Mutants: no thread that ends what does not end by itself; destructors of drivers run beside their own threads, after
/// the thread that ends the process or after `main`, which ends the process by another signal or not at all.
pub(crate) fn ends_while_compiling(device: &str) -> Outcome {
    let folder = tempfile::tempdir()?;
    for (i, moment) in MOMENTS.into_iter().enumerate() {
        let (signal, code) = if i % 2 == 0 { (SIGTERM, 143) } else { (SIGINT, 130) };
        let mut command = Command::new(env!("CARGO_BIN_EXE_raybalance"));
        command.current_dir(folder.path()).env("MESA_SHADER_CACHE_DISABLE", "true");
        // Endless but for the signal.
        command.args(["render", "yard", "--size", "8000x8000", "--spp", "64", "--devices", device]);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
        std::thread::sleep(Duration::from_secs_f64(moment));
        let sent = Command::new("kill").arg(format!("-{signal}")).arg(child.id().to_string()).status()?;
        let begin = Instant::now();
        let status = loop {
            match child.try_wait()? {
                Some(status) => break Some(status),
                None if begin.elapsed() > LIMIT => break None,
                None => std::thread::sleep(Duration::from_millis(20)),
            }
        };
        let Some(status) = status else {
            child.kill()?;
            child.wait()?;
            return Err(format!("deaf to signal {signal} after {moment} s").into());
        };
        if !sent.success() || status.code() != Some(code) {
            return Err(format!("signal {signal} after {moment} s: {status}").into());
        }
    }
    Ok(())
}
