//! Every key of `field.toml` and every column of its tables: name, kind, range and meaning, once.
//!
//! The parser asks for values by these, the unknown-name messages list them and
//! [`schema`](crate::schema) prints them, so that the three cannot disagree.

use crate::error::Problem;

/// A key of a TOML table or a column of a data table.
#[derive(Debug)]
pub(crate) struct Key {
    pub(crate) name: &'static str,
    pub(crate) kind: Kind,
    pub(crate) required: bool,
    pub(crate) about: &'static str,
}

/// What a value must be.
#[derive(Debug)]
pub(crate) enum Kind {
    Text,
    /// One of these words.
    Word(&'static [&'static str]),
    /// A number from min to max.
    Number(f64, f64),
    /// One of these numbers.
    OneOf(&'static [f64]),
    /// 0 or 1; in TOML also false or true.
    YesNo,
    /// A time with an offset.
    Time,
    /// East, north, up.
    Enu,
    /// A point or a direction in the frame of the scene.
    Vector,
    /// Four points of a picture.
    Corners,
    Texts,
    /// A table of these keys.
    Table(&'static [&'static Key]),
    /// A table of any names, each a table of these keys.
    Named(&'static [&'static Key]),
    /// A table from our column names to those of a foreign table.
    Renames(&'static [&'static Key]),
}

pub(crate) const fn optional(name: &'static str, kind: Kind, about: &'static str) -> Key {
    Key {
        name,
        kind,
        required: false,
        about,
    }
}

pub(crate) const fn required(name: &'static str, kind: Kind, about: &'static str) -> Key {
    Key {
        name,
        kind,
        required: true,
        about,
    }
}

impl Key {
    /// The unit that the name ends in, with a leading space.
    pub(crate) fn unit(&self) -> &'static str {
        for (ending, unit) in [
            ("steps_per_m", ""),
            ("steps_per_deg", ""),
            ("_deg", " deg"),
            ("_rad", " rad"),
            ("_hpa", " hPa"),
            ("_c", " °C"),
            ("_mrad", " mrad"),
            ("_w_m2", " W/m²"),
            ("_m_s", " m/s"),
            ("_m", " m"),
            ("_px", " px"),
            ("_s", " s"),
            ("_steps", " steps"),
        ] {
            if self.name.ends_with(ending) {
                return unit;
            }
        }
        ""
    }

    /// Checks a number; `what` is empty where the place names the quantity.
    pub(crate) fn check(&self, what: &str, value: f64) -> Result<f64, Problem> {
        if !value.is_finite() {
            return Err(Problem::NotFinite {
                what: what.to_string(),
                value,
            });
        }
        match &self.kind {
            Kind::Number(min, max) if !(*min..=*max).contains(&value) => Err(Problem::OutOfRange {
                what: what.to_string(),
                min: *min,
                max: *max,
                unit: self.unit(),
                value,
            }),
            Kind::OneOf(values) if !values.contains(&value) => Err(self.not_one(what, value)),
            Kind::YesNo if value != 0.0 && value != 1.0 => Err(self.not_one(what, value)),
            _ => Ok(value),
        }
    }

    fn not_one(&self, what: &str, value: f64) -> Problem {
        let (what, found) = (what.to_string(), value.to_string());
        Problem::WrongKind {
            what,
            wanted: self.wanted(),
            found,
        }
    }

    /// The kind in words.
    pub(crate) fn wanted(&self) -> String {
        match &self.kind {
            Kind::Text => "text in quotes".into(),
            Kind::Word(words) => {
                let words: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
                format!("one of {}", words.join(", "))
            }
            Kind::Number(..) => "a number".into(),
            Kind::OneOf(values) => {
                let values: Vec<String> = values.iter().map(f64::to_string).collect();
                values.join(" or ")
            }
            Kind::YesNo => "0 or 1".into(),
            Kind::Time => "a time with an offset, such as \"2026-06-21T12:00:00Z\"".into(),
            Kind::Enu => "three numbers [east, north, up]".into(),
            Kind::Vector => "three numbers [x, y, z]".into(),
            Kind::Corners => {
                "four corners [x, y]: upper left, upper right, lower right, lower left".into()
            }
            Kind::Texts => "a list of texts in quotes".into(),
            Kind::Table(_) | Kind::Named(_) | Kind::Renames(_) => "a table".into(),
        }
    }
}

/// The names of some keys.
pub(crate) fn names(keys: &'static [&'static Key]) -> impl Iterator<Item = &'static str> + Clone {
    keys.iter().map(|key| key.name)
}

// [site]

