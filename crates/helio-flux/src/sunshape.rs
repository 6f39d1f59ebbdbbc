//! How the light of the sun is spread over directions.

use core::f64::consts::{PI, TAU};

use crate::error::FluxError;

/// Half angle of the sun's disc \[rad\] at the mean distance of the earth, as Buie, Monger and Dey 2003 use it.
pub const SOLAR_HALF_ANGLE_RAD: f64 = 4.65e-3;

/// Where Buie, Monger and Dey 2003 end the aureole \[rad\].
const AUREOLE_END_RAD: f64 = 43.6e-3;

/// Knots over the sun's disc of a tabulated shape: the density between two changes by less than 0.3 %.
const DISC_KNOTS: usize = 512;

/// Part of a Gaussian cone's light that may be left outside [`SunShape::extent_rad`].
const GAUSSIAN_TAIL: f64 = 1e-9;

/// Radiance of the sun over the angle from its middle, the same all round, normalised so that its
/// integral over the solid angle is 1.
///
/// ```
/// use helio_flux::SunShape;
/// let sun = SunShape::pillbox(4.65e-3)?;
/// assert_eq!(sun.cumulative(4.65e-3), 1.0);
/// // Half of the light comes from within 1/√2 of the radius.
/// assert!((sun.quantile_rad(0.5) - 4.65e-3 / 2_f64.sqrt()).abs() < 1e-8);
/// # Ok::<(), helio_flux::FluxError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SunShape {
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Pillbox { h_edge: f64 },
    LimbDarkened { h_edge: f64 },
    Gaussian { variance: f64 },
    Buie(Box<Buie>),
}

/// The numbers of a Buie sun: Buie, Monger and Dey 2003, Solar Energy 74, 113-122.
#[derive(Debug, Clone, PartialEq)]
struct Buie {
    /// Light within each knot of the disc, of all the light.
    disc: Vec<f64>,
    /// Density at the middle \[1/sr\].
    middle_per_sr: f64,
    /// Aureole, in units of the middle's density: e^κ (θ / mrad)^γ.
    e_kappa: f64,
    gamma: f64,
}

impl SunShape {
    /// A disc of the same radiance all over.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] unless `half_angle_rad` lies above 0 and at most at 0.1.
    pub fn pillbox(half_angle_rad: f64) -> Result<Self, FluxError> {
        check_half_angle(half_angle_rad)?;
        let h_edge = versine(half_angle_rad);
        Ok(Self {
            kind: Kind::Pillbox { h_edge },
        })
    }

    /// A disc that darkens toward its limb: with x the angle over the half angle, the radiance is
    /// 0.36 + 0.84 √(1 - x²) - 0.20 (1 - x²) of that in the middle (Jose 1957, The flux through the image
    /// of the sun, Solar Energy 1, 19-22).
    ///
    /// # Errors
    /// As [`pillbox`](Self::pillbox).
    pub fn limb_darkened(half_angle_rad: f64) -> Result<Self, FluxError> {
        check_half_angle(half_angle_rad)?;
        let h_edge = versine(half_angle_rad);
        Ok(Self {
            kind: Kind::LimbDarkened { h_edge },
        })
    }

    /// A Gaussian cone of `sigma_rad` per axis: the density falls as exp(-(1 - cos θ) / σ²), which for small
    /// angles is exp(-θ² / 2σ²) and on the sphere has its integrals in closed form (Fisher 1953).
    ///
    /// # Errors
    /// [`FluxError::BadValue`] unless `sigma_rad` lies above 0 and at most at 0.1.
    pub fn gaussian(sigma_rad: f64) -> Result<Self, FluxError> {
        if !(sigma_rad > 0.0 && sigma_rad <= MAX_ANGLE_RAD) {
            return Err(bad("sigma_rad", "above 0 and at most 0.1 rad", sigma_rad));
        }
        let variance = sigma_rad * sigma_rad;
        Ok(Self {
            kind: Kind::Gaussian { variance },
        })
    }

    /// Disc and aureole after Buie, Monger and Dey 2003: with θ in mrad, cos(0.326 θ) / cos(0.308 θ) up to
    /// 4.65 and e^κ θ^γ up to 43.6.
    ///
    /// `circumsolar_ratio` is the part of all the light that comes from the aureole. The paper's κ and γ are
    /// functions of a ratio χ that differs from the one their profile then has; χ is solved for, so
    /// that the profile has the ratio asked for.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] unless the ratio lies in 0.01..=0.7.
    pub fn buie(circumsolar_ratio: f64) -> Result<Self, FluxError> {
        if !(0.01..=0.7).contains(&circumsolar_ratio) {
            let wanted = "within 0.01..=0.7";
            return Err(bad("circumsolar ratio", wanted, circumsolar_ratio));
        }
        let (mut low, mut high) = (1e-4, 0.95);
        for _ in 0..60 {
            let chi = 0.5 * (low + high);
            if Buie::of_chi(chi).1 < circumsolar_ratio {
                low = chi;
            } else {
                high = chi;
            }
        }
        let (buie, _) = Buie::of_chi(0.5 * (low + high));
        Ok(Self {
            kind: Kind::Buie(Box::new(buie)),
        })
    }

