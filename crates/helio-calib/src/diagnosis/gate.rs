//! How well the parameters point over the year, and whether that is good enough.
//!
//! The covariance of a least-squares fit divides the noise by the number of records. A short campaign then
//! looks well known: its residuals are tiny because what a mount does beyond six angles hardly changes within a
//! day and hides in the parameters. So records share an error that is correlated between neighbouring suns,
//! cov(e_i, e_j) = floor² exp(-(angle between the suns)²/(2 reach²)) in each direction, beside the noise that
//! the residuals show: C = J⁺ (sigma² I + floor² K) J⁺ᵀ.

use faer::Mat;
use helio_core::{Enu, EnuUnit};

use super::joint::{Columns, Frame, GEOMETRY, Model, REFERENCES, Record};
use crate::measures::{dot, spread_mrad};
use crate::parameters::COUNT;

/// Angle between suns over which errors are shared \[rad\].
const REACH_RAD: f64 = 0.35;
/// Suns lower than this are not tracked \[rad\].
const LOWEST_SUN_RAD: f64 = 0.1745;
const OBLIQUITY_RAD: f64 = 0.409_1;
/// Below this ratio of singular values (of columns scaled to unit length) a direction is not determined.
const RANK: f64 = 1e-8;

/// Covariance of an epoch's parameters \[rad²\] with shared errors; `None` if they are not determined.
#[allow(clippy::too_many_arguments)]
pub fn covariance(
    frame: &Frame,
    records: &[Record],
    epochs: &[usize],
    keep: &[bool],
    model: &Model,
    epoch: usize,
    sigma_mrad: f64,
    floor_mrad: f64,
) -> Option<[[f64; COUNT]; COUNT]> {
    let columns = Columns::new(frame, model.references.len());
    let n = columns.count();
    let kept: Vec<usize> = (0..records.len()).filter(|&i| keep[i]).collect();
    let expected = frame.stated();
    let rows = 2 * kept.len() + expected.len();
    if rows < n || n == 0 {
        return None;
    }
    let poses = model.poses();
    let mut jacobian = Mat::<f64>::zeros(rows, n);
    for (at, &i) in kept.iter().enumerate() {
        let (_, slopes) = records[i].linearised(&poses[epochs[i]]);
        for (c, slopes) in slopes.iter().enumerate() {
            columns.place(epochs[i], slopes, |column, value| {
                jacobian[(2 * at + c, column)] = records[i].precision * value;
            });
        }
    }
    // what was known before weighs as a record with the noise of the others
    for (at, &(k, sigma)) in expected.iter().enumerate() {
        let mut slopes = [0.0; super::joint::ANGLES];
        slopes[k] = sigma_mrad / sigma;
        columns.place(epoch, &slopes, |column, value| {
            jacobian[(2 * kept.len() + at, column)] = value;
        });
    }
    let norms: Vec<f64> = (0..n).map(|k| jacobian.col(k).norm_l2()).collect();
    if norms.iter().any(|&norm| !(norm > 0.0 && norm.is_finite())) {
        return None;
    }
    for (k, norm) in norms.iter().enumerate() {
        for i in 0..rows {
            jacobian[(i, k)] /= norm;
        }
    }
    let svd = jacobian.thin_svd().ok()?;
    let (u, s, v) = (svd.U(), svd.S().column_vector(), svd.V());
    if s[n - 1] <= RANK * s[0] {
        return None;
    }
    // Uᵀ K U of both directions. K is never stored: it would take the square of the records' number.
    let count = kept.len();
    let across: Vec<f64> = (0..2 * count)
        .flat_map(|row| (0..n).map(move |k| (row, k)))
        .map(|(row, k)| records[kept[row / 2]].precision * u[(row, k)])
        .collect();
    let mut middle = Mat::<f64>::zeros(n, n);
    let mut shared = vec![0.0; 2 * n];
    for a in 0..count {
        // half of itself and all before, for K is the same from both sides
        let own = &across[2 * n * a..2 * n * (a + 1)];
        for (sum, value) in shared.iter_mut().zip(own) {
            *sum = 0.5 * value;
        }
        let sun = records[kept[a]].sighting.sun;
        for (&other, values) in kept[..a].iter().zip(across.chunks_exact(2 * n)) {
            let cosine = dot(sun, records[other].sighting.sun);
            // 1 - cos = angle²/2 for the angles that matter
            let k = libm::exp((cosine.min(1.0) - 1.0) / (REACH_RAD * REACH_RAD));
            for (sum, value) in shared.iter_mut().zip(values) {
                *sum += k * value;
            }
        }
        for (own, shared) in own.chunks_exact(n).zip(shared.chunks_exact(n)) {
            for p in 0..n {
                for q in 0..n {
                    middle[(p, q)] += own[p] * shared[q] + own[q] * shared[p];
                }
            }
        }
    }
    let inner = Mat::<f64>::from_fn(n, n, |a, b| {
        let noise = if a == b { sigma_mrad * sigma_mrad } else { 0.0 };
        (noise + floor_mrad * floor_mrad * middle[(a, b)]) / (s[a] * s[b])
    });
    let whole = v * inner * v.transpose();
    // the columns of this epoch, in the order of the parameters
    let mut place = [None; COUNT];
    for k in GEOMETRY.into_iter().chain(REFERENCES) {
        let mut slopes = [0.0; super::joint::ANGLES];
        slopes[k] = 1.0;
        columns.place(epoch, &slopes, |column, value| {
            if value != 0.0 {
                place[k] = Some(column);
            }
        });
    }
    let mut out = [[0.0; COUNT]; COUNT];
    for (a, row) in out.iter_mut().enumerate() {
        for (b, value) in row.iter_mut().enumerate() {
            if let (Some(p), Some(q)) = (place[a], place[b]) {
                *value = whole[(p, q)] / (norms[p] * norms[q]);
            }
        }
    }
    out.iter().flatten().all(|x| x.is_finite()).then_some(out)
}

