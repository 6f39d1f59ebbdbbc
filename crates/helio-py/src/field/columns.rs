//! Columns into heliostats and back.

use std::collections::BTreeMap;

use helio_core::drive::Drive;
use helio_core::{AxisLimits, Enu, Field, Heliostat, MountErrors, PoseErrors, TrackingMode};
use helio_io::{FieldParts, Sha256, Site, Target};
use numpy::{PyArray2, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString};

use super::{not_points, rows};
use crate::array::{Column, Numbers, owned, scalar};
use crate::drive::PyDrive;
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

/// The arguments that make the same field again: each column, and whatever else there is.
pub(super) fn arguments<'py>(
    py: Python<'py>,
    parts: &FieldParts,
) -> Result<Bound<'py, PyDict>, Failure> {
    let field = &parts.field;
    let arguments = PyDict::new(py);
    arguments.set_item("position_enu_m", points(py, field, |h| h.pivot)?)?;
    match aims(parts) {
        Some(aims) => arguments.set_item("aim", aims)?,
        None => arguments.set_item("aim_enu_m", points(py, field, |h| h.aim)?)?,
    }
    arguments.set_item("ids", field.ids())?;
    arguments.set_item("mode", field.mode().as_str())?;
    arguments.set_item("axis_azimuth_rad", axis_azimuth_rad(field))?;
    arguments.set_item("latitude_rad", latitude_rad(field))?;
    if parts.drives.iter().any(|drives| *drives != [None; 2]) {
        arguments.set_item("drives", pairs(py, &parts.drives)?)?;
    }
    for quantity in QUANTITIES {
        let column = column(field, quantity.name);
        arguments.set_item(quantity.name, owned(py, column, &[field.len()])?)?;
    }
    Ok(arguments)
}

/// Names of what heliostats aim at, where these are targets.
fn aims(parts: &FieldParts) -> Option<Vec<&str>> {
    let names: Vec<&str> = parts.targets.keys().map(String::as_str).collect();
    let each = parts.target_of.iter();
    each.map(|number| names.get((*number)?).copied()).collect()
}

/// Drives as a list of pairs.
pub(super) fn pairs<'py>(
    py: Python<'py>,
    drives: &[[Option<Drive>; 2]],
) -> PyResult<Bound<'py, PyList>> {
    let pair = |&[axis1, axis2]: &[Option<Drive>; 2]| (axis1.map(PyDrive), axis2.map(PyDrive));
    PyList::new(py, drives.iter().map(pair).collect::<Vec<_>>())
}

/// SHA-256 of all that a field of columns says.
pub(super) fn hash(parts: &FieldParts, surroundings: &str) -> String {
    let mut hash = Sha256::default();
    hash.update(format!("{:?}\n{surroundings}", parts.field.mode()).as_bytes());
    let rows = parts.field.ids().iter().zip(parts.field.heliostats());
    for ((id, heliostat), (target, drives)) in rows.zip(parts.target_of.iter().zip(&parts.drives)) {
        hash.update(format!("\n{id:?} {target:?} {drives:?}").as_bytes());
        let (pivot, aim) = (heliostat.pivot, heliostat.aim);
        let points = [
            pivot.east,
            pivot.north,
            pivot.up,
            aim.east,
            aim.north,
            aim.up,
        ];
        let quantities = QUANTITIES.iter().map(|quantity| (quantity.get)(heliostat));
        for number in points.into_iter().chain(quantities) {
            hash.update(&number.to_bits().to_le_bytes());
        }
    }
    hash.finish()
}

