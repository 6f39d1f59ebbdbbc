//! The calibration table: written for `track` to read, and read to compare with.

use helio_core::angle::{degrees, radians};
use helio_core::{MountErrors, PoseErrors};

use crate::error::{IoError, Problem};
use crate::field::ignored_in_calibrations;
use crate::keys::{self, Key};
use crate::output::{Cells, Destination, Format, write_columns};
use crate::table::{Keyed, Naming, Table, TableSource};

/// One parameter set of one heliostat: a row of the calibration table.
///
/// Angles are radians here and degrees in the table. Numbers that do not exist are NaN here and absent
/// there.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibratedSet {
    /// The heliostat.
    pub id: String,
    /// Name of the set; empty where the heliostat has only one.
    pub set: String,
    /// The six errors; `None` where the fit is no good, and the layout's errors hold.
    pub errors: Option<MountErrors>,
    /// Pose errors \[rad\] in the order of [`PoseErrors`], where they are stated; the layout's hold where they
    /// are not.
    pub pose_errors_rad: [Option<f64>; 3],
    /// Mirror offset \[m\], where it was fitted.
    pub mirror_offset_m: Option<f64>,
    /// When the set begins to hold \[ns of Unix time\]; `None`: always has.
    pub valid_from_ns: Option<i64>,
    /// When it no longer holds \[ns of Unix time\]; `None`: never.
    pub valid_to_ns: Option<i64>,
    /// Hour angle of the sun from which it holds \[rad\], west positive; `None`: all day.
    pub hour_angle_from_rad: Option<f64>,
    /// Hour angle of the sun up to which it holds \[rad\]; `None`: all day.
    pub hour_angle_to_rad: Option<f64>,
    /// Standard errors \[rad\], the last \[m\], in the order of [`CalibratedSet::SIGMAS`].
    pub sigmas: [f64; 7],
    /// Covariance \[rad², rad·m, m²\] in the order of [`helio_calib::Parameter::ALL`]; rows of parameters that
    /// were not fitted are zero.
    pub covariance: Option<[[f64; 7]; 7]>,
    /// RMS over pivot-to-target-centre distance \[mrad\].
    pub rms_mrad: f64,
    /// RMS angle at the mirror between predicted beam and measured spot \[mrad\].
    pub beam_rms_mrad: f64,
    /// Observations used.
    pub observations: usize,
    /// Observations rejected.
    pub rejected: usize,
    /// Iterations of the solver; `None` where it did not run.
    pub iterations: Option<usize>,
    /// Condition number of the scaled Jacobian.
    pub condition: f64,
    /// Predicted pointing uncertainty, RMS over the year's sun positions \[mrad\].
    pub year_pointing_mrad: f64,
    /// First and last time of its observations \[ns of Unix time\].
    pub observed_ns: Option<(i64, i64)>,
    /// What the joint fit of a field says besides, where the set comes from one.
    pub joint: Option<JointColumns>,
    /// `ok`, or what is the matter.
    pub status: String,
    /// The reason of a status other than `ok`, in words.
    pub why: String,
}

/// What the joint fit of a field says of a heliostat besides its set: columns of their own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointColumns {
    /// One standard deviation of each pose error \[rad\], in the order of [`PoseErrors`].
    pub pose_sigmas_rad: [f64; 3],
    /// Jumps of zero points that are remembered.
    pub jumps: usize,
    /// Zero points of either axis less those at rest, after its last record \[rad\].
    pub zero_rad: [f64; 2],
    /// One standard deviation of them \[rad\].
    pub zero_sigma_rad: [f64; 2],
    /// Expected miss of its beam at its aim on the day that the set is for \[mrad\].
    pub foretold_mrad: f64,
    /// What was expected of the misses that [`CalibratedSet::beam_rms_mrad`] counts, RMS \[mrad\].
    pub expected_mrad: f64,
}

impl JointColumns {
    /// Columns in the table, in order.
    pub const NAMES: [&'static str; 10] = [
        "sigma_axis1_sag_mrad",
        "sigma_axis2_sag_mrad",
        "sigma_axis2_eccentricity_mrad",
        "jumps",
        "axis1_zero_mrad",
        "axis2_zero_mrad",
        "sigma_axis1_zero_mrad",
        "sigma_axis2_zero_mrad",
        "foretold_mrad",
        "expected_mrad",
    ];

