//! What a cause is worth in milliradians of the beam.

use rayon::prelude::*;

use super::belief::column;
use super::rows::{ANGLES, MILLI, filter_unit};
use super::{JointFit, is_free};
use crate::error::CalibrationError;
use crate::field::Campaign;

/// What a cause does to the beams of the records that a joint fit believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Worth {
    /// How far its value (of a cause of each heliostat: each one's own) turns the beam, root mean square over the
    /// records \[mrad\].
    pub turn_mrad: f64,
    /// What is left of that where each heliostat's angles at rest and other causes of its own take over as much as they
    /// can, root mean square over the same records \[mrad\]: by the root of the sum of squares a fit that
    /// does not know of the cause misses these records by so much more. Of few records the angles take over
    /// all, whatever the cause does to beams to come.
    pub worth_mrad: f64,
}

/// Sums of squares of one heliostat's records \[mrad²\], for each cause.
struct Squares {
    turn: Vec<f64>,
    left: Vec<f64>,
    records: usize,
}

/// Part of a column's length below which it is a combination of those before it.
const COMBINED: f64 = 1e-9;

impl JointFit {
    /// What each of [`causes`](Self::causes) is worth, from the campaigns that were fitted; zero for those not
    /// admitted, NaN without records.
    ///
    /// The effect e of a cause is its value times the derivative of each record's beam, two components across
    /// it; A has the derivatives by what the heliostat has of its own at rest. Then `turn_mrad`² is the mean of |e|²
    /// and `worth_mrad`² that of |e − A A⁺ e|². Zero points are not let wander more to make up for it.
    ///
    /// # Errors
    /// [`CalibrationError::BadOption`] where the number of campaigns is not that of the heliostats.
    pub fn worth(&self, campaigns: &[Campaign<'_>]) -> Result<Vec<Worth>, CalibrationError> {
        if campaigns.len() != self.heliostats.len() {
            return Err(CalibrationError::BadOption {
                what: "number of campaigns",
                wanted: "that of the heliostats of the fit",
                value: campaigns.len() as f64,
            });
        }
        let each: Vec<Squares> = campaigns
            .par_iter()
            .enumerate()
            .map(|(k, campaign)| self.squares(k, campaign))
            .collect();
        let records: usize = each.iter().map(|one| one.records).sum();
        let rms = |sum: f64| libm::sqrt(sum / records as f64);
        Ok((0..self.causes.len())
            .map(|c| Worth {
                turn_mrad: rms(each.iter().map(|one| one.turn[c]).sum()),
                worth_mrad: rms(each.iter().map(|one| one.left[c]).sum()),
            })
            .collect())
    }

    fn squares(&self, k: usize, campaign: &Campaign<'_>) -> Squares {
        let shape = self.structure.shape();
        let posterior = &self.heliostats[k];
        let (rows, _) = self.marked(k, campaign);
        let silent = shape.row() - column::REST + column::SILENT;
        let believed: Vec<&[f64]> = (0..rows.len())
            .map(|r| rows.row(shape, r))
            .filter(|row| row[silent] == 0.0)
            .collect();
        let effect = |at: usize, value: f64| -> Vec<f64> {
            let both = believed.iter().flat_map(|row| [row[at], row[at + 1]]);
            both.map(|slope| slope * value).collect()
        };
        // what the heliostat has of its own: causes last
        let own: Vec<usize> = (0..shape.still)
            .filter(|&i| i < ANGLES || is_free(self.prior_sigma[i]))
            .collect();
        let columns: Vec<Vec<f64>> = own.iter().map(|&i| effect(2 * i, 1.0)).collect();
        let basis = orthonormal(columns.iter());
        let mut squares = Squares {
            turn: Vec::with_capacity(self.causes.len()),
            left: Vec::with_capacity(self.causes.len()),
            records: believed.len(),
        };
        for (c, cause) in self.causes.iter().enumerate() {
            let unknown = ANGLES + c;
            if !cause.admitted {
                squares.turn.push(0.0);
                squares.left.push(0.0);
                continue;
            }
            let mut effect = if unknown < shape.still {
                effect(2 * unknown, posterior.still[unknown] * MILLI)
            } else {
                effect(2 * unknown, cause.value * filter_unit(cause.cause))
            };
            squares.turn.push(square(&effect));
            if unknown < shape.still {
                let others = own.iter().zip(&columns).filter(|(i, _)| **i != unknown);
                remove(&mut effect, &orthonormal(others.map(|(_, column)| column)));
            } else {
                remove(&mut effect, &basis);
            }
            squares.left.push(square(&effect));
        }
        squares
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn square(v: &[f64]) -> f64 {
    dot(v, v)
}

/// Takes out of a vector what lies along orthonormal ones; twice, so that nothing but rounding is left of it.
fn remove(from: &mut [f64], basis: &[Vec<f64>]) {
    for direction in basis.iter().chain(basis) {
        let part = dot(from, direction);
        for (x, d) in from.iter_mut().zip(direction) {
            *x -= part * d;
        }
    }
}

/// An orthonormal basis of what the columns span (Gram and Schmidt, twice over).
fn orthonormal<'a>(columns: impl Iterator<Item = &'a Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let length = libm::sqrt(square(column));
        let mut left = column.clone();
        remove(&mut left, &basis);
        let rest = libm::sqrt(square(&left));
        if rest > COMBINED * length {
            for x in &mut left {
                *x /= rest;
            }
            basis.push(left);
        }
    }
    basis
}

#[cfg(test)]
mod tests {
    use super::super::simulate::{FieldCauses, FieldOptions, SimulatedField, simulate_field};
    use super::super::{AxisCause, Cause, JointOptions, Noise, SpotCause, Wander, fit_joint};
    use super::*;
    use crate::{FitOptions, Mount, Observation, Parameters, ResidualForm, fit, measures};
    use helio_core::sun::{SunSite, position};
    use helio_core::{PoseErrors, TrackingMode};

