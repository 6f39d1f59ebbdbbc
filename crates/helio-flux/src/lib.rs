#![doc = include_str!("../README.md")]

pub mod account;
mod behind;
mod bvh;
pub mod choice;
pub mod convolve;
pub mod deform;
pub mod element;
pub mod error;
pub mod folded_plate;
pub mod gauge;
pub mod heliostats;
pub mod map;
pub mod mesh;
pub mod optics;
mod parallel;
pub mod receiver;
mod sampling;
pub mod sunshape;
pub mod trace;
mod vector;

pub use account::Account;
pub use behind::lit_from_behind_w;
pub use choice::{Choice, Way, Why, choose_way, peak_error, peak_excess, rays_to_repeat};
pub use convolve::{ConvolveOptions, convolve, convolve_watched};
pub use element::Element;
pub use error::FluxError;
pub use folded_plate::FoldedPlate;
pub use heliostats::{Canting, FieldMirrors, HeliostatMirror, field_mirrors, posed_mirrors};
pub use map::FluxMap;
pub use optics::OpticalError;
pub use parallel::Watch;
pub use receiver::{Frustum, Hit, MeshReceiver, Plane, Receiver};
pub use sunshape::SunShape;
pub use trace::{
    Origins, RayOptions, RaySet, Rays, Scene, trace_rays, trace_rays_watched, trace_rays_with,
};
