//! How much bins scatter from seed to seed, against what random rays would: many small mirrors traced by few rays each.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests fail and talk"
)]

mod common;

use common::*;
use helio_flux::{
    Element, FluxMap, OpticalError, RayOptions, Rays, Scene, SunShape, peak_excess, trace_rays,
};

/// Level mirrors in a square of 2 m, or turned to send the sun's middle to one point.
fn mirrors(side: usize, canted: bool) -> Vec<Element> {
    let size = 2.0 / side as f64;
    let at = |k: usize| (k as f64 + 0.5) * size - 1.0;
    let half = 0.45 * size;
    (0..side * side)
        .map(|k| {
            let centre = [at(k % side), at(k / side), 0.0];
            let slope = |x: f64| if canted { x / 200.0 } else { 0.0 };
            let (a, b) = (slope(centre[0]), slope(centre[1]));
            rectangle(centre, [half, 0.0, half * a], [0.0, half, half * b])
        })
        .collect()
}

/// Of maps by many seeds: the variance of bright bins over that of counts of random rays, and by how much the greatest bin is
/// above what is greatest in the mean of all, as it is told and as it is found.
struct Scatter {
    variance: f64,
    told: f64,
    found: f64,
}

fn scatter(scene: &Scene<'_>, rays: Rays, seeds: u64) -> Scatter {
    let maps: Vec<FluxMap> = (0..seeds)
        .map(|seed| {
            let options = RayOptions {
                rays,
                seed,
                ..RayOptions::default()
            };
            trace_rays(scene, &options).unwrap()
        })
        .collect();
    let over_maps = |of: &dyn Fn(&FluxMap) -> f64| maps.iter().map(of).sum::<f64>() / seeds as f64;
    let account = maps[0].account();
    let ray_w = account.incoming_w / account.rays as f64;
    let means: Vec<f64> = (0..scene.receiver.bins())
        .map(|bin| over_maps(&|map| map.irradiance_w_m2()[bin]))
        .collect();
    let peak = means.iter().copied().fold(0.0, f64::max);
    let (mut ratio, mut number) = (0.0, 0);
    for (bin, &mean) in means.iter().enumerate().filter(|(_, m)| **m > 0.5 * peak) {
        let squares = over_maps(&|map| (map.irradiance_w_m2()[bin] - mean).powi(2));
        let variance = squares * seeds as f64 / (seeds - 1) as f64;
        ratio += variance / (mean * ray_w / scene.receiver.bin_area_m2(bin));
        number += 1;
    }
    Scatter {
        variance: ratio / f64::from(number),
        told: over_maps(&|map| peak_excess(scene.receiver, map).unwrap()),
        found: over_maps(&|map| map.peak().0 / peak - 1.0),
    }
}

// However few rays a mirror has and however many mirrors share a set: bins scatter as those of random rays or less, and the
// greatest is above the rest by no more than is told.
#[test]
fn many_small_mirrors_scatter_no_more_than_random_rays() {
    let sun_shape = SunShape::limb_darkened(4.65e-3).unwrap();
    let errors = [(0.0, 0.0), (1e-3, 3e-4)].map(|(a, b)| OpticalError::new(a, b).unwrap());
    for (side, canted) in [(60, false), (60, true), (150, false), (150, true)] {
        let elements = mirrors(side, canted);
        for bins in [24, 96, 300] {
            let receiver = screen(bins);
            for (optical_error, per_element) in
                errors.iter().flat_map(|e| [16, 36, 256].map(|n| (*e, n)))
            {
                let scene = Scene {
                    elements: &elements,
                    receiver: &receiver,
                    sun: [0.02, 0.01, 1.0],
                    dni_w_m2: 1000.0,
                    sun_shape: &sun_shape,
                    optical_error,
                };
                let Scatter {
                    variance,
                    told,
                    found,
                } = scatter(&scene, Rays::PerElement(per_element), 12);
                let line = format!(
                    "{side}² mirrors, canted: {canted}, {bins}² bins, {per_element} rays each, {optical_error:?}: \
                     variance {variance:.2}, told {told:.4}, found {found:.4}"
                );
                println!("{line}");
                // of some hundred bins and twelve maps the ratio of random rays is 1.00 ± 0.05
                assert!(variance < 1.15, "{line}");
                // the mean of the maps has a scatter of its own
                assert!(found < 1.2 * told + 1e-3, "{line}");
            }
        }
    }
}
