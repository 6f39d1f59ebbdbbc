//! What is to be traced: pieces of elements, and how many rays each gets.

use super::beam::{Piece, pieces};
use super::{RayOptions, Rays, Scene};
use crate::element::Element;
use crate::error::FluxError;
use crate::vector::{Vector, dot};

/// Rays of an element come in multiples of this, the width of the widest vectors.
const ROUND: u64 = 16;

/// A piece with its rays.
#[derive(Debug, Clone, Copy)]
pub(super) struct Job {
    pub piece: Piece,
    /// The element it is a piece of.
    pub element: u32,
    /// Index of the first of its rays, among all.
    pub first_ray: u64,
    pub rays: u64,
    /// Quanta that a ray brings, and that are left of them when it is reflected.
    pub weight: u64,
    pub reflected: u64,
}

/// What is to be traced.
pub(super) struct Plan {
    pub jobs: Vec<Job>,
    pub rays: u64,
    pub quantum_w: f64,
    pub mirror_w: f64,
    pub turned_away: usize,
}

/// Quanta in all the light: room for four times as many in 64 bits, since every ray's are rounded.
const QUANTA: f64 = (1_u64 << 60) as f64;

/// Most rays: some minutes of a thread per thousandth of it, and a weight is still known to 1e-6.
const MAX_RAYS: u64 = 1 << 40;

impl Plan {
    pub(super) fn new(
        scene: &Scene<'_>,
        sun: Vector,
        options: &RayOptions,
    ) -> Result<Self, FluxError> {
        let (Rays::PerElement(wanted) | Rays::Total(wanted)) = options.rays;
        let too_many = |rays: u64| FluxError::BadValue {
            who: "rays",
            what: "their number",
            wanted: "within 1..=2⁴⁰, in all and for each element",
            value: rays as f64,
        };
        if !(1..=MAX_RAYS).contains(&wanted) {
            return Err(too_many(wanted));
        }
        let mut plan = Self {
            jobs: Vec::with_capacity(scene.elements.len()),
            rays: 0,
            quantum_w: 1.0,
            mirror_w: 0.0,
            turned_away: 0,
        };
        let power_of = |element: &Element| scene.dni_w_m2 * element.aperture_m2(sun);
        let all_w: f64 = scene.elements.iter().map(power_of).sum();
        if all_w > 0.0 {
            plan.quantum_w = all_w / QUANTA;
        }
        for (number, element) in scene.elements.iter().enumerate() {
            let power_w = power_of(element);
            if dot(element.normal(), sun) <= 0.0 {
                plan.turned_away += 1;
                continue;
            }
            plan.mirror_w += scene.dni_w_m2 * element.area_m2();
            if power_w <= 0.0 {
                continue;
            }
            for piece in pieces(element, options.origins) {
                let piece_w = power_w * piece.share;
                let rays = match options.rays {
                    Rays::PerElement(count) => count,
                    Rays::Total(count) => (piece_w / all_w * count as f64).ceil() as u64,
                };
                let rays = rays.max(1).next_multiple_of(ROUND);
                let quanta = piece_w / plan.quantum_w / rays as f64;
                plan.jobs.push(Job {
                    piece,
                    element: number as u32,
                    first_ray: plan.rays,
                    rays,
                    weight: quanta.round() as u64,
                    reflected: (quanta * element.reflectivity()).round() as u64,
                });
                plan.rays += rays;
                if plan.rays > MAX_RAYS {
                    return Err(too_many(plan.rays));
                }
            }
        }
        // Of what the weights were rounded to, so that all the light is all of it.
        let quanta: u64 = plan.jobs.iter().map(|job| job.rays * job.weight).sum();
        if quanta > 0 {
            plan.quantum_w = all_w / quanta as f64;
        }
        Ok(plan)
    }
}
