//! Drives: the published examples, both ways, and one triangle in two forms.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::f64::consts::PI;

use helio_core::drive::{Drive, EncoderDrive, ScrewGeometry, TriangleDrive, TriangleGeometry};
use helio_tests::data::{self, Table};
use helio_tests::{Rng, Worst};

/// Angle between the fixed sides of a triangle, law of cosines as printed.
fn law_of_cosines(o: f64, p: f64, s: f64) -> f64 {
    ((o * o + p * p - s * s) / (2.0 * o * p)).acos()
}

/// A row of the Jülich actuator table.
fn actuator(table: &Table, row: usize, sign: f64) -> TriangleGeometry {
    TriangleGeometry {
        offset_m: table.number(row, "offset_m"),
        pivot_radius_m: table.number(row, "pivot_radius_m"),
        initial_stroke_length_m: table.number(row, "initial_stroke_length_m"),
        initial_angle_rad: table.number(row, "initial_angle_rad"),
        steps_per_m: table.number(row, "increment_steps_per_m"),
        clockwise: table.text(row, "clockwise_axis_movement") == "1",
        sign,
    }
}

/// The five worked cases, to their printed digits.
#[test]
fn juelich_examples() {
    let Some(folder) = data::folder("juelich_examples") else {
        return;
    };
    let folder = folder.join("juelich/calibration");
    let examples = Table::read(folder.join("actuator_examples.csv"));
    let actuators = Table::read(folder.join("actuators.csv"));
    assert_eq!(examples.len(), 5);
    for row in 0..examples.len() {
        let key = (examples.text(row, "heliostat"), examples.text(row, "axis"));
        let found = (0..actuators.len())
            .find(|&r| (actuators.text(r, "heliostat"), actuators.text(r, "axis")) == key)
            .unwrap();
        let geometry = actuator(&actuators, found, 1.0);
        let drive = TriangleDrive::new(geometry).unwrap();
        let steps = examples.number(row, "steps");
        let angle = drive.angle_rad(steps).unwrap();
        assert!(
            (angle - examples.number(row, "axis_angle_rad")).abs() <= 0.5e-9,
            "{key:?}"
        );
        let in_degrees = examples.number(row, "axis_angle_deg");
        assert!((angle.to_degrees() - in_degrees).abs() <= 0.5e-6, "{key:?}");
        // the intermediate numbers are what the law says
        let g = geometry;
        let stroke = g.initial_stroke_length_m + steps / g.steps_per_m;
        assert!((stroke - examples.number(row, "stroke_m")).abs() <= 0.51e-9);
        let a = law_of_cosines(g.offset_m, g.pivot_radius_m, stroke);
        let a0 = law_of_cosines(g.offset_m, g.pivot_radius_m, g.initial_stroke_length_m);
        assert!((a - examples.number(row, "triangle_angle_rad")).abs() <= 0.51e-9);
        assert!((a0 - examples.number(row, "triangle_angle_at_zero_rad")).abs() <= 0.51e-9);
        // and back
        let back = drive.steps(angle).unwrap();
        assert!((back - steps).abs() < 1e-6, "{key:?} {back}");
        // the sign turns the axis, nothing else
        let other = TriangleDrive::new(actuator(&actuators, found, -1.0)).unwrap();
        assert_eq!(other.angle_rad(steps).unwrap(), -angle);
    }
}

/// The angles that stand beside the steps in the records of every heliostat, to their printed digits.
#[test]
fn juelich_records_have_the_angles_of_their_steps() {
    let Some(folder) = data::folder("juelich_records_have_the_angles_of_their_steps") else {
        return;
    };
    let folder = folder.join("juelich/calibration");
    let actuators = Table::read(folder.join("actuators.csv"));
    let mut count = 0;
    for row in 0..actuators.len() {
        let heliostat = actuators.text(row, "heliostat");
        let axis = actuators.text(row, "axis");
        let drive = TriangleDrive::new(actuator(&actuators, row, 1.0)).unwrap();
        let records = Table::read(folder.join(format!("{heliostat}.csv")));
        for record in 0..records.len() {
            let steps = records.number(record, &format!("axis{axis}_steps"));
            let want = records.number(record, &format!("axis{axis}_angle_deg"));
            let angle = drive.angle_rad(steps).unwrap();
            assert!(
                (angle.to_degrees() - want).abs() <= 0.51e-6,
                "{heliostat} {axis} {record}"
            );
            assert!((drive.steps(angle).unwrap() - steps).abs() < 1e-6);
            count += 1;
        }
    }
    eprintln!("{count} angles");
    assert!(count > 1_500);
}