pub(crate) static SITE_NAME: Key = optional("name", Kind::Text, "What the site is called.");
pub(crate) static LATITUDE: Key = required(
    "latitude_deg",
    Kind::Number(-90.0, 90.0),
    "Geodetic latitude in degrees, north positive.",
);
pub(crate) static LONGITUDE: Key = required(
    "longitude_deg",
    Kind::Number(-180.0, 180.0),
    "Longitude in degrees, east positive.",
);
pub(crate) static ELEVATION: Key = required(
    "elevation_m",
    Kind::Number(-500.0, 9000.0),
    "Height of the site above sea level in metres; gives the air pressure if none is stated.",
);
pub(crate) static PRESSURE: Key = optional(
    "pressure_hpa",
    Kind::Number(300.0, 1100.0),
    "Yearly mean air pressure at the site in hectopascals, for refraction. Default: the standard atmosphere at elevation_m.",
);
pub(crate) static TEMPERATURE: Key = optional(
    "temperature_c",
    Kind::Number(-90.0, 60.0),
    "Yearly mean air temperature in degrees Celsius, for refraction. Default: 12.",
);
pub(crate) static DELTA_T: Key = optional(
    "delta_t_s",
    Kind::Number(-8000.0, 8000.0),
    "Terrestrial time minus universal time (UT1) in seconds. Default: estimated from the date.",
);
pub(crate) static UT1_UTC: Key = optional(
    "ut1_utc_s",
    Kind::Number(-1.0, 1.0),
    "UT1 minus UTC in seconds. Default: 0, which turns the sun by at most 0.004 degrees.",
);
pub(crate) static SITE: &[&Key] = &[
    &SITE_NAME,
    &LATITUDE,
    &LONGITUDE,
    &ELEVATION,
    &PRESSURE,
    &TEMPERATURE,
    &DELTA_T,
    &UT1_UTC,
];

// [targets.NAME]

pub(crate) static CENTRE: Key = required(
    "centre_enu_m",
    Kind::Enu,
    "The point to hit: east, north, up in metres; the centre of a plane.",
);
pub(crate) static NORMAL: Key = optional(
    "normal_enu",
    Kind::Enu,
    "Makes the target a plane: the direction it faces, toward the field; any length.",
);
pub(crate) static WIDTH: Key = optional(
    "width_m",
    Kind::Number(1e-3, 1e4),
    "Width of the plane in metres.",
);
pub(crate) static HEIGHT: Key = optional(
    "height_m",
    Kind::Number(1e-3, 1e4),
    "Height of the plane in metres.",
);
pub(crate) static RIGHT: Key = optional(
    "right_enu",
    Kind::Enu,
    "Where the plane's right edge lies as seen from the field, if its upper edge is not level; any length.",
);
pub(crate) static TARGET: &[&Key] = &[&CENTRE, &NORMAL, &WIDTH, &HEIGHT, &RIGHT];

// Columns of the heliostat table.

/// Coordinates accepted \[m\]: map grids have northings of some 1e6 m, and a micrometre must remain.
pub(crate) const FAR_M: f64 = 2e7;
const COORDINATE: Kind = Kind::Number(-FAR_M, FAR_M);
const TURNS: Kind = Kind::Number(-36000.0, 36000.0);
const SKEW: Kind = Kind::Number(-80.0, 80.0);
const CIRCLE: Kind = Kind::Number(-360.0, 360.0);
/// Just within [`helio_core::PoseErrors::MAX_RAD`].
const POSE: Kind = Kind::Number(-2.86, 2.86);

