//! Round numbers along an axis.

/// Ticks inside a range, at steps of 1, 2 or 5 times a power of ten, at most `most` or so.
pub(crate) fn ticks(min: f64, max: f64, most: usize) -> Vec<f64> {
    let rough = (max - min) / most.max(1) as f64;
    if !(rough.is_finite() && rough > 0.0) {
        return vec![min];
    }
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|&step| step >= rough * 0.999_999)
        .unwrap_or(10.0 * power);
    at_steps(min, max, step)
}

/// Multiples of a step inside a range.
pub(crate) fn at_steps(min: f64, max: f64, step: f64) -> Vec<f64> {
    let first = (min / step - 1e-9).ceil();
    let last = (max / step + 1e-9).floor();
    let count = (last - first).clamp(0.0, 200.0) as usize;
    (0..=count).map(|i| (first + i as f64) * step).collect()
}

/// A tick's number, with no more decimals than its axis needs.
pub(crate) fn label(value: f64, ticks: &[f64]) -> String {
    let step = ticks
        .windows(2)
        .map(|w| w[1] - w[0])
        .fold(f64::INFINITY, f64::min);
    let decimals = if step.is_finite() && step > 0.0 {
        (-step.log10() - 1e-9).ceil().clamp(0.0, 9.0) as usize
    } else {
        2
    };
    let text = format!("{value:.decimals$}");
    if text
        .trim_start_matches('-')
        .bytes()
        .all(|b| matches!(b, b'0' | b'.'))
    {
        return text.trim_start_matches('-').to_owned();
    }
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(-0.5, 10.2, 6), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(ticks(3.0, 3.0, 6), [3.0]);
        let fine = ticks(0.013, 0.047, 5);
        assert_eq!(
            fine.iter().map(|&t| label(t, &fine)).collect::<Vec<_>>(),
            ["0.02", "0.03", "0.04"]
        );
        assert_eq!(label(-0.0, &[0.0, 1.0]), "0");
        assert_eq!(label(-5.0, &[-5.0, 0.0]), "\u{2212}5");
    }
}
