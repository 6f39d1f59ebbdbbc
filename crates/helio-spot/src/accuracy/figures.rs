//! Accuracy, precision and bias.

use std::collections::BTreeMap;

use super::correlation::design_effect;
use super::{Frames, Setup, Target};

/// A figure in milliradians, and how well it is known: one standard deviation from each cause.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Figure {
    /// The figure.
    pub mrad: f64,
    /// From the finite number of independent frames, for the winds that blew; infinite where there are no more frames
    /// than winds, whole metres per second, so that nothing tells.
    pub sampling_mrad: f64,
    /// From the distance.
    pub slant_mrad: f64,
    /// From the scale of the pictures.
    pub scale_mrad: f64,
    /// From the survey of the target.
    pub survey_mrad: f64,
    /// From the centres of the spots: by how much their scatter may have raised the figure.
    pub camera_mrad: f64,
}

impl Figure {
    /// All causes together, added in squares \[mrad\].
    #[must_use]
    pub fn uncertainty_mrad(&self) -> f64 {
        libm::sqrt(
            [
                self.sampling_mrad,
                self.slant_mrad,
                self.scale_mrad,
                self.survey_mrad,
                self.camera_mrad,
            ]
            .into_iter()
            .map(|v| v * v)
            .sum(),
        )
    }
}

/// Accuracy, precision and bias of some frames.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Figures {
    /// Root mean square about the aim point (3.2, by formula (1)).
    pub accuracy: Figure,
    /// Root mean square about the mean spot (3.3, by formula (1)).
    pub precision: Figure,
    /// Mean spot from the aim point: accuracy² = precision² + bias².
    pub bias: Figure,
    /// The same three as angles seen from the heliostat's centre of rotation, as clauses 3.2 and 3.3 define
    /// them \[mrad\]; `None` if it is not said from where the heliostat looks at the target.
    pub defined_mrad: Option<[f64; 3]>,
    /// The mean spot on the target \[m\], right and down.
    pub mean_m: [f64; 2],
    /// Scatter of the centres themselves, as stated: root mean square over both components \[mrad\].
    pub centre_noise_mrad: f64,
    /// How many independent frames would tell the accuracy as well.
    pub independent_frames: f64,
}

/// The figures of some frames; `None` without any.
pub(super) fn figures(frames: &Frames, setup: &Setup) -> Option<Figures> {
    let n = frames.spots_m.len();
    if n == 0 {
        return None;
    }
    let count = n as f64;
    let plain = Three::of(frames, setup, Target::of(setup));
    let mean_m = plain.mean_m;
    let Three {
        accuracy,
        precision,
        bias,
        ..
    } = plain;

    let mrad_per_m = 1e3 / setup.slant_m;
    let noise = frames.sigmas_m.iter().map(|s| 2.0 * s * s).sum::<f64>() / count;
    let centre_noise_mrad = libm::sqrt(noise) * mrad_per_m;
    let raised = |figure: f64| {
        let without = figure * figure - centre_noise_mrad * centre_noise_mrad;
        figure - libm::sqrt(without.max(0.0))
    };

    let out = [mean_m[0] - setup.aim_m[0], mean_m[1] - setup.aim_m[1]];
    let length = libm::hypot(out[0], out[1]);
    let toward = if length > 0.0 {
        [out[0] / length, out[1] / length]
    } else {
        [1.0, 0.0]
    };
    let (about_aim, effect) = frames.error_of_mean(|spot| squared(spot, setup.aim_m));
    let (about_mean, _) = frames.error_of_mean(|spot| squared(spot, mean_m));
    let (along, _) = frames.error_of_mean(|spot| spot[0] * toward[0] + spot[1] * toward[1]);
    // the square root of a mean of squares: its error is that of the mean over twice the root
    let of_root = |error_m2: f64, figure: f64| {
        let root_m = figure / mrad_per_m;
        if error_m2.is_infinite() {
            f64::INFINITY
        } else if root_m > 0.0 {
            0.5 * error_m2 / root_m * mrad_per_m
        } else {
            0.0
        }
    };

    let mut all = [accuracy, precision, bias].map(|mrad| Figure {
        mrad,
        ..Figure::default()
    });
    all[0].sampling_mrad = of_root(about_aim, accuracy);
    all[1].sampling_mrad = of_root(about_mean, precision);
    all[2].sampling_mrad = along * mrad_per_m;
    all[0].camera_mrad = raised(accuracy);
    all[1].camera_mrad = raised(precision);
    // the centres' scatter averages out of the mean spot
    all[2].camera_mrad = centre_noise_mrad / libm::sqrt(2.0 * count);
    for (cause, targets) in Target::moved(setup, 1.0) {
        let mut squares = [0.0; 3];
        for pair in targets {
            let moved = pair.map(|target| Three::of(frames, setup, target).list());
            for (k, sum) in squares.iter_mut().enumerate() {
                let change = moved
                    .iter()
                    .map(|m| (m[k] - all[k].mrad).abs())
                    .fold(0.0, f64::max);
                *sum += change * change;
            }
        }
        for (figure, sum) in all.iter_mut().zip(squares) {
            *cause.slot(figure) = libm::sqrt(sum);
        }
    }
    let [accuracy, precision, bias] = all;
    Some(Figures {
        accuracy,
        precision,
        bias,
        defined_mrad: setup.toward_heliostat.map(|_| {
            let rms = |about: [f64; 2]| {
                let angles = frames
                    .spots_m
                    .iter()
                    .map(|&spot| setup.angle_mrad(spot, about));
                libm::sqrt(angles.flatten().map(|a| a * a).sum::<f64>() / count)
            };
            let between = setup.angle_mrad(mean_m, setup.aim_m).unwrap_or_default();
            [rms(setup.aim_m), rms(mean_m), between]
        }),
        mean_m,
        centre_noise_mrad,
        independent_frames: count / effect,
    })
}

