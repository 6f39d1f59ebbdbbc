//! The calibration table, and the schedule of parameter sets it makes.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::Range;

use helio_core::angle::{radians, wrap_pi};
use helio_core::error::FieldError;
use helio_core::{Field, Heliostat, MountErrors, PoseErrors};

use super::in_row;
use super::layout::shown;
use crate::calibrated::{CalibratedSet, pose_errors_over};
use crate::error::{IoError, Place, Problem, quoted};
use crate::keys::{self, Key};
use crate::table::{Keyed, Naming, Table};
use crate::toml::check_name;

/// Columns of a calibration table that tracking leaves aside, besides `sigma_*`, `cov*` and `corr*`:
/// how good a fit is and where it comes from.
pub(crate) const IGNORED: &[&str] = &[
    "rms_mrad",
    "beam_rms_mrad",
    "rms_m",
    "observations",
    "rejected",
    "iterations",
    "condition",
    "residual_sum",
    "status",
    "solver",
    "residual",
    "robust",
    "target",
    "first_time",
    "last_time",
    "created",
    "version",
    "input_hash",
    "observations_hash",
    "field_hash",
    "options_hash",
    "year_pointing_mrad",
    "jumps",
    "axis1_zero_mrad",
    "axis2_zero_mrad",
    "foretold_mrad",
    "expected_mrad",
    "why",
];

pub(crate) fn ignored(name: &str) -> bool {
    IGNORED.contains(&name)
        || ["sigma", "cov", "corr"]
            .iter()
            .any(|begin| name.starts_with(begin))
}

/// One calibrated parameter set of one heliostat.
#[derive(Debug, Clone, PartialEq)]
struct Set {
    name: String,
    errors: MountErrors,
    pose_errors: PoseErrors,
    mirror_offset_m: f64,
    /// Times \[ns\], the end excluded.
    valid: Range<i64>,
    /// Hour angles \[rad\].
    from_rad: f64,
    to_rad: f64,
    /// True if a time or an hour angle is stated.
    bounded: bool,
}

impl Set {
    /// Of a calibrated set; `None` without errors.
    fn of(set: &CalibratedSet, base: &Heliostat) -> Option<Self> {
        let (from, to) = (set.hour_angle_from_rad, set.hour_angle_to_rad);
        let (begin, end) = (set.valid_from_ns, set.valid_to_ns);
        Some(Self {
            name: set.set.clone(),
            errors: set.errors?,
            pose_errors: set.pose_errors(base.pose_errors),
            mirror_offset_m: set.mirror_offset_m.unwrap_or(base.mirror_offset_m),
            valid: begin.unwrap_or(i64::MIN)..end.unwrap_or(i64::MAX),
            from_rad: from.unwrap_or(-PI),
            to_rad: to.unwrap_or(PI),
            bounded: [from, to].iter().any(Option::is_some) || begin.is_some() || end.is_some(),
        })
    }

    fn apply(&self, base: Heliostat) -> Heliostat {
        Heliostat {
            errors: self.errors,
            pose_errors: self.pose_errors,
            mirror_offset_m: self.mirror_offset_m,
            ..base
        }
    }

