//! What belongs to a tracking-accuracy campaign besides its spots: the weather record, the limits of a
//! guideline, and what is to be said of the instruments.

use std::path::Path;

use helio_spot::accuracy::{Limits, ShareLimit, Statements, Uncertainty, Weather};

use crate::error::{IoError, Problem};
use crate::keys::{Key, Kind};
use crate::table::{Keyed, Naming, Table, TableSource, read_text};
use crate::toml::{Section, Source};

const fn optional(name: &'static str, kind: Kind, about: &'static str) -> Key {
    Key {
        name,
        kind,
        required: false,
        about,
    }
}

const fn required(name: &'static str, kind: Kind, about: &'static str) -> Key {
    Key {
        name,
        kind,
        required: true,
        about,
    }
}

// The weather record

const SPEED: Kind = Kind::Number(0.0, 100.0);
static TIME: Key = required("time", Kind::Time, "When, with the offset from UTC.");
static WIND: Key = optional("wind_m_s", SPEED, "Wind speed of one anemometer.");
static WIND_HALF: Key = optional(
    "wind_half_height_m_s",
    SPEED,
    "Wind speed at half the heliostat's height.",
);
static WIND_FULL: Key = optional(
    "wind_full_height_m_s",
    SPEED,
    "Wind speed at the heliostat's height.",
);
static WIND_ABOVE: Key = optional("wind_above_m_s", SPEED, "Wind speed above the heliostat.");
static WIND_DIRECTION: Key = optional(
    "wind_direction_deg",
    Kind::Number(-360.0, 360.0),
    "Where the wind comes from; not used.",
);
static DNI: Key = optional(
    "dni_w_m2",
    Kind::Number(-100.0, 4000.0),
    "Direct normal irradiance.",
);
static AIR: Key = optional(
    "air_temperature_c",
    Kind::Number(-90.0, 70.0),
    "Air temperature.",
);
static WEATHER_COLUMNS: &[&Key] = &[
    &TIME,
    &WIND,
    &WIND_HALF,
    &WIND_FULL,
    &WIND_ABOVE,
    &WIND_DIRECTION,
    &DNI,
    &AIR,
];

/// Reads a weather record, CSV or Parquet: `time`, and any of `wind_m_s` (or the three of T/GRLM 02-2014,
/// `wind_half_height_m_s, wind_full_height_m_s, wind_above_m_s`), `dni_w_m2` and `air_temperature_c`; a
/// `wind_direction_deg` is left aside. Cells may be empty.
///
/// # Errors
/// [`IoError`] with file, line (row) and column for an unknown column, a table without any of these quantities, a
/// row without a time, a time without an offset or not later than the row before, and a number that is none or
/// out of range.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("weather.csv");
/// std::fs::write(&path, "time,wind_m_s,dni_w_m2\n2026-06-20T08:00:00Z,3.5,\n2026-06-20T08:00:01Z,3.7,812\n")?;
/// let weather = helio_io::load_weather(&path)?;
/// assert_eq!(weather.wind_m_s[0], [3.5, 3.7]);
/// assert!(weather.dni_w_m2.unwrap()[0].is_nan());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load_weather<'a>(table: impl Into<TableSource<'a>>) -> Result<Weather, IoError> {
    let table = Keyed::new(Table::read(table)?, WEATHER_COLUMNS, &Naming::default())?;
    let rows = table.table().rows();
    let column = |key: &'static Key| -> Result<Option<Vec<f64>>, IoError> {
        if !table.has(key) {
            return Ok(None);
        }
        (0..rows)
            .map(|row| Ok(table.number(row, key, None)?.unwrap_or(f64::NAN)))
            .collect::<Result<_, _>>()
            .map(Some)
    };
    let mut unix_ns: Vec<i64> = Vec::with_capacity(rows);
    for row in 0..rows {
        let Some(time) = table.time(row, &TIME, "")? else {
            let problem = Problem::Missing {
                what: "the time".into(),
                wanted: "every row of a weather record has one".into(),
            };
            return Err(table.error(row, &TIME, None, problem));
        };
        if unix_ns.last().is_some_and(|last| *last >= time) {
            let message = format!(
                "not later than {}; sort the record by time",
                table.table().position(row - 1)
            );
            return Err(table.error(row, &TIME, None, Problem::Conflict { message }));
        }
        unix_ns.push(time);
    }
    let mut wind_m_s = Vec::new();
    for key in [&WIND, &WIND_HALF, &WIND_FULL, &WIND_ABOVE] {
        wind_m_s.extend(column(key)?);
    }
    if table.has(&WIND) && wind_m_s.len() > 1 {
        let message =
            "wind_m_s stands beside winds by height; name all of them by height, or give one"
                .into();
        return Err(IoError::new(
            table.table().header_place(),
            Problem::Conflict { message },
        ));
    }
    let weather = Weather {
        unix_ns,
        wind_m_s,
        dni_w_m2: column(&DNI)?,
        air_temperature_c: column(&AIR)?,
    };
    if weather.wind_m_s.is_empty()
        && weather.dni_w_m2.is_none()
        && weather.air_temperature_c.is_none()
    {
        return Err(table.missing_column(&WIND));
    }
    Ok(weather)
}

