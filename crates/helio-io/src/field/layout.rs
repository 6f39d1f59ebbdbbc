//! The heliostat table.

use std::collections::HashMap;

use helio_core::angle::{degrees, radians};
use helio_core::{AxisLimits, Enu, Heliostat, MountErrors, PoseErrors};

use crate::error::{IoError, Problem};
use crate::keys;
use crate::table::Keyed;
use crate::toml::Section;

/// What a heliostat may have of its own or by default, in the order of [`keys::QUANTITIES`] and in
/// the unit of its key; `None` where nothing is stated.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Quantities([Option<f64>; 14]);

impl Quantities {
    /// The defaults for all.
    pub(super) fn parse(heliostats: &Section<'_>) -> Result<Self, IoError> {
        let mut values = Self::default();
        for (slot, key) in values.0.iter_mut().zip(keys::QUANTITIES) {
            *slot = heliostats.number(key)?;
        }
        Ok(values)
    }

    /// A row's own, or else the defaults.
    fn of_row(self, table: &Keyed, row: usize, id: &str) -> Result<Self, IoError> {
        let mut values = self;
        for (slot, key) in values.0.iter_mut().zip(keys::QUANTITIES) {
            *slot = table.number(row, key, Some(id))?.or(*slot);
        }
        Ok(values)
    }

    /// The limit of axis 2 that is stated without the other, and the other: with a single end, some
    /// turn always leads inside, which is not what anybody means by a stop.
    fn one_sided(&self) -> Option<(&'static keys::Key, &'static keys::Key)> {
        match self.0 {
            [.., Some(_), None] => Some((&keys::AXIS2_MIN, &keys::AXIS2_MAX)),
            [.., None, Some(_)] => Some((&keys::AXIS2_MAX, &keys::AXIS2_MIN)),
            _ => None,
        }
    }

    /// Refuses a single limit of axis 2 for all, unless the table has the other.
    pub(super) fn check_sides(
        &self,
        heliostats: &Section<'_>,
        table: &Keyed,
    ) -> Result<(), IoError> {
        match self.one_sided() {
            Some((given, lacking)) if !table.has(lacking) => {
                Err(heliostats.error(given, single(given, lacking)))
            }
            _ => Ok(()),
        }
    }

    fn heliostat(&self, pivot: Enu, aim: Enu) -> Heliostat {
        let [
            offset,
            tilt,
            tilt_azimuth,
            skew,
            mirror,
            reference1,
            reference2,
            sag1,
            sag2,
            eccentricity,
            limits @ ..,
        ] = self.0;
        let rad = |value: Option<f64>| radians(value.unwrap_or(0.0));
        let limit = |value: Option<f64>, none: f64| value.map_or(none, radians);
        Heliostat {
            pivot,
            aim,
            mirror_offset_m: offset.unwrap_or(0.0),
            errors: MountErrors {
                pedestal_tilt_rad: rad(tilt),
                pedestal_tilt_azimuth_rad: rad(tilt_azimuth),
                axis_nonorthogonality_rad: rad(skew),
                mirror_tilt_rad: rad(mirror),
                azimuth_reference_rad: rad(reference1),
                elevation_reference_rad: rad(reference2),
            },
            pose_errors: PoseErrors {
                axis1_sag_rad: rad(sag1),
                axis2_sag_rad: rad(sag2),
                axis2_eccentricity_rad: rad(eccentricity),
            },
            limits: AxisLimits {
                axis1_min_rad: limit(limits[0], f64::NEG_INFINITY),
                axis1_max_rad: limit(limits[1], f64::INFINITY),
                axis2_min_rad: limit(limits[2], f64::NEG_INFINITY),
                axis2_max_rad: limit(limits[3], f64::INFINITY),
            },
        }
    }
}

/// Where a row aims.
#[derive(Debug, Clone)]
pub(super) enum Aim {
    Point(Enu),
    /// Number of a target, in the order of their names.
    Target(usize),
}

/// A row of the layout.
#[derive(Debug, Clone)]
pub(super) struct Row {
    pub(super) id: String,
    pub(super) heliostat: Heliostat,
    pub(super) aim: Aim,
}

/// What the rows of a layout refer to.
pub(super) struct Context<'a> {
    pub(super) defaults: Quantities,
    pub(super) default_aim: Option<usize>,
    pub(super) up_offset_m: f64,
    /// Names and centres, in the order of the names.
    pub(super) targets: &'a [(&'a str, Enu)],
}