pub(crate) static ID: Key = required(
    "id",
    Kind::Text,
    "Name of the heliostat, at most 256 bytes, each once.",
);
pub(crate) static EAST: Key = required("east_m", COORDINATE, "Pivot, toward east, in metres.");
pub(crate) static NORTH: Key = required("north_m", COORDINATE, "Pivot, toward north, in metres.");
pub(crate) static UP: Key = required("up_m", COORDINATE, "Pivot, upward, in metres.");
pub(crate) static AIM: Key = optional(
    "aim",
    Kind::Text,
    "Name of the target that the beam is to hit.",
);
pub(crate) static AIM_EAST: Key = optional(
    "aim_east_m",
    COORDINATE,
    "Point to hit instead of a target, toward east, in metres.",
);
pub(crate) static AIM_NORTH: Key = optional("aim_north_m", COORDINATE, "Likewise, toward north.");
pub(crate) static AIM_UP: Key = optional("aim_up_m", COORDINATE, "Likewise, upward.");
pub(crate) static MIRROR_OFFSET: Key = optional(
    "mirror_offset_m",
    Kind::Number(-100.0, 100.0),
    "Pivot to mirror centre along the normal in metres (Hz). Default: 0.",
);
pub(crate) static PEDESTAL_TILT: Key = optional(
    "pedestal_tilt_deg",
    Kind::Number(-170.0, 170.0),
    "Lean of the fixed axis in degrees (psi_t). Default: 0.",
);
pub(crate) static PEDESTAL_TILT_AZIMUTH: Key = optional(
    "pedestal_tilt_azimuth_deg",
    CIRCLE,
    "Where the fixed axis leans to in degrees, clockwise from north for azimuth-elevation (psi_a). Default: 0.",
);
pub(crate) static NONORTHOGONALITY: Key = optional(
    "axis_nonorthogonality_deg",
    SKEW,
    "Moving axis away from square to the fixed axis in degrees (tau1). Default: 0.",
);
pub(crate) static MIRROR_TILT: Key = optional(
    "mirror_tilt_deg",
    SKEW,
    "Mirror plane away from parallel with the moving axis in degrees (mu). Default: 0.",
);
pub(crate) static AZIMUTH_REFERENCE: Key = optional(
    "azimuth_reference_deg",
    CIRCLE,
    "Reading of the first encoder at angle zero in degrees (gamma0). Default: 0.",
);
pub(crate) static ELEVATION_REFERENCE: Key = optional(
    "elevation_reference_deg",
    CIRCLE,
    "Reading of the second encoder at angle zero in degrees (alpha0). Default: 0.",
);
pub(crate) static AXIS1_SAG: Key = optional(
    "axis1_sag_deg",
    POSE,
    "PoseErrors of the first axis under gravity where the mirror pulls it round hardest, in degrees (kappa1); positive if the mirror sinks. Default: 0.",
);
pub(crate) static AXIS2_SAG: Key = optional(
    "axis2_sag_deg",
    POSE,
    "PoseErrors of the second axis under gravity where the mirror pulls it round hardest, in degrees (kappa2); positive if the mirror sinks. Default: 0.",
);
pub(crate) static AXIS2_ECCENTRICITY: Key = optional(
    "axis2_eccentricity_deg",
    POSE,
    "Eccentricity of the second axis' encoder: how far the axis turns beyond it a quarter turn from its zero, in degrees (e). Default: 0.",
);
pub(crate) static AXIS1_MIN: Key = optional(
    "axis1_min_deg",
    TURNS,
    "Least encoder angle of the first axis in degrees; may exceed ±360. Default: no limit.",
);
pub(crate) static AXIS1_MAX: Key = optional(
    "axis1_max_deg",
    TURNS,
    "Greatest encoder angle of the first axis.",
);
pub(crate) static AXIS2_MIN: Key = optional(
    "axis2_min_deg",
    TURNS,
    "Least encoder angle of the second axis in degrees; only together with axis2_max_deg. Default: no limits.",
);
pub(crate) static AXIS2_MAX: Key = optional(
    "axis2_max_deg",
    TURNS,
    "Greatest encoder angle of the second axis in degrees; only together with axis2_min_deg.",
);

/// In the order of [`helio_core::PoseErrors`].
pub(crate) static POSE_ERRORS: [&Key; 3] = [&AXIS1_SAG, &AXIS2_SAG, &AXIS2_ECCENTRICITY];

/// What a heliostat may have of its own or by default, in the order of [`Quantities`](crate::layout::Quantities).
pub(crate) static QUANTITIES: &[&Key] = &[
    &MIRROR_OFFSET,
    &PEDESTAL_TILT,
    &PEDESTAL_TILT_AZIMUTH,
    &NONORTHOGONALITY,
    &MIRROR_TILT,
    &AZIMUTH_REFERENCE,
    &ELEVATION_REFERENCE,
    &AXIS1_SAG,
    &AXIS2_SAG,
    &AXIS2_ECCENTRICITY,
    &AXIS1_MIN,
    &AXIS1_MAX,
    &AXIS2_MIN,
    &AXIS2_MAX,
];

pub(crate) static LAYOUT: &[&Key] = &[
    &ID,
    &EAST,
    &NORTH,
    &UP,
    &AIM,
    &AIM_EAST,
    &AIM_NORTH,
    &AIM_UP,
    &MIRROR_OFFSET,
    &PEDESTAL_TILT,
    &PEDESTAL_TILT_AZIMUTH,
    &NONORTHOGONALITY,
    &MIRROR_TILT,
    &AZIMUTH_REFERENCE,
    &ELEVATION_REFERENCE,
    &AXIS1_SAG,
    &AXIS2_SAG,
    &AXIS2_ECCENTRICITY,
    &AXIS1_MIN,
    &AXIS1_MAX,
    &AXIS2_MIN,
    &AXIS2_MAX,
];

// Drives: keys of [heliostats.drive.axisN] and columns of the drives table.

const STEPS: Kind = Kind::Number(-1e15, 1e15);
const LENGTH: Kind = Kind::Number(1e-6, 1e3);
const ANGLE_RAD: Kind = Kind::Number(-1e3, 1e3);