    fn numbers(&self) -> [f64; 10] {
        let [a, b, c] = self.pose_sigmas_rad.map(|sigma| 1e3 * sigma);
        let [d, e] = self.zero_rad.map(|zero| 1e3 * zero);
        let [f, g] = self.zero_sigma_rad.map(|sigma| 1e3 * sigma);
        let jumps = self.jumps as f64;
        let (day, seen) = (self.foretold_mrad, self.expected_mrad);
        [a, b, c, jumps, d, e, f, g, day, seen]
    }
}

/// What a calibration table comes from: the same for all its rows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Version of the program.
    pub version: String,
    /// The solver's word.
    pub solver: String,
    /// The residual's word.
    pub residual: String,
    /// The robust loss' word.
    pub robust: String,
    /// Hash of the field's files.
    pub field_hash: String,
    /// Hash of the observations.
    pub observations_hash: String,
    /// Hash of the options.
    pub options_hash: String,
}

impl CalibratedSet {
    /// Columns of the standard errors.
    pub const SIGMAS: [&'static str; 7] = [
        "sigma_pedestal_tilt_mrad",
        "sigma_pedestal_tilt_azimuth_deg",
        "sigma_axis_nonorthogonality_mrad",
        "sigma_mirror_tilt_mrad",
        "sigma_azimuth_reference_mrad",
        "sigma_elevation_reference_mrad",
        "sigma_mirror_offset_m",
    ];

    /// A set without a result.
    #[must_use]
    pub fn without_result(id: &str, status: &str, why: &str) -> Self {
        Self {
            id: id.to_owned(),
            set: String::new(),
            errors: None,
            pose_errors_rad: [None; 3],
            mirror_offset_m: None,
            valid_from_ns: None,
            valid_to_ns: None,
            hour_angle_from_rad: None,
            hour_angle_to_rad: None,
            sigmas: [f64::NAN; 7],
            covariance: None,
            rms_mrad: f64::NAN,
            beam_rms_mrad: f64::NAN,
            observations: 0,
            rejected: 0,
            iterations: None,
            condition: f64::NAN,
            year_pointing_mrad: f64::NAN,
            observed_ns: None,
            joint: None,
            status: status.to_owned(),
            why: why.to_owned(),
        }
    }

    /// Its pose errors: the layout's where it states none of its own.
    #[must_use]
    pub fn pose_errors(&self, layout: PoseErrors) -> PoseErrors {
        pose_errors_over(self.pose_errors_rad, layout)
    }

    /// What a set states of a mount's pose errors: all three, or nothing where the mount has none.
    #[must_use]
    pub fn stated(pose_errors: PoseErrors) -> [Option<f64>; 3] {
        if pose_errors.is_none() {
            [None; 3]
        } else {
            pose_errors.to_array().map(Some)
        }
    }
}

/// What is stated of them, and the layout's for the rest.
pub(crate) fn pose_errors_over(stated: [Option<f64>; 3], layout: PoseErrors) -> PoseErrors {
    let layout = layout.to_array();
    PoseErrors::from_array(std::array::from_fn(|k| stated[k].unwrap_or(layout[k])))
}

/// Degrees that are read back as this angle \[rad\] to the last bit where any double is, and otherwise
/// as the nearest that one is: degrees lie less densely than radians here and there.
///
/// ```
/// use helio_core::angle::radians;
/// assert_eq!(helio_io::degrees_for(radians(12.3)), 12.3);
/// let angle_rad = 1.234567890123456;
/// assert!((radians(helio_io::degrees_for(angle_rad)) - angle_rad).abs() < 3e-16);
/// ```
#[must_use]
pub fn degrees_for(angle_rad: f64) -> f64 {
    let near = degrees(angle_rad);
    if !near.is_finite() {
        return near;
    }
    // What somebody wrote with few digits stays short.
    let short = (near * 1e9).round() / 1e9;
    let off = |deg: f64| (radians(deg) - angle_rad).abs();
    [near, near.next_up(), near.next_down()]
        .into_iter()
        .fold(
            short,
            |best, other| if off(other) < off(best) { other } else { best },
        )
}

