//! `calibrate` of the field as one: the typed call and its answer are in `helio_py._joint`.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use helio_calib::Parameter;
use helio_io::calibrate::joint::{
    Following, JointAsked, JointFound, JointRun, NOT_AS_ONE, Remark, alarm_words, days_of,
    jump_words, needs_site,
};
use helio_io::calibrate::{CHANGES_TOLD, Proposals, write_rejected};
use helio_io::output::{Destination, Format, KeptColumns};
use helio_io::{
    AtomicFile, CalibratedSet, LoadedField, Provenance, read_state, state_bytes, state_of_bytes,
    write_calibration, write_file, write_leftovers,
};
use helio_report::AboutRun;
use helio_report::joint::{JointPage, joint_page};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};

use crate::beside::{Compared, Inputs, PageFile, Plan, check_plan, made_at, place, proposals};
use crate::calibrate::{columns_of_sets, in_keywords, observed, of_option};
use crate::failure::Failure;
use crate::field::PyField;
use crate::guard::guarded;
use crate::table::handed_out;
use crate::watch::watched;

/// Options as the keywords of `calibrate` have them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct JointWords {
    /// Those that were given and not left as they are.
    given: Vec<String>,
    keep_all: bool,
    no_jumps: bool,
    ahead_days: f64,
    max_year_pointing_mrad: Option<f64>,
    leftovers: bool,
    plan: Option<Plan>,
    /// The name of a state, and what it holds where it is no file.
    update: Option<(PathBuf, Option<Vec<u8>>)>,
    state: Option<PathBuf>,
    report: Option<PathBuf>,
}

impl JointWords {
    fn check(&self, field: &LoadedField, inputs: &Inputs) -> Result<(), Failure> {
        let way = match self.update {
            Some(_) => "--update",
            None => "--joint",
        };
        let known = NOT_AS_ONE.into_iter();
        let known = known.chain(
            helio_io::calibrate::joint::NOT_ANEW
                .into_iter()
                .filter(|_| self.update.is_some()),
        );
        for (option, why) in known {
            if self.given.iter().any(|given| given == option) {
                return Err(of_option(&format!("--{option} with {way}: {why}")));
            }
        }
        if !(0.0..=366.0).contains(&self.ahead_days) {
            let message = format!("wanted 0 to 366 days, got {}", self.ahead_days);
            return Err(Failure::of("OptionError", "ahead_days", message));
        }
        let limit = self.max_year_pointing_mrad;
        if let Some(limit) = limit.filter(|limit| !(1e-6..=1e6).contains(limit)) {
            let message = format!("wanted 1e-6 to 1e6 mrad, got {limit}");
            return Err(Failure::of(
                "OptionError",
                "max_year_pointing_mrad",
                message,
            ));
        }
        check_plan(self.plan.as_ref())?;
        if let Some(state) = &self.state {
            AtomicFile::check(state).map_err(|error| Failure::from(error).or_of("state"))?;
            inputs.not_among("state", state, field)?;
        }
        let Some(report) = &self.report else {
            return Ok(());
        };
        let read = self.update.as_ref().filter(|(_, held)| held.is_none());
        let read = read.map(|(path, _)| ("update", path));
        for (name, path) in read
            .into_iter()
            .chain(self.state.as_ref().map(|path| ("state", path)))
        {
            if place(path).is_some_and(|other| Some(other) == place(report)) {
                let message = format!(
                    "{}: {name} names it too; name another file",
                    report.display()
                );
                return Err(Failure::of("OptionError", "report", message));
            }
        }
        Ok(())
    }
}

