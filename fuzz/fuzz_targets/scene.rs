//! Files `scene.toml`, and rays in what they describe.
#![no_main]

use std::cell::OnceCell;

use libfuzzer_sys::fuzz_target;

#[path = "../../crates/helio-io/tests/io/any_scene.rs"]
mod any_scene;

thread_local! {
    /// Kept for all runs; the folder goes with the process's temporary ones.
    static PLACE: OnceCell<any_scene::Place> = const { OnceCell::new() };
}

fuzz_target!(|bytes: &[u8]| {
    // A name that a scene gives its receiver is opened: none that leads out of the folder.
    if bytes.contains(&b'/') {
        return;
    }
    PLACE.with(|place| {
        let place = place.get_or_init(|| {
            let folder = std::env::temp_dir().join(format!("helio-scene-{}", std::process::id()));
            std::fs::create_dir_all(&folder).expect("a temporary folder");
            any_scene::Place::new(&folder)
        });
        place.read(bytes);
    });
});
