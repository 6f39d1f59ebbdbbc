//! The worst-determined combination of parameters, in words.

use core::fmt;

use helio_core::{Enu, EnuUnit};

use crate::parameters::{COUNT, Parameter};

/// A part of the direction smaller than this share of its largest is not named.
const NAMED: f64 = 0.35;
/// How far outside the observed suns another sun must stand to be called higher, lower, earlier, later \[rad\].
const BEYOND_RAD: f64 = 0.12;

/// Two different numbers with the digits that tell them apart, at least one after the point.
///
/// ```
/// let (found, limit) = helio_calib::diagnosis::told_apart(2.04, 2.0);
/// assert_eq!(format!("{found} of {limit}"), "2.04 of 2.00");
/// ```
#[must_use]
pub fn told_apart(one: f64, other: f64) -> (String, String) {
    let with = |digits: usize| (format!("{one:.digits$}"), format!("{other:.digits$}"));
    (1..17)
        .map(with)
        .find(|(one, other)| one != other)
        .unwrap_or_else(|| (one.to_string(), other.to_string()))
}

/// The combination of parameters that the records determine worst.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Weakness {
    /// Parameters that take part, the largest part first.
    pub parameters: Vec<Parameter>,
    /// One standard deviation along the combination \[rad\]; infinite if not determined at all.
    pub sigma_rad: f64,
    /// What would help, such as "add observations at higher elevation".
    pub advice: String,
}

impl fmt::Display for Weakness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.parameters.iter().map(|p| p.in_words()).collect();
        match names.as_slice() {
            [] => write!(f, "nothing is determined")?,
            [one] => write!(f, "the {one} is determined worst")?,
            [first @ .., last] => {
                write!(f, "{} and {last} cannot be told apart", first.join(", "))?;
            }
        }
        write!(f, ": {}", self.advice)
    }
}

/// Puts a direction of parameters into words; `tracked` are suns that the heliostat will have to follow,
/// `slopes` what each parameter does to the beam there.
pub fn weakness(
    direction: &[f64; COUNT],
    sigma_rad: f64,
    observed: &[EnuUnit],
    tracked: &[EnuUnit],
    slopes: &[[[f64; COUNT]; 2]],
) -> Weakness {
    let mut named: Vec<Parameter> = Parameter::ALL.to_vec();
    let part = |p: Parameter| direction[p as usize].abs();
    let largest = named.iter().map(|&p| part(p)).fold(0.0, f64::max);
    named.retain(|&p| largest > 0.0 && part(p) >= NAMED * largest);
    named.sort_by(|&a, &b| part(b).total_cmp(&part(a)));
    // the sun whose beam tells most about the combination
    let mut best: Option<(f64, EnuUnit)> = None;
    for (&sun, slopes) in tracked.iter().zip(slopes) {
        let [right, down] =
            slopes.map(|by| by.iter().zip(direction).map(|(s, d)| s * d).sum::<f64>());
        let gain = libm::hypot(right, down);
        if best.is_none_or(|(most, _)| gain > most) {
            best = Some((gain, sun));
        }
    }
    let advice = best.map_or_else(
        || "add observations".to_owned(),
        |(_, sun)| advice(observed, sun),
    );
    Weakness {
        parameters: named,
        sigma_rad,
        advice,
    }
}

fn advice(observed: &[EnuUnit], best: EnuUnit) -> String {
    let mut sum = Enu::default();
    for sun in observed {
        sum = sum + sun.as_enu();
    }
    let middle = libm::atan2(sum.east, sum.north);
    let turn = |sun: EnuUnit| helio_core::angle::wrap_pi(sun.azimuth_rad() - middle);
    let range = |of: &dyn Fn(EnuUnit) -> f64| {
        observed
            .iter()
            .map(|&s| of(s))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
                (a.min(x), b.max(x))
            })
    };
    let (lowest, highest) = range(&|s| s.elevation_rad());
    let (first, last) = range(&turn);
    let elevation = if best.elevation_rad() > highest + BEYOND_RAD {
        Some("at higher elevation")
    } else if best.elevation_rad() < lowest - BEYOND_RAD {
        Some("at lower elevation")
    } else {
        None
    };
    // the sun of either hemisphere goes from east to west
    let east = best.as_enu().east;
    let time = if turn(best) < first - BEYOND_RAD || turn(best) > last + BEYOND_RAD {
        Some(if east > 0.0 {
            "in the morning"
        } else {
            "in the afternoon"
        })
    } else {
        None
    };
    match (elevation, time) {
        (Some(elevation), Some(time)) => format!("add observations {elevation} {time}"),
        (Some(where_), None) | (None, Some(where_)) => format!("add observations {where_}"),
        (None, None) => "add more observations".to_owned(),
    }
}
