//! Statuses against an independent classifier.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::f64::consts::TAU;

use helio_core::tracking::Prediction;
use helio_core::{
    EnuUnit, Heliostat, OffsetForm, Status, TargetPlane, TrackOptions, Tracker, TrackingMode,
};
use helio_tests::cases::{self, MODES};
use helio_tests::dd::{Dd, Dd3};
use helio_tests::{Rng, V3, mount, normal};
use rayon::prelude::*;

/// Distance from a boundary, in the quantity that decides, below which a row is left out: rounding
/// decides there.
const MARGIN: f64 = 1e-12;
/// What counts as inside a limit \[rad\].
const TOLERANCE_RAD: f64 = 1e-12;
/// Least cosine of incidence at the mirror.
const MIN_COS_INCIDENCE: f64 = 1e-6;

/// What the classifier says of a row.
struct Verdict {
    status: Status,
    /// The wanted normal, where there is one that is well determined.
    truth: Option<normal::Truth>,
    /// How far outside its limits the better solution is \[rad\], and to how much this is known.
    excess_rad: f64,
    excess_sigma_rad: f64,
    boundary: bool,
}

impl Verdict {
    fn of(status: Status) -> Self {
        Self {
            status,
            truth: None,
            excess_rad: 0.0,
            excess_sigma_rad: 0.0,
            boundary: false,
        }
    }
}

/// The first of these that holds: sun below the horizon; aim no farther than the mirror; sun opposite the
/// aim (cosine at the mirror); normal in a blind cone; neither solution within the limits.
fn classify(mode: TrackingMode, h: &Heliostat, form: OffsetForm, sun: EnuUnit) -> Verdict {
    let s = V3::from(sun);
    if s.2 < 0.0 {
        return Verdict::of(Status::SunBelowHorizon);
    }
    let to_aim = Dd3::new(h.aim.into()).minus(Dd3::new(h.pivot.into()));
    let slant_m = to_aim.norm().value();
    let mut boundary = false;
    let aim_room = slant_m - h.mirror_offset_m.abs();
    boundary |= aim_room.abs() < MARGIN * slant_m && slant_m > 0.0;
    if aim_room <= 0.0 {
        return Verdict {
            boundary,
            ..Verdict::of(Status::AimAtPivot)
        };
    }
    let offset_m = if form == OffsetForm::None {
        0.0
    } else {
        h.mirror_offset_m
    };
    let Some(truth) = normal::exact(h.pivot.into(), h.aim.into(), offset_m, s) else {
        panic!("no normal: {h:?} {sun:?}");
    };
    let cos = truth.cos_at_mirror() - MIN_COS_INCIDENCE;
    boundary |= cos.abs() < MARGIN;
    if cos <= 0.0 {
        return Verdict {
            boundary,
            ..Verdict::of(Status::SunOpposesAim)
        };
    }
    // What a last bit of the unit vectors does to the normal.
    let normal_sigma = 4e-16 / truth.cos_theta.value();
    let cone = mount::cone_margin(mode, truth.t, &h.errors, truth.n);
    boundary |= cone.abs() < MARGIN + 10.0 * normal_sigma;
    if cone < 0.0 {
        return Verdict {
            boundary,
            ..Verdict::of(Status::Unreachable)
        };
    }
    let Some(both) = mount::inverse_with(mode, truth.t, &h.errors, h.pose_errors, truth.n) else {
        return Verdict {
            boundary: true,
            ..Verdict::of(Status::Unreachable)
        };
    };
    // How well the axis angles are known: badly face up and beside a cone.
    let fixed = mount::leaning(mode, truth.t, &h.errors).fixed;
    let level = fixed.cross(truth.n).norm().value();
    let angle_sigma = normal_sigma / (level * level) / cone.max(1e-20).sqrt().min(1.0);
    let l = &h.limits;
    let ranges = [
        (l.axis1_min_rad, l.axis1_max_rad),
        (l.axis2_min_rad, l.axis2_max_rad),
    ];
    let outside = |angle: f64, (min, max): (f64, f64)| {
        (-5..=5)
            .map(|turns| angle + TAU * f64::from(turns))
            .map(|angle| (min - angle).max(angle - max))
            .fold(f64::INFINITY, f64::min)
    };
    let excess = both
        .map(|[a, b]| outside(a, ranges[0]).max(outside(b, ranges[1])))
        .into_iter()
        .fold(f64::INFINITY, f64::min);
    let excess_sigma_rad = MARGIN + 10.0 * angle_sigma;
    boundary |= (excess - TOLERANCE_RAD).abs() < excess_sigma_rad;
    let status = if excess > TOLERANCE_RAD {
        Status::OutsideLimits
    } else {
        Status::Ok
    };
    // Aim all but at the mirror: any small thing turns the normal a lot.
    let truth = (aim_room > 0.05 * slant_m).then_some(truth);
    Verdict {
        status,
        truth,
        excess_rad: excess,
        excess_sigma_rad,
        boundary,
    }
}

