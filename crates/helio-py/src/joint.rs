//! `calibrate` of the field as one: the typed call and its answer are in `helio_py._joint`.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use helio_io::calibrate::joint::{
    Following, JointAsked, JointFound, JointRun, NOT_AS_ONE, Remark, alarm_words, days_of,
    jump_words, needs_site,
};
use helio_io::calibrate::{Proposals, RunError, write_rejected};
use helio_io::output::{Destination, Format, KeptColumns};
use helio_io::{
    AtomicFile, CalibratedSet, LoadedField, Provenance, read_state, state_bytes, state_of_bytes,
    write_calibration, write_file, write_leftovers,
};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};

use crate::calibrate::{columns_of_sets, hash_text, observed, of_option};
use crate::failure::Failure;
use crate::field::PyField;
use crate::guard::guarded;
use crate::table::{Given, handed_out};
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
    plan: Option<(usize, String)>,
    /// The name of a state, and what it holds where it is no file.
    update: Option<(PathBuf, Option<Vec<u8>>)>,
    state: Option<PathBuf>,
}

impl JointWords {
    fn check(&self, field: &LoadedField, given: [Option<&Given>; 2]) -> Result<(), Failure> {
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
        if let Some((count, _)) = self
            .plan
            .as_ref()
            .filter(|(count, _)| !(1..=1000).contains(count))
        {
            let message = format!("wanted 1 to 1000 observations, got {count}");
            return Err(Failure::of("OptionError", "plan", message));
        }
        if let Some(state) = &self.state {
            AtomicFile::check(state).map_err(|error| Failure::from(error).or_of("state"))?;
            let read = given.into_iter().flatten().filter_map(|given| match given {
                Given::File(path) => Some(path),
                Given::Memory(_) => None,
            });
            let there = state.canonicalize().ok();
            let mut inputs = field.files.iter().chain(read);
            if there.is_some() && inputs.any(|input| input.canonicalize().ok() == there) {
                let message = format!("{}: this call reads it; name another file", state.display());
                return Err(Failure::of("OptionError", "state", message));
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
    state: Vec<u8>,
    noise: [(&'static str, f64); 3],
    wander: [(&'static str, Vec<f64>); 4],
    joint: Vec<f64>,
    off: bool,
    converged: bool,
    leftovers: Option<(bool, [f64; 2], f64, f64)>,
}

/// Calibrates a field as one; tables as lists of columns, numbers as arrays.
#[pyfunction]
pub(crate) fn _calibrate_joint<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    observations: &Bound<'py, PyAny>,
    spots: Option<&Bound<'py, PyAny>>,
    words: JointWords,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    guarded(|| {
        let inner = PyField::of(field)?.get().inner();
        let (loaded, hashes) = inner.files_read()?;
        let observations = Given::of(observations, "observations")?;
        let spots = spots.map(|spots| Given::of(spots, "spots")).transpose()?;
        words.check(loaded, [Some(&observations), spots.as_ref()])?;
        needs_site(loaded)?;
        let field_hash = hash_text(&hashes.join(" "));
        let found = watched(py, progress.as_ref(), |watch| {
            found(
                &words,
                loaded,
                [Some(&observations), spots.as_ref()],
                field_hash,
                watch,
            )
        })??;
        answer(py, found)
    })
}

fn found(
    words: &JointWords,
    loaded: &LoadedField,
    [observations, spots]: [Option<&Given>; 2],
    field_hash: String,
    watch: &(dyn Fn(u64, u64) -> bool + Sync),
) -> Result<Found, Failure> {
    let proposals = match &words.plan {
        Some((count, date)) => {
            let asked = Proposals::new(*count, date, loaded).map_err(|error| match error {
                RunError::Refused(words) => {
                    let words = words.trim_start_matches("--plan-date ");
                    Failure::of("OptionError", "plan", words.trim_start_matches("--plan: "))
                }
                other => other.into(),
            });
            Some(asked?)
        }
        None => None,
    };
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
    let Some(observations) = observations else {
        return Err(Failure::new("InternalError", "no observations"));
    };
    let (observations, observations_hash) = observed(observations, spots, loaded)?;
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
    let told = told(&run, &all, &provenance, proposals.as_ref(), words)?;
    if let Some(path) = &words.state {
        // the state goes last: where anything failed, the same records can be given again
        write_file(path, &told.state).map_err(|error| Failure::from(error).or_of("state"))?;
    }
    let said = said.into_inner().unwrap_or_else(PoisonError::into_inner);
    let warnings = observations.warnings.iter().cloned();
    Ok(Found {
        warnings: warnings.chain(said).chain(told.warnings).collect(),
        ..told
    })
}

/// A sentence that names options as the command line does, in the names of keywords.
fn in_keywords(words: &str) -> String {
    let each = words.split(' ').map(|word| match word.strip_prefix("--") {
        Some(option) => option.replace('-', "_"),
        None => word.to_owned(),
    });
    each.collect::<Vec<_>>().join(" ")
}

fn told(
    run: &JointRun<'_>,
    all: &JointFound<'_>,
    provenance: &Provenance,
    proposals: Option<&Proposals>,
    words: &JointWords,
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
    if words.leftovers
        && let Some((_, left)) = run.leftovers(all, &day)?
    {
        let rows = run.observations.heliostats.iter().map(|of| of.row);
        let ids: Vec<String> = rows.map(|row| ids[row].clone()).collect();
        write_leftovers(table("leftovers"), csv, &ids, &left.heliostats)?;
        let (amplitude, length) = (left.amplitude_mrad, left.length_rad);
        leftovers = Some((left.admitted, amplitude, length, left.log_evidence));
    }
    run.go_on()?;
    if let Some(proposals) = proposals {
        let rows = run.propose(proposals, all)?;
        proposals.write(&rows, run.loaded, table("plan"), csv)?;
    }
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
        off: all.off,
        converged: all.converged(),
        leftovers,
        sets,
        tables,
    })
}

fn answer(py: Python<'_>, found: Found) -> Result<Bound<'_, PyDict>, Failure> {
    let dict = columns_of_sets(py, &found.sets)?;
    for (name, kept) in found.tables {
        dict.set_item(name, handed_out(py, kept.take())?)?;
    }
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