/// A mount's errors as reading them back from a table gives them.
///
/// What [`write_calibration`] writes for these is read back as the same doubles, whatever the angles.
#[must_use]
pub fn errors_as_written(errors: &MountErrors) -> MountErrors {
    let written = |angle_rad: f64| radians(degrees_for(angle_rad));
    MountErrors {
        pedestal_tilt_rad: written(errors.pedestal_tilt_rad),
        pedestal_tilt_azimuth_rad: written(errors.pedestal_tilt_azimuth_rad),
        axis_nonorthogonality_rad: written(errors.axis_nonorthogonality_rad),
        mirror_tilt_rad: written(errors.mirror_tilt_rad),
        azimuth_reference_rad: written(errors.azimuth_reference_rad),
        elevation_reference_rad: written(errors.elevation_reference_rad),
    }
}

/// The six errors of [`MountErrors`] in the order of the table's columns.
fn in_order(e: &MountErrors) -> [f64; 6] {
    [
        e.pedestal_tilt_rad,
        e.pedestal_tilt_azimuth_rad,
        e.axis_nonorthogonality_rad,
        e.mirror_tilt_rad,
        e.azimuth_reference_rad,
        e.elevation_reference_rad,
    ]
}

const ERRORS: [&Key; 6] = [
    &keys::PEDESTAL_TILT,
    &keys::PEDESTAL_TILT_AZIMUTH,
    &keys::NONORTHOGONALITY,
    &keys::MIRROR_TILT,
    &keys::AZIMUTH_REFERENCE,
    &keys::ELEVATION_REFERENCE,
];

