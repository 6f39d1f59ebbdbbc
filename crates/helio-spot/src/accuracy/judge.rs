//! Shares of frames by wind, their intervals, and the verdict.

use std::fmt;

use super::correlation::design_effect;
use super::figures::figures;
use super::share::{clopper_pearson, frames_to_decide, normal_below, normal_width};
use super::{
    EvaluatedFrame, Figures, FrameStatus, Frames, Limits, Options, Setup, ShareLimit, SpotRow,
    Target,
};

/// What the campaign says of the heliostat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// The intervals of all bins lie above their limits.
    Qualified,
    /// The interval of at least one bin lies below its limit.
    NotQualified,
    /// Neither.
    NotEnoughData,
}

impl Verdict {
    /// In words: `qualified`, `not qualified`, `not enough data`.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Qualified => "qualified",
            Self::NotQualified => "not qualified",
            Self::NotEnoughData => "not enough data",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// Where the interval of a bin lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BinOutcome {
    /// Above the limit.
    Above,
    /// Below the limit.
    Below,
    /// The limit is within it.
    Open,
}

impl BinOutcome {
    /// The word for columns.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Above => "above",
            Self::Below => "below",
            Self::Open => "open",
        }
    }
}

/// The frames of a range of wind speeds.
#[derive(Debug, Clone, PartialEq)]
pub struct WindBin {
    /// Slowest wind \[m/s\].
    pub from_m_s: f64,
    /// Fastest wind \[m/s\].
    pub to_m_s: f64,
    /// Counted frames.
    pub frames: usize,
    /// Frames with the weather but without a spot that counts.
    pub lost: usize,
    /// Counted frames within the angle.
    pub within: usize,
    /// Share of the counted frames within the angle by formula (1); `None` without frames.
    pub share: Option<f64>,
    /// The same with the angle as clause 3.2 defines it, where that is known.
    pub defined_share: Option<f64>,
    /// Mean wind of the counted frames \[m/s\].
    pub mean_wind_m_s: Option<f64>,
    /// How many independent frames would tell the share as well.
    pub independent_frames: f64,
    /// Interval of the share from the number of independent frames alone.
    pub sampling: [f64; 2],
    /// The interval that is judged: with frames that are lost, and with the instruments.
    pub interval: [f64; 2],
    /// By how much the instruments lower and raise the share, at the confidence of the interval.
    pub instruments: [f64; 2],
    /// Accuracy, precision and bias of the counted frames.
    pub figures: Option<Figures>,
}

/// A bin that a limit belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedBin {
    /// The limit.
    pub limit: ShareLimit,
    /// The bin.
    pub bin: WindBin,
    /// Where its interval lies.
    pub outcome: BinOutcome,
    /// What the printed rule says: the share, as it is, is above the limit. `None` without frames.
    pub printed: Option<bool>,
    /// Independent frames from which a share like this one would be told from the limit; `None` without frames
    /// and where it is too close to the limit for ten million.
    pub frames_to_decide: Option<f64>,
}

/// By the intervals, and as printed.
pub(super) fn verdict(bins: &[JudgedBin]) -> (Verdict, Option<bool>) {
    let verdict = if bins.iter().any(|bin| bin.outcome == BinOutcome::Below) {
        Verdict::NotQualified
    } else if bins.iter().all(|bin| bin.outcome == BinOutcome::Above) {
        Verdict::Qualified
    } else {
        Verdict::NotEnoughData
    };
    let printed: Option<Vec<bool>> = bins.iter().map(|bin| bin.printed).collect();
    (
        verdict,
        printed.map(|each| each.into_iter().all(|above| above)),
    )
}

/// Everything that counting needs.
pub(super) struct Count<'a> {
    pub(super) spots: &'a [SpotRow],
    pub(super) frames: &'a [EvaluatedFrame],
    pub(super) order: &'a [usize],
    pub(super) step_ns: Option<i64>,
    pub(super) setup: &'a Setup,
    pub(super) limits: &'a Limits,
    pub(super) options: &'a Options,
}

