//! Numbers that a figure must bear or refuse.

use helio_report::FigureError;
use helio_report::flux::{
    Convergence, FaceMap, GridMap, MapText, Series, SeriesPlot, Surface, convergence, face_map,
    grid_map, grid_profiles, series_plot,
};

use super::drawing::read;

fn plane(irradiance_w_m2: &[f64], rows: usize, columns: usize) -> GridMap<'_> {
    GridMap {
        text: MapText::default(),
        surface: Surface::Plane {
            width_m: 1.0,
            height_m: 1.0,
        },
        rows,
        columns,
        irradiance_w_m2,
    }
}

#[test]
fn odd_maps_are_drawn() {
    let dark = vec![0.0; 100];
    let even = vec![7.0; 100];
    let column: Vec<f64> = (0..100).map(f64::from).collect();
    for (values, rows) in [
        (&dark[..], 10),
        (&even, 10),
        (&column, 100),
        (&column, 1),
        (&[3.0], 1),
        (&[0.0], 1),
        (&[f64::MIN_POSITIVE; 4], 2),
        (&[1e300, 0.0, 0.0, 0.0], 2),
    ] {
        let map = plane(values, rows, values.len() / rows);
        let drawing = read(&grid_map(&map).unwrap());
        assert!(drawing.contours.iter().flatten().count() < 40);
        read(&grid_profiles(&map).unwrap());
    }
    let drawing = read(&grid_map(&plane(&dark, 10, 10)).unwrap());
    assert!(drawing.marks.is_empty() && drawing.says("power 0\u{202f}W: no light"));
    // no bin of it is a peak
    for figure in [grid_map, grid_profiles] {
        let drawn = figure(&plane(&dark, 10, 10)).unwrap().to_svg();
        assert!(!drawn.contains("peak"), "{drawn}");
    }
    // needles are stretched to be seen, and say so
    for size in [[1e-3, 5.0], [80.0, 0.01], [1e4, 1e-3]] {
        let map = GridMap {
            surface: Surface::Plane {
                width_m: size[0],
                height_m: size[1],
            },
            ..plane(&even, 10, 10)
        };
        let drawing = read(&grid_map(&map).unwrap());
        assert!(drawing.says("shorter side stretched"));
    }
}

fn said(result: Result<helio_report::Figure, FigureError>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn impossible_maps_are_refused_by_name() {
    let good = [1.0; 4];
    let map = plane(&good, 2, 2);
    for draw in [grid_map, grid_profiles] {
        assert_eq!(
            said(draw(&plane(&[1.0, 2.0, f64::NAN, 0.0], 2, 2))),
            "figure: irradiance_w_m2: expected finite and not negative, got NaN in row 2 (counted from 0)"
        );
        assert_eq!(
            said(draw(&plane(&[1.0, -2.0, 0.0, 0.0], 2, 2))),
            "figure: irradiance_w_m2: expected finite and not negative, got -2 in row 1 (counted from 0)"
        );
        assert!(said(draw(&plane(&[f64::INFINITY; 4], 2, 2))).contains("got inf in row 0"));
        assert_eq!(
            said(draw(&plane(&good, 2, 3))),
            "figure: irradiance_w_m2: expected 6 entries, got 4"
        );
        assert_eq!(
            said(draw(&plane(&[], 0, 3))),
            "figure: there is no bin to draw"
        );
        assert!(draw(&plane(&good, usize::MAX, 2)).is_err());
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let surface = Surface::Plane {
                width_m: 1.0,
                height_m: bad,
            };
            assert_eq!(
                said(draw(&GridMap { surface, ..map })),
                format!("figure: height_m: expected above 0 m and finite, got {bad}")
            );
            let surface = Surface::Round {
                top_radius_m: bad,
                bottom_radius_m: 0.0,
                slant_m: 1.0,
            };
            assert!(draw(&GridMap { surface, ..map }).is_err());
            let text = MapText {
                dni_w_m2: Some(bad),
                ..MapText::default()
            };
            assert!(said(draw(&GridMap { text, ..map })).starts_with("figure: dni_w_m2"));
        }
    }
}