/// A triangle that closes, and a screw length inside its reach.
fn random_triangle(rng: &mut Rng) -> TriangleGeometry {
    let offset_m = rng.range(0.2, 1.0);
    let pivot_radius_m = offset_m * rng.range(0.8, 1.25);
    let (least, most) = ((offset_m - pivot_radius_m).abs(), offset_m + pivot_radius_m);
    TriangleGeometry {
        offset_m,
        pivot_radius_m,
        initial_stroke_length_m: least + (most - least) * rng.range(0.05, 0.3),
        initial_angle_rad: rng.within(1.0),
        steps_per_m: rng.log_range(1e3, 1e6),
        clockwise: rng.chance(0.5),
        sign: if rng.chance(0.5) { 1.0 } else { -1.0 },
    }
}

/// The law of the records' README, as printed.
fn readme_angle(g: &TriangleGeometry, steps: f64) -> f64 {
    let a = |s: f64| law_of_cosines(g.offset_m, g.pivot_radius_m, s);
    let change =
        a(g.initial_stroke_length_m + steps / g.steps_per_m) - a(g.initial_stroke_length_m);
    g.sign * (g.initial_angle_rad + if g.clockwise { -change } else { change })
}

#[test]
fn both_ways_close() {
    let mut rng = Rng::new(7);
    let (mut angles, mut strokes, mut law) = (Worst::default(), Worst::default(), Worst::default());
    for _ in 0..200_000 {
        let g = random_triangle(&mut rng);
        let drive = TriangleDrive::new(g).unwrap();
        let most = g.offset_m + g.pivot_radius_m;
        let least = (g.offset_m - g.pivot_radius_m).abs();
        let length = least + (most - least) * rng.range(0.05, 0.95);
        let steps = (length - g.initial_stroke_length_m) * g.steps_per_m;
        let angle = drive.angle_rad(steps).unwrap();
        let place = || format!("{g:?} {steps}");
        law.see((angle - readme_angle(&g, steps)).abs(), place);
        let back = drive.steps(angle).unwrap();
        strokes.see((back - steps).abs() / g.steps_per_m, place);
        angles.see((drive.angle_rad(back).unwrap() - angle).abs(), place);
        let whole = Drive::Triangle(drive);
        assert_eq!(whole.steps(angle), Some(back));
        let quantised = whole.quantised_rad(angle).unwrap();
        let step_rad = (drive.angle_rad(steps + 1.0).unwrap_or(angle) - angle)
            .abs()
            .max(1e-12);
        assert!(
            (quantised - angle).abs() < 0.6 * step_rad + 1e-9,
            "{}",
            place()
        );
    }
    eprintln!(
        "angle -> steps -> angle {angles} rad\nsteps -> angle -> steps {strokes} m\nprinted law {law} rad"
    );
    assert!(angles.value < 1e-12 && strokes.value < 1e-12);
    assert!(law.value < 1e-14, "{law}");
    for _ in 0..50_000 {
        let sign = if rng.chance(0.5) { 1.0 } else { -1.0 };
        let ratio = rng.log_range(10.0, 1e6);
        let zero = rng.within(1e5);
        let drive = Drive::Encoder(EncoderDrive::new(ratio, zero, sign).unwrap());
        let angle = rng.within(20.0);
        let steps = drive.steps(angle).unwrap();
        assert!((steps - (zero + sign * angle * ratio)).abs() < 1e-9 * ratio);
        // the zero's own last bit counts, in steps
        let bar = 1e-12 + 2e-16 * (zero.abs() + 20.0 * ratio) / ratio;
        assert!((drive.angle_rad(steps).unwrap() - angle).abs() < bar);
    }
}

