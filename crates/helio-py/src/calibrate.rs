//! `calibrate`: the typed call and its answer are in `helio_py._calibrate`.

use std::path::PathBuf;

use helio_calib::schedule::Sets;
use helio_io::calibrate::{
    AHEAD_NS, Asked, CHANGES_TOLD, Choice, Done, FitWords, PRIOR_WITHOUT_SIGMAS, Residual, Run,
    RunError, without_sigmas, write_rejected,
};
use helio_io::output::{Destination, Format, KeptCells, KeptColumns};
use helio_io::{
    CalibratedSet, IoError, LoadedField, Observations, Provenance, Sha256,
    load_observations_with_spots, load_spots, write_calibration,
};
use helio_report::AboutRun;
use helio_report::calibration::{CalibrationPage, calibration_page};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::prelude::*;

use crate::array::owned;
use crate::beside::{Compared, Inputs, PageFile, Plan, check_plan, made_at, now_ns, proposals};
use crate::failure::Failure;
use crate::field::PyField;
use crate::guard::guarded;
use crate::table::{Given, handed_out};
use crate::watch::watched_or_left;

/// Options as the keywords of `calibrate` have them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct FitAsked {
    solver: String,
    residual: String,
    robust: String,
    sets: String,
    fit_mirror_offset: bool,
    hold: Vec<String>,
    prior: Vec<String>,
    keep_all: bool,
    no_jumps: bool,
    max_year_pointing_mrad: f64,
    plan: Option<Plan>,
    report: Option<PathBuf>,
}

impl From<FitAsked> for FitWords {
    fn from(asked: FitAsked) -> Self {
        Self {
            solver: asked.solver,
            residual: asked.residual,
            robust: asked.robust,
            sets: asked.sets,
            fit_mirror_offset: asked.fit_mirror_offset,
            hold: asked.hold,
            prior: asked.prior,
            keep_all: asked.keep_all,
            no_jumps: asked.no_jumps,
            max_year_pointing_mrad: asked.max_year_pointing_mrad,
        }
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Io(error) => error.into(),
            RunError::Calibration(error) => Self::new("CalibrationError", error.to_string()),
            RunError::Sun(error) => error.into(),
            RunError::Field(error) => error.into(),
            refused => of_option(&refused.to_string()),
        }
    }
}

/// A refusal that names options as the command line does, in the names of keywords.
pub(crate) fn of_option(message: &str) -> Failure {
    let words = in_keywords(message);
    match words.split_once(' ').filter(|_| message.starts_with("--")) {
        Some((first, rest)) => Failure::of("OptionError", first.trim_end_matches(':'), rest),
        None => Failure::new("OptionError", words),
    }
}

/// A sentence that names options as the command line does, in the names of keywords.
pub(crate) fn in_keywords(words: &str) -> String {
    let each = words.split(' ').map(|word| match word.strip_prefix("--") {
        Some(option) => option.replace('-', "_"),
        None => word.to_owned(),
    });
    each.collect::<Vec<_>>().join(" ")
}

pub(crate) fn hash_text(text: &str) -> String {
    let mut hash = Sha256::default();
    hash.update(text.as_bytes());
    hash.finish()
}

/// A table by the names of its columns.
type Columns = Vec<(String, KeptCells)>;

/// What was found.
struct Found {
    sets: Vec<CalibratedSet>,
    tables: Vec<(&'static str, Columns)>,
    findings: Vec<(String, String)>,
    warnings: Vec<String>,
    changes: Vec<String>,
    page: Option<String>,
}

/// What is wanted of a run.
struct Wanted {
    words: FitWords,
    plan: Option<Plan>,
    page: bool,
}

/// Calibrates a field; tables as lists of columns, numbers as arrays.
#[pyfunction]
pub(crate) fn _calibrate<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    observations: &Bound<'py, PyAny>,
    spots: Option<&Bound<'py, PyAny>>,
    compare: Option<&Bound<'py, PyAny>>,
    mut words: FitAsked,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let field = PyField::of(field)?.clone().unbind();
        let loaded = field.get().inner().with_targets()?;
        let inputs = Inputs::of(observations, spots, compare)?;
        let (plan, report) = (words.plan.take(), words.report.take());
        check_plan(plan.as_ref())?;
        let words = FitWords::from(words);
        if Asked::new(&words)?.sets() != Sets::One && loaded.site.is_none() {
            return Err(of_option(
                "--sets: sets over the day go by the sun's hour angle, which needs the latitude from [site]",
            ));
        }
        let file = PageFile::wanted(report.as_deref(), &inputs, loaded)?;
        let wanted = Wanted {
            words,
            plan,
            page: file.is_some(),
        };
        let field_hash = field.get().inner().hash();
        // One heliostat of many thousand records takes longer than anybody waits who wants an end.
        let found = watched_or_left(py, progress.as_ref(), move |watch| {
            let loaded = field.get().inner().loaded();
            found(wanted, loaded, &inputs, field_hash, watch)
        })??;
        if let (Some(file), Some(page)) = (file, &found.page) {
            // Here, so that what was stopped and left to itself writes nothing.
            py.detach(|| file.write(page))?;
        }
        answer(py, found)
    })
}