#[derive(Clone, Default)]
struct Table {
    /// `counts[wanted][got]`.
    counts: [[usize; 7]; 7],
    left_out: usize,
    wrong: Vec<String>,
    worst_excess: f64,
}

impl Table {
    fn merge(mut self, o: Self) -> Self {
        for (row, other) in self.counts.iter_mut().zip(o.counts) {
            for (a, b) in row.iter_mut().zip(other) {
                *a += b;
            }
        }
        self.left_out += o.left_out;
        self.wrong.extend(o.wrong);
        self.worst_excess = self.worst_excess.max(o.worst_excess);
        self
    }

    fn enter(&mut self, wanted: Status, got: Status, place: impl FnOnce() -> String) {
        self.counts[usize::from(wanted.code())][usize::from(got.code())] += 1;
        if wanted != got && self.wrong.len() < 5 {
            self.wrong
                .push(format!("wanted {wanted}, got {got}: {}", place()));
        }
    }

    /// Notes what must not be.
    fn require(&mut self, good: bool, fault: impl FnOnce() -> String) {
        if !good && self.wrong.len() < 5 {
            self.wrong.push(fault());
        }
    }

    fn rows(&self) -> usize {
        self.counts.iter().flatten().sum::<usize>() + self.left_out
    }

    fn print(&self, title: &str) {
        eprintln!(
            "{title}: {} rows, {} at a boundary left out",
            self.rows(),
            self.left_out
        );
        eprintln!(
            "{:>18} {:>10?}",
            "wanted \\ got",
            Status::ALL.map(Status::code)
        );
        for status in Status::ALL {
            let row = self.counts[usize::from(status.code())];
            if row.iter().sum::<usize>() > 0 {
                eprintln!("{:>18} {row:>9?}", status.as_str());
            }
        }
    }

    fn check(&self, wanted: &[Status]) {
        assert!(self.wrong.is_empty(), "{:#?}", self.wrong);
        assert!(
            self.left_out * 1000 < self.rows(),
            "{} of {}",
            self.left_out,
            self.rows()
        );
        for status in wanted {
            let code = usize::from(status.code());
            assert!(self.counts[code][code] > 2_000, "too few {status}");
        }
    }
}

/// A row that is ok has numbers, any other has none.
fn numbers_keep_to(status: Status, numbers: &[f64]) -> bool {
    if status == Status::Ok {
        numbers.iter().all(|x| x.is_finite())
    } else {
        numbers.iter().all(|x| x.is_nan())
    }
}

/// Limits that hold one solution, or just fail to, by 1e-10 to 0.1 rad.
fn move_a_limit_beside_the_answer(rng: &mut Rng, mode: TrackingMode, h: &mut Heliostat, s: V3) {
    let Some(truth) = normal::exact(h.pivot.into(), h.aim.into(), h.mirror_offset_m, s) else {
        return;
    };
    if mount::cone_margin(mode, truth.t, &h.errors, truth.n) < 1e-2 {
        return; // where the angles are ill-determined by nature
    }
    let Some(both) = mount::inverse_with(mode, truth.t, &h.errors, h.pose_errors, truth.n) else {
        return;
    };
    let [angle1, angle2] = both[rng.below(2)];
    let mut around = |angle: f64| {
        let middle = angle + TAU * f64::from(rng.below(5) as u32) - 2.0 * TAU;
        let step = rng.log_range(1e-10, 0.1) * if rng.chance(0.5) { 1.0 } else { -1.0 };
        let width = rng.log_range(0.2, 3.0);
        if rng.chance(0.5) {
            (middle + step, middle + step + width)
        } else {
            (middle + step - width, middle + step)
        }
    };
    (h.limits.axis1_min_rad, h.limits.axis1_max_rad) = around(angle1);
    (h.limits.axis2_min_rad, h.limits.axis2_max_rad) = around(angle2);
}

