//! The 320 reference cases, all four modes, both offset forms, both solutions, every instruction set.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::f64::consts::FRAC_PI_2;

use helio_core::angle::degrees;
use helio_core::{
    AxisLimits, EnuUnit, Heliostat, MountErrors, OffsetForm, SimdLevel, Status, TrackOptions,
    Tracker, Tracking, TrackingMode,
};
use helio_tests::cases::{field, over_the_top};
use helio_tests::{V3, Worst, circle_difference_rad};
use serde::Deserialize;

/// What the file's `tolerance` asks for.
const TOLERANCE_RAD: f64 = 1e-13;

#[derive(Deserialize)]
struct File {
    source: String,
    method: String,
    tolerance: String,
    cases: Vec<Case>,
}

#[derive(Deserialize, Clone, Copy)]
struct Angles {
    azimuth_deg: f64,
    elevation_deg: f64,
}

#[derive(Deserialize)]
struct Case {
    kind: String,
    mode: String,
    latitude_deg: Option<f64>,
    axis_azimuth_deg: Option<f64>,
    aim_neu_m: [f64; 3],
    sun_azimuth_deg: f64,
    sun_elevation_deg: f64,
    mirror_offset_m: f64,
    psi_a_deg: f64,
    psi_t_deg: f64,
    gamma0_deg: f64,
    tau1_deg: f64,
    alpha0_deg: f64,
    mu_deg: f64,
    incidence_deg: f64,
    tau_approx_deg: f64,
    tau_exact_deg: f64,
    normal_neu_approx: [f64; 3],
    normal_neu_exact: [f64; 3],
    approx: Option<Angles>,
    approx_dual: Option<Angles>,
    exact: Option<Angles>,
    exact_dual: Option<Angles>,
}

fn from_neu([north, east, up]: [f64; 3]) -> V3 {
    V3(east, north, up)
}

impl Case {
    fn mode(&self) -> TrackingMode {
        match self.mode.as_str() {
            "azimuth-elevation" => TrackingMode::AzimuthElevation,
            "spinning-elevation" => TrackingMode::SpinningElevation,
            "pitch-roll" => TrackingMode::PitchRoll {
                axis_azimuth_rad: self.axis_azimuth_deg.unwrap().to_radians(),
            },
            "polar" => TrackingMode::Polar {
                latitude_rad: self.latitude_deg.unwrap().to_radians(),
            },
            other => panic!("{other}"),
        }
    }

    fn sun(&self) -> EnuUnit {
        let (sin_a, cos_a) = self.sun_azimuth_deg.to_radians().sin_cos();
        let (sin_e, cos_e) = self.sun_elevation_deg.to_radians().sin_cos();
        EnuUnit::try_new(V3(cos_e * sin_a, cos_e * cos_a, sin_e).enu()).unwrap()
    }

    fn heliostat(&self) -> Heliostat {
        Heliostat {
            mirror_offset_m: self.mirror_offset_m,
            errors: MountErrors {
                pedestal_tilt_rad: self.psi_t_deg.to_radians(),
                pedestal_tilt_azimuth_rad: self.psi_a_deg.to_radians(),
                axis_nonorthogonality_rad: self.tau1_deg.to_radians(),
                mirror_tilt_rad: self.mu_deg.to_radians(),
                azimuth_reference_rad: self.gamma0_deg.to_radians(),
                elevation_reference_rad: self.alpha0_deg.to_radians(),
            },
            ..Heliostat::new(V3(0.0, 0.0, 0.0).enu(), from_neu(self.aim_neu_m).enu())
        }
    }
}

fn cases() -> Vec<Case> {
    let file: File = serde_json::from_str(include_str!("../reference/tracking.json")).unwrap();
    assert!(!file.source.is_empty() && !file.method.is_empty() && !file.tolerance.is_empty());
    assert_eq!(file.cases.len(), 320);
    file.cases
}

/// Axis limits of one axis 2, half a turn about an elevation, that a solution of the other kind
/// (90° or more away in formula elevation, or the same mount to rounding) does not satisfy.
fn demanded(heliostat: &Heliostat, dual: bool) -> AxisLimits {
    if dual {
        over_the_top(&heliostat.errors)
    } else {
        AxisLimits::NONE
    }
}

