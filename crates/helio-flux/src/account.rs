//! Where the light went.

/// The power of a scene's light, from the sun to the receiver \[W\].
///
/// The parts add up: incoming = shaded + reflection loss + blocked + spilled + received.
/// What is traced is counted in whole quanta of power, so they do to rounding.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Account {
    /// Direct irradiance times the area of the elements that the sun sees the reflecting side of.
    pub mirror_w: f64,
    /// Direct irradiance times their apertures: [`mirror_w`](Self::mirror_w) less the loss by the cosine.
    pub incoming_w: f64,
    /// Kept from the elements by other mirrors.
    pub shaded_w: f64,
    /// Fell on an element and was not reflected.
    pub reflection_loss_w: f64,
    /// Was reflected and fell on another mirror.
    pub blocked_w: f64,
    /// Was reflected and missed the receiver.
    pub spilled_w: f64,
    /// Fell on the receiver.
    pub received_w: f64,
    /// Rays traced; 0 for a convolution.
    pub rays: u64,
    /// Elements whose reflecting side is turned away from the sun.
    pub turned_away: usize,
}

impl Account {
    /// Part of the power that leaves the direction of the sun toward mirrors facing it and falls on the
    /// receiver: 0 if there is none.
    #[must_use]
    pub fn efficiency(&self) -> f64 {
        if self.mirror_w > 0.0 {
            self.received_w / self.mirror_w
        } else {
            0.0
        }
    }

    /// Incoming power less all that is accounted for \[W\].
    #[must_use]
    pub fn unaccounted_w(&self) -> f64 {
        self.incoming_w
            - (self.shaded_w
                + self.reflection_loss_w
                + self.blocked_w
                + self.spilled_w
                + self.received_w)
    }
}
