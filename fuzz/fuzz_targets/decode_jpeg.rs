//! JPEG files.
#![no_main]

use libfuzzer_sys::fuzz_target;

mod common;

fuzz_target!(|bytes: &[u8]| {
    if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        common::decode_one(bytes);
    }
});