/// Writes a calibration table that [`load_field`](crate::load_field) reads; the number of its bytes.
///
/// The column `covariance` holds the lower triangle of the covariance row by row, numbers separated by
/// blanks, in radians and metres and in the order of [`helio_calib::Parameter::ALL`]: the tilt's two components
/// along the mount's axes, azimuth reference, axis non-orthogonality, elevation reference, mirror tilt,
/// mirror offset.
///
/// # Errors
/// [`IoError`] if it cannot be written; there is then no file.
pub fn write_calibration(
    destination: Destination,
    format: Format,
    sets: &[CalibratedSet],
    provenance: &Provenance,
) -> Result<u64, IoError> {
    let numbers = |of: &dyn Fn(&CalibratedSet) -> f64| sets.iter().map(of).collect::<Vec<f64>>();
    let texts = |of: &dyn Fn(&CalibratedSet) -> String| sets.iter().map(of).collect::<Vec<_>>();
    let whole = |of: &dyn Fn(&CalibratedSet) -> Option<usize>| -> Vec<Option<i64>> {
        let signed = |count: usize| i64::try_from(count).ok();
        sets.iter().map(|set| of(set).and_then(signed)).collect()
    };
    let times =
        |of: &dyn Fn(&CalibratedSet) -> Option<i64>| sets.iter().map(of).collect::<Vec<_>>();
    let same = |text: &str| vec![text.to_owned(); sets.len()];

    let (ids, names) = (texts(&|s| s.id.clone()), texts(&|s| s.set.clone()));
    let errors: [Vec<f64>; 6] = std::array::from_fn(|k| {
        numbers(&|s| {
            s.errors
                .as_ref()
                .map_or(f64::NAN, |e| degrees_for(in_order(e)[k]))
        })
    });
    let pose_errors: [Vec<f64>; 3] =
        std::array::from_fn(|k| numbers(&|s| s.pose_errors_rad[k].map_or(f64::NAN, degrees_for)));
    let offsets = numbers(&|s| s.mirror_offset_m.unwrap_or(f64::NAN));
    let (from, to) = (times(&|s| s.valid_from_ns), times(&|s| s.valid_to_ns));
    let hour = |angle: Option<f64>| angle.map_or(f64::NAN, degrees_for);
    let (hour_from, hour_to) = (
        numbers(&|s| hour(s.hour_angle_from_rad)),
        numbers(&|s| hour(s.hour_angle_to_rad)),
    );
    let sigmas: [Vec<f64>; 7] = std::array::from_fn(|k| {
        numbers(&|s| match k {
            1 => degrees(s.sigmas[k]),
            6 => s.sigmas[k],
            _ => 1e3 * s.sigmas[k],
        })
    });
    let covariances = texts(&|s| s.covariance.as_ref().map_or(String::new(), triangle));
    let (rms, beam_rms) = (numbers(&|s| s.rms_mrad), numbers(&|s| s.beam_rms_mrad));
    let used = whole(&|s| Some(s.observations));
    let rejected = whole(&|s| Some(s.rejected));
    let iterations = whole(&|s| s.iterations);
    let condition = numbers(&|s| s.condition);
    let year = numbers(&|s| s.year_pointing_mrad);
    let (first, last) = (
        times(&|s| s.observed_ns.map(|t| t.0)),
        times(&|s| s.observed_ns.map(|t| t.1)),
    );
    let joint: [Vec<f64>; 10] = std::array::from_fn(|k| {
        numbers(&|s| s.joint.as_ref().map_or(f64::NAN, |j| j.numbers()[k]))
    });
    let jumps = whole(&|s| s.joint.as_ref().map(|j| j.jumps));
    let (status, why) = (texts(&|s| s.status.clone()), texts(&|s| s.why.clone()));
    let origin = [
        ("version", &provenance.version),
        ("solver", &provenance.solver),
        ("residual", &provenance.residual),
        ("robust", &provenance.robust),
        ("field_hash", &provenance.field_hash),
        ("observations_hash", &provenance.observations_hash),
        ("options_hash", &provenance.options_hash),
    ]
    .map(|(name, text)| (name, same(text)));

    let mut columns = vec![("id", Cells::Text(&ids)), ("set", Cells::Text(&names))];
    columns.extend(
        ERRORS
            .iter()
            .zip(&errors)
            .map(|(key, column)| (key.name, Cells::Numbers(column))),
    );
    let any = |column: &[f64]| column.iter().any(|value| value.is_finite());
    for (key, column) in keys::POSE_ERRORS.iter().zip(&pose_errors) {
        if any(column) {
            columns.push((key.name, Cells::Numbers(column)));
        }
    }
    if any(&offsets) {
        columns.push((keys::MIRROR_OFFSET.name, Cells::Numbers(&offsets)));
    }
    columns.extend([
        (keys::VALID_FROM.name, Cells::Times(&from)),
        (keys::VALID_TO.name, Cells::Times(&to)),
        (keys::HOUR_ANGLE_FROM.name, Cells::Numbers(&hour_from)),
        (keys::HOUR_ANGLE_TO.name, Cells::Numbers(&hour_to)),
    ]);
    for (k, (name, column)) in CalibratedSet::SIGMAS.into_iter().zip(&sigmas).enumerate() {
        if k < 6 || any(column) {
            columns.push((name, Cells::Numbers(column)));
        }
    }
    columns.extend([
        (keys::COVARIANCE.name, Cells::Text(&covariances)),
        (keys::RMS.name, Cells::Numbers(&rms)),
        (keys::BEAM_RMS.name, Cells::Numbers(&beam_rms)),
        ("observations", Cells::Whole(&used)),
        ("rejected", Cells::Whole(&rejected)),
        ("iterations", Cells::Whole(&iterations)),
        ("condition", Cells::Numbers(&condition)),
        ("year_pointing_mrad", Cells::Numbers(&year)),
        ("first_time", Cells::Times(&first)),
        ("last_time", Cells::Times(&last)),
    ]);
    if sets.iter().any(|set| set.joint.is_some()) {
        for (name, column) in JointColumns::NAMES.into_iter().zip(&joint) {
            columns.push((
                name,
                if name == "jumps" {
                    Cells::Whole(&jumps)
                } else {
                    Cells::Numbers(column)
                },
            ));
        }
    }
    columns.extend([
        (keys::STATUS.name, Cells::Text(&status)),
        ("why", Cells::Text(&why)),
    ]);
    columns.extend(
        origin
            .iter()
            .map(|(name, cells)| (*name, Cells::Text(cells))),
    );
    write_columns(destination, format, &columns)
}

/// The lower triangle row by row; nothing after the last row that is not all zero.
fn triangle(covariance: &[[f64; 7]; 7]) -> String {
    let rows = covariance
        .iter()
        .rposition(|row| row.iter().any(|value| *value != 0.0))
        .map_or(0, |last| last + 1);
    let mut text = String::new();
    for (k, row) in covariance.iter().enumerate().take(rows) {
        for value in &row[..=k] {
            if !text.is_empty() {
                text.push(' ');
            }
            text.push_str(zmij::Buffer::new().format(*value));
        }
    }
    text
}

