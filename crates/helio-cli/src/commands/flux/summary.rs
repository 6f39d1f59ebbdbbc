//! What was found, as JSON and in words.

use helio_flux::{Account, FluxMap, Receiver};
use serde_json::{Map, Value, json};

use super::arrival::Arrival;
use super::digits::{decimals, unit_of};
use crate::failure::Failure;
use crate::printer::Printer;

/// What is known of a map: its peak, where that is, its mean.
pub(super) struct Peak {
    pub(super) flux_w_m2: f64,
    pub(super) mean_w_m2: f64,
    pub(super) bin: usize,
    pub(super) uv_m: Option<[f64; 2]>,
    pub(super) at_m: [f64; 3],
}

impl Peak {
    pub(super) fn of(receiver: &Receiver, map: &FluxMap) -> Self {
        let (flux_w_m2, bin) = map.peak();
        Self {
            flux_w_m2,
            mean_w_m2: map.account().received_w / receiver.area_m2(),
            bin,
            uv_m: receiver.bin_uv_m(bin),
            at_m: receiver.bin_centre_m(bin),
        }
    }
}

/// What a map says of its receiver.
pub(super) fn receiver(
    receiver: &Receiver,
    map: &FluxMap,
    dni_w_m2: f64,
    arrival: &Arrival,
) -> Value {
    let peak = Peak::of(receiver, map);
    // Where there is no light, no bin is the brightest.
    let place = Some(&peak).filter(|peak| peak.flux_w_m2 > 0.0);
    let concentration = |flux_w_m2: f64| (dni_w_m2 > 0.0).then(|| flux_w_m2 / dni_w_m2);
    let shape = match receiver {
        Receiver::Plane(_) => "plane",
        Receiver::Frustum(_) => "round",
        _ => "mesh",
    };
    json!({
        "shape": shape,
        "area_m2": receiver.area_m2(),
        "rows": receiver.rows(),
        "columns": receiver.columns(),
        "peak_flux_w_m2": peak.flux_w_m2,
        "peak_concentration": concentration(peak.flux_w_m2),
        "peak_row": place.map(|peak| peak.bin / receiver.columns()),
        "peak_column": place.map(|peak| peak.bin % receiver.columns()),
        "peak_u_v_m": place.map(|peak| peak.uv_m),
        "peak_at_m": place.map(|peak| peak.at_m),
        "mean_flux_w_m2": peak.mean_w_m2,
        "mean_concentration": concentration(peak.mean_w_m2),
        "lit_from_behind_w": arrival.behind_w,
    })
}

/// The parts of an account, in the order in which the light goes.
fn parts(account: &Account) -> [(&'static str, &'static str, f64); 5] {
    [
        ("shaded_w", "shaded", account.shaded_w),
        (
            "reflection_loss_w",
            "not reflected",
            account.reflection_loss_w,
        ),
        ("blocked_w", "blocked", account.blocked_w),
        ("spilled_w", "spilled", account.spilled_w),
        ("received_w", "received", account.received_w),
    ]
}

pub(super) fn account(account: &Account) -> Value {
    let mut map = Map::new();
    map.insert("mirror_w".into(), json!(account.mirror_w));
    map.insert(
        "cosine_loss_w".into(),
        json!(account.mirror_w - account.incoming_w),
    );
    map.insert("incoming_w".into(), json!(account.incoming_w));
    for (name, _, power_w) in parts(account) {
        map.insert(name.into(), json!(power_w));
    }
    map.insert("unaccounted_w".into(), json!(account.unaccounted_w()));
    map.insert("efficiency".into(), json!(account.efficiency()));
    map.insert("rays".into(), json!(account.rays));
    map.insert("elements_turned_away".into(), json!(account.turned_away));
    Value::Object(map)
}

/// Whole numbers of `step` that add up to the sum as it is rounded: each is at most one step from its own.
fn adding_up(values: &[f64], step: f64) -> Vec<f64> {
    let steps: Vec<f64> = values.iter().map(|value| value / step).collect();
    let mut whole: Vec<f64> = steps.iter().map(|value| value.floor()).collect();
    let all = steps.iter().sum::<f64>().round();
    let mut missing = all - whole.iter().sum::<f64>();
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| (steps[b] - whole[b]).total_cmp(&(steps[a] - whole[a])));
    for row in order {
        if missing >= 1.0 {
            whole[row] += 1.0;
            missing -= 1.0;
        }
    }
    whole.into_iter().map(|value| value * step).collect()
}

