//! Boards drawn here, with the share of each pixel that is black, blurred and with noise.

use super::*;
use crate::image::Picture;
use crate::target::{Homography, Plane};

const FOUR: Board = Board {
    width_m: 5.4,
    height_m: 6.4,
    marks: Marks::FourCorners,
};
const SIGNS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// Seeded numbers (splitmix64).
struct Draws(u64);

impl Draws {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Of the sum of twelve: standard normal within what matters here.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

/// How a camera sees a board.
#[derive(Clone, Copy)]
struct View3 {
    size_px: [usize; 2],
    px_per_m: f64,
    /// Turn about the vertical, tilt, roll \[degrees\].
    turn_deg: [f64; 3],
    /// Where the board's centre is seen, from the middle of the picture.
    shift_px: [f64; 2],
}

impl View3 {
    const fn plain(size_px: [usize; 2], px_per_m: f64) -> Self {
        Self {
            size_px,
            px_per_m,
            turn_deg: [0.0; 3],
            shift_px: [0.3, -0.2],
        }
    }

    /// Pixel of a place.
    fn see(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [[ca, sa], [cb, sb], [cc, sc]] = self.turn_deg.map(|a| {
            let a = a.to_radians();
            [a.cos(), a.sin()]
        });
        let [x, z] = [ca * u, -sa * u];
        let [y, z] = [cb * v - sb * z, sb * v + cb * z];
        let [x, y] = [cc * x - sc * y, sc * x + cc * y];
        let scale = self.px_per_m / (1.0 + z / 60.0);
        let middle = self.size_px.map(|n| 0.5 * (n as f64 - 1.0));
        [
            middle[0] + self.shift_px[0] + scale * x,
            middle[1] + self.shift_px[1] + scale * y,
        ]
    }

