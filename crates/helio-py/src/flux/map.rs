//! `Flux`: the irradiance of a receiver, and where the rest of the light went.

use std::ffi::OsStr;
use std::path::Path;

use helio_core::Status;
use helio_flux::deform::{write_csv, write_vtk as write_slopes_vtk};
use helio_flux::map::write_vtk;
use helio_flux::mesh::Mirror;
use helio_flux::{FluxMap, Receiver};
use helio_io::output::{Destination, Format, KeptColumns};
use helio_io::{DeformedMirror, FluxScene, write_file_with, write_flux_map};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;

use super::kept::{self, Kept};
use crate::array::owned;
use crate::failure::Failure;
use crate::given;
use crate::guard::guarded;
use crate::table::given_back;

/// Irradiance of every bin of a receiver, and where the rest of the light went: what `flux` returns.
///
/// Rows and columns are those of the receiver as a camera facing its lit side sees it: rows from the top, columns
/// from the left. A receiver that is a mesh has one row, and a column for each triangle. Places are in the frame of
/// the mirrors: that of the model for a mesh, east, north, up for a field.
#[pyclass(frozen, name = "Flux", module = "helio_py")]
pub(crate) struct PyFlux {
    pub(super) receiver: Receiver,
    pub(super) map: FluxMap,
    pub(super) dni_w_m2: f64,
    pub(super) status: Option<Vec<u8>>,
    pub(super) slopes: Option<(DeformedMirror, Mirror)>,
    pub(super) warnings: Vec<String>,
}

/// Names of the axes of a field's frame, and of that of a mesh.
const OF_FIELD: [&str; 3] = ["east_m", "north_m", "up_m"];
const OF_MESH: [&str; 3] = ["x_m", "y_m", "z_m"];

impl PyFlux {
    pub(super) fn of_field(scene: FluxScene, map: FluxMap, status: Vec<Status>) -> Self {
        let status = status.into_iter().map(|status| status as u8).collect();
        Self::new(scene, map, Some(status), Vec::new())
    }

    pub(super) fn of_mesh(scene: FluxScene, map: FluxMap, warnings: Vec<String>) -> Self {
        Self::new(scene, map, None, warnings)
    }

    fn new(scene: FluxScene, map: FluxMap, status: Option<Vec<u8>>, more: Vec<String>) -> Self {
        let mut warnings = scene.warnings;
        warnings.extend(more);
        Self {
            receiver: scene.receiver,
            map,
            dni_w_m2: scene.sun.dni_w_m2,
            status,
            slopes: None,
            warnings,
        }
    }

    pub(super) fn add_slopes(&mut self, slopes: Option<(DeformedMirror, Mirror)>) {
        self.slopes = slopes;
    }

    fn axes(&self) -> [&'static str; 3] {
        if self.status.is_some() {
            OF_FIELD
        } else {
            OF_MESH
        }
    }

    fn grid(&self) -> [usize; 2] {
        [self.receiver.rows(), self.receiver.columns()]
    }

    fn column<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(usize) -> f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        guarded(|| {
            let numbers = (0..self.receiver.bins()).map(of).collect();
            owned(py, numbers, &self.grid())
        })
    }

    fn uv_m(&self, axis: usize) -> impl Fn(usize) -> f64 + '_ {
        move |bin| self.receiver.bin_uv_m(bin).map_or(f64::NAN, |uv| uv[axis])
    }
}

