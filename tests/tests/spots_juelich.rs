//! Spots of the pictures of Jülich against both references there are, `HeliOS` and `UTIS`, and targets without a spot.
//!
//! Nothing was tuned on pictures with odd numbers or without one.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use helio_spot::{
    Board, Corners, FindOptions, Frame, Limits, MarkScratch, Marks, Picture, Plane, RobustOptions,
    Spot, SpotScratch, decode, find_corners, find_spot,
};
use helio_tests::data;

/// References further apart do not agree \[m\].
const AGREE_M: f64 = 0.20;
/// No spot may lie further from both, where they agree \[m\].
const WRONG_M: f64 = 0.25;
/// Median distance to the nearer, on crops \[m\].
const MEDIAN_M: f64 = 0.05;

fn picture(path: &Path) -> Picture<u8> {
    match decode(&std::fs::read(path).unwrap(), &Limits::default()).unwrap() {
        Frame::Gray8(picture) => picture,
        Frame::Gray16(_) => panic!("{}: 16 bit", path.display()),
    }
}

fn boards(folder: &Path) -> BTreeMap<String, Board> {
    let text = std::fs::read_to_string(folder.join("target_planes.json")).unwrap();
    let planes: BTreeMap<String, serde_json::Value> = serde_json::from_str(&text).unwrap();
    let board = |(name, plane): (String, serde_json::Value)| {
        let marks = match name.as_str() {
            "solar_tower_juelich_upper" => Marks::TwoPanelUpper,
            "solar_tower_juelich_lower" => Marks::TwoPanelLower,
            _ => Marks::FourCorners,
        };
        let side = |key: &str| plane[key].as_f64().unwrap();
        let (width_m, height_m) = (side("width_m"), side("height_m"));
        let board = Board {
            width_m,
            height_m,
            marks,
        };
        (name, board)
    };
    planes.into_iter().map(board).collect()
}

/// Crops show the whole target and nothing else.
fn of_crop(picture: &Picture<u8>, board: Board) -> Plane {
    let (right, low) = (
        picture.view().width() as f64 - 0.5,
        picture.view().height() as f64 - 0.5,
    );
    let corners = [[-0.5, -0.5], [right, -0.5], [right, low], [-0.5, low]];
    Plane::new(board, Corners::given(corners, 0.0), None).unwrap()
}

/// Marks are looked for.
fn of_frame(picture: &Picture<u8>, board: Board) -> Plane {
    let options = FindOptions::default();
    let found = find_corners(
        picture.view(),
        &board,
        &options,
        &mut MarkScratch::default(),
    );
    Plane::new(board, found.unwrap(), None).unwrap()
}

fn look(picture: &Picture<u8>, plane: &Plane) -> Spot {
    let (options, mut scratch) = (RobustOptions::default(), SpotScratch::default());
    find_spot(picture.view(), plane, &options, &mut scratch).unwrap()
}

/// Pictures with even numbers were looked at when choices were made.
fn is_even(name: &str) -> bool {
    let digits: String = name.chars().take_while(char::is_ascii_digit).collect();
    digits.parse::<u64>().is_ok_and(|number| number % 2 == 0)
}

fn half(even: bool) -> &'static str {
    if even { "even" } else { "odd" }
}

/// The rows of spots.csv; its last column may hold commas.
fn rows(folder: &Path) -> Vec<BTreeMap<String, String>> {
    let text = std::fs::read_to_string(folder.join("spots.csv")).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let cells = line.splitn(header.len(), ',').map(str::to_owned);
        header
            .iter()
            .map(|name| (*name).to_owned())
            .zip(cells)
            .collect()
    };
    lines.filter(|line| !line.is_empty()).map(row).collect()
}

fn references(row: &BTreeMap<String, String>) -> Option<[[f64; 2]; 2]> {
    let at = |who: &str| -> Option<[f64; 2]> {
        let side = |side: &str| row[&format!("{who}_{side}_m")].parse().ok();
        Some([side("right")?, side("down")?])
    };
    Some([at("helios")?, at("utis")?])
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len().is_multiple_of(2) {
        0.5 * (values[middle - 1] + values[middle])
    } else {
        values[middle]
    }
}