impl Count<'_> {
    pub(super) fn judged(&self, limit: ShareLimit) -> JudgedBin {
        let half = self.options.bin_half_width_m_s;
        let (from, to) = (limit.wind_m_s - half, limit.wind_m_s + half);
        let bin = self.bin(from, to, |wind| (from..=to).contains(&wind));
        let [low, high] = bin.interval;
        let outcome = if low > limit.share {
            BinOutcome::Above
        } else if high < limit.share {
            BinOutcome::Below
        } else {
            BinOutcome::Open
        };
        JudgedBin {
            limit,
            outcome,
            printed: bin.share.map(|share| share > limit.share),
            frames_to_decide: bin
                .share
                .and_then(|share| frames_to_decide(share, limit.share, self.options.confidence)),
            bin,
        }
    }

    /// Bins from calm to the strongest wind, and over the range to cover.
    pub(super) fn histogram(&self) -> Vec<WindBin> {
        let step = self.options.histogram_step_m_s;
        let strongest = self
            .frames
            .iter()
            .filter(|frame| frame.status == FrameStatus::Ok)
            .filter_map(|frame| frame.wind_m_s)
            .fold(0.0, f64::max);
        // no wind on earth is stronger
        let to_cover = self.limits.wind_m_s[1];
        let bins =
            ((strongest.min(100.0) / step) as usize + 1).max(libm::ceil(to_cover / step) as usize);
        (0..bins)
            .map(|k| {
                let (from, to) = (k as f64 * step, (k + 1) as f64 * step);
                self.bin(from, to, |wind| (from..to).contains(&wind))
            })
            .collect()
    }

    fn bin(&self, from_m_s: f64, to_m_s: f64, holds: impl Fn(f64) -> bool) -> WindBin {
        let inside = |frame: &EvaluatedFrame| frame.wind_m_s.is_some_and(&holds);
        let taken = Frames::of(
            self.spots,
            self.frames,
            self.order,
            self.step_ns,
            self.setup,
            &|frame| frame.status == FrameStatus::Ok && inside(frame),
        );
        // Rows of one time are one frame; those that contradict each other are lost as one.
        let mut lost = 0;
        let mut before = None;
        for &row in self.order {
            let new = before.replace(self.spots[row].unix_ns) != Some(self.spots[row].unix_ns);
            let frame = &self.frames[row];
            lost += usize::from(new && frame.status.is_lost() && inside(frame));
        }
        let frames = taken.spots_m.len();
        let mut bin = WindBin {
            from_m_s,
            to_m_s,
            frames,
            lost,
            within: 0,
            share: None,
            defined_share: None,
            mean_wind_m_s: None,
            independent_frames: 0.0,
            sampling: [0.0, 1.0],
            interval: [0.0, 1.0],
            instruments: [0.0; 2],
            figures: None,
        };
        if frames == 0 {
            return bin;
        }
        let n = frames as f64;
        let limit_mrad = self.limits.angle_mrad;
        let etas_mrad = self.etas_mrad(&taken, Target::of(self.setup));
        bin.within = within(&etas_mrad, limit_mrad);
        let share = bin.within as f64 / n;
        bin.share = Some(share);
        bin.mean_wind_m_s = Some(taken.winds_m_s.iter().sum::<f64>() / n);
        if self.setup.toward_heliostat.is_some() {
            let angle = |spot: &[f64; 2]| self.setup.angle_mrad(*spot, self.setup.aim_m);
            let angles: Vec<f64> = taken.spots_m.iter().filter_map(angle).collect();
            bin.defined_share = Some(within(&angles, limit_mrad) as f64 / n);
        }
        let confidence = self.options.confidence;
        bin.independent_frames =
            n / effect_of_level(&taken.ticks, &etas_mrad, limit_mrad, confidence);
        let trials = bin.independent_frames;
        bin.sampling = clopper_pearson(share * trials, trials, confidence);
        // Frames without a spot may have been anywhere.
        let all = n + lost as f64;
        let more = trials * all / n;
        let least = bin.within as f64 / all;
        let most = (bin.within as f64 + lost as f64) / all;
        let low = clopper_pearson(least * more, more, confidence)[0];
        let high = clopper_pearson(most * more, more, confidence)[1];
        let [lower, raise] = self.instruments(&taken, &etas_mrad, share);
        bin.instruments = [lower, raise];
        // Independent causes of error of one share are added in squares, each side for itself (Zou and Donner
        // 2008, Statistics in Medicine 27:1693).
        bin.interval = [
            (share - libm::hypot(share - low, lower)).max(0.0),
            (share + libm::hypot(high - share, raise)).min(1.0),
        ];
        bin.figures = figures(&taken, self.setup);
        bin
    }

    fn etas_mrad(&self, taken: &Frames, target: Target) -> Vec<f64> {
        let aim_m = self.setup.aim_m;
        let spots = taken.spots_m.iter();
        spots.map(|&spot| target.eta_mrad(spot, aim_m)).collect()
    }

    /// By how much instruments that are wrong may have lowered and raised a share: each is moved to either side
    /// as far as the confidence reaches and the frames are counted again; the changes are added in squares.
    fn instruments(&self, taken: &Frames, etas_mrad: &[f64], share: f64) -> [f64; 2] {
        let n = etas_mrad.len() as f64;
        let limit_mrad = self.limits.angle_mrad;
        let width = normal_width(self.options.confidence);
        let mut squares = [0.0; 2];
        for (_, pairs) in Target::moved(self.setup, width) {
            for pair in pairs {
                let mut change = [0.0_f64; 2];
                for target in pair {
                    let moved = within(&self.etas_mrad(taken, target), limit_mrad) as f64 / n;
                    change[0] = change[0].max(share - moved);
                    change[1] = change[1].max(moved - share);
                }
                squares[0] += change[0] * change[0];
                squares[1] += change[1] * change[1];
            }
        }
        // A centre's own scatter takes frames near the limit to its other side, each for itself.
        let mrad_per_m = 1e3 / self.setup.slant_m;
        let spread: f64 = etas_mrad
            .iter()
            .zip(&taken.sigmas_m)
            .filter(|(_, sigma)| **sigma > 0.0)
            .map(|(eta, sigma)| {
                let inside = normal_below((limit_mrad - eta) / (sigma * mrad_per_m));
                inside * (1.0 - inside)
            })
            .sum();
        let centres = width * width * spread / (n * n);
        squares.map(|sum| libm::sqrt(sum + centres))
    }
}

