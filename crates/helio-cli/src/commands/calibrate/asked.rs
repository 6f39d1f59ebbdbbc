//! What the options mean.

use helio_calib::schedule::Sets;
use helio_calib::{
    CalibrateOptions, Constraint, FitOptions, Loss, Parameter, Parameters, ResidualForm, Solver,
    Start,
};
use helio_core::angle::radians;

use crate::args::{FitArgs, ResidualWord, RobustWord, SetsWord, SolverWord};
use crate::failure::Failure;

/// What the options mean.
#[derive(Debug)]
pub(super) struct Asked {
    pub options: CalibrateOptions,
    pub sets: Sets,
    pub hold: [bool; 7],
}

/// Most sets over the day that are tried.
const MOST_SETS: usize = 4;

/// The names of parameters on the command line.
const NAMES: [(&str, &[Parameter]); 6] = [
    ("pedestal_tilt", &[Parameter::Tilt1, Parameter::Tilt2]),
    ("axis_nonorthogonality", &[Parameter::AxisNonorthogonality]),
    ("mirror_tilt", &[Parameter::MirrorTilt]),
    ("azimuth_reference", &[Parameter::AzimuthReference]),
    ("elevation_reference", &[Parameter::ElevationReference]),
    ("mirror_offset", &[Parameter::MirrorOffset]),
];

fn named(option: &str, name: &str) -> Result<&'static [Parameter], Failure> {
    let bare = name.trim();
    let bare = bare.strip_suffix("_deg").unwrap_or(bare);
    let bare = bare.strip_suffix("_m").unwrap_or(bare);
    let found = NAMES.iter().find(|(known, _)| *known == bare);
    found.map(|(_, parameters)| *parameters).ok_or_else(|| {
        let known: Vec<&str> = NAMES.iter().map(|(known, _)| *known).collect();
        Failure::refused(format!(
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
    pub(super) fn new(args: &FitArgs) -> Result<Self, Failure> {
        let mut fit = FitOptions {
            solver: match args.solver {
                SolverWord::HartleyMeyer => Solver::HartleyMeyer,
                SolverWord::GaussNewton => Solver::GaussNewton,
            },
            residual: match args.residual {
                ResidualWord::Components => ResidualForm::Components,
                ResidualWord::Distance => ResidualForm::Distance,
                ResidualWord::Beam => ResidualForm::Beam,
            },
            loss: match args.robust {
                RobustWord::None => Loss::Squares,
                RobustWord::Huber => Loss::Huber,
                RobustWord::StudentT => Loss::StudentT { degrees: 4.0 },
                RobustWord::Cauchy => Loss::Cauchy,
            },
            // The distance of eq. (38) may need many, theory §6.
            max_iterations: match args.residual {
                ResidualWord::Components | ResidualWord::Beam => 100,
                ResidualWord::Distance => 300,
            },
            ..FitOptions::default()
        };
        let mut hold = [false; 7];
        if args.fit_mirror_offset {
            fit.constraints[Parameter::MirrorOffset as usize] = Constraint::Free;
        }
        for name in &args.hold {
            for &parameter in named("--hold", name)? {
                if parameter == Parameter::MirrorOffset && args.fit_mirror_offset {
                    return Err(Failure::refused(
                        "--hold mirror_offset and --fit-mirror-offset contradict each other",
                    ));
                }
                fit.constraints[parameter as usize] = Constraint::Held;
                hold[parameter as usize] = true;
            }
        }
        for prior in &args.prior {
            let (parameters, mean, sigma) = prior_of(prior)?;
            for &parameter in parameters {
                if let Constraint::Prior { .. } = fit.constraints[parameter as usize] {
                    return Err(Failure::refused(format!(
                        "--prior {prior}: the {} has a prior already; give it one",
                        in_words(parameters)
                    )));
                }
                if hold[parameter as usize] {
                    return Err(Failure::refused(format!(
                        "--prior {prior}: the parameter is held by --hold"
                    )));
                }
                fit.constraints[parameter as usize] = Constraint::Prior { mean, sigma };
            }
        }
        if fit.free().next().is_none() {
            return Err(Failure::refused("--hold: every parameter is held"));
        }
        Ok(Self {
            options: CalibrateOptions {
                fit,
                reject: !args.keep_all,
                jumps: !args.no_jumps,
                max_year_pointing_mrad: args.max_year_pointing_mrad,
                ..CalibrateOptions::default()
            },
            sets: match args.sets {
                SetsWord::One => Sets::One,
                SetsWord::Two => Sets::Two,
                SetsWord::Auto => Sets::Auto { max: MOST_SETS },
            },
            hold,
        })
    }

    /// The options for a heliostat with these parameters in the field.
    pub(super) fn of(&self, field: &Parameters) -> CalibrateOptions {
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
fn prior_of(text: &str) -> Result<(&'static [Parameter], f64, f64), Failure> {
    let refuse = |why: String| Failure::refused(format!("--prior {text}: {why}"));
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
