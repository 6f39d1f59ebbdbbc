//! State files of followed fields.

use std::fs::OpenOptions;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use helio_calib::Mount;
use helio_calib::joint::{
    AccountParts, Alarm, AxisCause, Cause, HeliostatParts, JumpSeen, Lately, Mishaps, Noise, Spell,
    SpotCause, StateParts, Wander, Watch,
};
use helio_io::output::{Cells, Destination, Format, write_columns};
use helio_io::{KeptMount, LoadedField, Sha256, StateFile, load_field, read_state, write_state};

const FIELD: &str = r#"
[site]
latitude_deg = 37.4
longitude_deg = -6.25
elevation_m = 20.0
[targets.board]
centre_enu_m = [0.0, 8.0, 70.0]
normal_enu = [0.0, 1.0, 0.0]
width_m = 14.0
height_m = 12.0
[heliostats]
table = "heliostats.csv"
aim = "board"
mirror_offset_m = 0.3
"#;
const HELIOSTATS: &str = "id,east_m,north_m,up_m\nA1,-40,100,3\nA2,0.5,110,3\n\"B, 3\",60,240,3\n";

fn field(folder: &Path, toml: &str, heliostats: &str) -> LoadedField {
    std::fs::write(folder.join("field.toml"), toml).unwrap();
    std::fs::write(folder.join("heliostats.csv"), heliostats).unwrap();
    load_field(&folder.join("field.toml")).unwrap()
}

/// Doubles of all sizes that no short text is.
fn odd(seed: u64, count: usize) -> Vec<f64> {
    let mut x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    (0..count)
        .map(|k| {
            x ^= x << 13;
            x ^= x >> 7;
            x ^= x << 17;
            let number = f64::from_bits(x);
            match k % 7 {
                0 => -0.0,
                1 if number.is_finite() => number,
                2 => f64::MIN_POSITIVE / 3.0,
                _ => (x >> 11) as f64 / 3.0e14 - 10.0,
            }
        })
        .collect()
}

fn account(seed: u64, doubted: bool) -> AccountParts {
    AccountParts {
        log_likelihood: -0.1 * seed as f64,
        drift: [0.1 * seed as f64, -0.2],
        drift_variance: 0.3,
        unbelieved: 2,
        lately: Lately {
            odd: 1.0 / 3.0,
            records: 15.7,
        },
        mean: odd(seed, 11),
        gain: odd(seed + 1, 154),
        spread: odd(seed + 2, 66),
        matrix: if doubted {
            odd(seed + 3, 105)
        } else {
            Vec::new()
        },
        vector: if doubted {
            odd(seed + 4, 14)
        } else {
            Vec::new()
        },
        square: if doubted { 1.0 / 3.0 } else { 0.0 },
        outliers: if doubted { vec![0, 2] } else { Vec::new() },
        jumps: if doubted {
            vec![(1, 0), (2, 1)]
        } else {
            Vec::new()
        },
    }
}

