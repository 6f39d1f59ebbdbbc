//! `simulate_campaign`: the typed call and its answer are in `helio_py._campaign`.

use helio_io::output::{Destination, Format, KeptColumns};
use helio_io::{IoError, SimulatedCampaign};
use helio_spot::accuracy::simulate::Campaign;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::guard::guarded;
use crate::table::handed_out;
use crate::watch::watched_or_left;

/// How a heliostat swings, as the keywords of `simulate_campaign` have it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct SwingAsked {
    seed: u64,
    minutes: u32,
    frames_per_s: u16,
    slant_m: f64,
    calm_mrad: f64,
    gust_mrad: f64,
    memory_s: f64,
    empty: f64,
}

/// Spots and weather of a campaign, as columns.
#[pyfunction]
pub(crate) fn _simulate_campaign(py: Python<'_>, asked: SwingAsked) -> PyResult<Bound<'_, PyDict>> {
    guarded(|| {
        let campaign = Campaign {
            seed: asked.seed,
            duration_s: 60.0 * f64::from(asked.minutes),
            frames_per_s: f64::from(asked.frames_per_s),
            slant_m: asked.slant_m,
            calm_mrad: asked.calm_mrad,
            gust_mrad: asked.gust_mrad,
            memory_s: asked.memory_s,
            empty: asked.empty,
            ..Campaign::default()
        };
        let kept = watched_or_left(py, None, move |_| {
            let seen = SimulatedCampaign::of(&campaign);
            let (spots, weather) = (KeptColumns::default(), KeptColumns::default());
            seen.write_spots(Destination::Columns(spots.clone()), Format::Csv)?;
            seen.write_weather(Destination::Columns(weather.clone()), Format::Csv)?;
            Ok::<_, IoError>((spots.take(), weather.take()))
        })?;
        let (spots, weather) = kept?;
        let dict = PyDict::new(py);
        dict.set_item("spots", handed_out(py, spots)?)?;
        dict.set_item("weather", handed_out(py, weather)?)?;
        Ok(dict)
    })
}