fn within(etas_mrad: &[f64], limit_mrad: f64) -> usize {
    etas_mrad.iter().filter(|eta| **eta <= limit_mrad).count()
}

/// Design effect of "within the limit". Where nearly all frames or nearly none are within, how long an excursion
/// lasts cannot be told at the limit; then it is told at the level that a tenth of the frames lie beyond, whose
/// excursions last longer.
fn effect_of_level(ticks: &[i64], etas_mrad: &[f64], limit_mrad: f64, confidence: f64) -> f64 {
    let mut sorted = etas_mrad.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let last = sorted.len() - 1;
    let (low, high) = (sorted[last / 10], sorted[last - last / 10]);
    let inside = |eta: f64| {
        if limit_mrad >= high {
            eta < high
        } else {
            eta <= limit_mrad.max(low)
        }
    };
    let inside: Vec<f64> = etas_mrad
        .iter()
        .map(|eta| f64::from(u8::from(inside(*eta))))
        .collect();
    let effect = design_effect(ticks, &inside);
    // The effect is an estimate itself: a normal deviate becomes one of Student's t (Korn and Graubard 1998), here
    // by the first term of its expansion.
    let width = normal_width(confidence);
    let student = 1.0 + 0.25 * (width * width + 1.0) / effect.freedom;
    (effect.factor * student * student).min(ticks.len() as f64)
}