/// Suns over a year above 10°, evenly in time: six declinations for twelve months, every hour.
pub fn year(latitude_rad: f64) -> Vec<EnuUnit> {
    let mut suns = Vec::new();
    let (sin_latitude, cos_latitude) = libm::sincos(latitude_rad);
    for phase_deg in [-75.0_f64, -45.0, -15.0, 15.0, 45.0, 75.0] {
        let declination = libm::asin(libm::sin(OBLIQUITY_RAD) * libm::sin(phase_deg.to_radians()));
        let (sin_d, cos_d) = libm::sincos(declination);
        for hour in -12..12 {
            let (sin_h, cos_h) = libm::sincos((15.0 * f64::from(hour)).to_radians());
            let up = sin_latitude * sin_d + cos_latitude * cos_d * cos_h;
            if up < libm::sin(LOWEST_SUN_RAD) {
                continue;
            }
            let north = cos_latitude * sin_d - sin_latitude * cos_d * cos_h;
            if let Ok(sun) = EnuUnit::try_new(Enu::new(-cos_d * sin_h, north, up)) {
                suns.push(sun);
            }
        }
    }
    suns
}

/// The sky within a quarter turn of the observed suns, 10° to 70° high: where the latitude is not known.
pub fn sky(observed: &[EnuUnit]) -> Vec<EnuUnit> {
    let mut sum = Enu::default();
    for sun in observed {
        sum = sum + sun.as_enu();
    }
    let middle = libm::atan2(sum.east, sum.north);
    let mut suns = Vec::new();
    for azimuth_deg in [-90.0_f64, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0] {
        for elevation_deg in [10.0_f64, 25.0, 40.0, 55.0, 70.0] {
            suns.push(EnuUnit::from_azimuth_elevation(
                middle + azimuth_deg.to_radians(),
                elevation_deg.to_radians(),
            ));
        }
    }
    suns
}

/// RMS over suns of the beam error that a covariance causes \[mrad\], from what each parameter does to the beam at
/// each of them that can be tracked.
pub fn pointing_mrad(
    covariance: &[[f64; COUNT]; COUNT],
    tracked: &[[[f64; COUNT]; 2]],
) -> Option<f64> {
    let sum: f64 = tracked
        .iter()
        .map(|slopes| {
            let sigma = spread_mrad(slopes, covariance);
            sigma * sigma
        })
        .sum();
    (!tracked.is_empty())
        .then(|| libm::sqrt(sum / tracked.len() as f64))
        .filter(|p| p.is_finite())
}
