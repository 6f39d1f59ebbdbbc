//! Spoilt files never panic: every byte of good ones is cut, dropped and replaced in turn.

use crate::files::{FIELD, Folder, LAYOUT, floats, texts};

const DRIVES: &str = "[heliostats.drive.axis1]\ntype = \"encoder\"\nsteps_per_deg = 100\n";

#[test]
fn spoilt_files_are_refused_or_read_but_never_panic() {
    let toml = format!("{FIELD}calibration = \"cal.csv\"\n{DRIVES}");
    let calibration = "id,set,mirror_tilt_deg,valid_from\nA1,x,0.1,2026-01-01T00:00:00Z\n";
    let folder = Folder::of_field()
        .with("field.toml", &toml)
        .with("cal.csv", calibration);
    folder.load().unwrap();
    let spoil = |name: &str, good: &[u8], folder: Folder| {
        let (mut refused, mut folder) = (0, folder);
        for at in 0..good.len() {
            let mut versions = vec![good[..at].to_vec()];
            for byte in [b'"', b',', b'\n', b'[', 0, 0xFF] {
                let mut version = good.to_vec();
                version[at] = byte;
                versions.push(version);
            }
            for version in versions {
                folder = folder.with(name, version);
                if let Err(error) = folder.load() {
                    refused += 1;
                    assert!(!error.to_string().is_empty());
                }
            }
        }
        assert!(refused > good.len(), "{name}: {refused}");
        folder.with(name, good)
    };
    let folder = spoil("field.toml", toml.as_bytes(), folder);
    let folder = spoil("layout.csv", LAYOUT.as_bytes(), folder);
    spoil("cal.csv", calibration.as_bytes(), folder);
}

#[test]
fn spoilt_parquet_never_panics() {
    let columns = vec![
        ("id", texts(&["A1", "A2"])),
        ("east_m", floats(&[1.0, 2.0])),
        ("north_m", floats(&[1.0, 2.0])),
        ("up_m", floats(&[1.0, 2.0])),
    ];
    let mut folder = Folder::of_field()
        .edited(&[("layout.csv", "layout.parquet")], "")
        .with_parquet("layout.parquet", columns);
    folder.load().unwrap();
    // As a program would: these panics are caught, and their messages help nobody.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if std::thread::current().name() != Some(helio_io::PARQUET_THREAD) {
            hook(info);
        }
    }));
    let good = std::fs::read(folder.path("layout.parquet")).unwrap();
    for at in 0..good.len() {
        for byte in [0, 0x7F, 0xFF, good[at] ^ 1] {
            let mut version = good.clone();
            version[at] = byte;
            folder = folder.with("layout.parquet", version);
            let _ = folder.load();
        }
        folder = folder.with("layout.parquet", &good[..at]);
        assert!(folder.load().is_err());
    }
}

#[test]
fn deep_nesting_is_refused() {
    for (open, close) in [("[", "]"), ("{a=", "}")] {
        let text = format!("site = {}{}", open.repeat(100_000), close.repeat(100_000));
        assert!(Folder::new().with("field.toml", text).load().is_err());
    }
}