fn batch(mode_number: usize, batch: u64, form: OffsetForm) -> Table {
    let mut rng = Rng::new(4_000_000 + 1000 * mode_number as u64 + batch);
    let mode = cases::mode(mode_number, rng.range(0.0, 1.5));
    let mut sun = cases::sun(&mut rng);
    if batch % 8 == 7 {
        let s = V3::from(sun);
        sun = EnuUnit::try_new(V3(s.0, s.1, -s.2 * rng.range(1e-6, 1.0)).enu()).unwrap();
    }
    let mut heliostats: Vec<Heliostat> = (0..3001)
        .map(|_| cases::messy(&mut rng, mode, sun.into()))
        .collect();
    if batch % 3 == 1 {
        let seed = 4_500_000 + 1000 * mode_number as u64 + batch;
        cases::pose_errors(&mut Rng::new(seed), &mut heliostats);
    }
    for h in heliostats.iter_mut().step_by(5) {
        move_a_limit_beside_the_answer(&mut rng, mode, h, sun.into());
    }
    let tracker = Tracker::new(&cases::field(mode, &heliostats), form).unwrap();
    let got = tracker.track(sun);
    let zero = |column: &[f64]| -> Vec<f64> {
        column
            .iter()
            .map(|x| if x.is_finite() { *x } else { 0.0 })
            .collect()
    };
    let normals = tracker
        .forward(&zero(got.axis1_rad()), &zero(got.axis2_rad()))
        .unwrap();
    let mut table = Table::default();
    for (row, h) in heliostats.iter().enumerate() {
        let verdict = classify(mode, h, form, sun);
        let status = got.status()[row];
        let place = || format!("{mode:?} {form:?} sun {sun:?} {h:?}");
        // Whatever the status, the numbers keep to it.
        let numbers = [
            got.axis1_rad()[row],
            got.axis2_rad()[row],
            got.incidence_rad()[row],
        ];
        let excess = got.limit_excess_rad()[row];
        let plain = numbers_keep_to(status, &numbers)
            && if status == Status::OutsideLimits {
                excess > 0.0
            } else {
                excess == 0.0
            };
        table.require(plain, || {
            format!("{status} {numbers:?} {excess}: {}", place())
        });
        if verdict.boundary {
            table.left_out += 1;
            continue;
        }
        table.enter(verdict.status, status, place);
        if let (Status::Ok, Some(truth)) = (status, &verdict.truth) {
            let off = truth.n.distance_to(normals[row].into());
            let near = off < 4e-15 / truth.cos_theta.value() + 2e-14;
            table.require(near, || format!("normal off by {off:e}: {}", place()));
        }
        if status == Status::OutsideLimits && verdict.status == status {
            let off = (excess - verdict.excess_rad).abs();
            let near = off < verdict.excess_sigma_rad;
            table.require(near, || format!("limit excess off by {off:e}: {}", place()));
            table.worst_excess = table.worst_excess.max(off);
        }
    }
    table
}

const TRACKED: [Status; 6] = [
    Status::Ok,
    Status::Unreachable,
    Status::OutsideLimits,
    Status::SunBelowHorizon,
    Status::SunOpposesAim,
    Status::AimAtPivot,
];

#[test]
fn a_million_rows_have_the_status_they_deserve() {
    let jobs: Vec<_> = (0..MODES)
        .flat_map(|m| (0..72).map(move |b| (m, b)))
        .collect();
    let table = jobs
        .into_par_iter()
        .map(|(mode, b)| batch(mode, b, OffsetForm::Exact))
        .reduce(Table::default, Table::merge);
    table.print("track, exact offset");
    eprintln!("limit excess within {:.1e} rad", table.worst_excess);
    assert!(table.rows() > 1_000_000);
    table.check(&TRACKED);
}

