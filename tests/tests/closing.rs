//! Inverse then forward gives the wanted normal back; and forward is the mount's own turning.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::f64::consts::TAU;

use helio_core::{AxisLimits, Heliostat, OffsetForm, Status, Tracker};
use helio_tests::cases::{self, KINDS, Kind, MODES};
use helio_tests::dd::{Dd, Dd3};
use helio_tests::{Rng, V3, Worst, mount, normal};
use rayon::prelude::*;

/// Heliostats of a batch; each batch has one sun.
const BATCH: usize = 2000;
/// Batches per mode and kind.
const BATCHES: usize = 12;

/// Closure of the normal.
const BAR: f64 = 4e-15;

/// How much more than [`BAR`] the truth may be missed by. The unit vectors to sun and aim are doubles,
/// and the normal is the direction of their sum, 2 cos(theta) long: beyond 85° their last bits,
/// 1e-16, show in the truth itself as 1e-16/cos(theta).
fn conditioning(cos_theta: f64) -> f64 {
    (85_f64.to_radians().cos() / cos_theta).max(1.0)
}

/// What a batch left.
#[derive(Default, Clone)]
struct Left {
    /// Against the truth, not scaled.
    plain: Worst,
    direct: Worst,
    over: Worst,
    between: Worst,
    beam: Worst,
    incidence: Worst,
}

impl Left {
    fn merge(self, o: Self) -> Self {
        Self {
            plain: self.plain.merge(o.plain),
            direct: self.direct.merge(o.direct),
            over: self.over.merge(o.over),
            between: self.between.merge(o.between),
            beam: self.beam.merge(o.beam),
            incidence: self.incidence.merge(o.incidence),
        }
    }
}

fn close(kind: Kind, mode_number: usize, batch: usize, errs: bool) -> Left {
    let mut rng = Rng::new(1000 * batch as u64 + 10 * mode_number as u64 + kind as u64);
    let mode = cases::mode(mode_number, rng.range(0.05, 1.4));
    let sun = cases::sun(&mut rng);
    let s = V3::from(sun);
    let mut heliostats: Vec<Heliostat> = (0..BATCH)
        .map(|_| cases::heliostat(&mut rng, kind, mode, s))
        .collect();
    if errs {
        cases::pose_errors(&mut rng, &mut heliostats);
    }
    let limited: Vec<Heliostat> = heliostats
        .iter()
        .map(|h| Heliostat {
            limits: over_the_top(h),
            ..*h
        })
        .collect();
    let run = |heliostats: &[Heliostat]| {
        let tracker = Tracker::new(&cases::field(mode, heliostats), OffsetForm::Exact).unwrap();
        let got = tracker.track(sun);
        for (row, status) in got.status().iter().enumerate() {
            assert_eq!(
                *status,
                Status::Ok,
                "{kind:?} {mode:?} row {row}: {:?}",
                heliostats[row]
            );
        }
        let normals = tracker.forward(got.axis1_rad(), got.axis2_rad()).unwrap();
        (got, normals)
    };
    let (direct, direct_normals) = run(&heliostats);
    let (over, over_normals) = run(&limited);
    let mut left = Left::default();
    for (row, h) in heliostats.iter().enumerate() {
        let truth = normal::exact(h.pivot.into(), h.aim.into(), h.mirror_offset_m, s).unwrap();
        let place = || {
            format!(
                "{mode:?} batch {batch} row {row}, incidence {:.4}°, cone {:.1e}",
                truth.incidence_rad().to_degrees(),
                mount::cone_margin(mode, truth.t, &h.errors, truth.n),
            )
        };
        let (a, b) = (V3::from(direct_normals[row]), V3::from(over_normals[row]));
        let scale = conditioning(truth.cos_theta.value());
        left.plain
            .see(truth.n.distance_to(a).max(truth.n.distance_to(b)), place);
        left.direct.see(truth.n.distance_to(a) / scale, place);
        left.over.see(truth.n.distance_to(b) / scale, place);
        left.between.see((a - b).norm(), place);
        let centre = truth.n.scaled(Dd::new(h.mirror_offset_m));
        let to_aim = truth.t.scaled(truth.slant_m).minus(centre).unit();
        let beam = a * (2.0 * s.dot(a)) - s;
        // the beam turns by twice what the normal does
        left.beam.see(0.5 * to_aim.distance_to(beam) / scale, place);
        left.incidence.see(
            (direct.incidence_rad()[row] - truth.incidence_rad()).abs(),
            place,
        );
        assert_eq!(
            direct.incidence_rad()[row].to_bits(),
            over.incidence_rad()[row].to_bits()
        );
        // Which of the two it is, without the crate's help.
        let rise = |axis2: f64| (axis2 - h.errors.elevation_reference_rad).cos();
        let slack = 1e-12 + most_rad(h);
        assert!(rise(direct.axis2_rad()[row]) > -slack, "{}", place());
        assert!(rise(over.axis2_rad()[row]) < slack, "{}", place());
    }
    left
}

/// What the pose errors turn the second axis by at most.
fn most_rad(h: &Heliostat) -> f64 {
    h.pose_errors.axis2_sag_rad.abs() + h.pose_errors.axis2_eccentricity_rad.abs()
}