/// Where the light went, in one line whose numbers add up as printed.
pub(super) fn say_account(account: &Account, printer: &Printer) {
    let (unit, of_watt, decimals) = unit_of(account.incoming_w);
    let step = 10_f64.powi(-(decimals as i32));
    let parts = parts(account);
    let values: Vec<f64> = parts
        .iter()
        .map(|(.., power_w)| power_w / of_watt)
        .collect();
    let whole = adding_up(&values, step);
    let words: Vec<String> = parts
        .iter()
        .zip(&whole)
        .map(|((_, word, _), value)| format!("{value:.decimals$} {word}"))
        .collect();
    printer.say(format_args!(
        "{:.decimals$} {unit} fall on the mirrors = {}",
        whole.iter().sum::<f64>(),
        words.join(" + ")
    ));
    if account.turned_away > 0 {
        printer.warn(format_args!(
            "{} of the mirrors turn their backs to the sun and reflect nothing",
            crate::printer::Counted(account.turned_away, "element")
        ));
    }
}

/// A power as people read it.
pub(super) fn power(power_w: f64) -> String {
    let (unit, of_watt, decimals) = unit_of(power_w);
    format!("{:.decimals$} {unit}", power_w / of_watt)
}

/// Flux as people read it.
pub(super) fn flux(value_w_m2: f64) -> String {
    let (unit, value, least) = if value_w_m2 >= 1e4 {
        ("kW/m²", value_w_m2 / 1e3, 3)
    } else {
        ("W/m²", value_w_m2, 1)
    };
    let decimals = decimals(value, 4, least);
    format!("{value:.decimals$} {unit}")
}

pub(super) fn say_peak(receiver: &Receiver, map: &FluxMap, dni_w_m2: f64, printer: &Printer) {
    let peak = Peak::of(receiver, map);
    let area_m2 = receiver.area_m2();
    let area = decimals(area_m2, 3, 4);
    if peak.flux_w_m2 <= 0.0 {
        printer.say(format_args!(
            "no light on the {area_m2:.area$} m² of the receiver"
        ));
        return;
    }
    // A thousandth of the receiver, and no coarser than a millimetre.
    let fine = decimals(receiver.radius_m(), 4, 3);
    let suns = |flux_w_m2: f64| {
        if dni_w_m2 > 0.0 {
            format!(" ({:.2} suns)", flux_w_m2 / dni_w_m2)
        } else {
            String::new()
        }
    };
    let place = match peak.uv_m {
        Some([u_m, v_m]) => format!("u {u_m:.fine$} m, v {v_m:.fine$} m"),
        None => {
            let [x, y, z] = peak.at_m;
            format!("x {x:.fine$} m, y {y:.fine$} m, z {z:.fine$} m")
        }
    };
    printer.say(format_args!(
        "peak {}{} at {place}; mean {}{} over {area_m2:.area$} m²",
        flux(peak.flux_w_m2),
        suns(peak.flux_w_m2),
        flux(peak.mean_w_m2),
        suns(peak.mean_w_m2)
    ));
}

/// JSON that people can read.
pub(super) fn text_of(value: &Value) -> Result<String, Failure> {
    let mut text = serde_json::to_string_pretty(value)
        .map_err(|error| Failure::refused(format!("flux: {error}")))?;
    text.push('\n');
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_printed_adds_up() {
        let third = vec![1.0 / 3.0; 3];
        let printed = adding_up(&third, 0.01);
        let hundredths: Vec<i64> = printed.iter().map(|v| (v * 100.0).round() as i64).collect();
        assert_eq!(hundredths, [34, 33, 33]);
        for values in [vec![0.0, 12.345, 6.789], vec![1e-9; 5], vec![0.005, 0.005]] {
            let printed = adding_up(&values, 0.01);
            let sum: f64 = values.iter().sum();
            assert!((printed.iter().sum::<f64>() - sum).abs() <= 0.005 + 1e-12);
            for (a, b) in printed.iter().zip(&values) {
                assert!((a - b).abs() < 0.01 + 1e-12);
            }
        }
    }
}
