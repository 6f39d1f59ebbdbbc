//! Whether light arrives, and what comes to the receiver from behind.

use helio_flux::{Account, Element, FluxMap, Receiver, Scene, lit_from_behind_w};
use helio_io::FluxScene;

use super::summary::power;
use crate::failure::Failure;
use crate::printer::Printer;

/// Below this part of the reflected light what comes from behind is a ray or two at an edge.
const NEWS: f64 = 1e-3;

/// What becomes of the reflected light at the receiver.
pub(super) struct Arrival {
    reflected_w: f64,
    received_w: f64,
    /// Comes to the receiver's back; by middle rays, see [`lit_from_behind_w`].
    pub(super) behind_w: f64,
    round: bool,
}

impl Arrival {
    pub(super) fn of(
        scene: &FluxScene,
        elements: &[Element],
        sun: [f64; 3],
        map: &FluxMap,
    ) -> Result<Self, Failure> {
        let shape = scene.sun.form.shape()?;
        let behind_w = lit_from_behind_w(&Scene {
            elements,
            receiver: &scene.receiver,
            sun,
            dni_w_m2: scene.sun.dni_w_m2,
            sun_shape: &shape,
            optical_error: scene.mirror.error,
        })?;
        let account: &Account = map.account();
        Ok(Self {
            reflected_w: account.incoming_w - account.shaded_w - account.reflection_loss_w,
            received_w: account.received_w,
            behind_w,
            round: matches!(scene.receiver, Receiver::Frustum(_)),
        })
    }

    /// Whether mirrors reflect light and none of it arrives.
    pub(super) fn is_nothing(&self) -> bool {
        self.reflected_w > 0.0 && self.received_w <= 0.0
    }

    pub(super) fn say(&self, printer: &Printer) {
        let behind = self.behind_w > NEWS * self.reflected_w;
        let reflected = power(self.reflected_w);
        if behind {
            let way = if self.round {
                "through its end, to its inside, which takes no light,"
            } else {
                "to the back of its lit side, which is the side that `facing` (of a target `normal_enu`) points out \
                 of,"
            };
            printer.warn(format_args!(
                "the receiver is lit from behind: of {reflected} reflected about {} come {way} and pass",
                power(self.behind_w)
            ));
        }
        if self.is_nothing() {
            let why = if behind {
                ""
            } else {
                ": mirrors send it beside the receiver, or away from it"
            };
            printer.warn(format_args!(
                "none of the {reflected} reflected arrives on the receiver{why}"
            ));
        }
    }
}
