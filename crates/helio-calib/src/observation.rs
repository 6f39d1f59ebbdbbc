//! What was seen, and what a fit needs of it.

use helio_core::{Enu, EnuUnit, Heliostat, MountAxes, PoseErrors, TargetPlane, TrackingMode};

/// One camera picture of one heliostat's spot.
///
/// ```
/// use helio_calib::Observation;
/// use helio_core::{Enu, EnuUnit, TargetPlane};
/// let north = EnuUnit::try_new(Enu::new(0.0, 1.0, 0.0))?;
/// let plane = TargetPlane::level(Enu::new(0.0, 0.0, 40.0), north);
/// let sun = EnuUnit::from_azimuth_elevation(3.0, 0.7);
/// let observation = Observation::new(sun, 3.1, 0.4, plane, 0.25, -0.10);
/// assert_eq!(observation.sigma_m, None);
/// # Ok::<(), helio_core::error::FrameError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Toward the (apparent) sun.
    pub sun: EnuUnit,
    /// Encoder angle of the fixed axis \[rad\].
    pub axis1_rad: f64,
    /// Encoder angle of the moving axis \[rad\].
    pub axis2_rad: f64,
    /// The plane on which the spot was seen.
    pub plane: TargetPlane,
    /// Which target that is, as the caller numbers them; heliostats' observations may mix them.
    pub target: usize,
    /// Spot on the plane, to the right as a camera facing it sees it \[m\].
    pub u_m: f64,
    /// Spot on the plane, down as a camera facing it sees it \[m\].
    pub v_m: f64,
    /// One standard deviation of either component of the spot \[m\], where stated.
    pub sigma_m: Option<f64>,
    /// When, in nanoseconds from 1970 UTC, where known.
    pub unix_ns: Option<i64>,
    /// Hour angle of the sun \[rad\], west (afternoon) positive, where known.
    pub hour_angle_rad: Option<f64>,
}

impl Observation {
    /// An observation without sigma, time and hour angle, on target 0.
    #[must_use]
    pub const fn new(
        sun: EnuUnit,
        axis1_rad: f64,
        axis2_rad: f64,
        plane: TargetPlane,
        u_m: f64,
        v_m: f64,
    ) -> Self {
        Self {
            sun,
            axis1_rad,
            axis2_rad,
            plane,
            target: 0,
            u_m,
            v_m,
            sigma_m: None,
            unix_ns: None,
            hour_angle_rad: None,
        }
    }
}

/// What is known of a heliostat before its observations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mount {
    /// Where its fixed axis nominally points, and the zero of the first angle.
    pub axes: MountAxes,
    /// Crossing of its axes.
    pub pivot: Enu,
    /// Pivot to mirror centre along the normal \[m\].
    pub mirror_offset_m: f64,
    /// How far its axes stand from their encoders' angles, by the pose.
    pub pose_errors: PoseErrors,
}

impl Mount {
    /// Of a heliostat of a field. Its errors are not looked at, its pose errors are taken as known.
    #[must_use]
    pub fn of(mode: TrackingMode, heliostat: &Heliostat) -> Self {
        let to_aim = EnuUnit::try_new(heliostat.aim - heliostat.pivot).unwrap_or(EnuUnit::UP);
        Self {
            axes: MountAxes::of(mode, to_aim),
            pivot: heliostat.pivot,
            mirror_offset_m: heliostat.mirror_offset_m,
            pose_errors: heliostat.pose_errors,
        }
    }

    /// The world's up along the axes.
    pub(crate) fn up(&self) -> [f64; 3] {
        [self.axes.axis1.up, self.axes.axis2.up, self.axes.axis3.up]
    }

    pub(crate) fn components(&self, vector: Enu) -> [f64; 3] {
        [
            self.axes.axis1.dot(vector),
            self.axes.axis2.dot(vector),
            self.axes.axis3.dot(vector),
        ]
    }
}

/// An observation along its mount's axes, ready for the formula; `T` is one number or some lanes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting<T> {
    /// Unit vector to the sun.
    pub sun: [T; 3],
    /// Cosine and sine of the first encoder angle.
    pub axis1: [T; 2],
    /// Cosine and sine of the second encoder angle.
    pub axis2: [T; 2],
    /// nt, xi, eta: out of the target toward the field, right, down.
    pub plane: [[T; 3]; 3],
    /// Pivot → target centre along nt \[m\].
    pub centre_along_normal_m: T,
    /// Pivot → observed spot along xi and eta \[m\].
    pub spot_m: [T; 2],
    /// 1/sigma of either residual; 1 where none is stated.
    pub weight: T,
    /// The world's up along the mount's axes.
    pub up: [T; 3],
    /// Of the mount \[rad\], in the order of [`PoseErrors`], if it has any.
    pub pose_errors: Option<[T; 3]>,
}

impl Sighting<f64> {
    /// Prepares an observation.
    #[must_use]
    pub fn new(mount: &Mount, observation: &Observation) -> Self {
        let plane = &observation.plane;
        let centre = plane.centre - mount.pivot;
        let along = |axis: EnuUnit| axis.as_enu().dot(centre);
        let (sin1, cos1) = libm::sincos(observation.axis1_rad);
        let (sin2, cos2) = libm::sincos(observation.axis2_rad);
        Self {
            sun: mount.components(observation.sun.as_enu()),
            axis1: [cos1, sin1],
            axis2: [cos2, sin2],
            plane: [plane.normal, plane.right, plane.down]
                .map(|axis| mount.components(axis.as_enu())),
            centre_along_normal_m: along(plane.normal),
            spot_m: [
                along(plane.right) + observation.u_m,
                along(plane.down) + observation.v_m,
            ],
            weight: observation.sigma_m.map_or(1.0, f64::recip),
            up: mount.up(),
            pose_errors: (!mount.pose_errors.is_none()).then(|| mount.pose_errors.to_array()),
        }
    }

    /// What turns a residual on the plane into one across the beam that led to the observed spot: turned
    /// along the beam's shadow on the plane and foreshortened there. Over the slant it is then an
    /// angle, as in `beam_rms_mrad`, however obliquely the target is met.
    #[must_use]
    pub fn across_beam(&self) -> [[f64; 2]; 2] {
        let [u, v] = self.spot_m;
        let level = libm::hypot(u, v);
        if level == 0.0 {
            return [[1.0, 0.0], [0.0, 1.0]];
        }
        let (cosine, sine) = (u / level, v / level);
        let along_normal = libm::fabs(self.centre_along_normal_m);
        let shortened = along_normal / libm::hypot(along_normal, level);
        [[-sine, cosine], [cosine * shortened, sine * shortened]]
    }
}
