//! Drives: axis angles to motor steps and back.

use helio_core::drive::{Drive, EncoderDrive, ScrewGeometry, TriangleDrive, TriangleGeometry};
use pyo3::prelude::*;

use crate::array::{Numbers, owned_or_number};
use crate::failure::Failure;
use crate::given::{flag, number};
use crate::guard::guarded;

/// The mechanism that turns one axis: angles to motor steps and back.
///
/// Made by `Drive.encoder`, `Drive.screw` or `Drive.triangle`, or read with a field. Angles are encoder angles
/// of the axis [rad], as `track` gives them; steps are not rounded.
///
/// Examples
/// --------
/// >>> import helio_py as hp
/// >>> import numpy as np
/// >>> drive = hp.Drive.encoder(steps_per_rad=np.degrees(1000.0), zero_steps=500.0)
/// >>> drive.steps(np.radians([0.0, 2.0])).round(6)
/// array([ 500., 2500.])
#[pyclass(frozen, from_py_object, name = "Drive", module = "helio_py")]
#[derive(Debug, Clone, Copy)]
pub(crate) struct PyDrive(pub(crate) Drive);

/// An argument that may be left out.
type Maybe<'a, 'py> = Option<&'a Bound<'py, PyAny>>;
type Range<'a, 'py> = (Maybe<'a, 'py>, Maybe<'a, 'py>);

fn number_or(given: Maybe<'_, '_>, what: &str, default: f64) -> Result<f64, Failure> {
    given.map_or(Ok(default), |given| number(given, what))
}

fn ends((min_steps, max_steps): Range<'_, '_>) -> Result<Option<(f64, f64)>, Failure> {
    if min_steps.is_none() && max_steps.is_none() {
        return Ok(None);
    }
    let min_steps = number_or(min_steps, "min_steps", f64::NEG_INFINITY)?;
    Ok(Some((
        min_steps,
        number_or(max_steps, "max_steps", f64::INFINITY)?,
    )))
}

fn triangle(drive: TriangleDrive, range: Range<'_, '_>) -> Result<PyDrive, Failure> {
    Ok(PyDrive(Drive::Triangle(match ends(range)? {
        Some((min_steps, max_steps)) => drive.with_range(min_steps, max_steps)?,
        None => drive,
    })))
}

impl PyDrive {
    fn each<'py>(
        py: Python<'py>,
        given: &Bound<'py, PyAny>,
        what: &str,
        convert: impl Fn(f64) -> Option<f64> + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        guarded(|| {
            let given = Numbers::of(given, what)?;
            let numbers = given.as_slice()?;
            let convert = |&number: &f64| convert(number).unwrap_or(f64::NAN);
            let done = py.detach(|| numbers.iter().map(convert).collect());
            owned_or_number(py, done, given.shape())
        })
    }
}