    /// Light per solid angle \[1/sr\] at an angle from the middle; 0 beyond the edge.
    #[must_use]
    pub fn density_per_sr(&self, angle_rad: f64) -> f64 {
        let h = versine(angle_rad);
        match &self.kind {
            Kind::Pillbox { h_edge } if h <= *h_edge => 1.0 / (TAU * h_edge),
            Kind::LimbDarkened { h_edge } if h <= *h_edge => {
                let w = 1.0 - h / h_edge;
                // The integral over the disc is 2π h_edge · 0.82.
                (0.36 + 0.84 * w.sqrt() - 0.20 * w) / (TAU * h_edge * 0.82)
            }
            Kind::Pillbox { .. } | Kind::LimbDarkened { .. } => 0.0,
            Kind::Gaussian { variance } => libm::exp(-h / variance) / (TAU * variance),
            Kind::Buie(buie) => {
                let angle_rad = angle_rad.abs();
                let profile = buie.profile(angle_rad);
                if angle_rad <= SOLAR_HALF_ANGLE_RAD {
                    return buie.middle_per_sr * profile;
                }
                // The paper integrates over θ dθ: per solid angle that is θ / sin θ.
                buie.middle_per_sr * profile * angle_rad / libm::sin(angle_rad)
            }
        }
    }

    /// The part of the light from within an angle of the middle.
    #[must_use]
    pub fn cumulative(&self, angle_rad: f64) -> f64 {
        if angle_rad.is_nan() || angle_rad <= 0.0 {
            return 0.0;
        }
        let h = versine(angle_rad.min(PI));
        match &self.kind {
            Kind::Pillbox { h_edge } => (h / h_edge).min(1.0),
            Kind::LimbDarkened { h_edge } => {
                let w = (1.0 - h / h_edge).max(0.0);
                1.0 - limb_darkened_beyond(w)
            }
            Kind::Gaussian { variance } => -libm::expm1(-h / variance),
            Kind::Buie(buie) => buie.cumulative(angle_rad),
        }
    }

    /// The angle \[rad\] within which a part of the light lies: the inverse of
    /// [`cumulative`](Self::cumulative). `part` is clamped to 0..=1; of a Gaussian cone the angle is at most
    /// [`extent_rad`](Self::extent_rad).
    #[must_use]
    pub fn quantile_rad(&self, part: f64) -> f64 {
        let part = if part > 0.0 { part.min(1.0) } else { 0.0 };
        match &self.kind {
            Kind::Pillbox { h_edge } => angle_of_versine(part * h_edge),
            Kind::LimbDarkened { h_edge } => {
                let root = limb_darkened_root(1.0 - part);
                angle_of_versine((1.0 - root * root) * h_edge)
            }
            Kind::Gaussian { variance } => {
                let part = part.min(1.0 - GAUSSIAN_TAIL);
                angle_of_versine(-libm::log1p(-part) * variance)
            }
            Kind::Buie(buie) => buie.quantile_rad(part),
        }
    }

    /// Where the disc ends and the aureole begins \[rad\]; of a sun without one, where it ends.
    pub(crate) fn knee_rad(&self) -> f64 {
        match &self.kind {
            Kind::Buie(_) => SOLAR_HALF_ANGLE_RAD,
            _ => self.extent_rad(),
        }
    }

    /// The angle \[rad\] beyond which there is no light; of a Gaussian cone, less than one part in 10⁹.
    #[must_use]
    pub fn extent_rad(&self) -> f64 {
        self.quantile_rad(1.0)
    }
}

const MAX_ANGLE_RAD: f64 = 0.1;

fn bad(what: &'static str, wanted: &'static str, value: f64) -> FluxError {
    FluxError::BadValue {
        who: "sun shape",
        what,
        wanted,
        value,
    }
}

fn check_half_angle(half_angle_rad: f64) -> Result<(), FluxError> {
    if half_angle_rad > 0.0 && half_angle_rad <= MAX_ANGLE_RAD {
        return Ok(());
    }
    let wanted = "above 0 and at most 0.1 rad";
    Err(bad("half_angle_rad", wanted, half_angle_rad))
}