#[pymethods]
impl PyFlux {
    /// Irradiance of the bins [W/m²], of shape (rows, columns): a copy.
    #[getter]
    fn flux_w_m2<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        guarded(|| owned(py, self.map.irradiance_w_m2().to_vec(), &self.grid()))
    }

    /// Rows and columns of the receiver's grid.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.receiver.rows(), self.receiver.columns())
    }

    /// Areas of the bins [m²], of shape (rows, columns): a copy.
    #[getter]
    fn area_m2<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, |bin| self.receiver.bin_area_m2(bin))
    }

    /// How far right the middle of each bin is on the receiver laid flat [m], of shape (rows, columns): a copy. On a
    /// plane it counts from the centre, on a cylinder or cone it is the arc from where the first column begins; NaN on a
    /// mesh.
    #[getter]
    fn u_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, self.uv_m(0))
    }

    /// How far down it is [m]: from the centre of a plane, from the upper edge of a cylinder or cone; NaN on a mesh.
    #[getter]
    fn v_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, self.uv_m(1))
    }

    /// Middle of each bin in space [m], of shape (rows, columns, 3): a copy.
    #[getter]
    fn centre_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        guarded(|| {
            let bins = 0..self.receiver.bins();
            let flat = bins.flat_map(|bin| self.receiver.bin_centre_m(bin));
            let [rows, columns] = self.grid();
            owned(py, flat.collect::<Vec<f64>>(), &[rows, columns, 3])
        })
    }

    /// The greatest irradiance [W/m²].
    #[getter]
    fn peak_w_m2(&self) -> f64 {
        self.map.peak().0
    }

    /// Row and column of the greatest irradiance; the first of equals.
    #[getter]
    fn peak_bin(&self) -> (usize, usize) {
        let bin = self.map.peak().1;
        (bin / self.receiver.columns(), bin % self.receiver.columns())
    }

    /// Power received over the receiver's area [W/m²].
    #[getter]
    fn mean_w_m2(&self) -> f64 {
        self.map.account().received_w / self.receiver.area_m2()
    }

    /// Direct normal irradiance that the mirrors were lit with [W/m²].
    #[getter]
    fn dni_w_m2(&self) -> f64 {
        self.dni_w_m2
    }

    /// Where the light went: a `FluxAccount`.
    #[getter]
    fn account<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        static CLASS: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let a = self.map.account();
        CLASS.import(py, "helio_py._flux", "FluxAccount")?.call1((
            a.mirror_w,
            a.incoming_w,
            a.shaded_w,
            a.reflection_loss_w,
            a.blocked_w,
            a.spilled_w,
            a.received_w,
            a.rays,
            a.turned_away,
        ))
    }

    /// Status of each heliostat of a field, of shape (n,), numbers of `Status`: a copy. None for a mesh.
    #[getter]
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        guarded(|| {
            let Some(status) = &self.status else {
                return Ok(None);
            };
            Ok(Some(owned(py, status.clone(), &[status.len()])?))
        })
    }

    /// How far the load of a mesh turns the normals of its faces: a `SlopeErrors`; None without a load.
    #[getter]
    fn slopes<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        static CLASS: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        guarded(|| {
            let Some((shape, _)) = &self.slopes else {
                return Ok(None);
            };
            let slopes = &shape.slopes;
            let faces = slopes.area_m2().len();
            let column = |numbers: &[f64]| owned(py, numbers.to_vec(), &[faces]);
            let words = shape.deformed.status().iter().map(|status| status.word());
            let found = CLASS.import(py, "helio_py._flux", "SlopeErrors")?.call1((
                owned(py, slopes.element_ids().to_vec(), &[faces])?,
                column(slopes.area_m2())?,
                column(slopes.total_rad())?,
                column(slopes.first_rad())?,
                column(slopes.second_rad())?,
                column(slopes.moved_m())?,
                words.collect::<Vec<_>>(),
                slopes.rms_rad(),
                slopes.rms_first_rad(),
                slopes.rms_second_rad(),
            ))?;
            Ok(Some(found))
        })
    }

    /// Things worth saying about scene and mesh, that stop nothing.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// The table that `helio-rs flux --out` writes, a row for each bin: `row, column, u_m, v_m`, the middle of the bin
    /// (`x_m, y_m, z_m` for a mesh, `east_m, north_m, up_m` for a field), `area_m2, flux_w_m2`; as "dict" (of arrays),
    /// "pandas", "polars" or "pyarrow".
    #[pyo3(
        signature = (kind=None),
        text_signature = "($self, kind='dict')"
    )]
    fn to_table<'py>(
        &self,
        py: Python<'py>,
        kind: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        guarded(|| {
            let kind = given::text_or(kind, "kind", "dict")?;
            let kept = KeptColumns::default();
            let destination = Destination::Columns(kept.clone());
            write_flux_map(
                destination,
                Format::Csv,
                &self.receiver,
                &self.map,
                self.axes(),
            )?;
            given_back(py, kept.take(), &kind)
        })
    }

    /// Writes the map as `helio-rs flux --out` does, by the suffix of the path: .csv, .parquet, .json, .jsonl, or .vtk
    /// for ParaView. The file appears whole or not at all.
    #[pyo3(signature = (path))]
    fn write(&self, path: &Bound<'_, PyAny>) -> PyResult<()> {
        guarded(|| {
            let py = path.py();
            let path = given::path(path, "path")?;
            py.detach(|| {
                if suffix_is(&path, "vtk") {
                    write_file_with(&path, |out| write_vtk(out, &self.receiver, &self.map))?;
                    return Ok(());
                }
                let Some(format) = Format::of_path(&path) else {
                    let message = format!(
                        "{}: the suffix stands for no format; wanted .csv, .parquet, .json, .jsonl or .vtk",
                        path.display()
                    );
                    return Err(Failure::of("OptionError", "path", message));
                };
                let destination = Destination::File(path);
                write_flux_map(destination, format, &self.receiver, &self.map, self.axes())?;
                Ok(())
            })
        })
    }

    /// Writes the slope errors as `helio-rs flux --slopes` does: .csv, or .vtk for ParaView.
    #[pyo3(signature = (path))]
    fn write_slopes(&self, path: &Bound<'_, PyAny>) -> PyResult<()> {
        guarded(|| {
            let py = path.py();
            let path = given::path(path, "path")?;
            let Some((shape, mirror)) = &self.slopes else {
                let message = "there are no slope errors: the mirror is no mesh with displacements";
                return Err(Failure::new("OptionError", message));
            };
            py.detach(|| {
                if suffix_is(&path, "vtk") {
                    write_file_with(&path, |out| write_slopes_vtk(out, mirror, &shape.slopes))?;
                } else if suffix_is(&path, "csv") {
                    write_file_with(&path, |out| write_csv(out, &shape.deformed, &shape.slopes))?;
                } else {
                    let message = format!("{}: wanted .csv or .vtk", path.display());
                    return Err(Failure::of("OptionError", "path", message));
                }
                Ok(())
            })
        })
    }

    /// What it holds, as numbers and arrays: the same to the last bit after a journey to another process.
    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyDict>,))> {
        let kept = guarded(|| kept::kept(slf.py(), slf.get()))?;
        Ok((slf.get_type().getattr("_from_kept")?, (kept,)))
    }

    /// What `__reduce__` handed over.
    #[staticmethod]
    fn _from_kept(kept: Kept) -> PyResult<Self> {
        guarded(|| kept.flux())
    }

    /// Itself: a flux does not change.
    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    /// Itself.
    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        let [rows, columns] = self.grid();
        format!(
            "<Flux of {rows} by {columns} bins, peak {:.1} W/m²>",
            self.map.peak().0
        )
    }
}

fn suffix_is(path: &Path, wanted: &str) -> bool {
    let suffix = path.extension().map(OsStr::to_ascii_lowercase);
    suffix.is_some_and(|suffix| suffix == wanted)
}
