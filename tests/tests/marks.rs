//! The corner marks in the frames of the Jülich tower, against the corners found there with pictures of the marks.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::collections::BTreeMap;
use std::path::Path;

use helio_spot::target::diagonals_cross;
use helio_spot::{
    Board, Corners, CornersError, FindOptions, Frame, Limits, MarkScratch, Marks, Picture, Plane,
    decode, find_corners,
};
use helio_tests::data::{self, Table};

const CORNERS: [&str; 4] = ["upper_left", "upper_right", "lower_right", "lower_left"];

/// The tower's boards, sizes as surveyed.
fn board(target: &str) -> Board {
    let (width_m, height_m, marks) = match target {
        "solar_tower_juelich_upper" => (8.6252, 7.2105, Marks::TwoPanelUpper),
        "solar_tower_juelich_lower" => (8.6296, 7.2175, Marks::TwoPanelLower),
        "multi_focus_tower" => (5.4121, 6.3875, Marks::FourCorners),
        other => panic!("{other}"),
    };
    Board {
        width_m,
        height_m,
        marks,
    }
}

fn picture(path: &Path) -> Picture<u8> {
    let bytes = std::fs::read(path).unwrap();
    match decode(&bytes, &Limits::default()).unwrap() {
        Frame::Gray8(picture) => picture,
        Frame::Gray16(_) => panic!("{}: 16 bit", path.display()),
    }
}

/// Given corners of each frame and target.
fn given(folder: &Path) -> BTreeMap<(String, String), [[f64; 2]; 4]> {
    let table = Table::read(folder.join("frames/corner_pixels.csv"));
    let mut all = BTreeMap::new();
    for row in 0..table.len() {
        let key = (
            table.text(row, "frame").to_owned(),
            table.text(row, "target").to_owned(),
        );
        let corner = CORNERS.iter().position(|c| *c == table.text(row, "corner"));
        let corners: &mut [[f64; 2]; 4] = all.entry(key).or_default();
        corners[corner.unwrap()] = [table.number(row, "x_px"), table.number(row, "y_px")];
    }
    all
}

fn distances(found: &Corners, wanted: &[[f64; 2]; 4]) -> [f64; 4] {
    core::array::from_fn(|i| {
        let [x, y] = found.at_px[i];
        (x - wanted[i][0]).hypot(y - wanted[i][1])
    })
}