#[test]
fn without_offset_too() {
    let jobs: Vec<_> = (0..MODES)
        .flat_map(|m| (0..8).map(move |b| (m, 100 + b)))
        .collect();
    let table = jobs
        .into_par_iter()
        .map(|(mode, b)| batch(mode, b, OffsetForm::None))
        .reduce(Table::default, Table::merge);
    table.print("track, no offset");
    table.check(&TRACKED);
}

/// Forward: ok, sun below the horizon, or the beam misses the target's front.
#[test]
fn predicted_spots_have_the_status_they_deserve() {
    let jobs: Vec<_> = (0..MODES)
        .flat_map(|m| (0..12).map(move |b| (m, b)))
        .collect();
    let table = jobs
        .into_par_iter()
        .map(|(mode_number, number)| {
            let mut rng = Rng::new(9_000_000 + 100 * mode_number as u64 + number);
            let mode = cases::mode(mode_number, rng.range(0.0, 1.5));
            let mut sun = cases::sun(&mut rng);
            if number == 11 {
                let s = V3::from(sun);
                sun = EnuUnit::try_new(V3(s.0, s.1, -s.2).enu()).unwrap();
            }
            let s = V3::from(sun);
            let mut heliostats: Vec<Heliostat> =
                (0..2003).map(|_| cases::messy(&mut rng, mode, s)).collect();
            for h in &mut heliostats {
                if h.aim == h.pivot {
                    h.aim.up += 0.01; // a fixed axis must look somewhere
                }
            }
            let planes: Vec<TargetPlane> = heliostats
                .iter()
                .map(|_| {
                    let facing = EnuUnit::try_new(rng.direction().enu()).unwrap();
                    TargetPlane::level((rng.direction() * 900.0).enu(), facing)
                })
                .collect();
            let mut axis1: Vec<f64> = heliostats.iter().map(|_| rng.within(TAU)).collect();
            let axis2: Vec<f64> = heliostats.iter().map(|_| rng.within(TAU)).collect();
            axis1[17] = f64::NAN;
            let field = cases::field(mode, &heliostats);
            let tracker = Tracker::new(&field, OffsetForm::Exact).unwrap();
            let mut spots = Prediction::default();
            tracker
                .predict_into(
                    sun,
                    &axis1,
                    &axis2,
                    &planes,
                    &TrackOptions::default(),
                    &mut spots,
                )
                .unwrap();
            let mut table = Table::default();
            for (row, h) in heliostats.iter().enumerate() {
                let place = || format!("{mode:?} sun {sun:?} {h:?} {:?}", planes[row]);
                let numbers = [
                    spots.u_m[row],
                    spots.v_m[row],
                    spots.east_m[row],
                    spots.north_m[row],
                    spots.up_m[row],
                    spots.beam_error_rad[row],
                ];
                let status = spots.status[row];
                let plain = numbers_keep_to(status, &numbers);
                table.require(plain, || format!("{status} {numbers:?}: {}", place()));
                if s.2 < 0.0 {
                    table.enter(Status::SunBelowHorizon, status, place);
                    continue;
                }
                if axis1[row].is_nan() {
                    table.enter(Status::MissesTarget, status, place);
                    continue;
                }
                let pivot = Dd3::new(h.pivot.into());
                let to_aim = Dd3::new(h.aim.into()).minus(pivot);
                let n = mount::forward(mode, to_aim, &h.errors, axis1[row], axis2[row]);
                let (n, plane) = (n.value(), &planes[row]);
                let nt = V3::from(plane.normal);
                let lit = s.dot(n);
                let beam = n * (2.0 * lit) - s;
                let mirror = V3::from(h.pivot) + n * h.mirror_offset_m;
                let front = (mirror - V3::from(plane.centre)).dot(nt);
                let approach = -beam.dot(nt);
                // The front is lit by a beam that comes from before it and toward it.
                let far = (mirror - V3::from(plane.centre)).norm();
                if lit.abs() < MARGIN || approach.abs() < MARGIN || front.abs() < MARGIN * far {
                    table.left_out += 1;
                    continue;
                }
                let hits = lit > 0.0 && approach > 0.0 && front > 0.0;
                table.enter(
                    if hits {
                        Status::Ok
                    } else {
                        Status::MissesTarget
                    },
                    status,
                    place,
                );
                if !(hits && status == Status::Ok) {
                    continue;
                }
                let way_m = front / approach;
                let spot = mirror + beam * way_m;
                let on_plane = spot - V3::from(plane.centre);
                let bar = 1e-14 * (way_m + 1000.0) / approach;
                let off = [
                    on_plane.dot(plane.right.into()) - spots.u_m[row],
                    on_plane.dot(plane.down.into()) - spots.v_m[row],
                    spot.0 - spots.east_m[row],
                    spot.1 - spots.north_m[row],
                    spot.2 - spots.up_m[row],
                ];
                let near = off.iter().all(|x| x.abs() < bar);
                table.require(near, || format!("{off:?} {bar:e}: {}", place()));
                let centre = pivot.plus(Dd3::new(n).scaled(Dd::new(h.mirror_offset_m)));
                let wanted = Dd3::new(h.aim.into()).minus(centre).value();
                if wanted.norm() > 1.0 {
                    let miss = wanted.angle_to(beam) - spots.beam_error_rad[row];
                    table.require(miss.abs() < 1e-12, || format!("{miss:e}: {}", place()));
                }
            }
            table
        })
        .reduce(Table::default, Table::merge);
    table.print("predict");
    assert!(table.rows() > 100_000);
    table.check(&[Status::Ok, Status::SunBelowHorizon, Status::MissesTarget]);
}

