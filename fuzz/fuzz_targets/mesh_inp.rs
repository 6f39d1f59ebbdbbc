//! Input files of CalculiX and Abaqus, and what becomes of the mesh.
#![no_main]

use libfuzzer_sys::fuzz_target;

#[path = "../../crates/helio-flux/tests/mesh/whole_way.rs"]
mod whole_way;

fuzz_target!(|bytes: &[u8]| whole_way::read("inp", bytes));