/// Guo 2013: x + x0 = sqrt(a² + b² + 2ab cos(alpha + beta0)) and its inverse, as on the slide.
#[test]
fn the_screw_of_the_slide() {
    let mut rng = Rng::new(71);
    let (mut lengths, mut angles) = (Worst::default(), Worst::default());
    for _ in 0..200_000 {
        let (a, b) = (rng.range(0.2, 1.0), rng.range(0.2, 1.0));
        let bracket_rad = rng.within(1.0);
        let alpha = rng.range(0.05, PI - 0.05) - bracket_rad;
        let zero_length_m = rng.range(0.0, 0.5);
        let sign = if rng.chance(0.5) { 1.0 } else { -1.0 };
        let drive = TriangleDrive::from_screw(ScrewGeometry {
            arm_a_m: a,
            arm_b_m: b,
            bracket_rad,
            zero_length_m,
            steps_per_m: 1.0,
            sign,
        })
        .unwrap();
        let x = (a * a + b * b + 2.0 * a * b * (alpha + bracket_rad).cos()).sqrt() - zero_length_m;
        let place = || format!("a {a} b {b} beta0 {bracket_rad} alpha {alpha}");
        // the printed cosine cancels where the triangle is almost flat: |a - b| against a + b
        let flat = (a + b) / (x + zero_length_m);
        lengths.see((drive.steps(sign * alpha).unwrap() - x).abs() / flat, place);
        let back =
            (((x + zero_length_m).powi(2) - a * a - b * b) / (2.0 * a * b)).acos() - bracket_rad;
        let sine = (alpha + bracket_rad).sin();
        let got = drive.angle_rad(x).unwrap();
        // one unit in the last place of x, by d alpha/dx = -(x + x0)/(ab sin(alpha + beta0))
        let slope = (x + zero_length_m) / (a * b * sine);
        angles.see(
            (got - sign * back).abs() / (1.0 + slope + 1.0 / sine),
            place,
        );
    }
    eprintln!("lengths {lengths} m\nangles {angles} rad");
    assert!(lengths.value < 1e-15 && angles.value < 2e-15);
}

/// Theory §4: clockwise = 1 is alpha = t, beta0 = 180° - a0 - A(s0); clockwise = 0 is alpha = -t,
/// beta0 = 180° + a0 - A(s0).
#[test]
fn screw_and_triangle_are_one() {
    let mut rng = Rng::new(72);
    let (mut by_steps, mut by_angle) = (Worst::default(), Worst::default());
    for _ in 0..200_000 {
        let mut g = random_triangle(&mut rng);
        g.sign = 1.0;
        // the mechanism of the tables: beta0 and all angles of a size of one
        g.initial_angle_rad = rng.within(0.5);
        // A(s0) by half the angle: the printed arccosine has lost digits here
        let (o, p, s0) = (g.offset_m, g.pivot_radius_m, g.initial_stroke_length_m);
        let a0 = 2.0 * (((s0 - (o - p)) * (s0 + (o - p)) / (4.0 * o * p)).sqrt()).asin();
        let (sign, bracket_rad) = if g.clockwise {
            (1.0, PI - g.initial_angle_rad - a0)
        } else {
            (-1.0, PI + g.initial_angle_rad - a0)
        };
        let screw = TriangleDrive::from_screw(ScrewGeometry {
            arm_a_m: g.offset_m,
            arm_b_m: g.pivot_radius_m,
            bracket_rad,
            zero_length_m: g.initial_stroke_length_m,
            steps_per_m: g.steps_per_m,
            sign,
        })
        .unwrap();
        let triangle = TriangleDrive::new(g).unwrap();
        let most = g.offset_m + g.pivot_radius_m;
        let length = g.initial_stroke_length_m
            + (0.95 * most - g.initial_stroke_length_m) * rng.range(0.0, 1.0);
        let steps = (length - g.initial_stroke_length_m) * g.steps_per_m;
        let (a, b) = (
            screw.angle_rad(steps).unwrap(),
            triangle.angle_rad(steps).unwrap(),
        );
        let place = || format!("{g:?} {steps}");
        // relative to the angles that make it up: beta0 is some 3 rad
        by_angle.see((a - b).abs() / (PI + a0), place);
        let (a, b) = (screw.steps(b).unwrap(), triangle.steps(b).unwrap());
        by_steps.see((a - b).abs() / g.steps_per_m / most, place);
    }
    eprintln!("angle {by_angle}\nlength {by_steps} (both relative)");
    assert!(by_angle.value < 5e-16 && by_steps.value < 5e-16);
}

