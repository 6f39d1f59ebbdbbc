//! A field to start from.

use std::path::{Path, PathBuf};

use helio_core::layout::Measures;

use crate::output::{Destination, Format, write_table};
use crate::{IoError, LayoutPattern, SimulatedLayout, write_file};

/// File of the example field.
const FIELD: &str = "field.toml";
/// Its heliostats.
const TABLE: &str = "heliostats.csv";

/// The layout of the example field.
const EXAMPLE: Measures = Measures {
    count: 500,
    tower_height_m: 120.0,
    mirror_width_m: 11.0,
    mirror_height_m: 10.0,
    up_m: 6.0,
};

/// Why no example is written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExampleError {
    /// A file that would be replaced.
    #[error("{}: is there already", path.display())]
    There {
        /// Which.
        path: PathBuf,
    },
    /// A folder that cannot be made.
    #[error("{}: the folder cannot be made: {reason}", folder.display())]
    NoFolder {
        /// Which.
        folder: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file that cannot be written.
    #[error(transparent)]
    Io(#[from] IoError),
}

/// The example field, as it was written.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct ExampleField {
    /// The field.toml.
    pub field: PathBuf,
    /// Name of the table of heliostats beside it.
    pub table: &'static str,
    /// Heliostats in it.
    pub heliostats: usize,
}

/// Writes the example field: `field.toml` and `heliostats.csv` in a folder, which is made if it does not exist. `force`
/// replaces files that are there.
///
/// # Errors
/// [`ExampleError`] with what is in the way; [`IoError`] in it if a file cannot be written.
///
/// ```
/// use helio_io::{ExampleError, load_field, write_example_field};
/// let folder = tempfile::tempdir()?;
/// let written = write_example_field(folder.path(), false)?;
/// assert_eq!(load_field(&written.field)?.field.len(), written.heliostats);
/// let again = write_example_field(folder.path(), false);
/// assert!(matches!(again, Err(ExampleError::There { path }) if path == written.field));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_example_field(folder: &Path, force: bool) -> Result<ExampleField, ExampleError> {
    let (field, table) = (folder.join(FIELD), folder.join(TABLE));
    if !force {
        for path in [&field, &table] {
            if path.symlink_metadata().is_ok() {
                return Err(ExampleError::There { path: path.clone() });
            }
        }
    }
    std::fs::create_dir_all(folder).map_err(|e| {
        let reason = if e.kind() == std::io::ErrorKind::AlreadyExists {
            "there is a file of that name".to_owned()
        } else {
            e.to_string()
        };
        let folder = folder.to_owned();
        ExampleError::NoFolder { folder, reason }
    })?;
    // The table first: a field.toml never names what is not there.
    let layout = SimulatedLayout::generate(LayoutPattern::RadialStaggered, &EXAMPLE);
    write_table(
        Destination::File(table),
        Format::Csv,
        &layout.ids,
        &layout.columns(),
    )?;
    write_file(&field, field_toml().as_bytes())?;
    Ok(ExampleField {
        field,
        table: TABLE,
        heliostats: EXAMPLE.count,
    })
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