fn covariance(text: &str) -> Option<[[f64; 7]; 7]> {
    let numbers: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|word| word.parse().ok().filter(|value: &f64| value.is_finite()))
        .collect();
    let numbers = numbers?;
    // 1 + 2 + … numbers of whole rows, and nothing beside them.
    let rows = (0..=7).find(|n| n * (n + 1) / 2 == numbers.len())?;
    let mut matrix = [[0.0; 7]; 7];
    let places = (0..rows).flat_map(|row| (0..=row).map(move |column| (row, column)));
    for ((row, column), value) in places.zip(numbers) {
        matrix[row][column] = value;
        matrix[column][row] = value;
    }
    Some(matrix)
}

/// Reads a calibration table to compare another with: ids, sets, errors, pose errors, validity, covariance, RMS
/// and status. Rows without numbers are there too; standard errors and counts are not read.
///
/// # Errors
/// [`IoError`] for an unknown or missing column and for cells that are not what their column wants.
pub fn load_calibration<'a>(
    table: impl Into<TableSource<'a>>,
) -> Result<Vec<CalibratedSet>, IoError> {
    let ignore = |name: &str| {
        ignored_in_calibrations(name)
            && keys::names(keys::COMPARED_COLUMNS).all(|known| known != name)
    };
    let naming = Naming {
        synonyms: &[("heliostat", "id"), ("heliostat_id", "id")],
        ignore: Some(&ignore),
        ..Naming::default()
    };
    let table = Keyed::new(Table::read(table)?, keys::COMPARED_COLUMNS, &naming)?;
    if !ERRORS.iter().any(|key| table.has(key)) {
        return Err(table.missing_column(ERRORS[0]));
    }
    (0..table.table().rows())
        .map(|row| {
            let id = table.id(row, &keys::ID)?;
            let number = |key| table.number(row, key, Some(&id));
            let text = |key| {
                let text = table.text(row, key, &id)?;
                Ok::<_, IoError>(text.map_or(String::new(), |text| text.into_owned()))
            };
            let mut stated = [None; 6];
            for (slot, key) in stated.iter_mut().zip(ERRORS) {
                *slot = number(key)?.map(radians);
            }
            let mut pose_errors_rad = [None; 3];
            for (slot, key) in pose_errors_rad.iter_mut().zip(keys::POSE_ERRORS) {
                *slot = number(key)?.map(radians);
            }
            let known = stated.iter().any(Option::is_some);
            let [tilt, lean, skew, mirror, azimuth, elevation] =
                stated.map(|angle| angle.unwrap_or(0.0));
            let spread = text(&keys::COVARIANCE)?;
            let covariance = if spread.is_empty() {
                None
            } else {
                let refuse = || {
                    let message =
                        "must be the lower triangle of a matrix, numbers separated by blanks";
                    table.error(
                        row,
                        &keys::COVARIANCE,
                        Some(&id),
                        Problem::Conflict {
                            message: message.into(),
                        },
                    )
                };
                Some(covariance(&spread).ok_or_else(refuse)?)
            };
            Ok(CalibratedSet {
                set: text(&keys::SET)?,
                errors: known.then_some(MountErrors {
                    pedestal_tilt_rad: tilt,
                    pedestal_tilt_azimuth_rad: lean,
                    axis_nonorthogonality_rad: skew,
                    mirror_tilt_rad: mirror,
                    azimuth_reference_rad: azimuth,
                    elevation_reference_rad: elevation,
                }),
                pose_errors_rad,
                mirror_offset_m: number(&keys::MIRROR_OFFSET)?,
                valid_from_ns: table.time(row, &keys::VALID_FROM, &id)?,
                valid_to_ns: table.time(row, &keys::VALID_TO, &id)?,
                hour_angle_from_rad: number(&keys::HOUR_ANGLE_FROM)?.map(radians),
                hour_angle_to_rad: number(&keys::HOUR_ANGLE_TO)?.map(radians),
                covariance,
                rms_mrad: number(&keys::RMS)?.unwrap_or(f64::NAN),
                beam_rms_mrad: number(&keys::BEAM_RMS)?.unwrap_or(f64::NAN),
                ..CalibratedSet::without_result(&id, &text(&keys::STATUS)?, "")
            })
        })
        .collect()
}
