//! A tracking-accuracy campaign judged by a guideline: what is reported of it, as JSON, as rows and in words.

use helio_spot::accuracy::{
    AccuracyError, EvaluatedFrame, Evaluation, Figure, Figures, Limits, Options, Setup, SpotRow,
    Weather, WindBin, evaluate,
};
use serde_json::{Map, Value, json};

use crate::campaign::Campaign;
use crate::error::IoError;
use crate::output::{Cells, Destination, Format, write_columns};
use crate::spots::{SpotRow as FileRow, SpotTable};
use crate::times::format_time;

/// A campaign as it is to be judged.
#[derive(Debug, Clone)]
pub struct CampaignAsked<'a> {
    /// What cameras saw.
    pub spots: &'a SpotTable,
    /// The weather beside it; without it there is neither wind nor verdict.
    pub weather: Option<&'a Weather>,
    /// What it is judged by.
    pub limits: Limits,
    /// What is to be said of laboratory, instruments and their uncertainty.
    pub campaign: Campaign,
    /// Aim point on the target \[m\], right and down of its centre.
    pub aim_m: [f64; 2],
    /// From the heliostat's centre of rotation to the aim point \[m\].
    pub slant_m: f64,
    /// Where the heliostat stands as seen from the aim point: degrees right of and below the target's normal.
    pub heliostat_at_deg: Option<[f64; 2]>,
    /// How it is counted.
    pub options: Options,
    /// The raw data: name of each file and its SHA-256.
    pub files: Vec<(String, String)>,
}

/// A campaign that was judged.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct JudgedCampaign {
    /// What was found.
    pub evaluation: Evaluation,
    /// The spots it was found from.
    pub spots: Vec<SpotRow>,
    /// Where the heliostat aims and from where.
    pub setup: Setup,
    /// What it was judged by.
    pub limits: Limits,
    /// How it was counted.
    pub options: Options,
    /// What is to be said of it.
    pub campaign: Campaign,
    /// The raw data: name of each file and its SHA-256.
    pub files: Vec<(String, String)>,
    /// The method that the campaign states and the one that the table shows, where they differ.
    pub methods_differ: Option<[String; 2]>,
    heliostat_at_deg: Option<[f64; 2]>,
}

impl CampaignAsked<'_> {
    /// Judges it.
    ///
    /// # Errors
    /// [`AccuracyError`] for no spots, numbers that make no sense, and a weather record out of order.
    ///
    /// ```
    /// use helio_io::{Campaign, CampaignAsked, load_spots};
    /// use helio_spot::accuracy::{Limits, Options};
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("spots.csv");
    /// let rows = "a,2026-06-20T08:00:00Z,0.1,0,ok\nb,2026-06-20T08:00:01Z,-0.1,0,ok\n";
    /// std::fs::write(&path, format!("file,time,u_m,v_m,status\n{rows}"))?;
    /// let asked = CampaignAsked {
    ///     spots: &load_spots(&path)?,
    ///     weather: None,
    ///     limits: Limits::grlm(),
    ///     campaign: Campaign::default(),
    ///     aim_m: [0.0, 0.0],
    ///     slant_m: 100.0,
    ///     heliostat_at_deg: None,
    ///     options: Options::default(),
    ///     files: Vec::new(),
    /// };
    /// let judged = asked.judged()?;
    /// assert_eq!(judged.title(), "Tracking accuracy");
    /// assert_eq!(judged.json("1.0")["frames"]["ok"], 2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn judged(self) -> Result<JudgedCampaign, AccuracyError> {
        let setup = Setup {
            aim_m: self.aim_m,
            slant_m: self.slant_m,
            toward_heliostat: self.heliostat_at_deg.map(toward),
            uncertainty: self.campaign.uncertainty,
        };
        let spots: Vec<SpotRow> = self.spots.rows.iter().map(of_file).collect();
        let mut said = self.campaign.statements.clone();
        said.spot_method_of_table = method_of(self.spots).map(str::to_owned);
        let methods_differ = match (&said.spot_method, &said.spot_method_of_table) {
            (Some(stated), Some(shown)) if stated != shown => {
                Some([stated, shown].map(String::clone))
            }
            _ => None,
        };
        let (limits, options) = (self.limits, self.options);
        let evaluation = evaluate(&spots, self.weather, &setup, &limits, &options, &said)?;
        Ok(JudgedCampaign {
            evaluation,
            spots,
            setup,
            limits,
            options,
            campaign: self.campaign,
            files: self.files,
            methods_differ,
            heliostat_at_deg: self.heliostat_at_deg,
        })
    }
}