#[test]
fn all_cases_agree_with_forty_digits() {
    let mut worst_elevation = Worst::default();
    let mut worst_azimuth = Worst::default();
    let mut worst_normal = Worst::default();
    let mut worst_incidence = Worst::default();
    let mut worst_tau = Worst::default();
    let (mut refused, mut answered) = (0, 0);
    for (index, case) in cases().iter().enumerate() {
        let forms = [
            (
                OffsetForm::Approximate,
                false,
                case.approx,
                case.normal_neu_approx,
                case.tau_approx_deg,
            ),
            (
                OffsetForm::Approximate,
                true,
                case.approx_dual,
                case.normal_neu_approx,
                case.tau_approx_deg,
            ),
            (
                OffsetForm::Exact,
                false,
                case.exact,
                case.normal_neu_exact,
                case.tau_exact_deg,
            ),
            (
                OffsetForm::Exact,
                true,
                case.exact_dual,
                case.normal_neu_exact,
                case.tau_exact_deg,
            ),
        ];
        for (form, dual, want, want_normal, want_tau_deg) in forms {
            let mut heliostat = case.heliostat();
            heliostat.limits = demanded(&heliostat, dual);
            let tracker = Tracker::new(&field(case.mode(), &[heliostat]), form).unwrap();
            for &level in SimdLevel::available() {
                let name = || format!("case {index} {} {form:?} dual {dual} {level}", case.kind);
                let options = TrackOptions {
                    level: Some(level),
                    ..TrackOptions::default()
                };
                let mut got = Tracking::default();
                tracker
                    .track_into(&[case.sun()], None, &options, &mut got)
                    .unwrap();
                let (axis1, axis2) = (got.axis1_rad()[0], got.axis2_rad()[0]);
                let Some(want) = want else {
                    assert_eq!(got.status(), [Status::Unreachable], "{}", name());
                    assert!(axis1.is_nan() && axis2.is_nan() && got.incidence_rad()[0].is_nan());
                    refused += 1;
                    continue;
                };
                answered += 1;
                assert_eq!(got.status(), [Status::Ok], "{}", name());
                // Differences in degrees first: the reference's own digits stay exact.
                let off_deg = |got_rad: f64, want_deg: f64| {
                    let turns = (degrees(got_rad) - want_deg) / 360.0;
                    (360.0 * (turns - turns.round())).to_radians().abs()
                };
                let level_part = (want.elevation_deg - case.alpha0_deg)
                    .to_radians()
                    .cos()
                    .abs();
                worst_elevation.see(off_deg(axis2, want.elevation_deg), name);
                worst_azimuth.see(off_deg(axis1, want.azimuth_deg) * level_part, name);
                if !dual {
                    assert!((0.0..std::f64::consts::TAU).contains(&axis1), "{}", name());
                }
                let incidence = got.incidence_rad()[0];
                worst_incidence.see(
                    circle_difference_rad(incidence, case.incidence_deg.to_radians()).abs(),
                    name,
                );
                let normal: V3 = tracker.forward(&[axis1], &[axis2]).unwrap()[0].into();
                worst_normal.see((normal - from_neu(want_normal)).norm(), name);
                // tau: how much nearer the normal is to the aim than the bisector
                let aim = from_neu(case.aim_neu_m);
                let tau = case.incidence_deg.to_radians() - normal.angle_to(aim);
                worst_tau.see((tau - want_tau_deg.to_radians()).abs(), name);
            }
        }
    }
    eprintln!("elevation            {worst_elevation} rad");
    eprintln!("azimuth x cos(alpha) {worst_azimuth} rad");
    eprintln!("normal               {worst_normal}");
    eprintln!("incidence            {worst_incidence} rad");
    eprintln!("tau                  {worst_tau} rad");
    let levels = SimdLevel::available().len();
    eprintln!("{answered} answers, {refused} refused, {levels} levels");
    assert_eq!(refused, 18 * 4 * levels);
    assert_eq!(answered, (320 - 18) * 4 * levels);
    for worst in [
        &worst_elevation,
        &worst_azimuth,
        &worst_normal,
        &worst_incidence,
        &worst_tau,
    ] {
        assert!(worst.value < TOLERANCE_RAD, "{worst}");
    }
}

/// The direct solution can be demanded by limits too; they may wrap it in another window, which
/// costs a last bit at most.
#[test]
fn the_direct_solution_by_limits_is_the_same() {
    for case in cases().iter().filter(|case| case.exact.is_some()) {
        let free = case.heliostat();
        let mut limited = free;
        limited.limits = AxisLimits {
            axis2_min_rad: free.errors.elevation_reference_rad - FRAC_PI_2 - 1e-9,
            axis2_max_rad: free.errors.elevation_reference_rad + FRAC_PI_2 + 1e-9,
            ..AxisLimits::NONE
        };
        let track = |heliostat: Heliostat| {
            let field = field(case.mode(), &[heliostat]);
            let got = Tracker::new(&field, OffsetForm::Exact)
                .unwrap()
                .track(case.sun());
            (got.axis1_rad()[0], got.axis2_rad()[0])
        };
        let (a, b) = (track(free), track(limited));
        let off = circle_difference_rad(a.0, b.0).abs().max((a.1 - b.1).abs());
        assert!(off < 2e-15, "{off:e} {}", case.kind);
    }
}
