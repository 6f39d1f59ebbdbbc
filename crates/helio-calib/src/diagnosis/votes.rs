//! What each record says about the encoder references, in closed form, and calls that cannot be right.

use core::f64::consts::PI;

use super::finding::WrongCall;
use super::joint::{Frame, Judge, Model, REFERENCES, Record, records, solve};
use crate::loss::{median, middle};
use crate::model::Pose;
use crate::observation::{Mount, Observation};
use crate::parameters::Parameters;
use helio_core::{Enu, EnuUnit, TargetPlane};

/// Records that are asked for a vote, spread over the campaign.
const VOTERS: usize = 40;
/// Records that judge each vote.
const JUDGES: usize = 60;

/// References for which a record's normal would halve sun and spot if the mount were otherwise as at the
/// start: the direct solution and the one over the top.
fn votes(record: &Record) -> [[f64; 2]; 2] {
    let n = record.wanted_normal();
    let gamma = libm::atan2(n[1], n[0]);
    let alpha = libm::atan2(n[2], libm::hypot(n[0], n[1]));
    let [cos1, sin1] = record.sighting.axis1;
    let [cos2, sin2] = record.sighting.axis2;
    let (axis1, axis2) = (libm::atan2(sin1, cos1), libm::atan2(sin2, cos2));
    [
        [axis1 - gamma, axis2 - alpha],
        [axis1 - gamma - PI, axis2 - (PI - alpha)],
    ]
}

/// The vote that most records agree with, and the median beam error it leaves \[mrad\].
pub fn elect(frame: &Frame, records: &[Record]) -> (Parameters, f64) {
    let mut best = (
        Parameters {
            values: frame.start,
        },
        f64::INFINITY,
    );
    let judges: Vec<&Record> = records
        .iter()
        .step_by(records.len().div_ceil(JUDGES))
        .collect();
    let mut consider = |parameters: Parameters| {
        let pose = Pose::of(&parameters);
        // as soon as more than half are worse off than the best's middle one, so is the middle one
        let limit = if best.1.is_finite() {
            let chord = 2.0 * libm::sin(0.5e-3 * best.1);
            chord * chord
        } else {
            f64::INFINITY
        };
        let (mut worse, mut chords) = (0, Vec::with_capacity(judges.len()));
        for record in &judges {
            let chord2 = record.chord2(&pose);
            worse += usize::from(chord2 > limit);
            if worse > judges.len() / 2 {
                return;
            }
            chords.push(chord2);
        }
        let [below, above] =
            middle(&mut chords).map(|chord2| 2e3 * libm::asin((0.5 * libm::sqrt(chord2)).min(1.0)));
        let error = 0.5 * (below + above);
        if error < best.1 {
            best = (parameters, error);
        }
    };
    consider(Parameters {
        values: frame.start,
    });
    if frame.references_free() {
        for record in records.iter().step_by(records.len().div_ceil(VOTERS)) {
            for vote in votes(record) {
                let mut values = frame.start;
                for (k, value) in REFERENCES.into_iter().zip(vote) {
                    if frame.is_free(k) {
                        values[k] = value;
                    }
                }
                consider(Parameters { values });
            }
        }
    }
    best
}

/// Median beam error \[mrad\] that a quick robust fit of one epoch leaves.
pub fn quick(frame: &Frame, records: &[Record]) -> f64 {
    let (start, error) = elect(frame, records);
    let epochs = vec![0; records.len()];
    let marks = vec![true; records.len()];
    let mut model = Model::single(&start);
    let mut scale = error.max(1.0);
    for _ in 0..3 {
        let judge = Judge::Student(&marks, scale);
        model = solve(frame, records, &epochs, model, judge, 12).0;
        let pose = Pose::of(&model.parameters(0));
        let error = median(records.iter().map(|r| r.beam_mrad(&pose)).collect());
        scale = (error / 1.18).max(0.3);
    }
    scale * 1.18
}

/// Recognises encoder angles in steps by their size alone.
pub fn by_size(observations: &[Observation], rows: &[usize]) -> Option<WrongCall> {
    let middle = |of: fn(&Observation) -> f64| {
        median(
            rows.iter()
                .map(|&row| of(&observations[row]).abs())
                .collect(),
        )
    };
    let largest = middle(|o| o.axis1_rad).max(middle(|o| o.axis2_rad));
    // Steps as radians are thousands; steps as degrees are tens of radians and more. Degrees as
    // radians end at 360.
    (largest > 400.0).then_some(WrongCall::EncoderInSteps)
}

type Change<'a> = (WrongCall, Box<dyn Fn(&mut Observation) + 'a>);

fn turned_sun(observation: &mut Observation, azimuth_rad: impl Fn(f64) -> f64) {
    observation.sun = EnuUnit::from_azimuth_elevation(
        azimuth_rad(observation.sun.azimuth_rad()),
        observation.sun.elevation_rad(),
    );
}

