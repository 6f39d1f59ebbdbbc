#![doc = include_str!("../README.md")]

pub mod element;
pub mod error;
mod vector;

pub use element::Element;
pub use error::FluxError;