fn state(loaded: &LoadedField) -> StateFile {
    let field = &loaded.field;
    let heliostats = field
        .ids()
        .iter()
        .enumerate()
        .map(|(k, id)| HeliostatParts {
            id: id.clone(),
            last_day: (k != 1).then_some(20_454.123_456_789 + k as f64),
            records: 12 + k as u64,
            misses: 2 * k as u64,
            outliers: k as u64,
            jump_count: 2 + k as u64,
            jumps: vec![
                JumpSeen {
                    day: 1.0 / 3.0,
                    axis: 1
                };
                k
            ],
            undecided: if k == 2 {
                vec![1.5, 2.5, 3.5]
            } else {
                Vec::new()
            },
            accounts: (0..=k as u64)
                .map(|n| account(10 * k as u64 + n, k == 2))
                .collect(),
        })
        .collect();
    let area = loaded.targets["board"].area.unwrap();
    StateFile {
        parts: StateParts {
            noise: Noise {
                beam_mrad: 0.1,
                spot_m: 1.0 / 3.0,
                sun_path_s: 5.7,
            },
            wander: Wander {
                slow_mrad: [0.1, 0.7],
                slow_days: 60.3,
                fast_mrad: [1.0 / 7.0, 0.2],
                fast_days: 0.3,
            },
            mishaps: Mishaps::default(),
            alarm: Alarm::default(),
            site_latitude_rad: loaded.site.as_ref().unwrap().latitude_rad,
            own: vec![AxisCause::Axis2Eccentricity],
            shared: vec![
                Cause::Axis(AxisCause::Axis1Sag),
                Cause::Axis(AxisCause::Axis2Sag),
                Cause::Target(SpotCause::TargetRight, 0),
                Cause::Target(SpotCause::TargetDown, 0),
                Cause::Spots(SpotCause::SunTime),
            ],
            prior_sigma: odd(1, 14),
            spread: odd(2, 28),
            matrix: odd(3, 105),
            vector: odd(4, 14),
            square: 0.1 + 0.2,
            log_determinant: -1e-300,
            watch: Watch {
                days: [20_302.0, 20_305.0],
                waiting: [(0, 0.1), (2, 1e9)].into_iter().collect(),
                calm: 2,
                spells: vec![
                    Spell {
                        days: [20_000.0, 20_010.0],
                        heliostats: 12,
                        middle: 7.0 / 3.0,
                        lasts: false,
                    },
                    Spell {
                        days: [20_300.0, 20_301.0],
                        heliostats: 9,
                        middle: 1e9,
                        lasts: true,
                    },
                ],
            },
            heliostats,
        },
        targets: vec![("board".into(), area.plane)],
        site_longitude_rad: loaded.site.as_ref().unwrap().longitude_rad,
        mounts: field
            .heliostats()
            .iter()
            .zip(&loaded.drives)
            .map(|(h, drives)| KeptMount::of(&Mount::of(field.mode(), h), drives))
            .collect(),
        version: "0.1.0".into(),
    }
}

struct Kept {
    folder: tempfile::TempDir,
    loaded: LoadedField,
    path: PathBuf,
    state: StateFile,
}

fn kept() -> Kept {
    let folder = tempfile::tempdir().unwrap();
    let loaded = field(folder.path(), FIELD, HELIOSTATS);
    let path = folder.path().join("state.parquet");
    let state = state(&loaded);
    write_state(&path, &state).unwrap();
    Kept {
        folder,
        loaded,
        path,
        state,
    }
}

#[test]
fn a_state_is_read_back_bit_by_bit_and_written_in_the_same_bytes() {
    let kept = kept();
    let (back, _) = read_state(&kept.path).unwrap();
    // as text, so that -0.0 is not 0.0
    assert_eq!(format!("{back:?}"), format!("{:?}", kept.state));
    let first = std::fs::read(&kept.path).unwrap();
    let again = kept.folder.path().join("again.parquet");
    let bytes = write_state(&again, &back).unwrap();
    assert_eq!(bytes, first.len() as u64);
    assert!(std::fs::read(&again).unwrap() == first);
    assert_eq!(
        back.rows(&kept.path, &kept.loaded).unwrap(),
        [Some(0), Some(1), Some(2)]
    );
}

#[test]
fn a_state_without_heliostats_is_a_state() {
    let mut kept = kept();
    kept.state.parts.heliostats.clear();
    kept.state.mounts.clear();
    write_state(&kept.path, &kept.state).unwrap();
    assert_eq!(read_state(&kept.path).unwrap().0, kept.state);
}

fn refusal(path: &Path) -> String {
    let said = read_state(path).unwrap_err().to_string();
    assert!(said.starts_with(&path.display().to_string()), "{said}");
    said[path.display().to_string().len()..].to_owned()
}