/// The tracking mode that was asked for.
pub(super) fn mode(
    word: Option<&Bound<'_, PyAny>>,
    axis_azimuth_rad: Option<&Bound<'_, PyAny>>,
    latitude_rad: Option<&Bound<'_, PyAny>>,
    site: Option<&Site>,
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
        if word == of && value.is_none() && !(of == "polar" && site.is_some()) {
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
        None => Ok(site.map_or(0.0, |site| site.latitude_rad)),
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

/// Columns as a call gives them; the quantities of a mount are keywords besides.
pub(super) struct Given<'a, 'py> {
    pub(super) position_enu_m: &'a Bound<'py, PyAny>,
    pub(super) aim_enu_m: Option<&'a Bound<'py, PyAny>>,
    pub(super) aim: Option<&'a Bound<'py, PyAny>>,
    pub(super) ids: Option<&'a Bound<'py, PyAny>>,
    pub(super) mode: TrackingMode,
    pub(super) drives: Option<&'a Bound<'py, PyAny>>,
    pub(super) quantities: Option<&'a Bound<'py, PyDict>>,
}

/// The parts of a field from columns; `site` and `targets` are what surrounds it.
pub(super) fn parts(
    columns: &Given<'_, '_>,
    (site, targets): (Option<Site>, BTreeMap<String, Target>),
) -> Result<FieldParts, Failure> {
    let pivots = Numbers::of(columns.position_enu_m, "position_enu_m")?;
    let [len, 3] = *pivots.shape() else {
        return Err(not_points("position_enu_m", "(n, 3)", pivots.shape()));
    };
    let (aims, target_of) = match (columns.aim_enu_m, columns.aim) {
        (Some(aims), None) => (Some(Numbers::of(aims, "aim_enu_m")?), vec![None; len]),
        (None, Some(aim)) => (None, named(aim, len, &targets)?),
        (None, None) => {
            let message =
                "what the heliostats aim at is missing; wanted points, or aim and targets";
            return Err(Failure::of("MissingError", "aim_enu_m", message));
        }
        (Some(_), Some(_)) => {
            let message = "it stands beside aim_enu_m; wanted one of the two";
            return Err(Failure::of("OptionError", "aim", message));
        }
    };
    if let Some(aims) = &aims
        && aims.shape() != [3]
        && aims.shape() != [len, 3]
    {
        let wanted = format!("(3,) or ({len}, 3)");
        return Err(not_points("aim_enu_m", &wanted, aims.shape()));
    }
    let one_aim = aims.as_ref().is_some_and(|aims| aims.shape().len() == 1);
    let ids = names(columns.ids, "ids", len)?;
    let given = quantities(columns.quantities)?;
    let given: Vec<(&Quantity, Column<'_>)> = given
        .iter()
        .map(|(quantity, numbers)| Ok((*quantity, numbers.column(quantity.name, len)?)))
        .collect::<Result<_, Failure>>()?;
    let drives = drives(columns.drives, len)?;
    let pivots = pivots.as_slice()?;
    let aims = aims.as_ref().map(Numbers::as_slice).transpose()?;
    let point = |numbers: &[f64], row: usize| {
        Enu::new(numbers[3 * row], numbers[3 * row + 1], numbers[3 * row + 2])
    };
    let mut field = Field::new(columns.mode);
    for (row, id) in ids.iter().enumerate() {
        let aim = aims.map(|aims| point(aims, if one_aim { 0 } else { row }));
        let mut heliostat = Heliostat {
            pivot: point(pivots, row),
            aim: aim.unwrap_or_default(),
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
    Ok(FieldParts {
        field,
        site,
        targets,
        target_of,
        drives,
    })
}

/// Numbers of targets by their names: one for all, or one for each.
fn named(
    aim: &Bound<'_, PyAny>,
    len: usize,
    targets: &BTreeMap<String, Target>,
) -> Result<Vec<Option<usize>>, Failure> {
    let number = |name: &str, row: Option<usize>| {
        let found = targets.keys().position(|known| known == name);
        found.map(Some).ok_or_else(|| {
            let known = targets.keys().map(String::as_str).collect::<Vec<_>>();
            let known = match known.is_empty() {
                true => "there are none: give `targets`".to_owned(),
                false => format!("known are {}", known.join(", ")),
            };
            let failure = Failure::of(
                "UnknownNameError",
                "aim",
                format_args!("unknown target `{name}`; {known}"),
            );
            match row {
                Some(row) => failure.with_row(row),
                None => failure,
            }
        })
    };
    if let Ok(name) = aim.cast::<PyString>() {
        return Ok(vec![number(&name.to_cow()?, None)?; len]);
    }
    let names = names(Some(aim), "aim", len)?;
    let rows = names.iter().enumerate();
    rows.map(|(row, name)| number(name, Some(row))).collect()
}

/// Drives of both axes: a pair for all heliostats, or one for each.
fn drives(
    drives: Option<&Bound<'_, PyAny>>,
    len: usize,
) -> Result<Vec<[Option<Drive>; 2]>, Failure> {
    let Some(drives) = drives else {
        return Ok(vec![[None; 2]; len]);
    };
    let refuse = || {
        let message = "expected a pair of Drive or None, or such a pair for each heliostat";
        Failure::of("DataTypeError", "drives", message)
    };
    let pair = |pair: &Bound<'_, PyAny>| -> Result<[Option<Drive>; 2], Failure> {
        let (one, two): (Option<PyDrive>, Option<PyDrive>) =
            pair.extract().map_err(|_| refuse())?;
        Ok([one, two].map(|drive| drive.map(|PyDrive(drive)| drive)))
    };
    if let Ok(pair) = pair(drives) {
        return Ok(vec![pair; len]);
    }
    let each = drives.try_iter().map_err(|_| refuse())?;
    let each: Vec<_> = each
        .enumerate()
        .map(|(row, drives)| pair(&drives?).map_err(|failure| failure.with_row(row)))
        .collect::<Result<_, _>>()?;
    if each.len() != len {
        let (wanted, found) = (rows(len), rows(each.len()));
        let message = format!("expected shape {wanted}, got {found}");
        return Err(Failure::of("ShapeError", "drives", message));
    }
    Ok(each)
}

/// The quantities among the keywords, each of which must be one.
fn quantities<'py>(
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

fn names(names: Option<&Bound<'_, PyAny>>, what: &str, len: usize) -> Result<Vec<String>, Failure> {
    let Some(given) = names else {
        return Ok((0..len).map(|row| row.to_string()).collect());
    };
    let refuse = || {
        let found = given.get_type();
        let message = format!("expected a sequence of str, got {found}");
        Failure::of("DataTypeError", what, message)
    };
    if given.is_instance_of::<PyString>() {
        return Err(refuse());
    }
    let mut names = Vec::with_capacity(len);
    for (row, name) in given.try_iter().map_err(|_| refuse())?.enumerate() {
        let name = name?;
        let Ok(text) = name.cast::<PyString>() else {
            let found = name.get_type();
            let message = format!("row {row} must be a str, got {found}");
            return Err(Failure::of("DataTypeError", what, message));
        };
        names.push(text.to_cow()?.into_owned());
    }
    if names.len() != len {
        let (wanted, found) = (rows(len), rows(names.len()));
        let message = format!("expected shape {wanted}, got {found}");
        return Err(Failure::of("ShapeError", what, message));
    }
    Ok(names)
}
