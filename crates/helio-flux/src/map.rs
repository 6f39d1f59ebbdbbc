//! The irradiance of a receiver.

use std::io::{self, Write};

use crate::account::Account;
use crate::error::FluxError;
use crate::receiver::Receiver;

/// Irradiance of every bin of a receiver, and where the rest of the light went.
#[derive(Debug, Clone, PartialEq)]
pub struct FluxMap {
    rows: usize,
    columns: usize,
    irradiance_w_m2: Vec<f64>,
    account: Account,
}

impl FluxMap {
    /// From the power of every bin \[W\].
    pub(crate) fn new(receiver: &Receiver, power_w: &[f64], account: Account) -> Self {
        let irradiance = |(bin, &power): (usize, &f64)| power / receiver.bin_area_m2(bin);
        Self {
            rows: receiver.rows(),
            columns: receiver.columns(),
            irradiance_w_m2: power_w.iter().enumerate().map(irradiance).collect(),
            account,
        }
    }

    /// A map from what [`irradiance_w_m2`](Self::irradiance_w_m2) and [`account`](Self::account) of another said, such
    /// as one that was kept.
    ///
    /// # Errors
    /// [`FluxError::BadValue`] unless there is a number for each bin of the receiver.
    pub fn of_bins(
        receiver: &Receiver,
        irradiance_w_m2: Vec<f64>,
        account: Account,
    ) -> Result<Self, FluxError> {
        if irradiance_w_m2.len() != receiver.bins() {
            return Err(FluxError::BadValue {
                who: "flux map",
                what: "irradiance_w_m2",
                wanted: "as many numbers as the receiver has bins",
                value: irradiance_w_m2.len() as f64,
            });
        }
        Ok(Self {
            rows: receiver.rows(),
            columns: receiver.columns(),
            irradiance_w_m2,
            account,
        })
    }

    /// Rows of the receiver's grid.
    #[must_use]
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Columns of the receiver's grid.
    #[must_use]
    pub const fn columns(&self) -> usize {
        self.columns
    }

    /// Irradiance of the bins \[W/m²\], row by row: power over the true area of each.
    #[must_use]
    pub fn irradiance_w_m2(&self) -> &[f64] {
        &self.irradiance_w_m2
    }

    /// Irradiance of a row's bins \[W/m²\].
    ///
    /// # Panics
    /// If there is no such row.
    #[must_use]
    pub fn row_w_m2(&self, row: usize) -> &[f64] {
        &self.irradiance_w_m2[row * self.columns..(row + 1) * self.columns]
    }

    /// The greatest irradiance \[W/m²\] and its bin; the first of equals.
    #[must_use]
    pub fn peak(&self) -> (f64, usize) {
        let mut peak = (f64::NEG_INFINITY, 0);
        for (bin, &value) in self.irradiance_w_m2.iter().enumerate() {
            if value > peak.0 {
                peak = (value, bin);
            }
        }
        peak
    }

    /// Where the light went.
    #[must_use]
    pub const fn account(&self) -> &Account {
        &self.account
    }
}

/// Writes a map as a legacy VTK file (text) for ParaView and the like: a polygon for each bin, with `flux_w_m2` and
/// `bin`.
///
/// ```
/// use helio_flux::{Element, FluxError, OpticalError, Plane, RayOptions, Receiver, Scene, SunShape, trace_rays};
/// let mirror = [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]];
/// let plane = Plane::new([0.0, 0.0, 10.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [2.0, 2.0], [2, 2])?;
/// let scene = Scene {
///     elements: &[Element::quadrilateral(mirror)?],
///     receiver: &Receiver::Plane(plane),
///     sun: [0.0, 0.0, 1.0],
///     dni_w_m2: 1000.0,
///     sun_shape: &SunShape::pillbox(4.65e-3)?,
///     optical_error: OpticalError::NONE,
/// };
/// let map = trace_rays(&scene, &RayOptions::default())?;
/// let mut file = Vec::new();
/// helio_flux::map::write_vtk(&mut file, scene.receiver, &map)?;
/// assert!(String::from_utf8(file)?.contains("POLYGONS 4 20"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// What `out` says.
pub fn write_vtk(out: &mut impl Write, receiver: &Receiver, map: &FluxMap) -> io::Result<()> {
    let bins = receiver.bins().min(map.irradiance_w_m2.len());
    let corners: Vec<_> = (0..bins).map(|bin| receiver.bin_corners_m(bin)).collect();
    let points: usize = corners.iter().map(Vec::len).sum();
    writeln!(
        out,
        "# vtk DataFile Version 3.0\nirradiance of a receiver, metres and W/m2\nASCII\n\
         DATASET POLYDATA\nPOINTS {points} double"
    )?;
    for [x, y, z] in corners.iter().flatten() {
        writeln!(out, "{x:?} {y:?} {z:?}")?;
    }
    writeln!(out, "POLYGONS {bins} {}", points + bins)?;
    let mut first = 0;
    for corners in &corners {
        write!(out, "{}", corners.len())?;
        for corner in first..first + corners.len() {
            write!(out, " {corner}")?;
        }
        writeln!(out)?;
        first += corners.len();
    }
    writeln!(
        out,
        "CELL_DATA {bins}\nSCALARS flux_w_m2 double 1\nLOOKUP_TABLE default"
    )?;
    for value in &map.irradiance_w_m2[..bins] {
        writeln!(out, "{value:?}")?;
    }
    writeln!(out, "SCALARS bin long 1\nLOOKUP_TABLE default")?;
    for bin in 0..bins {
        writeln!(out, "{bin}")?;
    }
    Ok(())
}
