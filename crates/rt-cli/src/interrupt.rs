//! SIGINT and SIGTERM: the first one ends the command within a second, wherever it is.
//!
//! It sets a flag, which everything that can stop in good order looks at. Not everything can: a parser, a compiler of
//! kernels, a driver, a full pipe. So what has not ended when [`PATIENCE`] is over is ended from outside, and what it
//! was writing is removed. [`saving`] what is whole is given more time. A second signal has no patience.

use anyhow::{Result, bail};
use rt_balance::Control;
use rt_report::exit::Exit;
use std::io::{self, Write};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::time::Duration;

/// From a signal to the end of the process, less what ending takes, is to be a second at most.
#[cfg(unix)]
const PATIENCE: Duration = Duration::from_millis(700);

/// Most time that saving what is whole may take after a signal: a folder on a network may be slow.
#[cfg(unix)]
const SAVING: Duration = Duration::from_secs(30);

static REQUESTED: AtomicBool = AtomicBool::new(false);

static IS_SAVING: AtomicBool = AtomicBool::new(false);

/// The exit code that goes with the signal; 0 before there was one.
static CODE: AtomicU8 = AtomicU8::new(0);

/// Begins to watch for signals. Where that is not possible they end the process at once, which loses nothing but may
/// leave files in the making; the next run clears them.
pub(crate) fn watch() {
    #[cfg(unix)]
    let _ = signals::watch();
}

/// What stops a run.
pub(crate) fn control() -> Control<'static> {
    Control { cancel: Some(flag()), ..Control::default() }
}

/// The flag that a run looks at.
pub(crate) fn flag() -> &'static AtomicBool {
    &REQUESTED
}

/// Whether a signal came.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}

/// Says whether what is whole is being saved, which the first signal does not cut short.
pub(crate) fn saving(is_saving: bool) {
    IS_SAVING.store(is_saving, Ordering::Relaxed);
}

/// What a signal asks to end with, if one came.
pub(crate) fn exit() -> Option<Exit> {
    [Exit::Interrupted, Exit::Terminated].into_iter().find(|exit| exit.code() == CODE.load(Ordering::Relaxed))
}

/// Ends the process when all is written.
///
/// Not by returning from `main`, which runs the clean-up of drivers: a device that did not answer, or was not waited
/// for after a signal, has left a thread at work in its driver, and that crashes.
pub(crate) fn leave(exit: Exit) -> ExitCode {
    // What clap printed; our own results were flushed where it could still be told that they are lost.
    let _ = io::stdout().flush();
    #[cfg(unix)]
    signal_hook::low_level::exit(exit.code().into());
    #[cfg(not(unix))]
    exit.into()
}

/// An error once a signal came.
pub(crate) fn check() -> Result<()> {
    if requested() {
        bail!("interrupted");
    }
    Ok(())
}

#[cfg(unix)]
mod signals {
    use super::{CODE, Exit, IS_SAVING, PATIENCE, REQUESTED, SAVING};
    use rt_report::{output, print};
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::{flag, low_level};
    use std::io::{self, Read};
    use std::os::unix::net::UnixStream;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc;
    use std::thread::Builder;
    use std::time::{Duration, Instant};

    pub(super) fn watch() -> io::Result<()> {
        let (wakes, waker) = UnixStream::pair()?;
        let latest = Arc::new(AtomicUsize::new(0));
        let seen = Arc::clone(&latest);
        // First the thread: if there can be none, signals keep their meaning.
        Builder::new().name("signals".to_owned()).spawn(move || wait_and_end(wakes, &seen))?;
        for signal in [SIGINT, SIGTERM] {
            flag::register_usize(signal, Arc::clone(&latest), signal as usize)?;
            low_level::pipe::register(signal, waker.try_clone()?)?;
        }
        Ok(())
    }

    /// Ends the process some time after the first signal, or at the second, unless it has ended by itself.
    fn wait_and_end(mut wakes: UnixStream, latest: &AtomicUsize) {
        let mut wake = [0];
        if wakes.read_exact(&mut wake).is_err() {
            return;
        }
        let is_term = latest.load(Ordering::Relaxed) == SIGTERM as usize;
        let exit = if is_term { Exit::Terminated } else { Exit::Interrupted };
        CODE.store(exit.code(), Ordering::Relaxed);
        REQUESTED.store(true, Ordering::Relaxed);
        let (begin, _) = (Instant::now(), wakes.set_read_timeout(Some(PATIENCE)));
        while wakes.read_exact(&mut wake).is_err() && IS_SAVING.load(Ordering::Relaxed) && begin.elapsed() < SAVING {}
        output::abandon();
        say("error: interrupted");
        // Not the exit of the standard library: it runs the clean-up of drivers whose threads are at work.
        low_level::exit(exit.code().into())
    }

    /// Prints a line, but does not wait for a terminal that is stopped or a pipe that is full.
    fn say(line: &'static str) {
        const LONGEST: Duration = Duration::from_millis(50);
        let (done, said) = mpsc::channel();
        let speak = move || {
            print::note(line);
            let _ = done.send(());
        };
        let _ = Builder::new().spawn(speak);
        let _ = said.recv_timeout(LONGEST);
    }
}