pub(crate) static DRIVE_TYPE: Key = optional(
    "type",
    Kind::Word(&["encoder", "screw", "triangle", "linear"]),
    "encoder: steps proportional to the angle; screw: Guo's linear screw; triangle: the actuator of the Jülich tables (\"linear\" there).",
);
pub(crate) static SIGN: Key = optional(
    "sign",
    Kind::OneOf(&[1.0, -1.0]),
    "The axis angle is this times the drive's own angle. Default: 1.",
);
pub(crate) static STEPS_PER_DEG: Key = optional(
    "steps_per_deg",
    Kind::Number(1e-9, 1e12),
    "encoder: steps in a degree.",
);
pub(crate) static ZERO_STEPS: Key = optional(
    "zero_steps",
    STEPS,
    "encoder: steps at angle zero. Default: 0.",
);
pub(crate) static MIN_STEPS: Key = optional(
    "min_steps",
    STEPS,
    "encoder, screw: least steps. Default: no end. An encoder whose ends lie more than 3600 degrees apart is a counter, and limits no angle.",
);
pub(crate) static MAX_STEPS: Key = optional(
    "max_steps",
    STEPS,
    "encoder, screw: most steps. Default: no end.",
);
pub(crate) static ARM_A: Key = optional(
    "arm_a_m",
    LENGTH,
    "screw: one arm of the bracket, a, in metres.",
);
pub(crate) static ARM_B: Key = optional("arm_b_m", LENGTH, "screw: the other arm, b, in metres.");
pub(crate) static BRACKET: Key = optional(
    "bracket_deg",
    CIRCLE,
    "screw: bracket angle beta0 in degrees.",
);
pub(crate) static ZERO_LENGTH: Key = optional(
    "zero_length_m",
    Kind::Number(-1e3, 1e3),
    "screw: its length x0 at zero steps in metres.",
);
pub(crate) static STEPS_PER_M: Key = optional(
    "steps_per_m",
    Kind::Number(1e-6, 1e12),
    "screw: steps that lengthen it by a metre.",
);
pub(crate) static CLOCKWISE: Key = optional(
    "clockwise_axis_movement",
    Kind::YesNo,
    "triangle: 1 if the angle falls as the actuator grows, otherwise 0.",
);
pub(crate) static INCREMENT: Key = optional(
    "increment_steps_per_m",
    Kind::Number(1e-6, 1e12),
    "triangle: steps that lengthen the actuator by a metre.",
);
pub(crate) static OFFSET: Key = optional(
    "offset_m",
    LENGTH,
    "triangle: axis to the actuator's foot in metres.",
);
pub(crate) static PIVOT_RADIUS: Key = optional(
    "pivot_radius_m",
    LENGTH,
    "triangle: axis to the actuator's head in metres.",
);
pub(crate) static INITIAL_STROKE: Key = optional(
    "initial_stroke_length_m",
    LENGTH,
    "triangle: length of the actuator at zero steps in metres.",
);
pub(crate) static INITIAL_ANGLE: Key = optional(
    "initial_angle_rad",
    ANGLE_RAD,
    "triangle: the actuator's own angle at zero steps in radians.",
);
pub(crate) static MIN_INCREMENT: Key = optional(
    "min_increment_steps",
    STEPS,
    "triangle: least steps. Default: no end.",
);
pub(crate) static MAX_INCREMENT: Key = optional(
    "max_increment_steps",
    STEPS,
    "triangle: most steps. Default: no end.",
);
pub(crate) static MIN_MOVEMENT: Key = optional(
    "min_movement_angle_rad",
    ANGLE_RAD,
    "triangle: stop at the least of the actuator's own angle in radians. Default: none.",
);
pub(crate) static MAX_MOVEMENT: Key = optional(
    "max_movement_angle_rad",
    ANGLE_RAD,
    "triangle: stop at the greatest of the actuator's own angle in radians. Default: none.",
);

/// The numbers of a drive.
pub(crate) static DRIVE_NUMBERS: &[&Key] = &[
    &SIGN,
    &STEPS_PER_DEG,
    &ZERO_STEPS,
    &MIN_STEPS,
    &MAX_STEPS,
    &ARM_A,
    &ARM_B,
    &BRACKET,
    &ZERO_LENGTH,
    &STEPS_PER_M,
    &CLOCKWISE,
    &INCREMENT,
    &OFFSET,
    &PIVOT_RADIUS,
    &INITIAL_STROKE,
    &INITIAL_ANGLE,
    &MIN_INCREMENT,
    &MAX_INCREMENT,
    &MIN_MOVEMENT,
    &MAX_MOVEMENT,
];
pub(crate) static DRIVE: &[&Key] = &[
    &DRIVE_TYPE,
    &SIGN,
    &STEPS_PER_DEG,
    &ZERO_STEPS,
    &MIN_STEPS,
    &MAX_STEPS,
    &ARM_A,
    &ARM_B,
    &BRACKET,
    &ZERO_LENGTH,
    &STEPS_PER_M,
    &CLOCKWISE,
    &INCREMENT,
    &OFFSET,
    &PIVOT_RADIUS,
    &INITIAL_STROKE,
    &INITIAL_ANGLE,
    &MIN_INCREMENT,
    &MAX_INCREMENT,
    &MIN_MOVEMENT,
    &MAX_MOVEMENT,
];
pub(crate) static AXIS: Key = required("axis", Kind::OneOf(&[1.0, 2.0]), "The axis: 1 or 2.");
pub(crate) static DRIVE_COLUMNS: &[&Key] = &[
    &ID,
    &AXIS,
    &DRIVE_TYPE,
    &SIGN,
    &STEPS_PER_DEG,
    &ZERO_STEPS,
    &MIN_STEPS,
    &MAX_STEPS,
    &ARM_A,
    &ARM_B,
    &BRACKET,
    &ZERO_LENGTH,
    &STEPS_PER_M,
    &CLOCKWISE,
    &INCREMENT,
    &OFFSET,
    &PIVOT_RADIUS,
    &INITIAL_STROKE,
    &INITIAL_ANGLE,
    &MIN_INCREMENT,
    &MAX_INCREMENT,
    &MIN_MOVEMENT,
    &MAX_MOVEMENT,
];