/// From the aim point to the heliostat: right, down, out of the target.
fn toward([right_deg, below_deg]: [f64; 2]) -> [f64; 3] {
    let (right, below) = (right_deg.to_radians(), below_deg.to_radians());
    [
        right.sin() * below.cos(),
        below.sin(),
        right.cos() * below.cos(),
    ]
}

/// The method that wrote a table, where its columns show it: the standard's window, or a threshold without one.
fn method_of(table: &SpotTable) -> Option<&'static str> {
    let found = || table.rows.iter().filter(|row| row.at_m.is_some());
    let all = |of: fn(&FileRow) -> bool| found().next().is_some() && found().all(of);
    if all(|row| row.window_px.is_some()) {
        Some("standard")
    } else if all(|row| row.window_px.is_none() && row.threshold.is_some()) {
        Some("robust")
    } else {
        None
    }
}

fn of_file(row: &FileRow) -> SpotRow {
    SpotRow {
        unix_ns: row.unix_ns,
        spot_m: row.at_m,
        sigma_m: row.sigma_m,
        status: row.status,
    }
}

impl JudgedCampaign {
    /// The heliostat, where it is named.
    #[must_use]
    pub fn heliostat(&self) -> &str {
        let mut instruments = self.campaign.instruments.iter();
        instruments
            .find(|instrument| instrument.role == "heliostat")
            .map_or("", |heliostat| heliostat.name.as_str())
    }

    /// What a report of it is called.
    #[must_use]
    pub fn title(&self) -> String {
        let of = match self.heliostat() {
            "" => String::new(),
            name => format!(" of heliostat {name}"),
        };
        format!("Tracking accuracy{of}")
    }

    /// What a reader should know of it, each with its name.
    #[must_use]
    pub fn facts(&self) -> Vec<(String, String)> {
        let campaign = &self.campaign;
        let mut facts = Vec::new();
        for (name, text) in [
            ("laboratory", &campaign.laboratory),
            ("operator", &campaign.operator),
            ("place", &campaign.place),
        ] {
            if !text.is_empty() {
                facts.push((name.to_owned(), text.clone()));
            }
        }
        if let Some([from, to]) = self.evaluation.counted_ns {
            facts.push((
                "time".to_owned(),
                format!("{} to {}", format_time(from), format_time(to)),
            ));
        }
        let counted = self
            .evaluation
            .counts
            .first()
            .map_or(0, |(_, count)| *count);
        facts.push((
            "frames".to_owned(),
            format!(
                "{} of {} counted",
                grouped(counted),
                grouped(self.spots.len())
            ),
        ));
        let [u_m, v_m] = self.setup.aim_m;
        facts.push((
            "aim point".to_owned(),
            format!(
                "{u_m} m right and {v_m} m down of the target's centre, {} m from the heliostat",
                self.setup.slant_m
            ),
        ));
        if let Some([right, below]) = self.heliostat_at_deg {
            facts.push((
                "heliostat".to_owned(),
                format!("{right}° right of the target's normal and {below}° below it, seen from the aim point"),
            ));
        }
        facts
    }

    /// Instruments: role, name, maker, serial number, calibration.
    #[must_use]
    pub fn instruments(&self) -> Vec<[String; 5]> {
        let instruments = self.campaign.instruments.iter();
        instruments
            .map(|i| {
                [
                    i.role.to_owned(),
                    i.name.clone(),
                    i.maker.clone(),
                    i.serial.clone(),
                    i.calibrated.clone(),
                ]
            })
            .collect()
    }

