//! Random heliostats and suns.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use helio_core::{AxisLimits, EnuUnit, Field, Heliostat, MountErrors, PoseErrors, TrackingMode};

use crate::dd::Dd3;
use crate::{Rng, V3, mount};

/// The four modes, and the polar one also south of the equator, numbered 0 to 4; `angle` sets what
/// a mode needs besides.
#[must_use]
pub fn mode(number: usize, angle: f64) -> TrackingMode {
    match number {
        0 => TrackingMode::AzimuthElevation,
        1 => TrackingMode::SpinningElevation,
        2 => TrackingMode::PitchRoll {
            axis_azimuth_rad: 3.0 * angle,
        },
        3 => TrackingMode::Polar {
            latitude_rad: angle,
        },
        _ => TrackingMode::Polar {
            latitude_rad: -angle,
        },
    }
}

/// How many modes [`mode`] numbers.
pub const MODES: usize = 5;

/// Errors up to tilt 10°, non-orthogonality 6°, mirror tilt 3°, references anything.
pub fn large_errors(rng: &mut Rng) -> MountErrors {
    MountErrors {
        pedestal_tilt_rad: rng.range(0.0, 10_f64.to_radians()),
        pedestal_tilt_azimuth_rad: rng.range(0.0, TAU),
        axis_nonorthogonality_rad: rng.within(6_f64.to_radians()),
        mirror_tilt_rad: rng.within(3_f64.to_radians()),
        azimuth_reference_rad: rng.within(PI),
        elevation_reference_rad: rng.within(PI),
    }
}

/// A sun above the horizon.
pub fn sun(rng: &mut Rng) -> EnuUnit {
    loop {
        let d = rng.direction();
        let d = V3(d.0, d.1, d.2.abs());
        if let Ok(sun) = EnuUnit::try_new(d.enu()) {
            return sun;
        }
    }
}

/// What kind of heliostat to draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Any incidence from 0 to 89°, slant 15 to 2000 times the offset.
    Anywhere,
    /// The same with L/Hz = 15 to 15.1.
    NearField,
    /// The normal just outside a blind cone.
    BesideCone,
    /// Incidence below a milliradian, down to 1e-9.
    Retro,
    /// Incidence 80° to 89°.
    Grazing,
    /// Nearer than the papers go: L/|Hz| from 1.5 to 15, either sign of the offset.
    VeryNear,
}

/// All kinds.
pub const KINDS: [Kind; 6] = [
    Kind::Anywhere,
    Kind::NearField,
    Kind::BesideCone,
    Kind::Retro,
    Kind::Grazing,
    Kind::VeryNear,
];

