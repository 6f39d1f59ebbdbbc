//! The recorded heliostats of Jülich as observations.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use helio_calib::{Mount, Observation};
use helio_core::{Enu, EnuUnit, MountAxes, PoseErrors, TargetPlane, TrackingMode};

use crate::data::Table;

/// The heliostats of the README's table.
pub const NAMES: [&str; 12] = [
    "AA31", "AA39", "AK46", "BE61", "BF17", "BF55", "BF57", "BG16", "BG23", "BG29", "BG62", "BH35",
];

/// Site latitude \[rad\].
pub const LATITUDE_RAD: f64 = 0.888_606_832;

/// One heliostat's records, in time.
#[derive(Debug, Clone)]
pub struct Records {
    /// Its name.
    pub name: String,
    /// Its mount: fixed axis toward the east, gamma = -t1, alpha = t2.
    pub mount: Mount,
    /// One entry per record; sigma 1 mrad seen from the pivot.
    pub observations: Vec<Observation>,
    /// Record numbers.
    pub ids: Vec<String>,
    /// Planes of the targets, in the order of their names.
    pub targets: Vec<(String, TargetPlane)>,
}

/// Targets by name, in alphabetical order.
///
/// # Panics
/// If the file is not there or not as described.
#[must_use]
pub fn targets(juelich: &Path) -> Vec<(String, TargetPlane)> {
    let path = juelich.join("target_planes.json");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let value: HashMap<String, serde_json::Value> =
        serde_json::from_str(&text).expect("target_planes.json");
    let vector = |plane: &serde_json::Value, key: &str| {
        let at = |k: usize| plane[key][k].as_f64().expect("three numbers");
        Enu::new(at(0), at(1), at(2))
    };
    let mut targets: Vec<_> = value
        .into_iter()
        .map(|(name, plane)| {
            let unit = |key| EnuUnit::try_new(vector(&plane, key)).expect("a direction");
            let plane = TargetPlane::with_right(
                vector(&plane, "centre_enu_m"),
                unit("normal_to_camera_enu"),
                unit("right_unit_enu"),
            )
            .expect("a plane");
            (name, plane)
        })
        .collect();
    targets.sort_by(|a, b| a.0.cmp(&b.0));
    targets
}

/// Writes field.toml and layout.csv of one heliostat as it was surveyed, without errors, with all targets and its two
/// drives. Returns where the field.toml is.
///
/// # Panics
/// If a file is not there or not as described, or cannot be written.
#[must_use]
pub fn write_field(juelich: &Path, heliostat: &str, folder: &Path) -> PathBuf {
    let mut text = String::from(
        "[site]\nlatitude_deg = 50.9134211\nlongitude_deg = 6.3878248\nelevation_m = 87\n",
    );
    let mut add = |line: std::fmt::Arguments<'_>| text.push_str(&format!("{line}\n"));
    let planes = std::fs::read_to_string(juelich.join("target_planes.json"));
    let planes: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(&planes.expect("target_planes.json")).expect("target_planes.json");
    for (name, plane) in planes {
        add(format_args!("[targets.{name}]"));
        for (ours, theirs) in [
            ("centre_enu_m", "centre_enu_m"),
            ("normal_enu", "normal_to_camera_enu"),
            ("right_enu", "right_unit_enu"),
            ("width_m", "width_m"),
            ("height_m", "height_m"),
        ] {
            add(format_args!("{ours} = {}", plane[theirs]));
        }
    }
    let tables = juelich.join("calibration");
    let of = |table: &Table, also: &dyn Fn(usize) -> bool| {
        (0..table.len())
            .find(|&row| table.text(row, "heliostat") == heliostat && also(row))
            .expect("a known heliostat")
    };
    let surveyed = Table::read(tables.join("heliostats.csv"));
    let row = of(&surveyed, &|_| true);
    let at = ["east_m", "north_m", "up_m"].map(|name| surveyed.text(row, name));
    let layout = format!("id,east_m,north_m,up_m\n{heliostat},{}\n", at.join(","));
    std::fs::write(folder.join("layout.csv"), layout).expect("layout.csv");
    add(format_args!(
        "[heliostats]\ntable = \"layout.csv\"\naim = \"multi_focus_tower\"\nmode = \"pitch-roll\"\n\
         axis_azimuth_deg = 90\nmirror_offset_m = {}",
        surveyed.text(row, "mirror_pivot_offset_m")
    ));
    let actuators = Table::read(tables.join("actuators.csv"));
    for (axis, sign) in [("1", -1), ("2", 1)] {
        let row = of(&actuators, &|row| actuators.text(row, "axis") == axis);
        add(format_args!(
            "[heliostats.drive.axis{axis}]\ntype = \"triangle\"\nsign = {sign}"
        ));
        for name in [
            "clockwise_axis_movement",
            "increment_steps_per_m",
            "offset_m",
            "pivot_radius_m",
            "initial_stroke_length_m",
            "initial_angle_rad",
        ] {
            add(format_args!("{name} = {}", actuators.text(row, name)));
        }
    }
    let path = folder.join("field.toml");
    std::fs::write(&path, text).expect("field.toml");
    path
}