#[test]
fn where_the_mechanism_ends() {
    let g = TriangleGeometry {
        offset_m: 0.3,
        pivot_radius_m: 0.4,
        initial_stroke_length_m: 0.2,
        initial_angle_rad: 0.1,
        steps_per_m: 1000.0,
        clockwise: false,
        sign: 1.0,
    };
    let drive = TriangleDrive::new(g).unwrap();
    // reach is from 0.1 m to 0.7 m
    assert!(drive.angle_rad(-100.0 + 1e-6).is_some() && drive.angle_rad(-100.1).is_none());
    assert!(drive.angle_rad(500.0 - 1e-6).is_some() && drive.angle_rad(500.1).is_none());
    let a0 = law_of_cosines(0.3, 0.4, 0.2);
    let (least, most) = drive.range_rad();
    assert!((least - (0.1 - a0)).abs() < 1e-14 && (most - (0.1 - a0 + PI)).abs() < 1e-14);
    assert!(drive.steps(least - 1e-9).is_none() && drive.steps(most + 1e-9).is_none());
    assert!(drive.steps(f64::NAN).is_none() && drive.angle_rad(f64::NAN).is_none());
    let short = drive.with_range(0.0, 300.0).unwrap();
    assert!(short.angle_rad(-1.0).is_none() && short.angle_rad(301.0).is_none());
    let (least, most) = short.range_rad();
    assert!((least - 0.1).abs() < 1e-14);
    assert!((most - short.angle_rad(300.0).unwrap()).abs() < 1e-14);
    // the ends themselves are inside, both ways
    for steps in [0.0, 300.0] {
        assert!(short.steps(short.angle_rad(steps).unwrap()).is_some());
    }
    let stopped = short.with_stops(0.2, 9.0).unwrap();
    assert_eq!(stopped.range_rad().0, 0.2);
    for (bad, what) in [
        (
            TriangleGeometry {
                offset_m: -0.3,
                ..g
            },
            "offset_m",
        ),
        (
            TriangleGeometry {
                pivot_radius_m: f64::NAN,
                ..g
            },
            "pivot_radius_m",
        ),
        (
            TriangleGeometry {
                initial_stroke_length_m: 0.05,
                ..g
            },
            "initial_stroke_length_m",
        ),
        (
            TriangleGeometry {
                initial_stroke_length_m: 0.8,
                ..g
            },
            "initial_stroke_length_m",
        ),
        (
            TriangleGeometry {
                steps_per_m: 0.0,
                ..g
            },
            "steps_per_m",
        ),
        (TriangleGeometry { sign: 0.5, ..g }, "sign"),
        (
            TriangleGeometry {
                initial_angle_rad: f64::INFINITY,
                ..g
            },
            "initial_angle_rad",
        ),
    ] {
        let error = TriangleDrive::new(bad).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
    assert!(drive.with_range(5.0, 5.0).is_err());
    assert!(EncoderDrive::new(0.0, 0.0, 1.0).is_err());
    assert!(EncoderDrive::new(1.0, f64::NAN, 1.0).is_err());
    assert!(EncoderDrive::new(1.0, 0.0, 2.0).is_err());
    let encoder = EncoderDrive::new(100.0, 50.0, -1.0)
        .unwrap()
        .with_range(0.0, 200.0)
        .unwrap();
    assert_eq!(encoder.range_rad(), (-1.5, 0.5));
    assert!(encoder.steps(0.6).is_none() && encoder.steps(-1.5).is_some());
}