/// A heliostat with large errors, not limited, whose wanted normal exists: drawn from the normal
/// back to the aim.
pub fn heliostat(rng: &mut Rng, kind: Kind, mode: TrackingMode, sun: V3) -> Heliostat {
    let pivot = V3(rng.within(800.0), rng.within(800.0), rng.within(30.0));
    loop {
        let errors = large_errors(rng);
        let incidence = match kind {
            Kind::Retro => rng.log_range(1e-9, 1e-3),
            Kind::Grazing => rng.range(80_f64.to_radians(), 89_f64.to_radians()),
            _ => rng.range(0.0, 89_f64.to_radians()),
        };
        let normal_at = |rng: &mut Rng, incidence: f64| {
            let around = sun.any_square().rotated(sun, rng.range(0.0, TAU));
            (sun * incidence.cos() + around * incidence.sin()).unit()
        };
        let beside = rng.log_range(1e-13, 1e-2);
        let (tau1, mu) = (errors.axis_nonorthogonality_rad, errors.mirror_tilt_rad);
        let n = match (kind, mode) {
            (Kind::BesideCone, TrackingMode::SpinningElevation) => {
                // the fixed axis looks at the aim, so the cone is about small incidences
                normal_at(rng, (tau1 - mu).abs() + beside)
            }
            (Kind::BesideCone, _) => {
                let axis = mount::leaning(mode, Dd3::new(sun), &errors).fixed.value();
                let (axis, half) = if rng.chance(0.5) {
                    (axis, (tau1 - mu).abs())
                } else {
                    (-axis, (tau1 + mu).abs())
                };
                let around = axis.any_square().rotated(axis, rng.range(0.0, TAU));
                let polar = half + beside;
                (axis * polar.cos() + around * polar.sin()).unit()
            }
            _ => normal_at(rng, incidence),
        };
        if sun.dot(n) < 89_f64.to_radians().cos() {
            continue;
        }
        let errors = match (kind, mode) {
            (Kind::BesideCone, TrackingMode::SpinningElevation) => MountErrors {
                pedestal_tilt_rad: 0.0,
                ..errors
            },
            _ => errors,
        };
        let mirror_offset_m = match kind {
            Kind::VeryNear => rng.within(1.0),
            _ => rng.range(0.01, 1.0),
        };
        let ratio = match kind {
            Kind::NearField => rng.range(15.0, 15.1),
            Kind::VeryNear => rng.log_range(1.5, 15.0),
            _ => rng.log_range(15.0, 2000.0),
        };
        let beam = n * (2.0 * sun.dot(n)) - sun;
        let aim = pivot + n * mirror_offset_m + beam * (ratio * mirror_offset_m.abs());
        let heliostat = Heliostat {
            mirror_offset_m,
            errors,
            ..Heliostat::new(pivot.enu(), aim.enu())
        };
        // What rounding and the offset made of it must still be a case.
        let to_aim = aim - pivot;
        if to_aim.norm() < 1.4 * mirror_offset_m.abs() {
            continue;
        }
        let Some(truth) = crate::normal::exact(pivot, aim, mirror_offset_m, sun) else {
            continue;
        };
        if mount::cone_margin(mode, truth.t, &errors, truth.n) < 1e-14
            || truth.cos_theta.value() < 89_f64.to_radians().cos()
        {
            continue;
        }
        return heliostat;
    }
}

/// A field of some heliostats.
///
/// # Panics
/// If the crate refuses one.
#[must_use]
pub fn field(mode: TrackingMode, heliostats: &[Heliostat]) -> Field {
    let mut field = Field::new(mode);
    for (row, heliostat) in heliostats.iter().enumerate() {
        if let Err(error) = field.push(&row.to_string(), *heliostat) {
            panic!("{error}");
        }
    }
    field
}

/// Gives four heliostats in five pose errors, one or some, up to the most that is accepted.
pub fn pose_errors(rng: &mut Rng, heliostats: &mut [Heliostat]) {
    for h in heliostats {
        let mut some = |chance: f64| {
            if rng.chance(chance) {
                rng.within(PoseErrors::MAX_RAD)
            } else {
                0.0
            }
        };
        h.pose_errors = PoseErrors {
            axis1_sag_rad: some(0.4),
            axis2_sag_rad: some(0.5),
            axis2_eccentricity_rad: some(0.4),
        };
    }
}

/// Limits of axis 2 that hold every over-the-top solution and, but for its ends, no direct one.
#[must_use]
pub fn over_the_top(errors: &MountErrors) -> AxisLimits {
    AxisLimits {
        axis2_min_rad: errors.elevation_reference_rad + FRAC_PI_2,
        axis2_max_rad: errors.elevation_reference_rad + 3.0 * FRAC_PI_2,
        ..AxisLimits::NONE
    }
}

