//! Random heliostats and their records, for the tests of the diagnosis.

#![allow(dead_code, clippy::unwrap_used, reason = "each test uses a part")]

use helio_calib::aiming::encoder_angles_rad;
use helio_calib::measures::beam_errors_mrad;
use helio_calib::random::Random;
use helio_calib::simulate::{Aiming, ErrorSpread, SimulateOptions, Simulated, simulate};
use helio_calib::{Mount, Observation, Parameters};
use helio_core::sun::SunSite;
use helio_core::{Enu, EnuUnit, MountAxes, PoseErrors, TargetPlane, TrackingMode};

pub const DAY_NS: i64 = 86_400_000_000_000;

/// A heliostat, what it looks at and what is wrong with it.
pub struct Heliostat {
    pub mount: Mount,
    pub truth: Parameters,
    pub targets: [TargetPlane; 2],
    pub site: SunSite,
    pub latitude_rad: f64,
    mode: TrackingMode,
}

impl Heliostat {
    pub fn draw(random: &mut Random) -> Self {
        let latitude_rad = random.between(25.0, 52.0).to_radians();
        let site = SunSite::new(latitude_rad, 0.1, 100.0).unwrap();
        let mode = match random.below(4) {
            0 | 1 => TrackingMode::AzimuthElevation,
            2 => TrackingMode::PitchRoll {
                axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
            },
            _ => TrackingMode::Polar { latitude_rad },
        };
        let pivot = Enu::new(
            random.between(-120.0, 120.0),
            random.between(60.0, 250.0),
            2.0,
        );
        let spread = ErrorSpread {
            pedestal_tilt_rad: 0.03,
            axis_nonorthogonality_rad: 0.02,
            mirror_tilt_rad: 0.02,
            azimuth_reference_rad: 3.0,
            elevation_reference_rad: 0.15,
        };
        let mirror_offset_m = random.between(0.0, 0.3);
        let truth = Parameters::new(&spread.draw(random), mirror_offset_m);
        let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0)).unwrap();
        let height = random.between(30.0, 60.0);
        Self {
            mount: Mount {
                axes: MountAxes::of(mode, EnuUnit::UP),
                pivot,
                mirror_offset_m,
                pose_errors: PoseErrors::NONE,
            },
            truth,
            targets: [
                TargetPlane::level(Enu::new(0.0, 0.0, height), north),
                TargetPlane::level(Enu::new(0.0, 0.0, height + 8.0), north),
            ],
            site,
            latitude_rad,
            mode,
        }
    }

    /// Another heliostat of the same kind, some metres away, with errors of a field set up with care.
    pub fn neighbour(&self, random: &mut Random) -> (Mount, Parameters) {
        let mut mount = self.mount;
        mount.pivot =
            mount.pivot + Enu::new(random.between(5.0, 12.0), random.between(5.0, 12.0), 0.0);
        let errors = ErrorSpread::default().draw(random);
        (mount, Parameters::new(&errors, mount.mirror_offset_m))
    }

    /// Options to simulate its records: spots anywhere on a board of 6 m by 6 m.
    pub fn options(&self, random: &mut Random) -> SimulateOptions {
        SimulateOptions {
            seed: random.next_u64(),
            aiming: Aiming::Board {
                half_width_m: 3.0,
                half_height_m: 3.0,
            },
            ..SimulateOptions::default()
        }
    }

    /// Its records. Nothing where the sun never stands as the options ask.
    pub fn observe(&self, options: &SimulateOptions) -> Option<Simulated> {
        simulate(&self.mount, &self.truth, &self.targets, &self.site, options).ok()
    }

    /// RMS over the suns of a year of the beam error \[mrad\] when it aims at the first target with
    /// parameters that were found while its axes really turn `bent` away from what the encoders say.
    pub fn year_error_mrad(&self, found: &Parameters, bent: &Bending) -> f64 {
        let mut sum = 0.0;
        let mut count = 0;
        for month in 0..12 {
            for hour in 0..24 {
                let unix_ns = SimulateOptions::default().to_unix_ns
                    + month * 30 * DAY_NS
                    + hour * DAY_NS / 24;
                let position = helio_core::sun::position(&self.site, unix_ns, None, 0.0).unwrap();
                if position.apparent_elevation_rad < 0.1745 {
                    continue;
                }
                let sun = position.direction();
                let plane = self.targets[0];
                let Some(axes) = encoder_angles_rad(&self.mount, found, sun, plane.centre) else {
                    continue;
                };
                let axes = bent.true_angles(axes);
                let seen = Observation::new(sun, axes[0], axes[1], plane, 0.0, 0.0);
                let error = beam_errors_mrad(&self.mount, &[seen], &self.truth)[0];
                // a beam that misses the target is very wrong
                sum += if error.is_finite() {
                    error * error
                } else {
                    1e6
                };
                count += 1;
            }
        }
        (sum / f64::from(count)).sqrt()
    }
}

/// What a mount does beyond six angles: its second axis sags, its first runs out of round.
#[derive(Debug, Clone, Copy, Default)]
pub struct Bending {
    pub sag_rad: f64,
    pub runout_rad: f64,
    pub phase_rad: f64,
}

impl Bending {
    pub fn draw(random: &mut Random, most_mrad: f64) -> Self {
        Self {
            sag_rad: 1e-3 * random.between(-most_mrad, most_mrad),
            runout_rad: 1e-3 * random.between(-most_mrad, most_mrad),
            phase_rad: random.between(0.0, 6.0),
        }
    }

    /// Axis angles of the six-angle mount that has the normal of the bent one at these encoder angles.
    pub fn true_angles(&self, [axis1, axis2]: [f64; 2]) -> [f64; 2] {
        [
            axis1 - self.runout_rad * (2.0 * axis1 + self.phase_rad).sin(),
            axis2 - self.sag_rad * (2.0 * axis2 + self.phase_rad).cos(),
        ]
    }

    /// Encoder angles of records whose normals are as simulated.
    pub fn bend(&self, observations: &mut [Observation]) {
        for o in observations {
            let wanted = [o.axis1_rad, o.axis2_rad];
            let mut axes = wanted;
            for _ in 0..4 {
                let got = self.true_angles(axes);
                axes = [axes[0] + wanted[0] - got[0], axes[1] + wanted[1] - got[1]];
            }
            [o.axis1_rad, o.axis2_rad] = axes;
        }
    }
}
