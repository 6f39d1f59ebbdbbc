//! Limits, turns, and the way the axes travel, against enumeration.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::f64::consts::{PI, TAU};

use helio_core::{
    AxisLimits, EnuUnit, Heliostat, OffsetForm, Present, Status, TrackOptions, Tracker, Tracking,
};
use helio_tests::cases::{self, Kind, MODES};
use helio_tests::{Rng, V3, circle_difference_rad, mount, normal};
use rayon::prelude::*;

/// What counts as inside a limit \[rad\].
const TOLERANCE_RAD: f64 = 1e-12;
/// How well the enumeration knows an angle \[rad\]; choices closer than this are left open.
const KNOWN_RAD: f64 = 1e-9;
/// Turns tried, on either side.
const TURNS: i32 = 5;

/// One solution with one choice of turns.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    over: bool,
    axes: [f64; 2],
}

/// Both solutions, all turns, whether or not within limits. `None` where the angles are ill-determined.
fn candidates(mode: helio_core::TrackingMode, h: &Heliostat, s: V3) -> Option<Vec<Candidate>> {
    let truth = normal::exact(h.pivot.into(), h.aim.into(), h.mirror_offset_m, s)?;
    if mount::cone_margin(mode, truth.t, &h.errors, truth.n) < 1e-3
        || truth.cos_theta.value() < 0.02
    {
        return None;
    }
    let both = mount::inverse_with(mode, truth.t, &h.errors, h.pose_errors, truth.n)?;
    let mut all = Vec::new();
    for (over, solution) in [false, true].into_iter().zip(both) {
        // near nothing in particular; limits of the tests lie within three turns
        let base = solution.map(|angle| circle_difference_rad(angle, 0.0));
        for turn1 in -TURNS..=TURNS {
            for turn2 in -TURNS..=TURNS {
                let axes = [
                    base[0] + TAU * f64::from(turn1),
                    base[1] + TAU * f64::from(turn2),
                ];
                all.push(Candidate { over, axes });
            }
        }
    }
    Some(all)
}

fn ranges(l: &AxisLimits) -> [(f64, f64); 2] {
    [
        (l.axis1_min_rad, l.axis1_max_rad),
        (l.axis2_min_rad, l.axis2_max_rad),
    ]
}

fn fits(c: &Candidate, l: &AxisLimits, slack: f64) -> bool {
    c.axes
        .iter()
        .zip(ranges(l))
        .all(|(angle, (min, max))| *angle >= min - slack && *angle <= max + slack)
}

fn travel(c: &Candidate, present: [f64; 2]) -> f64 {
    (c.axes[0] - present[0])
        .abs()
        .max((c.axes[1] - present[1]).abs())
}

fn same(c: &Candidate, axes: [f64; 2]) -> bool {
    (c.axes[0] - axes[0]).abs() < KNOWN_RAD && (c.axes[1] - axes[1]).abs() < KNOWN_RAD
}

/// A verdict on one answer; `Ok(false)` where the enumeration cannot tell.
type Judged = Result<bool, String>;

/// Without a present position: the direct solution where it fits, else the other; each axis nearest to
/// the middle of its limits.
fn judge_stateless(all: &[Candidate], h: &Heliostat, status: Status, axes: [f64; 2]) -> Judged {
    let l = &h.limits;
    let inside = |over: bool, slack: f64| all.iter().any(|c| c.over == over && fits(c, l, slack));
    // a solution that fits by less than is known
    if [false, true]
        .into_iter()
        .any(|over| inside(over, KNOWN_RAD) != inside(over, -KNOWN_RAD))
    {
        return Ok(false);
    }
    let (direct, over) = (inside(false, TOLERANCE_RAD), inside(true, TOLERANCE_RAD));
    if !direct && !over {
        return if status == Status::OutsideLimits {
            Ok(true)
        } else {
            Err(format!("{status} where nothing fits"))
        };
    }
    if status != Status::Ok {
        return Err(format!("{status} where direct {direct}, over {over}"));
    }
    let want_over = !direct;
    let Some(found) = all.iter().find(|c| same(c, axes)) else {
        return Err(format!("{axes:?} is no solution"));
    };
    if found.over != want_over && !all.iter().any(|c| c.over == want_over && same(c, axes)) {
        return Err(format!("over the top {}, wanted {want_over}", found.over));
    }
    for (axis, (min, max)) in ranges(l).into_iter().enumerate() {
        let angle = axes[axis];
        let reference = [
            h.errors.azimuth_reference_rad,
            h.errors.elevation_reference_rad,
        ][axis];
        let good = match (min.is_finite(), max.is_finite()) {
            // nearest to the middle: no more than half a turn from it
            (true, true) => (angle - 0.5 * (min + max)).abs() <= PI + KNOWN_RAD,
            (false, false) if axis == 0 => (0.0..TAU).contains(&angle),
            // not wrapped: 90° either way of level, or over the top to 270°
            (false, false) => (angle - reference - 0.5 * PI).abs() <= PI + KNOWN_RAD,
            // in the first turn from the limit, or in the turn of an unlimited axis if that is within
            (one_min, _) => {
                let home = if axis == 0 { 0.0 } else { reference - PI };
                let start = if one_min {
                    home.max(min)
                } else {
                    home.min(max - TAU)
                };
                angle >= start - KNOWN_RAD && angle < start + TAU + KNOWN_RAD
            }
        };
        if !good {
            return Err(format!(
                "axis {} at {angle}, limits {min} to {max}",
                axis + 1
            ));
        }
    }
    Ok(true)
}

