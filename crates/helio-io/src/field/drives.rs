//! Drives: `[heliostats.drive.axisN]` and the drives table.

use std::collections::HashMap;

use helio_core::angle::radians;
use helio_core::drive::{Drive, EncoderDrive, ScrewGeometry, TriangleDrive, TriangleGeometry};
use helio_core::error::DriveError;

use crate::error::{IoError, Problem, quoted, short};
use crate::keys::{self, Key};
use crate::table::{Keyed, Naming, Table};
use crate::toml::Section;

const COUNT: usize = 20;

/// The kinds of drive.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Type {
    Encoder,
    Screw,
    Triangle,
}

impl Type {
    fn of(word: &str) -> Option<Self> {
        match word {
            "encoder" => Some(Self::Encoder),
            "screw" => Some(Self::Screw),
            "triangle" | "linear" => Some(Self::Triangle),
            _ => None,
        }
    }

    fn as_str(self) -> &'static str {
        match self {
            Self::Encoder => "encoder",
            Self::Screw => "screw",
            Self::Triangle => "triangle",
        }
    }

    /// The numbers it has, besides the sign; those that it must have first.
    fn numbers(self) -> (&'static [&'static Key], &'static [&'static Key]) {
        match self {
            Self::Encoder => {
                const {
                    (
                        &[&keys::STEPS_PER_DEG],
                        &[&keys::ZERO_STEPS, &keys::MIN_STEPS, &keys::MAX_STEPS],
                    )
                }
            }
            Self::Screw => {
                const {
                    (
                        &[
                            &keys::ARM_A,
                            &keys::ARM_B,
                            &keys::BRACKET,
                            &keys::ZERO_LENGTH,
                            &keys::STEPS_PER_M,
                        ],
                        &[&keys::MIN_STEPS, &keys::MAX_STEPS],
                    )
                }
            }
            Self::Triangle => {
                const {
                    (
                        &[
                            &keys::CLOCKWISE,
                            &keys::INCREMENT,
                            &keys::OFFSET,
                            &keys::PIVOT_RADIUS,
                            &keys::INITIAL_STROKE,
                            &keys::INITIAL_ANGLE,
                        ],
                        &[
                            &keys::MIN_INCREMENT,
                            &keys::MAX_INCREMENT,
                            &keys::MIN_MOVEMENT,
                            &keys::MAX_MOVEMENT,
                        ],
                    )
                }
            }
        }
    }
}

/// What is stated of a drive, in the order of [`keys::DRIVE_NUMBERS`].
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stated {
    kind: Option<Type>,
    numbers: [Option<f64>; COUNT],
}

impl Stated {
    fn get(&self, key: &Key) -> Option<f64> {
        let index = keys::DRIVE_NUMBERS
            .iter()
            .position(|known| std::ptr::eq(*known, key))?;
        self.numbers[index]
    }

    fn set(&mut self, key: &Key, value: Option<f64>) {
        for (slot, known) in self.numbers.iter_mut().zip(keys::DRIVE_NUMBERS) {
            if std::ptr::eq(*known, key) {
                *slot = value;
            }
        }
    }

    /// What is stated here, or else there; numbers of another type of drive stay out.
    fn or(self, default: Self) -> Self {
        let kind = self.kind.or(default.kind);
        let mut numbers = self.numbers;
        for ((slot, key), value) in numbers
            .iter_mut()
            .zip(keys::DRIVE_NUMBERS)
            .zip(default.numbers)
        {
            let belongs = kind.is_none_or(|kind| belongs(kind, key));
            *slot = slot.or(value.filter(|_| belongs));
        }
        Self { kind, numbers }
    }