/// A heliostat to which anything may happen: any aim, blind cones, an aim opposite the sun or at the
/// pivot, near fields, and limits of every kind.
pub fn messy(rng: &mut Rng, mode: TrackingMode, sun: V3) -> Heliostat {
    let pivot = V3(rng.within(800.0), rng.within(800.0), rng.within(30.0));
    let mut errors = large_errors(rng);
    if rng.chance(0.1) {
        errors.axis_nonorthogonality_rad = 0.0;
        errors.mirror_tilt_rad = 0.0;
    }
    let mut mirror_offset_m = match rng.below(10) {
        0 => 0.0,
        1 => rng.within(2.0),
        _ => rng.range(0.0, 0.6),
    };
    let which = rng.unit();
    let to_aim = if which < 0.55 {
        rng.direction() * rng.log_range(3.0, 2000.0)
    } else if which < 0.70 {
        // opposite the sun, more or less
        let aside = rng.log_range(1e-8, 0.3);
        let t = (-sun).rotated(sun.any_square().rotated(sun, rng.range(0.0, TAU)), aside);
        let near = rng.chance(0.7);
        t * if near {
            mirror_offset_m.abs().max(0.01) * rng.log_range(1.001, 30.0)
        } else {
            500.0
        }
    } else if which < 0.80 {
        // at the pivot, more or less
        if mirror_offset_m == 0.0 || rng.chance(0.05) {
            if rng.chance(0.5) {
                V3(0.0, 0.0, 0.0)
            } else {
                rng.direction() * 0.01
            }
        } else {
            let room = rng.log_range(1e-11, 0.99) * if rng.chance(0.5) { 1.0 } else { -1.0 };
            rng.direction() * (mirror_offset_m.abs() * (1.0 + room))
        }
    } else {
        // in and about a blind cone
        mirror_offset_m = if rng.chance(0.5) {
            0.0
        } else {
            mirror_offset_m.abs()
        };
        let slant_m = rng.log_range(10.0, 1000.0);
        match mode {
            TrackingMode::SpinningElevation => {
                let around = sun.any_square().rotated(sun, rng.range(0.0, TAU));
                sun.rotated(around, rng.range(2e-3, 0.4)) * slant_m
            }
            _ => {
                let axis = mount::leaning(mode, Dd3::new(sun), &errors).fixed.value();
                let axis = if axis.dot(sun) >= 0.0 { axis } else { -axis };
                let around = axis.any_square().rotated(axis, rng.range(0.0, TAU));
                let (tau1, mu) = (errors.axis_nonorthogonality_rad, errors.mirror_tilt_rad);
                // without a cone the first angle is ill-determined there by nature
                let least = if tau1 == 0.0 && mu == 0.0 { 1e-3 } else { 1e-8 };
                let off = rng.log_range(least, 0.2) * if rng.chance(0.5) { 1.0 } else { -1.0 };
                let half = if rng.chance(0.5) {
                    (tau1 - mu).abs()
                } else {
                    (tau1 + mu).abs()
                };
                let n = axis.rotated(around, half + off);
                (n * (2.0 * sun.dot(n)) - sun) * slant_m
            }
        }
    };
    let aim = pivot + to_aim;
    Heliostat {
        mirror_offset_m,
        errors,
        limits: random_limits(rng),
        ..Heliostat::new(pivot.enu(), aim.enu())
    }
}

/// None, on one side, or two-sided from a few degrees to some turns.
pub fn random_limits(rng: &mut Rng) -> AxisLimits {
    let mut axis = |least: f64, greatest: f64| {
        let middle = rng.within(2.5 * TAU);
        let half = 0.5 * rng.log_range(least, greatest);
        match rng.below(10) {
            0..=2 => (f64::NEG_INFINITY, f64::INFINITY),
            3 => (middle, f64::INFINITY),
            4 => (f64::NEG_INFINITY, middle),
            _ => (middle - half, middle + half),
        }
    };
    let (axis1_min_rad, axis1_max_rad) = axis(0.5, 4.0 * TAU);
    let (axis2_min_rad, axis2_max_rad) = axis(0.5, 2.0 * TAU);
    AxisLimits {
        axis1_min_rad,
        axis1_max_rad,
        axis2_min_rad,
        axis2_max_rad,
    }
}
