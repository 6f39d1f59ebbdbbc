//! Native part of the Python package `helio_py`: converts, lets go of the interpreter, calls, hands over.
//!
//! The package's own documentation is in its doc strings, which begin here as the comments above each
//! function and class, in the form that Python's readers know (numpydoc).
//!
//! One file per subject: `field`, `track`, `correct`, `verify`, `forward`, `sun`, `drive`, `predict`, `calibrate`, `joint`, `spots`, `accuracy`,
//! `flux`, `simulate`, `paint`, `begin`; below
//! them what they share: `beside` (what both ways of calibrating are asked beside their table), `array` (NumPy in and out), `table` (tables in and out), `rows` (answers as tables), `failure` (errors), `pool` (threads,
//! and forks), `guard` (panics), `slab` (memory of answers), `watch` (progress and Ctrl-C of long work).

#![allow(
    clippy::too_many_arguments,
    reason = "the arguments of a Python function are its keywords"
)]

mod accuracy;
mod array;
mod begin;
mod beside;
mod calibrate;
mod correct;
mod drive;
mod failure;
mod field;
mod flux;
mod forward;
mod given;
mod guard;
mod joint;
mod paint;
mod pool;
mod predict;
mod rows;
mod simulate;
mod slab;
mod spots;
mod sun;
mod table;
mod track;
mod verify;
mod watch;

use pyo3::prelude::*;

/// The native part of `helio_py`; private: import from `helio_py`.
// Not tried without the GIL: a free-threaded interpreter turns it on for us.
#[pymodule(gil_used = true)]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    // NumPy's tables of functions are looked up once: here, where no Ctrl-C in the middle of a call can come between.
    numpy::PyArray1::<f64>::zeros(module.py(), 0, false);
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("_optimised", !cfg!(debug_assertions))?;
    module.add("_simd_level", helio_core::SimdLevel::best().as_str())?;
    module.add_class::<drive::PyDrive>()?;
    module.add_class::<field::PyField>()?;
    module.add_class::<track::PyTracking>()?;
    module.add_function(wrap_pyfunction!(track::track, module)?)?;
    module.add_function(wrap_pyfunction!(forward::forward, module)?)?;
    module.add_function(wrap_pyfunction!(sun::sun_position, module)?)?;
    module.add_function(wrap_pyfunction!(sun::_parse_time, module)?)?;
    module.add_function(wrap_pyfunction!(array::_address_read, module)?)?;
    module.add_function(wrap_pyfunction!(guard::_panic, module)?)?;

    module.add_class::<flux::PyFlux>()?;
    module.add_function(wrap_pyfunction!(flux::_flux_mesh, module)?)?;
    module.add_function(wrap_pyfunction!(flux::_flux_field, module)?)?;
    module.add_function(wrap_pyfunction!(flux::_flux_camera, module)?)?;

    module.add_class::<simulate::PyCampaign>()?;
    module.add_function(wrap_pyfunction!(simulate::_simulate_field, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::_simulate_observations, module)?)?;
    module.add_function(wrap_pyfunction!(paint::_convert_paint, module)?)?;
    module.add_function(wrap_pyfunction!(
        simulate::images::_simulate_images,
        module
    )?)?;
    module.add_function(wrap_pyfunction!(
        simulate::campaign::_simulate_campaign,
        module
    )?)?;
    module.add_function(wrap_pyfunction!(begin::_init, module)?)?;
    module.add_function(wrap_pyfunction!(begin::_schema, module)?)?;
    module.add_function(wrap_pyfunction!(begin::_check_field, module)?)?;

    module.add_function(wrap_pyfunction!(correct::_correct, module)?)?;
    module.add_function(wrap_pyfunction!(verify::_verify, module)?)?;
    module.add_function(wrap_pyfunction!(rows::_tracked_table, module)?)?;

    module.add_function(wrap_pyfunction!(predict::_predict, module)?)?;
    module.add_function(wrap_pyfunction!(predict::_predict_rows, module)?)?;
    module.add_function(wrap_pyfunction!(rows::_landed_table, module)?)?;
    module.add_function(wrap_pyfunction!(rows::_angles, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate::_calibrate, module)?)?;
    module.add_function(wrap_pyfunction!(joint::_calibrate_joint, module)?)?;
    module.add_function(wrap_pyfunction!(table::_write_table, module)?)?;
    module.add_function(wrap_pyfunction!(table::_write_text, module)?)?;

    module.add_function(wrap_pyfunction!(spots::_find_spots, module)?)?;
    module.add_function(wrap_pyfunction!(spots::_find_raw_spots, module)?)?;
    module.add_function(wrap_pyfunction!(spots::_frame_files, module)?)?;
    module.add_function(wrap_pyfunction!(spots::_frame_times, module)?)?;
    module.add_function(wrap_pyfunction!(spots::_pixels_read, module)?)?;
    module.add_class::<accuracy::PyJudged>()?;
    module.add_function(wrap_pyfunction!(accuracy::_accuracy, module)?)?;
    Ok(())
}
