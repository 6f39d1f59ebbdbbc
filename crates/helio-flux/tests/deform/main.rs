//! Deformed mirrors against closed forms.

// clippy.toml covers the tests themselves, not their helpers.
#![allow(clippy::unwrap_used)]

mod bending;
mod elements;
mod poses;
mod scene;
mod writing;
