//! The analytic Jacobian against automatic differentiation of the values alone.

use std::ops::{Add, Div, Mul, Neg, Sub};

use helio_calib::model::{Pose, Real, landing};
use helio_calib::{Mount, Observation, Sighting};
use helio_core::{Enu, EnuUnit, Heliostat, PoseErrors, TargetPlane, TrackingMode};

/// Seven parameters and three pose errors.
const SLOPES: usize = 10;

/// A value with its derivatives by all of them (forward mode).
#[derive(Debug, Clone, Copy)]
struct Dual(f64, [f64; SLOPES]);

impl Dual {
    fn map2(self, other: Self, value: f64, by_self: f64, by_other: f64) -> Self {
        Self(
            value,
            std::array::from_fn(|k| by_self * self.1[k] + by_other * other.1[k]),
        )
    }
}
impl Add for Dual {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        self.map2(o, self.0 + o.0, 1.0, 1.0)
    }
}
impl Sub for Dual {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self.map2(o, self.0 - o.0, 1.0, -1.0)
    }
}
impl Mul for Dual {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        self.map2(o, self.0 * o.0, o.0, self.0)
    }
}
impl Div for Dual {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        self.map2(o, self.0 / o.0, 1.0 / o.0, -self.0 / (o.0 * o.0))
    }
}
impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        self.map2(self, -self.0, -1.0, 0.0)
    }
}
impl Real for Dual {
    fn splat(value: f64) -> Self {
        Self(value, [0.0; SLOPES])
    }
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.0.sin_cos();
        (self.map2(self, s, c, 0.0), self.map2(self, c, -s, 0.0))
    }
}

fn lift(s: &Sighting<f64>) -> Sighting<Dual> {
    let up = Dual::splat;
    Sighting {
        sun: s.sun.map(up),
        axis1: s.axis1.map(up),
        axis2: s.axis2.map(up),
        plane: s.plane.map(|v| v.map(up)),
        centre_along_normal_m: up(s.centre_along_normal_m),
        spot_m: s.spot_m.map(up),
        weight: up(s.weight),
        up: s.up.map(up),
        pose_errors: None,
    }
}

#[test]
fn the_analytic_jacobian_is_the_derivative_of_the_values() {
    let modes = [
        TrackingMode::AzimuthElevation,
        TrackingMode::SpinningElevation,
        TrackingMode::PitchRoll {
            axis_azimuth_rad: 1.3,
        },
        TrackingMode::Polar { latitude_rad: 0.7 },
    ];
    let mut worst: f64 = 0.0;
    for (number, mode) in modes.into_iter().enumerate() {
        let mut seed = 12345 + number as u64;
        let mut random = || {
            seed = seed
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        };
        for case in 0..500 {
            let pivot = Enu::new(60.0 * random(), 100.0 + 50.0 * random(), 3.0 * random());
            let centre = Enu::new(random(), random(), 40.0 + 5.0 * random());
            let heliostat = Heliostat::new(pivot, centre);
            let plane = TargetPlane::level(
                centre,
                EnuUnit::from_azimuth_elevation(0.3 * random(), 0.2 * random()),
            );
            let sun = EnuUnit::from_azimuth_elevation(3.0 + random(), 0.8 + 0.5 * random());
            let mut mount = Mount::of(mode, &heliostat);
            mount.mirror_offset_m = 0.3 * random();
            let observation = Observation::new(
                sun,
                3.0 * random(),
                1.5 * random(),
                plane,
                random(),
                random(),
            );
            let sighting = Sighting::new(&mount, &observation);
            let size = if case % 5 == 0 { 0.0 } else { 0.3 };
            let values: [f64; 7] = std::array::from_fn(|k| match k {
                6 => mount.mirror_offset_m,
                _ => size * random(),
            });
            // none for some, and up to the most allowed
            let errors: [f64; 3] = match case % 3 {
                0 => [0.0; 3],
                _ => std::array::from_fn(|_| PoseErrors::MAX_RAD * random()),
            };
            let lift_at = |place: usize, value: f64| {
                let mut unit = [0.0; SLOPES];
                unit[place] = 1.0;
                Dual(value, unit)
            };
            let dual = std::array::from_fn(|k| lift_at(k, values[k]));
            let dual_errors = std::array::from_fn(|k| lift_at(7 + k, errors[k]));
            mount.pose_errors = PoseErrors::from_array(errors);
            // the mount's own, and the same in place of others
            let own = landing(&Pose::new(values), &Sighting::new(&mount, &observation));
            let plain = landing(&Pose::new(values).with_pose_errors(errors), &sighting);
            for i in 0..2 {
                assert!((own.residual_m[i] - plain.residual_m[i]).abs() < 1e-9);
                for (a, b) in own.slopes[i].iter().zip(plain.slopes[i]) {
                    assert!((a - b).abs() <= 1e-9 * (1.0 + b.abs()), "{a} {b}");
                }
            }
            if plain.facing.abs() < 0.05 {
                continue;
            }
            let automatic = landing(
                &Pose::new(dual).with_pose_errors(dual_errors),
                &lift(&sighting),
            );
            for i in 0..2 {
                assert!((automatic.residual_m[i].0 - plain.residual_m[i]).abs() < 1e-9);
                let scale: f64 = plain.slopes[i].iter().map(|d| d * d).sum::<f64>().sqrt();
                for k in 0..SLOPES {
                    let analytic = match k.checked_sub(7) {
                        None => plain.slopes[i][k],
                        Some(error) => plain.pose_slopes[i][error],
                    };
                    let apart = (automatic.residual_m[i].1[k] - analytic).abs() / scale;
                    worst = worst.max(apart);
                }
            }
        }
    }
    println!("worst relative difference {worst:e}");
    assert!(worst < 1e-14);
}