#[test]
fn what_is_no_state_is_refused_in_words() {
    let kept = kept();
    let at = |name: &str| kept.folder.path().join(name);
    assert_eq!(
        refusal(&at("none.parquet")),
        ": cannot be read: no such file"
    );
    for (name, contents) in [("text.csv", "id,drift\nA1,1\n"), ("empty", "")] {
        std::fs::write(at(name), contents).unwrap();
        let said = refusal(&at(name));
        assert!(said.contains("no state of a followed field"), "{said}");
        assert!(said.contains("--joint --state"), "{said}");
    }
    let table = at("table.parquet");
    let columns = [("id", Cells::Text(&["A1".to_owned()]))];
    write_columns(Destination::File(table.clone()), Format::Parquet, &columns).unwrap();
    let said = refusal(&table);
    assert!(
        said.contains("a table but no state") && said.contains("`helio_state`"),
        "{said}"
    );

    // another format: the number stands after its key
    let mut bytes = std::fs::read(&kept.path).unwrap();
    let key = b"helio_state";
    let place = (0..bytes.len() - 40)
        .find(|&k| bytes[k..].starts_with(key) && bytes[k + key.len() + 2] == b'2')
        .unwrap();
    bytes[place + key.len() + 2] = b'7';
    seal(&mut bytes);
    std::fs::write(at("newer.parquet"), &bytes).unwrap();
    let said = refusal(&at("newer.parquet"));
    assert!(
        said.contains("format `7`") && said.contains("reads format 2"),
        "{said}"
    );
    // the first format had no checksum
    bytes[place + key.len() + 2] = b'1';
    let of_seal = checksum_of(&bytes) - 5;
    bytes[of_seal] = b'X';
    std::fs::write(at("older.parquet"), &bytes).unwrap();
    let said = refusal(&at("older.parquet"));
    assert!(said.contains("format `1`"), "{said}");
}

/// Where in a file its checksum begins: the last text of 64 after its key.
fn checksum_of(bytes: &[u8]) -> usize {
    let key = b"helio_state_sha256";
    let last = bytes.windows(key.len()).rposition(|w| w == key);
    last.unwrap() + key.len() + 2
}

/// With zeros where the checksum stands, of the SHA-256s of each mebibyte, as the documentation has it.
fn seal(bytes: &mut [u8]) {
    let at = checksum_of(bytes);
    bytes[at..at + 64].fill(b'0');
    let sha256 = |bytes: &[u8]| {
        let mut hash = Sha256::default();
        hash.update(bytes);
        hash.finish()
    };
    let each: Vec<String> = bytes.chunks(1024 * 1024).map(sha256).collect();
    bytes[at..at + 64].copy_from_slice(sha256(each.join("").as_bytes()).as_bytes());
}

/// Also of a file of several pieces.
#[test]
fn a_state_carries_the_checksum_that_the_documentation_tells() {
    let mut kept = kept();
    const BOUNDARY: usize = 3 << 20;
    let mut days = 0;
    let mut placed = Vec::new();
    // empty, of four pieces, and with the boundary of two in the middle of the checksum
    for _ in 0..3 {
        kept.state.parts.heliostats[0].undecided = vec![0.5; days];
        write_state(&kept.path, &kept.state).unwrap();
        let written = std::fs::read(&kept.path).unwrap();
        let mut bytes = written.clone();
        seal(&mut bytes);
        assert!(bytes == written);
        let at = checksum_of(&bytes);
        let (back, checksum) = read_state(&kept.path).unwrap();
        assert_eq!(checksum.as_bytes(), &bytes[at..at + 64]);
        assert!(back == kept.state);
        placed.push(at);
        days = match days {
            0 => 400_000,
            days => days - (at + 32 - BOUNDARY) / 8,
        };
    }
    println!("checksums at {placed:?}");
    assert!(placed[0] < 1 << 20 && placed[1] > BOUNDARY);
    assert!(placed[2] < BOUNDARY && BOUNDARY < placed[2] + 64);
}

#[test]
fn every_byte_that_is_not_as_written_is_refused() {
    let kept = kept();
    let whole = std::fs::read(&kept.path).unwrap();
    let mut file = OpenOptions::new().write(true).open(&kept.path).unwrap();
    let mut put = |at: usize, byte: u8| {
        file.seek(SeekFrom::Start(at as u64)).unwrap();
        file.write_all(&[byte]).unwrap();
    };
    let (mut sums, mut ends, mut starts, mut others) = (0, 0, 0, 0);
    for (at, &byte) in whole.iter().enumerate() {
        // a bit; and where it stands for a digit of a number, the next one
        put(at, byte ^ (1 << (at % 8)));
        let said = refusal(&kept.path);
        if said.contains("its checksum is") {
            sums += 1;
        } else if said.contains("it is not whole: wanted `PAR1`") {
            ends += 1;
        } else if said.contains("no state of a followed field") {
            starts += 1;
        } else {
            others += 1;
        }
        if byte.is_ascii_digit() {
            put(at, b'0' + (byte - b'0' + 1) % 10);
            refusal(&kept.path);
        }
        put(at, byte);
    }
    assert_eq!(read_state(&kept.path).unwrap().0, kept.state);
    println!(
        "{sums} by their checksum, {ends} by their end, {starts} by their beginning, {others} else"
    );
    assert_eq!((starts, ends), (4, 4));
    // the checksum's own key and the footer's length
    assert!(others <= 18 + 2 + 4, "{others}");
}