// The limits of a guideline

static NAME: Key = required("name", Kind::Text, "What the guideline is called.");
static ANGLE: Key = required(
    "angle_mrad",
    Kind::Number(1e-3, 1e3),
    "The angle within which frames are counted.",
);
static LEAST_DNI: Key = required(
    "least_dni_w_m2",
    Kind::Number(0.0, 2000.0),
    "Direct normal irradiance above which frames count.",
);
const AIR_C: Kind = Kind::Number(-90.0, 90.0);
static COLDEST: Key = required("coldest_air_c", AIR_C, "Coldest air in which frames count.");
static WARMEST: Key = required("warmest_air_c", AIR_C, "Warmest air in which frames count.");
static WIND_FROM: Key = required("wind_from_m_s", SPEED, "Weakest wind to cover.");
static WIND_TO: Key = required("wind_to_m_s", SPEED, "Strongest wind to cover.");
static LEAST_BITS: Key = required(
    "camera_bits",
    Kind::Number(0.0, 64.0),
    "Least bits of a pixel.",
);
static LEAST_RATE: Key = required(
    "camera_frames_per_s",
    Kind::Number(0.0, 1e6),
    "Least frames per second.",
);
const SIDE: Kind = Kind::Number(0.0, 1e6);
static LEAST_WIDTH: Key = required("camera_width_px", SIDE, "Least width of a frame.");
static LEAST_HEIGHT: Key = required("camera_height_px", SIDE, "Least height of a frame.");
static SHARE_WIND: Key = required("wind_m_s", SPEED, "The wind speed.");
static SHARE: Key = required(
    "share",
    Kind::Number(1e-6, 1.0 - 1e-6),
    "The share of frames within the angle that must be exceeded, 0 to 1.",
);
static SHARES: Key = required(
    "shares",
    Kind::Named(&[&SHARE_WIND, &SHARE]),
    "Tables of any names, each a wind speed and the share wanted there.",
);
static LIMITS: &[&Key] = &[
    &NAME,
    &ANGLE,
    &LEAST_DNI,
    &COLDEST,
    &WARMEST,
    &WIND_FROM,
    &WIND_TO,
    &LEAST_BITS,
    &LEAST_RATE,
    &LEAST_WIDTH,
    &LEAST_HEIGHT,
    &SHARES,
];

fn needed(section: &Section<'_>, key: &Key) -> Result<f64, IoError> {
    section.number(key)?.ok_or_else(|| section.missing(key))
}

