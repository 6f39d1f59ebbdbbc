//! Rows of suns and heliostats as the columns of a table in memory.

use helio_core::Status;

use super::rows::Checked;
use super::{KeptCells, Layout, Moments, Rows, Scale};
use crate::IoError;

/// The columns that [`TableWriter`](super::TableWriter) would write of a block, to go on computing with them.
///
/// # Errors
/// [`IoError`] for columns that do not fit together.
///
/// ```
/// use helio_core::Status;
/// use helio_io::output::{KeptCells, Layout, Moment, Moments, Number, Rows, kept_rows};
/// let layout = Layout {
///     ids: vec!["A1".into(), "A2".into()],
///     moment: Moment::Time,
///     numbers: vec![Number::degrees("azimuth_deg")],
/// };
/// let columns = kept_rows(&layout, &Rows {
///     moments: Moments::Times { unix_ns: &[0] },
///     ends: None,
///     heliostats: None,
///     numbers: &[&[std::f64::consts::PI, 1.0]],
///     status: &[Status::Ok, Status::Unreachable],
/// })?;
/// assert_eq!(columns[0], ("time".to_owned(), KeptCells::Times(vec![Some(0), Some(0)])));
/// let KeptCells::Numbers(azimuth_deg) = &columns[2].1 else { return Err("no numbers".into()) };
/// assert!(azimuth_deg[0] == 180.0 && azimuth_deg[1].is_nan());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn kept_rows(layout: &Layout, rows: &Rows<'_>) -> Result<Vec<(String, KeptCells)>, IoError> {
    let checked = Checked::new(layout, rows)?;
    let len = checked.len();
    let mut sun_of = Vec::with_capacity(len);
    for (sun, part) in checked.suns(0..len) {
        sun_of.resize(sun_of.len() + part.len(), sun);
    }
    let of_suns = |column: &[f64]| KeptCells::Numbers(sun_of.iter().map(|&s| column[s]).collect());
    let mut columns = match checked.moments {
        Moments::Times { unix_ns } => {
            let times = sun_of.iter().map(|&sun| Some(unix_ns[sun])).collect();
            vec![("time".to_owned(), KeptCells::Times(times))]
        }
        Moments::SunAngles {
            azimuth_deg,
            elevation_deg,
        } => vec![
            ("sun_azimuth_deg".to_owned(), of_suns(azimuth_deg)),
            ("sun_elevation_deg".to_owned(), of_suns(elevation_deg)),
        ],
    };
    let ids = (0..len).map(|row| layout.ids[checked.heliostat(row)].clone());
    columns.push(("id".to_owned(), KeptCells::Text(ids.collect())));
    for (number, column) in layout.numbers.iter().zip(checked.numbers) {
        let cell = |(&value, &status): (&f64, &Status)| {
            let written = number.scale.apply(value);
            let there = number.carried_by(status) && written.is_finite();
            there.then_some(written)
        };
        let cells = column.iter().zip(checked.status).map(cell);
        let cells = match number.scale {
            Scale::Whole => KeptCells::Whole(cells.map(|c| c.map(|c| c as i64)).collect()),
            _ => KeptCells::Numbers(cells.map(|c| c.unwrap_or(f64::NAN)).collect()),
        };
        columns.push((number.name.clone(), cells));
    }
    let words = checked.status.iter().map(|s| s.as_str().to_owned());
    columns.push(("status".to_owned(), KeptCells::Text(words.collect())));
    Ok(columns)
}
