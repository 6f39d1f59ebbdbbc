//! How many digits of a number are printed.

use std::borrow::Cow;

/// Powers by their units: from so many watts on, what one is of a watt, and the decimals at least.
const POWERS: [(f64, &str, f64, usize); 9] = [
    (1e16, "PW", 1e15, 3),
    (1e13, "TW", 1e12, 3),
    (1e10, "GW", 1e9, 3),
    (1e7, "MW", 1e6, 3),
    (1e4, "kW", 1e3, 3),
    (1.0, "W", 1.0, 2),
    (1e-3, "mW", 1e-3, 2),
    (1e-6, "µW", 1e-6, 2),
    (0.0, "nW", 1e-9, 2),
];
/// A million PW: from here on powers of ten are easier to read.
const HUGE_W: f64 = 1e21;
/// More than a double has.
const MOST_DECIMALS: usize = 17;

/// Decimals with which a number of this size has so many figures, and at least `least`.
pub(super) fn decimals(size: f64, figures: i32, least: usize) -> usize {
    if size == 0.0 || !size.is_finite() {
        return least;
    }
    let wanted = figures - 1 - size.abs().log10().floor() as i32;
    usize::try_from(wanted)
        .unwrap_or(0)
        .clamp(least, MOST_DECIMALS)
}

/// Powers as people read them, in five figures or more: the unit, what it is of a watt, and its decimals.
pub(super) fn unit_of(power_w: f64) -> (Cow<'static, str>, f64, usize) {
    if power_w >= HUGE_W && power_w.is_finite() {
        let exponent = power_w.log10().floor() as i32;
        return (
            format!("× 10^{exponent} W").into(),
            10_f64.powi(exponent),
            4,
        );
    }
    let fits = |(from_w, ..): &&(f64, &str, f64, usize)| power_w >= *from_w && power_w > 0.0;
    match POWERS.iter().find(fits) {
        Some(&(_, unit, of_watt, least)) => {
            (unit.into(), of_watt, decimals(power_w / of_watt, 5, least))
        }
        None => ("W".into(), 1.0, 2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_figures_of_any_power() {
        let printed = |power_w: f64| {
            let (unit, of_watt, decimals) = unit_of(power_w);
            format!("{:.decimals$} {unit}", power_w / of_watt)
        };
        for (power_w, wanted) in [
            (0.0, "0.00 W"),
            (165.4, "165.40 W"),
            (9_999.5, "9999.50 W"),
            (4.25, "4.2500 W"),
            (12_345.6, "12.346 kW"),
            (3.2e6, "3200.000 kW"),
            (4e14, "400.000 TW"),
            (9e20, "900000.000 PW"),
            (5e26, "5.0000 × 10^26 W"),
            (0.25, "250.00 mW"),
            (8.5e-7, "850.00 nW"),
            (1.234_56e-12, "0.0012346 nW"),
        ] {
            assert_eq!(printed(power_w), wanted);
        }
    }

    #[test]
    fn figures_of_lengths() {
        assert_eq!((decimals(0.18, 4, 3), decimals(25.0, 4, 3)), (4, 3));
        assert_eq!((decimals(3e-4, 4, 3), decimals(0.0, 4, 3)), (7, 3));
    }
}