/// Reads the limits of another guideline than T/GRLM 02-2014: TOML with the keys that [`limits_toml`] writes.
///
/// # Errors
/// [`IoError`] with file, line and column for text that is no TOML, an unknown or missing key, a number out of
/// range, two shares for one wind, and ranges that run backwards.
pub fn load_limits(path: &Path) -> Result<Limits, IoError> {
    limits_of_text(path, &read_text(path)?)
}

/// The same of the text that such a file would have; `path` is what messages call it.
///
/// # Errors
/// As [`load_limits`].
pub fn limits_of_text(path: &Path, text: &str) -> Result<Limits, IoError> {
    let source = Source { path, text };
    let document = source.parse()?;
    let file = Section::new(source, String::new(), document.as_table(), None, LIMITS)?;
    let number = |key| needed(&file, key);
    let ascending = |from: &'static Key, to: &'static Key| -> Result<[f64; 2], IoError> {
        let range = [number(from)?, number(to)?];
        if range[0] < range[1] {
            return Ok(range);
        }
        let message = format!("{} must be more than {}", to.name, from.name);
        Err(file.error(to, Problem::Conflict { message }))
    };
    let mut shares: Vec<ShareLimit> = Vec::new();
    for (_, section) in file.named(&SHARES)? {
        let wind_m_s = needed(&section, &SHARE_WIND)?;
        if shares.iter().any(|limit| limit.wind_m_s == wind_m_s) {
            let message = format!("there is another share for {wind_m_s} m/s");
            return Err(section.error(&SHARE_WIND, Problem::Conflict { message }));
        }
        shares.push(ShareLimit {
            wind_m_s,
            share: needed(&section, &SHARE)?,
        });
    }
    if shares.is_empty() {
        let what = "shares has no table: there is nothing to judge by".to_owned();
        return Err(file.error(&SHARES, Problem::Empty { what }));
    }
    shares.sort_by(|a, b| a.wind_m_s.total_cmp(&b.wind_m_s));
    Ok(Limits {
        name: file.text(&NAME)?.unwrap_or_default().to_owned(),
        angle_mrad: number(&ANGLE)?,
        shares,
        least_dni_w_m2: number(&LEAST_DNI)?,
        air_temperature_c: ascending(&COLDEST, &WARMEST)?,
        wind_m_s: ascending(&WIND_FROM, &WIND_TO)?,
        camera_bits: number(&LEAST_BITS)?,
        camera_frames_per_s: number(&LEAST_RATE)?,
        camera_px: [number(&LEAST_WIDTH)?, number(&LEAST_HEIGHT)?],
    })
}

/// Limits as a file that [`load_limits`] reads, to start another guideline from.
///
/// ```
/// use helio_spot::accuracy::Limits;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("limits.toml");
/// std::fs::write(&path, helio_io::limits_toml(&Limits::grlm()))?;
/// assert_eq!(helio_io::load_limits(&path)?, Limits::grlm());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn limits_toml(limits: &Limits) -> String {
    let mut text = format!("name = {}\n", toml_edit::Value::from(limits.name.as_str()));
    for (key, value) in [
        (&ANGLE, limits.angle_mrad),
        (&LEAST_DNI, limits.least_dni_w_m2),
        (&COLDEST, limits.air_temperature_c[0]),
        (&WARMEST, limits.air_temperature_c[1]),
        (&WIND_FROM, limits.wind_m_s[0]),
        (&WIND_TO, limits.wind_m_s[1]),
        (&LEAST_BITS, limits.camera_bits),
        (&LEAST_RATE, limits.camera_frames_per_s),
        (&LEAST_WIDTH, limits.camera_px[0]),
        (&LEAST_HEIGHT, limits.camera_px[1]),
    ] {
        text += &format!("{} = {value:?} # {}\n", key.name, key.about);
    }
    for limit in &limits.shares {
        let name = limit.wind_m_s.to_string().replace('.', "_");
        text += &format!(
            "\n[shares.at_{name}]\nwind_m_s = {:?}\nshare = {:?}\n",
            limit.wind_m_s, limit.share
        );
    }
    text
}

