//! Why a record does not fit: its spot may belong to another target, or all of it to another heliostat.

use helio_core::TargetPlane;

use super::finding::Reason;
use super::joint::{Frame, Judge, Model, Record, expectation, solve, squares};
use crate::model::{Pose, landing};
use crate::observation::{Mount, Observation, Sighting};
use crate::parameters::Parameters;

/// Records that together may show that they are another heliostat's.
const GROUP: usize = 4;
/// Typical size of an accident \[mrad\].
const ACCIDENT_MRAD: f64 = 15.0;
/// How far a mount is from perfect \[rad, one standard deviation\]: its geometry,
const GEOMETRY_RAD: f64 = 0.015;
/// and its encoder references.
const REFERENCES_RAD: f64 = 0.04;
/// Cost of an angle that may be chosen: twice the logarithm of expected over found spread.
const PER_ANGLE: f64 = 6.0;
/// By how much more likely a neighbour must be.
const MARGIN: f64 = 6.0;

/// What is judged against.
pub struct Fitted<'a> {
    pub mount: &'a Mount,
    pub observations: &'a [Observation],
    pub neighbours: &'a [Mount],
    pub targets: &'a [TargetPlane],
    /// Beam error that a record of this campaign may have \[mrad\].
    pub limit_mrad: f64,
}

impl Fitted<'_> {
    /// Reasons of the records `rows`, each with the parameters of its epoch.
    pub fn reasons(&self, rows: &[(usize, Parameters)]) -> Vec<Reason> {
        let mut reasons: Vec<Reason> = rows
            .iter()
            .map(|&(row, parameters)| self.alone(row, &parameters))
            .collect();
        self.groups(rows, &mut reasons);
        reasons
    }

    fn alone(&self, row: usize, parameters: &Parameters) -> Reason {
        let observation = &self.observations[row];
        let pose = Pose::of(parameters);
        let own = Record::new(self.mount, row, observation).beam_mrad(&pose);
        let others = self
            .targets
            .iter()
            .enumerate()
            .filter(|(_, plane)| **plane != observation.plane);
        let errors = others.map(|(target, plane)| {
            let moved = Observation {
                plane: *plane,
                ..*observation
            };
            let beam = Record::new(self.mount, row, &moved).beam_mrad(&pose);
            (beam, Reason::WrongTarget { target })
        });
        // With nothing known of a neighbour's errors its mount counts as perfect.
        let other = self
            .neighbours
            .iter()
            .enumerate()
            .map(|(neighbour, mount)| {
                let mut values = [0.0; crate::parameters::COUNT];
                values[6] = mount.mirror_offset_m;
                let beam = Record::new(mount, row, observation)
                    .beam_mrad(&Pose::of(&Parameters { values }));
                (beam, Reason::WrongHeliostat { neighbour })
            });
        let best = errors.chain(other).min_by(|a, b| a.0.total_cmp(&b.0));
        match best {
            Some((beam, reason)) if beam <= self.limit_mrad.min(0.5 * own) => reason,
            _ if !landing(&pose, &Sighting::new(self.mount, observation)).hits() => {
                Reason::MissesTarget
            }
            _ => Reason::Outlier,
        }
    }

    /// Several records that one mount elsewhere explains better than as many accidents.
    ///
    /// Both explanations are compared by -2 log of their evidence. An accident is a spot somewhere around the
    /// right one, with a long tail; a neighbour has six angles of which only the rough size is known.
    fn groups(&self, rows: &[(usize, Parameters)], reasons: &mut [Reason]) {
        let open: Vec<usize> = (0..rows.len())
            .filter(|&i| matches!(reasons[i], Reason::Outlier | Reason::MissesTarget))
            .collect();
        if open.len() < GROUP {
            return;
        }
        let sigma_mrad = 0.25 * self.limit_mrad;
        let accidents: Vec<f64> = open
            .iter()
            .map(|&i| {
                let (row, parameters) = &rows[i];
                let own = Record::new(self.mount, *row, &self.observations[*row])
                    .beam_mrad(&Pose::of(parameters));
                4.0 * (libm::log(ACCIDENT_MRAD / sigma_mrad) + libm::log1p(own / ACCIDENT_MRAD))
            })
            .collect();
        let mut best: Option<(f64, usize, Vec<bool>)> = None;
        for (neighbour, mount) in self.neighbours.iter().enumerate() {
            let frame = Frame::expecting(mount, GEOMETRY_RAD, REFERENCES_RAD);
            let records: Vec<Record> = open
                .iter()
                .map(|&i| Record::new(mount, rows[i].0, &self.observations[rows[i].0]))
                .collect();
            let epochs = vec![0; records.len()];
            let mut members = vec![true; records.len()];
            let mut model = Model::single(&Parameters {
                values: frame.start,
            });
            for scale in [10.0, 3.0, 1.0] {
                let judge = Judge::Student(&members, scale * sigma_mrad);
                model = solve(&frame, &records, &epochs, model, judge, 15).0;
            }
            for _ in 0..3 {
                members = squares(&records, &epochs, &model)
                    .into_iter()
                    .map(|square| libm::sqrt(square) <= self.limit_mrad)
                    .collect();
                let judge = Judge::Marked(&members);
                model = solve(&frame, &records, &epochs, model, judge, 15).0;
            }
            let count = members.iter().filter(|&&m| m).count();
            if count < GROUP {
                continue;
            }
            let mut gain = -expectation(&frame, &model) - PER_ANGLE * 6.0 - MARGIN;
            for (i, square) in squares(&records, &epochs, &model).into_iter().enumerate() {
                if members[i] {
                    gain += accidents[i] - square / (sigma_mrad * sigma_mrad);
                }
            }
            if gain > best.as_ref().map_or(0.0, |b| b.0) {
                best = Some((gain, neighbour, members));
            }
        }
        if let Some((_, neighbour, members)) = best {
            for (&i, member) in open.iter().zip(members) {
                if member {
                    reasons[i] = Reason::WrongHeliostat { neighbour };
                }
            }
        }
    }
}