/// With a present position: of all that fit, the one for which the axis that travels farther has the
/// shortest way; and the other axis no detour either.
fn judge_travel(
    all: &[Candidate],
    h: &Heliostat,
    status: Status,
    axes: [f64; 2],
    present: [f64; 2],
) -> Judged {
    let l = &h.limits;
    let allowed = |c: &&Candidate| !(l.is_none() && c.over);
    let best = |slack: f64| {
        all.iter()
            .filter(allowed)
            .filter(|c| fits(c, l, slack))
            .map(|c| travel(c, present))
            .fold(f64::INFINITY, f64::min)
    };
    let least = best(TOLERANCE_RAD);
    let sure = best(-KNOWN_RAD);
    if best(KNOWN_RAD).is_finite() != sure.is_finite()
        || (sure.is_finite() && (best(KNOWN_RAD) - sure).abs() > KNOWN_RAD)
    {
        return Ok(false);
    }
    if least.is_infinite() {
        return if status == Status::OutsideLimits {
            Ok(true)
        } else {
            Err(format!("{status} where nothing fits"))
        };
    }
    if status != Status::Ok {
        return Err(format!("{status} where a way of {least} is open"));
    }
    let Some(found) = all.iter().filter(allowed).find(|c| same(c, axes)) else {
        return Err(format!("{axes:?} is no allowed solution"));
    };
    if !fits(found, l, KNOWN_RAD) {
        return Err(format!("{axes:?} is outside its limits"));
    }
    let way = travel(found, present);
    if way > least + KNOWN_RAD {
        return Err(format!("travels {way} where {least} would do"));
    }
    // neither axis makes a detour by whole turns
    for axis in 0..2 {
        let least = all
            .iter()
            .filter(|c| c.over == found.over && fits(c, l, TOLERANCE_RAD))
            .map(|c| (c.axes[axis] - present[axis]).abs())
            .fold(f64::INFINITY, f64::min);
        let way = (axes[axis] - present[axis]).abs();
        if way > least + KNOWN_RAD {
            return Err(format!(
                "axis {} travels {way} where {least} would do",
                axis + 1
            ));
        }
    }
    Ok(true)
}

#[derive(Default, Debug)]
struct Tally {
    judged: usize,
    open: usize,
    ok: usize,
    over: usize,
    outside: usize,
    wrong: Vec<String>,
}

impl Tally {
    fn take(&mut self, judged: Judged, status: Status, place: impl FnOnce() -> String) {
        match judged {
            Ok(true) => self.judged += 1,
            Ok(false) => self.open += 1,
            Err(fault) => {
                self.judged += 1;
                if self.wrong.len() < 4 {
                    self.wrong.push(format!("{fault}: {}", place()));
                }
            }
        }
        self.ok += usize::from(status == Status::Ok);
        self.outside += usize::from(status == Status::OutsideLimits);
    }

    fn merge(mut self, o: Self) -> Self {
        self.judged += o.judged;
        self.open += o.open;
        self.ok += o.ok;
        self.over += o.over;
        self.outside += o.outside;
        self.wrong.extend(o.wrong);
        self
    }

    fn check(&self, title: &str, least: usize) {
        let Self {
            judged,
            open,
            ok,
            over,
            outside,
            ..
        } = self;
        eprintln!(
            "{title}: {judged} judged ({ok} ok, {over} over the top, {outside} outside limits), {open} left open"
        );
        assert!(self.wrong.is_empty(), "{:#?}", self.wrong);
        assert!(*judged >= least && open * 200 < *judged);
    }
}

