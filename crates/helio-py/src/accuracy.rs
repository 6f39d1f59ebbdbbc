//! `accuracy`: the typed call and its answer are in `helio_py._accuracy`.

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use helio_io::output::{Destination, Format, KeptColumns};
use helio_io::{
    CampaignAsked, IoError, JudgedCampaign, campaign_of_text, format_time, limits_of_text,
    load_campaign, load_limits, load_spots, load_weather,
};
use helio_report::accuracy::{AccuracyPage, accuracy_page};
use helio_spot::SpotStatus;
use helio_spot::accuracy::{AccuracyError, Limits, Options};
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::failure::Failure;
use crate::guard::guarded;
use crate::table::{Given, handed_out};

/// Options as the keywords of `accuracy` have them. Of limits and campaign the name and, of a mapping, its text.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct CampaignWords {
    slant_m: f64,
    aim_m: [f64; 2],
    heliostat_at_deg: Option<[f64; 2]>,
    limits: Option<(PathBuf, Option<String>)>,
    campaign: Option<(PathBuf, Option<String>)>,
    bin_half_width_m_s: f64,
    histogram_step_m_s: f64,
    confidence: f64,
    weather_gap_s: f64,
    accept: Vec<String>,
}

impl CampaignWords {
    fn options(&self) -> Result<Options, Failure> {
        let mut accepted = vec![SpotStatus::Ok];
        for word in &self.accept {
            let known = [
                SpotStatus::Ok,
                SpotStatus::Cut,
                SpotStatus::Saturated,
                SpotStatus::Ambiguous,
            ];
            let Some(status) = known.into_iter().find(|status| status.as_str() == word) else {
                let message = format!("wanted cut, saturated or ambiguous, got `{word}`");
                return Err(Failure::of("OptionError", "accept", message));
            };
            if !accepted.contains(&status) {
                accepted.push(status);
            }
        }
        Ok(Options {
            bin_half_width_m_s: self.bin_half_width_m_s,
            histogram_step_m_s: self.histogram_step_m_s,
            confidence: self.confidence,
            weather_gap_s: self.weather_gap_s,
            accepted,
        })
    }
}

fn of_toml<T>(
    (path, text): &(PathBuf, Option<String>),
    of_file: impl Fn(&Path) -> Result<T, IoError>,
    of_text: impl Fn(&Path, &str) -> Result<T, IoError>,
) -> Result<T, Failure> {
    Ok(match text {
        Some(text) => of_text(path, text)?,
        None => of_file(path)?,
    })
}

impl From<AccuracyError> for Failure {
    fn from(error: AccuracyError) -> Self {
        let message = error.to_string();
        match error {
            AccuracyError::NoSpots => Self::new("MissingError", message).with_field("spots"),
            AccuracyError::Bad { what, value, .. } => Self::new("OptionError", message)
                .with_field(keyword(what))
                .with_value(value),
            AccuracyError::Uncertainty { value, .. } => Self::new("OptionError", message)
                .with_field("campaign")
                .with_value(value),
            _ => Self::new("OptionError", message).with_field("weather"),
        }
    }
}

/// The keyword that a number of an evaluation was given by.
fn keyword(what: &str) -> &'static str {
    match what {
        "the distance of the heliostat" => "slant_m",
        "the aim point" => "aim_m",
        "the direction to the heliostat" => "heliostat_at_deg",
        "half the width of a wind bin" => "bin_half_width_m_s",
        "the width of the histogram's bins" => "histogram_step_m_s",
        "the confidence" => "confidence",
        "the longest gap of the weather" => "weather_gap_s",
        "a status whose spots are to count" => "accept",
        _ => "limits",
    }
}

/// A judged campaign; private: `helio_py.Accuracy` says what it holds.
#[pyclass(frozen, name = "_Judged", module = "helio_py._native")]
pub(crate) struct PyJudged {
    judged: JudgedCampaign,
    frames: KeptColumns,
    unix_ns: i64,
}

#[pymethods]
impl PyJudged {
    /// Everything as JSON.
    fn json(&self) -> PyResult<String> {
        guarded(|| {
            let value = self.judged.json(env!("CARGO_PKG_VERSION"));
            serde_json::to_string_pretty(&value)
                .map_err(|e| Failure::new("InternalError", format!("accuracy: {e}")))
        })
    }

    /// The columns of every frame, once.
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        guarded(|| handed_out(py, self.frames.take()))
    }

    /// What the campaign states otherwise than its table shows.
    fn methods_differ(&self) -> Option<[String; 2]> {
        self.judged.methods_differ.clone()
    }

    /// The page to look at and to sign.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        guarded(|| {
            Ok(py.detach(|| {
                let (version, made) = (env!("CARGO_PKG_VERSION"), format_time(self.unix_ns));
                accuracy_page(&AccuracyPage::of_campaign(&self.judged, version, made))
            }))
        })
    }
}

/// Judges a campaign.
#[pyfunction]
pub(crate) fn _accuracy(
    py: Python<'_>,
    spots: &Bound<'_, PyAny>,
    weather: Option<&Bound<'_, PyAny>>,
    words: CampaignWords,
) -> PyResult<PyJudged> {
    guarded(|| {
        let spots = Given::of(spots, "spots")?;
        let weather = weather.map(|w| Given::of(w, "weather")).transpose()?;
        py.detach(|| judged(&spots, weather.as_ref(), &words))
    })
}

fn judged(
    spots: &Given,
    weather: Option<&Given>,
    words: &CampaignWords,
) -> Result<PyJudged, Failure> {
    let named = |name: &'static str| move |error: IoError| Failure::from(error).or_of(name);
    let table = load_spots(spots.source()).map_err(named("spots"))?;
    if table.rows.iter().all(|row| row.unix_ns.is_none()) {
        let message =
            "no row has a time; wanted a column `time`, such as find_spots(times=…) gives";
        return Err(Failure::of("MissingError", "spots", message));
    }
    let record = weather.map(|w| load_weather(w.source()).map_err(named("weather")));
    let record = record.transpose()?;
    let mut files = Vec::new();
    for given in [Some(spots), weather].into_iter().flatten() {
        let source = given.source();
        files.push((source.path().display().to_string(), source.hash()?));
    }
    for (path, text) in [&words.limits, &words.campaign].into_iter().flatten() {
        if text.is_none() {
            files.push((path.display().to_string(), helio_io::hash_file(path)?));
        }
    }
    let asked = CampaignAsked {
        spots: &table,
        weather: record.as_ref(),
        limits: match &words.limits {
            Some(limits) => of_toml(limits, load_limits, limits_of_text)?,
            None => Limits::grlm(),
        },
        campaign: match &words.campaign {
            Some(campaign) => of_toml(campaign, load_campaign, campaign_of_text)?,
            None => helio_io::Campaign::default(),
        },
        aim_m: words.aim_m,
        slant_m: words.slant_m,
        heliostat_at_deg: words.heliostat_at_deg,
        options: words.options()?,
        files,
    };
    let judged = asked.judged()?;
    let frames = KeptColumns::default();
    judged.write_frames(Destination::Columns(frames.clone()), Format::Csv, &table)?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let seconds = now.map_or(0, |since| since.as_secs().min(4_000_000_000) as i64);
    Ok(PyJudged {
        judged,
        frames,
        unix_ns: seconds * 1_000_000_000,
    })
}
