//! `accuracy`: the tracking-accuracy report of T/GRLM 02-2014; `simulate campaign`: what it reads.

use std::path::{Path, PathBuf};

use helio_io::output::{Cells, Destination, write_columns};
use helio_io::{
    AtomicFile, Campaign, SpotRow as FileRow, SpotTable, format_time, hash_file, load_campaign,
    load_limits, load_spots, load_weather, write_file, write_spots,
};
use helio_report::accuracy::{AccuracyPage, accuracy_page};
use helio_spot::SpotStatus;
use helio_spot::accuracy::{
    AccuracyError, BinOutcome, Evaluation, Figure, Figures, FrameStatus, Limits, Options, Setup,
    SpotRow, Warning, WindBin, evaluate, simulate,
};
use serde_json::{Map, Value, json};

use super::calibrate::{report_file, write_page};
use crate::Outcome;
use crate::args::{AcceptWord, AccuracyArgs, SimulateCampaignArgs};
use crate::calibration_page::made_at;
use crate::failure::Failure;
use crate::plan;
use crate::printer::{Counted, Grouped, Printer};

pub(crate) fn run(args: &AccuracyArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let inputs: Vec<PathBuf> = [
        Some(&args.spots),
        args.weather.as_ref(),
        args.limits.as_ref(),
        args.campaign.as_ref(),
    ]
    .into_iter()
    .flatten()
    .cloned()
    .collect();
    check_outputs(args, &inputs)?;
    let frames_format = plan::format(args.frames.as_deref(), None)?;
    let report = match &args.report {
        Some(path) => Some(report_file(path)?),
        None => None,
    };
    let table = load_spots(&args.spots)?;
    if table.rows.iter().all(|row| row.unix_ns.is_none()) {
        return Err(Failure::refused(format!(
            "{}: no row has a time; wanted a column `time`, such as spot --start writes",
            args.spots.display()
        )));
    }
    let weather = args.weather.as_deref().map(load_weather).transpose()?;
    let limits = match &args.limits {
        Some(path) => load_limits(path)?,
        None => Limits::grlm(),
    };
    let campaign = match &args.campaign {
        Some(path) => load_campaign(path)?,
        None => Campaign::default(),
    };
    let files = inputs
        .iter()
        .map(|path| Ok((path.display().to_string(), hash_file(path)?)))
        .collect::<Result<Vec<_>, Failure>>()?;
    let setup = Setup {
        aim_m: args.aim.0,
        slant_m: args.slant_m,
        toward_heliostat: args.heliostat_at_deg.map(|two| toward(two.0)),
        uncertainty: campaign.uncertainty,
    };
    let options = options(args);
    let spots: Vec<SpotRow> = table.rows.iter().map(of_file).collect();
    let mut said = campaign.statements.clone();
    said.spot_method_of_table = method_of(&table).map(str::to_owned);
    if let (Some(stated), Some(shown)) = (&said.spot_method, &said.spot_method_of_table)
        && stated != shown
    {
        printer.warn(format_args!(
            "{} is of the method {shown}, though {} states {stated}",
            args.spots.display(),
            args.campaign.as_deref().unwrap_or(Path::new("")).display()
        ));
    }
    let found =
        evaluate(&spots, weather.as_ref(), &setup, &limits, &options, &said).map_err(|error| {
            let file = match error {
                AccuracyError::NoSpots => Some(&args.spots),
                AccuracyError::Uncertainty { .. } => args.campaign.as_ref(),
                AccuracyError::Length { .. } | AccuracyError::WeatherOrder { .. } => {
                    args.weather.as_ref()
                }
                _ => None,
            };
            let place = file.map_or_else(String::new, |file| format!("{}: ", file.display()));
            Failure::refused(format!("{place}{error}"))
        })?;
    let about = About {
        args,
        found: &found,
        limits: &limits,
        options: &options,
        setup: &setup,
        campaign: &campaign,
        files: &files,
        table: &table,
    };
    if let Some(file) = report {
        write_page(file, &accuracy_page(&about.page(&spots)))?;
    }
    if let Some(path) = &args.frames {
        let destination = plan::destination(Some(path), frames_format, &inputs, printer)?;
        write_frames(destination, frames_format, &table, &found)?;
    }
    let mut text = serde_json::to_string_pretty(&about.json())
        .map_err(|error| Failure::refused(format!("accuracy: {error}")))?;
    text.push('\n');
    match args.out.as_deref().filter(|path| !plan::is_stdout(path)) {
        Some(path) => write_file(path, text.as_bytes())?,
        None => printer.data(&text)?,
    }
    about.say(printer);
    let left_out = found.frames.iter().any(|f| f.status != FrameStatus::Ok);
    Ok(if left_out {
        Outcome::SomeRowsFailed
    } else {
        Outcome::Good
    })
}