    /// This set passing into another: `weight` is the other's share.
    ///
    /// The tilt is blended as a vector, since its azimuth means nothing where it is zero; the
    /// references the short way round.
    fn blend(&self, other: &Self, weight: f64, base: Heliostat) -> Heliostat {
        let (a, b) = (&self.errors, &other.errors);
        let mix = |from: f64, to: f64| from + weight * (to - from);
        let turn = |from: f64, to: f64| from + weight * wrap_pi(to - from);
        let lean = |e: &MountErrors| {
            let (sin, cos) = e.pedestal_tilt_azimuth_rad.sin_cos();
            (e.pedestal_tilt_rad * cos, e.pedestal_tilt_rad * sin)
        };
        let (from, to) = (lean(a), lean(b));
        let (along, across) = (mix(from.0, to.0), mix(from.1, to.1));
        let errors = MountErrors {
            pedestal_tilt_rad: along.hypot(across),
            pedestal_tilt_azimuth_rad: across.atan2(along),
            axis_nonorthogonality_rad: mix(
                a.axis_nonorthogonality_rad,
                b.axis_nonorthogonality_rad,
            ),
            mirror_tilt_rad: mix(a.mirror_tilt_rad, b.mirror_tilt_rad),
            azimuth_reference_rad: turn(a.azimuth_reference_rad, b.azimuth_reference_rad),
            elevation_reference_rad: turn(a.elevation_reference_rad, b.elevation_reference_rad),
        };
        let (from, to) = (self.pose_errors.to_array(), other.pose_errors.to_array());
        let pose_errors = PoseErrors::from_array(std::array::from_fn(|k| mix(from[k], to[k])));
        let mirror_offset_m = mix(self.mirror_offset_m, other.mirror_offset_m);
        Heliostat {
            errors,
            pose_errors,
            mirror_offset_m,
            ..base
        }
    }
}

/// Calibrated parameters that change with the hour or the date.
///
/// A heliostat may have several parameter sets, each for a span of time (`valid_from` up to, not
/// including, `valid_to`) and of hour angle (west positive, zero at solar noon). At any time:
///
/// - Of the sets valid then, the one in whose hour angles the sun stands counts. Around the boundary
///   of two neighbours they blend linearly over `blend_deg` of hour angle (half of it on each side, less
///   where a set is narrower than that); the boundary of neighbours that leave a gap or overlap lies in
///   the middle. Before the first and after the last set those two hold, up to midnight.
/// - Where no set is valid, the heliostat is as the layout states it. Without a time (sun given by
///   its angles) the sets of the last span of time count.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationSchedule {
    base: Vec<Heliostat>,
    /// By heliostat, then hour angle.
    sets: Vec<Set>,
    of_row: Vec<Range<usize>>,
    varying: Vec<usize>,
    blend_rad: f64,
}

/// Heliostats whose calibration does not hold all the time; see [`CalibrationSchedule::lapse`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Lapse {
    /// How many.
    pub heliostats: usize,
    /// Row of the first of them in the field.
    pub first: usize,
    /// When the last of their sets ceases to hold \[ns of Unix time\]; `None` if none does.
    pub last_valid_to_ns: Option<i64>,
}

impl CalibrationSchedule {
    /// The heliostats that have calibrated sets, but at some time from `from_ns` to `to_ns` \[ns of
    /// Unix time\] no valid one, so that the layout's errors hold; `None` if there is none.
    #[must_use]
    pub fn lapse(&self, from_ns: i64, to_ns: i64) -> Option<Lapse> {
        let mut lapse: Option<Lapse> = None;
        for &row in &self.varying {
            let mut spans: Vec<&Range<i64>> = self.sets[self.of_row[row].clone()]
                .iter()
                .map(|set| &set.valid)
                .collect();
            spans.sort_by_key(|span| span.start);
            // Covered up to, not including.
            let mut covered = from_ns;
            for span in &spans {
                if span.start <= covered {
                    covered = covered.max(span.end);
                }
            }
            if covered > to_ns {
                continue;
            }
            let ends = spans.iter().map(|span| span.end);
            let last = ends.max().filter(|&end| end != i64::MAX);
            let found = lapse.get_or_insert(Lapse {
                heliostats: 0,
                first: row,
                last_valid_to_ns: None,
            });
            found.heliostats += 1;
            found.last_valid_to_ns = found.last_valid_to_ns.max(last);
        }
        lapse
    }

