//! `track`: sun and aim in, axis angles out.

use std::borrow::Cow;
use std::cell::Cell;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use helio_calib::aiming::hour_angle_rad;
use helio_core::error::TrackError;
use helio_core::offset::MAX_ITERATIONS;
use helio_core::tracking::{TrackScratch, TrackingColumns};
use helio_core::{EnuUnit, Field, OffsetForm, Present, Status, TrackOptions, Tracker};
use pyo3::prelude::*;
use pyo3::types::PyString;

use crate::array::{Numbers, float, shape_text, wrong_shape};
use crate::failure::Failure;
use crate::field::{Inner, PyField};
use crate::given;
use crate::guard::guarded;
use crate::pool;
use crate::slab::Slab;
use crate::sun::unix_ns;
pub(crate) use tracking::PyTracking;

mod tracking;

/// Rows below which a call keeps the interpreter: it is done before another thread could take over.
const BRIEF_ROWS: usize = 2048;
/// Rows from which threads share the work.
const SHARED_ROWS: usize = 48 * 1024;
/// Rows computed between two looks at whether the user wants to stop: some milliseconds, and even without wide
/// instructions and with the most iterations of an offset well below a second.
const ROWS_PER_LOOK: usize = 1 << 20;

/// The zenith, and what rounding adds to it.
const HIGHEST_RAD: f64 = FRAC_PI_2 + 1e-9;

/// Axis angles of every heliostat of a field, for one sun or many.
///
/// Shading and blocking are not computed.
///
/// Parameters
/// ----------
/// field : Field
///     The heliostats, n of them.
/// sun_azimuth_rad, sun_elevation_rad : float or array of shape (m,)
///     Where the sun is seen [rad]: azimuth clockwise from north, apparent elevation above the horizon, at most
///     ±π/2. `sun_position` gives both.
/// offset : str, default "exact"
///     How the mirror's offset from the pivot is taken into account: "exact" (Guo 2015 eq. 9 to the last
///     digit), "approximate" (eq. 15), "iterated:N" (Shen 2016, N from 1 to 64) or "none".
/// out : Tracking, optional
///     An answer of the same shape to be written over and returned; arrays got from it change with it.
///     When the call is interrupted, what it holds is part old, part new.
/// present : (array, array) or Tracking, optional
///     Where both axes stand now, encoder angles of shape (n,) [rad]; NaN where it is not known. Of the
///     solutions within the limits the one is given to which the axis that travels farther has the
///     shortest way, and so on from one sun to the next. A Tracking stands for where its last rows with
///     status ok left the axes.
/// continuous : bool, default False
///     The shortest travel from one sun to the next, beginning anywhere.
/// times : optional
///     When each sun is seen, as for `sun_position`, of the suns' shape. Only a calibration that changes
///     with the date looks at it; without it the last span of time counts.
///
/// Returns
/// -------
/// Tracking
///     Columns of shape (n,) for one sun, (m, n) for m suns. A row that has no answer keeps its place,
///     says why in `status` and has NaN for angles.
///
/// Raises
/// ------
/// ShapeError, DataTypeError, SunDirectionError, AngleError, OptionError, BusyError
///
/// Notes
/// -----
/// The interpreter is free for other threads while a call computes more than some thousand rows. Arrays given
/// must not be written to by another thread meanwhile. The same input gives the same bits on any number of
/// threads.
///
/// Examples
/// --------
/// >>> import helio_py as hp
/// >>> import numpy as np
/// >>> field = hp.Field([[0.0, 100.0, 0.0]], [0.0, 0.0, 80.0], mirror_offset_m=0.2)
/// >>> tracking = hp.track(field, np.pi, np.pi / 4)
/// >>> tracking.azimuth_rad.round(12), tracking.status
/// (array([3.14159265]), array([0], dtype=uint8))
#[pyfunction]
#[pyo3(
    signature = (field, sun_azimuth_rad, sun_elevation_rad, offset=None, *, out=None, present=None, continuous=None, times=None),
    text_signature = "(field, sun_azimuth_rad, sun_elevation_rad, offset='exact', *, out=None, present=None, continuous=False, times=None)"
)]
pub(crate) fn track<'py>(
    py: Python<'py>,
    field: &Bound<'py, PyAny>,
    sun_azimuth_rad: &Bound<'py, PyAny>,
    sun_elevation_rad: &Bound<'py, PyAny>,
    offset: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
    present: Option<&Bound<'py, PyAny>>,
    continuous: Option<&Bound<'py, PyAny>>,
    times: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyTracking>> {
    guarded(|| {
        let field = PyField::of(field)?;
        let inner = field.get().inner();
        let suns = Suns::of(sun_azimuth_rad, sun_elevation_rad)?;
        let tracker = inner.tracker(offset.map_or(Ok(OffsetForm::Exact), offset_form)?)?;
        let times = match times {
            Some(times) => Some(suns.times(times)?),
            None => None,
        };
        let continuous = continuous.map_or(Ok(false), |given| given::flag(given, "continuous"))?;
        let mut job = Job {
            tracker: &tracker,
            present: match present {
                Some(present) => Some(place(present, inner.len())?),
                None if continuous => Some([(); 2].map(|()| vec![f64::NAN; inner.len()])),
                None => None,
            },
            changing: Changing::of(inner, &tracker)?,
            times,
            field: inner,
            suns: suns.directions(),
        };
        let shape = (suns.count(), inner.len());
        let answer = match out {
            Some(out) => PyTracking::reused(out, shape)?.clone(),
            None => Bound::new(py, PyTracking::new(shape)?)?,
        };
        {
            let tracking = answer.get();
            let _busy = tracking.occupy()?;
            // SAFETY: `_busy` keeps every other call out of this memory.
            #[allow(unsafe_code)]
            unsafe {
                tracking.slab().begin();
            }
            job.fill(py, tracking.slab())?;
        }
        Ok(answer)
    })
}