pub(crate) static DRIVE_AXIS1: Key =
    optional("axis1", Kind::Table(DRIVE), "Drive of the first axis.");
pub(crate) static DRIVE_AXIS2: Key =
    optional("axis2", Kind::Table(DRIVE), "Drive of the second axis.");
pub(crate) static DRIVE_AXES: &[&Key] = &[&DRIVE_AXIS1, &DRIVE_AXIS2];

// [heliostats]

pub(crate) static TABLE: Key = required(
    "table",
    Kind::Text,
    "CSV or Parquet file with a row for each heliostat, relative to this file: id, east_m, north_m, up_m, and any of the quantities that can also stand here as a default for all.",
);
pub(crate) static CALIBRATION: Key = optional(
    "calibration",
    Kind::Text,
    "CSV or Parquet file of calibrated errors, one row per heliostat and set; it overrides the layout.",
);
pub(crate) static DRIVES: Key = optional(
    "drives",
    Kind::Text,
    "CSV or Parquet file of drives, one row per heliostat and axis; empty cells fall back to [heliostats.drive.axis1] and axis2.",
);
pub(crate) static BLEND: Key = optional(
    "blend_deg",
    Kind::Number(0.0, 90.0),
    "Hour angle in degrees over which one calibration set passes into the next. Default: 5.",
);
pub(crate) static COLUMNS: Key = optional(
    "columns",
    Kind::Renames(LAYOUT),
    "Columns of a foreign table: our name = its name.",
);
pub(crate) static IGNORE: Key = optional(
    "ignore",
    Kind::Texts,
    "Columns of a foreign table to leave aside.",
);
pub(crate) static UP_OFFSET: Key = optional(
    "up_offset_m",
    Kind::Number(-1e4, 1e4),
    "Added to every up_m in metres, for tables that state the ground instead of the pivot. Default: 0.",
);
pub(crate) static MODE: Key = optional(
    "mode",
    Kind::Word(&[
        "azimuth-elevation",
        "spinning-elevation",
        "pitch-roll",
        "polar",
    ]),
    "How the mirrors turn. Default: azimuth-elevation. polar takes the latitude from [site].",
);
pub(crate) static AXIS_AZIMUTH: Key = optional(
    "axis_azimuth_deg",
    CIRCLE,
    "pitch-roll: where the horizontal fixed axis points in degrees, clockwise from north; 90 is east.",
);
pub(crate) static DRIVE_TABLE: Key = optional(
    "drive",
    Kind::Table(DRIVE_AXES),
    "Drives of all heliostats, or their defaults.",
);
pub(crate) static HELIOSTATS: &[&Key] = &[
    &TABLE,
    &AIM,
    &CALIBRATION,
    &DRIVES,
    &BLEND,
    &COLUMNS,
    &IGNORE,
    &UP_OFFSET,
    &MODE,
    &AXIS_AZIMUTH,
    &MIRROR_OFFSET,
    &PEDESTAL_TILT,
    &PEDESTAL_TILT_AZIMUTH,
    &NONORTHOGONALITY,
    &MIRROR_TILT,
    &AZIMUTH_REFERENCE,
    &ELEVATION_REFERENCE,
    &AXIS1_SAG,
    &AXIS2_SAG,
    &AXIS2_ECCENTRICITY,
    &AXIS1_MIN,
    &AXIS1_MAX,
    &AXIS2_MIN,
    &AXIS2_MAX,
    &DRIVE_TABLE,
];

// The file.

pub(crate) static SITE_TABLE: Key = optional(
    "site",
    Kind::Table(SITE),
    "Where the field lies; not needed where the sun is given by its angles, except for mode polar.",
);
pub(crate) static TARGETS_TABLE: Key = optional(
    "targets",
    Kind::Named(TARGET),
    "What can be aimed at, by name.",
);
pub(crate) static HELIOSTATS_TABLE: Key = required(
    "heliostats",
    Kind::Table(HELIOSTATS),
    "The heliostats: their table, where they aim and how they turn.",
);
pub(crate) static OBSERVED_COLUMNS: Key = optional(
    "columns",
    Kind::Renames(OBSERVATION_COLUMNS),
    "Columns of a foreign table of observations: our name = its name.",
);
pub(crate) static OBSERVED_IGNORE: Key = optional(
    "ignore",
    Kind::Texts,
    "Columns of a foreign table of observations to leave aside.",
);
pub(crate) static OBSERVATIONS: &[&Key] = &[&OBSERVED_COLUMNS, &OBSERVED_IGNORE];
pub(crate) static OBSERVATIONS_TABLE: Key = optional(
    "observations",
    Kind::Table(OBSERVATIONS),
    "How the tables of observations that calibrate reads name their columns.",
);
pub(crate) static FILE: &[&Key] = &[
    &SITE_TABLE,
    &TARGETS_TABLE,
    &HELIOSTATS_TABLE,
    &OBSERVATIONS_TABLE,
];

