//! The weather at the time of a frame.

use super::AccuracyError;

/// A weather record: times ascending, columns of the same length, NaN where a cell is empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Weather {
    /// Times \[ns of Unix time\], each later than the one before.
    pub unix_ns: Vec<i64>,
    /// Wind speed \[m/s\] of each anemometer; the wind of a frame is their mean.
    pub wind_m_s: Vec<Vec<f64>>,
    /// Direct normal irradiance \[W/m²\]; `None` if it was not recorded.
    pub dni_w_m2: Option<Vec<f64>>,
    /// Air temperature \[°C\]; `None` if it was not recorded.
    pub air_temperature_c: Option<Vec<f64>>,
}

impl Weather {
    pub(super) fn check(&self) -> Result<(), AccuracyError> {
        let rows = self.unix_ns.len();
        let columns = self.wind_m_s.iter().map(|column| ("the wind", column));
        let columns = columns
            .chain(
                self.dni_w_m2
                    .iter()
                    .map(|column| ("the irradiance", column)),
            )
            .chain(
                self.air_temperature_c
                    .iter()
                    .map(|column| ("the air temperature", column)),
            );
        for (what, column) in columns {
            if column.len() != rows {
                return Err(AccuracyError::Length {
                    what,
                    wanted: rows,
                    found: column.len(),
                });
            }
        }
        match self.unix_ns.windows(2).position(|pair| pair[0] >= pair[1]) {
            Some(row) => Err(AccuracyError::WeatherOrder { row: row + 1 }),
            None => Ok(()),
        }
    }
}

/// Looks up a column at ascending times, each as a straight line between its neighbours with a number.
pub(super) struct Column<'a> {
    unix_ns: &'a [i64],
    values: &'a [f64],
    gap_ns: i64,
    /// The last row with a number that is not later than the last time asked for.
    before: Option<usize>,
    next: usize,
}

impl<'a> Column<'a> {
    pub(super) fn new(unix_ns: &'a [i64], values: &'a [f64], gap_ns: i64) -> Self {
        Self {
            unix_ns,
            values,
            gap_ns,
            before: None,
            next: 0,
        }
    }

    /// The value at a time, which must not be earlier than the last one asked for; `None` outside the record
    /// and where the neighbours lie further apart than the gap.
    pub(super) fn at(&mut self, unix_ns: i64) -> Option<f64> {
        while let Some(&time) = self.unix_ns.get(self.next) {
            let there = self.values[self.next].is_finite();
            if time > unix_ns && there {
                break;
            }
            if there {
                self.before = Some(self.next);
            }
            self.next += 1;
        }
        let before = self.before?;
        let (from, low) = (self.unix_ns[before], self.values[before]);
        if from == unix_ns {
            return Some(low);
        }
        let (to, high) = (*self.unix_ns.get(self.next)?, self.values[self.next]);
        let span = to.checked_sub(from)?;
        if span > self.gap_ns {
            return None;
        }
        let part = (unix_ns - from) as f64 / span as f64;
        Some(low + (high - low) * part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    #[test]
    fn lines_between_neighbours() {
        let times = [0, 10 * S, 20 * S, 30 * S, 100 * S];
        let wind = [1.0, 3.0, f64::NAN, 5.0, 6.0];
        let mut column = Column::new(&times, &wind, 20 * S);
        assert_eq!(column.at(-S), None, "before the record");
        assert_eq!(column.at(0), Some(1.0));
        assert_eq!(column.at(5 * S), Some(2.0));
        assert_eq!(column.at(10 * S), Some(3.0));
        assert_eq!(column.at(25 * S), Some(4.5), "over an empty cell");
        assert_eq!(column.at(30 * S), Some(5.0));
        assert_eq!(column.at(31 * S), None, "a gap");
        assert_eq!(column.at(100 * S), Some(6.0));
        assert_eq!(column.at(101 * S), None, "after the record");
        let mut narrow = Column::new(&times, &wind, 19 * S);
        assert_eq!(narrow.at(25 * S), None);
    }

    #[test]
    fn times_must_ascend() {
        let weather = Weather {
            unix_ns: vec![0, 5, 5],
            wind_m_s: vec![vec![1.0; 3]],
            ..Weather::default()
        };
        assert_eq!(weather.check(), Err(AccuracyError::WeatherOrder { row: 2 }));
        let short = Weather {
            unix_ns: vec![0, 5],
            wind_m_s: vec![vec![1.0; 3]],
            ..Weather::default()
        };
        assert!(short.check().is_err());
    }
}