fn squared(spot: [f64; 2], about: [f64; 2]) -> f64 {
    let (u, v) = (spot[0] - about[0], spot[1] - about[1]);
    u * u + v * v
}

/// Accuracy, precision and bias \[mrad\], divisor N, as the instruments show them.
struct Three {
    accuracy: f64,
    precision: f64,
    bias: f64,
    mean_m: [f64; 2],
}

impl Three {
    fn of(frames: &Frames, setup: &Setup, target: Target) -> Self {
        let count = frames.spots_m.len() as f64;
        let placed = || frames.spots_m.iter().map(|&spot| target.place(spot));
        let mut mean_m = [0.0; 2];
        for spot in placed() {
            mean_m[0] += spot[0];
            mean_m[1] += spot[1];
        }
        let mean_m = mean_m.map(|sum| sum / count);
        let rms = |about: [f64; 2]| {
            let sum: f64 = placed().map(|spot| squared(spot, about)).sum();
            libm::sqrt(sum / count) / target.slant_m * 1e3
        };
        Self {
            accuracy: rms(setup.aim_m),
            precision: rms(mean_m),
            bias: libm::sqrt(squared(mean_m, setup.aim_m)) / target.slant_m * 1e3,
            mean_m,
        }
    }

    fn list(&self) -> [f64; 3] {
        [self.accuracy, self.precision, self.bias]
    }
}

impl Frames {
    /// Standard error of the mean of what `of` makes of each spot, for the winds that blew, and the design
    /// effect behind it: of the departures from the mean at each metre per second of wind.
    fn error_of_mean(&self, of: impl Fn([f64; 2]) -> f64) -> (f64, f64) {
        let mut values: Vec<f64> = self.spots_m.iter().map(|&spot| of(spot)).collect();
        let n = values.len() as f64;
        // no wind, or none that blows, is a stratum too
        let stratum = |wind: &f64| wind.clamp(-1.0, 200.0) as i64;
        let mut means: BTreeMap<i64, (f64, f64)> = BTreeMap::new();
        for (wind, value) in self.winds_m_s.iter().zip(&values) {
            let (sum, count) = means.entry(stratum(wind)).or_default();
            (*sum, *count) = (*sum + value, *count + 1.0);
        }
        for (wind, value) in self.winds_m_s.iter().zip(&mut values) {
            let (sum, count) = means.get(&stratum(wind)).copied().unwrap_or((0.0, 1.0));
            *value -= sum / count;
        }
        // each mean takes a degree of freedom
        let freedom = n - means.len() as f64;
        let squares = values.iter().map(|v| v * v).sum::<f64>();
        let variance = if freedom > 0.0 {
            squares / freedom
        } else {
            f64::INFINITY
        };
        let effect = design_effect(&self.ticks, &values).factor;
        (libm::sqrt(effect * variance / n), effect)
    }
}
