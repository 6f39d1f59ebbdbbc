//! The mirror-centre normal, Guo 2015 §2, in double-double.

use crate::V3;
use crate::dd::{Dd, Dd3};

/// Sun, aim and the normal between them.
#[derive(Debug, Clone, Copy)]
pub struct Truth {
    /// Unit vector to the sun.
    pub s: Dd3,
    /// Unit vector pivot to aim.
    pub t: Dd3,
    /// Pivot to aim \[m\].
    pub slant_m: Dd,
    /// cos(theta) = |s + t|/2.
    pub cos_theta: Dd,
    /// sin(theta) = |s - t|/2.
    pub sin_theta: Dd,
    /// The unit normal.
    pub n: Dd3,
}

impl Truth {
    /// Half the sun-aim angle \[rad\].
    #[must_use]
    pub fn incidence_rad(&self) -> f64 {
        self.sin_theta.value().atan2(self.cos_theta.value())
    }

    /// cos(theta*), the cosine of incidence at the mirror's centre.
    #[must_use]
    pub fn cos_at_mirror(&self) -> f64 {
        self.s.dot(self.n).value()
    }

    /// tau, by which the normal leans from the bisector toward the aim \[rad\].
    #[must_use]
    pub fn tau_rad(&self) -> f64 {
        let bisector = self.s.plus(self.t).value();
        let n = self.n.value();
        let size = bisector.angle_to(n);
        if self.t.minus(self.s).dot(self.n).value() >= 0.0 {
            size
        } else {
            -size
        }
    }
}

/// The normal that sends the sun to the aim exactly: Newton's method on eq. (9),
/// (L/Hz) sin(2 tau) = sin(theta + tau), put into the robust form (16).
///
/// `None` where sun and aim are opposite, the aim no farther than the mirror, or Newton does not
/// settle.
#[must_use]
pub fn exact(pivot: V3, aim: V3, mirror_offset_m: f64, sun: V3) -> Option<Truth> {
    let to_aim = Dd3::new(aim).minus(Dd3::new(pivot));
    let slant_m = to_aim.norm();
    if slant_m.value() <= mirror_offset_m.abs() || slant_m.value() == 0.0 {
        return None;
    }
    solve(
        Dd3::new(sun).unit(),
        to_aim.unit(),
        slant_m,
        mirror_offset_m,
    )
}

fn solve(s: Dd3, t: Dd3, slant_m: Dd, mirror_offset_m: f64) -> Option<Truth> {
    let half = Dd::new(0.5);
    let mean = s.plus(t).scaled(half);
    let difference = t.minus(s).scaled(half);
    let cos_theta = mean.norm();
    let sin_theta = difference.norm();
    if cos_theta.value() < 1e-20 {
        return None;
    }
    let h = Dd::new(mirror_offset_m) / slant_m;
    // With y = sin(tau), C = cos(tau): F = 2 y C - h (sin(theta) C + cos(theta) y) = 0.
    // Start from eq. (8).
    let one = Dd::new(1.0);
    let mut y = h * sin_theta / (Dd::new(2.0) - h * cos_theta);
    let mut settled = false;
    for _ in 0..200 {
        let c = (one - y * y).sqrt();
        let residual = Dd::new(2.0) * y * c - h * (sin_theta * c + cos_theta * y);
        let (yv, cv) = (y.value(), c.value());
        let slope = 2.0 * (cv - yv * yv / cv)
            - h.value() * (cos_theta.value() - sin_theta.value() * yv / cv);
        let mut step = residual.value() / slope;
        if !step.is_finite() {
            return None;
        }
        step = step.clamp(-0.1, 0.1);
        y = y - Dd::new(step);
        if y.value().abs() >= 1.0 {
            return None;
        }
        if step.abs() < 1e-26 {
            settled = true;
            break;
        }
    }
    if !settled {
        return None;
    }
    let c = (one - y * y).sqrt();
    // sin(tau)/sin(theta) from (9) itself: nothing is divided by sin(theta).
    let k = h * c / (Dd::new(2.0) * c - h * cos_theta);
    let n = mean.scaled(c / cos_theta).plus(difference.scaled(k));
    Some(Truth {
        s,
        t,
        slant_m,
        cos_theta,
        sin_theta,
        n,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    // What defines the normal: a ray from the sun, mirrored where the mirror's centre is, meets the aim.
    #[test]
    fn the_beam_meets_the_aim() {
        let mut rng = crate::Rng::new(2);
        let mut worst = 0.0_f64;
        for _ in 0..20_000 {
            let (sun, t) = (rng.direction(), rng.direction());
            if sun.dot(t) < -0.9995 {
                continue;
            }
            let pivot = rng.direction() * rng.range(0.0, 500.0);
            let slant = rng.log_range(2.0, 1000.0);
            let offset = rng.within(slant / 3.0);
            let aim = pivot + t * slant;
            let truth = exact(pivot, aim, offset, sun).unwrap();
            assert!((truth.n.norm().value() - 1.0).abs() < 1e-25);
            let cos = truth.s.dot(truth.n);
            let beam = truth.n.scaled(cos + cos).minus(truth.s);
            let centre = truth.n.scaled(Dd::new(offset));
            let to_aim = Dd3::new(aim).minus(Dd3::new(pivot)).minus(centre).unit();
            worst = worst.max(to_aim.minus(beam).value().norm());
        }
        assert!(worst < 1e-25, "{worst:e}");
    }
}
