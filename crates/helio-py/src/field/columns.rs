//! Columns into heliostats and back.

use helio_core::{AxisLimits, Enu, Field, Heliostat, MountErrors, PoseErrors, TrackingMode};
use numpy::{PyArray2, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use super::{PyField, not_points, rows};
use crate::array::{Column, Numbers, scalar};
use crate::failure::Failure;

/// A quantity of a heliostat: its name, what it is where not given, how it is read and set.
struct Quantity {
    name: &'static str,
    default: f64,
    get: fn(&Heliostat) -> f64,
    set: fn(&mut Heliostat, f64),
}

macro_rules! quantity {
    ($name:literal, $default:expr, $($place:tt)+) => {
        Quantity {
            name: $name,
            default: $default,
            get: |h| h.$($place)+,
            set: |h, value| h.$($place)+ = value,
        }
    };
}

const QUANTITIES: [Quantity; 14] = [
    quantity!("mirror_offset_m", 0.0, mirror_offset_m),
    quantity!("pedestal_tilt_rad", 0.0, errors.pedestal_tilt_rad),
    quantity!(
        "pedestal_tilt_azimuth_rad",
        0.0,
        errors.pedestal_tilt_azimuth_rad
    ),
    quantity!(
        "axis_nonorthogonality_rad",
        0.0,
        errors.axis_nonorthogonality_rad
    ),
    quantity!("mirror_tilt_rad", 0.0, errors.mirror_tilt_rad),
    quantity!("azimuth_reference_rad", 0.0, errors.azimuth_reference_rad),
    quantity!(
        "elevation_reference_rad",
        0.0,
        errors.elevation_reference_rad
    ),
    quantity!("axis1_sag_rad", 0.0, pose_errors.axis1_sag_rad),
    quantity!("axis2_sag_rad", 0.0, pose_errors.axis2_sag_rad),
    quantity!(
        "axis2_eccentricity_rad",
        0.0,
        pose_errors.axis2_eccentricity_rad
    ),
    quantity!("axis1_min_rad", f64::NEG_INFINITY, limits.axis1_min_rad),
    quantity!("axis1_max_rad", f64::INFINITY, limits.axis1_max_rad),
    quantity!("axis2_min_rad", f64::NEG_INFINITY, limits.axis2_min_rad),
    quantity!("axis2_max_rad", f64::INFINITY, limits.axis2_max_rad),
];

/// A column of a field by the name of its quantity; empty for a name there is none of.
pub(super) fn column(field: &Field, name: &str) -> Vec<f64> {
    let quantity = QUANTITIES.iter().find(|quantity| quantity.name == name);
    let each = |quantity: &Quantity| field.heliostats().iter().map(quantity.get).collect();
    quantity.map(each).unwrap_or_default()
}

pub(super) fn points<'py>(
    py: Python<'py>,
    field: &Field,
    of: fn(&Heliostat) -> Enu,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let points = field.heliostats().iter().map(of);
    let flat: Vec<f64> = points.flat_map(|p| [p.east, p.north, p.up]).collect();
    flat.to_pyarray(py).reshape([field.len(), 3])
}

pub(super) fn axis_azimuth_rad(field: &Field) -> Option<f64> {
    match field.mode() {
        TrackingMode::PitchRoll { axis_azimuth_rad } => Some(axis_azimuth_rad),
        _ => None,
    }
}

pub(super) fn latitude_rad(field: &Field) -> Option<f64> {
    match field.mode() {
        TrackingMode::Polar { latitude_rad } => Some(latitude_rad),
        _ => None,
    }
}

/// The arguments that make the same field again.
pub(super) fn arguments<'py>(this: &Bound<'py, PyField>) -> PyResult<Bound<'py, PyDict>> {
    let arguments = PyDict::new(this.py());
    let others = [
        "position_enu_m",
        "aim_enu_m",
        "ids",
        "mode",
        "axis_azimuth_rad",
        "latitude_rad",
    ];
    for name in others.into_iter().chain(QUANTITIES.map(|q| q.name)) {
        arguments.set_item(name, this.getattr(name)?)?;
    }
    Ok(arguments)
}

/// The tracking mode that was asked for.
pub(super) fn mode(
    word: Option<&Bound<'_, PyAny>>,
    axis_azimuth_rad: Option<&Bound<'_, PyAny>>,
    latitude_rad: Option<&Bound<'_, PyAny>>,
) -> Result<TrackingMode, Failure> {
    let word = match word {
        None => "azimuth-elevation".into(),
        Some(word) => match word.cast::<PyString>() {
            Ok(text) => text.to_string_lossy().into_owned(),
            Err(_) => {
                let found = word.get_type();
                return Err(Failure::of(
                    "DataTypeError",
                    "mode",
                    format_args!("expected a word, got {found}"),
                ));
            }
        },
    };
    for (value, what, of) in [
        (axis_azimuth_rad, "axis_azimuth_rad", "pitch-roll"),
        (latitude_rad, "latitude_rad", "polar"),
    ] {
        if word == of && value.is_none() {
            return Err(Failure::of(
                "OptionError",
                what,
                format_args!("mode {of} needs it"),
            ));
        }
        if word != of && value.is_some() {
            let message = format!("it is for mode {of}, but the mode is {word}");
            return Err(Failure::of("OptionError", what, message));
        }
    }
    let finite = |value: Option<&Bound<'_, PyAny>>, what| match value {
        Some(value) => {
            let number = scalar(value, what)?;
            if number.is_finite() {
                return Ok(number);
            }
            Err(Failure::of(
                "OptionError",
                what,
                format_args!("must be finite, got {number}"),
            ))
        }
        None => Ok(0.0),
    };
    match word.as_str() {
        "azimuth-elevation" => Ok(TrackingMode::AzimuthElevation),
        "spinning-elevation" => Ok(TrackingMode::SpinningElevation),
        "pitch-roll" => Ok(TrackingMode::PitchRoll {
            axis_azimuth_rad: finite(axis_azimuth_rad, "axis_azimuth_rad")?,
        }),
        "polar" => Ok(TrackingMode::Polar {
            latitude_rad: finite(latitude_rad, "latitude_rad")?,
        }),
        _ => Err(Failure::of(
            "OptionError",
            "mode",
            format_args!(
                "wanted azimuth-elevation, spinning-elevation, pitch-roll or polar, got `{word}`"
            ),
        )),
    }
}