/// 1 - cos θ, to full precision near 0. Solid angle is 2π times it.
fn versine(angle_rad: f64) -> f64 {
    let half = libm::sin(0.5 * angle_rad);
    2.0 * half * half
}

fn angle_of_versine(h: f64) -> f64 {
    2.0 * libm::asin((0.5 * h).sqrt().min(1.0))
}

/// Light of Jose's disc outside the circle where 1 - x² = w: ∫ (0.36 + 0.84 √w - 0.20 w) dw over 0.82.
fn limb_darkened_beyond(w: f64) -> f64 {
    w * (0.36 + 0.56 * w.sqrt() - 0.10 * w) / 0.82
}

/// The √w of [`limb_darkened_beyond`] for a part of the light, by Newton's method.
///
/// 0.36 r² + 0.56 r³ - 0.10 r⁴ is convex from 0 to 1, and at least 0.36 r²: from the root of that, which is on the right,
/// steps lead down to where rounding ends them.
fn limb_darkened_root(beyond: f64) -> f64 {
    const MOST_STEPS: usize = 60;
    if beyond >= 1.0 {
        return 1.0;
    }
    let wanted = 0.82 * beyond;
    let mut root = (wanted / 0.36).sqrt().min(1.0);
    for _ in 0..MOST_STEPS {
        let value = root * root * (0.36 + root * (0.56 - 0.10 * root));
        let slope = root * (0.72 + root * (1.68 - 0.40 * root));
        let next = root - (value - wanted) / slope;
        // No number, where the root is 0, ends it too.
        if next.is_nan() || next >= root {
            break;
        }
        root = next.max(0.0);
    }
    root
}

impl Buie {
    /// The profile of a χ, and the circumsolar ratio that it has.
    fn of_chi(chi: f64) -> (Self, f64) {
        // their eqs. for κ and γ
        let kappa = 0.9 * libm::log(13.5 * chi) * libm::pow(chi, -0.3);
        let gamma = 2.2 * libm::log(0.52 * chi) * libm::pow(chi, 0.43) - 0.1;
        let mut buie = Self {
            disc: Vec::with_capacity(DISC_KNOTS + 1),
            middle_per_sr: 1.0,
            e_kappa: libm::exp(kappa),
            gamma,
        };
        let mut sum = 0.0;
        buie.disc.push(sum);
        for knot in 0..DISC_KNOTS {
            // Simpson's rule in h = 1 - cos θ, of which the density is a smooth function
            let h = |at: f64| at / DISC_KNOTS as f64 * versine(SOLAR_HALF_ANGLE_RAD);
            let at = |k: f64| buie.profile(angle_of_versine(h(k)).min(SOLAR_HALF_ANGLE_RAD));
            let k = knot as f64;
            sum += TAU * h(1.0) / 6.0 * (at(k) + 4.0 * at(k + 0.5) + at(k + 1.0));
            buie.disc.push(sum);
        }
        let aureole = buie.aureole_within(AUREOLE_END_RAD);
        let all = sum + aureole;
        for knot in &mut buie.disc {
            *knot /= all;
        }
        buie.middle_per_sr = 1.0 / all;
        (buie, aureole / all)
    }

    /// Radiance over that of the middle.
    fn profile(&self, angle_rad: f64) -> f64 {
        let mrad = 1e3 * angle_rad;
        if angle_rad <= SOLAR_HALF_ANGLE_RAD {
            libm::cos(0.326 * mrad) / libm::cos(0.308 * mrad)
        } else if angle_rad <= AUREOLE_END_RAD {
            self.e_kappa * libm::pow(mrad, self.gamma)
        } else {
            0.0
        }
    }

    /// ∫ e^κ θ^γ 2πθ dθ from the disc's edge.
    fn aureole_within(&self, angle_rad: f64) -> f64 {
        let power = self.gamma + 2.0;
        let (from, to) = (1e3 * SOLAR_HALF_ANGLE_RAD, 1e3 * angle_rad);
        let ratio = libm::log(to / from);
        // (to^p - from^p) / p, also where p is near 0
        let integral = libm::pow(from, power)
            * if (power * ratio).abs() < 1e-12 {
                ratio
            } else {
                libm::expm1(power * ratio) / power
            };
        TAU * self.e_kappa * integral * 1e-6
    }

    fn cumulative(&self, angle_rad: f64) -> f64 {
        let of_disc = self.disc[DISC_KNOTS];
        if angle_rad >= SOLAR_HALF_ANGLE_RAD {
            let angle_rad = angle_rad.min(AUREOLE_END_RAD);
            return (of_disc + self.middle_per_sr * self.aureole_within(angle_rad)).min(1.0);
        }
        let at = versine(angle_rad) / versine(SOLAR_HALF_ANGLE_RAD) * DISC_KNOTS as f64;
        let knot = (at as usize).min(DISC_KNOTS - 1);
        let (low, high) = (self.disc[knot], self.disc[knot + 1]);
        low + (high - low) * (at - knot as f64)
    }

