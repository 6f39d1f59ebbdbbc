//! What the options mean.

use helio_calib::schedule::Sets;
use helio_calib::{
    CalibrateOptions, Constraint, FitOptions, Loss, Parameter, Parameters, ResidualForm, Solver,
    Start,
};
use helio_core::angle::radians;

use super::RunError;
use crate::hash::Sha256;

/// How to fit, in the words of the command line.
#[derive(Debug, Clone, PartialEq)]
pub struct FitWords {
    /// One of [`SOLVERS`](Self::SOLVERS).
    pub solver: String,
    /// One of [`RESIDUALS`](Self::RESIDUALS).
    pub residual: String,
    /// One of [`LOSSES`](Self::LOSSES).
    pub robust: String,
    /// One of [`SETS`](Self::SETS).
    pub sets: String,
    /// Whether the mirror offset is a seventh parameter.
    pub fit_mirror_offset: bool,
    /// Names of parameters to keep as the field states them.
    pub hold: Vec<String>,
    /// What is known of parameters: `NAME=MEAN:SD`, degrees (metres for `mirror_offset`).
    pub prior: Vec<String>,
    /// Whether every record that is a number is kept.
    pub keep_all: bool,
    /// Whether no jumps of the encoder references are looked for.
    pub no_jumps: bool,
    /// Greatest uncertainty of the pointing over the year that parameters may have \[mrad\].
    pub max_year_pointing_mrad: f64,
}

impl Default for FitWords {
    fn default() -> Self {
        Self {
            solver: "hartley-meyer".into(),
            residual: "components".into(),
            robust: "none".into(),
            sets: "1".into(),
            fit_mirror_offset: false,
            hold: Vec::new(),
            prior: Vec::new(),
            keep_all: false,
            no_jumps: false,
            max_year_pointing_mrad: 2.0,
        }
    }
}

/// Most sets over the day that are tried.
const MOST_SETS: usize = 4;

impl FitWords {
    /// Solvers.
    pub const SOLVERS: [(&'static str, Solver); 2] = [
        ("hartley-meyer", Solver::HartleyMeyer),
        ("gauss-newton", Solver::GaussNewton),
    ];
    /// What is made small.
    pub const RESIDUALS: [(&'static str, ResidualForm); 3] = [
        ("components", ResidualForm::Components),
        ("distance", ResidualForm::Distance),
        ("beam", ResidualForm::Beam),
    ];
    /// How much large residuals count.
    pub const LOSSES: [(&'static str, Loss); 4] = [
        ("none", Loss::Squares),
        ("huber", Loss::Huber),
        ("student-t", Loss::StudentT { degrees: 4.0 }),
        ("cauchy", Loss::Cauchy),
    ];
    /// Sets over the day.
    pub const SETS: [(&'static str, Sets); 3] = [
        ("1", Sets::One),
        ("2", Sets::Two),
        ("auto", Sets::Auto { max: MOST_SETS }),
    ];

    /// SHA-256 of all of it, for [`Provenance::options_hash`](crate::Provenance::options_hash).
    #[must_use]
    pub fn hash(&self) -> String {
        let mut hash = Sha256::default();
        hash.update(format!("{self:?}").as_bytes());
        hash.finish()
    }
}

fn chosen<T: Copy>(option: &str, word: &str, known: &[(&str, T)]) -> Result<T, RunError> {
    let found = known.iter().find(|(name, _)| *name == word);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
        RunError::refused(format!(
            "{option}: unknown word `{word}`; known are {}",
            names.join(", ")
        ))
    })
}

/// What the options mean.
#[derive(Debug)]
pub struct Asked {
    options: CalibrateOptions,
    sets: Sets,
    hold: [bool; 7],
}

/// The names of parameters on the command line.
const NAMES: [(&str, &[Parameter]); 6] = [
    ("pedestal_tilt", &[Parameter::Tilt1, Parameter::Tilt2]),
    ("axis_nonorthogonality", &[Parameter::AxisNonorthogonality]),
    ("mirror_tilt", &[Parameter::MirrorTilt]),
    ("azimuth_reference", &[Parameter::AzimuthReference]),
    ("elevation_reference", &[Parameter::ElevationReference]),
    ("mirror_offset", &[Parameter::MirrorOffset]),
];

fn named(option: &str, name: &str) -> Result<&'static [Parameter], RunError> {
    let bare = name.trim();
    let bare = bare.strip_suffix("_deg").unwrap_or(bare);
    let bare = bare.strip_suffix("_m").unwrap_or(bare);
    let found = NAMES.iter().find(|(known, _)| *known == bare);
    found.map(|(_, parameters)| *parameters).ok_or_else(|| {
        let known: Vec<&str> = NAMES.iter().map(|(known, _)| *known).collect();
        RunError::refused(format!(
            "{option}: unknown parameter `{name}`; known are {}",
            known.join(", ")
        ))
    })
}

fn in_words(parameters: &[Parameter]) -> &'static str {
    match parameters {
        [one] => one.in_words(),
        _ => "pedestal tilt",
    }
}

