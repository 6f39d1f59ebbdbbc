//! Campaigns whose truth is known: for tests, for planning how long to measure.

use core::f64::consts::TAU;

use super::{SpotRow, Weather};
use crate::SpotStatus;

/// A heliostat that swings in the wind, and the wind.
///
/// Each component of the spot swings about its mean as a first-order autoregressive Gaussian, its standard
/// deviation `calm_mrad + gust_mrad · (wind / 10 m/s)²`. The wind goes up and down between its ends; weather is
/// recorded once a second, under a clear sky.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Campaign {
    /// Of all random numbers.
    pub seed: u64,
    /// First time \[ns of Unix time\].
    pub from_unix_ns: i64,
    /// How long \[s\].
    pub duration_s: f64,
    /// Frames per second.
    pub frames_per_s: f64,
    /// Distance of the heliostat \[m\].
    pub slant_m: f64,
    /// Mean of the spots from the target's centre \[mrad\], right and down.
    pub bias_mrad: [f64; 2],
    /// Swing of either component without wind \[mrad\].
    pub calm_mrad: f64,
    /// What a wind of 10 m/s adds to it \[mrad\].
    pub gust_mrad: f64,
    /// Time in which a swing is forgotten but for 1/e \[s\]; 0 for independent frames.
    pub memory_s: f64,
    /// Weakest and strongest wind \[m/s\].
    pub wind_m_s: [f64; 2],
    /// Time from the weakest wind to the strongest and back \[s\].
    pub wind_period_s: f64,
    /// Scatter of the measured centres, per component \[m\]; also what the rows state.
    pub sigma_m: f64,
    /// Share of frames, at random, whose spot is not found.
    pub empty: f64,
}

impl Default for Campaign {
    fn default() -> Self {
        Self {
            seed: 1,
            from_unix_ns: 1_781_942_400_000_000_000, // 2026-06-20T08:00Z
            duration_s: 3600.0,
            frames_per_s: 15.0,
            slant_m: 100.0,
            bias_mrad: [0.2, -0.1],
            calm_mrad: 0.5,
            gust_mrad: 1.0,
            memory_s: 0.3,
            wind_m_s: [0.0, 15.0],
            wind_period_s: 600.0,
            sigma_m: 0.005,
            empty: 0.0,
        }
    }
}

/// Swing of a component at a wind \[mrad\].
fn swing_mrad(campaign: &Campaign, wind_m_s: f64) -> f64 {
    campaign.calm_mrad + campaign.gust_mrad * (wind_m_s / 10.0) * (wind_m_s / 10.0)
}

impl Campaign {
    /// The spots and the weather.
    ///
    /// ```
    /// let campaign = helio_spot::accuracy::simulate::Campaign { duration_s: 10.0, ..Default::default() };
    /// let (spots, weather) = campaign.simulate();
    /// assert_eq!((spots.len(), weather.unix_ns.len()), (150, 12));
    /// ```
    #[must_use]
    pub fn simulate(&self) -> (Vec<SpotRow>, Weather) {
        let mut dice = Dice::new(self.seed);
        let seconds = self.duration_s.clamp(0.0, 1e7);
        let mut weather = Weather {
            unix_ns: Vec::new(),
            wind_m_s: vec![Vec::new()],
            dni_w_m2: Some(Vec::new()),
            air_temperature_c: Some(Vec::new()),
        };
        for second in 0..=libm::ceil(seconds) as i64 + 1 {
            let at_s = second as f64;
            weather
                .unix_ns
                .push(self.from_unix_ns + second * 1_000_000_000);
            weather.wind_m_s[0].push(self.wind_at(at_s));
            let slow = libm::sin(TAU * at_s / 7200.0);
            weather
                .dni_w_m2
                .get_or_insert_default()
                .push(820.0 + 60.0 * slow);
            weather
                .air_temperature_c
                .get_or_insert_default()
                .push(24.0 + 3.0 * slow);
        }
        let kept = if self.memory_s > 0.0 {
            libm::exp(-1.0 / (self.frames_per_s * self.memory_s))
        } else {
            0.0
        };
        let fresh = libm::sqrt(1.0 - kept * kept);
        let mut swing = [dice.normal(), dice.normal()];
        let m_per_mrad = 1e-3 * self.slant_m;
        let frames = (seconds * self.frames_per_s).clamp(0.0, 1e8) as usize;
        let spots = (0..frames)
            .map(|frame| {
                let at_s = frame as f64 / self.frames_per_s;
                let sigma_mrad = swing_mrad(self, self.wind_at(at_s));
                let mut spot_m = [0.0; 2];
                for ((spot, swing), bias) in spot_m.iter_mut().zip(&mut swing).zip(self.bias_mrad) {
                    *swing = kept * *swing + fresh * dice.normal();
                    *spot =
                        (bias + sigma_mrad * *swing) * m_per_mrad + self.sigma_m * dice.normal();
                }
                let empty = dice.uniform() < self.empty;
                SpotRow {
                    unix_ns: Some(self.from_unix_ns + libm::round(at_s * 1e9) as i64),
                    spot_m: (!empty).then_some(spot_m),
                    sigma_m: (!empty && self.sigma_m > 0.0).then_some(self.sigma_m),
                    status: Some(if empty {
                        SpotStatus::Empty
                    } else {
                        SpotStatus::Ok
                    }),
                }
            })
            .collect();
        (spots, weather)
    }

    /// Straight up and down, so that all wind speeds last as long.
    fn wind_at(&self, at_s: f64) -> f64 {
        let part = at_s / self.wind_period_s;
        let part = part - libm::floor(part);
        let up = 1.0 - (2.0 * part - 1.0).abs();
        self.wind_m_s[0] + (self.wind_m_s[1] - self.wind_m_s[0]) * up
    }

    /// The true share of frames within an angle while the wind lies within a range, each wind for as long as
    /// the others; of a campaign without bias (the error then follows Rayleigh's distribution), with the scatter
    /// of the centres in it.
    #[must_use]
    pub fn share_without_bias(&self, angle_mrad: f64, from_m_s: f64, to_m_s: f64) -> f64 {
        const STEPS: usize = 2000;
        let centre_mrad = self.sigma_m / self.slant_m * 1e3;
        let sum: f64 = (0..STEPS)
            .map(|k| {
                let part = (k as f64 + 0.5) / STEPS as f64;
                let swing = swing_mrad(self, from_m_s + (to_m_s - from_m_s) * part);
                let variance = swing * swing + centre_mrad * centre_mrad;
                -libm::expm1(-0.5 * angle_mrad * angle_mrad / variance)
            })
            .sum();
        sum / STEPS as f64
    }
}

/// Random numbers that are the same everywhere: splitmix64 (Steele, Lea and Flood 2014).
pub(super) struct Dice(u64);

impl Dice {
    pub(super) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Evenly in [0, 1).
    pub(super) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// With mean 0 and standard deviation 1 (Box and Muller 1958).
    pub(super) fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        radius * libm::cos(TAU * self.uniform())
    }
}