    fn quantile_rad(&self, part: f64) -> f64 {
        let of_disc = self.disc[DISC_KNOTS];
        if part > of_disc {
            let wanted = (part - of_disc) / self.middle_per_sr / (TAU * self.e_kappa * 1e-6);
            let power = self.gamma + 2.0;
            let from = 1e3 * SOLAR_HALF_ANGLE_RAD;
            let relative = wanted / libm::pow(from, power);
            let ratio = if (power * relative).abs() < 1e-12 {
                relative
            } else {
                libm::log1p(power * relative) / power
            };
            return (1e-3 * from * libm::exp(ratio)).min(AUREOLE_END_RAD);
        }
        let knot = self.disc.partition_point(|&light| light < part);
        let knot = knot.clamp(1, DISC_KNOTS);
        let (low, high) = (self.disc[knot - 1], self.disc[knot]);
        let at = (knot - 1) as f64 + (part - low) / (high - low);
        angle_of_versine(at / DISC_KNOTS as f64 * versine(SOLAR_HALF_ANGLE_RAD))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> Vec<(&'static str, SunShape)> {
        vec![
            ("pillbox", SunShape::pillbox(SOLAR_HALF_ANGLE_RAD).unwrap()),
            ("wide pillbox", SunShape::pillbox(0.1).unwrap()),
            ("jose", SunShape::limb_darkened(4.65e-3).unwrap()),
            ("gaussian", SunShape::gaussian(2.0e-3).unwrap()),
            ("buie 2 %", SunShape::buie(0.02).unwrap()),
            ("buie 30 %", SunShape::buie(0.3).unwrap()),
        ]
    }

    // The density, integrated over rings of solid angle by the midpoint rule, against the closed forms.
    #[test]
    fn densities_are_normalised_and_are_the_derivative_of_the_cumulative() {
        for (name, shape) in shapes() {
            let end = shape.extent_rad();
            let n = 200_000;
            let mut sum = 0.0;
            for k in 0..n {
                let angle = (f64::from(k) + 0.5) / f64::from(n) * end;
                sum += shape.density_per_sr(angle) * TAU * libm::sin(angle) * end / f64::from(n);
                if k % 9999 == 0 {
                    let edge = (f64::from(k) + 1.0) / f64::from(n) * end;
                    // what the midpoint rule leaves of the jump at the limb: half a step of Buie's disc
                    let error = (shape.cumulative(edge) - sum).abs();
                    assert!(error < 3e-5, "{name} at {edge}: {error:e}");
                }
            }
            assert!((sum - 1.0).abs() < 3e-5, "{name}: {sum}");
        }
    }

    #[test]
    fn the_quantile_is_the_inverse_of_the_cumulative() {
        for (name, shape) in shapes() {
            for k in 0..=1000 {
                let part = f64::from(k) / 1000.0;
                let back = shape.cumulative(shape.quantile_rad(part));
                assert!((back - part).abs() < 2e-9, "{name}: {part} {back}");
            }
            assert_eq!(shape.quantile_rad(f64::NAN), 0.0);
        }
    }

    #[test]
    fn a_buie_sun_has_the_circumsolar_ratio_asked_for() {
        for wanted in [0.01, 0.05, 0.1, 0.3, 0.5, 0.7] {
            let shape = SunShape::buie(wanted).unwrap();
            let got = 1.0 - shape.cumulative(SOLAR_HALF_ANGLE_RAD);
            assert!((got - wanted).abs() < 1e-9, "{wanted}: {got}");
        }
        // limb over middle of the disc: cos(1.5159) / cos(1.4322) = 0.3964
        let shape = SunShape::buie(0.05).unwrap();
        let limb = shape.density_per_sr(SOLAR_HALF_ANGLE_RAD) / shape.density_per_sr(0.0);
        assert!((limb - 0.396_4).abs() < 1e-3, "{limb}");
    }

    #[test]
    fn numbers_out_of_range_are_refused() {
        for value in [0.0, -1.0, 0.11, f64::NAN, f64::INFINITY] {
            assert!(SunShape::pillbox(value).is_err());
            assert!(SunShape::limb_darkened(value).is_err());
            assert!(SunShape::gaussian(value).is_err());
        }
        let error = SunShape::buie(0.9).unwrap_err().to_string();
        let text = "sun shape: circumsolar ratio must be within 0.01..=0.7, got 0.9";
        assert_eq!(error, text);
    }
}
