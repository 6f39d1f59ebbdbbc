//! What a guideline demands, as a table that can be replaced.

use super::AccuracyError;

/// The share of frames within the angle that is wanted at a wind speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShareLimit {
    /// Wind speed \[m/s\].
    pub wind_m_s: f64,
    /// The share, 0 to 1, that must be exceeded.
    pub share: f64,
}

/// The numbers of a guideline. [`Limits::grlm`] has those of T/GRLM 02-2014; another guideline is another
/// table of the same kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// What the guideline is called.
    pub name: String,
    /// The angle within which frames are counted \[mrad\], itself included.
    pub angle_mrad: f64,
    /// Shares wanted, by ascending wind.
    pub shares: Vec<ShareLimit>,
    /// Direct normal irradiance above which frames count \[W/m²\], itself not included.
    pub least_dni_w_m2: f64,
    /// Coldest and warmest air \[°C\], both included.
    pub air_temperature_c: [f64; 2],
    /// Wind speeds that the campaign must cover \[m/s\].
    pub wind_m_s: [f64; 2],
    /// Least bits of a pixel.
    pub camera_bits: f64,
    /// Least frames per second.
    pub camera_frames_per_s: f64,
    /// Least width and height of a frame \[px\].
    pub camera_px: [f64; 2],
}

impl Limits {
    /// T/GRLM 02-2014: clauses 5.3, 6.1 and 8.2.
    ///
    /// ```
    /// let limits = helio_spot::accuracy::Limits::grlm();
    /// assert_eq!(limits.shares[1].wind_m_s, 8.0);
    /// assert_eq!(limits.shares[1].share, 0.62);
    /// ```
    #[must_use]
    pub fn grlm() -> Self {
        let at = |wind_m_s, share| ShareLimit { wind_m_s, share };
        Self {
            name: "T/GRLM 02-2014".to_owned(),
            angle_mrad: 3.5,
            shares: vec![at(4.0, 0.99), at(8.0, 0.62), at(11.0, 0.33)],
            least_dni_w_m2: 300.0,
            air_temperature_c: [-30.0, 50.0],
            wind_m_s: [0.0, 14.0],
            camera_bits: 8.0,
            camera_frames_per_s: 15.0,
            camera_px: [768.0, 576.0],
        }
    }

    pub(super) fn check(&self) -> Result<(), AccuracyError> {
        let bad = |what, wanted, value| {
            Err(AccuracyError::Bad {
                what,
                wanted,
                value,
            })
        };
        if !(self.angle_mrad > 0.0 && self.angle_mrad.is_finite()) {
            return bad("the angle of the limits", "above 0 mrad", self.angle_mrad);
        }
        if self.shares.is_empty() {
            return bad("the number of shares of the limits", "at least 1", 0.0);
        }
        let mut before = -1.0;
        for limit in &self.shares {
            if !(limit.share > 0.0 && limit.share < 1.0) {
                return bad("a share of the limits", "between 0 and 1", limit.share);
            }
            if !(limit.wind_m_s > before && limit.wind_m_s >= 0.0 && limit.wind_m_s.is_finite()) {
                let wanted = "at least 0 m/s, and more than the one before";
                return bad("a wind speed of the limits", wanted, limit.wind_m_s);
            }
            before = limit.wind_m_s;
        }
        for (what, [from, to]) in [
            ("the air temperatures of the limits", self.air_temperature_c),
            ("the wind to cover of the limits", self.wind_m_s),
        ] {
            if !(from.is_finite() && to.is_finite() && from < to) {
                return bad(what, "two numbers in ascending order", from);
            }
        }
        if !(self.wind_m_s[0] >= 0.0 && self.wind_m_s[1] <= 100.0) {
            let wanted = "within 0..=100 m/s";
            return bad("the wind to cover of the limits", wanted, self.wind_m_s[1]);
        }
        for (what, value) in [
            ("the irradiance of the limits", self.least_dni_w_m2),
            ("the bits of the limits", self.camera_bits),
            ("the frame rate of the limits", self.camera_frames_per_s),
            ("the frame width of the limits", self.camera_px[0]),
            ("the frame height of the limits", self.camera_px[1]),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return bad(what, "at least 0", value);
            }
        }
        Ok(())
    }
}
