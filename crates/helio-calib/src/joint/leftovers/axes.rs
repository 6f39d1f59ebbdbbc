//! By how much what is known of a mount turns its axes' readings, in a pose.

use crate::joint::terms::{AxisCause, LoadedPose};
use crate::measures::dot;
use crate::model::{Pose, normal, turned_back};
use crate::observation::{Mount, Sighting};
use crate::parameters::{Parameter, Parameters};

use super::super::rows::ANGLES;

/// Derivatives of both readings that give the same normal, by the six angles and then by causes: what a small
/// change of each asks of a set-point. Causes as in the unloaded pose, whose difference is of second order.
pub(super) fn readings_by(
    mount: &Mount,
    parameters: &Parameters,
    causes: &[AxisCause],
    [axis1_rad, axis2_rad]: [f64; 2],
) -> Vec<[f64; 2]> {
    let cos_sin = |angle: f64| {
        let (sine, cosine) = libm::sincos(angle);
        [cosine, sine]
    };
    let zero = [0.0; 3];
    let sighting = Sighting {
        sun: zero,
        axis1: cos_sin(axis1_rad),
        axis2: cos_sin(axis2_rad),
        plane: [zero; 3],
        centre_along_normal_m: 0.0,
        spot_m: [0.0; 2],
        weight: 1.0,
        up: mount.up(),
        pose_errors: None,
    };
    let slopes = normal(&Pose::of(parameters), &sighting).slopes;
    let first = slopes[Parameter::AzimuthReference as usize];
    let second = slopes[Parameter::ElevationReference as usize];
    // Gram and Schmidt, the second axis first: the first has no lever where the mirror looks along it
    let square2 = dot(second, second);
    let mixed = dot(first, second) / square2;
    let across: [f64; 3] = core::array::from_fn(|k| first[k] - mixed * second[k]);
    let square1 = dot(across, across).max(LEAST_LEVER * LEAST_LEVER);
    let mut by: Vec<[f64; 2]> = slopes[..ANGLES]
        .iter()
        .map(|&slope| {
            let one = dot(across, slope) / square1;
            [one, dot(second, slope) / square2 - mixed * one]
        })
        .collect();
    let loaded = LoadedPose {
        axis1: turned_back(
            sighting.axis1,
            cos_sin(parameters.get(Parameter::AzimuthReference)),
        ),
        axis2: turned_back(
            sighting.axis2,
            cos_sin(parameters.get(Parameter::ElevationReference)),
        ),
        up: sighting.up,
    };
    // further turned is less to be read
    by.extend(causes.iter().map(|cause| cause.turn(&loaded).map(|x| -x)));
    by
}

/// Shortest lever of the first axis, in parts of the normal: nearer to its blind spot derivatives stay as there.
const LEAST_LEVER: f64 = 0.01;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aiming::encoder_angles_rad;
    use helio_core::{Enu, EnuUnit, MountAxes, PoseErrors, TrackingMode};

    /// Against set-points of the formula itself, by differences.
    #[test]
    fn a_change_of_parameters_asks_for_these_readings() {
        let mode = TrackingMode::PitchRoll {
            axis_azimuth_rad: 1.2,
        };
        let aim = Enu::new(3.0, -80.0, 40.0);
        let mut mount = Mount {
            axes: MountAxes::of(mode, EnuUnit::UP),
            pivot: Enu::new(5.0, 20.0, 1.7),
            mirror_offset_m: 0.2,
            pose_errors: PoseErrors::NONE,
        };
        let mut parameters = Parameters {
            values: [0.01, -0.02, 0.03, 0.004, -0.02, 0.01, 0.2],
        };
        let sun = EnuUnit::from_azimuth_elevation(3.6, 0.7);
        let at = encoder_angles_rad(&mount, &parameters, sun, aim).unwrap();
        let by = readings_by(&mount, &parameters, AxisCause::ALL, at);
        let step = 1e-6;
        for (k, by) in by.iter().enumerate() {
            let mut moved = |by: f64| {
                if k < ANGLES {
                    parameters.values[k] += by;
                } else {
                    let mut errors = mount.pose_errors.to_array();
                    errors[k - ANGLES] += by;
                    mount.pose_errors = PoseErrors::from_array(errors);
                }
                encoder_angles_rad(&mount, &parameters, sun, aim).unwrap()
            };
            let above = moved(step);
            let below = moved(-2.0 * step);
            moved(step);
            for axis in 0..2 {
                let want = (above[axis] - below[axis]) / (2.0 * step);
                assert!((by[axis] - want).abs() < 1e-6, "{k} {axis}: {by:?} {want}");
            }
        }
    }
}