    /// The drive; a problem names the key it is about, if it is about one.
    fn build(&self) -> Result<Drive, (Option<&'static Key>, Problem)> {
        let Some(kind) = self.kind else {
            let wanted = keys::DRIVE_TYPE.wanted();
            return Err((
                None,
                Problem::Missing {
                    what: "type".into(),
                    wanted,
                },
            ));
        };
        for (key, value) in keys::DRIVE_NUMBERS.iter().zip(self.numbers) {
            if value.is_some() && !belongs(kind, key) {
                let message = format!("{} is not for a drive of type {}", key.name, kind.as_str());
                return Err((Some(key), Problem::Conflict { message }));
            }
        }
        for key in kind.numbers().0 {
            if self.get(key).is_none() {
                let wanted = format!("a drive of type {} needs it", kind.as_str());
                return Err((
                    None,
                    Problem::Missing {
                        what: key.name.into(),
                        wanted,
                    },
                ));
            }
        }
        for (min, max) in [
            (&keys::MIN_STEPS, &keys::MAX_STEPS),
            (&keys::MIN_INCREMENT, &keys::MAX_INCREMENT),
            (&keys::MIN_MOVEMENT, &keys::MAX_MOVEMENT),
        ] {
            if let (Some(low), Some(high)) = (self.get(min), self.get(max))
                && low >= high
            {
                let message = format!("{} {high} is not above {} {low}", max.name, min.name);
                return Err((Some(max), Problem::Conflict { message }));
            }
        }
        self.meets_triangle(kind)
            .and_then(|()| self.make(kind).map_err(|error| error.to_string()))
            .and_then(|drive| self.can_move(drive))
            .map_err(|message| (None, Problem::Conflict { message }))
    }

    /// A screw must close its triangle somewhere between its ends.
    fn meets_triangle(&self, kind: Type) -> Result<(), String> {
        let [side_a, side_b, length, ratio, min, max] = match kind {
            Type::Encoder => return Ok(()),
            Type::Screw => [
                &keys::ARM_A,
                &keys::ARM_B,
                &keys::ZERO_LENGTH,
                &keys::STEPS_PER_M,
                &keys::MIN_STEPS,
                &keys::MAX_STEPS,
            ],
            Type::Triangle => [
                &keys::OFFSET,
                &keys::PIVOT_RADIUS,
                &keys::INITIAL_STROKE,
                &keys::INCREMENT,
                &keys::MIN_INCREMENT,
                &keys::MAX_INCREMENT,
            ],
        };
        let needed = |key: &Key| self.get(key).unwrap_or(f64::NAN);
        let (a_m, b_m) = (needed(side_a), needed(side_b));
        let (least_m, most_m) = ((a_m - b_m).abs(), a_m + b_m);
        let at =
            |key: &Key, none: f64| needed(length) + self.get(key).unwrap_or(none) / needed(ratio);
        let (low_m, high_m) = (at(min, f64::NEG_INFINITY), at(max, f64::INFINITY));
        if low_m.max(least_m) < high_m.min(most_m) {
            return Ok(());
        }
        let screw = match (low_m.is_finite(), high_m.is_finite()) {
            (true, false) => format!("at least {} m", metres(low_m)),
            (false, true) => format!("at most {} m", metres(high_m)),
            _ => format!("{} to {} m", metres(low_m), metres(high_m)),
        };
        Err(format!(
            "the screw is {screw} long between {} and {}, but the triangle of {} and {} closes only \
             from {} to {} m; check {} (metres) and {}",
            min.name,
            max.name,
            side_a.name,
            side_b.name,
            metres(least_m),
            metres(most_m),
            length.name,
            ratio.name
        ))
    }

    /// Stops and ends must leave something between them.
    fn can_move(&self, drive: Drive) -> Result<Drive, String> {
        let (low, high) = drive.range_rad();
        if low <= high {
            return Ok(drive);
        }
        let mut ends = *self;
        for key in [&keys::MIN_MOVEMENT, &keys::MAX_MOVEMENT] {
            ends.set(key, None);
        }
        let reach = ends.make(Type::Triangle).map_err(|e| e.to_string())?;
        // The stops are on the actuator's own angle; so is what is compared with them here.
        let (low, high) = reach.range_rad();
        let (low, high) = match self.get(&keys::SIGN) {
            Some(sign) if sign < 0.0 => (-high, -low),
            _ => (low, high),
        };
        let said = |key: &Key| match self.get(key) {
            Some(value) => format!("{} {}", key.name, short(value)),
            None => format!("no {}", key.name),
        };
        Err(format!(
            "its stops ({}, {}) shut out every angle from {} to {} rad that its steps reach",
            said(&keys::MIN_MOVEMENT),
            said(&keys::MAX_MOVEMENT),
            short((low * 1e9).round() / 1e9),
            short((high * 1e9).round() / 1e9)
        ))
    }

