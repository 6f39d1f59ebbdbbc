//! Maps of grids and their profiles.

use std::f64::consts::TAU;

use helio_report::flux::{GridMap, MapText, Surface, grid_map, grid_profiles};

use super::drawing::read;

fn plane(irradiance_w_m2: &[f64], rows: usize, size_m: [f64; 2]) -> GridMap<'_> {
    GridMap {
        text: MapText {
            title: "A <map>",
            dni_w_m2: Some(1000.0),
            subtitle: "",
        },
        surface: Surface::Plane {
            width_m: size_m[0],
            height_m: size_m[1],
        },
        rows,
        columns: irradiance_w_m2.len() / rows,
        irradiance_w_m2,
    }
}

/// A round Gaussian spot: middle in parts of the sides, radius in parts of the width, peak 1 kW/m² times `peak_kw`.
fn spot(side: usize, middle: [f64; 2], radius: f64, peak_kw: f64) -> Vec<f64> {
    (0..side * side)
        .map(|i| {
            let x = ((i % side) as f64 + 0.5) / side as f64 - middle[0];
            let y = ((i / side) as f64 + 0.5) / side as f64 - middle[1];
            1e3 * peak_kw * (-0.5 * (x * x + y * y) / (radius * radius)).exp()
        })
        .collect()
}

// Colours of matplotlib's viridis at 0, 0.25, 0.5 and 1, read from its own table; cells as large as their bins.
#[test]
fn cells_have_the_colour_of_their_value_and_the_size_of_their_bin() {
    let values = [0.0, 1000.0, 2000.0, 4000.0, 0.0, 500.0];
    let drawing = read(&grid_map(&plane(&values, 2, [0.6, 0.2])).unwrap());
    let close = |fill: &str, wanted: [u8; 3]| {
        let channel = |k: usize| u8::from_str_radix(&fill[1 + 2 * k..3 + 2 * k], 16).unwrap();
        (0..3).all(|k| channel(k).abs_diff(wanted[k]) <= 2)
    };
    let viridis = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [253, 231, 37]];
    let cells = &drawing.cells[..6];
    for (cell, wanted) in cells.iter().zip(viridis) {
        assert!(close(&cell.fill, wanted), "{cell:?} {wanted:?}");
    }
    let [left, top, ..] = cells[0].edges;
    let [.., right, bottom] = cells[5].edges;
    // 0.6 m by 0.2 m to one scale
    assert!(((right - left) / (bottom - top) - 3.0).abs() < 0.01);
    for (k, cell) in cells.iter().enumerate() {
        let (row, column) = ((k / 3) as f64, (k % 3) as f64);
        let wanted = [
            left + (right - left) * column / 3.0,
            top + (bottom - top) * row / 2.0,
        ];
        assert!(
            (cell.edges[0] - wanted[0]).abs() <= 0.1 && (cell.edges[1] - wanted[1]).abs() <= 0.1
        );
    }
    // bins of 0.02 m²: 7500 W/m² times 0.02 m² is 150 W, over 0.12 m² 1250 W/m²
    assert!(drawing.says("power 150\u{202f}W, mean 1.25\u{202f}kW/m², peak 4\u{202f}kW/m²"));
    assert!(drawing.says("concentration 4 at the peak, 1.25 in the mean"));
    // the peak: first column, second row
    assert!(drawing.says("at \u{2212}0.2\u{202f}m right, 0.05\u{202f}m down"));
    let mark = drawing.marks[0];
    assert!((mark.0 - (left + (right - left) / 6.0)).abs() < 0.2);
    assert!((mark.1 - (top + (bottom - top) * 0.75)).abs() < 0.2);
    assert!(drawing.says("A <map>"));
}