/// Whatever cannot be written is better known before a long run than after it.
fn check_outputs(args: &AccuracyArgs, inputs: &[PathBuf]) -> Result<(), Failure> {
    let outputs = [
        ("--out", args.out.as_deref()),
        ("--report", args.report.as_deref()),
        ("--frames", args.frames.as_deref()),
    ];
    let files = outputs
        .into_iter()
        .filter_map(|(_, path)| path.filter(|path| !plan::is_stdout(path)));
    for path in files {
        plan::not_an_input(path, inputs)?;
        AtomicFile::check(path)?;
    }
    for (k, one) in outputs.iter().enumerate() {
        for other in &outputs[..k] {
            plan::not_the_same(*other, *one)?;
        }
    }
    if args.frames.as_deref().is_some_and(plan::is_stdout) {
        return Err(Failure::refused(
            "--frames: standard output is for what --out would take; give it a file",
        ));
    }
    if let Some(path) = args.out.as_deref().filter(|path| !plan::is_stdout(path))
        && path.extension().is_none_or(|suffix| suffix != "json")
    {
        return Err(Failure::refused(format!(
            "{}: --out writes JSON; wanted a name that ends in .json",
            path.display()
        )));
    }
    Ok(())
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

fn options(args: &AccuracyArgs) -> Options {
    let mut accepted = vec![SpotStatus::Ok];
    for word in &args.accept {
        let status = match word {
            AcceptWord::Cut => SpotStatus::Cut,
            AcceptWord::Saturated => SpotStatus::Saturated,
            AcceptWord::Ambiguous => SpotStatus::Ambiguous,
        };
        if !accepted.contains(&status) {
            accepted.push(status);
        }
    }
    Options {
        bin_half_width_m_s: args.bin_half_width_m_s,
        histogram_step_m_s: args.histogram_step_m_s,
        confidence: args.confidence,
        weather_gap_s: args.weather_gap_s,
        accepted,
    }
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

/// Every frame with its error.
fn write_frames(
    destination: Destination,
    format: helio_io::output::Format,
    table: &SpotTable,
    found: &Evaluation,
) -> Result<(), Failure> {
    let rows = &table.rows;
    let files: Vec<String> = rows.iter().map(|row| row.file.clone()).collect();
    let times: Vec<Option<i64>> = rows.iter().map(|row| row.unix_ns).collect();
    let at = |k: usize| -> Vec<f64> {
        rows.iter()
            .map(|row| row.at_m.map_or(f64::NAN, |at| at[k]))
            .collect()
    };
    let of = |of: &dyn Fn(&helio_spot::accuracy::EvaluatedFrame) -> Option<f64>| -> Vec<f64> {
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
    write_columns(destination, format, &columns)?;
    Ok(())
}

/// Everything that is reported.
struct About<'a> {
    args: &'a AccuracyArgs,
    found: &'a Evaluation,
    limits: &'a Limits,
    options: &'a Options,
    setup: &'a Setup,
    campaign: &'a Campaign,
    files: &'a [(String, String)],
    table: &'a SpotTable,
}

impl About<'_> {
    fn heliostat(&self) -> &str {
        let mut instruments = self.campaign.instruments.iter();
        instruments
            .find(|instrument| instrument.role == "heliostat")
            .map_or("", |heliostat| heliostat.name.as_str())
    }

    fn page<'b>(&'b self, spots: &'b [SpotRow]) -> AccuracyPage<'b> {
        let campaign = self.campaign;
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
        if let Some([from, to]) = self.found.counted_ns {
            facts.push((
                "time".to_owned(),
                format!("{} to {}", format_time(from), format_time(to)),
            ));
        }
        let counted = self.found.counts.first().map_or(0, |(_, count)| *count);
        facts.push((
            "frames".to_owned(),
            format!(
                "{} of {} counted",
                Grouped(counted as u64),
                Grouped(spots.len() as u64)
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
        if let Some(two) = self.args.heliostat_at_deg {
            let [right, below] = two.0;
            facts.push((
                "heliostat".to_owned(),
                format!("{right}° right of the target's normal and {below}° below it, seen from the aim point"),
            ));
        }
        let of = match self.heliostat() {
            "" => String::new(),
            name => format!(" of heliostat {name}"),
        };
        AccuracyPage {
            title: format!("Tracking accuracy{of}"),
            version: format!("helio-rs {}", env!("CARGO_PKG_VERSION")),
            generated_utc: made_at(),
            facts,
            evaluation: self.found,
            spots,
            setup: self.setup,
            limits: self.limits,
            options: self.options,
            instruments: campaign
                .instruments
                .iter()
                .map(|i| {
                    [
                        i.role.to_owned(),
                        i.name.clone(),
                        i.maker.clone(),
                        i.serial.clone(),
                        i.calibrated.clone(),
                    ]
                })
                .collect(),
            files: self.files.to_vec(),
            notes: campaign.notes.clone(),
        }
    }

    fn json(&self) -> Value {
        let (found, limits, options, setup) = (self.found, self.limits, self.options, self.setup);
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
            "version": env!("CARGO_PKG_VERSION"),
        })
    }

    /// A time and where its rows stand.
    fn rows_of(&self, unix_ns: i64) -> String {
        let rows = self.table.rows.iter().enumerate();
        let of_time = rows.filter(|(_, row)| row.unix_ns == Some(unix_ns));
        let places: Vec<String> = of_time.map(|(row, _)| self.table.position(row)).collect();
        let more = places.len().saturating_sub(3);
        format!(
            "{} ({}, {}{})",
            format_time(unix_ns),
            self.args.spots.display(),
            places[..places.len() - more].join(", "),
            if more > 0 {
                format!(" and {more} more")
            } else {
                String::new()
            }
        )
    }

    fn say(&self, printer: &Printer) {
        let found = self.found;
        let counted = found.counts.first().map_or(0, |(_, count)| *count);
        printer.say(format_args!(
            "{} counted, of {}",
            Counted(counted, "frame"),
            Grouped(found.frames.len() as u64)
        ));
        for (status, count) in found.counts.iter().skip(1) {
            printer.say(format_args!(
                "  {} left out: {} ({})",
                Grouped(*count as u64),
                status.as_str(),
                status.reason()
            ));
        }
        if let Some(figures) = &found.figures {
            let of = |f: &Figure| match f.uncertainty_mrad() {
                unsure if unsure.is_finite() => format!("{:.3} ± {unsure:.3} mrad", f.mrad),
                _ => format!("{:.3} mrad (nobody knows how certain)", f.mrad),
            };
            printer.say(format_args!(
                "accuracy {}, precision {}, bias {}",
                of(&figures.accuracy),
                of(&figures.precision),
                of(&figures.bias)
            ));
        }
        for judged in &found.judged {
            let bin = &judged.bin;
            let Some(share) = bin.share else {
                printer.say(format_args!(
                    "{} m/s: no frame counted",
                    judged.limit.wind_m_s
                ));
                continue;
            };
            let word = match judged.outcome {
                BinOutcome::Above => "above the limit of",
                BinOutcome::Below => "below the limit of",
                BinOutcome::Open => "around the limit of",
            };
            printer.say(format_args!(
                "{} m/s: {:.2} % of {} within {} mrad, interval {:.2} to {:.2} %, {word} {} %",
                judged.limit.wind_m_s,
                100.0 * share,
                Counted(bin.frames, "frame"),
                self.limits.angle_mrad,
                100.0 * bin.interval[0],
                100.0 * bin.interval[1],
                100.0 * judged.limit.share
            ));
        }
        for warning in &found.warnings {
            match warning {
                Warning::Contradicted { first_unix_ns, .. } => {
                    printer.warn(format_args!(
                        "{warning}; first {}",
                        self.rows_of(*first_unix_ns)
                    ));
                }
                _ => printer.warn(warning),
            }
        }
        printer.say(format_args!("{} by {}", found.verdict, self.limits.name));
    }
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

/// `simulate campaign`.
pub(crate) fn simulate_campaign(
    args: &SimulateCampaignArgs,
    printer: &Printer,
) -> Result<Outcome, Failure> {
    let spots_format = plan::format(Some(&args.spots), None)?;
    let weather_format = plan::format(Some(&args.weather), None)?;
    plan::not_the_same(
        ("--spots", Some(&args.spots)),
        ("--weather", Some(&args.weather)),
    )?;
    for path in [&args.spots, &args.weather] {
        if plan::is_stdout(path) {
            return Err(Failure::refused(
                "simulate campaign writes two tables; give each a file",
            ));
        }
        AtomicFile::check(path)?;
    }
    let campaign = simulate::Campaign {
        seed: args.seed,
        duration_s: 60.0 * f64::from(args.minutes),
        frames_per_s: f64::from(args.frames_per_s),
        slant_m: args.slant_m,
        calm_mrad: args.calm_mrad,
        gust_mrad: args.gust_mrad,
        memory_s: args.memory_s,
        empty: args.empty,
        ..simulate::Campaign::default()
    };
    let (spots, weather) = campaign.simulate();
    let rows: Vec<FileRow> = spots
        .iter()
        .enumerate()
        .map(|(frame, spot)| FileRow {
            at_m: spot.spot_m,
            sigma_m: spot.sigma_m,
            ..FileRow::without_position(format!("frame {frame}"), spot.unix_ns, spot.status)
        })
        .collect();
    let to = |path: &Path| Destination::File(path.to_owned());
    write_spots(to(&args.spots), spots_format, &rows)?;
    let times: Vec<Option<i64>> = weather.unix_ns.iter().copied().map(Some).collect();
    let columns = [
        ("time", Cells::Times(&times)),
        (
            "wind_m_s",
            Cells::Numbers(weather.wind_m_s.first().map_or(&[], Vec::as_slice)),
        ),
        (
            "dni_w_m2",
            Cells::Numbers(weather.dni_w_m2.as_deref().unwrap_or_default()),
        ),
        (
            "air_temperature_c",
            Cells::Numbers(weather.air_temperature_c.as_deref().unwrap_or_default()),
        ),
    ];
    write_columns(to(&args.weather), weather_format, &columns)?;
    printer.say(format_args!(
        "{} and {}",
        Counted(rows.len(), "frame"),
        Counted(times.len(), "weather row")
    ));
    Ok(Outcome::Good)
}
