//! Figures of real runs: the loaded strips and the folded plate of Yan 2022, and a field on receivers of every shape.

use std::fs;

use helio_core::{Enu, EnuUnit, Field, Heliostat, TrackingMode};
use helio_flux::deform::{SlopeErrors, substitute_elements};
use helio_flux::mesh::{MirrorOptions, Pick, ReadOptions, frd, inp};
use helio_flux::{
    Canting, Element, FluxMap, FoldedPlate, Frustum, HeliostatMirror, MeshReceiver, OpticalError,
    Plane, RayOptions, Rays, Receiver, Scene, SunShape, field_mirrors, trace_rays,
};
use helio_report::flux::{
    MapText, SlopeColumn, receiver_figure, receiver_map, slope_figure, slope_map,
};

use super::drawing::{keep, read};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/");
const UP: [f64; 3] = [0.0, 0.0, 1.0];

fn trace(elements: &[Element], receiver: &Receiver, sun: [f64; 3], rays: u64) -> FluxMap {
    let sun_shape = SunShape::pillbox(0.26_f64.to_radians()).unwrap();
    let scene = Scene {
        elements,
        receiver,
        sun,
        dni_w_m2: 1000.0,
        sun_shape: &sun_shape,
        optical_error: OpticalError::NONE,
    };
    let options = RayOptions {
        rays: Rays::Total(rays),
        ..RayOptions::default()
    };
    trace_rays(&scene, &options).unwrap()
}

fn text(title: &str) -> MapText<'_> {
    MapText {
        title,
        dni_w_m2: Some(1000.0),
        subtitle: "",
    }
}

// 22.60 mrad and 20.20 mm at most, as the readme of the example has them.
#[test]
fn the_loaded_strips() {
    let file = |name: &str| fs::read(format!("{ROOT}flux/{name}")).unwrap();
    let options = ReadOptions::in_units_of(0.001).unwrap();
    let mut mesh = inp::mesh("strips.inp", &file("strips.inp"), &options).unwrap();
    let moved = frd::displacements("strips.frd", &file("strips.frd"), frd::Step::Last, &options);
    mesh.displace(&moved.unwrap());
    let sun = MirrorOptions::toward(UP).unwrap();
    let mirror = mesh.mirror(&Pick::Surface("MIRROR"), &sun).unwrap();
    let loaded = substitute_elements(&mirror).unwrap();
    let slopes = SlopeErrors::new(&loaded, [0.0, 1.0, 0.0]).unwrap();
    let draw = |column| slope_map(&loaded, &slopes, column, UP, "Loaded strips").unwrap();
    let total = read(&draw(SlopeColumn::Total));
    assert_eq!(total.faces.len(), 280);
    assert!(total.says("slope error of 280 faces: greatest 22.6\u{202f}mrad"));
    assert!(total.says("seen along the sun"));
    // all of them, laid beside each other, cover what the brightest covers many times
    assert!(read(&draw(SlopeColumn::Moved)).says("displacement of 280 faces: greatest 20.1"));
    let figure = slope_figure(&loaded, &slopes, UP, "Slope errors of the loaded strips").unwrap();
    keep("flux-strips-slopes", &figure);
    assert_eq!(read(&figure).faces.len(), 4 * 280);

    let receiver = Plane::new(
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
        [1.0, 0.0, 0.0],
        [0.3; 2],
        [60; 2],
    );
    let receiver = Receiver::Plane(receiver.unwrap());
    let elements: Vec<Element> = loaded.loaded().iter().flatten().copied().collect();
    let map = trace(&elements, &receiver, UP, 1 << 20);
    keep(
        "flux-strips",
        &receiver_figure(&receiver, &map, &text("Loaded strips")).unwrap(),
    );
}

// The paper's concentration of 11.33: flat over 200 mm.
#[test]
fn the_folded_plate() {
    let plate = FoldedPlate::new(0.15, 0.2, 1.0, 8).unwrap();
    let elements = plate.elements(0.5).unwrap();
    let receiver = Plane::new(
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
        [1.0, 0.0, 0.0],
        [0.3, 0.2],
        [40, 60],
    );
    let receiver = Receiver::Plane(receiver.unwrap());
    let map = trace(&elements, &receiver, UP, 1 << 21);
    let figure =
        receiver_figure(&receiver, &map, &text("Folded plate, eight strips a side")).unwrap();
    keep("flux-folded-plate", &figure);
    let words = read(&figure);
    assert!(words.says("concentration 12."), "{:?}", words.texts);
}

fn field_on(receiver: &Receiver, rays: u64, every: usize) -> FluxMap {
    let table = fs::read_to_string(format!("{ROOT}heliostats.csv")).unwrap();
    let mut field = Field::new(TrackingMode::AzimuthElevation);
    for line in table.lines().skip(1).step_by(every) {
        let cells: Vec<&str> = line.split(',').collect();
        let at = |k: usize| cells[k].parse::<f64>().unwrap();
        let mut heliostat =
            Heliostat::new(Enu::new(at(1), at(2), at(3)), Enu::new(0.0, 0.0, 120.0));
        heliostat.mirror_offset_m = 0.3;
        field.push(cells[0], heliostat).unwrap();
    }
    let sun = EnuUnit::from_azimuth_elevation(3.3, 1.0);
    let mirror = HeliostatMirror {
        columns: 2,
        rows: 2,
        gap_m: 0.05,
        canting: Canting::ToAim,
        ..HeliostatMirror::default()
    };
    let mirrors = field_mirrors(&field, sun, &mirror).unwrap();
    let sun = sun.as_enu();
    let sun = [sun.east, sun.north, sun.up];
    trace(&mirrors.elements, receiver, sun, rays)
}

