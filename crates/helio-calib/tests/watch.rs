//! What does not fit is said, and believed neither of a heliostat nor of the field: records of something else, and
//! a clock that everybody has.

#![allow(clippy::unwrap_used, reason = "tests fail")]
#![allow(clippy::print_stdout, reason = "numbers behind the verdicts")]

use std::f64::consts::TAU;

use helio_calib::joint::simulate::{FieldOptions, SimulatedField, simulate_field};
use helio_calib::joint::{
    FieldState, History, JointFit, JointOptions, NO_TARGET, Step, fit_joint, too_late,
};
use helio_calib::{Campaign, Observation};
use helio_core::{Enu, EnuUnit};

/// Splitmix: any numbers will do.
struct Any(u64);

impl Any {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A spot of another heliostat: anywhere on the board.
fn garbage(observation: &mut Observation, any: &mut Any) {
    observation.u_m = 6.0 * any.unit() - 3.0;
    observation.v_m = 6.0 * any.unit() - 3.0;
}

/// The sun of a clock that is some seconds ahead.
fn late_clock(observation: &mut Observation, latitude_rad: f64, seconds: f64) {
    let pole = Enu::new(0.0, latitude_rad.cos(), latitude_rad.sin());
    let (sine, cosine) = (-TAU * seconds / 86_164.0).sin_cos();
    let sun = observation.sun.as_enu();
    // Rodrigues
    let turned = sun * cosine + pole.cross(sun) * sine + pole * (pole.dot(sun) * (1.0 - cosine));
    observation.sun = EnuUnit::try_new(turned).unwrap();
}

fn base(seed: u64) -> FieldOptions {
    FieldOptions {
        heliostats: 24,
        records: 60,
        ..FieldOptions::new(seed).unwrap()
    }
}

fn ids(field: &SimulatedField) -> Vec<String> {
    (0..field.heliostats.len()).map(|k| k.to_string()).collect()
}

fn begun(field: &SimulatedField, how: &JointOptions, records: usize) -> (JointFit, FieldState) {
    let fit = fit_joint(&field.first(records), how).unwrap();
    let state = fit.follow(&ids(field)).unwrap();
    (fit, state)
}

/// The records of some day and later of all heliostats, in calls of so many days.
fn followed(
    state: &mut FieldState,
    field: &SimulatedField,
    from: usize,
    days_at_once: Option<f64>,
) -> Vec<Step> {
    let day = |o: &Observation| o.unix_ns.unwrap() as f64 / 86_400e9;
    let later = |k: usize| &field.heliostats[k].observations[from..];
    let all: Vec<usize> = (0..field.heliostats.len()).collect();
    let days = || all.iter().flat_map(|&k| later(k).iter().map(day));
    let (first, last) = (
        days().fold(f64::MAX, f64::min).floor(),
        days().fold(f64::MIN, f64::max),
    );
    let wide = days_at_once.unwrap_or(1e6);
    let mut steps = Vec::new();
    let mut begin = first;
    while begin <= last {
        let now: Vec<Vec<Observation>> = all
            .iter()
            .map(|&k| {
                let of = later(k).iter().copied();
                of.filter(|o| (begin..begin + wide).contains(&day(o)))
                    .collect()
            })
            .collect();
        let campaigns: Vec<(usize, Campaign<'_>)> = all
            .iter()
            .filter(|&&k| !now[k].is_empty())
            .map(|&k| {
                let mount = field.heliostats[k].mount;
                let observations = &now[k];
                (
                    k,
                    Campaign {
                        mount,
                        observations,
                    },
                )
            })
            .collect();
        steps.extend(state.update(&campaigns).unwrap().concat());
        begin += wide;
    }
    steps
}

/// Takes in one record after the other of one heliostat; after each whether it is unexplained.
fn one_by_one(
    state: &mut FieldState,
    field: &SimulatedField,
    k: usize,
    records: &[Observation],
) -> Vec<(bool, Step)> {
    let mount = field.heliostats[k].mount;
    let each = records.chunks(1).map(|observations| {
        let campaign = Campaign {
            mount,
            observations,
        };
        let steps = state.update(&[(k, campaign)]).unwrap();
        (state.heliostats()[k].unexplained(), steps[0][0])
    });
    each.collect()
}

/// However long and good its history was, and never three of them in a row; and it is believed again once its records
/// have been good for some twenty, whatever was before.
#[test]
fn garbage_is_seen_after_any_history_and_forgotten_after_good_records() {
    for history in [20, 140] {
        let options = FieldOptions {
            heliostats: 12,
            records: history + 90,
            days: 720,
            ..base(3)
        };
        let mut field = simulate_field(&options).unwrap();
        let how = JointOptions::new(options.site.latitude_rad());
        let mut any = Any(9);
        for heliostat in field.heliostats.iter_mut().step_by(2) {
            let records = heliostat.observations[history..history + 24].iter_mut();
            for (n, o) in records.enumerate() {
                if n % 5 < 2 || n % 5 == 3 {
                    garbage(o, &mut any);
                }
            }
        }
        let (_, state) = begun(&field, &how, history);
        for k in 0..field.heliostats.len() {
            let mut state = state.clone();
            let records = &field.heliostats[k].observations[history..];
            let seen = one_by_one(&mut state, &field, k, records);
            let odd: Vec<usize> = (0..seen.len()).filter(|&n| seen[n].0).collect();
            println!("history {history}, heliostat {k}: unexplained after {odd:?}");
            if k % 2 == 1 {
                assert!(odd.is_empty());
                continue;
            }
            let (&first, &last) = (odd.first().unwrap(), odd.last().unwrap());
            assert!(first < 16, "seen after {first}");
            assert!((12..=24).all(|n| n < first || seen[n].0), "{odd:?}");
            assert!((26..60).contains(&last), "forgotten after {last}");
        }
    }
}

/// The third in a row that is not believed, and no other, begins an alarm, and the heliostat is not believed from there.
#[test]
fn three_in_a_row_are_an_alarm() {
    let options = base(5);
    let mut field = simulate_field(&options).unwrap();
    let how = JointOptions::new(options.site.latitude_rad());
    let mut any = Any(2);
    for heliostat in &mut field.heliostats {
        for o in &mut heliostat.observations[41..44] {
            garbage(o, &mut any);
        }
    }
    let (_, state) = begun(&field, &how, 40);
    let mut at_third = 0;
    for k in 0..field.heliostats.len() {
        let mut state = state.clone();
        let records = &field.heliostats[k].observations[40..];
        let seen = one_by_one(&mut state, &field, k, records);
        let unbelieved: Vec<bool> = seen.iter().map(|(_, step)| step.unbelieved).collect();
        assert!(!unbelieved[..3].contains(&true), "{k}: {unbelieved:?}");
        assert!(seen[..3].iter().all(|(unexplained, _)| !unexplained), "{k}");
        assert_eq!(unbelieved[3], seen[3].0, "{k}");
        at_third += usize::from(unbelieved[3]);
        // a good one ends it
        assert!(!unbelieved[5..].contains(&true), "{k}: {unbelieved:?}");
    }
    println!("{at_third} of {}", field.heliostats.len());
    // others are taken for jumps
    assert!(at_third * 2 > field.heliostats.len(), "{at_third}");
}

/// Garbage of a heliostat that is followed moves nothing of what all have in common.
#[test]
fn garbage_says_nothing_of_the_field() {
    let options = FieldOptions {
        records: 200,
        days: 720,
        ..base(8)
    };
    let mut field = simulate_field(&options).unwrap();
    let how = JointOptions {
        least_log_evidence: f64::NEG_INFINITY,
        ..JointOptions::new(options.site.latitude_rad())
    };
    let (_, begun) = begun(&field, &how, 30);
    let mut any = Any(4);
    let mut far: f64 = 0.0;
    for k in 0..6 {
        for (n, o) in field.heliostats[k].observations[30..]
            .iter_mut()
            .enumerate()
        {
            // never very far
            if n % 4 > 0 {
                o.u_m += 2.0 * any.unit() - 1.0;
                o.v_m += 2.0 * any.unit() - 1.0;
            }
        }
        let mut state = begun.clone();
        let records = &field.heliostats[k].observations[30..];
        let odd = one_by_one(&mut state, &field, k, records);
        let unexplained = odd.iter().filter(|(unexplained, _)| *unexplained).count();
        println!("{unexplained} of {}", odd.len());
        assert!(unexplained > 120);
        for (before, after) in begun.causes().iter().zip(state.causes()) {
            let moved = (after.value - before.value) / before.sigma;
            far = far.max(moved.abs());
        }
    }
    println!("what is common moved by {far:.2} of its standard deviations");
    assert!(far < 0.5, "{far}");
}

fn look_back(fit: &JointFit, state: &mut FieldState, campaigns: &[Campaign<'_>]) {
    let histories: Vec<Vec<History>> = campaigns
        .iter()
        .enumerate()
        .map(|(k, campaign)| fit.history(k, campaign).unwrap())
        .collect();
    state.look_back(&histories);
}

/// A clock that goes wrong for everybody at once: while following, day by day or at once, and in a fit of all records.
#[test]
fn a_clock_that_everybody_has_is_a_spell_of_the_field() {
    for seconds in [60.0, 300.0, 600.0] {
        let options = base(11);
        let latitude = options.site.latitude_rad();
        let mut field = simulate_field(&options).unwrap();
        let mut days: Vec<i64> = field
            .heliostats
            .iter()
            .flat_map(|h| h.observations.iter().map(|o| o.unix_ns.unwrap()))
            .collect();
        days.sort_unstable();
        let from_ns = days[days.len() * 5 / 6];
        for o in field
            .heliostats
            .iter_mut()
            .flat_map(|h| &mut h.observations)
        {
            if o.unix_ns.unwrap() >= from_ns {
                late_clock(o, latitude, seconds);
            }
        }
        let from = (from_ns as f64 / 86_400e9).floor();
        let how = JointOptions::new(latitude);
        let (_, begun) = begun(&field, &how, 40);
        let mut by_day = begun.clone();
        let mut at_once = begun;
        followed(&mut by_day, &field, 40, Some(1.0));
        followed(&mut at_once, &field, 40, None);
        let campaigns = field.first(options.records);
        let fit = fit_joint(&campaigns, &how).unwrap();
        let mut batch = fit.follow(&ids(&field)).unwrap();
        look_back(&fit, &mut batch, &campaigns);
        for (what, state) in [("by day", &by_day), ("at once", &at_once), ("all", &batch)] {
            let spells = state.spells();
            println!("{seconds} s from {from}, {what}: {spells:.1?}");
            let first = spells.first().unwrap();
            assert!((first.days[0] - from).abs() < 10.0);
            for last in state.heliostats().iter().filter_map(|h| h.last_day) {
                let held = spells.iter().any(|spell| spell.holds(last));
                assert!(held || last < from, "{last}");
            }
        }
        let begins = |state: &FieldState| state.spells()[0].days[0];
        assert!((begins(&by_day) - begins(&at_once)).abs() <= 1.0);
        // what waits and what was judged survives the file
        let again = FieldState::from_parts(at_once.parts()).unwrap();
        assert_eq!(again.spells(), at_once.spells());
    }
}

/// Neither outliers and jumps, nor garbage of a quarter of the heliostats, are one: with the number of judgements.
#[test]
fn sound_fields_have_no_spells() {
    let (mut spells, mut heliostats, mut unexplained, mut records) = (0, 0, 0, 0);
    for seed in 1..=12 {
        let options = FieldOptions {
            records: 90,
            outlier_probability: 0.02,
            jump_probability: 0.005,
            ..base(100 + seed)
        };
        let mut field = simulate_field(&options).unwrap();
        let mut any = Any(seed);
        let bad = if seed % 3 == 0 { 6 } else { 0 };
        for heliostat in &mut field.heliostats[..bad] {
            for o in &mut heliostat.observations[60..] {
                garbage(o, &mut any);
            }
        }
        let how = JointOptions::new(options.site.latitude_rad());
        let (_, mut state) = begun(&field, &how, 30);
        followed(&mut state, &field, 30, Some(1.0));
        let campaigns = field.first(options.records);
        let fit = fit_joint(&campaigns, &how).unwrap();
        let mut batch = fit.follow(&ids(&field)).unwrap();
        look_back(&fit, &mut batch, &campaigns);
        spells += state.spells().len() + batch.spells().len();
        for state in [&state, &batch] {
            for (k, heliostat) in state.heliostats().iter().enumerate() {
                if k < bad {
                    assert!(heliostat.unexplained(), "seed {seed}, {k}");
                } else {
                    heliostats += 1;
                    unexplained += usize::from(heliostat.unexplained());
                }
            }
        }
        records += 2 * 24 * 90;
    }
    println!(
        "{spells} spells in {records} records; {unexplained} of {heliostats} sound heliostats are unexplained"
    );
    assert_eq!(spells, 0);
    assert!(unexplained * 100 <= heliostats, "{unexplained}");
}

/// Records whose beams cannot have met their targets are neither believed nor forgotten.
#[test]
fn records_that_miss_their_targets_are_counted() {
    let options = base(21);
    let mut field = simulate_field(&options).unwrap();
    // boards that face the other way
    for o in &mut field.heliostats[2].observations {
        let back = o.plane.normal.as_enu() * -1.0;
        o.plane.normal = EnuUnit::try_new(back).unwrap();
        o.target = NO_TARGET;
    }
    let how = JointOptions::new(options.site.latitude_rad());
    let (fit, mut state) = begun(&field, &how, 40);
    assert_eq!(fit.heliostats[2].misses.len(), 40);
    assert_eq!(fit.heliostats[3].misses.len(), 0);
    let all = |state: &FieldState, count: u64| {
        let heliostat = &state.heliostats()[2];
        assert_eq!((heliostat.misses, heliostat.believed()), (count, 0));
        assert!(heliostat.unexplained());
        assert!(!state.heliostats()[3].unexplained());
        assert!(state.heliostats()[3].believed() > count - 6);
    };
    all(&state, 40);
    followed(&mut state, &field, 40, None);
    all(&state, 60);
}

/// A record that is not believed does not shut out those that come after it.
#[test]
fn a_wrong_date_moves_no_clock() {
    let options = base(31);
    let mut field = simulate_field(&options).unwrap();
    let how = JointOptions::new(options.site.latitude_rad());
    let mut any = Any(1);
    let year = 365 * 86_400_000_000_000;
    let of = |field: &mut SimulatedField, at: usize, any: &mut Any| {
        let o = &mut field.heliostats[4].observations[at];
        o.unix_ns = o.unix_ns.map(|ns| ns + year);
        garbage(o, any);
    };
    of(&mut field, 20, &mut any);
    of(&mut field, 45, &mut any);
    let (fit, mut state) = begun(&field, &how, 40);
    let last = |to: usize| {
        let of = field.heliostats[4].observations[..to].iter();
        let days = of.map(|o| o.unix_ns.unwrap() as f64 / 86_400e9);
        let mut days: Vec<f64> = days.collect();
        days.sort_by(f64::total_cmp);
        days
    };
    assert!(!fit.heliostats[4].outliers.is_empty());
    let days = last(40);
    assert_eq!(state.heliostats()[4].last_day, Some(days[38]));
    followed(&mut state, &field, 40, None);
    let days = last(60);
    assert_eq!(state.heliostats()[4].last_day, Some(days[57]));
    let field_day = state.last_day().unwrap();
    assert!(field_day < days[58], "{field_day} {days:?}");
    // where it is believed, it is no more the last day of the field
    assert_eq!(too_late(&[10.0, 400.0, 12.0]), 42.0);
    assert_eq!(too_late(&[10.0, 400.0]), f64::INFINITY);
}
