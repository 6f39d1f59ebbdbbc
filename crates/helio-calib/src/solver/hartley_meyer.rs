//! Hartley-Meyer: the step is halved until S falls enough (Guo 2015 §4.4).

use super::Trial;

/// beta_b: the share of the slope that S must follow.
const DESCENT_SHARE: f64 = 1e-5;
/// Shortest part of a step that is tried.
const MIN_PART: f64 = 1.0 / (1_u64 << 40) as f64;

/// The first of 1, 1/2, 1/4 … with S' < S + 2 beta_a beta_b dx·g. Near the optimum both sides agree to
/// rounding: `tolerance` keeps a good step from being halved for nothing, which costs a third of all
/// iterations.
pub(super) fn search(
    sum_of: impl Fn(f64) -> f64,
    sum: f64,
    descent: f64,
    tolerance: f64,
) -> Option<Trial> {
    let mut part = 1.0;
    while part >= MIN_PART {
        let trial = sum_of(part);
        // NaN and infinity fail
        if trial <= sum + 2.0 * part * DESCENT_SHARE * descent + tolerance {
            return Some(Trial { part, sum: trial });
        }
        part *= 0.5;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_until_it_falls_and_gives_up_at_the_floor() {
        // S = (1 - 3 a)²: at 1 it is 4 times the start, at 1/2 a quarter
        let found = search(|a| (1.0 - 3.0 * a).powi(2), 1.0, -1.0, 0.0).map(|t| t.part);
        assert_eq!(found, Some(0.5));
        assert!(search(|_| f64::INFINITY, 1.0, -1.0, 0.0).is_none());
        assert!(search(|_| f64::NAN, 1.0, -1.0, 0.0).is_none());
        // an uphill of rounding size is no reason to halve
        let found = search(|_| 1.0 + 1e-15, 1.0, -1e-20, 1e-14).map(|t| t.part);
        assert_eq!(found, Some(1.0));
    }
}
