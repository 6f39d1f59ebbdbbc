//! The heliostats of a field as mirrors.

use helio_core::{Enu, EnuUnit, Field, OffsetForm, Status, Tracker};

use crate::element::Element;
use crate::error::FluxError;
use crate::vector::{Vector, add, cross, scale, sub, unit};

/// How the facets of a heliostat are tilted toward its middle.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub enum Canting {
    /// Not at all: one flat mirror in pieces.
    #[default]
    Flat,
    /// On the axis, to a focal length \[m\]: tangent to a paraboloid, so that light along the normal meets there.
    FocalLength(f64),
    /// On the axis, to the distance of the heliostat's own aim point.
    ToAim,
}

/// The mirror of a heliostat: a rectangle of equal facets whose width lies along the moving axis.
///
/// ```
/// use helio_flux::{Canting, HeliostatMirror};
/// let mirror = HeliostatMirror {
///     width_m: 11.0,
///     height_m: 10.0,
///     columns: 4,
///     rows: 5,
///     gap_m: 0.02,
///     canting: Canting::ToAim,
///     ..HeliostatMirror::default()
/// };
/// assert_eq!(mirror.columns * mirror.rows, 20);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeliostatMirror {
    /// Along the moving axis \[m\], over all facets.
    pub width_m: f64,
    /// Across it \[m\].
    pub height_m: f64,
    /// Facets side by side along the width.
    pub columns: usize,
    /// Facets side by side along the height.
    pub rows: usize,
    /// Free space between facets \[m\].
    pub gap_m: f64,
    /// How facets are tilted.
    pub canting: Canting,
    /// Flat pieces along each side of a facet: 1 for flat facets; more stand for facets that are themselves curved
    /// like the canting's paraboloid.
    pub pieces: usize,
    /// The part of the light that is reflected.
    pub reflectivity: f64,
}

impl Default for HeliostatMirror {
    /// One flat facet of 7 m by 6 m with reflectivity 0.9.
    fn default() -> Self {
        Self {
            width_m: 7.0,
            height_m: 6.0,
            columns: 1,
            rows: 1,
            gap_m: 0.0,
            canting: Canting::Flat,
            pieces: 1,
            reflectivity: 0.9,
        }
    }
}

/// The mirrors of a field as they stand.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FieldMirrors {
    /// East, north, up \[m\]. An element's [`mirror`](Element::mirror) is the row of its heliostat, so that
    /// heliostats shade and block each other, and facets of one do not.
    pub elements: Vec<Element>,
    /// What became of every heliostat; one that is not [`Status::Ok`] has no elements.
    pub status: Vec<Status>,
}

/// The mirrors of a field that tracks: each heliostat sends the sun to its aim, with its offset and errors.
///
/// ```
/// use helio_core::{Enu, EnuUnit, Field, Heliostat, TrackingMode};
/// use helio_flux::{HeliostatMirror, field_mirrors};
/// let mut field = Field::new(TrackingMode::AzimuthElevation);
/// field.push("A1", Heliostat::new(Enu::new(0.0, 100.0, 0.0), Enu::new(0.0, 0.0, 80.0)))?;
/// let sun = EnuUnit::from_azimuth_elevation(180_f64.to_radians(), 45_f64.to_radians());
/// let mirrors = field_mirrors(&field, sun, &HeliostatMirror::default())?;
/// assert_eq!(mirrors.elements.len(), 1);
/// assert!((mirrors.elements[0].area_m2() - 42.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`FluxError::BadValue`] for a mirror that is none, [`FluxError::Tracking`] for a sun that is no direction.
pub fn field_mirrors(
    field: &Field,
    sun: EnuUnit,
    mirror: &HeliostatMirror,
) -> Result<FieldMirrors, FluxError> {
    let tracker = Tracker::new(field, OffsetForm::Exact)?;
    let mut tracking = helio_core::Tracking::default();
    tracker.track_into(
        &[sun],
        None,
        &helio_core::TrackOptions::default(),
        &mut tracking,
    )?;
    let (axis1, axis2) = (tracking.axis1_rad(), tracking.axis2_rad());
    posed(field, &tracker, axis1, axis2, tracking.status(), mirror)
}

/// The mirrors of a field at given encoder angles \[rad\], one entry per heliostat; NaN leaves a heliostat out, with
/// status [`Status::Unreachable`].
///
/// # Errors
/// As [`field_mirrors`], and [`FluxError::Tracking`] for columns of another length than the field or angles that are
/// infinite or beyond ±1e5 rad.
pub fn posed_mirrors(
    field: &Field,
    axis1_rad: &[f64],
    axis2_rad: &[f64],
    mirror: &HeliostatMirror,
) -> Result<FieldMirrors, FluxError> {
    let tracker = Tracker::new(field, OffsetForm::Exact)?;
    let known = |(a, b): (&f64, &f64)| match a.is_nan() || b.is_nan() {
        true => Status::Unreachable,
        false => Status::Ok,
    };
    let status: Vec<_> = axis1_rad.iter().zip(axis2_rad).map(known).collect();
    posed(field, &tracker, axis1_rad, axis2_rad, &status, mirror)
}