/// Every row of the table, ids checked to stand once.
pub(super) fn rows(table: &Keyed, context: &Context<'_>) -> Result<Vec<Row>, IoError> {
    let count = table.table().rows();
    let mut rows = Vec::with_capacity(count);
    let mut first: HashMap<String, usize> = HashMap::with_capacity(count);
    for row in 0..count {
        let id = table.id(row, &keys::ID)?;
        if let Some(first) = first.insert(id.to_string(), row) {
            let first = table.table().position(first);
            let problem = Problem::Duplicate {
                what: "id",
                name: id.to_string(),
                first,
            };
            return Err(table.error(row, &keys::ID, None, problem));
        }
        let who = Some(id.as_ref());
        let pivot = Enu::new(
            table.needed(row, &keys::EAST, who)?,
            table.needed(row, &keys::NORTH, who)?,
            table.needed(row, &keys::UP, who)? + context.up_offset_m,
        );
        let aim = aim(table, context, row, &id)?;
        let point = match aim {
            Aim::Point(point) => point,
            Aim::Target(number) => context.targets[number].1,
        };
        let quantities = context.defaults.of_row(table, row, &id)?;
        if let Some((given, lacking)) = quantities.one_sided() {
            return Err(table.row_error(row, &id, single(given, lacking)));
        }
        let heliostat = quantities.heliostat(pivot, point);
        check_limits(table, row, &id, &heliostat.limits)?;
        rows.push(Row {
            id: id.into_owned(),
            heliostat,
            aim,
        });
    }
    Ok(rows)
}

fn aim(table: &Keyed, context: &Context<'_>, row: usize, id: &str) -> Result<Aim, IoError> {
    let own = [&keys::AIM_EAST, &keys::AIM_NORTH, &keys::AIM_UP];
    let mut point = [None; 3];
    for (slot, key) in point.iter_mut().zip(own) {
        *slot = table.number(row, key, Some(id))?;
    }
    let name = table.text(row, &keys::AIM, id)?;
    let conflict = |message: String| table.row_error(row, id, Problem::Conflict { message });
    match (point, name) {
        ([Some(east), Some(north), Some(up)], None) => Ok(Aim::Point(Enu::new(east, north, up))),
        ([None, None, None], Some(name)) => {
            let number = context.targets.iter().position(|(known, _)| *known == name);
            number.map(Aim::Target).ok_or_else(|| {
                let known = context.targets.iter().map(|(known, _)| *known);
                table.error(
                    row,
                    &keys::AIM,
                    Some(id),
                    Problem::unknown("target", &name, known),
                )
            })
        }
        ([None, None, None], None) => context.default_aim.map(Aim::Target).ok_or_else(|| {
            conflict(
                "it has no aim: name a target in [heliostats] aim or in column aim, \
                 or give aim_east_m, aim_north_m and aim_up_m"
                    .into(),
            )
        }),
        (point, Some(name)) if point.iter().all(Option::is_some) => Err(conflict(format!(
            "it has two aims, the target {} and the point aim_east_m, aim_north_m, aim_up_m",
            crate::error::quoted(&name)
        ))),
        (point, _) => {
            let lacking: Vec<&str> = own
                .iter()
                .zip(point)
                .filter(|(_, value)| value.is_none())
                .map(|(key, _)| key.name)
                .collect();
            Err(conflict(format!(
                "its aim point lacks {}",
                lacking.join(" and ")
            )))
        }
    }
}

fn single(given: &keys::Key, lacking: &keys::Key) -> Problem {
    let message = format!(
        "{} is given without {}: a moving axis has two stops; give both",
        given.name, lacking.name
    );
    Problem::Conflict { message }
}

fn check_limits(table: &Keyed, row: usize, id: &str, limits: &AxisLimits) -> Result<(), IoError> {
    let l = limits;
    for (axis, min_rad, max_rad) in [
        (1, l.axis1_min_rad, l.axis1_max_rad),
        (2, l.axis2_min_rad, l.axis2_max_rad),
    ] {
        if min_rad > max_rad {
            let message = format!(
                "axis{axis}_min_deg {} is above axis{axis}_max_deg {}",
                shown(min_rad),
                shown(max_rad)
            );
            return Err(table.row_error(row, id, Problem::Conflict { message }));
        }
    }
    Ok(())
}

/// Radians as the degrees somebody wrote, without the last digits' noise.
pub(super) fn shown(angle_rad: f64) -> f64 {
    (degrees(angle_rad) * 1e9).round() / 1e9
}