/// Those of a field that says the rest elsewhere.
pub(crate) static SURROUNDINGS: &[&Key] = &[&SITE_TABLE, &TARGETS_TABLE];

// Columns of the calibration table.

pub(crate) static SET: Key = optional(
    "set",
    Kind::Text,
    "Name of the parameter set, where a heliostat has several.",
);
pub(crate) static VALID_FROM: Key = optional(
    "valid_from",
    Kind::Time,
    "When the set begins to hold. Default: always has.",
);
pub(crate) static VALID_TO: Key = optional(
    "valid_to",
    Kind::Time,
    "When the set no longer holds. Default: never.",
);
pub(crate) static HOUR_ANGLE_FROM: Key = optional(
    "hour_angle_from_deg",
    Kind::Number(-180.0, 180.0),
    "Hour angle of the sun from which the set holds, west positive. Default: -180.",
);
pub(crate) static HOUR_ANGLE_TO: Key = optional(
    "hour_angle_to_deg",
    Kind::Number(-180.0, 180.0),
    "Hour angle of the sun up to which the set holds. Default: 180.",
);
pub(crate) static CALIBRATION_COLUMNS: &[&Key] = &[
    &ID,
    &SET,
    &VALID_FROM,
    &VALID_TO,
    &HOUR_ANGLE_FROM,
    &HOUR_ANGLE_TO,
    &MIRROR_OFFSET,
    &PEDESTAL_TILT,
    &PEDESTAL_TILT_AZIMUTH,
    &NONORTHOGONALITY,
    &MIRROR_TILT,
    &AZIMUTH_REFERENCE,
    &ELEVATION_REFERENCE,
    &AXIS1_SAG,
    &AXIS2_SAG,
    &AXIS2_ECCENTRICITY,
];

pub(crate) static COVARIANCE: Key = optional(
    "covariance",
    Kind::Text,
    "Lower triangle of the covariance, radians and metres.",
);
pub(crate) static RMS: Key = optional(
    "rms_mrad",
    Kind::Number(0.0, 1e6),
    "RMS of the spots over the slant.",
);
pub(crate) static BEAM_RMS: Key = optional(
    "beam_rms_mrad",
    Kind::Number(0.0, 1e6),
    "RMS angle of the beams at the mirror.",
);
/// What a comparison of two calibrations needs.
pub(crate) static COMPARED_COLUMNS: &[&Key] = &[
    &ID,
    &SET,
    &VALID_FROM,
    &VALID_TO,
    &HOUR_ANGLE_FROM,
    &HOUR_ANGLE_TO,
    &MIRROR_OFFSET,
    &PEDESTAL_TILT,
    &PEDESTAL_TILT_AZIMUTH,
    &NONORTHOGONALITY,
    &MIRROR_TILT,
    &AZIMUTH_REFERENCE,
    &ELEVATION_REFERENCE,
    &AXIS1_SAG,
    &AXIS2_SAG,
    &AXIS2_ECCENTRICITY,
    &COVARIANCE,
    &RMS,
    &BEAM_RMS,
    &STATUS,
];

// Columns of the small tables.

pub(crate) static TIME: Key = optional("time", Kind::Time, "When.");
pub(crate) static SUN_AZIMUTH: Key = optional(
    "sun_azimuth_deg",
    CIRCLE,
    "Azimuth of the sun in degrees, clockwise from north.",
);
pub(crate) static SUN_ELEVATION: Key = optional(
    "sun_elevation_deg",
    Kind::Number(-90.0, 90.0),
    "Apparent elevation of the sun in degrees.",
);
pub(crate) static AXIS1: Key = optional(
    "axis1_deg",
    TURNS,
    "Encoder angle of the first axis in degrees.",
);
pub(crate) static AXIS2: Key = optional(
    "axis2_deg",
    TURNS,
    "Encoder angle of the second axis in degrees.",
);
pub(crate) static AXIS1_STEPS: Key = optional("axis1_steps", STEPS, "Steps of the first drive.");
pub(crate) static AXIS2_STEPS: Key = optional("axis2_steps", STEPS, "Steps of the second drive.");
pub(crate) static STATUS: Key = optional("status", Kind::Text, "What became of the row.");
pub(crate) static SUN_COLUMNS: &[&Key] = &[&SUN_AZIMUTH, &SUN_ELEVATION];
/// Every other column that `track` writes: left aside by the tables that do not need it, so that
/// what it wrote can always be read back.
pub(crate) static TRACKED: &[&str] = &[
    "time",
    "sun_azimuth_deg",
    "sun_elevation_deg",
    "incidence_deg",
    "limit_excess_deg",
    "axis1_steps",
    "axis2_steps",
    "leftover_axis1_mrad",
    "leftover_axis2_mrad",
    "sigma_axis1_mrad",
    "sigma_axis2_mrad",
    "beam_error_mrad",
    "status",
];
pub(crate) static PRESENT_COLUMNS: &[&Key] = &[&ID, &AXIS1, &AXIS2];
pub(crate) static ANGLE_COLUMNS: &[&Key] = &[
    &ID,
    &AXIS1,
    &AXIS2,
    &AXIS1_STEPS,
    &AXIS2_STEPS,
    &TIME,
    &SUN_AZIMUTH,
    &SUN_ELEVATION,
    &STATUS,
];

