//! `flux`: irradiance on a receiver. The typed call is `helio_py._flux.flux`; here is one entry for each kind of mirrors.

mod camera;
mod field;
mod kept;
mod map;
mod mesh;
mod scene;

pub(crate) use camera::_flux_camera;
pub(crate) use field::_flux_field;
pub(crate) use map::PyFlux;
pub(crate) use mesh::_flux_mesh;