fn posed(
    field: &Field,
    tracker: &Tracker,
    axis1_rad: &[f64],
    axis2_rad: &[f64],
    status: &[Status],
    mirror: &HeliostatMirror,
) -> Result<FieldMirrors, FluxError> {
    mirror.check()?;
    // The moving axis turns the normal: it lies across the normal's way. Half a step of 1e-4 rad leaves 1e-9 of it.
    const STEP_RAD: f64 = 1e-4;
    let known = |angles: &[f64], by: f64| -> Vec<f64> {
        angles
            .iter()
            .map(|&a| if a.is_nan() { 0.0 } else { a + by })
            .collect()
    };
    let axis1 = known(axis1_rad, 0.0);
    let normals = tracker.forward(&axis1, &known(axis2_rad, 0.0))?;
    let before = tracker.forward(&axis1, &known(axis2_rad, -STEP_RAD))?;
    let after = tracker.forward(&axis1, &known(axis2_rad, STEP_RAD))?;
    let mut out = FieldMirrors {
        elements: Vec::new(),
        status: status.to_vec(),
    };
    for (row, heliostat) in field.heliostats().iter().enumerate() {
        if out.status[row] != Status::Ok {
            continue;
        }
        let [normal, before, after] =
            [normals[row], before[row], after[row]].map(|n| vector(n.as_enu()));
        let Some(across) = unit(cross(normal, sub(after, before))) else {
            out.status[row] = Status::Unreachable;
            continue;
        };
        let pivot = vector(heliostat.pivot);
        let centre = add(pivot, scale(normal, heliostat.mirror_offset_m));
        let aim_m = (heliostat.aim - heliostat.pivot).norm();
        let frame = Frame {
            centre,
            axes: [across, cross(normal, across), normal],
        };
        mirror.pieces_of(&frame, aim_m, row as u32, &mut out.elements)?;
    }
    Ok(out)
}

fn vector(enu: Enu) -> Vector {
    [enu.east, enu.north, enu.up]
}

/// Where a mirror is, and its axes: along its width, its height, and its normal.
struct Frame {
    centre: Vector,
    axes: [Vector; 3],
}

impl HeliostatMirror {
    fn check(&self) -> Result<(), FluxError> {
        let bad = |what, wanted, value| {
            Err(FluxError::BadValue {
                who: "heliostat's mirror",
                what,
                wanted,
                value,
            })
        };
        for (what, value) in [("width_m", self.width_m), ("height_m", self.height_m)] {
            if !(value > 0.0 && value <= 1e3) {
                return bad(what, "above 0 and at most 1000 m", value);
            }
        }
        for (what, count) in [
            ("columns", self.columns),
            ("rows", self.rows),
            ("pieces", self.pieces),
        ] {
            if !(1..=1000).contains(&count) {
                return bad(what, "within 1..=1000", count as f64);
            }
        }
        let [facet_width_m, facet_height_m] = self.facet_m();
        if !(self.gap_m >= 0.0 && facet_width_m > 0.0 && facet_height_m > 0.0) {
            let wanted = "at least 0 m, and leave room for facets";
            return bad("gap_m", wanted, self.gap_m);
        }
        if let Canting::FocalLength(focal_m) = self.canting
            && !(focal_m > 0.0 && focal_m.is_finite())
        {
            return bad("focal length", "above 0 m", focal_m);
        }
        if !(0.0..=1.0).contains(&self.reflectivity) {
            return bad("reflectivity", "within 0..=1", self.reflectivity);
        }
        Ok(())
    }

    /// Width and height of a facet.
    fn facet_m(&self) -> [f64; 2] {
        let one =
            |size: f64, count: usize| (size - (count as f64 - 1.0) * self.gap_m) / count as f64;
        [
            one(self.width_m, self.columns),
            one(self.height_m, self.rows),
        ]
    }

    fn pieces_of(
        &self,
        frame: &Frame,
        aim_m: f64,
        mirror: u32,
        elements: &mut Vec<Element>,
    ) -> Result<(), FluxError> {
        // paraboloid z = curvature (x² + y²) / 2
        let curvature = match self.canting {
            Canting::Flat => 0.0,
            Canting::FocalLength(focal_m) => 0.5 / focal_m,
            Canting::ToAim => 0.5 / aim_m,
        };
        let facet_m = self.facet_m();
        let half_m = facet_m.map(|size| 0.5 * size / self.pieces as f64);
        let place = |k: usize, count: usize, axis: usize, size: f64| {
            let (facet, piece) = (k / self.pieces, k % self.pieces);
            let first = facet as f64 * (facet_m[axis] + self.gap_m) - 0.5 * size;
            debug_assert!(facet < count);
            first + (2.0 * piece as f64 + 1.0) * half_m[axis]
        };
        for row in 0..self.rows * self.pieces {
            for column in 0..self.columns * self.pieces {
                let x = place(column, self.columns, 0, self.width_m);
                let y = place(row, self.rows, 1, self.height_m);
                let height = 0.5 * curvature * (x * x + y * y);
                let corner = |dx: f64, dy: f64| {
                    let (dx, dy) = (dx * half_m[0], dy * half_m[1]);
                    let local = [x + dx, y + dy, height + curvature * (x * dx + y * dy)];
                    let mut at = frame.centre;
                    for (axis, by) in frame.axes.into_iter().zip(local) {
                        at = add(at, scale(axis, by));
                    }
                    at
                };
                let corners_m = [
                    corner(-1.0, -1.0),
                    corner(1.0, -1.0),
                    corner(1.0, 1.0),
                    corner(-1.0, 1.0),
                ];
                let element = Element::quadrilateral(corners_m)?;
                elements.push(
                    element
                        .with_reflectivity(self.reflectivity)?
                        .with_mirror(mirror),
                );
            }
        }
        Ok(())
    }
}
