//! Where a beam lands: u to the right, v down, and what is a miss.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use helio_core::tracking::Prediction;
use helio_core::{
    Enu, EnuUnit, Heliostat, OffsetForm, SimdLevel, Status, TargetPlane, TrackOptions, Tracker,
    TrackingMode,
};
use helio_tests::cases::{self, Kind, MODES};
use helio_tests::{Rng, V3, Worst};

fn predict(
    mode: TrackingMode,
    heliostats: &[Heliostat],
    sun: EnuUnit,
    axes: (&[f64], &[f64]),
    planes: &[TargetPlane],
) -> Prediction {
    let tracker = Tracker::new(&cases::field(mode, heliostats), OffsetForm::Exact).unwrap();
    let mut out = Prediction::default();
    for &level in SimdLevel::available() {
        let options = TrackOptions {
            level: Some(level),
            ..TrackOptions::default()
        };
        let before = out.clone();
        tracker
            .predict_into(sun, axes.0, axes.1, planes, &options, &mut out)
            .unwrap();
        if level != SimdLevel::available()[0] {
            assert_eq!(before.status, out.status);
            let bits = |column: &[f64]| column.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&before.u_m), bits(&out.u_m));
            assert_eq!(bits(&before.v_m), bits(&out.v_m));
            assert_eq!(bits(&before.beam_error_rad), bits(&out.beam_error_rad));
        }
    }
    out
}

/// A target facing the beam, not square to it.
fn facing(rng: &mut Rng, at: V3, from: V3) -> TargetPlane {
    loop {
        let normal = ((from - at).unit() + rng.direction() * 0.8).unit();
        if normal.dot((from - at).unit()) > 0.2 {
            return TargetPlane::level(at.enu(), EnuUnit::try_new(normal.enu()).unwrap());
        }
    }
}

#[test]
fn a_beam_aimed_at_a_point_of_the_plane_lands_there() {
    let mut rng = Rng::new(10);
    let mut worst_centre = Worst::default();
    let mut worst_point = Worst::default();
    for batch in 0..40 {
        let mode = cases::mode(batch % MODES, 0.7);
        let sun = cases::sun(&mut rng);
        let s = V3::from(sun);
        let mut heliostats = Vec::new();
        let (mut planes, mut uv) = (Vec::new(), Vec::new());
        for _ in 0..500 {
            let mut h = cases::heliostat(&mut rng, Kind::Anywhere, mode, s);
            let plane = facing(&mut rng, h.aim.into(), h.pivot.into());
            // level axes as theory draws them
            assert!(plane.right.as_enu().up.abs() < 1e-15);
            assert!(plane.down.as_enu().up < 0.0);
            let (u, v) = if batch < 20 {
                (0.0, 0.0)
            } else {
                (rng.within(0.3), rng.within(0.3))
            };
            h.aim = plane.point(u, v);
            let by_hand =
                V3::from(plane.centre) + V3::from(plane.right) * u + V3::from(plane.down) * v;
            assert!((by_hand - V3::from(h.aim)).norm() < 1e-12);
            heliostats.push(h);
            planes.push(plane);
            uv.push((u, v));
        }
        let got = Tracker::new(&cases::field(mode, &heliostats), OffsetForm::Exact)
            .unwrap()
            .track(sun);
        let axes = (got.axis1_rad(), got.axis2_rad());
        let spots = predict(mode, &heliostats, sun, axes, &planes);
        for (row, h) in heliostats.iter().enumerate() {
            if got.status()[row] != Status::Ok {
                assert_eq!(spots.status[row], Status::MissesTarget);
                continue;
            }
            assert_eq!(spots.status[row], Status::Ok);
            let slant = (V3::from(h.aim) - V3::from(h.pivot)).norm();
            let off = (spots.u_m[row] - uv[row].0).hypot(spots.v_m[row] - uv[row].1);
            let place = || format!("slant {slant:.1} m, off {off:.1e} m");
            let hit = V3(spots.east_m[row], spots.north_m[row], spots.up_m[row]);
            assert!((hit - V3::from(h.aim)).norm() < 1e-9, "{}", place());
            // as an angle from the mirror
            let worst = if batch < 20 {
                &mut worst_centre
            } else {
                &mut worst_point
            };
            worst.see(off / (slant + 1000.0), place);
            assert!(
                spots.beam_error_rad[row] < 3e-14,
                "{}",
                spots.beam_error_rad[row]
            );
        }
    }
    eprintln!(
        "at the centre {worst_centre}, at a point {worst_point} (per metre of way and place)"
    );
    assert!(worst_centre.value < 2e-13 && worst_point.value < 2e-13);
}

