//! The calibration table goes out and comes back as the same doubles.

use helio_core::MountErrors;
use helio_core::angle::{degrees, radians};
use helio_io::output::{Destination, Format};
use helio_io::{
    CalibratedSet, Provenance, degrees_for, errors_as_written, load_calibration, write_calibration,
};

use crate::files::Folder;

/// Some doubles that look like anything (an LCG; Knuth's MMIX constants).
fn doubles(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn errors(next: &mut impl FnMut() -> f64) -> MountErrors {
    let mut within = |size: f64| (2.0 * next() - 1.0) * size;
    MountErrors {
        pedestal_tilt_rad: within(0.05).abs(),
        pedestal_tilt_azimuth_rad: within(3.1),
        axis_nonorthogonality_rad: within(0.1),
        mirror_tilt_rad: within(0.05),
        azimuth_reference_rad: within(3.1),
        elevation_reference_rad: within(0.3),
    }
}

fn bits(e: &MountErrors) -> [u64; 6] {
    [
        e.pedestal_tilt_rad,
        e.pedestal_tilt_azimuth_rad,
        e.axis_nonorthogonality_rad,
        e.mirror_tilt_rad,
        e.azimuth_reference_rad,
        e.elevation_reference_rad,
    ]
    .map(f64::to_bits)
}

fn set(id: &str, next: &mut impl FnMut() -> f64) -> CalibratedSet {
    let mut covariance = [[0.0; 7]; 7];
    for (row, column) in (0..7).flat_map(|row| (0..=row).map(move |column| (row, column))) {
        covariance[row][column] = 1e-8 * (next() - 0.5);
        covariance[column][row] = covariance[row][column];
    }
    CalibratedSet {
        errors: Some(errors_as_written(&errors(next))),
        pose_errors_rad: [
            None,
            Some(radians(degrees_for(0.01 * next()))),
            Some(radians(degrees_for(-0.01 * next()))),
        ],
        mirror_offset_m: Some(0.1 + next()),
        sigmas: [0; 7].map(|_| 1e-4 * next()),
        covariance: Some(covariance),
        rms_mrad: next(),
        beam_rms_mrad: next(),
        observations: 40,
        rejected: 3,
        iterations: Some(5),
        condition: 100.0 * next(),
        year_pointing_mrad: next(),
        observed_ns: Some((1_700_000_000_000_000_000, 1_710_000_000_123_456_789)),
        ..CalibratedSet::without_result(id, "ok", "")
    }
}

#[test]
fn what_is_written_is_read_back_as_the_same_doubles() {
    let mut next = doubles(1);
    let sets: Vec<CalibratedSet> = ["A1", "A2", "A3"].map(|id| set(id, &mut next)).to_vec();
    for (name, format) in [("c.csv", Format::Csv), ("c.parquet", Format::Parquet)] {
        let more = format!("calibration = \"{name}\"\n");
        let folder = Folder::of_field().edited(&[], &more);
        let destination = Destination::File(folder.path(name));
        write_calibration(destination, format, &sets, &Provenance::default()).unwrap();
        let loaded = folder.load().unwrap();
        assert!(loaded.warnings.is_empty() && loaded.schedule.is_none());
        for (heliostat, set) in loaded.field.heliostats().iter().zip(&sets) {
            assert_eq!(bits(&heliostat.errors), bits(set.errors.as_ref().unwrap()));
            assert_eq!(Some(heliostat.mirror_offset_m), set.mirror_offset_m);
            let stated = set.pose_errors_rad.map(|error| error.unwrap_or(0.0));
            assert_eq!(heliostat.pose_errors.to_array(), stated);
        }
        let again = load_calibration(&folder.path(name)).unwrap();
        for (again, set) in again.iter().zip(&sets) {
            assert_eq!(again.errors, set.errors);
            assert_eq!(again.covariance, set.covariance);
            assert_eq!(again.pose_errors_rad, set.pose_errors_rad);
            assert_eq!(
                (
                    &again.id,
                    &again.status,
                    again.rms_mrad,
                    again.beam_rms_mrad
                ),
                (&set.id, &set.status, set.rms_mrad, set.beam_rms_mrad)
            );
        }
    }
}

#[test]
fn epochs_hours_and_failures_are_read_back() {
    let mut next = doubles(2);
    let day_ns = 86_400_000_000_000;
    let mut sets = vec![
        set("A1", &mut next),
        set("A1", &mut next),
        set("A2", &mut next),
        set("A2", &mut next),
    ];
    (sets[0].set, sets[1].set) = ("1".into(), "2".into());
    sets[0].valid_to_ns = Some(day_ns);
    sets[1].valid_from_ns = Some(day_ns);
    (sets[2].set, sets[3].set) = ("morning".into(), "afternoon".into());
    sets[2].hour_angle_to_rad = Some(0.0);
    sets[3].hour_angle_from_rad = Some(0.0);
    sets.push(CalibratedSet {
        observations: 2,
        ..CalibratedSet::without_result("A3", "too_few", "2 records, at least 3, are needed")
    });
    for set in &mut sets {
        set.mirror_offset_m = None;
    }
    let folder = Folder::of_field().edited(&[], "calibration = \"c.csv\"\n");
    let destination = Destination::File(folder.path("c.csv"));
    write_calibration(destination, Format::Csv, &sets, &Provenance::default()).unwrap();
    let loaded = folder.load().unwrap();
    assert_eq!(loaded.warnings.len(), 1, "{:?}", loaded.warnings);
    assert!(loaded.warnings[0].contains("a row without any numbers for 1 of 3"));
    let schedule = loaded.schedule.unwrap();
    let at = |row, time, hour: f64| bits(&schedule.heliostat_at(row, time, hour).unwrap().errors);
    let of = |set: &CalibratedSet| bits(set.errors.as_ref().unwrap());
    assert_eq!(at(0, Some(day_ns - 1), 1.0), of(&sets[0]));
    assert_eq!(at(0, Some(day_ns), 1.0), of(&sets[1]));
    assert_eq!(at(1, Some(0), -1.0), of(&sets[2]));
    assert_eq!(at(1, Some(0), 1.0), of(&sets[3]));
    // The failure leaves the layout's errors, and says why in the table.
    assert_eq!(bits(&loaded.field.heliostats()[2].errors), [0; 6]);
    let text = std::fs::read_to_string(folder.path("c.csv")).unwrap();
    assert!(
        text.contains("too_few,\"2 records, at least 3, are needed\""),
        "{text}"
    );
    assert!(!text.contains(",mirror_offset_m,"));
}

#[test]
fn degrees_are_the_nearest_and_stay() {
    let mut next = doubles(3);
    let (mut exact, mut worst) = (0, 0.0_f64);
    for _ in 0..100_000 {
        let angle_rad = (2.0 * next() - 1.0) * 3.2;
        let written = radians(degrees_for(angle_rad));
        exact += usize::from(written == angle_rad);
        worst = worst.max(((written - angle_rad) / angle_rad).abs());
        // Once written it stays.
        assert_eq!(radians(degrees_for(written)).to_bits(), written.to_bits());
        assert!((written - angle_rad).abs() <= (radians(degrees(angle_rad)) - angle_rad).abs());
    }
    // Half a step of the degrees at most, whose relative size is 2^-52.
    assert!(worst <= 2.3e-16, "{worst}");
    assert!(exact > 50_000, "{exact}");
    for written in [0.0, -0.1, 12.3, 359.999, 1e-7] {
        assert_eq!(degrees_for(radians(written)), written);
    }
}

#[test]
fn a_covariance_that_is_none_is_refused() {
    for bad in ["1 2", "1 x 2", "NaN", "1 2 3 4 5"] {
        let text = format!("id,pedestal_tilt_deg,covariance\nA1,0.1,{bad}\n");
        let folder = Folder::new().with("c.csv", text);
        let error = load_calibration(&folder.path("c.csv")).unwrap_err();
        let said = folder.redact(&error);
        assert!(
            said.starts_with("DIR/c.csv:2: heliostat `A1`: column `covariance`: must be the lower"),
            "{said}"
        );
    }
}