/// The suns of a call.
pub(crate) enum Suns {
    One([EnuUnit; 1]),
    Many(Vec<EnuUnit>),
}

impl Suns {
    pub(crate) fn of(
        azimuth_rad: &Bound<'_, PyAny>,
        elevation_rad: &Bound<'_, PyAny>,
    ) -> Result<Self, Failure> {
        if let (Some(azimuth_rad), Some(elevation_rad)) = (float(azimuth_rad), float(elevation_rad))
        {
            return Ok(Self::One([direction(0, azimuth_rad, elevation_rad)?]));
        }
        let azimuth_rad = Numbers::of(azimuth_rad, "sun_azimuth_rad")?;
        let elevation_rad = Numbers::of(elevation_rad, "sun_elevation_rad")?;
        let shape = azimuth_rad.shape();
        if shape.len() > 1 {
            return Err(wrong_shape("sun_azimuth_rad", "() or (m,)", shape));
        }
        if elevation_rad.shape() != shape {
            let wanted = format!("{} as sun_azimuth_rad has", shape_text(shape));
            return Err(wrong_shape(
                "sun_elevation_rad",
                &wanted,
                elevation_rad.shape(),
            ));
        }
        let angles = azimuth_rad
            .as_slice()?
            .iter()
            .zip(elevation_rad.as_slice()?);
        if shape.is_empty()
            && let Some((&azimuth_rad, &elevation_rad)) = angles.clone().next()
        {
            return Ok(Self::One([direction(0, azimuth_rad, elevation_rad)?]));
        }
        let suns: Result<_, _> = angles
            .enumerate()
            .map(|(row, (&azimuth_rad, &elevation_rad))| direction(row, azimuth_rad, elevation_rad))
            .collect();
        Ok(Self::Many(suns?))
    }

    pub(crate) fn directions(&self) -> &[EnuUnit] {
        match self {
            Self::One(sun) => sun,
            Self::Many(suns) => suns,
        }
    }

    /// How many, unless it is the one of a scalar.
    pub(crate) fn count(&self) -> Option<usize> {
        match self {
            Self::One(_) => None,
            Self::Many(suns) => Some(suns.len()),
        }
    }

    pub(crate) fn times(&self, times: &Bound<'_, PyAny>) -> Result<Vec<i64>, Failure> {
        let (times, shape) = unix_ns(times)?;
        let wanted = self.count();
        if shape.as_slice() != wanted.as_slice() {
            let wanted = shape_text(wanted.as_slice());
            return Err(wrong_shape(
                "times",
                &format!("{wanted} as the suns have"),
                &shape,
            ));
        }
        Ok(times.as_slice().map_err(PyErr::from)?.to_vec())
    }
}