// Radii of a Gaussian's isolines follow from its formula: r = radius √(2 ln(peak / level)).
#[test]
fn contours_and_their_numbers_are_where_the_formula_has_them() {
    let (side, middle, radius) = (200, [0.55, 0.45], 0.12);
    let values = spot(side, middle, radius, 8.4);
    let drawing = read(&grid_map(&plane(&values, side, [2.0, 2.0])).unwrap());
    let (_, [left, top, right, bottom]) = drawing.image.expect("many bins are a picture");
    let side_px = right - left;
    assert!((side_px - (bottom - top)).abs() < 0.2);
    let at = |part: [f64; 2]| (left + side_px * part[0], top + side_px * part[1]);
    let centre = at(middle);
    let wanted = |level_kw: f64| side_px * radius * (2.0 * (8.4 / level_kw).ln()).sqrt();
    assert_eq!(drawing.contours.len(), 4); // 2, 4, 6 and 8 kW/m²
    for (lines, level) in drawing.contours.iter().zip([2.0, 4.0, 6.0, 8.0]) {
        assert_eq!(lines.len(), 1, "{level}");
        for &(x, y) in &lines[0] {
            let r = (x - centre.0).hypot(y - centre.1);
            assert!(
                (r - wanted(level)).abs() < 1.0,
                "{level}: {r} {}",
                wanted(level)
            );
        }
    }
    assert!(drawing.levels.len() >= 3, "{:?}", drawing.levels);
    for (x, y, text) in &drawing.levels {
        let level: f64 = text.parse().unwrap();
        let r = (x - centre.0).hypot(y - 4.0 - centre.1);
        assert!((r - wanted(level)).abs() < 1.5, "{text}: {r}");
    }
    for (k, a) in drawing.levels.iter().enumerate() {
        for b in &drawing.levels[..k] {
            assert!(
                (a.0 - b.0).abs() > 12.0 || (a.1 - b.1).abs() > 12.0,
                "{a:?} {b:?}"
            );
        }
    }
    let mark = drawing.marks[0];
    assert!((mark.0 - centre.0).abs() < 2.0 && (mark.1 - centre.1).abs() < 2.0);
}

// A million bins: a file of a few hundred kilobytes, each bin's pixel of the colour of its value.
#[test]
fn a_map_of_a_million_bins_is_one_picture() {
    let side = 1000;
    let values = spot(side, [0.25, 0.7], 0.1, 1200.0);
    let figure = grid_map(&plane(&values, side, [10.0, 10.0])).unwrap();
    assert!(
        figure.to_svg().len() < 2_000_000,
        "{}",
        figure.to_svg().len()
    );
    let drawing = read(&figure);
    let (picture, _) = drawing.image.unwrap();
    assert_eq!((picture.width(), picture.height()), (1000, 1000));
    assert_eq!(picture.get_pixel(250, 700).0, [253, 231, 37]);
    assert_eq!(picture.get_pixel(950, 50).0, [68, 1, 84]);
    assert!(drawing.says("peak 1.2\u{202f}MW/m²"));
    // on a grid too fine to show, means of 2 by 2
    let fine = vec![5.0; 1300 * 4];
    let drawing = read(&grid_map(&plane(&fine, 4, [10.0, 5.0])).unwrap());
    assert_eq!(drawing.image.unwrap().0.width(), 650);
    // few bins are repeated until they are hundreds of pixels
    let drawing = read(&grid_map(&plane(&spot(64, [0.5; 2], 0.2, 3.0), 64, [1.0; 2])).unwrap());
    let picture = drawing.image.unwrap().0;
    assert_eq!((picture.width(), picture.height()), (1024, 1024));
    assert_eq!(
        picture.get_pixel(32 * 16, 32 * 16),
        picture.get_pixel(33 * 16 - 1, 33 * 16 - 1)
    );
}

