#![doc = include_str!("../README.md")]
#![cfg_attr(not(feature = "std"), no_std)]

extern crate alloc;

pub mod angle;
pub mod drive;
pub mod error;
pub mod field;
pub mod frame;
#[doc(hidden)]
pub mod lanes;
pub mod layout;
pub mod mount;
pub mod offset;
mod status;
pub mod sun;
pub mod tracking;

pub use field::{Field, Heliostat};
pub use frame::{Enu, EnuUnit, TargetPlane};
pub use lanes::SimdLevel;
pub use mount::{AxisLimits, MountAxes, MountErrors, PoseErrors, TrackingMode};
pub use offset::OffsetForm;
pub use status::Status;
pub use tracking::{Present, TrackOptions, Tracker, Tracking};