/// Where a sun is seen. An elevation beyond the zenith is refused: it is one in degrees; so is an azimuth of more than two
/// turns, which leaves room for one that was unwrapped over a day.
#[inline]
pub(crate) fn direction(
    row: usize,
    azimuth_rad: f64,
    elevation_rad: f64,
) -> Result<EnuUnit, Failure> {
    if azimuth_rad.abs() <= 2.0 * TAU && elevation_rad.abs() <= HIGHEST_RAD {
        return Ok(EnuUnit::from_azimuth_elevation(azimuth_rad, elevation_rad));
    }
    Err(no_direction(row, azimuth_rad, elevation_rad))
}

#[cold]
fn no_direction(row: usize, azimuth_rad: f64, elevation_rad: f64) -> Failure {
    if !(azimuth_rad.is_finite() && elevation_rad.is_finite()) {
        let what = match azimuth_rad.is_finite() {
            true => "sun_elevation_rad",
            false => "sun_azimuth_rad",
        };
        return Failure::from(TrackError::BadSun { row }).with_field(what);
    }
    let (what, wanted, value) = if elevation_rad.abs() <= HIGHEST_RAD {
        ("sun_azimuth_rad", "±4π rad (±720°)", azimuth_rad)
    } else {
        ("sun_elevation_rad", "±π/2 rad (±90°)", elevation_rad)
    };
    let message = format_args!("sun {row} (counted from 0) must be within {wanted}, got {value}");
    Failure::of("SunDirectionError", what, message)
        .with_row(row)
        .with_value(value)
}

fn offset_form(offset: &Bound<'_, PyAny>) -> Result<OffsetForm, Failure> {
    let wanted = "wanted exact, approximate, iterated:N or none";
    let Ok(text) = offset.cast::<PyString>() else {
        let found = offset.get_type();
        return Err(Failure::of(
            "DataTypeError",
            "offset",
            format_args!("{wanted}, got {found}"),
        ));
    };
    let text: Cow<'_, str> = text.to_string_lossy();
    match &*text {
        "exact" => Ok(OffsetForm::Exact),
        "approximate" => Ok(OffsetForm::Approximate),
        "none" => Ok(OffsetForm::None),
        _ => match text.strip_prefix("iterated:").map(str::parse) {
            Some(Ok(times)) if (1..=MAX_ITERATIONS).contains(&times) => {
                Ok(OffsetForm::Iterated(times))
            }
            Some(_) => Err(Failure::of(
                "OptionError",
                "offset",
                format_args!(
                    "iterated: wants a number of iterations in 1..={MAX_ITERATIONS}, such as \
                     iterated:2, got `{text}`"
                ),
            )),
            None => Err(Failure::of(
                "OptionError",
                "offset",
                format_args!("{wanted}, got `{text}`"),
            )),
        },
    }
}

/// Where the axes stand, as copies: the caller may be writing over what they come from.
fn place(present: &Bound<'_, PyAny>, len: usize) -> Result<[Vec<f64>; 2], Failure> {
    if let Ok(tracking) = present.cast::<PyTracking>() {
        return tracking.get().last_place(len);
    }
    let Ok((axis1, axis2)) = present.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>() else {
        let found = present.get_type();
        let wanted = "expected two columns (axis 1, axis 2) or a Tracking";
        return Err(Failure::of(
            "DataTypeError",
            "present",
            format_args!("{wanted}, got {found}"),
        ));
    };
    let column = |value: &Bound<'_, PyAny>, what: &str| {
        let numbers = Numbers::of(value, what)?;
        match *numbers.shape() {
            [found] if found == len => Ok(numbers.as_slice()?.to_vec()),
            _ => Err(wrong_shape(what, &format!("({len},)"), numbers.shape())),
        }
    };
    Ok([
        column(&axis1, "present axis1_rad")?,
        column(&axis2, "present axis2_rad")?,
    ])
}

/// What is computed, block by block.
struct Job<'a> {
    field: &'a Inner,
    tracker: &'a Tracker,
    suns: &'a [EnuUnit],
    times: Option<Vec<i64>>,
    /// Where the axes stand, for shortest travel.
    present: Option<[Vec<f64>; 2]>,
    changing: Option<Changing<'a>>,
}

/// A field whose calibration changes with the hour or the date.
pub(crate) struct Changing<'a> {
    schedule: &'a helio_io::CalibrationSchedule,
    latitude_rad: f64,
    field: Field,
    tracker: Tracker,
}

