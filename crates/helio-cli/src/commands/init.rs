//! `init`: a field to start from.

use std::path::Path;

use helio_io::output::{Destination, Format, write_table};
use helio_io::write_file;

use super::simulate::{EXAMPLE, layout};
use crate::Outcome;
use crate::args::InitArgs;
use crate::failure::Failure;
use crate::printer::Printer;

const FIELD: &str = "field.toml";
const TABLE: &str = "heliostats.csv";

pub(crate) fn run(args: &InitArgs, printer: &Printer) -> Result<Outcome, Failure> {
    let dir = &args.dir;
    let (field, table) = (dir.join(FIELD), dir.join(TABLE));
    if !args.force {
        for path in [&field, &table] {
            if path.symlink_metadata().is_ok() {
                return Err(Failure::refused(format!(
                    "{}: is there already; --force replaces it",
                    path.display()
                )));
            }
        }
    }
    std::fs::create_dir_all(dir).map_err(|e| {
        let reason = if e.kind() == std::io::ErrorKind::AlreadyExists {
            "there is a file of that name".to_owned()
        } else {
            e.to_string()
        };
        Failure::refused(format!(
            "{}: the folder cannot be made: {reason}",
            dir.display()
        ))
    })?;
    // The table first: a field.toml never names what is not there.
    let layout = layout(&EXAMPLE);
    write_table(
        Destination::File(table),
        Format::Csv,
        &layout.ids,
        &layout.columns(),
    )?;
    write_file(&field, field_toml().as_bytes())?;
    let shown = field.display();
    printer.say(format_args!(
        "{shown} and {TABLE}: {} heliostats",
        EXAMPLE.heliostats
    ));
    printer.say(format_args!(
        "next: helio-rs track --field {}",
        Quoted(&field)
    ));
    Ok(Outcome::Good)
}

/// A path as a shell takes it.
struct Quoted<'a>(&'a Path);

impl std::fmt::Display for Quoted<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = self.0.display().to_string();
        let plain = |c: char| c.is_alphanumeric() || "/._-+:\\".contains(c);
        if text.chars().all(plain) {
            f.write_str(&text)
        } else {
            write!(f, "'{}'", text.replace('\'', "'\\''"))
        }
    }
}

fn field_toml() -> String {
    format!(
        r#"# A heliostat field. Metres east, north and up of an origin of your choice; degrees, azimuths
# clockwise from north. `helio-rs schema` lists every key, `helio-rs check --field field.toml` says
# what it makes of this file.

[site]                          # for the position of the sun
name = "Example field"
latitude_deg = 37.4             # north positive
longitude_deg = -6.25           # east positive
elevation_m = 20.0              # gives the air pressure for refraction
# pressure_hpa = 1010.8         # yearly mean, if you know it better
# temperature_c = 12.0

[targets.receiver]
centre_enu_m = [0.0, 0.0, {height:.1}]
# A flat target also faces somewhere and has a size (a point is looked at along each beam):
# normal_enu = [0.0, 1.0, -0.3]
# width_m = 12.0
# height_m = 12.0

# White boards below the receiver, on which cameras see spots for `helio-rs calibrate`.
[targets.board-north]
centre_enu_m = [0.0, 8.0, 70.0]
normal_enu = [0.0, 1.0, 0.0]    # the way it faces
width_m = 14.0
height_m = 12.0

[targets.board-south]
centre_enu_m = [0.0, -8.0, 70.0]
normal_enu = [0.0, -1.0, 0.0]
width_m = 14.0
height_m = 12.0

[heliostats]
table = "{TABLE}"       # id, east_m, north_m, up_m: one row per heliostat
aim = "receiver"
mode = "azimuth-elevation"      # or spinning-elevation, pitch-roll, polar
mirror_offset_m = 0.3           # from the crossing of the axes to the mirror's centre

# Departures from the ideal mount, for all heliostats; columns of the table of the same name
# override them for each.
# pedestal_tilt_deg = 0.0
# pedestal_tilt_azimuth_deg = 0.0
# axis_nonorthogonality_deg = 0.0
# mirror_tilt_deg = 0.0
# azimuth_reference_deg = 0.0
# elevation_reference_deg = 0.0
# axis1_sag_deg = 0.0           # how far an axis gives way where the mirror pulls it round hardest
# axis2_sag_deg = 0.0
# axis2_eccentricity_deg = 0.0  # how far axis 2 turns beyond its encoder a quarter turn from its zero

# How far the axes turn, on encoder angles.
axis1_min_deg = -90.0
axis1_max_deg = 450.0
axis2_min_deg = -5.0
axis2_max_deg = 90.0

[heliostats.drive.axis1]
type = "encoder"
steps_per_deg = 1000.0
zero_steps = 100000

[heliostats.drive.axis2]
type = "encoder"
steps_per_deg = 1000.0
zero_steps = 10000
"#,
        height = EXAMPLE.tower_height_m
    )
}
