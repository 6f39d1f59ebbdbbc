#![doc = include_str!("../README.md")]

pub mod accuracy;
pub mod error;
pub mod image;
pub mod robust;
mod simd;
pub mod simulate;
pub mod status;
pub mod target;
pub mod threshold;
pub mod window;

pub use error::SpotError;
pub use image::{
    DecodeError, Frame, Gray, Limits, Picture, RawFormat, RawVideo, VideoError, View, decode,
    is_decoding,
};
pub use robust::{Candidate, Refusal, RobustOptions, Spot, SpotScratch, find_spot};
pub use simulate::SimulatedFrame;
pub use status::{Flags, SpotStatus};
pub use target::{
    Board, Corner, Corners, CornersError, Expected, FindOptions, Homography, Lens, LensError,
    LensValues, MarkScratch, MarkSize, Marks, Plane, find_corners,
};
pub use threshold::{Histogram, Threshold};
pub use window::{Scratch, StandardOptions, StandardSpot, standard};
