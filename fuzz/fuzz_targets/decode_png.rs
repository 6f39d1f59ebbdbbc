//! PNG files.
#![no_main]

use libfuzzer_sys::fuzz_target;

mod common;

fuzz_target!(|bytes: &[u8]| {
    if bytes.starts_with(b"\x89PNG") {
        common::decode_one(bytes);
    }
});
