//! Long work: the interpreter is free while it runs, Ctrl-C ends it, and progress is told.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use pyo3::prelude::*;

use crate::failure::Failure;
use crate::pool;

/// How often the user is asked whether to go on, and told how far it is.
const LOOK: Duration = Duration::from_millis(50);

/// Runs some work on the threads of the pool. The work tells the closure it is given how much more is done and how
/// much there is in all, and ends early when that answers false. `progress`, if there is one, is called with both sums.
///
/// # Errors
/// What the user's signal or `progress` raised; `InternalError` without a thread to be had.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&(dyn Fn(u64, u64) -> bool + Sync)) -> T + Send,
) -> Result<T, Failure> {
    let (done, all) = (AtomicU64::new(0), AtomicU64::new(0));
    let stop = AtomicBool::new(false);
    let watch = |more: u64, total: u64| {
        done.fetch_add(more, Ordering::Relaxed);
        all.store(total, Ordering::Relaxed);
        !stop.load(Ordering::Relaxed)
    };
    let look = || {
        Python::attach(|py| {
            py.check_signals()?;
            let all = all.load(Ordering::Relaxed);
            match progress {
                Some(progress) if all > 0 => progress
                    .call1(py, (done.load(Ordering::Relaxed).min(all), all))
                    .map(|_| ()),
                _ => Ok(()),
            }
        })
    };
    let answer = py.detach(|| {
        let (send, ended) = channel();
        std::thread::scope(|scope| {
            let task = || {
                // Whatever happens, the one who waits hears of the end.
                let answer = catch_unwind(AssertUnwindSafe(|| pool::run(|| work(&watch))));
                let _ = send.send(());
                answer
            };
            let worker = std::thread::Builder::new()
                .name("helio-watched".into())
                .spawn_scoped(scope, task)
                .map_err(|e| Failure::new("InternalError", format!("no thread to be had: {e}")))?;
            let mut raised = None;
            while ended.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if raised.is_none()
                    && let Err(error) = look()
                {
                    stop.store(true, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
            let answer = worker.join().and_then(|answer| answer);
            match raised {
                Some(error) => Err(Failure::Python(error)),
                None => answer.unwrap_or_else(|panic| resume_unwind(panic)),
            }
        })
    })?;
    // The last word of progress, and of a Ctrl-C that came with the end.
    look()?;
    Ok(answer)
}