/// The observations that can be used, which are some, and a hash of them.
pub(crate) fn observed(
    observations: &Given,
    spots: Option<&Given>,
    loaded: &LoadedField,
) -> Result<(Observations, String), Failure> {
    let source = observations.source();
    let named = |error: IoError| Failure::from(error).or_of("observations");
    let mut hash = source.hash().map_err(named)?;
    let table = match spots {
        Some(spots) => {
            let of_spots = spots.source().hash()?;
            hash = hash_text(&format!("{hash} {of_spots}"));
            let table = load_spots(spots.source());
            Some(table.map_err(|error| Failure::from(error).or_of("spots"))?)
        }
        None => None,
    };
    let observations = load_observations_with_spots(source, table.as_ref(), loaded);
    let mut observations = observations.map_err(named)?;
    observations.leave_aside_after(now_ns().saturating_add(AHEAD_NS))?;
    if observations.is_empty() {
        let records = observations.records;
        let message = format!("none of its {records} records can be used");
        return Err(Failure::of("MissingError", "observations", message));
    }
    Ok((observations, hash))
}

type Watch<'a> = &'a (dyn Fn(u64, u64) -> bool + Sync);

fn found(
    wanted: Wanted,
    loaded: &LoadedField,
    inputs: &Inputs,
    field_hash: String,
    watch: Watch<'_>,
) -> Result<Found, Failure> {
    let words = &wanted.words;
    let asked = Asked::new(words)?;
    let proposals = proposals(wanted.plan.as_ref(), loaded)?;
    let old = inputs.earlier(loaded)?;
    let (observations, observations_hash) =
        observed(&inputs.observations, inputs.spots.as_ref(), loaded)?;
    let run = Run {
        loaded,
        observations: &observations,
        asked: &asked,
    };
    let provenance = Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        solver: words.solver.clone(),
        residual: words.residual.clone(),
        robust: words.robust.clone(),
        field_hash,
        observations_hash,
        options_hash: words.hash(),
    };
    let done = all(&run, watch)?;
    let sets: Vec<CalibratedSet> = done.iter().flat_map(|done| run.sets(done)).collect();
    let mut tables = Vec::new();
    let kept = KeptColumns::default();
    let destination = || Destination::Columns(kept.clone());
    let csv = Format::Csv; // of columns in memory there is no format
    write_calibration(destination(), csv, &sets, &provenance)?;
    tables.push(("calibration", kept.take()));
    let left = run.rejected(&done);
    write_rejected(destination(), csv, left, loaded, &observations)?;
    tables.push(("rejected", kept.take()));
    let mut residuals: Vec<Residual> = done.iter().flat_map(|done| run.residuals(done)).collect();
    residuals.sort_by_key(|residual| residual.record);
    tables.push(("residuals", residual_columns(&residuals, &run)));
    if asked.sets() != Sets::One {
        tables.push(("choices", choice_columns(&done, &run)));
    }
    let go_on = || watch(0, observations.heliostats.len() as u64);
    let compared = match &old {
        Some(old) => Some(Compared::of(old, &sets, loaded, &observations, &go_on)?),
        None => None,
    };
    if let Some(proposals) = &proposals {
        let rows = run.propose(proposals, &done, &go_on)?;
        proposals.write(&rows, loaded, destination(), csv)?;
        tables.push(("plan", kept.take()));
    }
    let changes = |most| {
        compared
            .as_ref()
            .map_or(Vec::new(), |compared| compared.changes.sentences(most))
    };
    let page = match wanted.page {
        true => {
            let about = AboutRun {
                provenance: &provenance,
                generated_utc: made_at(),
                changes: changes(CHANGES_TOLD),
            };
            Some(calibration_page(&CalibrationPage::of_run(
                &run, &done, about,
            )?))
        }
        false => None,
    };
    let changes = changes(usize::MAX);
    tables.extend(compared.map(|compared| ("changes", compared.table.take())));
    let findings = done.iter().flat_map(|done| {
        let id = run.id(done.index);
        let findings = done.findings.iter();
        findings.map(move |finding| (id.to_owned(), finding.clone()))
    });
    let mut warnings = observations.warnings.clone();
    if !words.prior.is_empty() && observations.heliostats.iter().any(without_sigmas) {
        warnings.push(in_keywords(PRIOR_WITHOUT_SIGMAS));
    }
    Ok(Found {
        findings: findings.collect(),
        warnings,
        sets,
        tables,
        changes,
        page,
    })
}

/// What every heliostat with observations came to, in the order of the field.
fn all(run: &Run<'_>, watch: Watch<'_>) -> Result<Vec<Done>, Failure> {
    let total = run.observations.heliostats.len();
    let one = |index: usize| -> Result<Option<Done>, Failure> {
        if !watch(0, total as u64) {
            return Ok(None); // the user's signal is what is raised
        }
        let done = run.one(index)?;
        watch(1, total as u64);
        Ok(Some(done))
    };
    let all: Vec<Result<Option<Done>, Failure>> = (0..total)
        .into_par_iter()
        .with_max_len(1)
        .map(one)
        .collect();
    // In the order of the field, whoever was first; and of several failures the first.
    let all = all.into_iter().collect::<Result<Vec<_>, _>>()?;
    Ok(all.into_iter().flatten().collect())
}

