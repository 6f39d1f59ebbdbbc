//! Image files of every layout against gray values worked out elsewhere, and files that must be refused.
#![allow(clippy::unwrap_used, reason = "tests fail")]

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use helio_spot::{DecodeError, Frame, Limits, RawFormat, RawVideo, VideoError, decode};

fn corpus() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/corpus")
}

/// Bits, width, height, gray values.
fn contents(frame: &Frame) -> (u32, usize, usize, Vec<u32>) {
    match frame {
        Frame::Gray8(picture) => {
            let view = picture.view();
            let gray = view.rows().flatten().map(|&g| g.into()).collect();
            (8, view.width(), view.height(), gray)
        }
        Frame::Gray16(picture) => {
            let view = picture.view();
            let gray = view.rows().flatten().map(|&g| g.into()).collect();
            (16, view.width(), view.height(), gray)
        }
    }
}

fn name_of(error: &DecodeError) -> String {
    let debug = format!("{error:?}");
    let end = debug.find([' ', '{', '(']).unwrap_or(debug.len());
    debug[..end].to_owned()
}

#[test]
fn every_file_of_the_corpus() {
    let expected = fs::read_to_string(corpus().join("expected.txt")).unwrap();
    let mut listed = BTreeSet::from(["expected.txt", "README.md"].map(str::to_owned));
    let mut wrong = Vec::new();
    for line in expected.lines().filter(|line| !line.starts_with('#')) {
        let mut words = line.split(' ');
        let name = words.next().unwrap();
        listed.insert(name.to_owned());
        let bytes = fs::read(corpus().join(name)).unwrap();
        let found = decode(&bytes, &Limits::default());
        let first = words.next().unwrap();
        if first == "error" {
            let right = words.next().unwrap();
            match found {
                Ok(frame) => wrong.push(format!("{name}: decoded: {:?}", contents(&frame))),
                Err(error) if !right.split('|').any(|name| name == name_of(&error)) => {
                    wrong.push(format!("{name}: {error:?}, not {right}"));
                }
                Err(_) => {}
            }
            continue;
        }
        let numbers: Vec<u32> = words.map(|word| word.parse().unwrap()).collect();
        let bits: u32 = first.parse().unwrap();
        let (width, height, gray) = (numbers[0] as usize, numbers[1] as usize, &numbers[2..]);
        // Another decoder's inverse cosine transform and colours may round otherwise.
        let jpeg = bytes.starts_with(&[0xff, 0xd8]);
        let most = if jpeg { 2 } else { 0 };
        match found.as_ref().map(contents) {
            Err(error) => wrong.push(format!("{name}: {error:?}")),
            Ok(found) => {
                let off = found.3.iter().zip(gray).map(|(a, b)| a.abs_diff(*b)).max();
                if (found.0, found.1, found.2) != (bits, width, height)
                    || found.3.len() != gray.len()
                    || off > Some(most)
                {
                    wrong.push(format!(
                        "{name}: off by {off:?}, size {:?}",
                        (found.0, found.1, found.2)
                    ));
                }
            }
        }
    }
    for file in fs::read_dir(corpus()).unwrap() {
        let file = file.unwrap();
        let name = file.file_name().into_string().unwrap();
        if file.path().is_file() && !listed.contains(&name) {
            wrong.push(format!("{name}: not listed"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_prefix_of_a_file_is_refused_or_whole() {
    for name in [
        "gray8.png",
        "gray16.tif",
        "gray8.pgm",
        "rgb8-ascii.ppm",
        "colour.jpg",
    ] {
        let bytes = fs::read(corpus().join(name)).unwrap();
        let whole = decode(&bytes, &Limits::default()).unwrap();
        for end in 0..bytes.len() {
            match decode(&bytes[..end], &Limits::default()) {
                // What follows the picture may be missing: PNG's last chunk, a tag of the TIFF, the last digit.
                Ok(frame) => {
                    let missing = bytes.len() - end;
                    let last_digit = name == "rgb8-ascii.ppm" && missing <= 2;
                    let (found, wanted) = (contents(&frame), contents(&whole));
                    assert!(
                        found == wanted || last_digit,
                        "{name}: {missing} bytes missing"
                    );
                    assert!(missing <= 16, "{name}: {missing} bytes missing");
                }
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
}

#[test]
fn limits_are_the_callers() {
    let bytes = fs::read(corpus().join("rgb16.png")).unwrap(); // 7 x 5
    assert!(decode(&bytes, &Limits::with_max_pixels(35)).is_ok());
    assert_eq!(
        decode(&bytes, &Limits::with_max_pixels(34))
            .unwrap_err()
            .to_string(),
        "an image of 7 x 5 pixels: at most 34 pixels are read"
    );
    let mut limits = Limits::default();
    limits.max_bytes = 35 * 6 - 1;
    assert_eq!(
        decode(&bytes, &limits).unwrap_err().to_string(),
        "an image that takes more than 209 bytes when decoded"
    );
}

#[test]
fn raw_video() {
    let bytes: Vec<u8> = (0..=255).cycle().take(3 * 12 + 5).collect();
    let mut video = RawVideo::new(&bytes[..], 4, 3, RawFormat::Gray8, &Limits::default()).unwrap();
    for k in 0..3_u32 {
        let frame = video.next().unwrap().unwrap();
        assert_eq!(contents(&frame), (8, 4, 3, (12 * k..12 * k + 12).collect()));
    }
    let error = video.next().unwrap().unwrap_err();
    assert_eq!(
        error.to_string(),
        "frame 3, counted from 0: the stream ends after 5 of its 12 bytes"
    );
    assert!(video.next().is_none());

    let words = [0x34, 0x12, 0xff, 0x00, 0x01];
    let mut video =
        RawVideo::new(&words[..4], 2, 1, RawFormat::Gray16Le, &Limits::default()).unwrap();
    let frame = video.next().unwrap().unwrap();
    assert_eq!(contents(&frame), (16, 2, 1, vec![0x1234, 0xff]));
    assert!(video.next().is_none());
    let mut odd =
        RawVideo::new(&words[..3], 2, 1, RawFormat::Gray16Le, &Limits::default()).unwrap();
    assert!(matches!(
        odd.next(),
        Some(Err(VideoError::ShortFrame {
            frame: 0,
            found: 3,
            wanted: 4
        }))
    ));

    let nothing: &[u8] = &[];
    let new =
        |width, height| RawVideo::new(nothing, width, height, RawFormat::Gray8, &Limits::default());
    assert!(new(4, 3).unwrap().next().is_none());
    assert!(matches!(new(0, 3), Err(DecodeError::NoPixels { .. })));
    assert!(matches!(
        new(10_000, 10_000),
        Err(DecodeError::TooManyPixels { .. })
    ));
    assert!(matches!(
        new(usize::MAX, 3),
        Err(DecodeError::TooManyPixels { .. })
    ));
}

#[test]
fn a_stream_that_fails_is_said() {
    struct Broken;
    impl std::io::Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("cable pulled"))
        }
    }
    let mut video = RawVideo::new(Broken, 4, 3, RawFormat::Gray8, &Limits::default()).unwrap();
    let error = video.next().unwrap().unwrap_err();
    assert_eq!(error.to_string(), "frame 0, counted from 0: cable pulled");
    assert!(video.next().is_none());
}

#[test]
fn what_fuzzing_found() {
    // Each gives a frame within the limits or is refused with a sentence, and twice the same.
    let mut limits = Limits::with_max_pixels(1 << 20);
    limits.max_bytes = 4 << 20;
    let mut count = 0;
    for file in fs::read_dir(corpus().join("found")).unwrap() {
        let path = file.unwrap().path();
        let bytes = fs::read(&path).unwrap();
        let found = decode(&bytes, &limits);
        match &found {
            Ok(frame) => {
                let (_, width, height, gray) = contents(frame);
                assert!(gray.len() == width * height && (1..=1 << 20).contains(&gray.len()));
            }
            Err(error) => {
                // Decoders quote from files: one of them 261 kB.
                let said = error.to_string();
                let long = said.chars().count();
                assert!((1..=200).contains(&long), "{}: {long}", path.display());
                assert!(!said.contains(char::is_control), "{}", path.display());
            }
        }
        assert_eq!(decode(&bytes, &limits), found, "{}", path.display());
        assert!(!helio_spot::is_decoding());
        count += 1;
    }
    assert!(count > 0);
}

/// What fuzzing found to panic in a decoder is told as such while it lasts, so that a program can keep silent about it.
#[test]
fn panics_of_decoders_are_known_as_such() {
    use std::sync::atomic::{AtomicUsize, Ordering};
    static WITHIN: AtomicUsize = AtomicUsize::new(0);
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if helio_spot::is_decoding() {
            WITHIN.fetch_add(1, Ordering::Relaxed);
        } else {
            hook(info);
        }
    }));
    let mut panics = 0;
    for file in fs::read_dir(corpus().join("found")).unwrap() {
        let path = file.unwrap().path();
        if !path.to_string_lossy().contains("-panic-") {
            continue;
        }
        // With all the pixels that decode allows unless told otherwise.
        let found = decode(&fs::read(&path).unwrap(), &Limits::default());
        panics += usize::from(
            found.is_err_and(|error| error.to_string().ends_with("the decoder gave up")),
        );
    }
    // Other tests of this program decode too.
    assert!(
        panics > 0 && WITHIN.load(Ordering::Relaxed) >= panics,
        "{panics}"
    );
}