fn field_of(rng: &mut Rng, mode: helio_core::TrackingMode, s: V3, count: usize) -> Vec<Heliostat> {
    (0..count)
        .map(|row| {
            let mut h = cases::heliostat(rng, Kind::Anywhere, mode, s);
            h.limits = match row % 10 {
                0 => AxisLimits::NONE,
                1 => AxisLimits {
                    axis1_min_rad: -0.5 * PI,
                    axis1_max_rad: 2.5 * PI,
                    axis2_min_rad: -0.2,
                    axis2_max_rad: PI + 0.2,
                },
                _ => cases::random_limits(rng),
            };
            h
        })
        .collect()
}

fn is_over(h: &Heliostat, axis2_rad: f64) -> bool {
    (axis2_rad - h.errors.elevation_reference_rad).cos() < 0.0
}

#[test]
fn limits_and_turns_against_enumeration() {
    let tally = (0..60_usize)
        .into_par_iter()
        .map(|batch| {
            let mut rng = Rng::new(600 + batch as u64);
            let mode = cases::mode(batch % MODES, rng.range(0.0, 1.5));
            let sun = cases::sun(&mut rng);
            let mut heliostats = field_of(&mut rng, mode, sun.into(), 2_000);
            if batch % 2 == 1 {
                cases::pose_errors(&mut Rng::new(650 + batch as u64), &mut heliostats);
            }
            let field = cases::field(mode, &heliostats);
            let tracker = Tracker::new(&field, OffsetForm::Exact).unwrap();
            let stateless = tracker.track(sun);
            // some know where both axes are, some one, some none
            let mut column = || -> Vec<f64> {
                heliostats
                    .iter()
                    .map(|_| {
                        if rng.chance(0.05) {
                            f64::NAN
                        } else {
                            rng.within(3.0 * TAU)
                        }
                    })
                    .collect()
            };
            let (axis1, axis2) = (column(), column());
            let present = Present {
                axis1_rad: &axis1,
                axis2_rad: &axis2,
            };
            let mut moved = Tracking::default();
            tracker
                .track_into(&[sun], Some(present), &TrackOptions::default(), &mut moved)
                .unwrap();
            let (mut first, mut second) = (Tally::default(), Tally::default());
            for (row, h) in heliostats.iter().enumerate() {
                let Some(all) = candidates(mode, h, sun.into()) else {
                    continue;
                };
                let axes = [stateless.axis1_rad()[row], stateless.axis2_rad()[row]];
                let status = stateless.status()[row];
                first.over += usize::from(status == Status::Ok && is_over(h, axes[1]));
                first.take(judge_stateless(&all, h, status, axes), status, || {
                    format!("{mode:?} {h:?}")
                });
                let here = [axis1[row], axis2[row]];
                let axes = [moved.axis1_rad()[row], moved.axis2_rad()[row]];
                let status = moved.status()[row];
                let place = || format!("from {here:?}, {mode:?} {h:?}");
                second.over += usize::from(status == Status::Ok && is_over(h, axes[1]));
                if here[0].is_nan() && here[1].is_nan() {
                    second.take(judge_stateless(&all, h, status, axes), status, place);
                } else if here[0].is_nan() || here[1].is_nan() {
                    // half known: any answer within the limits
                    let fine = status != Status::Ok
                        || all
                            .iter()
                            .any(|c| same(c, axes) && fits(c, &h.limits, KNOWN_RAD));
                    second.take(
                        if fine {
                            Ok(true)
                        } else {
                            Err(format!("{axes:?}"))
                        },
                        status,
                        place,
                    );
                } else {
                    second.take(judge_travel(&all, h, status, axes, here), status, place);
                }
                // the same rows are answerable either way
                assert_eq!(status, stateless.status()[row]);
            }
            (first, second)
        })
        .reduce(Default::default, |a, b| (a.0.merge(b.0), a.1.merge(b.1)));
    tally.0.check("without present", 100_000);
    tally.1.check("with present", 100_000);
}