/// How well numbers of sets over the day do, of each heliostat of which several were tried.
fn choice_columns(done: &[Done], run: &Run<'_>) -> Columns {
    let all: Vec<(&str, &Choice)> = done
        .iter()
        .flat_map(|done| {
            done.choices
                .iter()
                .map(|choice| (run.id(done.index), choice))
        })
        .collect();
    let whole = |of: &dyn Fn(&Choice) -> usize| {
        KeptCells::Whole(
            all.iter()
                .map(|(_, choice)| i64::try_from(of(choice)).ok())
                .collect(),
        )
    };
    let numbers = |of: &dyn Fn(&Choice) -> f64| {
        KeptCells::Numbers(all.iter().map(|(_, choice)| of(choice)).collect())
    };
    let ids = all.iter().map(|(id, _)| (*id).to_owned()).collect();
    [
        ("id", KeptCells::Text(ids)),
        ("sets", whole(&|choice| choice.sets)),
        ("beam_rms_mrad", numbers(&|choice| choice.beam_rms_mrad.0)),
        (
            "unseen_rms_mrad",
            numbers(&|choice| choice.unseen_rms_mrad.map_or(f64::NAN, |unseen| unseen.0)),
        ),
        ("taken", whole(&|choice| usize::from(choice.chosen))),
    ]
    .map(|(name, cells)| (name.to_owned(), cells))
    .into()
}

fn residual_columns(residuals: &[Residual], run: &Run<'_>) -> Columns {
    let numbers =
        |of: &dyn Fn(&Residual) -> f64| KeptCells::Numbers(residuals.iter().map(of).collect());
    let texts =
        |of: &dyn Fn(&Residual) -> String| KeptCells::Text(residuals.iter().map(of).collect());
    let whole = residuals.iter().map(|r| i64::try_from(r.record).ok());
    [
        ("id", texts(&|r| run.loaded.field.ids()[r.row].clone())),
        ("record", KeptCells::Whole(whole.collect())),
        (
            "time",
            KeptCells::Times(residuals.iter().map(|r| r.unix_ns).collect()),
        ),
        (
            "target",
            texts(&|r| run.observations.targets[r.target].0.clone()),
        ),
        ("u_m", numbers(&|r| r.seen_m[0])),
        ("v_m", numbers(&|r| r.seen_m[1])),
        ("predicted_u_m", numbers(&|r| r.predicted_m[0])),
        ("predicted_v_m", numbers(&|r| r.predicted_m[1])),
        ("beam_mrad", numbers(&|r| r.beam_mrad)),
        ("before_u_m", numbers(&|r| r.before_m[0])),
        ("before_v_m", numbers(&|r| r.before_m[1])),
        ("before_mrad", numbers(&|r| r.before_mrad)),
    ]
    .map(|(name, cells)| (name.to_owned(), cells))
    .into()
}

fn answer(py: Python<'_>, found: Found) -> Result<Bound<'_, PyDict>, Failure> {
    let dict = columns_of_sets(py, &found.sets)?;
    for (name, columns) in found.tables {
        dict.set_item(name, handed_out(py, columns)?)?;
    }
    dict.set_item("changes_said", found.changes)?;
    dict.set_item("findings", PyList::new(py, found.findings)?)?;
    dict.set_item("warnings", found.warnings)?;
    Ok(dict)
}

/// The parameters of sets as arrays.
pub(crate) fn columns_of_sets<'py>(
    py: Python<'py>,
    sets: &[CalibratedSet],
) -> Result<Bound<'py, PyDict>, Failure> {
    let rows = sets.len();
    let errors: Vec<f64> = sets
        .iter()
        .flat_map(|set| match &set.errors {
            None => [f64::NAN; 6],
            Some(e) => [
                e.pedestal_tilt_rad,
                e.pedestal_tilt_azimuth_rad,
                e.axis_nonorthogonality_rad,
                e.mirror_tilt_rad,
                e.azimuth_reference_rad,
                e.elevation_reference_rad,
            ],
        })
        .collect();
    let offsets = sets.iter();
    let offsets: Vec<f64> = offsets
        .map(|set| set.mirror_offset_m.unwrap_or(f64::NAN))
        .collect();
    let sigmas: Vec<f64> = sets.iter().flat_map(|set| set.sigmas).collect();
    let covariance: Vec<f64> = sets
        .iter()
        .flat_map(|set| set.covariance.unwrap_or([[f64::NAN; 7]; 7]))
        .flatten()
        .collect();
    let dict = PyDict::new(py);
    dict.set_item("errors", owned(py, errors, &[rows, 6])?)?;
    dict.set_item("mirror_offset_m", owned(py, offsets, &[rows])?)?;
    dict.set_item("sigmas", owned(py, sigmas, &[rows, 7])?)?;
    dict.set_item("covariance", owned(py, covariance, &[rows, 7, 7])?)?;
    Ok(dict)
}
