//! The mirror-centre normal with a mirror-pivot offset (Guo 2015 §2, Shen 2016).
//!
//! When the mirror's centre M stands off the crossing of the axes O by Hz along the normal, it moves
//! as the mirror turns, and the normal that sends the sun to the aim depends on itself. With theta
//! half the angle between sun and aim as seen from O, and L the distance to the aim, the normal
//! leans from the bisector toward the aim by tau,
//!
//! ```text
//! (L/Hz) sin(2 tau) = sin(theta + tau)                                          Guo 2015 (9)
//! n = cos(tau)/cos(theta) (s+t)/2 + sin(tau)/sin(theta) (t-s)/2                 Guo 2015 (16)
//! ```

mod quartic;

pub use quartic::tau_by_quartic_rad;

/// How the mirror-pivot offset is taken into account.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum OffsetForm {
    /// The solution of Guo 2015 eq. (9) to the last digit: by the power series of Newton's limit where
    /// L/Hz is at least 12, by Newton's method within a bracket below.
    #[default]
    Exact,
    /// Guo 2015 eq. (8): within 2.50e-5° for L/Hz >= 15 and theta up to 70° (fig. 4).
    Approximate,
    /// Shen 2016 eq. (11): reflect from where the mirror's centre was found to be, this many times.
    /// Each time wins about two digits where L/Hz is some ten or more; from about 2 down it need not
    /// converge at all, and nothing says so: use [`Exact`](Self::Exact) there.
    Iterated(u32),
    /// As if the mirror turned about its own centre.
    None,
}

/// Most iterations of [`OffsetForm::Iterated`] that are accepted.
pub const MAX_ITERATIONS: u32 = 64;
