#![doc = include_str!("../README.md")]

pub mod error;
pub mod image;
pub mod status;

pub use error::SpotError;
pub use image::{Frame, Gray, View};
pub use status::{Flags, SpotStatus};