    /// Little noise and no wander: what is left is what nobody made up for.
    fn quiet(causes: FieldCauses) -> FieldOptions {
        FieldOptions {
            heliostats: 30,
            records: 40,
            mode: TrackingMode::PitchRoll {
                axis_azimuth_rad: core::f64::consts::FRAC_PI_2,
            },
            causes,
            noise: Noise {
                beam_mrad: 0.05,
                spot_m: 0.0,
                sun_path_s: 0.0,
            },
            wander: Wander {
                slow_mrad: [0.0; 2],
                slow_days: 60.0,
                fast_mrad: [0.0; 2],
                fast_days: 0.3,
            },
            ..FieldOptions::new(17).unwrap()
        }
    }

    fn worth_of(options: &FieldOptions, cause: Cause) -> (SimulatedField, Worth, f64) {
        let field = simulate_field(options).unwrap();
        let campaigns = field.first(options.records);
        let fit = fit_joint(&campaigns, &JointOptions::new(options.site.latitude_rad())).unwrap();
        let worth = fit.worth(&campaigns).unwrap();
        assert_eq!(worth.len(), fit.causes.len());
        assert!(fit.worth(&campaigns[1..]).is_err());
        let found = fit.causes.iter().position(|c| c.cause == cause).unwrap();
        assert!(fit.causes[found].admitted);
        for (cause, worth) in fit.causes.iter().zip(&worth) {
            assert!(worth.worth_mrad <= worth.turn_mrad * (1.0 + 1e-9));
            assert!(cause.admitted || worth.turn_mrad == 0.0);
        }
        (field, worth[found], fit.causes[found].value)
    }

    /// What six angles leave, heliostat by heliostat, of mounts that know of a cause or not \[mrad\].
    fn left_by_six_angles(field: &SimulatedField, known: impl Fn(&mut Mount)) -> f64 {
        let options = FitOptions {
            residual: ResidualForm::Beam,
            ..FitOptions::default()
        };
        let squares = field.heliostats.iter().map(|h| {
            let mut mount = h.mount;
            known(&mut mount);
            let fit = fit(&mount, &h.observations, &options).unwrap();
            fit.beam_rms_mrad * fit.beam_rms_mrad
        });
        libm::sqrt(squares.sum::<f64>() / field.heliostats.len() as f64)
    }

    /// How far two sets of predicted spots lie apart, seen from the pivot \[mrad\]; boards are met nearly square.
    fn apart(
        field: &SimulatedField,
        other: impl Fn(&Mount, &Observation) -> (Mount, Observation),
    ) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for h in &field.heliostats {
            let parameters = Parameters {
                values: core::array::from_fn(|k| {
                    h.angles_rad
                        .get(k)
                        .copied()
                        .unwrap_or(h.mount.mirror_offset_m)
                }),
            };
            for o in &h.observations {
                let (mount, turned) = other(&h.mount, o);
                let (before, _) = measures(&h.mount, &[*o], &parameters);
                let (after, _) = measures(&mount, &[turned], &parameters);
                let sighting = crate::Sighting::new(&h.mount, o);
                let [a, b] = sighting.across_beam();
                let moved = [after[0][0] - before[0][0], after[0][1] - before[0][1]];
                let slant = libm::hypot(
                    libm::hypot(sighting.spot_m[0], sighting.spot_m[1]),
                    sighting.centre_along_normal_m,
                );
                for line in [a, b] {
                    let angle = 1e3 * (line[0] * moved[0] + line[1] * moved[1]) / slant;
                    sum += angle * angle;
                }
                count += 1.0;
            }
        }
        libm::sqrt(sum / count)
    }

