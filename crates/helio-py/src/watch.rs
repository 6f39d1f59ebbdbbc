//! Long work: the interpreter is free while it runs, Ctrl-C ends it, and progress is told.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;

use crate::failure::Failure;
use crate::pool;

/// How often the user is asked whether to go on, and told how far it is.
const LOOK: Duration = Duration::from_millis(50);

/// How long work that owns all it needs may take to end once it is to stop, before it is left to itself.
const PATIENCE: Duration = Duration::from_millis(300);

/// Told by the work how much more is done and how much there is in all; false where it is to end.
type Watch<'a> = &'a (dyn Fn(u64, u64) -> bool + Sync);

/// How far some work is, and whether it is to stop.
#[derive(Default)]
struct State {
    done: AtomicU64,
    all: AtomicU64,
    stop: AtomicBool,
}

impl State {
    fn watch(&self, more: u64, total: u64) -> bool {
        self.done.fetch_add(more, Ordering::Relaxed);
        self.all.store(total, Ordering::Relaxed);
        !self.stop.load(Ordering::Relaxed)
    }

    /// What the user's signal or `progress` raises.
    fn look(&self, progress: Option<&Py<PyAny>>) -> PyResult<()> {
        Python::attach(|py| {
            py.check_signals()?;
            let all = self.all.load(Ordering::Relaxed);
            match progress {
                Some(progress) if all > 0 => progress
                    .call1(py, (self.done.load(Ordering::Relaxed).min(all), all))
                    .map(|_| ()),
                _ => Ok(()),
            }
        })
    }
}

fn builder() -> thread::Builder {
    thread::Builder::new().name("helio-watched".into())
}

fn no_thread(error: &std::io::Error) -> Failure {
    Failure::new("InternalError", format!("no thread to be had: {error}"))
}

/// Runs some work on the threads of the pool. The work tells the closure it is given how much more is done and how
/// much there is in all, and ends early when that answers false. `progress`, if there is one, is called with both sums.
///
/// # Errors
/// What the user's signal or `progress` raised; `InternalError` without a thread to be had.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(Watch<'_>) -> T + Send,
) -> Result<T, Failure> {
    watched_alone(py, progress, |watch| pool::run(|| work(watch)))?
}

/// The same for work that hands the threads of the pool what is there to do itself.
///
/// # Errors
/// As [`watched`].
pub(crate) fn watched_alone<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(Watch<'_>) -> T + Send,
) -> Result<T, Failure> {
    let state = State::default();
    let watch = |more: u64, total: u64| state.watch(more, total);
    let answer = py.detach(|| {
        let (send, ended) = channel();
        thread::scope(|scope| {
            let task = || {
                // Whatever happens, the one who waits hears of the end.
                let answer = catch_unwind(AssertUnwindSafe(|| work(&watch)));
                let _ = send.send(());
                answer
            };
            let worker = builder()
                .spawn_scoped(scope, task)
                .map_err(|error| no_thread(&error))?;
            let mut raised = None;
            while ended.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if raised.is_none()
                    && let Err(error) = state.look(progress)
                {
                    state.stop.store(true, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
            let answer = worker.join().and_then(|answer| answer);
            match raised {
                Some(error) => Err(Failure::Python(error)),
                None => Ok(answer.unwrap_or_else(|panic| resume_unwind(panic))),
            }
        })
    })?;
    // The last word of progress, and of a Ctrl-C that came with the end.
    state.look(progress)?;
    Ok(answer)
}

/// Like [`watched`], for work that owns all it needs and does not look often enough: some tenths of a second after it is
/// told to stop it is left to itself, and ends when it looks next.
///
/// # Errors
/// As [`watched`].
pub(crate) fn watched_or_left<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(Watch<'_>) -> T + Send + 'static,
) -> Result<T, Failure> {
    watched_alone_or_left(py, progress, |watch| pool::run(|| work(watch)))?
}

/// The same for work that may wait, as for a stream, and hands the threads of the pool what is there to do itself.
///
/// # Errors
/// As [`watched`].
pub(crate) fn watched_alone_or_left<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(Watch<'_>) -> T + Send + 'static,
) -> Result<T, Failure> {
    let state = Arc::new(State::default());
    let theirs = Arc::clone(&state);
    let (send, ended) = channel();
    let task = move || {
        let watch = |more: u64, total: u64| theirs.watch(more, total);
        let answer = catch_unwind(AssertUnwindSafe(|| work(&watch)));
        // Nobody hears it who has gone.
        let _ = send.send(answer);
    };
    let ours = &state;
    let answer = py.detach(move || {
        builder().spawn(task).map_err(|error| no_thread(&error))?;
        let mut raised: Option<(PyErr, Instant)> = None;
        loop {
            match ended.recv_timeout(LOOK) {
                Err(RecvTimeoutError::Timeout) => {}
                _ if raised.is_some() => break,
                Ok(answer) => return Ok(answer.unwrap_or_else(|panic| resume_unwind(panic))),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(Failure::new(
                        "InternalError",
                        "a thread ended without an answer",
                    ));
                }
            }
            match &raised {
                Some((_, since)) if since.elapsed() > PATIENCE => break,
                Some(_) => {}
                None => {
                    if let Err(error) = ours.look(progress) {
                        ours.stop.store(true, Ordering::Relaxed);
                        raised = Some((error, Instant::now()));
                    }
                }
            }
        }
        match raised {
            Some((error, _)) => Err(Failure::Python(error)),
            None => Err(Failure::new("InternalError", "a thread was not waited for")),
        }
    })?;
    state.look(progress)?;
    Ok(answer)
}