impl Asked {
    /// # Errors
    /// [`RunError::Refused`] for an unknown word or parameter, for a prior that is none, and for options that
    /// contradict each other.
    pub fn new(words: &FitWords) -> Result<Self, RunError> {
        let residual = chosen("--residual", &words.residual, &FitWords::RESIDUALS)?;
        let mut fit = FitOptions {
            solver: chosen("--solver", &words.solver, &FitWords::SOLVERS)?,
            residual,
            loss: chosen("--robust", &words.robust, &FitWords::LOSSES)?,
            // The distance of eq. (38) may need many, theory §6.
            max_iterations: match residual {
                ResidualForm::Distance => 300,
                _ => 100,
            },
            ..FitOptions::default()
        };
        let mut hold = [false; 7];
        if words.fit_mirror_offset {
            fit.constraints[Parameter::MirrorOffset as usize] = Constraint::Free;
        }
        for name in &words.hold {
            for &parameter in named("--hold", name)? {
                if parameter == Parameter::MirrorOffset && words.fit_mirror_offset {
                    return Err(RunError::refused(
                        "--hold mirror_offset and --fit-mirror-offset contradict each other",
                    ));
                }
                fit.constraints[parameter as usize] = Constraint::Held;
                hold[parameter as usize] = true;
            }
        }
        for prior in &words.prior {
            let (parameters, mean, sigma) = prior_of(prior)?;
            for &parameter in parameters {
                if let Constraint::Prior { .. } = fit.constraints[parameter as usize] {
                    return Err(RunError::refused(format!(
                        "--prior {prior}: the {} has a prior already; give it one",
                        in_words(parameters)
                    )));
                }
                if hold[parameter as usize] {
                    return Err(RunError::refused(format!(
                        "--prior {prior}: the parameter is held by --hold"
                    )));
                }
                fit.constraints[parameter as usize] = Constraint::Prior { mean, sigma };
            }
        }
        if fit.free().next().is_none() {
            return Err(RunError::refused("--hold: every parameter is held"));
        }
        Ok(Self {
            options: CalibrateOptions {
                fit,
                reject: !words.keep_all,
                jumps: !words.no_jumps,
                max_year_pointing_mrad: words.max_year_pointing_mrad,
                ..CalibrateOptions::default()
            },
            sets: chosen("--sets", &words.sets, &FitWords::SETS)?,
            hold,
        })
    }

    /// Sets over the day.
    #[must_use]
    pub const fn sets(&self) -> Sets {
        self.sets
    }

    /// The options for a heliostat with these parameters in the field.
    #[must_use]
    pub fn of(&self, field: &Parameters) -> CalibrateOptions {
        let mut options = self.options;
        if self.hold.contains(&true) {
            let mut start = Parameters::default();
            for parameter in Parameter::ALL {
                let k = parameter as usize;
                start.values[k] = match options.fit.constraints[k] {
                    Constraint::Prior { mean, .. } => mean,
                    _ if self.hold[k] || parameter == Parameter::MirrorOffset => field.values[k],
                    _ => 0.0,
                };
            }
            options.fit.start = Start::At(start);
        }
        options
    }
}

/// NAME=MEAN:SD
fn prior_of(text: &str) -> Result<(&'static [Parameter], f64, f64), RunError> {
    let refuse = |why: String| RunError::refused(format!("--prior {text}: {why}"));
    let parts = text
        .split_once('=')
        .and_then(|(name, rest)| Some((name, rest.split_once(':')?)));
    let Some((name, (mean, sigma))) = parts else {
        return Err(refuse(
            "wanted NAME=MEAN:SD, such as mirror_tilt=0:0.1".into(),
        ));
    };
    let parameters = named("--prior", name)?;
    let number = |text: &str, what: &str| match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(refuse(format!("{what} `{text}` is no finite number"))),
    };
    let (mean, sigma) = (
        number(mean, "the mean")?,
        number(sigma, "the standard deviation")?,
    );
    if sigma <= 0.0 {
        return Err(refuse("the standard deviation must be above zero".into()));
    }
    if parameters == [Parameter::MirrorOffset] {
        return Ok((parameters, mean, sigma));
    }
    if parameters.len() > 1 && mean != 0.0 {
        return Err(refuse(
            "the tilt's direction is not known, so its mean must be 0".into(),
        ));
    }
    Ok((parameters, radians(mean), radians(sigma)))
}