#[test]
fn a_field_on_a_plane() {
    let plane = Plane::new(
        [0.0, 0.0, 120.0],
        [0.0, 0.9, -0.4],
        [-1.0, 0.0, 0.0],
        [12.0, 10.0],
        [100, 120],
    );
    let receiver = Receiver::Plane(plane.unwrap());
    let calm = receiver_figure(
        &receiver,
        &field_on(&receiver, 1 << 22, 2),
        &text("A field"),
    );
    keep("flux-field", &calm.unwrap());
    // few rays: noise of several per cent
    let rough = receiver_map(
        &receiver,
        &field_on(&receiver, 1 << 17, 2),
        &text("The same, few rays"),
    );
    let rough = rough.unwrap();
    keep("flux-field-noisy", &rough);
    let drawing = read(&rough);
    assert!(drawing.says("contours smoothed over"));
    let lines: usize = drawing.contours.iter().map(Vec::len).sum();
    assert!(lines < 60, "{lines}");
}

#[test]
fn a_field_on_round_receivers() {
    let base = [0.0, 0.0, 114.0];
    let zero = [0.0, -1.0, 0.0];
    let cylinder = Frustum::cylinder(base, UP, zero, 5.0, 12.0, [48, 120]).unwrap();
    let receiver = Receiver::Frustum(cylinder);
    let figure = receiver_figure(
        &receiver,
        &field_on(&receiver, 1 << 21, 2),
        &text("A cylinder"),
    );
    keep("flux-cylinder", &figure.unwrap());
    let cone = Frustum::cone(base, UP, zero, [3.0, 6.0], 12.0, [24, 60]).unwrap();
    let receiver = Receiver::Frustum(cone);
    let figure = receiver_map(&receiver, &field_on(&receiver, 1 << 20, 2), &text("A cone"));
    keep("flux-cone", &figure.unwrap());
}

// A board of triangles has the flux of a board of bins.
#[test]
fn a_field_on_a_mesh() {
    let (columns, rows) = (24, 20);
    let at = |i: usize, j: usize| {
        let (x, z) = (
            i as f64 / columns as f64 - 0.5,
            j as f64 / rows as f64 - 0.5,
        );
        // bent like a bow, hollow to the field
        [-12.0 * x, 6.0 * x * x, 120.0 + 10.0 * z]
    };
    let mut triangles = Vec::new();
    for j in 0..rows {
        for i in 0..columns {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let receiver = Receiver::Mesh(MeshReceiver::new(&triangles).unwrap());
    let map = field_on(&receiver, 1 << 20, 2);
    assert!(map.account().received_w > 0.0);
    let figure = receiver_map(&receiver, &map, &text("A bowed board of triangles")).unwrap();
    keep("flux-mesh", &figure);
    let drawing = read(&figure);
    assert_eq!(drawing.faces.len(), triangles.len());
    assert!(drawing.says("irradiance of 960 faces: greatest"));
}

#[cfg(feature = "png")]
#[test]
fn pictures_have_text_and_the_same_bytes_each_time() {
    let receiver = Plane::new(
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
        [1.0, 0.0, 0.0],
        [0.3; 2],
        [8; 2],
    );
    let receiver = Receiver::Plane(receiver.unwrap());
    let elements = FoldedPlate::new(0.15, 0.2, 1.0, 8)
        .unwrap()
        .elements(0.5)
        .unwrap();
    let map = trace(&elements, &receiver, UP, 1 << 14);
    let draw = |title| receiver_map(&receiver, &map, &text(title)).unwrap();
    let (figure, silent) = (draw("Title: Ωµ 10⁻³ м²"), draw(""));
    let png = figure.to_png(2.0).unwrap();
    assert_eq!(png, figure.to_png(2.0).unwrap());
    let picture = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().into_luma8();
    let (with, without) = (picture(&png), picture(&silent.to_png(2.0).unwrap()));
    assert_eq!(with.width(), 2 * 860);
    // the title's letters are the only difference: 16 pixels high, a line from the left
    let ink = |(x, y, pixel): (u32, u32, &image::Luma<u8>)| {
        (pixel.0 != without.get_pixel(x, y).0).then_some((x, y, pixel.0[0]))
    };
    let letters: Vec<(u32, u32, u8)> = with.enumerate_pixels().filter_map(ink).collect();
    let dark = letters.iter().filter(|l| l.2 < 80).count();
    assert!((1000..6000).contains(&dark), "{dark}");
    assert!(
        letters
            .iter()
            .all(|&(x, y, _)| x >= 2 * 74 && x < 2 * 300 && (20..64).contains(&y))
    );
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e4, 1e-9] {
        assert!(figure.to_png(scale).is_err(), "{scale}");
    }
}
