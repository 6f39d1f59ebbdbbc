//! One heliostat after another, in parallel.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use helio_io::Finished;
use helio_io::calibrate::{Done, Run};
use rayon::prelude::*;

use crate::commands::track::stop_on_signals;
use crate::failure::Failure;
use crate::printer::{Counted, Grouped, Printer};

/// What threads share.
struct Shared {
    part: Option<Finished>,
    done: Vec<Done>,
    progress: crate::printer::Progress,
    failed: Option<Failure>,
}

fn held(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Calibrates every heliostat that is not finished, in parallel.
pub(super) fn all(
    run: &Run<'_>,
    part: Option<(Finished, Vec<String>)>,
    printer: &Printer,
) -> Result<(Vec<Done>, Option<Finished>), Failure> {
    let all = &run.observations.heliostats;
    let (part, lines) = part.map_or((None, Vec::new()), |(part, lines)| (Some(part), lines));
    let mut done: Vec<Done> = Vec::with_capacity(all.len());
    let mut is_done = vec![false; all.len()];
    for line in &lines {
        // The key is right and the checksum too: the line is one of ours.
        if let Some(one) = Done::from_line(line)
            && one.index < all.len()
            && !std::mem::replace(&mut is_done[one.index], true)
        {
            done.push(one);
        }
    }
    if !done.is_empty() {
        printer.say(format_args!(
            "resumed: {} of {} are finished",
            Grouped(done.len() as u64),
            Counted(all.len(), "heliostat")
        ));
    }
    let todo: Vec<usize> = (0..all.len()).filter(|&index| !is_done[index]).collect();
    let stop = stop_on_signals();
    let give_up = AtomicBool::new(false);
    let shared = Mutex::new(Shared {
        part,
        done,
        progress: printer.progress_of(todo.len() as u64, "heliostats"),
        failed: None,
    });
    todo.par_iter().with_max_len(1).for_each(|&index| {
        if stop.load(Ordering::Relaxed) || give_up.load(Ordering::Relaxed) {
            return;
        }
        let one = run.one(index).map_err(Failure::from);
        let mut shared = held(&shared);
        let kept = one.and_then(|one| {
            if let Some(part) = &mut shared.part {
                part.add(&one.to_line())?;
            }
            shared.done.push(one);
            Ok(())
        });
        if let Err(failure) = kept {
            give_up.store(true, Ordering::Relaxed);
            shared.failed.get_or_insert(failure);
        }
        shared.progress.advance(1);
    });
    let Shared {
        part,
        mut done,
        progress,
        failed,
    } = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
    progress.finish();
    if let Some(failure) = failed {
        return Err(failure);
    }
    if done.len() < all.len() {
        return Err(match part {
            Some(part) => Failure::Paused {
                done: done.len(),
                of: all.len(),
                path: part.path().to_owned(),
            },
            None => Failure::Interrupted { streamed: false },
        });
    }
    // In the order of the field, whoever was first.
    done.sort_by_key(|one| one.index);
    Ok((done, part))
}
