//! The standard, clause by clause.

use super::{Evaluation, Limits, Setup, Weather};

/// What was stated of the measurement besides the tables; `None` where nothing was.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Statements {
    /// Upper end of the pyrheliometer's range \[W/m²\].
    pub dni_range_w_m2: Option<f64>,
    /// Its resolution \[W/m²\].
    pub dni_resolution_w_m2: Option<f64>,
    /// Upper end of the anemometers' range \[m/s\].
    pub wind_range_m_s: Option<f64>,
    /// Their resolution \[m/s\].
    pub wind_resolution_m_s: Option<f64>,
    /// Their distance from the heliostat \[m\].
    pub wind_distance_m: Option<f64>,
    /// Whether they stand upwind of it.
    pub wind_upwind: Option<bool>,
    /// Their heights above ground \[m\]; empty if not stated.
    pub wind_heights_m: Vec<f64>,
    /// Height of the heliostat \[m\].
    pub heliostat_height_m: Option<f64>,
    /// Bits of a pixel.
    pub camera_bits: Option<f64>,
    /// Frames per second that the camera takes.
    pub camera_frames_per_s: Option<f64>,
    /// Width and height of its frames \[px\].
    pub camera_px: Option<[f64; 2]>,
    /// Whether it is a black-and-white camera.
    pub camera_monochrome: Option<bool>,
    /// Whether the target reflects diffusely.
    pub target_diffuse: Option<bool>,
    /// Whether it keeps shape and colour at 100 °C.
    pub target_stable_at_100_c: Option<bool>,
    /// Whether it is larger than the receiver's aperture.
    pub target_exceeds_aperture: Option<bool>,
    /// Whether it fills the frames.
    pub target_fills_frames: Option<bool>,
    /// Whether its centre was found from its four black corner marks.
    pub centre_from_marks: Option<bool>,
    /// Whether the campaign covers the poses in which the heliostat works.
    pub poses_covered: Option<bool>,
    /// Whether frames, wind, irradiance and temperature were recorded at the same time by one clock.
    pub synchronous: Option<bool>,
    /// How spots were found: `standard` (A.1 to A.4 as printed) or another word.
    pub spot_method: Option<String>,
    /// How they were found as their table shows, which is believed before what was stated.
    pub spot_method_of_table: Option<String>,
}

/// Whether a clause was followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ClauseOutcome {
    /// It was.
    Met,
    /// Nothing or not everything was said about it.
    NotStated,
    /// It was not.
    Deviates,
}

impl ClauseOutcome {
    /// In words.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Met => "met",
            Self::NotStated => "not stated",
            Self::Deviates => "deviates",
        }
    }
}

/// A clause of T/GRLM 02-2014 and whether it was followed.
#[derive(Debug, Clone, PartialEq)]
pub struct Clause {
    /// Its number.
    pub number: &'static str,
    /// What it is about.
    pub title: &'static str,
    /// Whether it was followed: as its worst part.
    pub outcome: ClauseOutcome,
    /// What was found, each part.
    pub words: Vec<String>,
}

/// Gathers the parts of a clause.
struct Parts {
    number: &'static str,
    title: &'static str,
    parts: Vec<(ClauseOutcome, String)>,
}

impl Parts {
    fn new(number: &'static str, title: &'static str) -> Self {
        Self {
            number,
            title,
            parts: Vec::new(),
        }
    }

    fn part(mut self, met: Option<bool>, words: impl Into<String>) -> Self {
        let outcome = match met {
            Some(true) => ClauseOutcome::Met,
            Some(false) => ClauseOutcome::Deviates,
            None => ClauseOutcome::NotStated,
        };
        self.parts.push((outcome, words.into()));
        self
    }

    /// A number that must be at least or at most another.
    fn number(self, what: &str, unit: &str, value: Option<f64>, at_most: bool, limit: f64) -> Self {
        let wanted = if at_most { "at most" } else { "at least" };
        let met = value.map(|v| if at_most { v <= limit } else { v >= limit });
        let words = match value {
            Some(v) => format!("{what} {v}{unit}, wanted {wanted} {limit}{unit}"),
            None => format!("{what}: not stated, wanted {wanted} {limit}{unit}"),
        };
        self.part(met, words)
    }

    /// Frames per second: as stated, else by the times of the frames. A camera that could take more than it took is no
    /// deviation of the camera.
    fn frame_rate(self, found: &Evaluation, said: &Statements, least: f64) -> Self {
        let by_times = found.step_s.map(|step_s| 1.0 / step_s);
        match (said.camera_frames_per_s, by_times) {
            (None, Some(rate)) => self.part(
                (rate >= 0.99 * least).then_some(true),
                format!("frames per second: not stated, {rate:.3} by their times, wanted at least {least}"),
            ),
            (stated, _) => self.number("frames per second", "", stated, false, least),
        }
    }

    /// A statement that must be true.
    fn stated(self, value: Option<bool>, yes: &str, no: &str, unknown: &str) -> Self {
        let words = match value {
            Some(true) => yes,
            Some(false) => no,
            None => unknown,
        };
        self.part(value, words)
    }

