//! Reading files: what is good is understood, what is bad is refused in good words.

// clippy.toml covers the tests themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod angles;
mod any_scene;
mod calibrated;
mod files;
mod foreign;
mod good;
mod joining;
mod messages;
mod observations;
mod robust;
mod scenes;
mod schema;
mod state;