// The campaign

static LABORATORY: Key = optional("laboratory", Kind::Text, "Who measured.");
static OPERATOR: Key = optional("operator", Kind::Text, "Who was there.");
static PLACE: Key = optional("place", Kind::Text, "Where.");
static NOTES: Key = optional("notes", Kind::Texts, "What else is to be known.");
static WHO: Key = optional("name", Kind::Text, "What it is called.");
static MAKER: Key = optional("maker", Kind::Text, "Who made it.");
static SERIAL: Key = optional("serial", Kind::Text, "Its serial number.");
static CALIBRATED: Key = optional("calibrated", Kind::Text, "When, by whom, certificate.");
const ANY_LENGTH: Kind = Kind::Number(0.0, 1e5);
static HEIGHT: Key = optional(
    "height_m",
    ANY_LENGTH,
    "Height of the heliostat above ground.",
);
static RANGE_DNI: Key = optional(
    "range_w_m2",
    Kind::Number(0.0, 1e5),
    "Upper end of its range.",
);
static RESOLUTION_DNI: Key = optional("resolution_w_m2", Kind::Number(0.0, 1e3), "Its resolution.");
static RANGE_WIND: Key = optional(
    "range_m_s",
    Kind::Number(0.0, 1e3),
    "Upper end of their range.",
);
static RESOLUTION_WIND: Key = optional("resolution_m_s", SPEED, "Their resolution.");
static DISTANCE: Key = optional(
    "distance_m",
    ANY_LENGTH,
    "Their distance from the heliostat.",
);
static UPWIND: Key = optional("upwind", Kind::YesNo, "Whether they stand upwind of it.");
static HEIGHT_1: Key = optional(
    "half_height_m",
    ANY_LENGTH,
    "Height of the lowest above ground.",
);
static HEIGHT_2: Key = optional("full_height_m", ANY_LENGTH, "Height of the middle one.");
static HEIGHT_3: Key = optional("above_height_m", ANY_LENGTH, "Height of the highest.");
static BITS: Key = optional("bits", Kind::Number(1.0, 64.0), "Bits of a pixel.");
static RATE: Key = optional("frames_per_s", Kind::Number(0.0, 1e6), "Frames per second.");
static WIDTH_PX: Key = optional("width_px", SIDE, "Width of a frame.");
static HEIGHT_PX: Key = optional("height_px", SIDE, "Height of a frame.");
static MONOCHROME: Key = optional("monochrome", Kind::YesNo, "Whether it is black and white.");
static DIFFUSE: Key = optional("diffuse", Kind::YesNo, "Whether it reflects diffusely.");
static STABLE: Key = optional(
    "stable_at_100_c",
    Kind::YesNo,
    "Whether it keeps shape and colour at 100 °C.",
);
static EXCEEDS: Key = optional(
    "exceeds_aperture",
    Kind::YesNo,
    "Whether it is larger than the receiver's aperture.",
);
static FILLS: Key = optional("fills_frames", Kind::YesNo, "Whether it fills the frames.");
static FROM_MARKS: Key = optional(
    "centre_from_marks",
    Kind::YesNo,
    "Whether its centre was found from its four black corner marks.",
);
static METHOD: Key = optional(
    "spot_method",
    Kind::Text,
    "How spots were found: standard (as printed), robust, or another word.",
);
static POSES: Key = optional(
    "poses_covered",
    Kind::YesNo,
    "Whether the working poses of the heliostat are covered.",
);
static SYNCHRONOUS: Key = optional(
    "synchronous",
    Kind::YesNo,
    "Whether frames and weather were recorded at the same time by one clock.",
);
static SIGMA_SLANT: Key = optional(
    "slant_m",
    ANY_LENGTH,
    "Of the distance: one standard deviation.",
);
static SIGMA_SCALE: Key = optional(
    "pixel_scale",
    Kind::Number(0.0, 0.099),
    "Of the pixel scale, as a part of itself.",
);
static SIGMA_SURVEY: Key = optional(
    "survey_m",
    ANY_LENGTH,
    "Of the target's place, per component.",
);
static SIGMA_CENTRE: Key = optional(
    "centre_m",
    ANY_LENGTH,
    "Of a spot's centre, per component, where the table states none.",
);
static HELIOSTAT: Key = optional(
    "heliostat",
    Kind::Table(&[&WHO, &MAKER, &SERIAL, &HEIGHT]),
    "The heliostat.",
);
static IRRADIANCE: Key = optional(
    "irradiance",
    Kind::Table(&[
        &WHO,
        &MAKER,
        &SERIAL,
        &CALIBRATED,
        &RANGE_DNI,
        &RESOLUTION_DNI,
    ]),
    "The pyrheliometer.",
);
static ANEMOMETERS: Key = optional(
    "wind",
    Kind::Table(&[
        &WHO,
        &MAKER,
        &SERIAL,
        &CALIBRATED,
        &RANGE_WIND,
        &RESOLUTION_WIND,
        &DISTANCE,
        &UPWIND,
        &HEIGHT_1,
        &HEIGHT_2,
        &HEIGHT_3,
    ]),
    "The anemometers.",
);
static THERMOMETER: Key = optional(
    "thermometer",
    Kind::Table(&[&WHO, &MAKER, &SERIAL, &CALIBRATED]),
    "The thermometer.",
);
static CAMERA: Key = optional(
    "camera",
    Kind::Table(&[
        &WHO,
        &MAKER,
        &SERIAL,
        &CALIBRATED,
        &BITS,
        &RATE,
        &WIDTH_PX,
        &HEIGHT_PX,
        &MONOCHROME,
    ]),
    "The camera.",
);
static TARGET: Key = optional(
    "target",
    Kind::Table(&[
        &WHO,
        &MAKER,
        &SERIAL,
        &CALIBRATED,
        &DIFFUSE,
        &STABLE,
        &EXCEEDS,
        &FILLS,
        &FROM_MARKS,
    ]),
    "The target.",
);
static MEASUREMENT: Key = optional(
    "measurement",
    Kind::Table(&[&METHOD, &POSES, &SYNCHRONOUS]),
    "How it was measured.",
);
static UNCERTAINTY: Key = optional(
    "uncertainty",
    Kind::Table(&[&SIGMA_SLANT, &SIGMA_SCALE, &SIGMA_SURVEY, &SIGMA_CENTRE]),
    "One standard deviation of what the instruments may be wrong by.",
);
static CAMPAIGN: &[&Key] = &[
    &LABORATORY,
    &OPERATOR,
    &PLACE,
    &NOTES,
    &HELIOSTAT,
    &IRRADIANCE,
    &ANEMOMETERS,
    &THERMOMETER,
    &CAMERA,
    &TARGET,
    &MEASUREMENT,
    &UNCERTAINTY,
];