// Columns of the table of observations.

pub(crate) static HELIOSTAT_ID: Key = required(
    "heliostat_id",
    Kind::Text,
    "Name of the heliostat whose spot was seen.",
);
pub(crate) static RECORD_ID: Key = optional(
    "record_id",
    Kind::Text,
    "Name of the record, such as a picture's number, for lists of rejected records.",
);
pub(crate) static FRAME: Key = optional(
    "file",
    Kind::Text,
    "The frame that shows the spot, where a table of spots is given apart.",
);
pub(crate) static SPOT_TARGET: Key = optional(
    "target",
    Kind::Text,
    "Name of the target on which the spot was seen. Default: the one that the heliostat aims at.",
);
/// Farther from its centre nobody sees a spot \[m\].
const ON_TARGET: Kind = Kind::Number(-1e4, 1e4);
pub(crate) static SPOT_U: Key = optional(
    "u_m",
    ON_TARGET,
    "Spot on the target in metres, right of its centre as a camera facing it sees it.",
);
pub(crate) static SPOT_V: Key = optional(
    "v_m",
    ON_TARGET,
    "Spot on the target in metres, below its centre.",
);
pub(crate) static SPOT_EAST: Key = optional(
    "spot_east_m",
    COORDINATE,
    "Spot on the target as a point of the field, toward east, in metres.",
);
pub(crate) static SPOT_NORTH: Key = optional("spot_north_m", COORDINATE, "Likewise, toward north.");
pub(crate) static SPOT_UP: Key = optional("spot_up_m", COORDINATE, "Likewise, upward.");
pub(crate) static SIGMA: Key = optional(
    "sigma_m",
    Kind::Number(1e-9, 1e3),
    "One standard deviation of either component of the spot in metres.",
);
pub(crate) static OBSERVATION_COLUMNS: &[&Key] = &[
    &HELIOSTAT_ID,
    &RECORD_ID,
    &FRAME,
    &TIME,
    &SUN_AZIMUTH,
    &SUN_ELEVATION,
    &AXIS1,
    &AXIS2,
    &AXIS1_STEPS,
    &AXIS2_STEPS,
    &SPOT_TARGET,
    &SPOT_U,
    &SPOT_V,
    &SPOT_EAST,
    &SPOT_NORTH,
    &SPOT_UP,
    &SIGMA,
];

// target.toml

const PIXELS: Kind = Kind::Number(-1e6, 1e6);