/// A day in steps of two minutes: every step is the shortest there is from the one before, and a night
/// or a blind cone leaves the axes where they were.
#[test]
fn a_day_has_no_jump_that_is_not_needed() {
    let mut tally = Tally::default();
    for number in 0..MODES {
        let mut rng = Rng::new(700 + number as u64);
        let mode = cases::mode(number, 0.7);
        // an equinox-like arc over a site at 35°, from before sunrise to after sunset
        let suns: Vec<EnuUnit> = (-10..370)
            .map(|step| {
                let hour_angle = PI * (f64::from(step) / 360.0 - 0.5);
                let (sin, cos) = hour_angle.sin_cos();
                let (sin_dec, cos_dec) = 0.1_f64.sin_cos();
                let (sin_lat, cos_lat) = 35_f64.to_radians().sin_cos();
                let v = V3(
                    cos_dec * sin,
                    sin_dec * cos_lat - cos_dec * cos * sin_lat,
                    sin_dec * sin_lat + cos_dec * cos * cos_lat,
                );
                EnuUnit::try_new(v.enu()).unwrap()
            })
            .collect();
        assert!(V3::from(suns[0]).2 < 0.0 && V3::from(suns[379]).2 < 0.0);
        let noon = V3::from(suns[190]);
        let heliostats = field_of(&mut rng, mode, noon, 60);
        let tracker = Tracker::new(&cases::field(mode, &heliostats), OffsetForm::Exact).unwrap();
        let mut out = Tracking::default();
        let start: [Vec<f64>; 2] =
            [0, 1].map(|_| heliostats.iter().map(|_| rng.within(TAU)).collect());
        let present = Present {
            axis1_rad: &start[0],
            axis2_rad: &start[1],
        };
        tracker
            .track_into(&suns, Some(present), &TrackOptions::default(), &mut out)
            .unwrap();
        for (row, h) in heliostats.iter().enumerate() {
            let mut here = [start[0][row], start[1][row]];
            for (index, sun) in suns.iter().enumerate() {
                let at = index * heliostats.len() + row;
                let status = out.status()[at];
                let s = V3::from(*sun);
                if s.2 < 0.0 {
                    assert_eq!(status, Status::SunBelowHorizon);
                    continue;
                }
                let axes = [out.axis1_rad()[at], out.axis2_rad()[at]];
                if let Some(all) = candidates(mode, h, s)
                    && !matches!(status, Status::Unreachable | Status::SunOpposesAim)
                {
                    let judged = judge_travel(&all, h, status, axes, here);
                    tally.take(judged, status, || {
                        format!("{index} from {here:?} {mode:?} {h:?}")
                    });
                }
                if status == Status::Ok {
                    tally.over += usize::from(is_over(h, axes[1]));
                    here = axes;
                }
            }
        }
    }
    tally.check("day", 80_000);
}