#[pymethods]
impl PyDrive {
    /// An encoder or stepper: steps = zero_steps + sign · angle · steps_per_rad.
    ///
    /// Parameters
    /// ----------
    /// steps_per_rad : float
    ///     Above zero.
    /// zero_steps : float, default 0
    ///     Reading at angle zero.
    /// sign : float, default 1
    ///     1, or -1 for one that counts down as the angle grows.
    /// min_steps, max_steps : float, optional
    ///     Ends of the mechanism.
    #[staticmethod]
    #[pyo3(
        signature = (steps_per_rad, *, zero_steps=None, sign=None, min_steps=None, max_steps=None),
        text_signature = "(steps_per_rad, *, zero_steps=0.0, sign=1.0, min_steps=None, max_steps=None)"
    )]
    fn encoder(
        steps_per_rad: &Bound<'_, PyAny>,
        zero_steps: Maybe<'_, '_>,
        sign: Maybe<'_, '_>,
        min_steps: Maybe<'_, '_>,
        max_steps: Maybe<'_, '_>,
    ) -> PyResult<Self> {
        guarded(|| {
            let drive = EncoderDrive::new(
                number(steps_per_rad, "steps_per_rad")?,
                number_or(zero_steps, "zero_steps", 0.0)?,
                number_or(sign, "sign", 1.0)?,
            )?;
            Ok(Self(Drive::Encoder(match ends((min_steps, max_steps))? {
                Some((min_steps, max_steps)) => drive.with_range(min_steps, max_steps)?,
                None => drive,
            })))
        })
    }

    /// A linear screw that closes a triangle (Guo 2013, last page):
    /// x + x0 = sqrt(a² + b² + 2ab cos(angle + bracket)).
    ///
    /// Parameters
    /// ----------
    /// arm_a_m, arm_b_m : float
    ///     Arms of the bracket, a and b [m].
    /// bracket_rad : float
    ///     Bracket angle; angle + bracket must stay between 0 and π.
    /// zero_length_m : float
    ///     Length x0 of the screw at zero steps [m].
    /// steps_per_m : float, default 1
    ///     Steps that lengthen the screw by a metre.
    /// sign : float, default 1
    ///     The axis angle is this times the slide's: 1 or -1.
    /// min_steps, max_steps : float, optional
    ///     Ends of the mechanism.
    #[staticmethod]
    #[pyo3(
        signature = (arm_a_m, arm_b_m, bracket_rad, zero_length_m, *, steps_per_m=None, sign=None, min_steps=None, max_steps=None),
        text_signature = "(arm_a_m, arm_b_m, bracket_rad, zero_length_m, *, steps_per_m=1.0, sign=1.0, min_steps=None, max_steps=None)"
    )]
    fn screw(
        arm_a_m: &Bound<'_, PyAny>,
        arm_b_m: &Bound<'_, PyAny>,
        bracket_rad: &Bound<'_, PyAny>,
        zero_length_m: &Bound<'_, PyAny>,
        steps_per_m: Maybe<'_, '_>,
        sign: Maybe<'_, '_>,
        min_steps: Maybe<'_, '_>,
        max_steps: Maybe<'_, '_>,
    ) -> PyResult<Self> {
        guarded(|| {
            let screw = ScrewGeometry {
                arm_a_m: number(arm_a_m, "arm_a_m")?,
                arm_b_m: number(arm_b_m, "arm_b_m")?,
                bracket_rad: number(bracket_rad, "bracket_rad")?,
                zero_length_m: number(zero_length_m, "zero_length_m")?,
                steps_per_m: number_or(steps_per_m, "steps_per_m", 1.0)?,
                sign: number_or(sign, "sign", 1.0)?,
            };
            triangle(TriangleDrive::from_screw(screw)?, (min_steps, max_steps))
        })
    }

    /// A linear actuator in the parameters of the Jülich actuator tables.
    ///
    /// Parameters
    /// ----------
    /// offset_m, pivot_radius_m : float
    ///     Fixed sides from the axis to the actuator's foot and head [m].
    /// initial_stroke_length_m : float
    ///     Length of the screw at zero steps [m].
    /// initial_angle_rad : float
    ///     The actuator's own angle at zero steps [rad].
    /// steps_per_m : float
    ///     Steps that lengthen the screw by a metre.
    /// clockwise : bool, default False
    ///     True if the angle falls as the screw grows.
    /// sign : float, default 1
    ///     The axis angle is this times the actuator's own: 1 or -1.
    /// min_steps, max_steps : float, optional
    ///     Ends of the mechanism.
    #[staticmethod]
    #[pyo3(
        signature = (offset_m, pivot_radius_m, initial_stroke_length_m, initial_angle_rad, steps_per_m, *, clockwise=None, sign=None, min_steps=None, max_steps=None),
        text_signature = "(offset_m, pivot_radius_m, initial_stroke_length_m, initial_angle_rad, steps_per_m, *, clockwise=False, sign=1.0, min_steps=None, max_steps=None)"
    )]
    fn triangle(
        offset_m: &Bound<'_, PyAny>,
        pivot_radius_m: &Bound<'_, PyAny>,
        initial_stroke_length_m: &Bound<'_, PyAny>,
        initial_angle_rad: &Bound<'_, PyAny>,
        steps_per_m: &Bound<'_, PyAny>,
        clockwise: Maybe<'_, '_>,
        sign: Maybe<'_, '_>,
        min_steps: Maybe<'_, '_>,
        max_steps: Maybe<'_, '_>,
    ) -> PyResult<Self> {
        guarded(|| {
            let geometry = TriangleGeometry {
                offset_m: number(offset_m, "offset_m")?,
                pivot_radius_m: number(pivot_radius_m, "pivot_radius_m")?,
                initial_stroke_length_m: number(
                    initial_stroke_length_m,
                    "initial_stroke_length_m",
                )?,
                initial_angle_rad: number(initial_angle_rad, "initial_angle_rad")?,
                steps_per_m: number(steps_per_m, "steps_per_m")?,
                clockwise: clockwise.map_or(Ok(false), |given| flag(given, "clockwise"))?,
                sign: number_or(sign, "sign", 1.0)?,
            };
            triangle(TriangleDrive::new(geometry)?, (min_steps, max_steps))
        })
    }

    /// Steps, not rounded, that bring the axis to angles [rad] of any shape; NaN where the mechanism
    /// cannot.
    fn steps<'py>(
        &self,
        py: Python<'py>,
        angle_rad: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Self::each(py, angle_rad, "angle_rad", |angle| self.0.steps(angle))
    }

    /// Angles [rad] of the axis at steps of any shape; NaN where the mechanism cannot be.
    fn angle_rad<'py>(
        &self,
        py: Python<'py>,
        steps: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Self::each(py, steps, "steps", |steps| self.0.angle_rad(steps))
    }

    /// Angles [rad] after rounding to whole steps; NaN where the mechanism cannot be.
    fn quantised_rad<'py>(
        &self,
        py: Python<'py>,
        angle_rad: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Self::each(py, angle_rad, "angle_rad", |angle| {
            self.0.quantised_rad(angle)
        })
    }

    /// Least and greatest angle [rad] that the mechanism reaches; infinite where it has no end.
    #[getter]
    fn range_rad(&self) -> (f64, f64) {
        self.0.range_rad()
    }

    /// Made again by `_from_numbers`.
    fn __reduce__<'py>(this: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Vec<f64>,))> {
        let again = this.get_type().getattr("_from_numbers")?;
        Ok((again, (this.get().0.numbers(),)))
    }

    /// What `__reduce__` hands over.
    #[staticmethod]
    fn _from_numbers(numbers: Vec<f64>) -> PyResult<Self> {
        guarded(|| match Drive::from_numbers(&numbers)? {
            Some(drive) => Ok(Self(drive)),
            None => {
                let message = format!("wanted 5 or 10 of them, got {}", numbers.len());
                Err(Failure::of("OptionError", "numbers", message))
            }
        })
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.0 == other.0
    }

    fn __hash__(&self) -> u64 {
        let bits = self.0.numbers();
        // Zeros of either sign are equal.
        bits.iter().fold(0, |hash: u64, number| {
            hash.rotate_left(5).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (number + 0.0).to_bits()
        })
    }

    fn __repr__(&self) -> String {
        let kind = match self.0 {
            Drive::Encoder(_) => "encoder",
            Drive::Triangle(_) => "triangle",
            _ => "drive",
        };
        let (min_rad, max_rad) = self.0.range_rad();
        format!("<Drive {kind}: {min_rad} to {max_rad} rad>")
    }
}