    /// What parameter sets say about some heliostats: the sets of each, in any order, over what is known of
    /// it without them. Sets without errors say nothing; `blend_rad` is the hour angle over which neighbours
    /// blend \[rad\].
    #[must_use]
    pub fn of_sets(base: Vec<Heliostat>, sets: &[Vec<&CalibratedSet>], blend_rad: f64) -> Self {
        let found = base.iter().zip(sets).map(|(base, sets)| {
            let sets = sets.iter().filter_map(|set| Set::of(set, base));
            sets.enumerate().collect()
        });
        let found = found.collect();
        arranged(found, base, blend_rad)
    }

    /// A heliostat as calibrated for a time \[ns of Unix time\] and hour angle of the sun \[rad\], west
    /// positive.
    ///
    /// # Errors
    /// [`FieldError::NoSuchRow`] if `row` is not in the field.
    pub fn heliostat_at(
        &self,
        row: usize,
        unix_ns: Option<i64>,
        hour_angle_rad: f64,
    ) -> Result<Heliostat, FieldError> {
        let of = in_row(&self.of_row, row)?;
        Ok(self.told(self.base[row], of, unix_ns, hour_angle_rad))
    }

    fn told(
        &self,
        base: Heliostat,
        of: &Range<usize>,
        unix_ns: Option<i64>,
        hour_angle_rad: f64,
    ) -> Heliostat {
        match self.holding(of, unix_ns, hour_angle_rad) {
            None => base,
            Some((here, None)) => here.apply(base),
            Some((here, Some((there, weight)))) => here.blend(there, weight, base),
        }
    }

    /// The name of the set that holds at a time and hour angle, as [`heliostat_at`](Self::heliostat_at);
    /// where two blend, of the one with the greater share. `None` where none is valid.
    ///
    /// # Errors
    /// [`FieldError::NoSuchRow`] if `row` is not in the field.
    pub fn set_at(
        &self,
        row: usize,
        unix_ns: Option<i64>,
        hour_angle_rad: f64,
    ) -> Result<Option<&str>, FieldError> {
        let holding = self.holding(in_row(&self.of_row, row)?, unix_ns, hour_angle_rad);
        Ok(holding.map(|(here, next)| {
            let greater = next.filter(|(_, weight)| *weight > 0.5);
            greater.map_or(here, |(there, _)| there).name.as_str()
        }))
    }

    /// The set of some that holds, and the one it is passing into with that one's share.
    fn holding(
        &self,
        of: &Range<usize>,
        unix_ns: Option<i64>,
        hour_angle_rad: f64,
    ) -> Option<(&Set, Option<(&Set, f64)>)> {
        let sets = &self.sets[of.clone()];
        // Without a time, the last instant of the last span.
        let last = || {
            sets.iter()
                .map(|set| set.valid.end - 1)
                .max()
                .unwrap_or(i64::MAX)
        };
        let now = unix_ns.unwrap_or_else(last);
        let mut valid = sets.iter().filter(|set| set.valid.contains(&now));
        let mut here = valid.next()?;
        let hour = wrap_pi(hour_angle_rad);
        let boundary = |a: &Set, b: &Set| 0.5 * (a.to_rad + b.from_rad);
        let mut next = valid.next();
        let mut before = f64::NEG_INFINITY;
        while let Some(there) = next {
            next = valid.next();
            let middle = boundary(here, there);
            let after = next.map_or(f64::INFINITY, |beyond| boundary(there, beyond));
            let half = (0.5 * self.blend_rad)
                .min(0.5 * (middle - before))
                .min(0.5 * (after - middle));
            if hour < middle - half {
                return Some((here, None));
            }
            if hour < middle + half {
                let weight = (hour - (middle - half)) / (2.0 * half);
                return Some((here, Some((there, weight))));
            }
            (here, before) = (there, middle);
        }
        Some((here, None))
    }

    /// Rows whose parameters change with the hour or the date, ascending; the others' are constant
    /// and stand in the field.
    #[must_use]
    pub fn varying_rows(&self) -> &[usize] {
        &self.varying
    }