    /// Every number that is needed is there by now.
    fn make(&self, kind: Type) -> Result<Drive, DriveError> {
        let needed = |key: &Key| self.get(key).unwrap_or(f64::NAN);
        let ends = |min: &Key, max: &Key| {
            let low = self.get(min).unwrap_or(f64::NEG_INFINITY);
            (low, self.get(max).unwrap_or(f64::INFINITY))
        };
        let sign = self.get(&keys::SIGN).unwrap_or(1.0);
        match kind {
            Type::Encoder => {
                // Steps in a degree times degrees in a radian.
                let steps_per_rad = helio_core::angle::degrees(needed(&keys::STEPS_PER_DEG));
                let zero_steps = self.get(&keys::ZERO_STEPS).unwrap_or(0.0);
                let (min, max) = ends(&keys::MIN_STEPS, &keys::MAX_STEPS);
                let drive = EncoderDrive::new(steps_per_rad, zero_steps, sign)?;
                Ok(Drive::Encoder(drive.with_range(min, max)?))
            }
            Type::Screw => {
                let screw = ScrewGeometry {
                    arm_a_m: needed(&keys::ARM_A),
                    arm_b_m: needed(&keys::ARM_B),
                    bracket_rad: radians(needed(&keys::BRACKET)),
                    zero_length_m: needed(&keys::ZERO_LENGTH),
                    steps_per_m: needed(&keys::STEPS_PER_M),
                    sign,
                };
                let (min, max) = ends(&keys::MIN_STEPS, &keys::MAX_STEPS);
                Ok(Drive::Triangle(
                    TriangleDrive::from_screw(screw)?.with_range(min, max)?,
                ))
            }
            Type::Triangle => {
                let geometry = TriangleGeometry {
                    offset_m: needed(&keys::OFFSET),
                    pivot_radius_m: needed(&keys::PIVOT_RADIUS),
                    initial_stroke_length_m: needed(&keys::INITIAL_STROKE),
                    initial_angle_rad: needed(&keys::INITIAL_ANGLE),
                    steps_per_m: needed(&keys::INCREMENT),
                    clockwise: needed(&keys::CLOCKWISE) != 0.0,
                    sign,
                };
                let (min, max) = ends(&keys::MIN_INCREMENT, &keys::MAX_INCREMENT);
                let (low, high) = ends(&keys::MIN_MOVEMENT, &keys::MAX_MOVEMENT);
                // The stops are on the actuator's own angle, the drive's on the axis.
                let (low, high) = if sign < 0.0 {
                    (-high, -low)
                } else {
                    (low, high)
                };
                let drive = TriangleDrive::new(geometry)?.with_range(min, max)?;
                Ok(Drive::Triangle(drive.with_stops(low, high)?))
            }
        }
    }
}

/// Metres without the last digits' noise.
fn metres(length_m: f64) -> String {
    short((length_m * 1e9).round() / 1e9)
}

fn belongs(kind: Type, key: &Key) -> bool {
    let (needed, optional) = kind.numbers();
    std::ptr::eq(key, &keys::SIGN)
        || needed
            .iter()
            .chain(optional)
            .any(|known| std::ptr::eq(*known, key))
}