    fn done(self) -> Clause {
        let outcome = self.parts.iter().map(|(outcome, _)| *outcome).max();
        Clause {
            number: self.number,
            title: self.title,
            outcome: outcome.unwrap_or(ClauseOutcome::NotStated),
            words: self.parts.into_iter().map(|(_, words)| words).collect(),
        }
    }
}

pub(super) fn clauses(
    found: &Evaluation,
    weather: Option<&Weather>,
    setup: &Setup,
    limits: &Limits,
    said: &Statements,
) -> Vec<Clause> {
    vec![
        Parts::new("5.1", "Irradiance instrument")
            .number("range to", " W/m²", said.dni_range_w_m2, false, 4000.0)
            .number("resolution", " W/m²", said.dni_resolution_w_m2, true, 0.03)
            .done(),
        anemometers(weather, said),
        Parts::new("5.3", "Camera")
            .stated(
                said.camera_monochrome,
                "black and white",
                "not black and white",
                "black and white or colour: not stated",
            )
            .number(
                "pixels of",
                " bit",
                said.camera_bits,
                false,
                limits.camera_bits,
            )
            .frame_rate(found, said, limits.camera_frames_per_s)
            .part(
                said.camera_px
                    .map(|px| px[0] >= limits.camera_px[0] && px[1] >= limits.camera_px[1]),
                format!(
                    "frames of {}, wanted at least {} × {} px",
                    said.camera_px.map_or_else(
                        || "a size not stated".to_owned(),
                        |[w, h]| format!("{w} × {h} px")
                    ),
                    limits.camera_px[0],
                    limits.camera_px[1]
                ),
            )
            .done(),
        Parts::new("5.4", "Target")
            .stated(
                said.target_diffuse,
                "reflects diffusely",
                "does not reflect diffusely",
                "diffuse reflection: not stated",
            )
            .stated(
                said.target_stable_at_100_c,
                "keeps shape and colour at 100 °C",
                "does not keep shape and colour at 100 °C",
                "shape and colour at 100 °C: not stated",
            )
            .stated(
                said.target_exceeds_aperture,
                "larger than the receiver's aperture",
                "not larger than the receiver's aperture",
                "size against the receiver's aperture: not stated",
            )
            .done(),
        conditions(found, weather, limits),
        acquisition(found, weather, limits, said),
        Parts::new("7.1", "Taking the pictures")
            .stated(
                said.target_fills_frames,
                "the target fills the frames",
                "the target does not fill the frames",
                "whether the target fills the frames: not stated",
            )
            .stated(
                said.poses_covered,
                "the working poses of the heliostat are covered",
                "the working poses of the heliostat are not covered",
                "whether the working poses are covered: not stated",
            )
            .done(),
        method(Parts::new("7.2", "Centre of the spot"), said).done(),
        Parts::new("7.3", "Tracking accuracy of a frame")
            .part(
                Some(true),
                format!(
                    "formula (1) with L = {} m, about the aim point ({}, {}) m",
                    setup.slant_m, setup.aim_m[0], setup.aim_m[1]
                ),
            )
            .part(
                Some(setup.aim_m == [0.0; 2]),
                if setup.aim_m == [0.0; 2] {
                    "the aim point is the target's centre"
                } else {
                    "the aim point is not the target's centre"
                },
            )
            .done(),
        {
            let binned = found.histogram.iter().any(|bin| bin.frames > 0);
            Parts::new("8.1", "Distribution by wind speed")
                .part(
                    Some(binned),
                    if binned {
                        "shares at all wind speeds are drawn as in figure 3"
                    } else {
                        "no counted frame has a wind speed"
                    },
                )
                .done()
        },
        thresholds(found, limits),
        Parts::new("A.1", "Centre of the target")
            .stated(
                said.centre_from_marks,
                "from the four black corner marks",
                "not from the four black corner marks",
                "how the centre was found: not stated",
            )
            .done(),
        method(Parts::new("A.2", "Calculation of the spot's centre"), said).done(),
    ]
}

fn anemometers(weather: Option<&Weather>, said: &Statements) -> Clause {
    let mut parts = Parts::new("5.2", "Anemometers")
        .number("range to", " m/s", said.wind_range_m_s, false, 60.0)
        .number("resolution", " m/s", said.wind_resolution_m_s, true, 0.8)
        .stated(
            said.wind_upwind,
            "upwind of the heliostat",
            "not upwind of the heliostat",
            "whether upwind: not stated",
        )
        .number("distance", " m", said.wind_distance_m, false, 150.0);
    let recorded = weather.map_or(0, |w| w.wind_m_s.len());
    parts = parts.part(
        Some(recorded >= 3),
        format!("{recorded} of three wind columns recorded"),
    );
    let mut heights = said.wind_heights_m.clone();
    heights.sort_by(f64::total_cmp);
    let wanted = "wanted half the heliostat's height, its height, and more than 2 m above it";
    match (said.heliostat_height_m, heights.as_slice()) {
        (Some(height), heights) if !heights.is_empty() => {
            // within a tenth of the height
            let near = |wanted: f64| heights.iter().any(|h| (h - wanted).abs() <= 0.1 * height);
            let above = heights.last().is_some_and(|h| *h > height + 2.0);
            let list: Vec<String> = heights.iter().map(f64::to_string).collect();
            parts
                .part(
                    Some(near(0.5 * height) && near(height) && above),
                    format!("heights {} m, {wanted} ({height} m)", list.join(", ")),
                )
                .done()
        }
        _ => parts
            .part(None, format!("heights not stated, {wanted}"))
            .done(),
    }
}

