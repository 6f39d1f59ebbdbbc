//! How much less correlated frames tell than independent ones.

/// Lags looked at before cells are joined.
const LAGS: usize = 64;
/// The sum over lags stops where the window is so many times the number of frames that tell as much as one:
/// Sokal's rule (1997, *Monte Carlo methods in statistical mechanics*, §3), there 6 correlation times.
const WINDOW: f64 = 3.0;

/// Of a lag that has less than one in so many of the pairs at none, nothing is known.
const FEW_PAIRS: f64 = 50.0;

/// How much less the mean of correlated values tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DesignEffect {
    /// By how much its variance exceeds that of the mean of as many independent values: at least 1. The number of
    /// values if their correlation lasts too long for them to tell.
    pub(super) factor: f64,
    /// Degrees of freedom of that: how many windows there are.
    pub(super) freedom: f64,
}

/// The design effect of a series.
///
/// `ticks` are the times of the values as whole numbers of frame steps, ascending; gaps are simply times
/// without a value. The variance of the mean is (1/n²) Σ C(tᵢ − tⱼ) over all pairs of values, whose
/// autocovariances C, of pairs at the same time too, are summed up to a window that the data choose; for the sample mean taken out it is
/// corrected as by Wolff (2004, Comput. Phys. Commun. 156:143, eq. 49). Long windows are summed over cells of 2,
/// 4, 8 … steps, which only groups the same pairs: the cost is some 128 products a value. The window is one of time, by
/// what the correlation would be without gaps: over lags that hardly any pairs have it is taken to stay as it was before
/// them, so that frames in bursts do not end the sum within one.
pub(super) fn design_effect(ticks: &[i64], values: &[f64]) -> DesignEffect {
    let n = values.len() as f64;
    let untold = DesignEffect {
        factor: n.max(1.0),
        freedom: f64::INFINITY,
    };
    if values.len() < 2 {
        return untold;
    }
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    // Values that are all the same tell nothing about their correlation.
    let greatest = values.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    if squares <= n * greatest * greatest * 1e-28 {
        return untold;
    }
    // Lags without any pair would end the sum at once: the first cells hold about a value each.
    let step = median_step(ticks.windows(2).map(|pair| pair[1].saturating_sub(pair[0])));
    let step = step.unwrap_or(1);
    let cell = |tick: i64| tick.div_euclid(step);
    let values = values.iter().map(|value| (value - mean, 1.0));
    let mut cells = cells(ticks.iter().map(|&tick| cell(tick)).zip(values));
    let mut width = 1.0;
    let mut least = None;
    while let ([(first, _), .., (last, _)], true) = (&cells[..], 2.0 * width < n) {
        let span = last.saturating_sub(*first).saturating_add(1) as f64;
        let (sums, pairs) = products(&cells);
        let mut effect = sums[0];
        // Values of one time are one value, whatever chance makes of the lags beyond.
        let least = *least.get_or_insert((effect / squares).max(1.0));
        let mut correlation = sums[0] / pairs[0] * n / squares;
        // what as many values without gaps would have
        let mut gapless = width * correlation;
        for (lag, product) in sums.iter().enumerate().skip(1) {
            effect += 2.0 * product;
            if FEW_PAIRS * pairs[lag] >= pairs[0] {
                correlation = product / pairs[lag] * n / squares;
            }
            gapless += 2.0 * width * correlation * (1.0 - lag as f64 / span).max(0.0);
            let relative = (effect / squares).max(least);
            if lag as f64 * width >= WINDOW * relative.max(gapless) {
                let covered = (2.0 * lag as f64 + 1.0) / span;
                // A window as long as the record has the mean's own error for a result.
                if covered > 0.5 {
                    return untold;
                }
                return DesignEffect {
                    factor: (relative * (1.0 + covered)).min(n),
                    freedom: 1.0 / covered,
                };
            }
        }
        cells = self::cells(cells.iter().map(|&(tick, of)| (tick.div_euclid(2), of)));
        width *= 2.0;
    }
    untold
}

/// The median of the steps above zero.
pub(super) fn median_step(steps: impl Iterator<Item = i64>) -> Option<i64> {
    let mut steps: Vec<i64> = steps.filter(|step| *step > 0).collect();
    let middle = steps.len().checked_sub(1)? / 2;
    Some(*steps.select_nth_unstable(middle).1)
}

/// A sum of values, and of how many.
type Cell = (i64, (f64, f64));

/// Sums of the values of each tick.
fn cells(values: impl Iterator<Item = Cell>) -> Vec<Cell> {
    let mut cells: Vec<Cell> = Vec::with_capacity(values.size_hint().0);
    for (tick, (value, count)) in values {
        match cells.last_mut() {
            Some((last, (sum, all))) if *last == tick => {
                *sum += value;
                *all += count;
            }
            _ => cells.push((tick, (value, count))),
        }
    }
    cells
}