pub(crate) static BOARD_NAME: Key = optional("name", Kind::Text, "What the target is called.");
pub(crate) static BOARD_WIDTH: Key = required(
    "width_m",
    Kind::Number(0.01, 10_000.0),
    "Distance of the left corners from the right ones in metres.",
);
pub(crate) static BOARD_HEIGHT: Key = required(
    "height_m",
    Kind::Number(0.01, 10_000.0),
    "Distance of the upper corners from the lower ones in metres.",
);
pub(crate) static CORNERS: Key = optional(
    "corners_px",
    Kind::Corners,
    "The corners in the picture of a fixed camera: [x, y] of the upper left, upper right, lower right and lower left one; x right, y down, the middle of the first pixel is 0, 0. Default: marks are looked for.",
);
pub(crate) static CORNERS_SIGMA: Key = optional(
    "corners_sigma_px",
    Kind::Number(0.0, 100.0),
    "How well corners_px is known: one standard deviation along x as along y, in pixels. Default: 0.5.",
);
const FRAME_SIDE: Kind = Kind::Number(1.0, 1e6);
pub(crate) static FRAME_WIDTH: Key = optional(
    "frame_width_px",
    FRAME_SIDE,
    "Width of the frames for which corners_px and [camera] hold, in pixels; frames of another size are no_target. Default: any.",
);
pub(crate) static FRAME_HEIGHT: Key = optional(
    "frame_height_px",
    FRAME_SIDE,
    "Height of these frames. Default: any.",
);
pub(crate) static MARKS: Key = optional(
    "marks",
    Kind::Word(&["four-corners", "two-panel-upper", "two-panel-lower"]),
    "The black marks of the target: an L in each corner, or L and T marks of the upper or the lower of two panels. Default: four-corners.",
);
pub(crate) static MARKS_SIGMA: Key = optional(
    "marks_sigma_m",
    Kind::Number(0.0, 10.0),
    "How well the places of the marks on the target are known: one standard deviation right as down, in metres. Default: 0.01.",
);
pub(crate) static FX: Key = required(
    "fx_px",
    Kind::Number(1.0, 1e7),
    "Focal length over the width of a pixel.",
);
pub(crate) static FY: Key = required(
    "fy_px",
    Kind::Number(1.0, 1e7),
    "Focal length over the height of a pixel.",
);
pub(crate) static CX: Key = required("cx_px", PIXELS, "Principal point, to the right, in pixels.");
pub(crate) static CY: Key = required("cy_px", PIXELS, "Principal point, down, in pixels.");
const DISTORTION: Kind = Kind::Number(-1e3, 1e3);
pub(crate) static K1: Key = optional("k1", DISTORTION, "Radial distortion of the second order.");
pub(crate) static K2: Key = optional("k2", DISTORTION, "Radial distortion of the fourth order.");
pub(crate) static P1: Key = optional("p1", DISTORTION, "Tangential distortion, down.");
pub(crate) static P2: Key = optional("p2", DISTORTION, "Tangential distortion, right.");
pub(crate) static K3: Key = optional("k3", DISTORTION, "Radial distortion of the sixth order.");
pub(crate) static CAMERA: Key = optional(
    "camera",
    Kind::Table(&[&FX, &FY, &CX, &CY, &K1, &K2, &P1, &P2, &K3]),
    "The camera's intrinsics and distortion (the model of OpenCV). Default: none, straight lines stay straight.",
);
pub(crate) static TARGET_FILE: &[&Key] = &[
    &BOARD_NAME,
    &BOARD_WIDTH,
    &BOARD_HEIGHT,
    &CORNERS,
    &CORNERS_SIGMA,
    &FRAME_WIDTH,
    &FRAME_HEIGHT,
    &MARKS,
    &MARKS_SIGMA,
    &CAMERA,
];

// The table of spots

pub(crate) static SPOT_FILE: Key = required("file", Kind::Text, "The frame.");
pub(crate) static SPOT_STATUS: Key = required("status", Kind::Text, "What became of the frame.");
pub(crate) static SPOT_FLAGS: Key = optional("flags", Kind::Text, "What else is to be known.");
pub(crate) static SPOT_REASON: Key = optional("reason", Kind::Text, "Why a frame was not read.");
pub(crate) static SPOT_SIGMA: Key = optional(
    "sigma_m",
    Kind::Number(0.0, 1e4),
    "One standard deviation of either component of the spot in metres.",
);
const COUNT: Kind = Kind::Number(-1e12, 1e12);
pub(crate) static SPOT_THRESHOLD: Key = optional("threshold", COUNT, "Gray value.");
pub(crate) static SPOT_AREA: Key = optional("area_px", COUNT, "Pixels of the spot.");
pub(crate) static SPOT_WINDOW: Key = optional("window_px", COUNT, "Side of the window.");
pub(crate) static SPOT_X: Key = optional("x_px", COUNT, "Where it is seen, to the right.");
pub(crate) static SPOT_Y: Key = optional("y_px", COUNT, "Where it is seen, down.");
pub(crate) static SPOT_ROW: Key = optional("row", COUNT, "Row of the standard's centre.");
pub(crate) static SPOT_COLUMN: Key = optional(
    "column",
    COUNT,
    "Where it is seen, to the right, in pixels.",
);
pub(crate) static SPOT_COLUMNS: &[&Key] = &[
    &SPOT_FILE,
    &TIME,
    &SPOT_THRESHOLD,
    &SPOT_AREA,
    &SPOT_WINDOW,
    &SPOT_ROW,
    &SPOT_COLUMN,
    &SPOT_X,
    &SPOT_Y,
    &SPOT_U,
    &SPOT_V,
    &SPOT_SIGMA,
    &SPOT_FLAGS,
    &SPOT_STATUS,
    &SPOT_REASON,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_hold_every_quantity_once_and_in_one_order() {
        for list in [
            LAYOUT,
            HELIOSTATS,
            DRIVE,
            DRIVE_COLUMNS,
            CALIBRATION_COLUMNS,
            SITE,
            TARGET,
            TARGET_FILE,
            SPOT_COLUMNS,
        ] {
            let mut seen: Vec<&str> = names(list).collect();
            seen.sort_unstable();
            seen.dedup();
            assert_eq!(seen.len(), list.len());
        }
        let all: Vec<&str> = names(QUANTITIES).collect();
        for list in [LAYOUT, HELIOSTATS] {
            assert!(
                all.iter()
                    .all(|name| names(list).any(|known| known == *name))
            );
        }
        let numbers: Vec<&str> = names(DRIVE_NUMBERS).collect();
        assert_eq!(numbers, names(DRIVE).skip(1).collect::<Vec<_>>());
        assert_eq!(numbers, names(DRIVE_COLUMNS).skip(3).collect::<Vec<_>>());
    }
}
