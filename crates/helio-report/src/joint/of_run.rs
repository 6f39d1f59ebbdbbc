//! The page of a field calibrated as one, from what a run found.

use std::collections::HashMap;

use helio_calib::Parameter;
use helio_calib::joint::{CommonCause, Scope, StepKind, ZeroPoint};
use helio_io::calibrate::RunError;
use helio_io::calibrate::joint::{JointFound, JointRun, STOPPED, cause_target, for_people};
use rayon::prelude::*;

use super::{CauseLine, HeliostatLine, JointPage, NumberLine, RecordLine, jumped, tracks};
use crate::run::{AboutRun, facts, site_name};

/// Records that a page is given at most: of larger fields those of some heliostats, evenly chosen.
const MOST_RECORDS: usize = 1_000_000;

/// Angles of a mount.
const ANGLES: usize = 6;

/// What a page is made of.
struct Source<'a> {
    run: &'a JointRun<'a>,
    all: &'a JointFound<'a>,
}

impl JointPage {
    /// The page of a run, from what it found.
    ///
    /// # Errors
    /// [`RunError`] if the observations are not those of their file, and where the run is stopped.
    ///
    /// ```
    /// use std::path::Path;
    ///
    /// use helio_io::calibrate::joint::{JointAsked, JointRun};
    /// use helio_report::AboutRun;
    /// use helio_report::joint::JointPage;
    ///
    /// let examples = Path::new("../../examples");
    /// let loaded = helio_io::load_field(&examples.join("field.toml"))?;
    /// let run = JointRun {
    ///     loaded: &loaded,
    ///     observations: &helio_io::load_observations(&examples.join("observations.csv"), &loaded)?,
    ///     asked: &JointAsked::default(),
    ///     say: &|_| (),
    ///     watch: &|_, _| true,
    /// };
    /// let found = run.fit()?;
    /// let about = AboutRun {
    ///     provenance: &helio_io::Provenance::default(),
    ///     generated_utc: "2026-06-21T12:00:00Z".into(),
    ///     changes: Vec::new(),
    /// };
    /// let page = JointPage::of_run(&run, &found, about)?;
    /// assert_eq!(page.heliostats.len(), 500); // all, whether they were seen or not
    /// assert_eq!(page.heliostats.iter().filter(|line| !line.records.is_empty()).count(), 4);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of_run(
        run: &JointRun<'_>,
        found: &JointFound<'_>,
        about: AboutRun<'_>,
    ) -> Result<Self, RunError> {
        Source { run, all: found }.page(about)
    }
}