#[test]
fn what_is_cut_off_or_put_to_a_state_is_refused() {
    let kept = kept();
    let whole = std::fs::read(&kept.path).unwrap();
    let damaged = kept.folder.path().join("damaged.parquet");
    let said_of = |bytes: &[u8]| {
        std::fs::write(&damaged, bytes).unwrap();
        refusal(&damaged)
    };
    for cut in (4..whole.len()).step_by(97).chain([whole.len() - 1]) {
        let said = said_of(&whole[..cut]);
        assert!(said.contains("it is not whole: wanted `PAR1`"), "{said}");
    }
    said_of(&[&whole[..], b"\n"].concat());
    said_of(&[&whole[..], &whole].concat());
    said_of(&[&whole[..4], &whole].concat());
    // pieces in another order, of the same length
    let middle = whole.len() / 2;
    let mut turned = whole.clone();
    turned[middle..middle + 16].rotate_left(8);
    assert!(turned != whole);
    let said = said_of(&turned);
    assert!(
        said.contains("its checksum is") && said.contains("stands in it"),
        "{said}"
    );
}

#[test]
fn a_write_that_fails_leaves_what_was_there() {
    let kept = kept();
    let before = std::fs::read(&kept.path).unwrap();
    let mut wrong = kept.state.clone();
    wrong.mounts.pop();
    let said = write_state(&kept.path, &wrong).unwrap_err().to_string();
    assert!(
        said.contains("expected 3 mounts, one a heliostat, got 2"),
        "{said}"
    );
    assert!(std::fs::read(&kept.path).unwrap() == before);
    let nowhere = kept.folder.path().join("none/state.parquet");
    let said = write_state(&nowhere, &kept.state).unwrap_err().to_string();
    assert!(said.contains("does not exist"), "{said}");
}

#[test]
fn a_field_that_has_changed_is_refused_by_name() {
    let kept = kept();
    let folder = tempfile::tempdir().unwrap();
    let said = |toml: &str, heliostats: &str| {
        let changed = field(folder.path(), toml, heliostats);
        kept.state
            .rows(&kept.path, &changed)
            .unwrap_err()
            .to_string()
    };
    for (from, to, wanted) in [
        (
            "latitude_deg = 37.4",
            "latitude_deg = 37.5",
            "latitude of 37.4 degrees, this field's at 37.5",
        ),
        (
            "longitude_deg = -6.25",
            "longitude_deg = 6.25",
            "longitude of -6.25 degrees, this field's at 6.25",
        ),
        (
            "[0.0, 8.0, 70.0]",
            "[0.0, 8.0, 70.1]",
            "target `board` has its centre at (0, 8, 70) there and at (0, 8, 70.1)",
        ),
        (
            "normal_enu = [0.0, 1.0, 0.0]",
            "normal_enu = [0.1, 1.0, 0.0]",
            "target `board` has its normal along (0, 1, 0)",
        ),
        (
            "mirror_offset_m = 0.3",
            "mirror_offset_m = 0.2",
            "heliostat `A1`: has a mirror offset of 0.3 m there and of 0.2 m",
        ),
        (
            "aim = \"board\"",
            "aim = \"board\"\nmode = \"polar\"",
            "heliostat `A1`: has its fixed axis along (0, 0, 1) there",
        ),
    ] {
        assert!(FIELD.contains(from));
        let said = said(&FIELD.replace(from, to), HELIOSTATS);
        assert!(said.contains(wanted), "{said}");
    }
    let said = said(FIELD, &HELIOSTATS.replace("A2,0.5,", "A2,0.6,"));
    assert!(
        said.contains("heliostat `A2`: has its pivot at (0.5, 110, 3) there and at (0.6, 110, 3)"),
        "{said}"
    );
    assert!(said.contains("begin a new state with --joint"), "{said}");

    // Less than a millimetre is rounding, other orders and other heliostats are no contradiction.
    let rounded = "id,east_m,north_m,up_m\nA2,0.5004,110,3\nNEW,1,200,3\nA1,-40,100,3\n";
    let changed = field(folder.path(), FIELD, rounded);
    let rows = kept.state.rows(&kept.path, &changed).unwrap();
    assert_eq!(rows, [Some(2), Some(0), None]);
}