    /// Brings a field up to date; true if anything changed, so that a tracker must be made anew.
    ///
    /// # Errors
    /// [`FieldError`] as for [`Field::replace`], so also if the field has fewer rows than the one this schedule was
    /// loaded with.
    pub fn update(
        &self,
        field: &mut Field,
        unix_ns: Option<i64>,
        hour_angle_rad: f64,
    ) -> Result<bool, FieldError> {
        let mut changed = false;
        for &row in &self.varying {
            let heliostat = self.heliostat_at(row, unix_ns, hour_angle_rad)?;
            if field.heliostats().get(row) != Some(&heliostat) {
                field.replace(row, heliostat)?;
                changed = true;
            }
        }
        Ok(changed)
    }
}

/// What a calibration table says about a field.
pub(super) struct Calibrated {
    /// One for each row of the field.
    pub(super) heliostats: Vec<Heliostat>,
    /// Only if something varies.
    pub(super) schedule: Option<CalibrationSchedule>,
    pub(super) warnings: Vec<String>,
}

/// Applies a calibration table to the heliostats of a layout.
pub(super) fn apply(
    table: Table,
    ids: &[String],
    row_of: &HashMap<&str, usize>,
    base: Vec<Heliostat>,
    blend_deg: f64,
) -> Result<Calibrated, IoError> {
    let naming = Naming {
        synonyms: &[("heliostat", "id"), ("heliostat_id", "id")],
        ignore: Some(&ignored),
        ..Naming::default()
    };
    let table = Keyed::new(table, keys::CALIBRATION_COLUMNS, &naming)?;
    if !ERRORS
        .iter()
        .chain(&keys::POSE_ERRORS)
        .any(|key| table.has(key))
    {
        let message = format!(
            "it has none of the columns {}",
            ERRORS.map(|key| key.name).join(", ")
        );
        let problem = Problem::Conflict { message };
        return Err(IoError::new(table.table().header_place(), problem));
    }
    let mut found: Vec<Vec<(usize, Set)>> = vec![Vec::new(); ids.len()];
    let (mut strangers, mut blank) = (0, Vec::new());
    for row in 0..table.table().rows() {
        let id = table.id(row, &keys::ID)?;
        let base = row_of
            .get(id.as_ref())
            .map(|&heliostat| (heliostat, base[heliostat]));
        // A stranger's row is read all the same: a table is right or wrong as a whole.
        let like = base.map_or_else(
            || Heliostat::new(helio_core::Enu::default(), helio_core::Enu::default()),
            |(_, base)| base,
        );
        let set = read(&table, row, &id, like)?;
        match (base, set) {
            (None, _) => strangers += 1,
            (Some(_), None) => blank.push(id.into_owned()),
            (Some((heliostat, _)), Some(set)) => {
                check_against(&table, row, &id, &set, &found[heliostat], blend_deg)?;
                found[heliostat].push((row, set));
            }
        }
    }
    if found.iter().all(Vec::is_empty) {
        let what = "no row calibrates a heliostat of this field".to_string();
        return Err(IoError::new(
            Place::file(table.table().path()),
            Problem::Empty { what },
        ));
    }
    let lacking: Vec<&str> = ids
        .iter()
        .zip(&found)
        .filter(|(id, sets)| sets.is_empty() && !blank.contains(id))
        .map(|(id, _)| id.as_str())
        .collect();
    let path = table.table().path().display();
    let mut warnings = Vec::new();
    if !lacking.is_empty() {
        warnings.push(format!(
            "{path}: no calibration for {}; the layout's errors stay",
            listed(&lacking, ids.len())
        ));
    }
    if !blank.is_empty() {
        let blank: Vec<&str> = blank.iter().map(String::as_str).collect();
        warnings.push(format!(
            "{path}: a row without any numbers for {}; it is left aside",
            listed(&blank, ids.len())
        ));
    }
    if strangers > 0 {
        warnings.push(format!(
            "{path}: rows about heliostats not in this field: {strangers}"
        ));
    }
    Ok(schedule(found, base, radians(blend_deg), warnings))
}

