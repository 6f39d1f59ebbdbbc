//! Which of a file's vectors are displacements.

use super::error::{ReadError, ReadProblem, quoted};
use super::text::{Source, lossy};

/// Which vectors of the nodes are their displacements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Vectors<'a> {
    /// Those named `displacement`, `displacements`, `displacement_m`, `disp` or `u`, whatever the case; none
    /// if there are none of these names. Of several steps the last.
    #[default]
    Displacement,
    /// Those of this name.
    Named(&'a str),
}

impl Vectors<'_> {
    pub(crate) fn wants(&self, name: &str) -> bool {
        match self {
            Self::Displacement => {
                let known = [
                    "displacement",
                    "displacements",
                    "displacement_m",
                    "disp",
                    "u",
                ];
                known.iter().any(|known| name.eq_ignore_ascii_case(known))
            }
            Self::Named(wanted) => name == *wanted,
        }
    }

    /// Names that were asked for must be there.
    pub(crate) fn check(
        &self,
        source: &Source<'_>,
        found: bool,
        known: &[String],
    ) -> Result<(), ReadError> {
        match self {
            Self::Named(name) if !found => {
                let known: Vec<_> = known.iter().take(8).cloned().collect();
                Err(source.whole(ReadProblem::Missing {
                    what: format!("a vector of the nodes named {}", quoted(name)),
                    wanted: format!("one of [{}]", lossy(known.join(", ").as_bytes())),
                }))
            }
            _ => Ok(()),
        }
    }
}