impl Source<'_> {
    fn page(&self, about: AboutRun<'_>) -> Result<JointPage, RunError> {
        let state = &self.all.state;
        let own = self.own_causes();
        let unknowns: Vec<String> = Parameter::ALL[..ANGLES]
            .iter()
            .map(|parameter| parameter.in_words())
            .chain(own.iter().map(|cause| cause.cause.description().in_words))
            .map(str::to_owned)
            .collect();
        let shown = self.shown();
        let (mean, covariance) = (state.field_mean(), state.field_covariance());
        let all = mean.len();
        let pairs = shown
            .iter()
            .flat_map(|&i| shown.iter().map(move |&j| (i, j)));
        let stopped = (!self.all.converged()).then(|| STOPPED.to_owned());
        let loaded = self.run.loaded;
        let mut page = JointPage {
            followed: self.all.fit.is_none(),
            title: format!("{} as one", site_name(loaded)),
            generated_utc: about.generated_utc,
            version: format!("helio-rs {}", about.provenance.version),
            facts: facts(loaded, self.run.observations, about.provenance),
            findings: stopped.into_iter().chain(about.changes).collect(),
            causes: self.causes(),
            noise: self.noise(),
            unknowns: shown.iter().map(|&k| unknowns[k].clone()).collect(),
            mean_mrad: shown.iter().map(|&k| 1e3 * mean[k]).collect(),
            covariance_mrad2: pairs.map(|(i, j)| 1e6 * covariance[i * all + j]).collect(),
            heliostats: self.heliostats()?,
        };
        self.smooth(&mut page)?;
        Ok(page)
    }

    fn own_causes(&self) -> Vec<&CommonCause> {
        let causes = self.all.causes.iter();
        causes
            .filter(|cause| cause.cause.description().scope == Scope::Heliostat)
            .collect()
    }

    /// Of the heliostats' own unknowns those that the page shows: six angles and the causes that are admitted.
    fn shown(&self) -> Vec<usize> {
        let own = self.own_causes().into_iter().enumerate();
        let admitted = own.filter(|(_, cause)| cause.admitted);
        (0..ANGLES)
            .chain(admitted.map(|(k, _)| ANGLES + k))
            .collect()
    }

    /// Zero points that the page shows, as all records tell them.
    fn smooth(&self, page: &mut JointPage) -> Result<(), RunError> {
        if self.all.fit.is_none() {
            return Ok(());
        }
        let index_of: HashMap<&str, usize> = self
            .run
            .observations
            .heliostats
            .iter()
            .enumerate()
            .map(|(index, of)| (self.run.loaded.field.ids()[of.row].as_str(), index))
            .collect();
        let mut shown = tracks(page);
        shown.extend(jumped(page));
        shown.sort_unstable();
        shown.dedup();
        let found: Result<Vec<(usize, Vec<ZeroPoint>)>, RunError> = shown
            .into_par_iter()
            .filter_map(|line| {
                let index = index_of.get(page.heliostats[line].id.as_str())?;
                if let Err(stopped) = self.run.go_on() {
                    return Some(Err(stopped));
                }
                let zeros = self.all.zero_points(*index).transpose()?;
                Some(zeros.map(|zeros| (line, zeros)))
            })
            .collect();
        for (line, zeros) in found? {
            for (record, zero) in page.heliostats[line].records.iter_mut().zip(zeros) {
                record.zero_mrad = zero.zero_rad.map(|x| 1e3 * x);
                record.zero_sigma_mrad = zero.sigma_rad.map(|x| 1e3 * x);
            }
        }
        Ok(())
    }

    fn causes(&self) -> Vec<CauseLine> {
        let of = |k: usize| self.all.worth.as_ref().and_then(|worth| worth.get(k));
        self.all
            .causes
            .iter()
            .enumerate()
            .map(|(k, cause)| {
                let description = cause.cause.description();
                let (factor, unit) = for_people(description.unit);
                let name = match cause_target(cause.cause, &self.all.targets) {
                    "" => description.in_words.to_owned(),
                    target => {
                        let shift = description.in_words.replace(" of the target", "");
                        format!("{target}: {shift}")
                    }
                };
                CauseLine {
                    name,
                    scope: description.scope.as_str().to_owned(),
                    unit: unit.to_owned(),
                    value: factor * cause.value,
                    sigma: factor * cause.sigma,
                    spread: (description.scope == Scope::Heliostat)
                        .then_some(factor * cause.spread),
                    log_evidence: cause.log_evidence,
                    admitted: cause.admitted,
                    turn_mrad: of(k).map(|worth| worth.turn_mrad),
                    worth_mrad: of(k).map(|worth| worth.worth_mrad),
                }
            })
            .collect()
    }

    fn noise(&self) -> Vec<NumberLine> {
        let (noise, wander) = (&self.all.state.noise, &self.all.state.wander);
        [
            (
                "scatter across the beam, either component",
                noise.beam_mrad,
                "mrad",
            ),
            (
                "scatter on the target, either component, of records without sigma_m",
                1e2 * noise.spot_m,
                "cm",
            ),
            (
                "scatter of time, along the sun's path",
                noise.sun_path_s,
                "s",
            ),
            ("slow wander of axis 1", wander.slow_mrad[0], "mrad"),
            ("slow wander of axis 2", wander.slow_mrad[1], "mrad"),
            (
                "slow wander is forgotten by a factor e in",
                wander.slow_days,
                "days",
            ),
            ("fast wander of axis 1", wander.fast_mrad[0], "mrad"),
            ("fast wander of axis 2", wander.fast_mrad[1], "mrad"),
            (
                "fast wander is forgotten by a factor e in",
                wander.fast_days,
                "days",
            ),
        ]
        .map(|(name, value, unit)| NumberLine {
            name: name.to_owned(),
            value,
            unit: unit.to_owned(),
        })
        .to_vec()
    }

    fn heliostats(&self) -> Result<Vec<HeliostatLine>, RunError> {
        let (found, observations) = (self.all, self.run.observations);
        let mut of_row: Vec<Vec<RecordLine>> = vec![Vec::new(); self.run.loaded.field.len()];
        let indices = observations.heliostats.len();
        let every = found
            .judged
            .len()
            .div_ceil(MOST_RECORDS)
            .clamp(1, indices.max(1));
        for one in found.judged.iter().filter(|one| one.index % every == 0) {
            let of = &observations.heliostats[one.index];
            let record = of.records[one.observation];
            let place = observations.position(record)?;
            let name = observations.record_id(record);
            of_row[of.row].push(RecordLine {
                label: name.map_or(place.clone(), |name| format!("{name} ({place})")),
                unix_ns: of.observations[one.observation].unix_ns,
                miss_mrad: one.foretold.miss_mrad,
                covariance_mrad2: one.foretold.covariance_mrad2,
                zero_mrad: one.zero_rad.map(|x| 1e3 * x),
                zero_sigma_mrad: one.zero_sigma_rad.map(|x| 1e3 * x),
                outlier: one.kind == StepKind::Outlier,
                jumped: one.jumped,
                in_doubt: one.in_doubt,
            });
        }
        let mut places: Vec<(usize, usize)> = found
            .rows
            .iter()
            .enumerate()
            .filter_map(|(place, row)| Some(((*row)?, place)))
            .collect();
        places.sort_unstable();
        let shown = self.shown();
        let lines: Result<Vec<HeliostatLine>, RunError> = places
            .par_iter()
            .map(|&(row, place)| {
                self.run.go_on()?;
                let (values, sigmas) = found.state.at_rest(place)?;
                let mrad = |x: Vec<f64>| shown.iter().map(|&k| 1e3 * x[k]).collect();
                Ok(HeliostatLine {
                    id: self.run.loaded.field.ids()[row].clone(),
                    observations: found.state.heliostats()[place].believed() as usize,
                    values_mrad: mrad(values),
                    sigmas_mrad: mrad(sigmas),
                    records: Vec::new(),
                })
            })
            .collect();
        let mut lines = lines?;
        for (line, (row, _)) in lines.iter_mut().zip(&places) {
            line.records = std::mem::take(&mut of_row[*row]);
        }
        Ok(lines)
    }
}
