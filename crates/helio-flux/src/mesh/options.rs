//! What a reader is told: the unit of lengths, and how much is too much.

use super::error::MeshError;

/// How to read a file of a mesh or of displacements.
///
/// Formats of solvers carry no units: say what one unit of length of the file is. Mechanical models are
/// as often in millimetres as in metres.
///
/// ```
/// use helio_flux::mesh::ReadOptions;
/// let millimetres = ReadOptions::in_units_of(0.001)?;
/// assert_eq!(millimetres.metres_per_unit(), 0.001);
/// assert!(ReadOptions::in_units_of(0.0).is_err());
/// # Ok::<(), helio_flux::mesh::MeshError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadOptions {
    metres_per_unit: f64,
    /// How much is accepted.
    pub limits: Limits,
}

impl ReadOptions {
    /// Lengths of the file in units of so many metres; standard limits.
    ///
    /// # Errors
    /// [`MeshError::BadValue`] unless the unit lies between a nanometre and a thousand kilometres.
    pub fn in_units_of(metres_per_unit: f64) -> Result<Self, MeshError> {
        if !(1e-9..=1e6).contains(&metres_per_unit) {
            return Err(MeshError::BadValue {
                what: "metres_per_unit",
                wanted: "within 1e-9..=1e6",
                value: metres_per_unit,
            });
        }
        Ok(Self {
            metres_per_unit,
            limits: Limits::default(),
        })
    }

    /// One unit of length of the file \[m\].
    #[must_use]
    pub const fn metres_per_unit(&self) -> f64 {
        self.metres_per_unit
    }
}

impl Default for ReadOptions {
    /// Lengths in metres; standard limits.
    fn default() -> Self {
        Self {
            metres_per_unit: 1.0,
            limits: Limits::default(),
        }
    }
}

/// How much of each a file may have. A file that has more is refused before memory is taken for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Bytes of all files together, and of what a compressed part of one unpacks to.
    pub bytes: u64,
    /// Nodes.
    pub nodes: u64,
    /// Elements.
    pub elements: u64,
    /// Members of all sets and surfaces together, sets within sets counted.
    pub set_members: u64,
    /// Files that the first one includes, at any depth.
    pub includes: u64,
}

impl Default for Limits {
    /// A thousand times the mesh of Yan 2022: 4 GB, 50 million nodes, 50 million elements, 50 million
    /// members of sets, 200 included files. What is kept of so much takes some gigabytes of memory.
    fn default() -> Self {
        Self {
            bytes: 4 << 30,
            nodes: 50_000_000,
            elements: 50_000_000,
            set_members: 50_000_000,
            includes: 200,
        }
    }
}
