//! Numbers with units that people read.

/// A unit and what a number in SI is multiplied with to be in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Unit {
    pub(super) factor: f64,
    pub(super) name: &'static str,
}

/// The unit in which the greatest irradiance \[W/m²\] of a map reads best.
pub(super) fn irradiance(greatest_w_m2: f64) -> Unit {
    prefixed(greatest_w_m2, ["W/m²", "kW/m²", "MW/m²"])
}

/// The unit in which a power \[W\] reads best.
pub(super) fn power(greatest_w: f64) -> Unit {
    prefixed(greatest_w, ["W", "kW", "MW"])
}

fn prefixed(greatest: f64, [one, kilo, mega]: [&'static str; 3]) -> Unit {
    let (factor, name) = match greatest {
        g if g >= 1e6 => (1e-6, mega),
        g if g >= 1e3 => (1e-3, kilo),
        _ => (1.0, one),
    };
    Unit { factor, name }
}

/// A value in SI with its unit: four figures.
pub(super) fn with(value: f64, unit: Unit) -> String {
    format!("{}\u{202f}{}", figures(value * unit.factor), unit.name)
}

/// Four figures; powers of ten where there would be many zeros.
pub(super) fn figures(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let text = if (1e-3..1e6).contains(&value.abs()) {
        let before = value.abs().log10().floor() as i32;
        let decimals = (3 - before).clamp(0, 6) as usize;
        let text = format!("{value:.decimals$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    } else {
        let text = format!("{value:.3e}");
        match text.split_once('e') {
            Some((digits, power)) => format!("{digits}\u{202f}×\u{202f}10{}", superscript(power)),
            None => text,
        }
    };
    text.replace('-', "\u{2212}")
}

/// A whole number as raised digits.
pub(super) fn superscript(digits: &str) -> String {
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c @ '0'..='9' => char::from_u32('⁰' as u32 + c as u32 - '0' as u32).unwrap_or(c),
        c => c,
    };
    digits.chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_figures() {
        for (value, text) in [
            (0.0, "0"),
            (12.0, "12"),
            (1234.56, "1235"),
            (0.012345, "0.01235"),
            (-7.5, "\u{2212}7.5"),
            (999_999.0, "999999"),
            (1.5e-7, "1.500\u{202f}×\u{202f}10⁻⁷"),
            (3.0e12, "3.000\u{202f}×\u{202f}10¹²"),
        ] {
            assert_eq!(figures(value), text);
        }
        assert_eq!(with(12_340.0, irradiance(12_340.0)), "12.34\u{202f}kW/m²");
        assert_eq!(with(2.5e6, power(2.5e6)), "2.5\u{202f}MW");
        assert_eq!(with(0.0, power(0.0)), "0\u{202f}W");
    }
}
