//! Targets that a followed field has not seen before: what is stated of beams on them, held against the truth.

#![allow(clippy::unwrap_used, reason = "tests fail")]
#![allow(clippy::print_stdout, reason = "numbers behind the verdicts")]

mod common;

use common::Rng;
use helio_calib::joint::simulate::{FieldCauses, FieldOptions, SimulatedField, simulate_field};
use helio_calib::joint::{
    Cause, FieldState, Foretold, JointOptions, Noise, SpotCause, StepKind, Wander, fit_joint,
};
use helio_calib::{Campaign, Observation};

/// 95 % of chi-squared with two degrees of freedom lie below.
const SQUARE_95: f64 = 5.991;
/// The target that comes later.
const NEW: usize = 2;
const HELIOSTATS: usize = 16;
const RECORDS: usize = 30;
/// Of the day after; so many of those on the new target are taken in before the rest are foretold.
const NEXT_DAY: usize = 12;
const TAKEN: usize = 2;
/// Of each component of a target's shift, as the list of causes expects them \[m\].
const SHIFT_M: f64 = 0.03;

fn ids() -> Vec<String> {
    (0..HELIOSTATS).map(|k| format!("S{k}")).collect()
}

/// A field of three targets, each of them off by a shift of its own.
fn field(seed: u64) -> (FieldOptions, SimulatedField) {
    let mut random = Rng::new(seed);
    let options = FieldOptions {
        heliostats: HELIOSTATS,
        records: RECORDS,
        next_day_records: NEXT_DAY,
        // so near and so quiet that three centimetres are much
        distance_m: [30.0, 60.0],
        noise: Noise {
            beam_mrad: 0.2,
            spot_m: 0.01,
            sun_path_s: 2.0,
        },
        wander: Wander {
            slow_mrad: [0.15, 0.15],
            slow_days: 60.0,
            fast_mrad: [0.1, 0.1],
            fast_days: 0.3,
        },
        causes: FieldCauses {
            target_shift_m: (0..3)
                .map(|_| [random.normal(), random.normal()].map(|z| SHIFT_M * z))
                .collect(),
            ..FieldCauses::default()
        },
        ..FieldOptions::new(seed).unwrap()
    };
    let field = simulate_field(&options).unwrap();
    (options, field)
}

/// Its state after all records but those of the next day and those on the new target.
fn begun(options: &FieldOptions, field: &SimulatedField) -> FieldState {
    let known: Vec<Vec<Observation>> = field
        .heliostats
        .iter()
        .map(|h| {
            let first = h.observations[..RECORDS].iter();
            first.filter(|o| o.target != NEW).copied().collect()
        })
        .collect();
    let campaigns: Vec<Campaign<'_>> = field
        .heliostats
        .iter()
        .zip(&known)
        .map(|(h, observations)| Campaign {
            mount: h.mount,
            observations,
        })
        .collect();
    let how = JointOptions::new(options.site.latitude_rad());
    let fit = fit_joint(&campaigns, &how).unwrap();
    fit.follow(&ids()).unwrap()
}

/// Records of the next day on the new target.
fn on_new(field: &SimulatedField) -> Vec<Vec<Observation>> {
    field
        .heliostats
        .iter()
        .map(|h| {
            let later = h.observations[RECORDS..].iter();
            later.filter(|o| o.target == NEW).copied().collect()
        })
        .collect()
}

#[derive(Default)]
struct Foretellings {
    squares: Vec<f64>,
}

impl Foretellings {
    fn add(&mut self, foretold: &[Foretold]) {
        self.squares.extend(foretold.iter().map(Foretold::square));
    }

    fn covered(&self) -> f64 {
        let inside = self.squares.iter().filter(|x| **x < SQUARE_95).count();
        inside as f64 / self.squares.len() as f64
    }

    fn report(&self, what: &str) {
        let mean = self.squares.iter().sum::<f64>() / self.squares.len() as f64;
        println!(
            "{what}: {:.1} % of {} covered, mean square {mean:.2}",
            100.0 * self.covered(),
            self.squares.len()
        );
    }
}

