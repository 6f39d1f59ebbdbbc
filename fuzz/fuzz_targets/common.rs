//! What every decoder target asks.

use std::sync::Once;

use helio_spot::{Frame, Limits, decode};

/// Panics inside `decode` are its own business, as long as none leaves it: say where, go on.
static HOOK: Once = Once::new();

/// Bytes give a frame within the limits, or an error with a message.
pub fn decode_one(bytes: &[u8]) {
    HOOK.call_once(|| {
        std::panic::set_hook(Box::new(|panic| {
            eprintln!("panic at {:?}", panic.location());
        }));
    });
    let mut limits = Limits::with_max_pixels(1 << 20);
    limits.max_bytes = 4 << 20;
    match decode(bytes, &limits) {
        Ok(Frame::Gray8(picture)) => {
            let view = picture.view();
            assert!((1..=1 << 20).contains(&(view.width() * view.height())));
        }
        Ok(Frame::Gray16(picture)) => {
            let view = picture.view();
            assert!((1..=1 << 20).contains(&(view.width() * view.height())));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}
