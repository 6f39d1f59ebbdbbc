//! Work cut into tasks that threads fetch one by one.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Told by threads how much work they have just done and how much there is in all (rays, or
/// elements of a convolution); false asks them to stop.
pub type Watch<'a> = &'a (dyn Fn(u64, u64) -> bool + Sync);

/// Whether to go on, as whoever watches wants it.
pub(crate) struct Going<'a> {
    watch: Option<Watch<'a>>,
    all: u64,
    stopped: AtomicBool,
}

impl<'a> Going<'a> {
    pub(crate) fn new(watch: Option<Watch<'a>>, all: u64) -> Self {
        Self {
            watch,
            all,
            stopped: AtomicBool::new(false),
        }
    }

    pub(crate) fn is_on(&self) -> bool {
        !self.stopped.load(Ordering::Relaxed)
    }

    pub(crate) fn did(&self, work: u64) {
        if self.watch.is_some_and(|watch| !watch(work, self.all)) {
            self.stopped.store(true, Ordering::Relaxed);
        }
    }
}

/// Runs `work` on as many threads as are wanted and useful (0: all of the pool's), each with an iterator over
/// the tasks that it gets, and gives what they answer, in no order.
pub(crate) fn over_tasks<T: Send>(
    tasks: usize,
    threads: usize,
    work: impl Fn(&mut dyn Iterator<Item = usize>) -> T + Sync,
) -> Vec<T> {
    let threads = match threads {
        0 => rayon::current_num_threads(),
        some => some,
    };
    let threads = threads.min(tasks).max(1);
    let next = AtomicUsize::new(0);
    let fetch = || {
        let mut mine = core::iter::from_fn(|| {
            let task = next.fetch_add(1, Ordering::Relaxed);
            (task < tasks).then_some(task)
        });
        work(&mut mine)
    };
    if threads == 1 {
        return vec![fetch()];
    }
    let answers = Mutex::new(Vec::with_capacity(threads));
    let give = |answer| {
        let mut all = answers
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        all.push(answer);
    };
    rayon::in_place_scope(|scope| {
        for _ in 1..threads {
            scope.spawn(|_| give(fetch()));
        }
        give(fetch());
    });
    answers
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_is_done_once() {
        for threads in [0, 1, 2, 7] {
            for tasks in [0, 1, 5, 1000] {
                let mut done: Vec<_> =
                    over_tasks(tasks, threads, |mine| mine.collect::<Vec<_>>()).concat();
                done.sort_unstable();
                assert!(done.into_iter().eq(0..tasks), "{threads} {tasks}");
            }
        }
    }
}
