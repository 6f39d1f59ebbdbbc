//! Fields made again: for pickle, and with another calibration.

use std::path::Path;

use helio_io::hash_file;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use super::{Inner, PyField, columns, surroundings};
use crate::failure::Failure;
use crate::table::of_columns;

impl PyField {
    /// The field of the arguments of a call and what [`surroundings::text`] made of its site and targets.
    pub(super) fn from_columns(
        arguments: &Bound<'_, PyDict>,
        surroundings: &str,
        calibration: Option<Py<PyList>>,
    ) -> Result<Self, Failure> {
        let quantities = arguments.copy()?;
        let other = |name: &str| -> PyResult<Option<Bound<'_, PyAny>>> {
            let found = quantities.get_item(name)?;
            if found.is_some() {
                quantities.del_item(name)?;
            }
            Ok(found.filter(|found| !found.is_none()))
        };
        let position = other("position_enu_m")?;
        let position = position
            .ok_or_else(|| Failure::of("MissingError", "position_enu_m", "there is none"))?;
        let (aim_enu_m, aim) = (other("aim_enu_m")?, other("aim")?);
        let (ids, mode, drives) = (other("ids")?, other("mode")?, other("drives")?);
        let [axis_azimuth, latitude] = [other("axis_azimuth_rad")?, other("latitude_rad")?];
        let (axis_azimuth, latitude) = (axis_azimuth.as_ref(), latitude.as_ref());
        let given = columns::Given {
            position_enu_m: &position,
            aim_enu_m: aim_enu_m.as_ref(),
            aim: aim.as_ref(),
            ids: ids.as_ref(),
            mode: columns::mode(mode.as_ref(), axis_azimuth, latitude, None)?,
            drives: drives.as_ref(),
            quantities: Some(&quantities),
        };
        let parts = columns::parts(&given, surroundings::read(surroundings)?)?;
        let field = Self {
            inner: Inner::of_columns(parts, surroundings.to_owned(), None)?,
            calibration: None,
        };
        match calibration {
            Some(calibration) => field.with_calibration(arguments.py(), calibration),
            None => Ok(field),
        }
    }

    /// This field with a table's calibration in the place of the one it has.
    pub(super) fn with_calibration(
        &self,
        py: Python<'_>,
        calibration: Py<PyList>,
    ) -> Result<Self, Failure> {
        let table = of_columns(calibration.bind(py), "calibration")?;
        let inner = match self.inner.read_from() {
            Some((path, hashes)) => {
                let files = &self.inner.loaded().files;
                let now: Result<Vec<String>, _> = files.iter().map(|f| hash_file(f)).collect();
                if now? != hashes {
                    return Err(changed(path, "read"));
                }
                py.detach(|| Inner::load_calibrated(path, &table))?
            }
            None => {
                let parts = self.inner.parts().into_owned();
                let surroundings = self.inner.surroundings().to_owned();
                py.detach(|| Inner::of_columns(parts, surroundings, Some(&table)))?
            }
        };
        Ok(Self {
            inner,
            calibration: Some(calibration),
        })
    }
}

/// Files that are not any more what they were.
pub(super) fn changed(path: &Path, since: &str) -> Failure {
    let message = format!(
        "{}: it, or a table it names, has changed since this field was {since}",
        path.display()
    );
    Failure::new("ConflictError", message)
}
