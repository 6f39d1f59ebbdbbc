//! Scenes that fuzzing begins from, and scenes broken at random: a message or a scene, never a panic.

use std::fs;
use std::path::PathBuf;

use crate::any_scene::Place;

/// Every scene of `scenes/` and of the examples.
fn scenes() -> Vec<(String, Vec<u8>)> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let mut paths: Vec<PathBuf> = fs::read_dir(root.join("tests/io/scenes"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    for example in ["strips.toml", "tower.toml"] {
        paths.push(root.join("../../examples/flux").join(example));
    }
    paths.sort();
    let name = |path: &PathBuf| path.file_name().unwrap().to_str().unwrap().to_owned();
    paths
        .iter()
        .map(|path| (name(path), fs::read(path).unwrap()))
        .collect()
}

/// Those that are called `wrong-…` are scenes of nothing; the others of a mesh, of a field, or of both.
#[test]
fn the_corpus_of_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let place = Place::new(folder.path());
    let all = scenes();
    assert!(all.len() >= 14, "{}", all.len());
    for (name, bytes) in all {
        let read = place.read(&bytes);
        assert_eq!(read == 0, name.starts_with("wrong-"), "{name}: {read}");
    }
}

/// Bytes changed, put in, taken out and cut off, by a generator with a fixed seed.
#[test]
fn scenes_broken_at_random() {
    let folder = tempfile::tempdir().unwrap();
    let place = Place::new(folder.path());
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut next = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let (mut tried, mut refused) = (0, 0);
    for (_, whole) in scenes() {
        for _ in 0..80 {
            let mut bytes = whole.clone();
            for _ in 0..1 + next() % 3 {
                let at = (next() % bytes.len() as u64) as usize;
                match next() % 6 {
                    0 => bytes[at] = next() as u8,
                    1 => drop(bytes.splice(at..at, *b"99")),
                    2 => drop(bytes.splice(at..at, *b"-1e300")),
                    3 => drop(bytes.splice(at..at, *b"nan")),
                    4 => drop(bytes.drain(at..(at + 8).min(bytes.len()))),
                    _ => bytes.truncate(at.max(1)),
                }
                if bytes.is_empty() {
                    bytes.push(b'\n');
                }
            }
            refused += usize::from(place.read(&bytes) == 0);
            tried += 1;
        }
    }
    assert!(tried >= 1000 && refused > tried / 4, "{tried} {refused}");
}
