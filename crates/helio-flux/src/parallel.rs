//! Work cut into tasks that threads fetch one by one.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

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