fn schedule(
    found: Vec<Vec<(usize, Set)>>,
    base: Vec<Heliostat>,
    blend_rad: f64,
    warnings: Vec<String>,
) -> Calibrated {
    let schedule = arranged(found, base, blend_rad);
    let each = schedule.base.iter().zip(&schedule.of_row);
    let heliostats = each
        .map(|(base, of)| schedule.told(*base, of, None, 0.0))
        .collect();
    let schedule = (!schedule.varying.is_empty()).then_some(schedule);
    Calibrated {
        heliostats,
        schedule,
        warnings,
    }
}

/// Sets in the order in which they are looked for.
fn arranged(
    found: Vec<Vec<(usize, Set)>>,
    base: Vec<Heliostat>,
    blend_rad: f64,
) -> CalibrationSchedule {
    let mut schedule = CalibrationSchedule {
        base,
        sets: Vec::new(),
        of_row: Vec::with_capacity(found.len()),
        varying: Vec::new(),
        blend_rad,
    };
    for (row, sets) in found.into_iter().enumerate() {
        let mut sets: Vec<Set> = sets.into_iter().map(|(_, set)| set).collect();
        sets.sort_by(|a, b| {
            a.from_rad
                .total_cmp(&b.from_rad)
                .then(a.valid.start.cmp(&b.valid.start))
        });
        if sets.iter().any(|set| set.bounded) {
            schedule.varying.push(row);
        }
        let start = schedule.sets.len();
        schedule.sets.extend(sets);
        schedule.of_row.push(start..schedule.sets.len());
    }
    schedule
}

/// The six errors, in the order of the table's columns.
const ERRORS: [&Key; 6] = [
    &keys::PEDESTAL_TILT,
    &keys::PEDESTAL_TILT_AZIMUTH,
    &keys::NONORTHOGONALITY,
    &keys::MIRROR_TILT,
    &keys::AZIMUTH_REFERENCE,
    &keys::ELEVATION_REFERENCE,
];

/// A row; `None` if it has no number, as where a fit failed.
fn read(table: &Keyed, row: usize, id: &str, base: Heliostat) -> Result<Option<Set>, IoError> {
    let name = table
        .text(row, &keys::SET, id)?
        .unwrap_or_default()
        .into_owned();
    if !name.is_empty() {
        check_name("set", &name).map_err(|p| table.error(row, &keys::SET, Some(id), p))?;
    }
    let mut stated = [None; 6];
    for (slot, key) in stated.iter_mut().zip(ERRORS) {
        *slot = table.number(row, key, Some(id))?.map(radians);
    }
    let mut pose_errors = [None; 3];
    for (slot, key) in pose_errors.iter_mut().zip(keys::POSE_ERRORS) {
        *slot = table.number(row, key, Some(id))?.map(radians);
    }
    let offset = table.number(row, &keys::MIRROR_OFFSET, Some(id))?;
    let from = table.time(row, &keys::VALID_FROM, id)?;
    let to = table.time(row, &keys::VALID_TO, id)?;
    let hour_from = table.number(row, &keys::HOUR_ANGLE_FROM, Some(id))?;
    let hour_to = table.number(row, &keys::HOUR_ANGLE_TO, Some(id))?;
    if let (Some(from), Some(to)) = (from, to)
        && from >= to
    {
        let message = format!(
            "valid_to is not after valid_from {}",
            crate::format_time(from)
        );
        return Err(table.error(
            row,
            &keys::VALID_TO,
            Some(id),
            Problem::Conflict { message },
        ));
    }
    let (hour_angle_from, hour_angle_to) = (hour_from.unwrap_or(-180.0), hour_to.unwrap_or(180.0));
    if hour_angle_from >= hour_angle_to {
        let message = format!(
            "hour_angle_to_deg {hour_angle_to} is not above hour_angle_from_deg {hour_angle_from}"
        );
        let key = if hour_to.is_some() {
            &keys::HOUR_ANGLE_TO
        } else {
            &keys::HOUR_ANGLE_FROM
        };
        return Err(table.error(row, key, Some(id), Problem::Conflict { message }));
    }
    if stated.iter().chain(&pose_errors).all(Option::is_none) && offset.is_none() {
        return Ok(None);
    }
    let [tilt, tilt_azimuth, skew, mirror, reference1, reference2] = stated;
    let b = base.errors;
    let errors = MountErrors {
        pedestal_tilt_rad: tilt.unwrap_or(b.pedestal_tilt_rad),
        pedestal_tilt_azimuth_rad: tilt_azimuth.unwrap_or(b.pedestal_tilt_azimuth_rad),
        axis_nonorthogonality_rad: skew.unwrap_or(b.axis_nonorthogonality_rad),
        mirror_tilt_rad: mirror.unwrap_or(b.mirror_tilt_rad),
        azimuth_reference_rad: reference1.unwrap_or(b.azimuth_reference_rad),
        elevation_reference_rad: reference2.unwrap_or(b.elevation_reference_rad),
    };
    Ok(Some(Set {
        name,
        errors,
        pose_errors: pose_errors_over(pose_errors, base.pose_errors),
        mirror_offset_m: offset.unwrap_or(base.mirror_offset_m),
        valid: from.unwrap_or(i64::MIN)..to.unwrap_or(i64::MAX),
        from_rad: radians(hour_angle_from),
        to_rad: radians(hour_angle_to),
        bounded: from.is_some() || to.is_some() || hour_from.is_some() || hour_to.is_some(),
    }))
}

