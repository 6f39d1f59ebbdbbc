//! Threads of ours, which survive a fork.
//!
//! A forked child has its parent's memory but none of its threads: work given to a pool that was made
//! before the fork is never done. `rayon`'s global pool cannot be made anew, so this module keeps one of
//! its own and remembers which process made it. No lock is taken: a fork can happen at any moment.

use std::sync::atomic::{AtomicPtr, Ordering};

use rayon::{Scope, ThreadPool, ThreadPoolBuilder};

use crate::failure::Failure;

struct Pool {
    process: u32,
    threads: ThreadPool,
}

/// Never freed: a pool replaced after a fork cannot be, its threads being gone.
static POOL: AtomicPtr<Pool> = AtomicPtr::new(std::ptr::null_mut());

/// Runs some work on a thread of the pool, where what it shares out finds the others.
///
/// # Errors
/// `InternalError` if the system refuses threads.
pub(crate) fn run<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    Ok(current()?.threads.install(work))
}

/// Runs some work on the caller's own thread, from which it hands parts of itself to threads of the pool; ends when they have.
///
/// # Errors
/// `InternalError` if the system refuses threads.
pub(crate) fn handing_out<'scope, T>(work: impl FnOnce(&Scope<'scope>) -> T) -> Result<T, Failure> {
    Ok(current()?.threads.in_place_scope(work))
}

fn current() -> Result<&'static Pool, Failure> {
    let process = std::process::id();
    loop {
        let found = POOL.load(Ordering::Acquire);
        if let Some(pool) = leaked(found)
            && pool.process == process
        {
            return Ok(pool);
        }
        let threads = ThreadPoolBuilder::new()
            .thread_name(|number| format!("helio-{number}"))
            .build()
            .map_err(|e| Failure::new("InternalError", format!("no threads to be had: {e}")))?;
        let made = Box::into_raw(Box::new(Pool { process, threads }));
        let set = POOL.compare_exchange(found, made, Ordering::AcqRel, Ordering::Acquire);
        if set.is_err() {
            discard(made);
        }
    }
}

#[allow(unsafe_code)]
fn leaked(pool: *mut Pool) -> Option<&'static Pool> {
    // SAFETY: null, or from `Box::into_raw` in `current` and put into `POOL`, from where nothing is
    // ever freed.
    unsafe { pool.as_ref() }
}

#[allow(unsafe_code)]
fn discard(pool: *mut Pool) {
    // SAFETY: from `Box::into_raw` in `current`, and seen by nobody: another thread was first.
    drop(unsafe { Box::from_raw(pool) });
}