/// All records of a field on one target share its shift, so that fields are what is counted: many small ones.
#[test]
fn beams_on_a_target_new_to_the_state_are_stated_as_well_as_they_are_known() {
    let mut without = Foretellings::default();
    let mut with = Foretellings::default();
    let mut learnt = Foretellings::default();
    let mut scores = Vec::new();
    let (mut unbelieved, mut alarms, mut taken) = (0, 0, 0);
    for seed in 1..=300 {
        let (options, field) = field(seed);
        let mut state = begun(&options, &field);
        let new = on_new(&field);
        let foretell = |state: &FieldState, from: usize, into: &mut Foretellings| {
            for (place, (h, observations)) in field.heliostats.iter().zip(&new).enumerate() {
                let campaign = Campaign {
                    mount: h.mount,
                    observations: &observations[from.min(observations.len())..],
                };
                into.add(&state.foretell(place, &campaign).unwrap());
            }
        };
        foretell(&state, 0, &mut without);
        state.add_target(NEW);
        foretell(&state, 0, &mut with);
        let first: Vec<(usize, Campaign<'_>)> = field
            .heliostats
            .iter()
            .zip(&new)
            .map(|(h, observations)| Campaign {
                mount: h.mount,
                observations: &observations[..TAKEN.min(observations.len())],
            })
            .enumerate()
            .collect();
        for step in state.update(&first).unwrap().into_iter().flatten() {
            taken += 1;
            unbelieved += usize::from(step.kind != StepKind::Believed);
            alarms += usize::from(step.alarm);
        }
        foretell(&state, TAKEN, &mut learnt);
        for cause in state.causes() {
            let k = match cause.cause {
                Cause::Target(SpotCause::TargetRight, NEW) => 0,
                Cause::Target(SpotCause::TargetDown, NEW) => 1,
                _ => continue,
            };
            let truth = options.causes.target_shift_m[NEW][k];
            scores.push((cause.value - truth) / cause.sigma);
        }
    }
    without.report("taken to be where it was surveyed");
    with.report("as unknown as targets are");
    learnt.report("after its first records");
    let rms = (scores.iter().map(|z| z * z).sum::<f64>() / scores.len() as f64).sqrt();
    println!("{} shifts found: z rms {rms:.2}", scores.len());
    println!("of {taken} first records {unbelieved} not believed, {alarms} alarms");
    assert!(without.covered() < 0.9, "{}", without.covered());
    for stated in [with, learnt] {
        let covered = stated.covered();
        assert!((0.93..0.97).contains(&covered), "{covered}");
    }
    assert_eq!(scores.len(), 600);
    assert!((0.85..1.15).contains(&rms), "{rms}");
    // nothing went wrong in any of them
    assert!(50 * unbelieved < taken, "{unbelieved} of {taken}");
}

#[test]
fn a_state_with_a_target_that_came_later_is_the_same_from_its_parts() {
    let (options, field) = field(7);
    let mut state = begun(&options, &field);
    let before = state.causes().len();
    state.add_target(NEW);
    assert_eq!(state.causes().len(), before + 2);
    let again = FieldState::from_parts(state.parts()).unwrap();
    assert!(again == state);
    // once is enough, and an update needs none
    state.add_target(NEW);
    assert!(again == state);
    let new = on_new(&field);
    let campaigns: Vec<(usize, Campaign<'_>)> = field
        .heliostats
        .iter()
        .zip(&new)
        .map(|(h, observations)| Campaign {
            mount: h.mount,
            observations,
        })
        .enumerate()
        .collect();
    let mut by_itself = begun(&options, &field);
    by_itself.update(&campaigns).unwrap();
    state.update(&campaigns).unwrap();
    assert!(by_itself == state);
    let again = FieldState::from_parts(state.parts()).unwrap();
    assert!(again.parts() == state.parts());
}