/// Limits as [`cases::over_the_top`], as wide as the pose errors need them.
fn over_the_top(h: &Heliostat) -> AxisLimits {
    let limits = cases::over_the_top(&h.errors);
    let most_rad = most_rad(h);
    AxisLimits {
        axis2_min_rad: limits.axis2_min_rad - most_rad,
        axis2_max_rad: limits.axis2_max_rad + most_rad,
        ..limits
    }
}

/// 720,000 heliostats, both solutions of each: 1.44 million closures.
#[test]
fn inverse_then_forward_closes_the_normal() {
    let total = close_all(BATCHES, false);
    assert!(total.direct.count + total.over.count >= 1_400_000);
}

/// The same where four in five have pose errors.
#[test]
fn inverse_then_forward_closes_the_normal_of_a_mount_with_pose_errors() {
    let total = close_all(BATCHES / 3, true);
    assert!(total.direct.count + total.over.count >= 480_000);
}

fn close_all(batches: usize, errs: bool) -> Left {
    let mut failed = Vec::new();
    let mut total = Left::default();
    for kind in KINDS {
        let jobs: Vec<_> = (0..MODES)
            .flat_map(|mode| (0..batches).map(move |batch| (mode, batch)))
            .collect();
        let left = jobs
            .into_par_iter()
            .map(|(mode, batch)| close(kind, mode, batch, errs))
            .reduce(Left::default, Left::merge);
        eprintln!("{kind:?}:");
        eprintln!("  against truth, not scaled {}", left.plain);
        for (what, worst) in [
            ("direct against truth", &left.direct),
            ("over the top against truth", &left.over),
            ("direct against over the top", &left.between),
            ("half the beam's miss", &left.beam),
            ("incidence", &left.incidence),
        ] {
            eprintln!("  {what} {worst}");
            if worst.value.is_nan() || worst.value >= BAR {
                failed.push(format!("{kind:?} {what}: {worst}"));
            }
        }
        total = total.merge(left);
    }
    eprintln!(
        "direct {}\nover {}\nbetween {}",
        total.direct, total.over, total.between
    );
    assert!(failed.is_empty(), "{failed:#?}");
    total
}

/// Forward against rotations about the mount's own axes in the world, one after the other.
#[test]
fn forward_is_the_turning_of_the_mount() {
    let jobs: Vec<_> = (0..MODES)
        .flat_map(|m| (0..20).map(move |b| (m, b)))
        .collect();
    let worst: Vec<(usize, Worst)> = jobs
        .into_par_iter()
        .map(|(mode_number, batch)| {
            let mut rng = Rng::new(77_000 + 100 * mode_number as u64 + batch);
            let mode = cases::mode(mode_number, rng.range(0.0, 1.5));
            let mut worst = Worst::default();
            let mut heliostats: Vec<Heliostat> = (0..10_000)
                .map(|row| {
                    let mut h = Heliostat::new(
                        (rng.direction() * 300.0).enu(),
                        (rng.direction() * 900.0).enu(),
                    );
                    h.errors = cases::large_errors(&mut rng);
                    // half of them turned by less, and some perfect in each way
                    if row % 2 == 0 {
                        h.errors.azimuth_reference_rad = 0.0;
                        h.errors.elevation_reference_rad = 0.0;
                    }
                    match row % 16 {
                        1 => h.errors.pedestal_tilt_rad = 0.0,
                        2 => h.errors.axis_nonorthogonality_rad = 0.0,
                        3 => h.errors.mirror_tilt_rad = 0.0,
                        4 => h.errors = helio_core::MountErrors::default(),
                        _ => {}
                    }
                    h
                })
                .collect();
            if batch % 4 == 1 {
                cases::pose_errors(&mut Rng::new(78_000 + batch), &mut heliostats);
            }
            let turn = |rng: &mut Rng| rng.within(TAU);
            let axis1: Vec<f64> = heliostats.iter().map(|_| turn(&mut rng)).collect();
            let axis2: Vec<f64> = heliostats.iter().map(|_| turn(&mut rng)).collect();
            let field = cases::field(mode, &heliostats);
            let tracker = Tracker::new(&field, OffsetForm::Exact).unwrap();
            let normals = tracker.forward(&axis1, &axis2).unwrap();
            for (row, h) in heliostats.iter().enumerate() {
                let to_aim = Dd3::new(h.aim.into()).minus(Dd3::new(h.pivot.into()));
                let (axis1, axis2) = (axis1[row], axis2[row]);
                let want =
                    mount::forward_with(mode, to_aim, &h.errors, h.pose_errors, axis1, axis2);
                let got = V3::from(normals[row]);
                worst.see(want.distance_to(got), || format!("{mode:?} {h:?}"));
            }
            (mode_number, worst)
        })
        .collect();
    for mode in 0..MODES {
        let all = worst
            .iter()
            .filter(|(m, _)| *m == mode)
            .fold(Worst::default(), |sum, (_, w)| sum.merge(w.clone()));
        eprintln!(
            "{}: {:.3e} of {}",
            cases::mode(mode, 0.5).as_str(),
            all.value,
            all.count
        );
        assert!(all.value < 2e-15, "{all}");
    }
}
