//! Raw video: two bytes of size, one of format, then the stream.
#![no_main]

use helio_spot::{Limits, RawFormat, RawVideo};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let [width, height, format, stream @ ..] = bytes else {
        return;
    };
    let (format, size) = if format & 1 == 0 {
        (RawFormat::Gray8, 1)
    } else {
        (RawFormat::Gray16Le, 2)
    };
    let (width, height) = (usize::from(*width), usize::from(*height));
    let Ok(video) = RawVideo::new(stream, width, height, format, &Limits::default()) else {
        assert!(width * height == 0);
        return;
    };
    let frame = width * height * size;
    let (mut good, mut bad) = (0, 0);
    for frame in video {
        match frame {
            Ok(_) => good += 1,
            Err(_) => bad += 1,
        }
    }
    assert_eq!(good, stream.len() / frame);
    assert_eq!(bad, usize::from(stream.len() % frame > 0));
});