/// An instrument as `campaign.toml` names it; texts are empty where nothing was stated.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Instrument {
    /// What it is for: the name of its table.
    pub role: &'static str,
    /// What it is called.
    pub name: String,
    /// Who made it.
    pub maker: String,
    /// Its serial number.
    pub serial: String,
    /// When it was calibrated, by whom, by which certificate.
    pub calibrated: String,
}

/// What `campaign.toml` says of a measurement.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Campaign {
    /// Who measured.
    pub laboratory: String,
    /// Who was there.
    pub operator: String,
    /// Where.
    pub place: String,
    /// What else is to be known.
    pub notes: Vec<String>,
    /// The heliostat and the instruments that are named.
    pub instruments: Vec<Instrument>,
    /// What clauses ask for.
    pub statements: Statements,
    /// How well the instruments know.
    pub uncertainty: Uncertainty,
}

/// Reads a `campaign.toml`: who measured, where, with what, and how well that knows. Every key is optional; what is
/// not stated is reported as such.
///
/// # Errors
/// [`IoError`] with file, line and column for text that is no TOML, an unknown key, and a value of another kind or
/// out of range.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("campaign.toml");
/// std::fs::write(&path, "laboratory = \"Optics\"\n[camera]\nbits = 12\n[uncertainty]\nslant_m = 0.05\n")?;
/// let campaign = helio_io::load_campaign(&path)?;
/// assert_eq!(campaign.statements.camera_bits, Some(12.0));
/// assert_eq!(campaign.uncertainty.slant_m, Some(0.05));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load_campaign(path: &Path) -> Result<Campaign, IoError> {
    campaign_of_text(path, &read_text(path)?)
}