/// Products of cells at distance 0, 1, … summed, and how many pairs of values these are.
fn products(cells: &[Cell]) -> ([f64; LAGS + 1], [f64; LAGS + 1]) {
    let (mut sums, mut pairs) = ([0.0; LAGS + 1], [0.0; LAGS + 1]);
    for (i, &(tick, (value, count))) in cells.iter().enumerate() {
        for &(later, (other, others)) in cells[i..].iter().take(LAGS + 1) {
            let lag = later.saturating_sub(tick);
            match usize::try_from(lag) {
                Ok(lag) if lag <= LAGS => {
                    sums[lag] += value * other;
                    pairs[lag] += count * others;
                }
                _ => break,
            }
        }
    }
    (sums, pairs)
}

#[cfg(test)]
mod tests {
    use super::super::simulate::Dice;
    use super::*;

    /// A first-order autoregressive series: the effect is (1 + φ)/(1 − φ) (e.g. Priestley 1981, §5.3).
    fn series(phi: f64, n: usize, dice: &mut Dice) -> Vec<f64> {
        let mut x = dice.normal();
        let fresh = (1.0 - phi * phi).sqrt();
        (0..n)
            .map(|_| {
                x = phi * x + fresh * dice.normal();
                x
            })
            .collect()
    }

    #[test]
    fn known_correlations_are_found() {
        let mut dice = Dice::new(5);
        let ticks: Vec<i64> = (0..100_000).collect();
        for phi in [0.0, 0.5, 0.9, 0.99] {
            let mut sum = 0.0;
            for _ in 0..8 {
                sum += design_effect(&ticks, &series(phi, ticks.len(), &mut dice)).factor;
            }
            let (got, truth) = (sum / 8.0, (1.0 + phi) / (1.0 - phi));
            assert!((got / truth - 1.0).abs() < 0.06, "{phi}: {got} {truth}");
        }
    }

    #[test]
    fn gaps_make_frames_more_independent() {
        let mut dice = Dice::new(6);
        // every tenth frame of a series: φ becomes φ^10
        let all = series(0.9, 400_000, &mut dice);
        let ticks: Vec<i64> = (0..40_000).map(|i| 10 * i).collect();
        let thinned: Vec<f64> = all.iter().copied().step_by(10).collect();
        let phi = 0.9_f64.powi(10);
        let got = design_effect(&ticks, &thinned).factor;
        let truth = (1.0 + phi) / (1.0 - phi);
        assert!((got / truth - 1.0).abs() < 0.1, "{got} {truth}");
    }

    /// Three frames of every 25 of a slow swing: the effect is (1/n) Σ ρ over all pairs, summed here one by one.
    #[test]
    fn frames_in_bursts_tell_little() {
        let phi = 0.98_f64;
        let mut sum = 0.0;
        for seed in 0..8 {
            let all = series(phi, 200_000, &mut Dice::new(seed));
            let ticks: Vec<i64> = (0..200_000).filter(|i| i % 25 < 3).collect();
            let values: Vec<f64> = ticks.iter().map(|&i| all[i as usize]).collect();
            sum += design_effect(&ticks, &values).factor;
        }
        let of_pair = |a: i64, b: i64| phi.powf((a - b).abs() as f64);
        let others = (-40..=40).flat_map(|burst| (0..3).map(move |i| 25 * burst + i));
        let truth: f64 = others
            .map(|other| (0..3).map(|i| of_pair(i, other)).sum::<f64>() / 3.0)
            .sum();
        assert!(
            (sum / 8.0 / truth - 1.0).abs() < 0.1,
            "{} {truth}",
            sum / 8.0
        );
    }

    /// Values that stand twice tell no more than once, whatever the chance correlation of the lags is.
    #[test]
    fn values_of_one_time_are_one() {
        let ticks: Vec<i64> = (0..400).flat_map(|tick| [tick; 2]).collect();
        for seed in 0..50 {
            let mut dice = Dice::new(seed);
            let values: Vec<f64> = (0..400).flat_map(|_| [dice.normal(); 2]).collect();
            let found = design_effect(&ticks, &values).factor;
            assert!(found >= 2.0, "{seed}: {found}");
        }
    }

    #[test]
    fn a_drift_tells_nothing() {
        let ticks: Vec<i64> = (0..5000).collect();
        let drift: Vec<f64> = ticks.iter().map(|t| *t as f64).collect();
        assert_eq!(design_effect(&ticks, &drift).factor, 5000.0);
        assert_eq!(design_effect(&ticks, &vec![0.3; 5000]).factor, 5000.0);
        assert_eq!(design_effect(&[7], &[0.3]).factor, 1.0);
        assert_eq!(design_effect(&[], &[]).factor, 1.0);
        // two frames at the same time are one
        assert_eq!(design_effect(&[3, 3], &[0.0, 1.0]).factor, 2.0);
    }
}
