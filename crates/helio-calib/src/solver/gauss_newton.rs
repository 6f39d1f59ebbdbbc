//! Damped Gauss-Newton: the length of the step by golden section (Guo 2015 §4.4).

use super::Trial;

/// Golden section.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// eps3: width of the bracket, in steps, at which the search ends. The paper prints "a_k < eps3", which
/// would ask for a step of no length.
const MIN_WIDTH: f64 = 1e-2;
/// Longest step that is tried, in Gauss-Newton steps.
const MAX_PART: f64 = 64.0;
/// Shortest bracket's end that is tried where longer steps leave the target.
const MIN_PART: f64 = 1.0 / (1_u64 << 40) as f64;

/// The minimum of S over a >= 0. The full step is kept where no other is better by more than rounding:
/// close to the optimum the search cannot tell lengths apart, and 1 is then the best length there is.
pub(super) fn search(sum_of: impl Fn(f64) -> f64, sum: f64, tolerance: f64) -> Option<Trial> {
    let at = |part: f64| Trial {
        part,
        sum: match sum_of(part) {
            sum if sum.is_nan() => f64::INFINITY,
            sum => sum,
        },
    };
    let full = at(1.0);
    // a bracket (low, inner, high) with S(inner) no greater than at either end
    let mut low = 0.0;
    let mut inner = full;
    let mut high;
    if full.sum < sum {
        loop {
            high = at(inner.part / GOLDEN);
            if high.sum >= inner.sum || high.part > MAX_PART {
                break;
            }
            low = inner.part;
            inner = high;
        }
    } else {
        high = full;
        loop {
            inner = at(high.part * GOLDEN);
            if inner.sum < sum {
                break;
            }
            if inner.part < MIN_PART {
                return (full.sum <= sum + tolerance).then_some(full);
            }
            high = inner;
        }
    }
    let mut high = high.part;
    while high - low > MIN_WIDTH * inner.part.min(1.0) {
        // the other golden point of the bracket
        let other = at(low + high - inner.part);
        if other.part == inner.part || !(low..high).contains(&other.part) {
            break;
        }
        let (left, right) = if other.part < inner.part {
            (other, inner)
        } else {
            (inner, other)
        };
        if left.sum <= right.sum {
            high = right.part;
            inner = left;
        } else {
            low = left.part;
            inner = right;
        }
    }
    let best = if full.sum <= inner.sum + tolerance {
        full
    } else {
        inner
    };
    (best.sum <= sum + tolerance).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_bottom_of_a_parabola_near_and_far() {
        for bottom in [1e-4, 0.01, 0.3, 0.9, 1.1, 7.0, 30.0] {
            let sum_of = |a: f64| 2.0 + (a - bottom) * (a - bottom);
            let found = search(sum_of, sum_of(0.0), 0.0).map_or(f64::NAN, |t| t.part);
            assert!(
                (found - bottom).abs() < MIN_WIDTH * bottom.min(1.0),
                "{bottom}: {found}"
            );
        }
    }

    #[test]
    fn shrinks_from_misses_and_gives_up_uphill() {
        let sum_of = |a: f64| {
            if a > 0.1 { f64::INFINITY } else { 1.0 - a }
        };
        let found = search(sum_of, 1.0, 0.0).map_or(f64::NAN, |t| t.part);
        assert!(found > 0.05 && found <= 0.1, "{found}");
        assert!(search(|a| 1.0 + a, 1.0, 0.0).is_none());
        assert!(search(|_| f64::NAN, 1.0, 0.0).is_none());
    }

    #[test]
    fn keeps_the_full_step_where_lengths_cannot_be_told_apart() {
        let noise = |a: f64| 1.0 + 1e-16 * (a * 1e6).sin();
        let found = search(noise, 1.0, 1e-14).map(|t| t.part);
        assert_eq!(found, Some(1.0));
    }
}
