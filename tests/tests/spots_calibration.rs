//! From camera frames to corrected parameters: the seven pictured records of AA39's last epoch.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use std::fmt::Write as _;
use std::path::Path;

use helio_calib::{FitOptions, Mount, Observation, Parameters, beam_errors_mrad, fit};
use helio_io::output::{Destination, Format};
use helio_io::{
    SpotRow, load_field, load_observations_with_spots, load_spots, load_target, write_spots,
};
use helio_spot::{Frame, Limits, Plane, RobustOptions, SpotScratch, decode, find_spot};
use helio_tests::data::{self, Table};
use helio_tests::juelich;

const HELIOSTAT: &str = "AA39";

/// The records, and which of the last epoch have a picture.
fn pictured(juelich: &Path) -> (Table, Vec<usize>) {
    let path = juelich.join("calibration").join(format!("{HELIOSTAT}.csv"));
    let records = Table::read(path);
    let rows = (0..records.len())
        .filter(|&row| records.text(row, "epoch") == "3")
        .filter(|&row| crop(juelich, records.text(row, "record_id")).exists())
        .collect();
    (records, rows)
}

fn crop(juelich: &Path, id: &str) -> std::path::PathBuf {
    juelich.join("crops").join(format!("{id}-cropped.png"))
}

/// Crops show the whole target: their edges are the lines between its corners.
fn plane_of_crop(folder: &Path, size_m: [f64; 2]) -> Plane {
    let path = folder.join("target.toml");
    let [width_m, height_m] = size_m;
    let text = format!(
        "width_m = {width_m}\nheight_m = {height_m}\ncorners_sigma_px = 0.3\n\
         corners_px = [[-0.5, -0.5], [255.5, -0.5], [255.5, 255.5], [-0.5, 255.5]]\n"
    );
    std::fs::write(&path, text).unwrap();
    load_target(&path).unwrap().plane.unwrap()
}

fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0), |(sum, count), value| {
        (sum + value * value, count + 1)
    });
    (sum / f64::from(count)).sqrt()
}

fn beam_rms(mount: &Mount, seen: &[Observation], parameters: &Parameters) -> f64 {
    rms(beam_errors_mrad(mount, seen, parameters))
}

#[test]
fn seven_frames_correct_a_heliostat() {
    let Some(data) = data::folder("seven_frames_correct_a_heliostat") else {
        return;
    };
    let juelich = data.join("juelich");
    let folder = tempfile::tempdir().unwrap();
    let field = juelich::write_field(&juelich, HELIOSTAT, folder.path());
    let loaded = load_field(&field).unwrap();

    // Frames into a table of spots, records into a log of axis steps.
    let mut spots = Vec::new();
    let mut log = String::from(
        "heliostat_id,record_id,file,sun_azimuth_deg,sun_elevation_deg,axis1_steps,axis2_steps,target\n",
    );
    let mut scratch = SpotScratch::default();
    let (records, rows) = pictured(&juelich);
    for &row in &rows {
        let id = records.text(row, "record_id");
        let target = records.text(row, "target");
        let area = loaded.targets[target].area.unwrap();
        let plane = plane_of_crop(folder.path(), [area.width_m, area.height_m]);
        let path = crop(&juelich, id);
        let frame = decode(&std::fs::read(&path).unwrap(), &Limits::default()).unwrap();
        let Frame::Gray8(picture) = &frame else {
            panic!("8 bit wanted");
        };
        let options = RobustOptions::default();
        let spot = find_spot(picture.view(), &plane, &options, &mut scratch).unwrap();
        let reference = |name| records.number(row, name);
        let helios = helio_core::Enu::new(
            reference("helios_e_m"),
            reference("helios_n_m"),
            reference("helios_u_m"),
        ) - area.plane.centre;
        let off_m = [
            spot.u_m - area.plane.right.as_enu().dot(helios),
            spot.v_m - area.plane.down.as_enu().dot(helios),
        ];
        eprintln!(
            "{id} {target:<26} {:?}: {:+.3} {:+.3} m, sigma {:.3} m, from HeliOS {:+.3} {:+.3} m",
            spot.status,
            spot.u_m,
            spot.v_m,
            spot.sigma_m(),
            off_m[0],
            off_m[1]
        );
        let file = path.to_string_lossy().into_owned();
        spots.push(SpotRow {
            at_px: Some([spot.x_px, spot.y_px]),
            at_m: Some([spot.u_m, spot.v_m]),
            sigma_m: Some(spot.sigma_m()),
            ..SpotRow::without_position(file, None, Some(spot.status))
        });
        writeln!(
            log,
            "{HELIOSTAT},{id},{id}-cropped.png,{},{},{},{},{target}",
            180.0 - records.number(row, "sun_azimuth_south_deg"),
            records.text(row, "sun_elevation_deg"),
            records.text(row, "axis1_steps"),
            records.text(row, "axis2_steps"),
        )
        .unwrap();
    }
    assert_eq!(spots.len(), 7);
    let path = |name: &str| folder.path().join(name);
    write_spots(Destination::File(path("spots.csv")), Format::Csv, &spots).unwrap();
    std::fs::write(path("log.csv"), log).unwrap();

    let spots = load_spots(&path("spots.csv")).unwrap();
    let seen = load_observations_with_spots(&path("log.csv"), Some(&spots), &loaded).unwrap();
    assert!(seen.left_aside.is_empty(), "{:?}", seen.left_aside);
    let seen = &seen.heliostats[0].observations;
    let mount = Mount::of(loaded.field.mode(), &loaded.field.heliostats()[0]);
    let fit = fit(&mount, seen, &FitOptions::default()).unwrap();
    assert!(fit.stop.converged(), "{:?}", fit.stop);

    // Truth of its own: the same records as the plant's software saw them.
    let plant = juelich::records(&data, HELIOSTAT);
    let plant: Vec<Observation> = rows
        .iter()
        .map(|&row| {
            let id = records.text(row, "record_id");
            let at = plant.ids.iter().position(|other| other == id).unwrap();
            plant.observations[at]
        })
        .collect();
    let none = Parameters::new(&helio_core::MountErrors::default(), mount.mirror_offset_m);
    let before = beam_rms(&mount, &plant, &none);
    let of_plant = six_angles(&mount, &plant);
    let (ours, theirs) = (
        beam_rms(&mount, seen, &fit.parameters),
        beam_rms(&mount, &plant, &of_plant),
    );
    // Each from the six others.
    let mut foretold = Vec::new();
    for k in 0..seen.len() {
        let mut others = seen.clone();
        others.remove(k);
        let parameters = six_angles(&mount, &others);
        foretold.extend(beam_errors_mrad(&mount, &plant[k..=k], &parameters));
    }
    let foretold = rms(foretold);
    eprintln!(
        "beams, mrad rms: as surveyed {before:.2}; six angles, spots of the frames {ours:.2}, of HeliOS {theirs:.2}; \
         HeliOS' spots foretold from six other frames {foretold:.2}"
    );
    // Seven frames are explained as well as the plant's own spots of them are, and foretell far better than the survey.
    assert!(ours < 1.1 * theirs, "{ours} {theirs}");
    assert!(foretold < 0.5 * before, "{before} {foretold}");
}

fn six_angles(mount: &Mount, seen: &[Observation]) -> Parameters {
    fit(mount, seen, &FitOptions::default()).unwrap().parameters
}
