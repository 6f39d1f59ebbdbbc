//! Meshes from files: what is good is understood, what is bad is refused or named and counted.

// clippy.toml covers the tests themselves, not their helpers.
#![allow(clippy::unwrap_used)]

mod corpus;
mod gmsh;
mod messages;
mod mirror;
mod readers;
mod vtk;
mod whole_way;
