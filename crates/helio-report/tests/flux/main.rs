//! Figures of flux: their structure against what the numbers say, odd numbers, and figures of real runs, which are also
//! written to the build's temporary folder to be looked at.

#[path = "../common/mod.rs"]
mod common;
mod drawing;
mod hostile;
mod maps;
mod meshes;
mod pages;
mod runs;
mod series;
#[path = "../../examples/stiffness.rs"]
mod stiffness;