/// Two sets of a heliostat must differ in name, and share no more than a blend where both are valid.
fn check_against(
    table: &Keyed,
    row: usize,
    id: &str,
    set: &Set,
    others: &[(usize, Set)],
    blend_deg: f64,
) -> Result<(), IoError> {
    for (other_row, other) in others {
        let first = table.table().position(*other_row);
        if other.name == set.name {
            let mut name = quoted(id);
            if !set.name.is_empty() {
                name = format!("{id}, set {}", set.name);
            }
            let name = name.trim_matches('`').to_string();
            let problem = Problem::Duplicate {
                what: "id",
                name,
                first,
            };
            return Err(table.error(row, &keys::ID, None, problem));
        }
        let together = set.valid.start < other.valid.end && other.valid.start < set.valid.end;
        let from_rad = set.from_rad.max(other.from_rad);
        let to_rad = set.to_rad.min(other.to_rad);
        let shared_rad = to_rad - from_rad;
        let inside =
            shared_rad >= (set.to_rad - set.from_rad).min(other.to_rad - other.from_rad) - 1e-12;
        if together && (shared_rad > radians(blend_deg) + 1e-9 || inside) {
            let message = format!(
                "sets {} and {} ({first}) are both valid at hour angles {} to {} deg; \
                 bound them by hour_angle_from_deg, hour_angle_to_deg, valid_from or valid_to",
                quoted(&set.name),
                quoted(&other.name),
                shown(from_rad),
                shown(to_rad)
            );
            return Err(table.row_error(row, id, Problem::Conflict { message }));
        }
    }
    Ok(())
}