/// What `[heliostats.drive.axisN]` states.
pub(super) struct Defaults<'a> {
    axes: [Option<(Stated, Section<'a>)>; 2],
}

impl<'a> Defaults<'a> {
    pub(super) fn parse(heliostats: &Section<'a>) -> Result<Self, IoError> {
        let mut axes = [None, None];
        if let Some(drive) = heliostats.section(&keys::DRIVE_TABLE)? {
            for (slot, key) in axes
                .iter_mut()
                .zip([&keys::DRIVE_AXIS1, &keys::DRIVE_AXIS2])
            {
                let Some(section) = drive.section(key)? else {
                    continue;
                };
                let kind = section.text(&keys::DRIVE_TYPE)?.and_then(Type::of);
                let mut stated = Stated {
                    kind,
                    numbers: [None; COUNT],
                };
                for (slot, key) in stated.numbers.iter_mut().zip(keys::DRIVE_NUMBERS) {
                    *slot = section.number(key)?;
                }
                *slot = Some((stated, section));
            }
        }
        Ok(Self { axes })
    }

    fn stated(&self, axis: usize) -> Stated {
        self.axes[axis]
            .as_ref()
            .map_or_else(Stated::default, |(stated, _)| *stated)
    }

    /// The drive that every heliostat has, from the TOML alone.
    fn complete(&self, axis: usize) -> Result<Option<Drive>, IoError> {
        let Some((stated, section)) = &self.axes[axis] else {
            return Ok(None);
        };
        stated.build().map(Some).map_err(|(key, mut problem)| {
            if let Problem::Missing { what, .. } = &mut problem {
                *what = format!("{}.{what}", section.name());
            }
            match key {
                Some(key) => section.error(key, problem),
                None => section.source().error(section.span(), problem),
            }
        })
    }

    /// The drives of a field without a table of them.
    pub(super) fn for_all(&self, count: usize) -> Result<Vec<[Option<Drive>; 2]>, IoError> {
        let both = [self.complete(0)?, self.complete(1)?];
        Ok(vec![both; count])
    }

    /// The drives of a field from a table; `row_of` finds a heliostat.
    pub(super) fn with_table(
        &self,
        table: Table,
        ids: &[String],
        row_of: &HashMap<&str, usize>,
    ) -> Result<Vec<[Option<Drive>; 2]>, IoError> {
        let naming = Naming {
            synonyms: &[("heliostat", "id"), ("heliostat_id", "id")],
            ..Naming::default()
        };
        let table = Keyed::new(table, keys::DRIVE_COLUMNS, &naming)?;
        let mut drives = vec![[None; 2]; ids.len()];
        let mut first: HashMap<(usize, usize), usize> = HashMap::new();
        let mut seen = [false; 2];
        for row in 0..table.table().rows() {
            let id = table.id(row, &keys::ID)?;
            let axis = if table.needed(row, &keys::AXIS, Some(&id))? == 1.0 {
                0
            } else {
                1
            };
            // A table may hold more heliostats than this field.
            let Some(&heliostat) = row_of.get(id.as_ref()) else {
                continue;
            };
            if let Some(first) = first.insert((heliostat, axis), row) {
                let what = if axis == 0 {
                    "axis 1 of id"
                } else {
                    "axis 2 of id"
                };
                let first = table.table().position(first);
                let problem = Problem::Duplicate {
                    what,
                    name: id.to_string(),
                    first,
                };
                return Err(table.error(row, &keys::ID, None, problem));
            }
            let mut stated = Stated::default();
            if let Some(word) = table.text(row, &keys::DRIVE_TYPE, &id)? {
                stated.kind = Some(Type::of(&word).ok_or_else(|| {
                    let wanted = "encoder, screw or triangle (linear means triangle)".to_string();
                    let what = String::new();
                    let problem = Problem::WrongKind {
                        what,
                        wanted,
                        found: quoted(&word),
                    };
                    table.error(row, &keys::DRIVE_TYPE, Some(&id), problem)
                })?);
            }
            for (slot, key) in stated.numbers.iter_mut().zip(keys::DRIVE_NUMBERS) {
                *slot = table.number(row, key, Some(&id))?;
            }
            let drive =
                stated
                    .or(self.stated(axis))
                    .build()
                    .map_err(|(key, problem)| match key {
                        Some(key) if table.has(key) => table.error(row, key, Some(&id), problem),
                        _ => table.row_error(row, &id, problem),
                    })?;
            seen[axis] = true;
            drives[heliostat][axis] = Some(drive);
        }
        for axis in 0..2 {
            let default = match self.stated(axis).kind {
                Some(_) => self.complete(axis)?,
                None => None,
            };
            for (drive, id) in drives.iter_mut().zip(ids) {
                if drive[axis].is_none() && default.is_none() && seen[axis] {
                    let what = format!("a row for axis {} of heliostat {}", axis + 1, quoted(id));
                    let wanted = "other heliostats have one".to_string();
                    let place = crate::error::Place::file(table.table().path());
                    return Err(IoError::new(place, Problem::Missing { what, wanted }));
                }
                drive[axis] = drive[axis].or(default);
            }
        }
        if seen == [false; 2] {
            let what = "no row is about a heliostat of this field".to_string();
            let place = crate::error::Place::file(table.table().path());
            return Err(IoError::new(place, Problem::Empty { what }));
        }
        Ok(drives)
    }
}