/// A north-facing target: u grows to the west, v down (like pixels of a camera that looks south).
#[test]
fn u_is_west_and_v_down_on_a_target_that_faces_north() {
    let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0)).unwrap();
    let plane = TargetPlane::level(Enu::new(0.0, 0.0, 50.0), north);
    let sun = EnuUnit::from_azimuth_elevation(3.3, 0.7);
    let at = |east: f64, up: f64| {
        let aim = Enu::new(east, 0.0, up);
        let h = Heliostat {
            mirror_offset_m: 0.2,
            ..Heliostat::new(Enu::new(30.0, 120.0, 2.0), aim)
        };
        let mode = TrackingMode::AzimuthElevation;
        let got = Tracker::new(&cases::field(mode, &[h]), OffsetForm::Exact)
            .unwrap()
            .track(sun);
        let spots = predict(
            mode,
            &[h],
            sun,
            (got.axis1_rad(), got.axis2_rad()),
            &[plane],
        );
        (spots.u_m[0], spots.v_m[0])
    };
    let close =
        |a: (f64, f64), b: (f64, f64)| assert!((a.0 - b.0).hypot(a.1 - b.1) < 1e-12, "{a:?}");
    close(at(0.0, 50.0), (0.0, 0.0));
    close(at(-1.5, 50.0), (1.5, 0.0)); // west is right
    close(at(0.0, 48.0), (0.0, 2.0)); // below is down
    close(at(2.0, 53.0), (-2.0, -3.0));
}

/// An edge that is not level: the same spot in turned coordinates.
#[test]
fn a_rolled_target_turns_u_and_v() {
    let mut rng = Rng::new(11);
    for _ in 0..200 {
        let normal = EnuUnit::try_new(rng.direction().enu()).unwrap();
        let centre = (rng.direction() * 80.0).enu();
        let level = TargetPlane::level(centre, normal);
        let roll = rng.within(3.0);
        let right = V3::from(level.right).rotated(V3::from(normal), -roll);
        let rolled =
            TargetPlane::with_right(centre, normal, EnuUnit::try_new(right.enu()).unwrap())
                .unwrap();
        let (u, v) = (rng.within(4.0), rng.within(4.0));
        // turned clockwise as the camera sees it, a spot goes the other way round
        let (sin, cos) = roll.sin_cos();
        let (u2, v2) = (u * cos + v * sin, v * cos - u * sin);
        let off = V3::from(level.point(u, v)) - V3::from(rolled.point(u2, v2));
        assert!(off.norm() < 1e-13, "{off:?}");
        // right x down = -normal: the camera sees them as pixel axes
        let away = V3::from(rolled.right).cross(V3::from(rolled.down)) + V3::from(normal);
        assert!(away.norm() < 1e-14);
        assert!(TargetPlane::with_right(centre, normal, normal).is_err());
    }
}

