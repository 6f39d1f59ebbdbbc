//! Synthetic campaigns of tracking accuracy: spots and weather.

use helio_spot::accuracy::{Weather, simulate};

use crate::output::{Cells, Destination, Format, write_columns};
use crate::{IoError, SpotRow, write_spots};

/// A campaign as `accuracy` reads it.
#[derive(Debug, Clone)]
pub struct SimulatedCampaign {
    /// What the camera saw, frame by frame.
    pub spots: Vec<SpotRow>,
    /// The weather record.
    pub weather: Weather,
}

impl SimulatedCampaign {
    /// A heliostat that swings in the wind; see [`simulate::Campaign`].
    ///
    /// ```
    /// use helio_io::SimulatedCampaign;
    /// use helio_spot::accuracy::simulate::Campaign;
    /// let seen = SimulatedCampaign::of(&Campaign { duration_s: 10.0, ..Campaign::default() });
    /// assert_eq!((seen.spots.len(), seen.weather.unix_ns.len()), (150, 12));
    /// assert_eq!(seen.spots[149].file, "frame 149");
    /// ```
    #[must_use]
    pub fn of(campaign: &simulate::Campaign) -> Self {
        let (spots, weather) = campaign.simulate();
        let spots = spots.iter().enumerate().map(|(frame, spot)| SpotRow {
            at_m: spot.spot_m,
            sigma_m: spot.sigma_m,
            ..SpotRow::without_position(format!("frame {frame}"), spot.unix_ns, spot.status)
        });
        Self {
            spots: spots.collect(),
            weather,
        }
    }

    /// Writes the spots, as `spot` does.
    ///
    /// # Errors
    /// [`IoError`] if they cannot be written; there is then no file.
    pub fn write_spots(&self, destination: Destination, format: Format) -> Result<(), IoError> {
        write_spots(destination, format, &self.spots)?;
        Ok(())
    }

    /// Writes the weather record.
    ///
    /// # Errors
    /// [`IoError`] if it cannot be written; there is then no file.
    pub fn write_weather(&self, destination: Destination, format: Format) -> Result<(), IoError> {
        let weather = &self.weather;
        let times: Vec<Option<i64>> = weather.unix_ns.iter().copied().map(Some).collect();
        let columns = [
            ("time", Cells::Times(&times)),
            (
                "wind_m_s",
                Cells::Numbers(weather.wind_m_s.first().map_or(&[], Vec::as_slice)),
            ),
            (
                "dni_w_m2",
                Cells::Numbers(weather.dni_w_m2.as_deref().unwrap_or_default()),
            ),
            (
                "air_temperature_c",
                Cells::Numbers(weather.air_temperature_c.as_deref().unwrap_or_default()),
            ),
        ];
        write_columns(destination, format, &columns)?;
        Ok(())
    }
}