    fn near(what: &str, got: f64, want: f64, within: f64) {
        println!("{what}: {got:.4} mrad, another way {want:.4}");
        assert!((got / want - 1.0).abs() < within, "{what}: {got} {want}");
    }

    #[test]
    fn a_sag_is_worth_what_fits_that_do_not_know_it_miss_more() {
        let pose_errors = PoseErrors {
            axis2_sag_rad: 3.6e-3,
            ..PoseErrors::NONE
        };
        let options = quiet(FieldCauses {
            pose_errors,
            ..FieldCauses::default()
        });
        let (field, worth, _) = worth_of(&options, Cause::Axis(AxisCause::Axis2Sag));
        let without = left_by_six_angles(&field, |_| {});
        let with = left_by_six_angles(&field, |mount| mount.pose_errors = pose_errors);
        let more = libm::sqrt(without * without - with * with);
        near("worth of the sag", worth.worth_mrad, more, 0.02);
        let turned = apart(&field, |mount, o| {
            (
                Mount {
                    pose_errors,
                    ..*mount
                },
                *o,
            )
        });
        near("turn of the sag", worth.turn_mrad, turned, 0.01);
        assert!(worth.worth_mrad < 0.9 * worth.turn_mrad);
    }

    #[test]
    fn an_eccentricity_of_each_heliostat_counts_with_its_own_value() {
        let options = quiet(FieldCauses {
            pose_errors: PoseErrors {
                axis2_eccentricity_rad: 2e-3,
                ..PoseErrors::NONE
            },
            axis2_eccentricity_spread_rad: 1e-3,
            ..FieldCauses::default()
        });
        let (field, worth, _) = worth_of(&options, Cause::Axis(AxisCause::Axis2Eccentricity));
        let own: Vec<f64> = field
            .heliostats
            .iter()
            .map(|h| h.axis2_eccentricity_rad)
            .collect();
        let without = left_by_six_angles(&field, |_| {});
        let with = left_by_six_angles(&field, |mount| {
            let h = field
                .heliostats
                .iter()
                .position(|h| h.mount.pivot == mount.pivot);
            mount.pose_errors.axis2_eccentricity_rad = own[h.unwrap()];
        });
        let more = libm::sqrt(without * without - with * with);
        near("worth of the eccentricity", worth.worth_mrad, more, 0.05);
    }

    #[test]
    fn the_time_of_the_sun_and_a_shift_turn_beams_as_geometry_says() {
        let options = quiet(FieldCauses {
            sun_time_s: 20.0,
            ..FieldCauses::default()
        });
        let (field, worth, late_s) = worth_of(&options, Cause::Spots(SpotCause::SunTime));
        let site: SunSite = options.site;
        let turned = apart(&field, |mount, o| {
            let at = o.unix_ns.unwrap() + (late_s * 1e9) as i64;
            let sun = position(&site, at, None, 0.0).unwrap().direction();
            (*mount, Observation { sun, ..*o })
        });
        near("turn of the sun's time", worth.turn_mrad, turned, 0.01);

        let options = quiet(FieldCauses {
            target_shift_m: vec![[0.0; 2], [0.08, 0.0], [0.0; 2]],
            ..FieldCauses::default()
        });
        let (field, worth, right_m) = worth_of(&options, Cause::Target(SpotCause::TargetRight, 1));
        let turned = apart(&field, |mount, o| {
            let mut o = *o;
            o.u_m -= if o.target == 1 { right_m } else { 0.0 };
            (*mount, o)
        });
        near("turn of a target's shift", worth.turn_mrad, turned, 0.01);
    }

    #[test]
    fn columns_that_are_combinations_count_once() {
        let columns = vec![
            vec![1.0, 1.0, 0.0, 0.0],
            vec![2.0, 2.0, 0.0, 0.0],
            vec![0.0, 1.0, 1e-3, 0.0],
            vec![0.0; 4],
        ];
        let basis = orthonormal(columns.iter());
        assert_eq!(basis.len(), 2);
        let mut v = vec![3.0, -1.0, 2.0, 5.0];
        remove(&mut v, &basis);
        for column in &columns {
            assert!(dot(&v, column).abs() < 1e-14);
        }
        assert_eq!(v[3], 5.0);
    }
}