fn conditions(found: &Evaluation, weather: Option<&Weather>, limits: &Limits) -> Clause {
    let missing = super::missing_winds(&found.histogram, limits);
    let [from, to] = limits.wind_m_s;
    let any_wind = weather.is_some_and(|w| !w.wind_m_s.is_empty());
    let dni = weather.and_then(|w| w.dni_w_m2.as_ref());
    let air = weather.and_then(|w| w.air_temperature_c.as_ref());
    let [coldest, warmest] = limits.air_temperature_c;
    Parts::new("6.1", "Irradiance and weather")
        .part(
            any_wind.then_some(missing.is_empty()),
            if !any_wind {
                "wind: not recorded".to_owned()
            } else if missing.is_empty() {
                format!("wind speeds from {from} to {to} m/s are covered")
            } else {
                let ranges: Vec<String> =
                    missing.iter().map(|[a, b]| format!("{a} to {b}")).collect();
                format!(
                    "of {from} to {to} m/s of wind, {} are without frames",
                    ranges.join(", ")
                )
            },
        )
        .part(
            air.map(|_| true),
            match air {
                Some(_) => format!("only frames with air of {coldest} to {warmest} °C are counted"),
                None => "air temperature: not recorded".to_owned(),
            },
        )
        .part(
            dni.map(|_| true),
            match dni {
                Some(_) => format!(
                    "only frames with more than {} W/m² are counted",
                    limits.least_dni_w_m2
                ),
                None => "irradiance: not recorded".to_owned(),
            },
        )
        .done()
}

fn acquisition(
    found: &Evaluation,
    weather: Option<&Weather>,
    limits: &Limits,
    said: &Statements,
) -> Clause {
    let recorded = weather.is_some_and(|w| {
        !w.wind_m_s.is_empty() && w.dni_w_m2.is_some() && w.air_temperature_c.is_some()
    });
    let parts = Parts::new("6.2", "Data acquisition")
        .part(
            Some(recorded),
            if recorded {
                "wind, irradiance and air temperature are recorded along with the frames"
            } else {
                "not all of wind, irradiance and air temperature are recorded"
            },
        )
        .stated(
            said.synchronous,
            "recorded at the same time by one clock",
            "not recorded at the same time by one clock",
            "whether by one clock: not stated",
        );
    match found.step_s {
        Some(step_s) if 1.0 / step_s < 0.99 * limits.camera_frames_per_s => parts
            .part(
                Some(false),
                format!(
                    "frames come at {:.3} per second, the camera of 5.3 at {} or more",
                    1.0 / step_s,
                    limits.camera_frames_per_s
                ),
            )
            .done(),
        _ => parts.done(),
    }
}

fn method(parts: Parts, said: &Statements) -> Parts {
    let stated = said.spot_method.as_deref();
    let shown = said.spot_method_of_table.as_deref();
    let method = shown.or(stated);
    let mut words = match method {
        Some("standard") => "threshold, square window and arg max as printed".to_owned(),
        Some(word) => format!("by the method “{word}” in place of the printed one"),
        None => "how spots were found: not stated".to_owned(),
    };
    match (stated, shown) {
        (Some(stated), Some(shown)) if stated != shown => {
            words += &format!(", as the table of spots shows; stated was “{stated}”");
        }
        (None, Some(_)) => words += ", as the table of spots shows",
        _ => {}
    }
    parts.part(method.map(|word| word == "standard"), words)
}

fn thresholds(found: &Evaluation, limits: &Limits) -> Clause {
    let grlm = Limits::grlm();
    let same = limits.shares == grlm.shares && limits.angle_mrad == grlm.angle_mrad;
    let empty: Vec<String> = found
        .judged
        .iter()
        .filter(|judged| judged.bin.frames == 0)
        .map(|judged| judged.limit.wind_m_s.to_string())
        .collect();
    Parts::new("8.2", "Thresholds of quality")
        .part(
            Some(same),
            if same {
                "the printed limits".to_owned()
            } else {
                format!("the limits of {} in place of the printed ones", limits.name)
            },
        )
        .part(
            Some(empty.is_empty()),
            if empty.is_empty() {
                "all wind speeds with a limit have frames".to_owned()
            } else {
                format!("no counted frames at {} m/s", empty.join(", "))
            },
        )
        .done()
}