#[test]
fn odd_faces_are_drawn_and_impossible_ones_refused() {
    let face = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let faces: [&[[f64; 3]]; 1] = [&face];
    let map = FaceMap {
        title: "",
        words: "",
        quantity: "q",
        unit: "",
        faces_m: &faces,
        values: &[1.0],
        toward_viewer: [0.0, 0.0, 1.0],
        signed: false,
    };
    // seen from its edge, without a value, with none of any size
    let far = [
        [1e9, 1e9, 0.0],
        [1e9, 1e9 + 1e-3, 0.0],
        [1e9 + 1e-3, 1e9, 0.0],
    ];
    let flat = [[1.0; 3]; 3];
    for faces in [[&face[..]], [&far[..]], [&flat[..]]] {
        for toward_viewer in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1e-3, 2.0, 1e-200]] {
            for value in [f64::NAN, 0.0, -3.0, 1e300] {
                for signed in [false, true] {
                    let values = [value];
                    let odd = FaceMap {
                        faces_m: &faces,
                        values: &values,
                        toward_viewer,
                        signed,
                        ..map
                    };
                    read(&face_map(&odd).unwrap());
                }
            }
        }
    }
    assert!(
        said(face_map(&FaceMap {
            faces_m: &[],
            values: &[],
            ..map
        }))
        .contains("no face")
    );
    assert!(said(face_map(&FaceMap { values: &[], ..map })).contains("expected 1 entries"));
    let infinite = FaceMap {
        values: &[f64::INFINITY],
        ..map
    };
    assert!(said(face_map(&infinite)).contains("got inf in row 0"));
    let nowhere = FaceMap {
        toward_viewer: [0.0; 3],
        ..map
    };
    assert!(said(face_map(&nowhere)).contains("toward_viewer"));
    let line: [&[[f64; 3]]; 1] = [&face[..2]];
    assert!(
        said(face_map(&FaceMap {
            faces_m: &line,
            ..map
        }))
        .contains("three corners")
    );
    let lost = [[0.0, f64::NAN, 0.0]; 3];
    let lost: [&[[f64; 3]]; 1] = [&lost];
    assert!(
        said(face_map(&FaceMap {
            faces_m: &lost,
            ..map
        }))
        .contains("got NaN in row 0")
    );
}

#[test]
fn odd_series_are_drawn_and_impossible_ones_refused() {
    let series = |x: &'static [f64], y: &'static [f64]| Series {
        name: "a",
        x,
        y,
        fit: true,
    };
    let draw = |one: Series<'_>| {
        convergence(&Convergence {
            title: "",
            x_name: "rays",
            y_name: "error",
            series: &[one],
        })
    };
    for one in [
        series(&[10.0], &[0.1]),
        series(&[10.0, 10.0], &[0.1, 0.1]),
        series(&[1e-300, 1e300], &[1e300, 1e-300]),
        series(&[1.0, 2.0], &[0.0, 1e-3]),
    ] {
        read(&draw(one).unwrap());
    }
    let words = read(&draw(series(&[1.0, 2.0], &[0.0, 1e-3])).unwrap());
    assert!(words.says("a (one error of 0 not drawn)"));
    for (one, why) in [
        (
            series(&[0.0], &[1.0]),
            "x of a series: expected above 0 and finite, got 0 in row 0",
        ),
        (
            series(&[1.0], &[-1.0]),
            "y of a series: expected not negative and finite, got -1",
        ),
        (series(&[1.0], &[f64::NAN]), "got NaN"),
        (series(&[1.0, 2.0], &[1.0]), "expected 2 entries, got 1"),
        (series(&[], &[]), "no point of a series"),
        (series(&[1.0], &[0.0]), "no point"),
    ] {
        let text = said(draw(one));
        assert!(text.contains(why), "{text}");
    }
    let plot = |series: &[Series<'_>]| {
        said(series_plot(&SeriesPlot {
            title: "",
            x_name: "",
            y_name: "",
            x_log: false,
            y_log: false,
            series,
        }))
    };
    assert_eq!(plot(&[]), "figure: there is no series to draw");
    assert!(plot(&[series(&[1.0], &[1.0]); 8]).contains("at most 7, got 8"));
    assert!(plot(&[series(&[f64::MAX, f64::MIN], &[1.0, 2.0])]).contains("no point"));
}