#[test]
fn spots_lie_where_the_references_have_them() {
    let Some(folder) = data::folder("spots_lie_where_the_references_have_them") else {
        return;
    };
    let folder = folder.join("juelich");
    let boards = boards(&folder);
    // Distances to the nearer reference by kind of picture and half, where they agree.
    let mut nearer: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    // The same over the uncertainty that is stated.
    let mut ratios: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    let (mut pictures, mut missed, mut wrong) = (0, Vec::new(), Vec::new());
    for row in rows(&folder) {
        let board = boards[&row["target"]];
        for kind in ["crop", "frame"] {
            if row[kind].is_empty() {
                continue;
            }
            let picture = picture(&folder.join(&row[kind]));
            let plane = match kind {
                "crop" => of_crop(&picture, board),
                _ => of_frame(&picture, board),
            };
            let spot = look(&picture, &plane);
            pictures += 1;
            if !spot.status.has_position() {
                missed.push(format!("{}: {}", row[kind], spot.status.as_str()));
                continue;
            }
            let Some([helios, utis]) = references(&row) else {
                continue;
            };
            if apart(helios, utis) > AGREE_M {
                continue;
            }
            let both = [helios, utis].map(|at| apart([spot.u_m, spot.v_m], at));
            let near_m = both[0].min(both[1]);
            if near_m > WRONG_M {
                wrong.push(format!("{}: {both:.3?} m", row[kind]));
            }
            let group = (kind, half(is_even(&row["image_id"])));
            nearer.entry(group).or_default().push(near_m);
            let ratio = near_m / spot.sigma_m();
            ratios.entry(group).or_default().push(ratio);
        }
    }
    for ((kind, half), all) in &nearer {
        let largest = all.iter().copied().fold(0.0, f64::max);
        let median = median(all.clone());
        eprintln!(
            "{kind} {half}: {} with references that agree, nearer one median {:.1} cm, largest {:.1} cm",
            all.len(),
            100.0 * median,
            100.0 * largest
        );
        if *kind == "crop" {
            assert!(median <= MEDIAN_M, "{kind} {half}: {median}");
            let ratio = self::median(ratios[&(*kind, *half)].clone());
            eprintln!("{kind} {half}: over the stated uncertainty, median {ratio:.2}");
            assert!((0.5..1.5).contains(&ratio), "{kind} {half}: {ratio}");
        }
    }
    eprintln!("{pictures} crops and frames with a spot, missed: {missed:?}");
    assert_eq!(pictures, 86);
    assert!(missed.is_empty(), "{missed:?}");
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn empty_targets_are_empty_and_unlabelled_spots_are_seen() {
    let Some(folder) = data::folder("empty_targets_are_empty_and_unlabelled_spots_are_seen") else {
        return;
    };
    let folder = folder.join("juelich");
    let board = boards(&folder)["solar_tower_juelich_lower"];
    for (kind, count, holds) in [("empty_targets", 20, false), ("unlabelled_spots", 5, true)] {
        let files = std::fs::read_dir(folder.join(kind)).unwrap();
        let files: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
        let mut otherwise: Vec<String> = Vec::new();
        for path in &files {
            let picture = picture(path);
            let spot = look(&picture, &of_crop(&picture, board));
            if spot.status.has_position() != holds {
                let name = path.file_stem().unwrap().to_string_lossy().into_owned();
                let half = half(is_even(&name));
                otherwise.push(format!("{name} ({half}): {}", spot.status.as_str()));
            }
        }
        eprintln!(
            "{kind}: {} pictures, judged otherwise: {otherwise:?}",
            files.len()
        );
        assert_eq!(files.len(), count);
        assert!(otherwise.is_empty(), "{kind}: {otherwise:?}");
    }
}
