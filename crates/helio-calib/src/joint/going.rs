//! Long work that somebody watches and may end.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::CalibrationError;

/// Told by threads how many heliostats they have just gone through and how many there are to go through in all, one
/// counted each time; false asks them to stop.
pub type Progress<'a> = &'a (dyn Fn(u64, u64) -> bool + Sync);

/// Whether to go on, as whoever watches wants it.
pub(super) struct Going<'a> {
    progress: Progress<'a>,
    all: u64,
    stopped: AtomicBool,
}

impl<'a> Going<'a> {
    pub fn new(progress: Progress<'a>, all: usize) -> Self {
        Self {
            progress,
            all: all as u64,
            stopped: AtomicBool::new(false),
        }
    }

    /// Tells of heliostats and asks whether to go on; once it is not to, that stays.
    pub fn on_after(&self, heliostats: usize) -> bool {
        if !(self.progress)(heliostats as u64, self.all) {
            self.stopped.store(true, Ordering::Relaxed);
        }
        !self.stopped.load(Ordering::Relaxed)
    }

    /// Asks whether to go on.
    pub fn is_on(&self) -> bool {
        self.on_after(0)
    }

    /// # Errors
    /// [`CalibrationError::Stopped`] where something may not have been done.
    pub fn check(&self) -> Result<(), CalibrationError> {
        if self.is_on() {
            Ok(())
        } else {
            Err(CalibrationError::Stopped)
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::super::simulate::{FieldOptions, SimulatedField, simulate_field};
    use super::super::{JointOptions, LeftoverOptions, fit_joint, fit_joint_watched};
    use super::*;

    fn field() -> (SimulatedField, JointOptions) {
        let options = FieldOptions {
            heliostats: 40,
            records: 14,
            outlier_probability: 0.02,
            ..FieldOptions::new(3).unwrap()
        };
        let how = JointOptions {
            learnt_from: 24,
            ..JointOptions::new(options.site.latitude_rad())
        };
        (simulate_field(&options).unwrap(), how)
    }

    /// What a watcher who stops at a call is told before, and what comes of it.
    fn stopped_at(call: u64, work: impl Fn(Progress<'_>) -> Option<CalibrationError>) -> bool {
        let calls = AtomicU64::new(0);
        // true again afterwards: to have stopped once is enough
        let found = work(&|_, _| calls.fetch_add(1, Ordering::Relaxed) != call);
        match found {
            Some(error) => {
                assert_eq!(error, CalibrationError::Stopped, "{call}");
                true
            }
            None => {
                assert!(calls.load(Ordering::Relaxed) <= call, "{call}");
                false
            }
        }
    }

    /// Wherever it is stopped there is no answer and no panic.
    fn stops_anywhere(work: impl Fn(Progress<'_>) -> Option<CalibrationError>) -> u64 {
        let mut call = 0;
        while stopped_at(call, &work) {
            call += 1 + call / 8;
        }
        call
    }

    #[test]
    fn a_fit_is_watched_and_stops_wherever_it_is() {
        let (field, options) = field();
        let campaigns = field.first(14);
        let done = AtomicU64::new(0);
        let all = AtomicU64::new(0);
        let watched = fit_joint_watched(&campaigns, &options, &|more, of| {
            done.fetch_add(more, Ordering::Relaxed);
            all.store(of, Ordering::Relaxed);
            true
        });
        let fit = watched.unwrap();
        let unwatched = fit_joint(&campaigns, &options).unwrap();
        assert_eq!(format!("{fit:?}"), format!("{unwatched:?}"));
        assert_eq!(done.into_inner(), all.into_inner());
        let places =
            stops_anywhere(|progress| fit_joint_watched(&campaigns, &options, progress).err());
        assert!(places > 20, "{places}");
        let leftovers = LeftoverOptions::default();
        let places = stops_anywhere(|progress| {
            let found = fit.leftovers_watched(&campaigns, &leftovers, progress);
            found.err()
        });
        assert!(places > 40, "{places}");
    }

    #[test]
    fn an_update_is_watched_and_stops_wherever_it_is() {
        let (field, options) = field();
        let fit = fit_joint(&field.first(10), &options).unwrap();
        let ids: Vec<String> = (0..40).map(|k| format!("H{k}")).collect();
        let state = fit.follow(&ids).unwrap();
        let all = field.first(14);
        let later: Vec<_> = all
            .iter()
            .map(|campaign| crate::Campaign {
                observations: &campaign.observations[10..],
                ..*campaign
            })
            .enumerate()
            .collect();
        let (mut watched, mut unwatched) = (state.clone(), state.clone());
        let done = AtomicU64::new(0);
        let steps = watched.update_watched(&later, &|more, of| {
            done.fetch_add(more, Ordering::Relaxed);
            of == 40
        });
        assert_eq!(steps.unwrap(), unwatched.update(&later).unwrap());
        assert_eq!(watched, unwatched);
        assert_eq!(done.into_inner(), 40);
        let places =
            stops_anywhere(|progress| state.clone().update_watched(&later, progress).err());
        assert!(places > 40, "{places}");
    }
}
