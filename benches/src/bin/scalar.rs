//! Peer: plain scalar Rust, the reduced form one heliostat after another with the standard library's
//! functions; the same steps as `peers/c_reduced.c`, variant `loop`.
//!
//! ```text
//! scalar --input FILE [--threads 1] [--repeat R] [--output ANSWERS]
//! ```
#![allow(clippy::print_stdout)]

use std::f64::consts::TAU;
use std::hint::black_box;
use std::path::Path;

use helio_bench::{Nanoseconds, Options, PeerInput, write_answers};
use helio_core::{Enu, Status};

const MIN_COS_INCIDENCE: f64 = 1e-6;

/// Constants of one heliostat, named as in `peers/common.py`.
struct Constants {
    target: Enu,
    two_slants: f64,
    tilt_north: f64,
    tilt_east: f64,
    tilt_w: f64,
    sec_tau1: f64,
    tan_tau1_sin_mu: f64,
    tan_tau1: f64,
    sin_mu_sec_tau1: f64,
    azimuth_reference_rad: f64,
    elevation_reference_rad: f64,
    axis1_rad: [f64; 2],
    axis2_rad: [f64; 2],
}

impl Constants {
    fn new(columns: &[Vec<f64>], row: usize) -> Self {
        let at = |column: usize| columns[column][row];
        let aim = Enu::new(at(0), at(1), at(2));
        let slant_m = aim.dot(aim).sqrt();
        let (tilt, tau1, mu) = (at(5).sin(), at(6), at(7));
        Self {
            target: aim * (1.0 / slant_m),
            two_slants: 2.0 * slant_m / at(3),
            tilt_north: tilt * at(4).cos(),
            tilt_east: tilt * at(4).sin(),
            tilt_w: 1.0 / (1.0 + at(5).cos()),
            sec_tau1: 1.0 / tau1.cos(),
            tan_tau1_sin_mu: tau1.tan() * mu.sin(),
            tan_tau1: tau1.tan(),
            sin_mu_sec_tau1: mu.sin() / tau1.cos(),
            azimuth_reference_rad: at(8).rem_euclid(TAU),
            elevation_reference_rad: at(9),
            axis1_rad: [at(10), at(11)],
            axis2_rad: [at(12), at(13)],
        }
    }

    /// Azimuth, elevation, incidence and status.
    fn track(&self, sun: Enu) -> ([f64; 3], Status) {
        let t = self.target;
        let cos_two_theta = sun.dot(t);
        let sin_squared = 0.5 - 0.5 * cos_two_theta;
        let cos_theta = (0.5 + 0.5 * cos_two_theta).sqrt();
        // (9): ratio = C / (2L/Hz C - cos(theta)), C = sqrt(1 - ratio^2 sin(theta)^2), from C = 1
        let mut ratio = 1.0 / (self.two_slants - cos_theta);
        let mut cos_tau = 1.0;
        for _ in 0..2 {
            cos_tau = (1.0 - ratio * ratio * sin_squared).sqrt();
            ratio = cos_tau / (self.two_slants * cos_tau - cos_theta);
        }
        let cos_incidence = cos_tau * cos_theta - ratio * sin_squared;
        // (16)
        let sun_part = 0.5 * (cos_tau / cos_theta - ratio);
        let target_part = sun_part + ratio;
        let n = sun * sun_part + t * target_part;
        // c = A n
        let (p, q, w) = (self.tilt_north, self.tilt_east, self.tilt_w);
        let tilt = p * n.north + q * n.east;
        let lift = n.up + w * tilt;
        let c1 = n.north - p * lift;
        let c2 = n.east - q * lift;
        let c3 = n.up * (1.0 - w * (p * p + q * q)) + tilt;
        // (22)-(27)
        let d2 = self.sin_mu_sec_tau1 - self.tan_tau1 * c3;
        let d1_squared = c1 * c1 + c2 * c2 - d2 * d2;
        let d1 = d1_squared.max(0.0).sqrt();
        let rise = c3 * self.sec_tau1 - self.tan_tau1_sin_mu;
        let elevation = rise.atan2(d1) + self.elevation_reference_rad;
        let mut azimuth = (c2 * d1 - c1 * d2).atan2(c1 * d1 + c2 * d2) + self.azimuth_reference_rad;
        if azimuth < 0.0 {
            azimuth += TAU;
        }
        if azimuth >= TAU {
            azimuth -= TAU;
        }
        let within = |angle: f64, [min, max]: [f64; 2]| min <= angle && angle <= max;
        let status = if cos_incidence.is_nan() || cos_incidence <= MIN_COS_INCIDENCE {
            Status::SunOpposesAim
        } else if d1_squared < 0.0 {
            Status::Unreachable
        } else if !within(azimuth, self.axis1_rad) || !within(elevation, self.axis2_rad) {
            Status::OutsideLimits
        } else {
            return ([azimuth, elevation, 0.5 * cos_two_theta.acos()], Status::Ok);
        };
        ([f64::NAN; 3], status)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = Options::from_arguments(&["input", "threads", "repeat", "output"])?;
    let input = PeerInput::read(options.path("input")?)?;
    if options.number("threads", 1)? != 1 {
        return Err("scalar: one thread only".into());
    }
    let n = input.len();
    let sun = input.sun.as_enu();
    let constants: Vec<Constants> = (0..n)
        .map(|row| Constants::new(&input.columns, row))
        .collect();
    let mut angles: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; n]);
    let mut status = vec![0_u8; n];
    let [azimuth, elevation, incidence] = &mut angles;
    let mut track = || {
        for (row, constants) in constants.iter().enumerate() {
            let ([azimuth_rad, elevation_rad, incidence_rad], code) = constants.track(sun);
            azimuth[row] = azimuth_rad;
            elevation[row] = elevation_rad;
            incidence[row] = incidence_rad;
            status[row] = code.code();
        }
        black_box((&azimuth, &elevation, &incidence, &status));
    };
    track();
    let time = Nanoseconds::of(options.number("repeat", 11)?, track);
    if let Some(path) = options.text("output") {
        let [azimuth, elevation, incidence] = &angles;
        write_answers(Path::new(path), &[azimuth, elevation, incidence], &status)?;
    }
    println!(
        "{{\"peer\": \"rust_scalar\", \"version\": \"{}\", \"n\": {n}, \"threads\": 1, \
         \"ns_per_heliostat\": {}}}",
        env!("CARGO_PKG_VERSION"),
        time.json(n)
    );
    Ok(())
}