#[test]
fn misses_are_misses() {
    let mut rng = Rng::new(12);
    for batch in 0..20 {
        let mode = cases::mode(batch % MODES, 0.7);
        let sun = cases::sun(&mut rng);
        let s = V3::from(sun);
        let heliostats: Vec<Heliostat> = (0..300)
            .map(|_| cases::heliostat(&mut rng, Kind::Anywhere, mode, s))
            .collect();
        let got = Tracker::new(&cases::field(mode, &heliostats), OffsetForm::Exact)
            .unwrap()
            .track(sun);
        let axes = (got.axis1_rad(), got.axis2_rad());
        let planes: Vec<TargetPlane> = heliostats
            .iter()
            .map(|h| facing(&mut rng, h.aim.into(), h.pivot.into()))
            .collect();
        let good = predict(mode, &heliostats, sun, axes, &planes);
        assert!(good.status.iter().all(|status| *status == Status::Ok));
        let all_miss = |planes: &[TargetPlane], axes: (&[f64], &[f64]), what: &str| {
            let spots = predict(mode, &heliostats, sun, axes, planes);
            for row in 0..heliostats.len() {
                assert_eq!(spots.status[row], Status::MissesTarget, "{what} row {row}");
                for column in [
                    &spots.u_m,
                    &spots.v_m,
                    &spots.east_m,
                    &spots.north_m,
                    &spots.up_m,
                    &spots.beam_error_rad,
                ] {
                    assert!(column[row].is_nan());
                }
            }
        };
        let backs: Vec<TargetPlane> = planes
            .iter()
            .map(|p| {
                let back = -V3::from(p.normal);
                TargetPlane::level(p.centre, EnuUnit::try_new(back.enu()).unwrap())
            })
            .collect();
        all_miss(&backs, axes, "the target's back");
        // the same plane moved behind the mirror along the beam
        let behind: Vec<TargetPlane> = heliostats
            .iter()
            .zip(&planes)
            .map(|(h, p)| {
                let way = V3::from(h.aim) - V3::from(h.pivot);
                TargetPlane {
                    centre: (V3::from(h.pivot) - way).enu(),
                    ..*p
                }
            })
            .collect();
        all_miss(&behind, axes, "a target behind the mirror");
        // Half round about the moving axis of a mount: its back to the sun. With mu and tau1 small
        // the normal is all but reversed; leave grazing suns out by the wanted incidence.
        let turned: Vec<f64> = axes.1.iter().map(|a| a + std::f64::consts::PI).collect();
        let spots = predict(mode, &heliostats, sun, (axes.0, &turned), &planes);
        for row in 0..heliostats.len() {
            if got.incidence_rad()[row] < 1.4 {
                assert_eq!(
                    spots.status[row],
                    Status::MissesTarget,
                    "the mirror's back, row {row}"
                );
            }
        }
        // no angle, no spot; an infinite one is an error
        let nan = vec![f64::NAN; heliostats.len()];
        all_miss(&planes, (&nan, axes.1), "no angle");
        all_miss(&planes, (axes.0, &nan), "no angle");
        let tracker = Tracker::new(&cases::field(mode, &heliostats), OffsetForm::Exact).unwrap();
        let infinite = vec![f64::INFINITY; heliostats.len()];
        let options = TrackOptions::default();
        let mut out = Prediction::default();
        assert!(
            tracker
                .predict_into(sun, &infinite, axes.1, &planes, &options, &mut out)
                .is_err()
        );
        let short = &planes[1..];
        assert!(
            tracker
                .predict_into(sun, axes.0, axes.1, short, &options, &mut out)
                .is_err()
        );
        // below the horizon nothing is lit
        let night = EnuUnit::try_new(V3(s.0, s.1, -s.2).enu()).unwrap();
        tracker
            .predict_into(night, axes.0, axes.1, &planes, &options, &mut out)
            .unwrap();
        assert!(
            out.status
                .iter()
                .all(|status| *status == Status::SunBelowHorizon)
        );
        assert!(out.u_m.iter().chain(&out.east_m).all(|x| x.is_nan()));
    }
}

/// A small turn of the normal moves the beam by twice as much in the plane of incidence and by
/// 2 cos(theta*) times as much across it.
#[test]
fn an_axis_error_moves_the_beam_as_theory_says() {
    let mut rng = Rng::new(13);
    let mode = TrackingMode::AzimuthElevation;
    for _ in 0..2_000 {
        let sun = cases::sun(&mut rng);
        let s = V3::from(sun);
        let mut h = cases::heliostat(&mut rng, Kind::Anywhere, mode, s);
        h.errors = helio_core::MountErrors::default();
        let got = Tracker::new(&cases::field(mode, &[h]), OffsetForm::Exact)
            .unwrap()
            .track(sun);
        if got.status()[0] != Status::Ok {
            continue;
        }
        let (gamma, alpha) = (got.axis1_rad()[0], got.axis2_rad()[0]);
        let plane = facing(&mut rng, h.aim.into(), h.pivot.into());
        let step = 1e-4;
        let (dg, da) = (rng.within(step), rng.within(step));
        let spots = predict(mode, &[h], sun, (&[gamma + dg], &[alpha + da]), &[plane]);
        if spots.status[0] != Status::Ok {
            continue;
        }
        // the normal moves by da upward and cos(alpha) dg sideways
        let (sin_g, cos_g) = gamma.sin_cos();
        let (sin_a, cos_a) = alpha.sin_cos();
        let n = V3(cos_a * sin_g, cos_a * cos_g, sin_a);
        let up = V3(-sin_a * sin_g, -sin_a * cos_g, cos_a);
        let side = V3(cos_g, -sin_g, 0.0);
        let dn = up * da + side * (cos_a * dg);
        let cos = s.dot(n);
        let in_plane = (s - n * cos).unit();
        let along = dn.dot(in_plane);
        let across = (dn - in_plane * along).norm();
        let beam = ((2.0 * along).powi(2) + (2.0 * cos * across).powi(2)).sqrt();
        // The mirror's centre moves with the normal and sees the aim from elsewhere.
        let slant = (V3::from(h.aim) - V3::from(h.pivot)).norm();
        let moved = h.mirror_offset_m.abs() * dn.norm() / slant;
        let off = (spots.beam_error_rad[0] - beam).abs();
        assert!(
            off < 1.1 * moved + 20.0 * step * step,
            "{off:e} {beam:e} {moved:e}"
        );
    }
}