/// Every target of every frame: median within 2 px, none beyond 5.
#[test]
fn marks_of_all_frames_are_where_they_were_found_by_template() {
    let Some(folder) = data::folder("marks_of_all_frames_are_where_they_were_found_by_template")
    else {
        return;
    };
    let folder = folder.join("juelich");
    let mut scratch = MarkScratch::default();
    let mut all = Vec::new();
    let given = given(&folder);
    assert_eq!(given.len(), 12);
    for ((frame, target), wanted) in &given {
        let picture = picture(&folder.join(frame));
        let board = board(target);
        let found = find_corners(
            picture.view(),
            &board,
            &FindOptions::default(),
            &mut scratch,
        )
        .unwrap_or_else(|e| panic!("{frame} {target}: {e}"));
        assert_eq!(found.seen, [true; 4], "{frame} {target}");
        let off = distances(&found, wanted);
        eprintln!(
            "{frame} {target}: {off:.2?} px, sigma {:.2?}",
            found.sigma_px
        );
        all.extend(off);
        // The centre of the board, by the crossing of the diagonals and by the homography.
        let plane = Plane::new(board, found, None).unwrap();
        let [a, b] = [plane.centre_px(), diagonals_cross(&found.at_px)].map(Option::unwrap);
        assert!((a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9);
        let size = found.marks.unwrap();
        for arm in [size.arm_right_m, size.arm_down_m] {
            assert!((0.7..0.8).contains(&arm), "{frame} {target}: {size:?}");
        }
    }
    all.sort_by(f64::total_cmp);
    let median = 0.5 * (all[all.len() / 2 - 1] + all[all.len() / 2]);
    eprintln!(
        "{} corners: median {median:.2} px, largest {:.2}",
        all.len(),
        all[all.len() - 1]
    );
    assert!(median < 2.0, "{median}");
    assert!(all.iter().all(|d| *d < 5.0), "{all:?}");
}

/// The other tower's board is not seen where it is not, and panels are not taken for boards of four L marks.
#[test]
fn no_other_board_is_found_in_a_frame() {
    let Some(folder) = data::folder("no_other_board_is_found_in_a_frame") else {
        return;
    };
    let folder = folder.join("juelich");
    let mut scratch = MarkScratch::default();
    let given = given(&folder);
    let boards = [
        "solar_tower_juelich_upper",
        "solar_tower_juelich_lower",
        "multi_focus_tower",
    ];
    for (frame, target) in given.keys() {
        let picture = picture(&folder.join(frame));
        let tower = |t: &str| t.starts_with("solar");
        for other in boards.iter().filter(|b| tower(b) != tower(target)) {
            let found = find_corners(
                picture.view(),
                &board(other),
                &FindOptions::default(),
                &mut scratch,
            );
            assert!(
                matches!(found, Err(CornersError::NoMarks { .. })),
                "{frame} {other}: {found:?}"
            );
        }
    }
}

/// Crops end at the marks' outer edges, so there is no mark with light all around it in them.
#[test]
fn no_board_is_found_in_crops() {
    let Some(folder) = data::folder("no_board_is_found_in_crops") else {
        return;
    };
    let folder = folder.join("juelich");
    let mut scratch = MarkScratch::default();
    let mut count = 0;
    for part in ["crops", "empty_targets", "unlabelled_spots"] {
        for entry in std::fs::read_dir(folder.join(part)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|e| e != "png") {
                continue;
            }
            let picture = picture(&path);
            for target in [
                "solar_tower_juelich_upper",
                "solar_tower_juelich_lower",
                "multi_focus_tower",
            ] {
                let found = find_corners(
                    picture.view(),
                    &board(target),
                    &FindOptions::default(),
                    &mut scratch,
                );
                assert!(found.is_err(), "{}: {found:?}", path.display());
            }
            count += 1;
        }
    }
    assert!(count > 100, "{count} crops");
}

/// A mark covered by a beam that blinds the camera or by a deep shadow: its corner follows from the three others, and is
/// as far off as its uncertainty says.
#[test]
fn a_covered_mark_follows_from_the_others() {
    let Some(folder) = data::folder("a_covered_mark_follows_from_the_others") else {
        return;
    };
    let folder = folder.join("juelich");
    let mut scratch = MarkScratch::default();
    let (mut squares, mut count) = (0.0, 0.0);
    for ((frame, target), wanted) in &given(&folder) {
        let picture = picture(&folder.join(frame));
        let (width, height) = (picture.view().width(), picture.view().height());
        let plain: Vec<u8> = picture.view().rows().flatten().copied().collect();
        let board = board(target);
        for (hidden, &[x, y]) in wanted.iter().enumerate() {
            for gray in [255, 10] {
                let mut covered = plain.clone();
                for (k, value) in covered.iter_mut().enumerate() {
                    let [dx, dy] = [(k % width) as f64 - x, (k / width) as f64 - y];
                    if dx.hypot(dy) < 220.0 {
                        *value = gray;
                    }
                }
                let covered = Picture::new(covered, width, height).unwrap();
                let found = find_corners(
                    covered.view(),
                    &board,
                    &FindOptions::default(),
                    &mut scratch,
                )
                .unwrap_or_else(|e| panic!("{frame} {target} {hidden}: {e}"));
                assert_eq!(found.seen, core::array::from_fn(|i| i != hidden));
                let at = found.at_px[hidden];
                for off in [at[0] - x, at[1] - y] {
                    let z = off / found.sigma_px[hidden];
                    assert!(z.abs() < 4.0, "{frame} {target} {hidden}: {z}");
                    squares += z * z;
                    count += 1.0;
                }
            }
        }
    }
    let rms = f64::sqrt(squares / count);
    eprintln!("{count} coordinates of hidden corners: {rms:.2} of their standard deviation");
    assert!(rms < 1.5, "{rms}");
}
