//! `accuracy`: the tracking-accuracy report of T/GRLM 02-2014; `simulate campaign`: what it reads.

use std::path::{Path, PathBuf};

use helio_io::output::Destination;
use helio_io::{
    AtomicFile, Campaign, CampaignAsked, JudgedCampaign, SimulatedCampaign, SpotTable, format_time,
    hash_file, load_campaign, load_limits, load_spots, load_weather, write_file,
};
use helio_report::accuracy::{AccuracyPage, accuracy_page};
use helio_spot::SpotStatus;
use helio_spot::accuracy::{
    AccuracyError, BinOutcome, Figure, FrameStatus, Limits, Options, Warning, simulate,
};

use super::calibrate::{report_file, write_page};
use crate::Outcome;
use crate::args::{AcceptWord, AccuracyArgs, SimulateCampaignArgs};
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
    let asked = CampaignAsked {
        spots: &table,
        weather: weather.as_ref(),
        limits,
        campaign,
        aim_m: args.aim.0,
        slant_m: args.slant_m,
        heliostat_at_deg: args.heliostat_at_deg.map(|two| two.0),
        options: options(args),
        files,
    };
    let judged = asked.judged().map_err(|error| {
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
    if let Some([stated, shown]) = &judged.methods_differ {
        printer.warn(format_args!(
            "{} is of the method {shown}, though {} states {stated}",
            args.spots.display(),
            args.campaign.as_deref().unwrap_or(Path::new("")).display()
        ));
    }
    let about = About {
        args,
        judged: &judged,
        table: &table,
    };
    if let Some(file) = report {
        let version = env!("CARGO_PKG_VERSION");
        let page = AccuracyPage::of_campaign(&judged, version, plan::made_at());
        write_page(file, &accuracy_page(&page))?;
    }
    if let Some(path) = &args.frames {
        let destination = plan::destination(Some(path), frames_format, &inputs, printer)?;
        judged.write_frames(destination, frames_format, &table)?;
    }
    let mut text = serde_json::to_string_pretty(&judged.json(env!("CARGO_PKG_VERSION")))
        .map_err(|error| Failure::refused(format!("accuracy: {error}")))?;
    text.push('\n');
    match args.out.as_deref().filter(|path| !plan::is_stdout(path)) {
        Some(path) => write_file(path, text.as_bytes())?,
        None => printer.data(&text)?,
    }
    about.say(printer);
    let left_out = judged
        .evaluation
        .frames
        .iter()
        .any(|f| f.status != FrameStatus::Ok);
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

/// Everything that is reported.
struct About<'a> {
    args: &'a AccuracyArgs,
    judged: &'a JudgedCampaign,
    table: &'a SpotTable,
}

impl About<'_> {
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
        let found = &self.judged.evaluation;
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
                self.judged.limits.angle_mrad,
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
        printer.say(format_args!(
            "{} by {}",
            found.verdict, self.judged.limits.name
        ));
    }
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
    let seen = SimulatedCampaign::of(&campaign);
    let to = |path: &Path| Destination::File(path.to_owned());
    seen.write_spots(to(&args.spots), spots_format)?;
    seen.write_weather(to(&args.weather), weather_format)?;
    printer.say(format_args!(
        "{} and {}",
        Counted(seen.spots.len(), "frame"),
        Counted(seen.weather.unix_ns.len(), "weather row")
    ));
    Ok(Outcome::Good)
}