/// Another way of reading the records.
pub struct Reading {
    pub call: WrongCall,
    /// Median beam error that it leaves with one epoch \[mrad\].
    pub error_mrad: f64,
    pub records: Vec<Record>,
}

/// Tries other ways of reading the records; the best.
pub fn reread(
    mount: &Mount,
    neighbours: &[Mount],
    targets: &[TargetPlane],
    observations: &[Observation],
    rows: &[usize],
    frame: &Frame,
) -> Option<Reading> {
    let scaled = |factors: [f64; 2]| -> Box<dyn Fn(&mut Observation)> {
        Box::new(move |o| {
            o.axis1_rad *= factors[0];
            o.axis2_rad *= factors[1];
        })
    };
    let (degrees, radians) = (1_f64.to_radians(), 1_f64.to_degrees());
    let mut changes: Vec<Change<'_>> = vec![
        (WrongCall::EncoderInDegrees, scaled([degrees; 2])),
        (WrongCall::EncoderInRadians, scaled([radians; 2])),
        (WrongCall::Axis1InDegrees, scaled([degrees, 1.0])),
        (WrongCall::Axis1InRadians, scaled([radians, 1.0])),
        (WrongCall::Axis2InDegrees, scaled([1.0, degrees])),
        (WrongCall::Axis2InRadians, scaled([1.0, radians])),
        (
            WrongCall::SunFromSouthEastward,
            Box::new(|o| turned_sun(o, |azimuth| PI - azimuth)),
        ),
        (
            WrongCall::SunFromSouthWestward,
            Box::new(|o| turned_sun(o, |azimuth| PI + azimuth)),
        ),
        (
            WrongCall::Axis1Flipped,
            Box::new(|o| o.axis1_rad = -o.axis1_rad),
        ),
        (
            WrongCall::AxesSwapped,
            Box::new(|o| core::mem::swap(&mut o.axis1_rad, &mut o.axis2_rad)),
        ),
        (WrongCall::SpotUpward, Box::new(|o| o.v_m = -o.v_m)),
        (WrongCall::SpotMirrored, Box::new(|o| o.u_m = -o.u_m)),
        (
            WrongCall::SpotSwapped,
            Box::new(|o| core::mem::swap(&mut o.u_m, &mut o.v_m)),
        ),
    ];
    for (target, plane) in targets.iter().enumerate() {
        changes.push((
            WrongCall::OtherTarget { target },
            Box::new(|o| o.plane = *plane),
        ));
    }
    let mut best: Option<Reading> = None;
    let mut consider = |call: WrongCall, mount: &Mount, read: &[Observation]| {
        let records = records(mount, read, rows);
        let error_mrad = quick(frame, &records);
        if best.as_ref().is_none_or(|b| error_mrad < b.error_mrad) {
            best = Some(Reading {
                call,
                error_mrad,
                records,
            });
        }
    };
    let mut read = observations.to_vec();
    for (call, change) in changes {
        read.copy_from_slice(observations);
        read.iter_mut().for_each(change);
        consider(call, mount, &read);
    }
    for (neighbour, mount) in neighbours.iter().enumerate() {
        consider(WrongCall::OtherHeliostat { neighbour }, mount, observations);
    }
    best
}

/// Tries suns that stand earlier or later by some half hours, turned about the pole; the best. The sun's
/// declination changes by a mrad or two meanwhile.
pub fn other_times(
    mount: &Mount,
    latitude_rad: f64,
    observations: &[Observation],
    rows: &[usize],
    frame: &Frame,
    half_hours: core::ops::RangeInclusive<i32>,
) -> Option<Reading> {
    let (sin_latitude, cos_latitude) = libm::sincos(latitude_rad);
    let pole = Enu::new(0.0, cos_latitude, sin_latitude);
    let mut read = observations.to_vec();
    let others = half_hours.filter(|&half_hours| half_hours != 0);
    let readings = others.map(|half_hours| {
        // westward, clockwise about the northern pole
        let (sine, cosine) = libm::sincos(-7.5_f64.to_radians() * f64::from(half_hours));
        for (o, given) in read.iter_mut().zip(observations) {
            let sun = given.sun.as_enu();
            let along = pole * pole.dot(sun);
            let turned = along + (sun - along) * cosine + pole.cross(sun) * sine;
            o.sun = EnuUnit::try_new(turned).unwrap_or(given.sun);
        }
        let call = WrongCall::TimesOff {
            early_minutes: 30 * half_hours,
        };
        let records = records(mount, &read, rows);
        Reading {
            call,
            error_mrad: quick(frame, &records),
            records,
        }
    });
    readings.min_by(|a, b| a.error_mrad.total_cmp(&b.error_mrad))
}