/// Who found the spots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spots {
    /// The plant's software.
    Helios,
    /// A network that separates spot and background; not for every record.
    Utis,
}

/// The records of one heliostat, with the HeliOS spots; of AA39 and AA23 the last epoch alone.
///
/// # Panics
/// If a file is not there or not as described.
#[must_use]
pub fn records(data: &Path, name: &str) -> Records {
    records_with(data, name, Spots::Helios)
}

/// The records of one heliostat that have spots of one kind; none where its file has none of that kind.
///
/// # Panics
/// If a file is not there or not as described.
#[must_use]
pub fn records_with(data: &Path, name: &str, spots: Spots) -> Records {
    let [east, north, up] = match spots {
        Spots::Helios => ["helios_e_m", "helios_n_m", "helios_u_m"],
        Spots::Utis => ["utis_e_m", "utis_n_m", "utis_u_m"],
    };
    let juelich = data.join("juelich");
    let folder = juelich.join("calibration");
    let heliostats = Table::read(folder.join("heliostats.csv"));
    let row = (0..heliostats.len())
        .find(|&row| heliostats.text(row, "heliostat") == name)
        .expect("a known heliostat");
    let at = |column: &str| heliostats.number(row, column);
    let pivot = Enu::new(at("east_m"), at("north_m"), at("up_m"));
    let mode = TrackingMode::PitchRoll {
        axis_azimuth_rad: std::f64::consts::FRAC_PI_2,
    };
    let mount = Mount {
        axes: MountAxes::of(mode, EnuUnit::UP),
        pivot,
        mirror_offset_m: at("mirror_pivot_offset_m"),
        pose_errors: PoseErrors::NONE,
    };
    let targets = targets(&juelich);
    let table = Table::read(folder.join(format!("{name}.csv")));
    let last_epoch = table.has("epoch").then(|| {
        (0..table.len())
            .map(|row| table.text(row, "epoch").to_owned())
            .max()
            .expect("records")
    });
    let mut observations = Vec::new();
    let mut ids = Vec::new();
    for record in 0..table.len() {
        if let Some(last) = &last_epoch
            && table.text(record, "epoch") != last
        {
            continue;
        }
        if !table.has(east) || table.text(record, east).is_empty() {
            continue;
        }
        let at = |column: &str| table.number(record, column);
        let target = table.text(record, "target");
        let target = targets
            .iter()
            .position(|(name, _)| name == target)
            .expect("a known target");
        let plane = targets[target].1;
        let spot = Enu::new(at(east), at(north), at(up)) - plane.centre;
        let sun = EnuUnit::from_azimuth_elevation(
            (180.0 - at("sun_azimuth_south_deg")).to_radians(),
            at("sun_elevation_deg").to_radians(),
        );
        let time = table.text(record, "timestamp_utc");
        observations.push(Observation {
            target,
            sigma_m: Some(1e-3 * (plane.centre - pivot).norm()),
            unix_ns: (!time.is_empty()).then(|| helio_io::parse_time(time).expect("a time")),
            hour_angle_rad: Some(hour_angle_rad(sun)),
            ..Observation::new(
                sun,
                -at("axis1_angle_deg").to_radians(),
                at("axis2_angle_deg").to_radians(),
                plane,
                spot.dot(plane.right.as_enu()),
                spot.dot(plane.down.as_enu()),
            )
        });
        ids.push(table.text(record, "record_id").to_owned());
    }
    Records {
        name: name.to_owned(),
        mount,
        observations,
        ids,
        targets,
    }
}

/// Hour angle of a sun seen from Jülich \[rad\], west positive.
#[must_use]
pub fn hour_angle_rad(sun: EnuUnit) -> f64 {
    let s = sun.as_enu();
    let (sine, cosine) = LATITUDE_RAD.sin_cos();
    (-s.east).atan2(s.up * cosine - s.north * sine)
}