/// Worked cases that can be checked by eye.
#[test]
fn worked_cases() {
    let up60 = |azimuth_deg: f64| {
        // sun and aim together at 60° of elevation: the normal points there
        EnuUnit::from_azimuth_elevation(azimuth_deg.to_radians(), 60_f64.to_radians())
    };
    let rad = |deg: f64| deg.to_radians();
    let limits = |a: f64, b: f64, c: f64, d: f64| AxisLimits {
        axis1_min_rad: rad(a),
        axis1_max_rad: rad(b),
        axis2_min_rad: rad(c),
        axis2_max_rad: rad(d),
    };
    let track = |azimuth_deg: f64, limits: AxisLimits, present: Option<[f64; 2]>| {
        let sun = up60(azimuth_deg);
        let aim = V3::from(sun) * 100.0;
        let mut h = Heliostat::new(V3(0.0, 0.0, 0.0).enu(), aim.enu());
        h.limits = limits;
        let field = cases::field(helio_core::TrackingMode::AzimuthElevation, &[h]);
        let tracker = Tracker::new(&field, OffsetForm::Exact).unwrap();
        let here = present.map(|p| p.map(rad));
        let mut out = Tracking::default();
        let column = here.map(|p| ([p[0]], [p[1]]));
        let present = column.as_ref().map(|(a, b)| Present {
            axis1_rad: a,
            axis2_rad: b,
        });
        tracker
            .track_into(&[sun], present, &TrackOptions::default(), &mut out)
            .unwrap();
        let round = |x: f64| (x.to_degrees() * 1e9).round() / 1e9;
        (
            out.status()[0],
            round(out.axis1_rad()[0]),
            round(out.axis2_rad()[0]),
            round(out.limit_excess_rad()[0]),
        )
    };
    let none = AxisLimits::NONE;
    assert_eq!(track(350.0, none, None), (Status::Ok, 350.0, 60.0, 0.0));
    // nearest to the present, without limits: the direct solution, on by the turn
    assert_eq!(
        track(350.0, none, Some([10.0, 60.0])),
        (Status::Ok, -10.0, 60.0, 0.0)
    );
    assert_eq!(
        track(350.0, none, Some([725.0, 60.0])),
        (Status::Ok, 710.0, 60.0, 0.0)
    );
    assert_eq!(
        track(350.0, none, Some([165.0, 120.0])),
        (Status::Ok, -10.0, 60.0, 0.0)
    );
    // the middle of the limits
    let half = limits(-180.0, 180.0, 0.0, 90.0);
    assert_eq!(track(350.0, half, None), (Status::Ok, -10.0, 60.0, 0.0));
    let two_turns = limits(-360.0, 360.0, 0.0, 90.0);
    assert_eq!(
        track(350.0, two_turns, None),
        (Status::Ok, -10.0, 60.0, 0.0)
    );
    assert_eq!(
        track(350.0, two_turns, Some([300.0, 50.0])),
        (Status::Ok, 350.0, 60.0, 0.0)
    );
    let third_turn = limits(720.0, 1080.0, 0.0, 90.0);
    assert_eq!(
        track(350.0, third_turn, None),
        (Status::Ok, 1070.0, 60.0, 0.0)
    );
    // over the top where the first axis does not reach
    let narrow = limits(90.0, 270.0, 0.0, 180.0);
    assert_eq!(track(350.0, narrow, None), (Status::Ok, 170.0, 120.0, 0.0));
    // both reach: direct, unless the other is nearer
    let both = limits(-400.0, 400.0, 0.0, 180.0);
    assert_eq!(track(350.0, both, None), (Status::Ok, -10.0, 60.0, 0.0));
    assert_eq!(
        track(350.0, both, Some([170.0, 100.0])),
        (Status::Ok, 170.0, 120.0, 0.0)
    );
    assert_eq!(
        track(350.0, both, Some([-100.0, 90.0])),
        (Status::Ok, -10.0, 60.0, 0.0)
    );
    // outside: by the better solution's worse axis
    let far = limits(20.0, 100.0, 0.0, 90.0);
    assert_eq!(track(350.0, far, None).0, Status::OutsideLimits);
    assert_eq!(track(350.0, far, None).3, 30.0);
    let low = limits(-180.0, 180.0, 0.0, 45.0);
    assert_eq!(track(350.0, low, None).3, 15.0);
    // the very ends are inside
    let end = limits(350.0, 360.0, 60.0, 60.0);
    assert_eq!(track(350.0, end, None), (Status::Ok, 350.0, 60.0, 0.0));
    // a present outside the limits is where it is; the answer is not
    assert_eq!(
        track(350.0, half, Some([1000.0, 60.0])),
        (Status::Ok, -10.0, 60.0, 0.0)
    );
    // not known at all, and half known
    assert_eq!(
        track(350.0, two_turns, Some([f64::NAN, f64::NAN])),
        (Status::Ok, -10.0, 60.0, 0.0)
    );
}

/// What a present must be.
#[test]
fn a_present_of_the_wrong_length_is_refused() {
    let h = Heliostat::new(V3(0.0, 0.0, 0.0).enu(), V3(0.0, 50.0, 50.0).enu());
    let field = cases::field(helio_core::TrackingMode::AzimuthElevation, &[h, h]);
    let tracker = Tracker::new(&field, OffsetForm::Exact).unwrap();
    let mut out = Tracking::default();
    let present = Present {
        axis1_rad: &[0.0],
        axis2_rad: &[0.0, 0.0],
    };
    let options = TrackOptions::default();
    let error = tracker
        .track_into(&[EnuUnit::UP], Some(present), &options, &mut out)
        .unwrap_err();
    assert!(error.to_string().contains("expected 2 rows"), "{error}");
    assert!(Tracker::new(&field, OffsetForm::Iterated(0)).is_err());
    assert!(Tracker::new(&field, OffsetForm::Iterated(1_000)).is_err());
}

/// A present that is no angle is refused or taken as not known; it never becomes an answer.
#[test]
fn a_wild_present_never_becomes_an_answer() {
    let h = Heliostat::new(V3(0.0, 0.0, 0.0).enu(), V3(0.0, 50.0, 50.0).enu());
    let field = cases::field(helio_core::TrackingMode::AzimuthElevation, &[h, h]);
    let tracker = Tracker::new(&field, OffsetForm::Exact).unwrap();
    let mut out = Tracking::default();
    let options = TrackOptions::default();
    for wild in [f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e17] {
        let present = Present {
            axis1_rad: &[wild, 0.0],
            axis2_rad: &[0.0, wild],
        };
        if tracker
            .track_into(&[EnuUnit::UP], Some(present), &options, &mut out)
            .is_ok()
        {
            for row in 0..2 {
                let axes = [out.axis1_rad()[row], out.axis2_rad()[row]];
                let sane = axes.iter().all(|a| a.abs() < 1e5);
                assert!(
                    out.status()[row] != Status::Ok || sane,
                    "{wild:e}: {axes:?}"
                );
            }
        }
    }
}