const DRIVES: &str = r#"
[heliostats.drive.axis1]
type = "encoder"
steps_per_deg = 1000
zero_steps = 500
min_steps = -200000
max_steps = 200000
[heliostats.drive.axis2]
type = "triangle"
clockwise_axis_movement = 0
increment_steps_per_m = 154166.666
offset_m = 0.34
pivot_radius_m = 0.32
initial_stroke_length_m = 0.08
initial_angle_rad = 0.0
min_increment_steps = 0
max_increment_steps = 80000
"#;

#[test]
fn a_drive_whose_steps_mean_something_else_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let toml = format!("{FIELD}{DRIVES}");
    let loaded = field(folder.path(), &toml, HELIOSTATS);
    let path = folder.path().join("state.parquet");
    write_state(&path, &state(&loaded)).unwrap();
    let (kept, _) = read_state(&path).unwrap();
    assert_eq!(kept, state(&loaded));
    let rows = |toml: &str| kept.rows(&path, &field(folder.path(), toml, HELIOSTATS));
    assert_eq!(rows(&toml).unwrap(), [Some(0), Some(1), Some(2)]);
    for (from, to, axis) in [
        ("zero_steps = 500", "zero_steps = 600", 1),
        ("zero_steps = 500", "zero_steps = 500\nsign = -1", 1),
        ("steps_per_deg = 1000", "steps_per_deg = 1000.01", 1),
        ("154166.666", "154000", 2),
        ("offset_m = 0.34", "offset_m = 0.3401", 2),
        ("pivot_radius_m = 0.32", "pivot_radius_m = 0.3201", 2),
        ("stroke_length_m = 0.08", "stroke_length_m = 0.0801", 2),
        ("angle_rad = 0.0", "angle_rad = 0.0001", 2),
        ("movement = 0", "movement = 1", 2),
    ] {
        assert!(toml.contains(from));
        let said = rows(&toml.replace(from, to)).unwrap_err().to_string();
        let wanted = format!("heliostat `A1`: has a drive of axis {axis} that stands at ");
        assert!(said.contains(&wanted), "{said}");
        assert!(
            said.contains(" steps and ") && said.contains(" in this field"),
            "{said}"
        );
        assert!(said.contains("begin a new state with --joint"), "{said}");
    }
    let said = rows(&toml.replace("zero_steps = 500", "zero_steps = 600")).unwrap_err();
    let wanted =
        "stands at -135 degrees there at -134500 steps and at -135.1 degrees in this field";
    assert!(said.to_string().contains(wanted), "{said}");

    // Its ends are no part of it, nor is a hundredth of a step.
    for (from, to) in [
        ("min_steps = -200000", "min_steps = -190000"),
        ("max_increment_steps = 80000", "max_increment_steps = 70000"),
        ("zero_steps = 500", "zero_steps = 500.01"),
    ] {
        assert!(toml.contains(from));
        rows(&toml.replace(from, to)).unwrap();
    }
    // A drive that is gone, and one that was not there.
    let said = rows(FIELD).unwrap_err().to_string();
    let wanted = "has a drive of axis 1 there and none in this field";
    assert!(said.contains(wanted), "{said}");
    let loaded = field(folder.path(), FIELD, HELIOSTATS);
    let without = state(&loaded);
    let with = field(folder.path(), &toml, HELIOSTATS);
    let said = without.rows(&path, &with).unwrap_err().to_string();
    let wanted = "has no drive of axis 1 there and one in this field";
    assert!(said.contains(wanted), "{said}");
}