/// Exactly at the ends, where the answer must still be one or the other and never a plausible NaN.
#[test]
fn rows_at_the_very_edge_keep_to_their_status() {
    let up = EnuUnit::UP;
    let v = |e: f64, n: f64, u: f64| V3(e, n, u).enu();
    let track = |mode, h: Heliostat, sun: EnuUnit, form| {
        let got = Tracker::new(&cases::field(mode, &[h]), form)
            .unwrap()
            .track(sun);
        let numbers = [
            got.axis1_rad()[0],
            got.axis2_rad()[0],
            got.incidence_rad()[0],
        ];
        let status = got.status()[0];
        assert!(
            numbers_keep_to(status, &numbers),
            "{mode:?} {form:?} {status} {numbers:?} {h:?} {sun:?}"
        );
        status
    };
    let forms = [
        OffsetForm::Exact,
        OffsetForm::Approximate,
        OffsetForm::Iterated(3),
        OffsetForm::None,
    ];
    for form in forms {
        for number in 0..MODES {
            let mode = cases::mode(number, 0.6);
            for offset_m in [0.0, 0.2] {
                let at = |aim| Heliostat {
                    mirror_offset_m: offset_m,
                    ..Heliostat::new(v(1.0, 2.0, 3.0), aim)
                };
                // sun and aim both straight up: face up
                assert_eq!(track(mode, at(v(1.0, 2.0, 90.0)), up, form), Status::Ok);
                // nearly so: components whose squares are no longer numbers
                for tiny in [
                    1e-8, 1e-30, 1e-150, 1e-154, 1e-158, 1e-160, 1e-162, 1e-170, 1e-310,
                ] {
                    let sun = EnuUnit::try_new(v(tiny, -tiny, 1.0)).unwrap();
                    assert_eq!(track(mode, at(v(1.0, 2.0, 90.0)), sun, form), Status::Ok);
                }
                // sun straight behind the aim's opposite
                assert_eq!(
                    track(mode, at(v(1.0, 2.0, -50.0)), up, form),
                    Status::SunOpposesAim
                );
                // no aim at all
                assert_eq!(
                    track(mode, at(v(1.0, 2.0, 3.0)), up, form),
                    Status::AimAtPivot
                );
                // sun on the horizon itself is up
                let low = EnuUnit::try_new(v(1.0, 0.0, -0.0)).unwrap();
                assert_eq!(track(mode, at(v(50.0, 40.0, 30.0)), low, form), Status::Ok);
            }
            // the aim just where the mirror is
            let h = Heliostat {
                mirror_offset_m: 0.5,
                ..Heliostat::new(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.5))
            };
            assert_eq!(track(mode, h, up, form), Status::AimAtPivot);
        }
    }
}
