//! Confidence intervals of a share.

/// Interval of a share after Clopper and Pearson (1934): it holds the truth at least as often as `confidence`
/// says, also near 0 and 1, where the limits of the standard lie and where the shorter interval of Wilson holds
/// it less often.
///
/// `hits` and `trials` need not be whole: of correlated frames, `trials` is the number of independent ones that
/// would tell as much, and `hits` the same share of them (Korn and Graubard 1998, Survey Methodology 24:193).
/// No trial tells nothing: 0 to 1.
///
/// Lower end B⁻¹(α/2; k, n − k + 1), upper end B⁻¹(1 − α/2; k + 1, n − k), where B is the cumulative beta
/// distribution. Valid for 0 ≤ hits ≤ trials ≤ 10⁹ and a confidence in 0.5..=0.999999; outside, and for what is
/// not finite, 0 to 1.
///
/// ```
/// // Newcombe (1998), Statistics in Medicine 17:857, table I
/// let [low, high] = helio_spot::accuracy::clopper_pearson(81.0, 263.0, 0.95);
/// assert!((low - 0.2527).abs() < 5e-5 && (high - 0.3676).abs() < 5e-5);
/// ```
#[must_use]
pub fn clopper_pearson(hits: f64, trials: f64, confidence: f64) -> [f64; 2] {
    let inside = (0.0..=1e9).contains(&trials)
        && (0.0..=trials).contains(&hits)
        && (0.5..=0.999_999).contains(&confidence);
    if !inside || trials == 0.0 {
        return [0.0, 1.0];
    }
    let tail = 0.5 * (1.0 - confidence);
    let low = if hits == 0.0 {
        0.0
    } else {
        beta_quantile(tail, hits, trials - hits + 1.0)
    };
    let high = if hits == trials {
        1.0
    } else {
        // by symmetry, so that both ends are as exact
        1.0 - beta_quantile(tail, trials - hits, hits + 1.0)
    };
    [low, high]
}

/// Independent frames from which an interval around `share` would no longer hold `limit`; `None` beyond ten
/// million.
pub(super) fn frames_to_decide(share: f64, limit: f64, confidence: f64) -> Option<f64> {
    let decides = |trials: f64| {
        let [low, high] = clopper_pearson(share * trials, trials, confidence);
        low > limit || high < limit
    };
    let mut enough = 1.0;
    while !decides(enough) {
        enough *= 2.0;
        if enough > 1e7 {
            return None;
        }
    }
    let mut too_few = 0.5 * enough;
    while enough - too_few > 0.5 {
        let middle = 0.5 * (enough + too_few);
        if decides(middle) {
            enough = middle;
        } else {
            too_few = middle;
        }
    }
    Some(libm::ceil(enough))
}

