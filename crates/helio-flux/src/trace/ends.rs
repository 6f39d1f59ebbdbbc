//! Where reflected rays end: at the receiver, or past it.

use crate::receiver::Receiver;
use crate::vector::{Vector, dot, sub};

/// Where the rays of an element end; nothing past it is in their way.
///
/// A ray that meets the receiver ends there. One that misses ends in the plane of a flat receiver, and at the latest in
/// a plane behind all of the receiver, square to the element's middle ray.
///
/// Rays run along the middle ray, a unit vector, plus something square to it: a plane square to it that is `d` ahead of
/// a ray's origin is met after `d` lengths of its direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ends<'a> {
    receiver: &'a Receiver,
    origin: Vector,
    pub middle: Vector,
    /// True if all hits lie in the gate.
    pub is_flat: bool,
    /// The plane of a flat receiver, else the last one: its normal, and how far it is from the element along that.
    pub gate: Vector,
    pub gate_offset_m: f64,
    /// Planes square to the middle ray before and behind all of the receiver, as far from the element.
    pub near_m: f64,
    pub far_m: f64,
}

impl<'a> Ends<'a> {
    /// Of an element at `origin` with its middle ray.
    pub(super) fn new(receiver: &'a Receiver, middle: Vector, origin: Vector) -> Self {
        let to_centre_m = dot(middle, sub(receiver.centre_m(), origin));
        let flat = receiver.plane();
        // Past a flat receiver's edge its plane goes on, as far as it is anywhere from the middle.
        let half_m = match flat {
            Some(_) => receiver.radius_m(),
            None => receiver.half_extent_m(middle),
        };
        let far_m = to_centre_m + half_m;
        let (gate, gate_offset_m) = match flat {
            Some((normal, through)) => (normal, dot(normal, sub(through, origin))),
            None => (middle, far_m),
        };
        Self {
            receiver,
            origin,
            middle,
            is_flat: flat.is_some(),
            gate,
            gate_offset_m,
            near_m: to_centre_m - half_m,
            far_m,
        }
    }

    /// Where a ray ends if it meets no receiver, in lengths of its direction.
    pub(super) fn of_miss(&self, from: Vector, direction: Vector) -> f64 {
        let from = sub(from, self.origin);
        let gate = (self.gate_offset_m - dot(self.gate, from)) / dot(self.gate, direction);
        gate.min(self.far_m - dot(self.middle, from))
    }

    /// True if something that `is_met` before a way, in lengths of the direction, keeps a ray from where it ends.
    pub(super) fn is_cut(
        &self,
        from: Vector,
        direction: Vector,
        is_met: impl Fn(f64) -> bool,
    ) -> bool {
        // Most rays meet nothing at all: where they hit is asked last.
        is_met(self.of_miss(from, direction))
            && (self.is_flat
                || match self.receiver.hit(from, direction) {
                    Some(hit) => is_met(hit.along),
                    None => true,
                })
    }
}