/// A few names and how many there are.
fn listed(names: &[&str], of: usize) -> String {
    let shown: Vec<&str> = names.iter().take(5).copied().collect();
    let more = if names.len() > shown.len() {
        ", …"
    } else {
        ""
    };
    format!(
        "{} of {of} heliostats ({}{more})",
        names.len(),
        shown.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use helio_core::Enu;

    fn set(name: &str, hours_deg: (f64, f64), valid: Range<i64>, tilt_rad: f64) -> Set {
        let errors = MountErrors {
            pedestal_tilt_rad: tilt_rad,
            axis_nonorthogonality_rad: tilt_rad,
            ..MountErrors::default()
        };
        Set {
            name: name.into(),
            errors,
            pose_errors: PoseErrors::NONE,
            mirror_offset_m: 0.1,
            valid,
            from_rad: radians(hours_deg.0),
            to_rad: radians(hours_deg.1),
            bounded: true,
        }
    }

    fn of(sets: Vec<Set>) -> CalibrationSchedule {
        let base = vec![Heliostat::new(Enu::default(), Enu::new(0.0, 0.0, 50.0))];
        let found = vec![sets.into_iter().enumerate().collect()];
        schedule(found, base, radians(5.0), Vec::new())
            .schedule
            .unwrap()
    }

    const ALWAYS: Range<i64> = i64::MIN..i64::MAX;

    #[test]
    fn morning_passes_linearly_into_afternoon() {
        let schedule = of(vec![
            set("pm", (0.0, 180.0), ALWAYS, 0.003),
            set("am", (-180.0, 0.0), ALWAYS, 0.001),
        ]);
        let skew = |hour_deg: f64| {
            let heliostat = schedule
                .heliostat_at(0, Some(0), radians(hour_deg))
                .unwrap();
            heliostat.errors.axis_nonorthogonality_rad
        };
        for (hour_deg, wanted) in [
            (-90.0, 0.001),
            (-2.5, 0.001),
            (0.0, 0.002),
            (1.25, 0.0025),
            (2.5, 0.003),
            (90.0, 0.003),
        ] {
            assert!(
                (skew(hour_deg) - wanted).abs() < 1e-15,
                "{hour_deg}: {}",
                skew(hour_deg)
            );
        }
        // Outside the blend a set is itself, to the bit.
        assert_eq!(skew(-2.6).to_bits(), 0.001_f64.to_bits());
        assert_eq!(skew(2.6).to_bits(), 0.003_f64.to_bits());
    }

    #[test]
    fn nothing_jumps_over_gaps_overlaps_and_narrow_sets() {
        for hours in [
            [(-90.0, -20.0), (10.0, 12.0), (12.0, 14.0)],
            [(-90.0, 2.0), (0.0, 30.0), (28.0, 90.0)],
            [(-1.0, 0.0), (0.0, 0.5), (0.5, 90.0)],
        ] {
            let schedule = of(vec![
                set("a", hours[0], ALWAYS, 0.001),
                set("b", hours[1], ALWAYS, 0.004),
                set("c", hours[2], ALWAYS, 0.002),
            ]);
            let skew = |hour_deg: f64| {
                let heliostat = schedule.heliostat_at(0, None, radians(hour_deg)).unwrap();
                heliostat.errors.axis_nonorthogonality_rad
            };
            let mut last = skew(-179.0);
            assert_eq!(last, 0.001);
            for step in 0..358_000 {
                let here = skew(-179.0 + 0.001 * f64::from(step));
                assert!((here - last).abs() < 2e-5, "{hours:?}: {step}");
                last = here;
            }
            assert_eq!(last, 0.002);
        }
    }

    #[test]
    fn sets_of_a_calibration_hold_as_those_of_its_table() {
        let sets = [
            ("am", None, Some(0.0), 0.001),
            ("pm", Some(0.0), None, 0.003),
        ]
        .map(|(name, from, to, tilt_rad)| CalibratedSet {
            set: name.into(),
            errors: Some(set("", (0.0, 1.0), ALWAYS, tilt_rad).errors),
            hour_angle_from_rad: from,
            hour_angle_to_rad: to,
            ..CalibratedSet::without_result("A", "ok", "")
        });
        let refused = CalibratedSet::without_result("A", "undetermined", "");
        let base = Heliostat::new(Enu::default(), Enu::new(0.0, 0.0, 50.0));
        let given = vec![&sets[1], &refused, &sets[0]];
        let schedule = CalibrationSchedule::of_sets(vec![base; 2], &[given, vec![]], radians(5.0));
        let mut read = of(vec![
            set("pm", (0.0, 180.0), ALWAYS, 0.003),
            set("am", (-180.0, 0.0), ALWAYS, 0.001),
        ]);
        for set in &mut read.sets {
            set.mirror_offset_m = base.mirror_offset_m;
        }
        for (hour_deg, name) in [(-90.0, "am"), (-1.0, "am"), (1.0, "pm"), (90.0, "pm")] {
            let hour = radians(hour_deg);
            assert_eq!(
                schedule.heliostat_at(0, None, hour).unwrap(),
                read.heliostat_at(0, None, hour).unwrap()
            );
            assert_eq!(schedule.set_at(0, None, hour).unwrap(), Some(name));
        }
        assert_eq!(
            (
                schedule.set_at(1, None, 0.0).unwrap(),
                schedule.heliostat_at(1, None, 0.0).unwrap()
            ),
            (None, base)
        );
    }

    #[test]
    fn a_vanishing_tilt_blends_without_its_azimuth() {
        let mut am = set("am", (-180.0, 0.0), ALWAYS, 0.002);
        am.errors.pedestal_tilt_azimuth_rad = 1.0;
        am.errors.azimuth_reference_rad = radians(179.0);
        let mut pm = set("pm", (0.0, 180.0), ALWAYS, 0.0);
        pm.errors.azimuth_reference_rad = radians(-179.0);
        let errors = of(vec![am, pm]).heliostat_at(0, None, 0.0).unwrap().errors;
        assert!((errors.pedestal_tilt_rad - 0.001).abs() < 1e-15);
        assert!((errors.pedestal_tilt_azimuth_rad - 1.0).abs() < 1e-12);
        assert!((errors.azimuth_reference_rad - radians(180.0)).abs() < 1e-12);
    }

    #[test]
    fn dates_choose_and_outside_them_the_layout_holds() {
        let schedule = of(vec![
            set("old", (-180.0, 180.0), 10..20, 0.001),
            set("new", (-180.0, 180.0), 20..30, 0.002),
        ]);
        let tilt = |time| {
            schedule
                .heliostat_at(0, time, 0.0)
                .unwrap()
                .errors
                .pedestal_tilt_rad
        };
        assert_eq!(tilt(Some(9)), 0.0);
        assert_eq!(tilt(Some(10)), 0.001);
        assert_eq!(tilt(Some(19)), 0.001);
        assert_eq!(tilt(Some(20)), 0.002);
        assert_eq!(tilt(Some(30)), 0.0);
        assert_eq!(tilt(None), 0.002);
    }

    #[test]
    fn a_lapse_is_found_before_between_and_after() {
        let schedule = of(vec![
            set("old", (-180.0, 180.0), 10..20, 0.001),
            set("new", (-180.0, 180.0), 25..30, 0.002),
        ]);
        for (from, to, lapses) in [
            (10, 19, false),
            (25, 29, false),
            (9, 12, true),
            (12, 25, true),
            (29, 30, true),
        ] {
            let lapse = schedule.lapse(from, to);
            assert_eq!(lapse.is_some(), lapses, "{from}..={to}");
            let last = lapse.map(|l| (l.heliostats, l.first, l.last_valid_to_ns));
            assert_eq!(last, lapses.then_some((1, 0, Some(30))));
        }
    }

    #[test]
    fn a_field_is_updated_only_where_something_changed() {
        let schedule = of(vec![
            set("am", (-180.0, 0.0), ALWAYS, 0.001),
            set("pm", (0.0, 180.0), ALWAYS, 0.003),
        ]);
        let mut field = Field::new(helio_core::TrackingMode::AzimuthElevation);
        field
            .push("A", schedule.heliostat_at(0, None, -1.0).unwrap())
            .unwrap();
        assert!(!schedule.update(&mut field, None, -0.5).unwrap());
        assert!(schedule.update(&mut field, None, 0.0).unwrap());
        assert_eq!(
            field.heliostats()[0],
            schedule.heliostat_at(0, None, 0.0).unwrap()
        );
    }
}
