//! Synthetic campaigns for tests, by rotation matrices as the theory writes them: nothing of the code under
//! test goes in.

#![allow(dead_code, reason = "each test file uses a part")]
#![allow(clippy::unwrap_used, reason = "tests fail")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use helio_calib::{Mount, Observation, Parameters};
use helio_core::{Enu, EnuUnit, MountAxes, MountErrors, PoseErrors, TargetPlane, TrackingMode};

/// splitmix64 (Steele, Lea, Flood 2014).
pub struct Rng(u64);

impl Rng {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x2545_f491_4f6c_dd1d))
    }

    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub fn within(&mut self, size: f64) -> f64 {
        self.range(-size, size)
    }

    /// Standard normal (Box, Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (TAU * self.unit()).cos()
    }
}

/// The errors of issue 3: tilt to 2°, non-orthogonality to 5°, mirror tilt to 2°, references to ±180° and ±10°.
pub fn errors(rng: &mut Rng) -> MountErrors {
    let deg = f64::to_radians;
    MountErrors {
        pedestal_tilt_rad: rng.range(0.0, deg(2.0)),
        pedestal_tilt_azimuth_rad: rng.range(0.0, TAU),
        axis_nonorthogonality_rad: rng.within(deg(5.0)),
        mirror_tilt_rad: rng.within(deg(2.0)),
        azimuth_reference_rad: rng.within(PI),
        elevation_reference_rad: rng.within(deg(10.0)),
    }
}

/// A heliostat north of its tower, and the target on the tower.
pub struct Place {
    pub mount: Mount,
    pub plane: TargetPlane,
}

pub fn place(rng: &mut Rng, mode: TrackingMode) -> Place {
    let distance = rng.range(50.0, 400.0);
    let azimuth = rng.within(70_f64.to_radians());
    let pivot = Enu::new(
        distance * azimuth.sin(),
        distance * azimuth.cos(),
        rng.range(1.0, 5.0),
    );
    let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0)).unwrap();
    let plane = TargetPlane::level(Enu::new(0.0, 0.0, rng.range(25.0, 120.0)), north);
    let to_centre = EnuUnit::try_new(plane.centre - pivot).unwrap();
    Place {
        mount: Mount {
            axes: MountAxes::of(mode, to_centre),
            pivot,
            mirror_offset_m: rng.range(0.1, 0.4),
            pose_errors: PoseErrors::NONE,
        },
        plane,
    }
}

/// The sun over 37° north, if at least 10° up; hour angle west positive.
pub fn sun_at(declination_rad: f64, hour_rad: f64) -> Option<EnuUnit> {
    let (sin_l, cos_l) = 37_f64.to_radians().sin_cos();
    let (sin_d, cos_d) = declination_rad.sin_cos();
    let south = cos_d * hour_rad.cos() * sin_l - sin_d * cos_l;
    let up = sin_d * sin_l + cos_d * hour_rad.cos() * cos_l;
    let west = cos_d * hour_rad.sin();
    let high = up > 10_f64.to_radians().sin();
    high.then(|| EnuUnit::try_new(Enu::new(-west, -south, up)).unwrap())
}

/// A sun of a random day and hour.
pub fn sun(rng: &mut Rng) -> EnuUnit {
    loop {
        let declination = 23.4_f64.to_radians() * (TAU * rng.unit()).sin();
        let hour = rng.within(75_f64.to_radians());
        if let Some(sun) = sun_at(declination, hour) {
            return sun;
        }
    }
}

type M3 = [[f64; 3]; 3];