/// How many standard deviations of a normal distribution hold this share of it, on both sides together.
pub(super) fn normal_width(confidence: f64) -> f64 {
    let (mut low, mut high) = (0.0, 10.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if libm::erf(middle / core::f64::consts::SQRT_2) < confidence {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Share of a normal distribution below `z` standard deviations.
pub(super) fn normal_below(z: f64) -> f64 {
    0.5 * libm::erfc(-z / core::f64::consts::SQRT_2)
}

/// Where the cumulative beta distribution reaches `share`.
fn beta_quantile(share: f64, a: f64, b: f64) -> f64 {
    let (mut low, mut high) = (0.0_f64, 1.0_f64);
    // to the last bit or so: a hundred halvings at most
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if beta_below(middle, a, b) < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The cumulative beta distribution I_x(a, b), for 0 < x < 1 and a, b > 0: the continued fraction of DLMF
/// 8.17.22, from whichever side it runs down faster.
fn beta_below(x: f64, a: f64, b: f64) -> f64 {
    let log_front = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b)
        + a * libm::log(x)
        + b * libm::log1p(-x);
    let front = libm::exp(log_front);
    if x < (a + 1.0) / (a + b + 2.0) {
        front * fraction(x, a, b) / a
    } else {
        1.0 - front * fraction(1.0 - x, b, a) / b
    }
}

/// The fraction by the method of Lentz (1976).
fn fraction(x: f64, a: f64, b: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let away = |v: f64| if v.abs() < TINY { TINY } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / away(1.0 - (a + b) * x / (a + 1.0));
    let mut value = d;
    // about the square root of the larger of a and b many steps are needed
    for m in 1..100_000 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / away(1.0 + even * d);
        c = away(1.0 + even / c);
        value *= d * c;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / away(1.0 + odd * d);
        c = away(1.0 + odd / c);
        let step = d * c;
        value *= step;
        if (step - 1.0).abs() < 1e-15 {
            break;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Newcombe (1998), Statistics in Medicine 17:857-872, table I, method 5 (four printed digits), and
    /// Brown, Cai and DasGupta (2001) on which of the two intervals keeps its promise near 1.
    #[test]
    fn printed_intervals() {
        for (hits, trials, low, high) in [
            (81.0, 263.0, 0.2527, 0.3676),
            (15.0, 148.0, 0.0578, 0.1617),
            (0.0, 20.0, 0.0000, 0.1684),
            (1.0, 29.0, 0.0009, 0.1776),
        ] {
            let got = clopper_pearson(hits, trials, 0.95);
            assert!((got[0] - low).abs() <= 5e-5, "{hits} of {trials}: {got:?}");
            assert!((got[1] - high).abs() <= 5e-5, "{hits} of {trials}: {got:?}");
        }
    }

    /// The ends solve the equations that define them: exact sums of the binomial distribution.
    #[test]
    fn ends_solve_their_equations() {
        for trials in [1_u32, 2, 5, 37, 300, 1000] {
            for hits in [0, 1, trials / 3, trials / 2, trials - 1, trials] {
                for confidence in [0.8, 0.95, 0.999] {
                    let tail = 0.5 * (1.0 - confidence);
                    let [low, high] =
                        clopper_pearson(f64::from(hits), f64::from(trials), confidence);
                    if hits > 0 {
                        let at_least: f64 = (hits..=trials).map(|k| pmf(k, trials, low)).sum();
                        assert!((at_least - tail).abs() < 1e-10, "{hits} of {trials}");
                    }
                    if hits < trials {
                        let at_most: f64 = (0..=hits).map(|k| pmf(k, trials, high)).sum();
                        assert!((at_most - tail).abs() < 1e-10, "{hits} of {trials}");
                    }
                }
            }
        }
    }

    /// Probability of `k` of `n`, as a product of its factors.
    fn pmf(k: u32, n: u32, p: f64) -> f64 {
        let mut log = f64::from(k) * p.ln() + f64::from(n - k) * (-p).ln_1p();
        for i in 0..k {
            log += (f64::from(n - i) / f64::from(k - i)).ln();
        }
        log.exp()
    }

    /// Numbers of scipy 1.17 (`beta.ppf`), among them parts of frames and very many frames.
    #[test]
    fn numbers_of_scipy() {
        for (hits, trials, low, high) in SCIPY {
            let got = clopper_pearson(hits, trials, 0.95);
            for (got, wanted) in got.into_iter().zip([low, high]) {
                assert!(
                    (got - wanted).abs() < 2e-9,
                    "{hits} of {trials}: {got} {wanted}"
                );
            }
        }
    }

    const SCIPY: [(f64, f64, f64, f64); 7] = [
        (0.5, 1.0, 0.000_385_580_980_755_9, 0.999_614_419_019_244_1),
        (
            367.4,
            368.0,
            0.986_871_901_753_981_9,
            0.999_995_182_743_114_9,
        ),
        (
            12.25,
            40.5,
            0.168_346_592_397_523_5,
            0.466_766_736_615_667_2,
        ),
        (
            99_000.5,
            1e5,
            0.989_369_040_893_543_6,
            0.990_612_291_120_617_1,
        ),
        (
            620_000.0,
            1e6,
            0.619_047_813_607_972_5,
            0.620_951_491_275_194_6,
        ),
        (
            33.0,
            100.0,
            0.239_198_534_622_601_8,
            0.431_172_750_777_563_2,
        ),
        (5.0, 5.0, 0.478_176_249_895_018_5, 1.0),
    ];

    #[test]
    fn no_frames_tell_nothing() {
        assert_eq!(clopper_pearson(0.0, 0.0, 0.95), [0.0, 1.0]);
        assert_eq!(clopper_pearson(f64::NAN, 3.0, 0.95), [0.0, 1.0]);
        assert_eq!(clopper_pearson(4.0, 3.0, 0.95), [0.0, 1.0]);
    }

    #[test]
    fn as_many_frames_as_decide() {
        // 0.975 of a chance: 0.99^n < 0.025 from n = 368 (ln 0.025 / ln 0.99 = 367.04)
        assert_eq!(frames_to_decide(1.0, 0.99, 0.95), Some(368.0));
        assert_eq!(frames_to_decide(0.62, 0.62, 0.95), None);
        assert!((normal_width(0.95) - 1.959_963_984_540_054).abs() < 1e-12);
    }
}
