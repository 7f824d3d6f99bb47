//! A child process that can neither hang the program nor outlive what it was started for.
//!
//! Threads read what the child writes and hand it on; the caller waits for it in small steps, asks between two of them whether
//! to stop, and gives up on a child that has written nothing for a while. The child has a process group of its own, so that
//! Ctrl-C reaches this program alone, which then ends the child. It is killed when its owner is dropped.

use std::{
    io::{self, Read},
    process::{Child, ChildStderr, ChildStdout, Command, Stdio},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{Receiver, RecvTimeoutError},
    },
    thread,
    time::{Duration, Instant},
};

use super::options::Stop;
use crate::IoError;

/// A child that writes nothing for this long is taken for hung. While ffmpeg works it writes twice a second.
pub(super) const PATIENCE: Duration = Duration::from_secs(60);
/// Between two questions whether to stop.
const STEP: Duration = Duration::from_millis(50);

/// Why waiting for a child ended without what was waited for.
#[derive(Debug)]
pub(super) enum Gone {
    /// The caller asked to stop.
    Interrupted,
    /// It wrote nothing for this long.
    Silent(Duration),
}

/// A running child.
#[derive(Debug)]
pub(super) struct Running {
    child: Child,
    pulse: Pulse,
    stop: Stop,
    patience: Duration,
}

/// What a child writes, to be read by threads of their own. Reading counts as a sign of life.
pub(super) struct Pipes {
    pub(super) out: Heard<ChildStdout>,
    pub(super) err: Heard<ChildStderr>,
}

impl Running {
    /// Starts `command`.
    pub(super) fn start(mut command: Command, stop: &Stop, patience: Duration) -> io::Result<(Self, Pipes)> {
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn()?;
        let pulse = Pulse { since: Instant::now(), last_ms: Arc::default() };
        let (Some(out), Some(err)) = (child.stdout.take(), child.stderr.take()) else {
            unreachable!("BUG: both pipes were asked for")
        };
        let pipes =
            Pipes { out: Heard { pipe: out, pulse: pulse.clone() }, err: Heard { pipe: err, pulse: pulse.clone() } };
        Ok((Self { child, pulse, stop: stop.clone(), patience }, pipes))
    }

    /// The next item from a reading thread; none when that thread has ended.
    pub(super) fn next<T>(&mut self, items: &Receiver<T>) -> Result<Option<T>, Gone> {
        // Only silence while somebody waits counts: a child whose pictures are not fetched has nothing to write into.
        self.pulse.beat();
        loop {
            self.check()?;
            match items.recv_timeout(STEP) {
                Ok(item) => return Ok(Some(item)),
                Err(RecvTimeoutError::Disconnected) => return Ok(None),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Waits for the child's end and says whether it was content.
    pub(super) fn succeeded(&mut self) -> Result<bool, Gone> {
        self.pulse.beat();
        loop {
            self.check()?;
            match self.child.try_wait() {
                Ok(Some(status)) => return Ok(status.success()),
                Ok(None) => thread::sleep(Duration::from_millis(5)),
                Err(_) => return Ok(false),
            }
        }
    }

    fn check(&mut self) -> Result<(), Gone> {
        let gone = if self.stop.check().is_err() {
            Gone::Interrupted
        } else if self.pulse.idle() > self.patience {
            Gone::Silent(self.patience)
        } else {
            return Ok(());
        };
        self.kill();
        Err(gone)
    }

    /// Ends it. Nothing is left to do about a child that has already gone.
    pub(super) fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill();
    }
}

/// When a child last wrote something.
#[derive(Debug, Clone)]
struct Pulse {
    since: Instant,
    last_ms: Arc<AtomicU64>,
}

impl Pulse {
    fn beat(&self) {
        self.last_ms.store(self.since.elapsed().as_millis() as u64, Ordering::Relaxed);
    }

    fn idle(&self) -> Duration {
        self.since.elapsed().saturating_sub(Duration::from_millis(self.last_ms.load(Ordering::Relaxed)))
    }
}

/// A pipe whose every read is a sign of life.
pub(super) struct Heard<R> {
    pipe: R,
    pulse: Pulse,
}

impl<R: Read> Read for Heard<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.pipe.read(buffer);
        self.pulse.beat();
        read
    }
}

/// Runs `work` on a thread of its own. It ends by itself when its pipe closes or nobody wants its items any more, so it is never
/// waited for: a grandchild may hold a pipe open for longer than the child lives.
pub(super) fn on_thread(name: &str, work: impl FnOnce() + Send + 'static) -> io::Result<()> {
    thread::Builder::new().name(name.to_owned()).spawn(work).map(drop)
}

/// Turns the end of waiting into an error about `path`; `tool` is the program's name.
pub(super) fn gone(error: &Gone, tool: &'static str, path: &std::path::Path) -> IoError {
    match error {
        Gone::Interrupted => IoError::Interrupted,
        Gone::Silent(patience) => IoError::ToolHangs { tool, seconds: patience.as_secs(), path: path.to_owned() },
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::sync::{atomic::AtomicBool, mpsc::sync_channel};

    use super::*;

    /// A child that is silent after one line, and a thread that reads it.
    fn silent(stop: &Stop, patience: Duration) -> (Running, Receiver<String>) {
        let mut command = Command::new("sh");
        command.args(["-c", "echo ready; exec sleep 60"]);
        let (running, mut pipes) = Running::start(command, stop, patience).expect("sh starts");
        let (send, items) = sync_channel(1);
        on_thread("test", move || {
            let mut line = [0; 6];
            if pipes.out.read_exact(&mut line).is_ok() {
                let _ = send.send(String::from_utf8_lossy(&line).into_owned());
                let _ = pipes.out.read(&mut line);
            }
        })
        .expect("a thread starts");
        (running, items)
    }

    #[test]
    fn a_silent_child_is_given_up() {
        let since = Instant::now();
        let (mut running, items) = silent(&Stop::default(), Duration::from_millis(300));
        assert_eq!(running.next(&items).unwrap().as_deref(), Some("ready\n"));
        assert!(matches!(running.next(&items), Err(Gone::Silent(_))));
        assert!(since.elapsed() < Duration::from_secs(20), "it was not waited for");
        assert!(running.child.try_wait().unwrap().is_some(), "it is gone");
    }

    #[test]
    fn a_stop_ends_the_child() {
        let flag = Arc::new(AtomicBool::new(false));
        let asked = flag.clone();
        let (mut running, items) = silent(&Stop::when(move || asked.load(Ordering::Relaxed)), PATIENCE);
        assert_eq!(running.next(&items).unwrap().as_deref(), Some("ready\n"));
        flag.store(true, Ordering::Relaxed);
        let since = Instant::now();
        assert!(matches!(running.next(&items), Err(Gone::Interrupted)));
        assert!(since.elapsed() < Duration::from_secs(10));
        assert!(running.child.try_wait().unwrap().is_some(), "it is gone");
    }
}