    /// Writes every frame with its error; `table` is what was judged.
    ///
    /// # Errors
    /// [`IoError`] if it cannot be written.
    pub fn write_frames(
        &self,
        destination: Destination,
        format: Format,
        table: &SpotTable,
    ) -> Result<u64, IoError> {
        let found = &self.evaluation;
        let rows = &table.rows;
        let files: Vec<String> = rows.iter().map(|row| row.file.clone()).collect();
        let times: Vec<Option<i64>> = rows.iter().map(|row| row.unix_ns).collect();
        let at = |k: usize| -> Vec<f64> {
            rows.iter()
                .map(|row| row.at_m.map_or(f64::NAN, |at| at[k]))
                .collect()
        };
        let of = |of: &dyn Fn(&EvaluatedFrame) -> Option<f64>| -> Vec<f64> {
            found
                .frames
                .iter()
                .map(|frame| of(frame).unwrap_or(f64::NAN))
                .collect()
        };
        let status: Vec<String> = found
            .frames
            .iter()
            .map(|frame| frame.status.as_str().to_owned())
            .collect();
        let columns = [
            ("file", Cells::Text(&files)),
            ("time", Cells::Times(&times)),
            ("u_m", Cells::Numbers(&at(0))),
            ("v_m", Cells::Numbers(&at(1))),
            ("eta_mrad", Cells::Numbers(&of(&|f| f.eta_mrad))),
            ("angle_mrad", Cells::Numbers(&of(&|f| f.angle_mrad))),
            ("wind_m_s", Cells::Numbers(&of(&|f| f.wind_m_s))),
            ("dni_w_m2", Cells::Numbers(&of(&|f| f.dni_w_m2))),
            (
                "air_temperature_c",
                Cells::Numbers(&of(&|f| f.air_temperature_c)),
            ),
            ("status", Cells::Text(&status)),
        ];
        write_columns(destination, format, &columns)
    }

    /// Everything as JSON, with the version of what made it.
    #[must_use]
    pub fn json(&self, version: &str) -> Value {
        let (found, limits) = (&self.evaluation, &self.limits);
        let (options, setup) = (&self.options, &self.setup);
        let shares: Vec<Value> = found
            .judged
            .iter()
            .map(|judged| {
                let mut bin = bin(&judged.bin, setup);
                bin.insert("wind_m_s".to_owned(), json!(judged.limit.wind_m_s));
                bin.insert("limit".to_owned(), json!(judged.limit.share));
                bin.insert("interval_is".to_owned(), json!(judged.outcome.as_str()));
                bin.insert("share_above_limit".to_owned(), json!(judged.printed));
                let wanted = json!(judged.frames_to_decide);
                bin.insert("independent_frames_to_decide".to_owned(), wanted);
                Value::Object(bin)
            })
            .collect();
        let histogram: Vec<Value> = found
            .histogram
            .iter()
            .map(|b| Value::Object(bin(b, setup)))
            .collect();
        let clauses: Vec<Value> = found
            .clauses
            .iter()
            .map(|clause| {
                json!({
                    "clause": clause.number,
                    "title": clause.title,
                    "outcome": clause.outcome.as_str(),
                    "found": clause.words,
                })
            })
            .collect();
        let instruments: Vec<Value> = self
            .campaign
            .instruments
            .iter()
            .map(|i| {
                json!({
                    "role": i.role, "name": i.name, "maker": i.maker, "serial": i.serial,
                    "calibrated": i.calibrated,
                })
            })
            .collect();
        let files: Vec<Value> = self
            .files
            .iter()
            .map(|(name, hash)| json!({ "file": name, "sha256": hash }))
            .collect();
        let counts: Map<String, Value> = found
            .counts
            .iter()
            .map(|(status, count)| (status.as_str().to_owned(), json!(count)))
            .collect();
        let warnings: Vec<String> = found.warnings.iter().map(ToString::to_string).collect();
        let accepted: Vec<&str> = options.accepted.iter().map(|s| s.as_str()).collect();
        let limit_shares: Vec<Value> = limits
            .shares
            .iter()
            .map(|limit| json!({ "wind_m_s": limit.wind_m_s, "share": limit.share }))
            .collect();
        let time = |k: usize| found.counted_ns.map(|times| format_time(times[k]));
        json!({
            "verdict": found.verdict.as_str(),
            "printed_rule": found.printed_verdict.map(|good| if good { "qualified" } else { "not qualified" }),
            "shares": shares,
            "figures": found.figures.as_ref().map(|f| figures(f, setup)),
            "histogram": histogram,
            "frames": counts,
            "counted_from": time(0),
            "counted_to": time(1),
            "median_step_s": found.step_s,
            "warnings": warnings,
            "clauses": clauses,
            "setup": {
                "slant_m": setup.slant_m,
                "aim_m": setup.aim_m,
                "toward_heliostat": setup.toward_heliostat,
                "sigma_slant_m": setup.uncertainty.slant_m,
                "sigma_pixel_scale": setup.uncertainty.scale,
                "sigma_survey_m": setup.uncertainty.survey_m,
                "sigma_centre_m": setup.uncertainty.centre_m,
            },
            "limits": {
                "name": limits.name,
                "angle_mrad": limits.angle_mrad,
                "shares": limit_shares,
                "least_dni_w_m2": limits.least_dni_w_m2,
                "air_temperature_c": limits.air_temperature_c,
                "wind_m_s": limits.wind_m_s,
                "camera_bits": limits.camera_bits,
                "camera_frames_per_s": limits.camera_frames_per_s,
                "camera_px": limits.camera_px,
            },
            "options": {
                "bin_half_width_m_s": options.bin_half_width_m_s,
                "histogram_step_m_s": options.histogram_step_m_s,
                "confidence": options.confidence,
                "weather_gap_s": options.weather_gap_s,
                "accepted": accepted,
            },
            "campaign": {
                "heliostat": self.heliostat(),
                "laboratory": self.campaign.laboratory,
                "operator": self.campaign.operator,
                "place": self.campaign.place,
                "instruments": instruments,
                "notes": self.campaign.notes,
            },
            "files": files,
            "version": version,
        })
    }
}