/// What was found, as tables and words.
struct Found {
    sets: Vec<CalibratedSet>,
    tables: Vec<(&'static str, KeptColumns)>,
    findings: Vec<(String, String)>,
    warnings: Vec<String>,
    changes: Vec<String>,
    page: Option<String>,
    state: Vec<u8>,
    noise: [(&'static str, f64); 3],
    wander: [(&'static str, Vec<f64>); 4],
    /// Mean and standard deviation over the field of each angle of a mount \[rad\].
    of_field: Vec<(&'static str, (f64, f64))>,
    joint: Vec<f64>,
    off: bool,
    converged: bool,
    leftovers: Option<(bool, [f64; 2], f64, f64)>,
}

impl Found {
    /// Writes what goes to files: after a Ctrl-C that came with the end nothing.
    fn write(&self, page: Option<PageFile>, state: Option<&Path>) -> Result<(), Failure> {
        if let (Some(file), Some(page)) = (page, &self.page) {
            file.write(page)?;
        }
        if let Some(path) = state {
            // the state goes last: where anything failed, the same records can be given again
            write_file(path, &self.state).map_err(|error| Failure::from(error).or_of("state"))?;
        }
        Ok(())
    }
}

/// Calibrates a field as one; tables as lists of columns, numbers as arrays.
#[pyfunction]
pub(crate) fn _calibrate_joint<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    observations: &Bound<'py, PyAny>,
    spots: Option<&Bound<'py, PyAny>>,
    compare: Option<&Bound<'py, PyAny>>,
    words: JointWords,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let inner = PyField::of(field)?.get().inner();
        let loaded = inner.with_targets()?;
        let inputs = Inputs::of(observations, spots, compare)?;
        words.check(loaded, &inputs)?;
        needs_site(loaded)?;
        let page = PageFile::wanted(words.report.as_deref(), &inputs, loaded)?;
        let field_hash = inner.hash();
        let found = watched(py, progress.as_ref(), |watch| {
            found(&words, loaded, &inputs, field_hash, watch)
        })??;
        py.detach(|| found.write(page, words.state.as_deref()))?;
        answer(py, found)
    })
}

fn found(
    words: &JointWords,
    loaded: &LoadedField,
    inputs: &Inputs,
    field_hash: String,
    watch: &(dyn Fn(u64, u64) -> bool + Sync),
) -> Result<Found, Failure> {
    let proposals = proposals(words.plan.as_ref(), loaded)?;
    let old = inputs.earlier(loaded)?;
    let said = Mutex::new(Vec::new());
    let say = |remark: Remark| {
        let (Remark::Warning(words) | Remark::Note(words)) = remark;
        let mut said = said.lock().unwrap_or_else(PoisonError::into_inner);
        said.push(in_keywords(&words));
    };
    let following = match &words.update {
        Some((name, bytes)) => {
            let begun = || {
                let state = match bytes {
                    None => read_state(name)?,
                    Some(bytes) => state_of_bytes(name, bytes.clone())?,
                };
                Ok::<_, Failure>(Following::begin(name, state, loaded, &say)?)
            };
            Some(begun().map_err(|failure| failure.or_of("update"))?)
        }
        None => None,
    };
    let (observations, observations_hash) =
        observed(&inputs.observations, inputs.spots.as_ref(), loaded)?;
    let asked = JointAsked {
        keep_all: words.keep_all,
        no_jumps: words.no_jumps,
        ahead_days: words.ahead_days,
        max_year_pointing_mrad: words.max_year_pointing_mrad,
    };
    // where a part only asks whether to go on, the number of all is the last that was told
    let all = AtomicU64::new(0);
    let watch = |more: u64, of: u64| {
        if of > 0 {
            all.store(of, Ordering::Relaxed);
        }
        watch(more, all.load(Ordering::Relaxed))
    };
    let run = JointRun {
        loaded,
        observations: &observations,
        asked: &asked,
        say: &say,
        watch: &watch,
    };
    let of_records = |error| Failure::from(error).or_of("observations");
    run.check_times(following.is_some()).map_err(of_records)?;
    let provenance = Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        solver: if following.is_some() {
            "joint-update"
        } else {
            "joint"
        }
        .to_owned(),
        residual: "beam".to_owned(),
        robust: "accounts".to_owned(),
        field_hash,
        observations_hash,
        options_hash: match &following {
            Some(following) => following.checksum().to_owned(),
            None => asked.hash(),
        },
    };
    let all = match following {
        Some(following) => {
            let all = run.update(following, proposals.is_some());
            all.map_err(of_records)?
        }
        None => run.fit()?,
    };
    let beside = Beside {
        proposals,
        old,
        page: words.report.is_some(),
        leftovers: words.leftovers,
    };
    let told = told(&run, &all, &provenance, &beside)?;
    let said = said.into_inner().unwrap_or_else(PoisonError::into_inner);
    let warnings = observations.warnings.iter().cloned();
    Ok(Found {
        warnings: warnings.chain(said).chain(told.warnings).collect(),
        ..told
    })
}

/// What is wanted beside the tables that there always are.
struct Beside {
    proposals: Option<Proposals>,
    old: Option<Vec<CalibratedSet>>,
    page: bool,
    leftovers: bool,
}

fn told(
    run: &JointRun<'_>,
    all: &JointFound<'_>,
    provenance: &Provenance,
    beside: &Beside,
) -> Result<Found, Failure> {
    let day = run.day(&all.state)?;
    let sets = run.sets(all, &day)?;
    let mut tables = Vec::new();
    let mut table = |name| {
        let kept = KeptColumns::default();
        tables.push((name, kept.clone()));
        Destination::Columns(kept)
    };
    let csv = Format::Csv; // of columns in memory there is no format
    write_calibration(table("calibration"), csv, &sets, provenance)?;
    write_rejected(
        table("rejected"),
        csv,
        run.rejected(all),
        run.loaded,
        run.observations,
    )?;
    run.go_on()?;
    all.write_causes(table("causes"), csv)?;
    run.write_steps(all, table("steps"), csv)?;
    run.go_on()?;
    let ids = run.loaded.field.ids();
    let mut leftovers = None;
    if beside.leftovers
        && let Some((_, left)) = run.leftovers(all, &day)?
    {
        let rows = run.observations.heliostats.iter().map(|of| of.row);
        let ids: Vec<String> = rows.map(|row| ids[row].clone()).collect();
        write_leftovers(table("leftovers"), csv, &ids, &left.heliostats)?;
        let (amplitude, length) = (left.amplitude_mrad, left.length_rad);
        leftovers = Some((left.admitted, amplitude, length, left.log_evidence));
    }
    run.go_on()?;
    if let Some(proposals) = &beside.proposals {
        let rows = run.propose(proposals, all)?;
        proposals.write(&rows, run.loaded, table("plan"), csv)?;
    }
    let go_on = || (run.watch)(0, 0);
    let compared = match &beside.old {
        Some(old) => Some(Compared::of(
            old,
            &sets,
            run.loaded,
            run.observations,
            &go_on,
        )?),
        None => None,
    };
    let changes = |most| {
        compared
            .as_ref()
            .map_or(Vec::new(), |compared| compared.changes.sentences(most))
    };
    let page = match beside.page {
        true => {
            let about = AboutRun {
                provenance,
                generated_utc: made_at(),
                changes: changes(CHANGES_TOLD),
            };
            let page = JointPage::of_run(run, all, about)?;
            run.go_on()?;
            Some(joint_page(&page))
        }
        false => None,
    };
    let changes = changes(usize::MAX);
    tables.extend(compared.map(|compared| ("changes", compared.table)));
    let id = |index: usize| ids[run.observations.heliostats[index].row].clone();
    let jumps = all
        .jumps
        .iter()
        .map(|jump| (id(jump.index), jump_words(jump)));
    let alarms = run.alarms(all);
    let alarms = alarms.iter();
    let alarms = alarms.map(|&(index, ns, in_a_row)| (id(index), alarm_words(ns, in_a_row)));
    let (noise, wander) = (&all.state.noise, &all.state.wander);
    let joint = sets.iter().flat_map(|set| match &set.joint {
        Some(joint) => [
            joint.foretold_mrad,
            joint.expected_mrad,
            joint.zero_rad[0],
            joint.zero_rad[1],
            joint.zero_sigma_rad[0],
            joint.zero_sigma_rad[1],
        ],
        None => [f64::NAN; 6],
    });
    run.go_on()?;
    Ok(Found {
        changes,
        page,
        joint: joint.collect(),
        findings: jumps.chain(alarms).collect(),
        warnings: all
            .spells
            .iter()
            .map(|spell| {
                format!(
                    "{} the field as a whole was off: more than half of {} heliostats at a time missed by far more than \
                     was expected of them. Rather than each of them, a clock, the name or the survey of a target, the \
                     table of angles or a camera is wrong",
                    days_of(spell),
                    spell.heliostats
                )
            })
            .collect(),
        state: state_bytes(Path::new("state"), all.state_file())?,
        noise: [
            ("beam_mrad", noise.beam_mrad),
            ("spot_m", noise.spot_m),
            ("sun_path_s", noise.sun_path_s),
        ],
        wander: [
            ("slow_mrad", wander.slow_mrad.to_vec()),
            ("slow_days", vec![wander.slow_days]),
            ("fast_mrad", wander.fast_mrad.to_vec()),
            ("fast_days", vec![wander.fast_days]),
        ],
        of_field: of_field(all),
        off: all.off,
        converged: all.converged(),
        leftovers,
        sets,
        tables,
    })
}

/// What heliostats of the field are like.
fn of_field(all: &JointFound<'_>) -> Vec<(&'static str, (f64, f64))> {
    let (mean, covariance) = (all.state.field_mean(), all.state.field_covariance());
    let angles = Parameter::ALL.iter().take(6).enumerate();
    let of = |k: usize| (mean[k], covariance[k * mean.len() + k].max(0.0).sqrt());
    angles.map(|(k, angle)| (angle.as_str(), of(k))).collect()
}

fn answer(py: Python<'_>, found: Found) -> Result<Bound<'_, PyDict>, Failure> {
    let dict = columns_of_sets(py, &found.sets)?;
    for (name, kept) in found.tables {
        dict.set_item(name, handed_out(py, kept.take())?)?;
    }
    dict.set_item("changes_said", found.changes)?;
    dict.set_item("findings", PyList::new(py, found.findings)?)?;
    dict.set_item("warnings", found.warnings)?;
    dict.set_item("state", PyBytes::new(py, &found.state))?;
    let noise = PyDict::new(py);
    for (name, value) in found.noise {
        noise.set_item(name, value)?;
    }
    dict.set_item("noise", noise)?;
    let wander = PyDict::new(py);
    for (name, value) in found.wander {
        match value[..] {
            [axis1, axis2] => wander.set_item(name, (axis1, axis2))?,
            _ => wander.set_item(name, value[0])?,
        }
    }
    dict.set_item("wander", wander)?;
    let of_field = PyDict::new(py);
    for (name, mean_and_sigma) in found.of_field {
        of_field.set_item(name, mean_and_sigma)?;
    }
    dict.set_item("of_field", of_field)?;
    let rows = found.sets.len();
    dict.set_item("joint", crate::array::owned(py, found.joint, &[rows, 6])?)?;
    dict.set_item("field_is_off", found.off)?;
    dict.set_item("converged", found.converged)?;
    if let Some((admitted, amplitude_mrad, length_rad, log_evidence)) = found.leftovers {
        let left = PyDict::new(py);
        left.set_item("admitted", admitted)?;
        left.set_item("amplitude_mrad", (amplitude_mrad[0], amplitude_mrad[1]))?;
        left.set_item("length_rad", length_rad)?;
        left.set_item("log_evidence", log_evidence)?;
        dict.set_item("leftovers_found", left)?;
    }
    Ok(dict)
}