fn times(a: &M3, v: [f64; 3]) -> [f64; 3] {
    a.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// B2 and B3 of theory §1.
fn about2(x: f64) -> M3 {
    let (s, c) = x.sin_cos();
    [[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]
}

fn about3(x: f64) -> M3 {
    let (s, c) = x.sin_cos();
    [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
}

fn along(axes: &MountAxes, v: Enu) -> [f64; 3] {
    [axes.axis1.dot(v), axes.axis2.dot(v), axes.axis3.dot(v)]
}

/// Encoder angles for a normal, Guo 2015 (22)-(27), direct solution; nothing in a blind cone.
pub fn encoders(axes: &MountAxes, e: &MountErrors, normal: Enu) -> Option<(f64, f64)> {
    let n = along(axes, normal);
    // c = B3(-psi_a) B2(psi_t) B3(psi_a) n
    let turned = times(&about3(e.pedestal_tilt_azimuth_rad), n);
    let tilted = times(&about2(e.pedestal_tilt_rad), turned);
    let c = times(&about3(-e.pedestal_tilt_azimuth_rad), tilted);
    let (sin_tau, cos_tau) = e.axis_nonorthogonality_rad.sin_cos();
    let (sin_mu, cos_mu) = e.mirror_tilt_rad.sin_cos();
    let sin_alpha = (c[2] - sin_tau * sin_mu) / (cos_tau * cos_mu);
    let d2 = cos_tau * sin_mu - sin_tau * cos_mu * sin_alpha;
    let d1 = (c[0] * c[0] + c[1] * c[1] - d2 * d2).sqrt();
    if d1.is_nan() {
        return None;
    }
    let alpha = sin_alpha.atan2(d1 / cos_mu);
    let gamma = (c[1] * d1 - c[0] * d2).atan2(c[0] * d1 + c[1] * d2);
    Some((
        gamma + e.azimuth_reference_rad,
        alpha + e.elevation_reference_rad,
    ))
}

/// An observation whose beam, without noise, hits the plane at a point; nothing if the heliostat cannot.
pub fn observe(
    mount: &Mount,
    truth: &MountErrors,
    plane: &TargetPlane,
    sun: EnuUnit,
    [u, v]: [f64; 2],
) -> Option<Observation> {
    let aim = plane.point(u, v) - mount.pivot;
    let s = sun.as_enu();
    let mut n = EnuUnit::try_new(s + EnuUnit::try_new(aim).ok()?.as_enu()).ok()?;
    for _ in 0..20 {
        let beam = EnuUnit::try_new(aim - n.as_enu() * mount.mirror_offset_m).ok()?;
        n = EnuUnit::try_new(s + beam.as_enu()).ok()?;
    }
    let (axis1, axis2) = encoders(&mount.axes, truth, n.as_enu())?;
    let (gamma, alpha) = (
        axis1 - truth.azimuth_reference_rad,
        axis2 - truth.elevation_reference_rad,
    );
    // How high a perfect mount's normal points, and what it gains with either angle.
    let g = [
        mount.axes.axis1.up,
        mount.axes.axis2.up,
        mount.axes.axis3.up,
    ];
    let height = |gamma: f64, alpha: f64| {
        alpha.cos() * (gamma.cos() * g[0] + gamma.sin() * g[1]) + alpha.sin() * g[2]
    };
    let gain1 = 0.5 * (height(gamma + FRAC_PI_2, alpha) - height(gamma - FRAC_PI_2, alpha));
    let gain2 = height(gamma, alpha + FRAC_PI_2);
    let axis1 = axis1 + mount.pose_errors.axis1_sag_rad * gain1;
    let eccentricity = mount.pose_errors.axis2_eccentricity_rad * alpha.sin();
    let axis2 = axis2 + mount.pose_errors.axis2_sag_rad * gain2 - eccentricity;
    Some(Observation::new(sun, axis1, axis2, *plane, u, v))
}

/// Observations of random suns and aims within 1 m, with noise per component in mrad of the slant.
pub fn campaign(
    rng: &mut Rng,
    place: &Place,
    truth: &MountErrors,
    records: usize,
    noise_mrad: f64,
) -> Vec<Observation> {
    let slant = (place.plane.centre - place.mount.pivot).norm();
    let mut seen = Vec::with_capacity(records);
    while seen.len() < records {
        let aim = [rng.within(1.0), rng.within(1.0)];
        let at = sun(rng);
        if let Some(mut record) = observe(&place.mount, truth, &place.plane, at, aim) {
            record.u_m += 1e-3 * noise_mrad * slant * rng.normal();
            record.v_m += 1e-3 * noise_mrad * slant * rng.normal();
            seen.push(record);
        }
    }
    seen
}

/// The truth as parameters.
pub fn parameters(mount: &Mount, truth: &MountErrors) -> Parameters {
    Parameters::new(truth, mount.mirror_offset_m)
}