/// A field from columns.
pub(super) fn field(
    position_enu_m: &Bound<'_, PyAny>,
    aim_enu_m: &Bound<'_, PyAny>,
    ids: Option<&Bound<'_, PyAny>>,
    mode: TrackingMode,
    columns: Option<&Bound<'_, PyDict>>,
) -> Result<Field, Failure> {
    let pivots = Numbers::of(position_enu_m, "position_enu_m")?;
    let [len, 3] = *pivots.shape() else {
        return Err(not_points("position_enu_m", "(n, 3)", pivots.shape()));
    };
    let aims = Numbers::of(aim_enu_m, "aim_enu_m")?;
    if aims.shape() != [3] && aims.shape() != [len, 3] {
        let wanted = format!("(3,) or ({len}, 3)");
        return Err(not_points("aim_enu_m", &wanted, aims.shape()));
    }
    let one_aim = aims.shape().len() == 1;
    let ids = names(ids, len)?;
    let given = given(columns)?;
    let given: Vec<(&Quantity, Column<'_>)> = given
        .iter()
        .map(|(quantity, numbers)| Ok((*quantity, numbers.column(quantity.name, len)?)))
        .collect::<Result<_, Failure>>()?;
    let (pivots, aims) = (pivots.as_slice()?, aims.as_slice()?);
    let point = |numbers: &[f64], row: usize| {
        Enu::new(numbers[3 * row], numbers[3 * row + 1], numbers[3 * row + 2])
    };
    let mut field = Field::new(mode);
    for (row, id) in ids.iter().enumerate() {
        let mut heliostat = Heliostat {
            pivot: point(pivots, row),
            aim: point(aims, if one_aim { 0 } else { row }),
            mirror_offset_m: 0.0,
            errors: MountErrors::default(),
            pose_errors: PoseErrors::NONE,
            limits: AxisLimits::NONE,
        };
        for (quantity, column) in &given {
            (quantity.set)(&mut heliostat, column.get(row));
        }
        field.push(id, heliostat)?;
    }
    Ok(field)
}

/// The quantities among the keywords, each of which must be one.
fn given<'py>(
    columns: Option<&Bound<'py, PyDict>>,
) -> Result<Vec<(&'static Quantity, Numbers<'py>)>, Failure> {
    static KNOWN: [Quantity; 14] = QUANTITIES;
    let mut given = Vec::new();
    for (name, value) in columns.into_iter().flatten() {
        let name: String = name.extract()?;
        let Some(quantity) = KNOWN.iter().find(|quantity| quantity.name == name) else {
            let known = KNOWN.each_ref().map(|quantity| quantity.name).join(", ");
            let message = format!("no such quantity of a heliostat; known are {known}");
            return Err(Failure::of("UnknownNameError", &name, message));
        };
        if value.is_none() && quantity.default.is_infinite() {
            continue; // no limit
        }
        given.push((quantity, Numbers::of(&value, quantity.name)?));
    }
    Ok(given)
}

fn names(ids: Option<&Bound<'_, PyAny>>, len: usize) -> Result<Vec<String>, Failure> {
    let Some(ids) = ids else {
        return Ok((0..len).map(|row| row.to_string()).collect());
    };
    let refuse = || {
        let found = ids.get_type();
        Failure::of(
            "DataTypeError",
            "ids",
            format_args!("expected a sequence of str, got {found}"),
        )
    };
    if ids.is_instance_of::<PyString>() {
        return Err(refuse());
    }
    let mut names = Vec::with_capacity(len);
    for (row, id) in ids.try_iter().map_err(|_| refuse())?.enumerate() {
        let id = id?;
        let Ok(text) = id.cast::<PyString>() else {
            let found = id.get_type();
            let message = format!("row {row} must be a str, got {found}");
            return Err(Failure::of("DataTypeError", "ids", message));
        };
        names.push(text.to_cow()?.into_owned());
    }
    if names.len() != len {
        let (wanted, found) = (rows(len), rows(names.len()));
        return Err(Failure::of(
            "ShapeError",
            "ids",
            format_args!("expected shape {wanted}, got {found}"),
        ));
    }
    Ok(names)
}