    fn corners(&self, board: &Board) -> [[f64; 2]; 4] {
        SIGNS.map(|[s, t]| self.see([0.5 * s * board.width_m, 0.5 * t * board.height_m]))
    }
}

/// Bars of the marks as rectangles left, top, right, bottom; T marks with the joint below the middle of their arm.
fn bars(board: &Board, arm: f64, bar: f64, skip: Option<usize>) -> Vec<[f64; 4]> {
    let mut all = Vec::new();
    let [right, down] = [0.5 * board.width_m, 0.5 * board.height_m];
    let mut add = |a: [f64; 2], b: [f64; 2]| {
        all.push([
            a[0].min(b[0]),
            a[1].min(b[1]),
            a[0].max(b[0]),
            a[1].max(b[1]),
        ]);
    };
    for (corner, [s, t]) in SIGNS.into_iter().enumerate() {
        if skip == Some(corner) {
            continue;
        }
        let [x, y] = [s * right, t * down];
        let bar_mark = match board.marks {
            Marks::FourCorners => false,
            Marks::TwoPanelUpper => corner > 1,
            Marks::TwoPanelLower => corner < 2,
        };
        if bar_mark {
            let middle = y - JOINT_SHARE * arm;
            add([x, middle - 0.5 * arm], [x - s * bar, middle + 0.5 * arm]);
            add([x, middle - 0.5 * bar], [x - s * arm, middle + 0.5 * bar]);
        } else {
            add([x, y], [x - s * arm, y - t * bar]);
            add([x, y], [x - s * bar, y - t * arm]);
        }
    }
    all
}

/// Gray levels 0 to 1 without blur and noise: marks 0.08, board 0.6, what is around it 0.35.
fn draw(view: &View3, board: &Board, marks: &[[f64; 4]]) -> Vec<f64> {
    let map =
        Homography::from_corners(&view.corners(board), board.width_m, board.height_m).unwrap();
    let rim = 0.08 * board.width_m;
    let mut top = 0.5 * board.height_m + rim;
    let mut low = top;
    match board.marks {
        Marks::FourCorners => {}
        Marks::TwoPanelUpper => low += board.height_m,
        Marks::TwoPanelLower => top += board.height_m,
    }
    let right = 0.5 * board.width_m + rim;
    let gray = |x: f64, y: f64| {
        let [u, v] = map.to_target([x, y]).unwrap();
        if marks
            .iter()
            .any(|m| u >= m[0] && u < m[2] && v >= m[1] && v < m[3])
        {
            0.08
        } else if u.abs() < right && v > -top && v < low {
            0.6
        } else {
            0.35
        }
    };
    let [width, height] = view.size_px;
    let mut out = Vec::with_capacity(width * height);
    const N: usize = 16;
    for row in 0..height {
        for column in 0..width {
            let [x, y] = [column as f64, row as f64];
            let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
                .map(|[a, b]| gray(x + a, y + b));
            if corners.iter().all(|g| *g == corners[0]) {
                out.push(corners[0]);
                continue;
            }
            let mut sum = 0.0;
            for k in 0..N * N {
                // A skewed lattice, so that no edge along the rows meets many points at once.
                let a = ((k % N) as f64 + (k / N) as f64 / N as f64 + 0.5 / N as f64) / N as f64;
                let b = ((k / N) as f64 + (k % N) as f64 / N as f64 + 0.5 / N as f64) / N as f64;
                sum += gray(x + a - 0.5, y + b - 0.5);
            }
            out.push(sum / (N * N) as f64);
        }
    }
    out
}

/// Gaussian blur of so many pixels, rows then columns, edges repeated.
fn blur(levels: &mut [f64], width: usize, sigma: f64) {
    if sigma <= 0.0 {
        return;
    }
    let reach = (4.0 * sigma).ceil() as isize;
    let weights: Vec<f64> = (-reach..=reach)
        .map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    let height = levels.len() / width;
    for (count, step, lines, line_step) in [(width, 1, height, width), (height, width, width, 1)] {
        for line in 0..lines {
            let start = line * line_step;
            let old: Vec<f64> = (0..count).map(|k| levels[start + k * step]).collect();
            for k in 0..count {
                let mut value = 0.0;
                for (j, w) in weights.iter().enumerate() {
                    let at = (k as isize + j as isize - reach).clamp(0, count as isize - 1);
                    value += w * old[at as usize];
                }
                levels[start + k * step] = value / sum;
            }
        }
    }
}

/// As an 8 bit camera of so many gray levels of noise sees it.
fn shoot(levels: &[f64], width: usize, noise: f64, seed: u64) -> Picture<u8> {
    let mut draws = Draws(seed);
    let gray = levels
        .iter()
        .map(|l| {
            (255.0 * l + noise * draws.normal())
                .round()
                .clamp(0.0, 255.0) as u8
        })
        .collect();
    Picture::new(gray, width, levels.len() / width).unwrap()
}

fn frame(view: &View3, board: &Board, arm: f64, bar: f64, blur_px: f64, noise: f64) -> Picture<u8> {
    let mut levels = draw(view, board, &bars(board, arm, bar, None));
    blur(&mut levels, view.size_px[0], blur_px);
    shoot(&levels, view.size_px[0], noise, 11)
}

fn find(picture: &Picture<u8>, board: &Board) -> Result<Corners, CornersError> {
    find_corners(
        picture.view(),
        board,
        &FindOptions::default(),
        &mut MarkScratch::default(),
    )
}

/// Found less wanted.
fn errors(found: &Corners, wanted: &[[f64; 2]; 4]) -> [[f64; 2]; 4] {
    core::array::from_fn(|i| core::array::from_fn(|k| found.at_px[i][k] - wanted[i][k]))
}

fn worst(found: &Corners, wanted: &[[f64; 2]; 4]) -> f64 {
    errors(found, wanted)
        .map(|[x, y]| x.hypot(y))
        .into_iter()
        .fold(0.0, f64::max)
}

/// Error against scale, blur and noise; and the errors over their own uncertainty are about standard normal.
#[test]
fn errors_are_small_and_as_large_as_they_say() {
    let (mut squares, mut count, mut beyond) = (0.0, 0.0, 0);
    // Pixels per metre (arms 0.14 m wide), blur and noise in pixels and gray levels, largest error allowed.
    for (k, (px_per_m, blur_px, noise, allowed)) in [
        (30.0, 0.5, 1.0, 0.25),
        (45.0, 0.7, 1.0, 0.15),
        (45.0, 0.7, 4.0, 0.3),
        (60.0, 0.0, 1.0, 0.1),
        (60.0, 0.7, 2.0, 0.12),
        (60.0, 1.5, 2.0, 0.2),
        (60.0, 0.7, 8.0, 0.5),
        (60.0, 0.7, 16.0, 1.0),
        (100.0, 0.7, 2.0, 0.1),
        (100.0, 1.0, 8.0, 0.3),
    ]
    .into_iter()
    .enumerate()
    {
        for turn in 0..3 {
            let side = (7.5 * px_per_m) as usize;
            let view = View3 {
                turn_deg: [0.0, 0.0, 2.0 * f64::from(turn) - 1.7],
                shift_px: [0.31 * f64::from(turn), 0.17 * k as f64],
                ..View3::plain([side, side], px_per_m)
            };
            let wanted = view.corners(&FOUR);
            let picture = frame(&view, &FOUR, 0.7, 0.14, blur_px, noise);
            let found = find(&picture, &FOUR).unwrap();
            assert_eq!(found.seen, [true; 4]);
            let error = worst(&found, &wanted);
            assert!(error < allowed, "{px_per_m} {blur_px} {noise}: {error}");
            for (off, sigma) in errors(&found, &wanted).into_iter().zip(found.sigma_px) {
                for z in off.map(|o| o / sigma) {
                    squares += z * z;
                    count += 1.0;
                    beyond += u32::from(z.abs() > 2.0);
                }
            }
            let size = found.marks.unwrap();
            // Told by blocks, of one or two pixels here, from end to end; noise that darkens blocks adds some.
            let cell_px = if side * side > 350_000 { 2.0 } else { 1.0 };
            let grain_m = 2.0 * cell_px / px_per_m;
            let off = [
                size.arm_right_m - 0.7,
                size.arm_down_m - 0.7,
                size.width_m - 0.14,
            ];
            assert!(
                noise > 8.0 || off.iter().all(|o| o.abs() < grain_m),
                "{px_per_m} {noise} {off:?}"
            );
        }
    }
    let rms = f64::sqrt(squares / count);
    let share = f64::from(beyond) / count;
    assert!((0.7..1.25).contains(&rms), "{rms}");
    assert!(share < 0.1, "{share} beyond two standard deviations");
}

#[test]
fn any_roll_and_tilt_that_a_fixed_camera_has() {
    for turn_deg in [
        [0.0, 0.0, -15.0],
        [0.0, 0.0, 15.0],
        [0.0, 0.0, 8.0],
        [0.0, 30.0, 0.0],
        [0.0, -30.0, 3.0],
        [30.0, 0.0, 0.0],
        [-30.0, 0.0, -4.0],
        [20.0, 25.0, 0.0],
        [-15.0, 25.0, 12.0],
    ] {
        let view = View3 {
            turn_deg,
            ..View3::plain([600, 560], 60.0)
        };
        let found = find(&frame(&view, &FOUR, 0.7, 0.14, 0.7, 2.0), &FOUR)
            .unwrap_or_else(|e| panic!("{turn_deg:?}: {e}"));
        let error = worst(&found, &view.corners(&FOUR));
        assert!(error < 0.15, "{turn_deg:?}: {error}");
    }
}

#[test]
fn both_panels_of_a_board_of_two() {
    for (marks, shift) in [
        (Marks::TwoPanelUpper, -180.0),
        (Marks::TwoPanelLower, 180.0),
    ] {
        let board = Board {
            width_m: 8.6,
            height_m: 7.2,
            marks,
        };
        for roll in [-2.0, 1.4, 10.0] {
            let view = View3 {
                turn_deg: [3.0, 12.0, roll],
                shift_px: [0.0, shift],
                ..View3::plain([700, 900], 50.0)
            };
            // The marks of the other panel too.
            let mut all = bars(&board, 0.9, 0.18, None);
            let other = Board {
                marks: if marks == Marks::TwoPanelUpper {
                    Marks::TwoPanelLower
                } else {
                    Marks::TwoPanelUpper
                },
                ..board
            };
            let by = if marks == Marks::TwoPanelUpper {
                7.2
            } else {
                -7.2
            };
            let moved = bars(&other, 0.9, 0.18, None);
            all.extend(moved.iter().map(|m| [m[0], m[1] + by, m[2], m[3] + by]));
            let mut levels = draw(&view, &board, &all);
            blur(&mut levels, 700, 0.7);
            let picture = shoot(&levels, 700, 2.0, 5);
            let found = find(&picture, &board).unwrap_or_else(|e| panic!("{marks:?} {roll}: {e}"));
            let error = worst(&found, &view.corners(&board));
            assert!(error < 0.25, "{marks:?} {roll}: {error}");
            // No board of four L marks is this tall for its width.
            let four = Board {
                marks: Marks::FourCorners,
                ..board
            };
            assert!(matches!(
                find(&picture, &four),
                Err(CornersError::NoMarks { .. })
            ));
        }
    }
}

#[test]
fn sixteen_bits_give_what_eight_do() {
    let view = View3::plain([480, 440], 55.0);
    let eight = frame(&view, &FOUR, 0.7, 0.14, 0.7, 1.0);
    let gray: Vec<u8> = eight.view().rows().flatten().copied().collect();
    let wanted = find(&eight, &FOUR).unwrap();
    // Twelve bits of sixteen, and all of them.
    for factor in [16_u16, 257] {
        let wide = gray.iter().map(|&g| u16::from(g) * factor).collect();
        let wide = Picture::new(wide, 480, 440).unwrap();
        let found = find_corners(
            wide.view(),
            &FOUR,
            &FindOptions::default(),
            &mut MarkScratch::default(),
        )
        .unwrap();
        // Where the coarse picture differs, edges start elsewhere.
        assert!(worst(&found, &wanted.at_px) < 0.01);
    }
}

/// Covers a disc about a corner with light or shadow.
fn cover(levels: &mut [f64], width: usize, at: [f64; 2], radius: f64, level: f64) {
    for (k, value) in levels.iter_mut().enumerate() {
        let [x, y] = [(k % width) as f64, (k / width) as f64];
        if (x - at[0]).hypot(y - at[1]) < radius {
            *value = level;
        }
    }
}

#[test]
fn a_hidden_mark_follows_from_the_others_or_is_refused() {
    let view = View3 {
        turn_deg: [10.0, -20.0, 4.0],
        ..View3::plain([600, 560], 60.0)
    };
    let wanted = view.corners(&FOUR);
    for hidden in 0..4 {
        for level in [1.0, 0.02, 0.6] {
            let mut levels = draw(&view, &FOUR, &bars(&FOUR, 0.7, 0.14, None));
            blur(&mut levels, 600, 0.7);
            cover(&mut levels, 600, wanted[hidden], 65.0, level);
            let picture = shoot(&levels, 600, 2.0, 3);
            let found = find(&picture, &FOUR).unwrap();
            for (i, [x, y]) in errors(&found, &wanted).into_iter().enumerate() {
                assert_eq!(found.seen[i], i != hidden);
                let bound = if i == hidden { found.sigma_px[i] } else { 0.15 };
                assert!(x.hypot(y) < bound, "{hidden} {level}: {x} {y}");
            }
            // The uncertainty is that of a direction over the board's side.
            assert!((2.0..6.0).contains(&found.sigma_px[hidden]), "{found:?}");
            let options = FindOptions {
                all_four: true,
                ..FindOptions::default()
            };
            let mut seen = [true; 4];
            seen[hidden] = false;
            assert_eq!(
                find_corners(picture.view(), &FOUR, &options, &mut MarkScratch::default()),
                Err(CornersError::NoMarks { found: seen })
            );
        }
    }
    // Two marks are too few.
    let mut levels = draw(&view, &FOUR, &bars(&FOUR, 0.7, 0.14, None));
    for at in &wanted[1..3] {
        cover(&mut levels, 600, *at, 65.0, 1.0);
    }
    let error = find(&shoot(&levels, 600, 2.0, 3), &FOUR).unwrap_err();
    assert_eq!(
        error,
        CornersError::NoMarks {
            found: [true, false, false, true]
        }
    );
    assert!(error.to_string().contains("upper left, lower left"));
}

#[test]
fn beams_shadows_and_folds_do_not_mislead() {
    let view = View3 {
        turn_deg: [5.0, -15.0, -3.0],
        ..View3::plain([600, 560], 60.0)
    };
    let wanted = view.corners(&FOUR);
    let plain = draw(&view, &FOUR, &bars(&FOUR, 0.7, 0.14, None));
    let mut draws = Draws(9);
    for round in 0..12 {
        let mut levels = plain.clone();
        let [bx, by, size] = [
            draws.unit() * 600.0,
            draws.unit() * 560.0,
            40.0 + 80.0 * draws.unit(),
        ];
        let [sx, sy, a] = [
            draws.unit() * 600.0,
            draws.unit() * 560.0,
            6.0 * draws.unit(),
        ];
        for (k, value) in levels.iter_mut().enumerate() {
            let [x, y] = [(k % 600) as f64, (k / 600) as f64];
            // A beam that may blind the camera, and the edge of a shadow.
            let beam = 1.2 * (-((x - bx).powi(2) + (y - by).powi(2)) / (2.0 * size * size)).exp();
            let lit = (x - sx) * a.cos() + (y - sy) * a.sin() > 0.0;
            let fold = 1.0 + 0.06 * ((0.13 * x + 0.05 * y).sin() + (0.31 * y).sin());
            *value *= fold * (if lit { 1.0 } else { 0.5 } + beam);
        }
        blur(&mut levels, 600, 0.7);
        let picture = shoot(&levels, 600, 2.0, round);
        match find(&picture, &FOUR) {
            Ok(found) => {
                for (i, [x, y]) in errors(&found, &wanted).into_iter().enumerate() {
                    let bound = if found.seen[i] {
                        1.0
                    } else {
                        4.0 * found.sigma_px[i]
                    };
                    assert!(x.hypot(y) < bound, "{round} corner {i}: {x} {y} {found:?}");
                }
            }
            Err(error) => panic!("{round}: {error}"),
        }
    }
}

#[test]
fn nothing_is_claimed_where_there_is_no_board() {
    let mut draws = Draws(21);
    let [width, height] = [480, 360];
    for round in 0..30 {
        let mut levels = vec![0.5; width * height];
        match round % 5 {
            // Noise, coarse noise, beams, bars at random, L marks at random.
            0 => levels.fill_with(|| draws.unit()),
            1 => {
                levels.fill_with(|| 0.5 + 3.0 * (draws.unit() - 0.5));
                blur(&mut levels, width, 2.0 + 0.5 * f64::from(round));
            }
            2 => {
                for _ in 0..3 {
                    let [x, y, s] = [
                        480.0 * draws.unit(),
                        360.0 * draws.unit(),
                        5.0 + 50.0 * draws.unit(),
                    ];
                    for (k, value) in levels.iter_mut().enumerate() {
                        let [dx, dy] = [(k % width) as f64 - x, (k / width) as f64 - y];
                        *value += 0.7 * (-(dx * dx + dy * dy) / (2.0 * s * s)).exp();
                    }
                }
            }
            kind => {
                for _ in 0..40 {
                    let [x, y] = [430.0, 310.0].map(|n| (draws.unit() * n) as usize);
                    let [a, b] = [0, 1].map(|_| 8 + (draws.unit() * 40.0) as usize);
                    for k in 0..a {
                        for w in 0..6 {
                            levels[(y + w) * width + x + k] = 0.1;
                        }
                    }
                    if kind == 4 {
                        for k in 0..b {
                            for w in 0..6 {
                                levels[(y + k) * width + x + w] = 0.1;
                            }
                        }
                    }
                }
            }
        }
        let picture = shoot(&levels, width, 2.0, u64::from(round as u32));
        for marks in [
            Marks::FourCorners,
            Marks::TwoPanelUpper,
            Marks::TwoPanelLower,
        ] {
            let board = Board { marks, ..FOUR };
            let found = find(&picture, &board);
            assert!(
                matches!(found, Err(CornersError::NoMarks { .. })),
                "{round}: {found:?}"
            );
        }
    }
}

#[test]
fn two_boards_are_told_apart_by_where_one_is_expected() {
    let left = View3 {
        shift_px: [-170.0, 3.0],
        ..View3::plain([700, 420], 45.0)
    };
    let right = View3 {
        shift_px: [170.0, -5.0],
        ..left
    };
    let marks = bars(&FOUR, 0.7, 0.14, None);
    let [a, b] = [left, right].map(|view| draw(&view, &FOUR, &marks));
    let mut both: Vec<f64> = a
        .iter()
        .zip(&b)
        .enumerate()
        .map(|(k, (a, b))| if k % 700 < 350 { *a } else { *b })
        .collect();
    blur(&mut both, 700, 0.7);
    let picture = shoot(&both, 700, 2.0, 8);
    assert_eq!(find(&picture, &FOUR), Err(CornersError::SeveralBoards));
    let mut scratch = MarkScratch::default();
    for view in [left, right] {
        let wanted = view.corners(&FOUR);
        let options = FindOptions {
            expected: Some(Expected {
                at_px: wanted.map(|[x, y]| [x + 6.0, y - 7.0]),
                within_px: 15.0,
            }),
            ..FindOptions::default()
        };
        let found = find_corners(picture.view(), &FOUR, &options, &mut scratch).unwrap();
        assert!(worst(&found, &wanted) < 0.25);
    }
    // Nowhere near either.
    let options = FindOptions {
        expected: Some(Expected {
            at_px: left.corners(&FOUR).map(|[x, y]| [x + 60.0, y]),
            within_px: 15.0,
        }),
        ..FindOptions::default()
    };
    assert!(find_corners(picture.view(), &FOUR, &options, &mut scratch).is_err());
}

#[test]
fn memory_of_other_frames_changes_nothing() {
    let mut scratch = MarkScratch::default();
    let large = frame(&View3::plain([600, 560], 60.0), &FOUR, 0.7, 0.14, 0.7, 2.0);
    let small = frame(&View3::plain([360, 330], 40.0), &FOUR, 0.7, 0.14, 0.7, 2.0);
    for picture in [&large, &small, &large] {
        let again = find_corners(picture.view(), &FOUR, &FindOptions::default(), &mut scratch);
        assert_eq!(again, find(picture, &FOUR));
    }
}

#[test]
fn any_picture_is_taken() {
    let mut scratch = MarkScratch::default();
    for [width, height] in [[1, 1], [1, 500], [500, 1], [31, 31], [32, 33], [40, 1000]] {
        for level in [0_u8, 255] {
            let picture = Picture::new(vec![level; width * height], width, height).unwrap();
            let found = find_corners(picture.view(), &FOUR, &FindOptions::default(), &mut scratch);
            assert_eq!(found, Err(CornersError::NoMarks { found: [false; 4] }));
        }
    }
}

#[test]
fn bad_calls_are_refused_by_name() {
    let picture = Picture::new(vec![9_u8; 10_000], 100, 100).unwrap();
    let mut scratch = MarkScratch::default();
    let flat = Board {
        height_m: 0.0,
        ..FOUR
    };
    let found = find_corners(picture.view(), &flat, &FindOptions::default(), &mut scratch);
    assert!(matches!(
        found,
        Err(CornersError::BadBoard {
            what: "height_m",
            ..
        })
    ));
    for (value, within_px) in [(f64::NAN, 5.0), (1.0, 0.0), (1.0, f64::INFINITY)] {
        let options = FindOptions {
            expected: Some(Expected {
                at_px: [[0.0, 0.0], [90.0, value], [90.0, 90.0], [0.0, 90.0]],
                within_px,
            }),
            ..FindOptions::default()
        };
        let found = find_corners(picture.view(), &FOUR, &options, &mut scratch);
        assert!(
            matches!(found, Err(CornersError::NotFinite { .. })),
            "{found:?}"
        );
    }
    // Far outside of the picture there is nothing.
    let options = FindOptions {
        expected: Some(Expected {
            at_px: [[1e9, 1e9], [2e9, 1e9], [2e9, 2e9], [1e9, 2e9]],
            within_px: 5.0,
        }),
        ..FindOptions::default()
    };
    assert!(find_corners(picture.view(), &FOUR, &options, &mut scratch).is_err());
}

#[test]
fn regions_cover_the_marks_and_little_else() {
    for marks in [
        Marks::FourCorners,
        Marks::TwoPanelUpper,
        Marks::TwoPanelLower,
    ] {
        let board = Board { marks, ..FOUR };
        let size = MarkSize {
            arm_right_m: 0.7,
            arm_down_m: 0.7,
            width_m: 0.14,
        };
        let regions = size.regions(&board, 0.02);
        let covered = |u: f64, v: f64| {
            regions
                .iter()
                .any(|[a, _, c, _]| u >= a[0] && u <= c[0] && v >= a[1] && v <= c[1])
        };
        let painted = bars(&board, 0.7, 0.14, None);
        let (mut dark, mut more) = (0, 0);
        let mut draws = Draws(4);
        for _ in 0..200_000 {
            let [u, v] = [3.2, 3.7].map(|m| m * (2.0 * draws.unit() - 1.0));
            let black = painted
                .iter()
                .any(|m| u >= m[0] && u < m[2] && v >= m[1] && v < m[3]);
            assert!(covered(u, v) || !black, "{u} {v}");
            dark += i32::from(black);
            more += i32::from(covered(u, v) && !black);
        }
        // Margins of 2 cm around 14 cm, and one T more on a board of two panels.
        assert!(more < dark * 3 / 4, "{marks:?} {dark} {more}");
    }
}

#[test]
fn corners_make_a_plane() {
    let view = View3::plain([480, 440], 55.0);
    let found = find(&frame(&view, &FOUR, 0.7, 0.14, 0.7, 1.0), &FOUR).unwrap();
    let plane = Plane::new(FOUR, found, None).unwrap();
    let place = plane.to_target(view.see([0.5, -1.2])).unwrap();
    assert!((place[0] - 0.5).abs() < 2e-3 && (place[1] + 1.2).abs() < 2e-3);
    let sigma_m = plane.covariance_m2(view.see([0.5, -1.2])).unwrap()[0][0].sqrt();
    assert!(sigma_m > 1e-5 && sigma_m < 2e-3, "{sigma_m}");
}

/// Through a lens that bends the board's sides by many pixels, marks are put together as a perfect lens would show
/// them, and corners are where the lens pictures them.
#[test]
fn lenses_that_bend_the_board() {
    use crate::simulate::Scene;
    use crate::target::LensValues;
    let mut scratch = MarkScratch::default();
    let (mut squares, mut count, mut largest) = (0.0, 0.0, 0.0_f64);
    for (marks, seed) in [(Marks::FourCorners, 1), (Marks::TwoPanelLower, 2)] {
        for [width, height] in [[768, 576], [1000, 750]] {
            for k1 in [-0.3, 0.2] {
                let board = Board {
                    width_m: 8.0,
                    height_m: 7.0,
                    marks,
                };
                let lens = Lens::new(LensValues {
                    fx_px: width as f64,
                    fy_px: 1.01 * width as f64,
                    cx_px: 0.5 * width as f64 + 7.0,
                    cy_px: 0.5 * height as f64 - 4.0,
                    k1,
                    p1: 0.001,
                    ..LensValues::default()
                })
                .unwrap();
                let plain = Scene::plain(board, width, height).unwrap();
                let scene = Scene {
                    camera: plain.camera.with_lens(lens),
                    ..plain
                };
                let simulated = scene.render(seed).unwrap();
                let crate::Frame::Gray8(picture) = &simulated.frame else {
                    panic!("8 bit");
                };
                let wanted = simulated.truth.corners_px;
                let options = FindOptions {
                    lens: Some(lens),
                    ..FindOptions::default()
                };
                let here = format!("{marks:?} {width} {k1}");
                let mut look = |options: &FindOptions| {
                    find_corners(picture.view(), &board, options, &mut scratch)
                };
                let found = look(&options).unwrap_or_else(|e| panic!("{here}: {e}"));
                assert_eq!(found.seen, [true; 4], "{here}");
                // And looked for near where they are, in a part of the picture.
                let near = look(&FindOptions {
                    expected: Some(Expected {
                        at_px: wanted,
                        within_px: 12.0,
                    }),
                    ..options
                })
                .unwrap();
                for corners in [found, near] {
                    for ((at, to), sigma) in corners.at_px.iter().zip(wanted).zip(corners.sigma_px)
                    {
                        for off in [at[0] - to[0], at[1] - to[1]] {
                            largest = largest.max(off.abs());
                            squares += (off / sigma).powi(2);
                            count += 1.0;
                        }
                    }
                }
                if k1 == -0.3 && marks == Marks::FourCorners {
                    assert!(look(&FindOptions::default()).is_err(), "{here}");
                }
            }
        }
    }
    let rms = f64::sqrt(squares / count);
    println!(
        "{count} coordinates: largest {largest:.3} px, rms {rms:.2} of their standard deviation"
    );
    assert!(largest < 0.3 && rms < 1.5, "{largest} {rms}");
}

/// A hidden corner follows from the three others through the lens too.
#[test]
fn a_hidden_mark_behind_a_lens() {
    use crate::simulate::Scene;
    use crate::target::LensValues;
    let board = Board {
        width_m: 8.0,
        height_m: 7.0,
        marks: Marks::FourCorners,
    };
    let lens = Lens::new(LensValues {
        fx_px: 1000.0,
        fy_px: 1000.0,
        cx_px: 499.5,
        cy_px: 374.5,
        k1: -0.25,
        ..LensValues::default()
    })
    .unwrap();
    let plain = Scene::plain(board, 1000, 750).unwrap();
    let scene = Scene {
        camera: plain.camera.with_lens(lens),
        ..plain
    };
    let simulated = scene.render(3).unwrap();
    let crate::Frame::Gray8(picture) = simulated.frame else {
        panic!("8 bit");
    };
    let wanted = simulated.truth.corners_px;
    let plain: Vec<u8> = picture.view().rows().flatten().copied().collect();
    let options = FindOptions {
        lens: Some(lens),
        ..FindOptions::default()
    };
    for (hidden, [x, y]) in wanted.into_iter().enumerate() {
        let mut covered = plain.clone();
        for (k, value) in covered.iter_mut().enumerate() {
            if ((k % 1000) as f64 - x).hypot((k / 1000) as f64 - y) < 145.0 {
                *value = 255;
            }
        }
        let covered = Picture::new(covered, 1000, 750).unwrap();
        let mut scratch = MarkScratch::default();
        let found = find_corners(covered.view(), &board, &options, &mut scratch).unwrap();
        assert!(!found.seen[hidden]);
        let [dx, dy] = [found.at_px[hidden][0] - x, found.at_px[hidden][1] - y];
        let sigma = found.sigma_px[hidden];
        println!("{hidden}: {dx:.2} {dy:.2} px, sigma {sigma:.2}");
        assert!(dx.hypot(dy) < 4.0 * sigma, "{hidden}: {dx} {dy} {sigma}");
    }
}
