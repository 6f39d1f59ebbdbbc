//! Files that fuzzing found, and files broken at random: a message or a mesh, never a panic.

use std::fs;
use std::path::{Path, PathBuf};

use crate::whole_way;

fn data() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/mesh/data")
}

/// The format of a file by its name; `None` for what is no mesh.
fn format(path: &Path) -> Option<&'static str> {
    match path.extension()?.to_str()? {
        "inp" => Some("inp"),
        "frd" => Some("frd"),
        "msh" => Some("gmsh"),
        "vtk" | "vtu" | "vtp" => Some("vtk"),
        _ => None,
    }
}

/// Every file of the tests, with its format; three tables as one.
fn files() -> Vec<(&'static str, Vec<u8>)> {
    let mut files = Vec::new();
    for folder in [data(), data().join("vtk")] {
        let mut paths: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().path())
            .collect();
        paths.sort();
        for path in paths {
            if let Some(format) = format(&path) {
                files.push((format, fs::read(path).unwrap()));
            }
        }
    }
    let tables = "node,x_m,y_m,z_m\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,1,1,0\n---\n\
        element,node1,node2,node3,node4,set\n1,1,2,4,3,a\n2,1,2,3,,b\n---\n\
        node,ux_m,uy_m,uz_m\n1,0,0,0\n2,0,0,0.1\n3,0,0,0\n4,0,0,0.1\n";
    files.push(("csv", tables.as_bytes().to_vec()));
    files
}

/// `data/found`: of the smallest set of files that reach all that fuzzing reached, twelve of each format,
/// from small to large.
#[test]
fn what_fuzzing_found() {
    let mut replayed = 0;
    let folder = data().join("found");
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        let format = name.split('-').next().unwrap();
        whole_way::read(format, &fs::read(&path).unwrap());
        replayed += 1;
    }
    assert!(replayed > 50, "{replayed}");
}

/// Bytes changed, put in, taken out and cut off, by a generator with a fixed seed.
#[test]
fn files_broken_at_random() {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut next = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let mut tried = 0;
    for (format, whole) in files() {
        whole_way::read(format, &whole);
        for _ in 0..60 {
            let mut bytes = whole.clone();
            for _ in 0..1 + next() % 3 {
                let at = (next() % bytes.len() as u64) as usize;
                match next() % 5 {
                    0 => bytes[at] = next() as u8,
                    1 => drop(bytes.splice(at..at, *b"999")),
                    2 => drop(bytes.splice(at..at, *b"-1e3 ")),
                    3 => drop(bytes.drain(at..(at + 8).min(bytes.len()))),
                    _ => bytes.truncate(at.max(1)),
                }
                if bytes.is_empty() {
                    bytes.push(b'\n');
                }
            }
            whole_way::read(format, &bytes);
            tried += 1;
        }
    }
    assert!(tried > 2000, "{tried}");
}