#[test]
fn a_cylinder_is_unrolled_by_its_arc() {
    let values: Vec<f64> = (0..40 * 10)
        .map(|i| if i == 5 * 40 + 9 { 3000.0 } else { 100.0 })
        .collect();
    let map = GridMap {
        text: MapText::default(),
        surface: Surface::Round {
            top_radius_m: 2.0,
            bottom_radius_m: 2.0,
            slant_m: 3.0,
        },
        rows: 10,
        columns: 40,
        irradiance_w_m2: &values,
    };
    let drawing = read(&grid_map(&map).unwrap());
    let (left, top) = (drawing.cells[0].edges[0], drawing.cells[0].edges[1]);
    let (mut right, mut bottom) = (0.0, 0.0);
    for cell in drawing
        .cells
        .iter()
        .filter(|c| c.fill.starts_with("#3") || c.fill.starts_with("#4"))
    {
        if cell.edges[2] < 700.0 {
            (right, bottom) = (cell.edges[2].max(right), cell.edges[3].max(bottom));
        }
    }
    assert!(((right - left) / (bottom - top) - TAU * 2.0 / 3.0).abs() < 0.02);
    // the tenth of forty columns ends at a quarter turn: its middle is at 85.5 degrees
    assert!(drawing.says("at 85.5°, 1.65\u{202f}m down"));
    for degrees in ["0°", "90°", "180°", "270°", "360°"] {
        assert!(drawing.texts.iter().any(|t| t.2 == degrees));
    }
    // bins of a cone differ in area: 100 W/m² over the whole of it is its area times that
    let cone = GridMap {
        surface: Surface::Round {
            top_radius_m: 0.0,
            bottom_radius_m: 2.0,
            slant_m: 5.0,
        },
        irradiance_w_m2: &[100.0; 400],
        ..map
    };
    // π r s = 31.416 m²
    let drawing = read(&grid_map(&cone).unwrap());
    assert!(drawing.says("power 3.142\u{202f}kW, mean 100\u{202f}W/m²"));
    assert!(drawing.says("arc length at the mean radius (m), angle above"));
    assert!(drawing.contours.is_empty());
}

#[test]
fn profiles_are_the_row_and_the_column_of_the_peak() {
    let values = [0.0, 1000.0, 2000.0, 4000.0, 0.0, 500.0];
    let drawing = read(&grid_profiles(&plane(&values, 2, [0.6, 0.2])).unwrap());
    // along the row: the mean of both rows and the second row; along the column: the mean of three and the first
    assert_eq!(drawing.curves.len(), 4 + 4); // and four in the legends
    let curves: Vec<&Vec<(f64, f64)>> = drawing
        .curves
        .iter()
        .map(|c| &c.1)
        .filter(|c| c.len() > 2)
        .collect();
    let wanted: [&[f64]; 4] = [
        &[2000.0, 500.0, 1250.0],
        &[4000.0, 0.0, 500.0],
        &[1000.0, 1500.0],
        &[0.0, 4000.0],
    ];
    // pixels of 0 and of the peak, both in the curves through the peak
    for (pair, wanted) in curves.chunks(2).zip(wanted.chunks(2)) {
        let lowest = pair[1]
            .iter()
            .map(|p| p.1)
            .fold(f64::NEG_INFINITY, f64::max);
        let highest = pair[1].iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        for (curve, wanted) in pair.iter().zip(wanted) {
            assert_eq!(curve.len(), 2 * wanted.len());
            for (k, &(_, y)) in curve.iter().enumerate() {
                let value = 4000.0 * (lowest - y) / (lowest - highest);
                assert!(
                    (value - wanted[k / 2]).abs() < 5.0,
                    "{value} {}",
                    wanted[k / 2]
                );
            }
        }
    }
    assert!(drawing.says("row of the peak, 0.05\u{202f}m down (2 of 2)"));
    assert!(drawing.says("mean of the 3 columns"));
    let fine = spot(700, [0.5; 2], 0.1, 2.0);
    let drawing = read(&grid_profiles(&plane(&fine, 700, [1.0; 2])).unwrap());
    assert!(drawing.curves.iter().all(|c| c.1.len() <= 1500));
}