/// The same of the text that such a file would have; `path` is what messages call it.
///
/// # Errors
/// As [`load_campaign`].
pub fn campaign_of_text(path: &Path, text: &str) -> Result<Campaign, IoError> {
    let source = Source { path, text };
    let document = source.parse()?;
    let file = Section::new(source, String::new(), document.as_table(), None, CAMPAIGN)?;
    let text = |section: &Section<'_>, key: &'static Key| -> Result<String, IoError> {
        Ok(section.text(key)?.unwrap_or_default().trim().to_owned())
    };
    let mut campaign = Campaign {
        laboratory: text(&file, &LABORATORY)?,
        operator: text(&file, &OPERATOR)?,
        place: text(&file, &PLACE)?,
        ..Campaign::default()
    };
    for note in file.texts(&NOTES)? {
        campaign.notes.push(note.text.trim().to_owned());
    }
    let said = &mut campaign.statements;
    let yes = |section: &Section<'_>, key: &'static Key| -> Result<Option<bool>, IoError> {
        Ok(section.number(key)?.map(|number| number != 0.0))
    };
    for key in [
        &HELIOSTAT,
        &TARGET,
        &CAMERA,
        &IRRADIANCE,
        &ANEMOMETERS,
        &THERMOMETER,
    ] {
        let Some(section) = file.section(key)? else {
            continue;
        };
        campaign.instruments.push(Instrument {
            role: key.name,
            name: text(&section, &WHO)?,
            maker: text(&section, &MAKER)?,
            serial: text(&section, &SERIAL)?,
            calibrated: match key.name {
                "heliostat" => String::new(),
                _ => text(&section, &CALIBRATED)?,
            },
        });
        match key.name {
            "heliostat" => said.heliostat_height_m = section.number(&HEIGHT)?,
            "irradiance" => {
                said.dni_range_w_m2 = section.number(&RANGE_DNI)?;
                said.dni_resolution_w_m2 = section.number(&RESOLUTION_DNI)?;
            }
            "wind" => {
                said.wind_range_m_s = section.number(&RANGE_WIND)?;
                said.wind_resolution_m_s = section.number(&RESOLUTION_WIND)?;
                said.wind_distance_m = section.number(&DISTANCE)?;
                said.wind_upwind = yes(&section, &UPWIND)?;
                for height in [&HEIGHT_1, &HEIGHT_2, &HEIGHT_3] {
                    said.wind_heights_m.extend(section.number(height)?);
                }
            }
            "camera" => {
                said.camera_bits = section.number(&BITS)?;
                said.camera_frames_per_s = section.number(&RATE)?;
                said.camera_px = match (section.number(&WIDTH_PX)?, section.number(&HEIGHT_PX)?) {
                    (Some(width), Some(height)) => Some([width, height]),
                    _ => None,
                };
                said.camera_monochrome = yes(&section, &MONOCHROME)?;
            }
            "target" => {
                said.target_diffuse = yes(&section, &DIFFUSE)?;
                said.target_stable_at_100_c = yes(&section, &STABLE)?;
                said.target_exceeds_aperture = yes(&section, &EXCEEDS)?;
                said.target_fills_frames = yes(&section, &FILLS)?;
                said.centre_from_marks = yes(&section, &FROM_MARKS)?;
            }
            _ => {}
        }
    }
    if let Some(section) = file.section(&MEASUREMENT)? {
        said.spot_method = section.text(&METHOD)?.map(|word| word.trim().to_owned());
        said.poses_covered = yes(&section, &POSES)?;
        said.synchronous = yes(&section, &SYNCHRONOUS)?;
    }
    if let Some(section) = file.section(&UNCERTAINTY)? {
        campaign.uncertainty = Uncertainty {
            slant_m: section.number(&SIGMA_SLANT)?,
            scale: section.number(&SIGMA_SCALE)?,
            survey_m: section.number(&SIGMA_SURVEY)?,
            centre_m: section.number(&SIGMA_CENTRE)?,
        };
    }
    Ok(campaign)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused<T: std::fmt::Debug>(
        read: impl Fn(&Path) -> Result<T, IoError>,
        text: &str,
    ) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, text).unwrap();
        read(&path).unwrap_err().to_string()
    }

    #[test]
    fn wrong_weather_is_refused_by_name() {
        for (text, words) in [
            ("time,wind_m_s\n2026-06-20T08:00:00,3\n", "no offset"),
            (
                "time,wind_ms\n2026-06-20T08:00:00Z,3\n",
                "did you mean `wind_m_s`",
            ),
            ("wind_m_s\n3\n", "`time`"),
            ("time\n2026-06-20T08:00:00Z\n", "`wind_m_s`"),
            ("time,wind_m_s\n", "no rows"),
            ("time,wind_m_s\n,3\n", "the time is missing"),
            (
                "time,wind_m_s\n2026-06-20T08:00:01Z,3\n2026-06-20T08:00:00Z,3\n",
                "not later than line 2",
            ),
            ("time,wind_m_s\n2026-06-20T08:00:01Z,-3\n", "0..=100 m/s"),
            ("time,dni_w_m2\n2026-06-20T08:00:01Z,9999\n", "W/m²"),
            ("time,wind_m_s\n2026-06-20T08:00:01Z,calm\n", "a number"),
            (
                "time,wind_m_s,wind_above_m_s\n2026-06-20T08:00:01Z,3,4\n",
                "by height",
            ),
        ] {
            let said = refused(|path| load_weather(path), text);
            assert!(said.contains(words), "{text}: {said}");
        }
    }

    #[test]
    fn wrong_limits_are_refused_by_name() {
        let good = limits_toml(&Limits::grlm());
        for (from, to, words) in [
            ("angle_mrad", "angle_mard", "did you mean `angle_mrad`"),
            ("share = 0.62", "share = 62", "share"),
            (
                "wind_m_s = 8.0",
                "wind_m_s = 4.0",
                "another share for 4 m/s",
            ),
            (
                "wind_to_m_s = 14.0",
                "wind_to_m_s = 0.0",
                "more than wind_from_m_s",
            ),
            ("least_dni_w_m2 = 300.0", "", "least_dni_w_m2 is missing"),
        ] {
            assert!(good.contains(from), "{from}");
            let said = refused(load_limits, &good.replacen(from, to, 1));
            assert!(said.contains(words), "{to}: {said}");
        }
        let none = format!("{}\n[shares]\n", good.split("\n[shares").next().unwrap());
        let said = refused(load_limits, &none);
        assert!(said.contains("nothing to judge by"), "{said}");
    }

    #[test]
    fn wrong_campaigns_are_refused_by_name() {
        for (text, words) in [
            ("labratory = \"x\"\n", "did you mean `laboratory`"),
            ("[camera]\nbits = \"8\"\n", "camera.bits"),
            ("[uncertainty]\nslant_m = -1\n", "slant_m"),
            ("[wind]\nupwind = 3\n", "0 or 1"),
            ("[heliostat]\ncalibrated = \"x\"\n", "calibrated"),
        ] {
            let said = refused(load_campaign, text);
            assert!(said.contains(words), "{text}: {said}");
        }
    }
}