/// A number with commas.
fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

fn bin(bin: &WindBin, setup: &Setup) -> Map<String, Value> {
    let value = json!({
        "from_m_s": bin.from_m_s,
        "to_m_s": bin.to_m_s,
        "frames": bin.frames,
        "without_spot": bin.lost,
        "within": bin.within,
        "share": bin.share,
        "share_as_defined": bin.defined_share,
        "mean_wind_m_s": bin.mean_wind_m_s,
        "independent_frames": bin.independent_frames,
        "sampling_interval": bin.sampling,
        "instruments_lower_raise": bin.instruments,
        "interval": bin.interval,
        "figures": bin.figures.as_ref().map(|f| figures(f, setup)),
    });
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// Figures with one standard deviation from each cause; null is what was not stated, or what nobody knows.
fn figures(figures: &Figures, setup: &Setup) -> Value {
    let unsure = setup.uncertainty;
    let one = |figure: &Figure| {
        json!({
            "mrad": figure.mrad,
            "sigma_mrad": figure.uncertainty_mrad(),
            "sigma_sampling_mrad": figure.sampling_mrad,
            "sigma_slant_mrad": unsure.slant_m.map(|_| figure.slant_mrad),
            "sigma_pixel_scale_mrad": unsure.scale.map(|_| figure.scale_mrad),
            "sigma_survey_mrad": unsure.survey_m.map(|_| figure.survey_mrad),
            "sigma_centre_mrad": (figures.centre_noise_mrad > 0.0).then_some(figure.camera_mrad),
        })
    };
    json!({
        "accuracy": one(&figures.accuracy),
        "precision": one(&figures.precision),
        "bias": one(&figures.bias),
        "accuracy_precision_bias_as_defined_mrad": figures.defined_mrad,
        "mean_spot_m": figures.mean_m,
        "centre_noise_mrad": figures.centre_noise_mrad,
        "independent_frames": figures.independent_frames,
    })
}