impl<'a> Changing<'a> {
    pub(crate) fn of(field: &'a Inner, tracker: &Tracker) -> Result<Option<Self>, Failure> {
        let Some((schedule, site)) = field.schedule() else {
            return Ok(None);
        };
        let Some(site) = site else {
            let message = "the calibration changes with the hour angle of the sun, which needs the \
                           latitude from [site]";
            return Err(Failure::new("MissingError", message));
        };
        Ok(Some(Self {
            schedule,
            latitude_rad: site.latitude_rad,
            field: field.field().clone(),
            tracker: tracker.clone(),
        }))
    }

    pub(crate) fn tracker(&self) -> &Tracker {
        &self.tracker
    }

    pub(crate) fn bring_up_to_date(
        &mut self,
        unix_ns: Option<i64>,
        sun: EnuUnit,
    ) -> Result<(), Failure> {
        let hour_rad = hour_angle_rad(sun, self.latitude_rad);
        if self.schedule.update(&mut self.field, unix_ns, hour_rad)? {
            self.tracker = Tracker::new(&self.field, self.tracker.offset())?;
        }
        Ok(())
    }
}

impl Job<'_> {
    fn fill(&mut self, py: Python<'_>, slab: &Slab) -> Result<(), Failure> {
        let n = self.field.len();
        let suns = self.suns.len();
        if self.changing.is_none() && n.saturating_mul(suns) < BRIEF_ROWS {
            return self.block(0..suns, slab, 1);
        }
        // Whole blocks begin on cache lines if the first does.
        let per_block = (ROWS_PER_LOOK / n.max(1)).max(1).next_multiple_of(8);
        for first in (0..suns).step_by(per_block) {
            if first > 0 {
                py.check_signals()?;
            }
            let block = first..suns.min(first + per_block);
            py.detach(|| {
                if block.len() * n >= SHARED_ROWS {
                    pool::run(|| self.block(block, slab, 0))?
                } else {
                    self.block(block, slab, 1)
                }
            })?;
        }
        Ok(())
    }

    /// Some of the suns. One thread stays on the caller's, and asks nobody for others.
    fn block(&mut self, suns: Range<usize>, slab: &Slab, threads: usize) -> Result<(), Failure> {
        if self.changing.is_none() {
            return self.suns(suns, slab, threads);
        }
        for sun in suns {
            let unix_ns = self.times.as_ref().map(|times| times[sun]);
            if let Some(changing) = &mut self.changing {
                changing.bring_up_to_date(unix_ns, self.suns[sun])?;
            }
            self.suns(sun..sun + 1, slab, threads)?;
        }
        Ok(())
    }

    fn suns(&mut self, suns: Range<usize>, slab: &Slab, threads: usize) -> Result<(), Failure> {
        thread_local! {
            static SCRATCH: Cell<Option<TrackScratch>> = const { Cell::new(None) };
        }
        let n = self.field.len();
        let rows = suns.start * n..suns.end * n;
        // SAFETY: the caller of `fill` keeps everybody else out, and blocks come one after another.
        #[allow(unsafe_code)]
        let columns = || unsafe { slab.columns(rows.clone()) };
        let mut scratch = SCRATCH.take().unwrap_or_default();
        let options = TrackOptions {
            threads,
            level: None,
        };
        let present = self.present.as_ref().map(|[axis1_rad, axis2_rad]| Present {
            axis1_rad,
            axis2_rad,
        });
        let tracker = self.changing.as_ref().map_or(self.tracker, |c| &c.tracker);
        let done =
            tracker.track_columns(&self.suns[suns], present, &options, &mut scratch, columns());
        SCRATCH.set(Some(scratch));
        if done? {
            slab.excess_written();
        }
        if let Some(present) = &mut self.present {
            let done = columns();
            move_on(present, &done);
        }
        if self.field.drives_end_early() && self.field.beyond_drives(columns()) {
            slab.excess_written();
        }
        Ok(())
    }
}

/// Each heliostat now stands where its last answer put it.
fn move_on(present: &mut [Vec<f64>; 2], done: &TrackingColumns<'_>) {
    let n = present[0].len();
    for (row, &status) in done.status.iter().enumerate() {
        if status == Status::Ok {
            present[0][row % n] = done.axis1_rad[row];
            present[1][row % n] = done.axis2_rad[row];
        }
    }
}
