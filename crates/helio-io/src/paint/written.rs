//! The files of a plant that records were converted into.

use std::path::{Path, PathBuf};

use super::Paint;
use super::heliostats::{ACTUATOR, Properties};
use super::observations::Seen;
use crate::error::{IoError, Place, Problem};
use crate::hash::{Sha256, hash_file};
use crate::output::{Cells, Destination, Format, write_columns};
use crate::write_file;

/// Files that a conversion writes.
const FIELD: &str = "field.toml";
const HELIOSTATS: &str = "heliostats.csv";
const DRIVES: &str = "drives.csv";
const OBSERVATIONS: &str = "observations.csv";

impl Paint {
    /// Writes field.toml, heliostats.csv, drives.csv and observations.csv into a folder, which is made if it is not there;
    /// the paths of the first and of the last. What a conversion wrote into it before is replaced.
    ///
    /// # Errors
    /// [`IoError`] for what cannot be written, and for a folder with files of these names that no conversion wrote, or
    /// that were changed since.
    pub fn write(&self, folder: &Path) -> Result<(PathBuf, PathBuf), IoError> {
        std::fs::create_dir_all(folder).map_err(|error| IoError::write(folder, error))?;
        check(folder)?;
        // The tables first: a field.toml never names what is not there.
        self.write_heliostats(folder.join(HELIOSTATS))?;
        self.write_drives(folder.join(DRIVES))?;
        let observations = folder.join(OBSERVATIONS);
        self.write_observations(observations.clone())?;
        let (field, text) = (folder.join(FIELD), sums(folder)? + &self.toml());
        write_file(&field, format!("{}\n{text}", headed(&text)).as_bytes())?;
        Ok((field, observations))
    }

    fn write_heliostats(&self, path: PathBuf) -> Result<(), IoError> {
        let of = |number: fn(&Properties) -> f64| -> Vec<f64> {
            self.heliostats.iter().map(number).collect()
        };
        let columns = [
            ("id", Cells::Text(&self.names)),
            ("east_m", Cells::Numbers(&of(|h| h.pivot.east))),
            ("north_m", Cells::Numbers(&of(|h| h.pivot.north))),
            ("up_m", Cells::Numbers(&of(|h| h.pivot.up))),
            (
                "mirror_offset_m",
                Cells::Numbers(&of(|h| h.mirror_offset_m)),
            ),
        ];
        write_columns(Destination::File(path), Format::Csv, &columns).map(|_| ())
    }

    fn write_drives(&self, path: PathBuf) -> Result<(), IoError> {
        let each: Vec<(&String, usize, &[f64; ACTUATOR.len()])> = self
            .names
            .iter()
            .zip(&self.heliostats)
            .flat_map(|(name, heliostat)| {
                let both = heliostat.actuators.iter().enumerate();
                both.map(move |(axis, numbers)| (name, axis, numbers))
            })
            .collect();
        let ids: Vec<String> = each.iter().map(|(name, ..)| (*name).clone()).collect();
        let whole = |of: fn(usize) -> i64| -> Vec<Option<i64>> {
            each.iter().map(|(_, axis, _)| Some(of(*axis))).collect()
        };
        let kinds = vec!["triangle".to_owned(); each.len()];
        let (axes, signs) = (whole(|axis| axis as i64 + 1), whole(|axis| [-1, 1][axis]));
        let numbers: [Vec<f64>; ACTUATOR.len()] =
            std::array::from_fn(|k| each.iter().map(|(.., numbers)| numbers[k]).collect());
        let mut columns = vec![
            ("id", Cells::Text(&ids)),
            ("axis", Cells::Whole(&axes)),
            ("type", Cells::Text(&kinds)),
            ("sign", Cells::Whole(&signs)),
        ];
        let actuators = ACTUATOR.iter().zip(&numbers);
        columns.extend(actuators.map(|((_, name), cells)| (*name, Cells::Numbers(cells))));
        write_columns(Destination::File(path), Format::Csv, &columns).map(|_| ())
    }

    fn write_observations(&self, path: PathBuf) -> Result<(), IoError> {
        let text = |of: fn(&Seen) -> &String| -> Vec<String> {
            self.seen.iter().map(|seen| of(seen).clone()).collect()
        };
        let number = |of: fn(&Seen) -> f64| -> Vec<f64> { self.seen.iter().map(of).collect() };
        let columns = [
            ("heliostat_id", Cells::Text(&text(|s| &s.heliostat))),
            ("record_id", Cells::Text(&text(|s| &s.record))),
            (
                "sun_azimuth_deg",
                Cells::Numbers(&number(|s| s.sun_azimuth_deg)),
            ),
            (
                "sun_elevation_deg",
                Cells::Numbers(&number(|s| s.sun_elevation_deg)),
            ),
            ("axis1_steps", Cells::Numbers(&number(|s| s.steps[0]))),
            ("axis2_steps", Cells::Numbers(&number(|s| s.steps[1]))),
            ("target", Cells::Text(&text(|s| &s.target))),
            ("spot_east_m", Cells::Numbers(&number(|s| s.spot.east))),
            ("spot_north_m", Cells::Numbers(&number(|s| s.spot.north))),
            ("spot_up_m", Cells::Numbers(&number(|s| s.spot.up))),
        ];
        write_columns(Destination::File(path), Format::Csv, &columns).map(|_| ())
    }

    fn toml(&self) -> String {
        let [latitude_deg, longitude_deg, elevation_m] = self.geodetic;
        let name = |text: &str| toml_edit::Value::from(text).to_string().trim().to_owned();
        let point = |p: helio_core::Enu| format!("[{:?}, {:?}, {:?}]", p.east, p.north, p.up);
        let mut text = format!(
            "[site]\nlatitude_deg = {latitude_deg:?}\nlongitude_deg = {longitude_deg:?}\nelevation_m = {elevation_m:?}\n"
        );
        for (target, plane) in &self.targets {
            let section = toml_edit::Key::new(target);
            text.push_str(&format!(
                "\n[targets.{section}]\ncentre_enu_m = {}\nnormal_enu = {}\nright_enu = {}\nwidth_m = {:?}\nheight_m = {:?}\n",
                point(plane.centre),
                point(plane.normal),
                point(plane.right),
                plane.width_m,
                plane.height_m
            ));
        }
        text.push_str(&format!(
            "\n[heliostats]\ntable = {}\ndrives = {}\naim = {}\nmode = \"pitch-roll\"\naxis_azimuth_deg = 90\n",
            name(HELIOSTATS),
            name(DRIVES),
            name(&self.aim)
        ));
        text
    }
}

/// The first line of a field.toml that a conversion may write over, up to the sum of what stands below.
const OURS: &str = "# From PAINT records (https://paint-database.org). Replaced by the next conversion as long as this sum (SHA-256) of the lines below holds: ";

fn headed(text: &str) -> String {
    let mut sum = Sha256::default();
    sum.update(text.as_bytes());
    format!("{OURS}{}", sum.finish())
}

/// The tables that stand beside, with their sums, as comments.
fn sums(folder: &Path) -> Result<String, IoError> {
    let mut lines = String::new();
    for name in [HELIOSTATS, DRIVES, OBSERVATIONS] {
        lines += &format!("# {} {name}\n", hash_file(&folder.join(name))?);
    }
    Ok(lines)
}

/// Refuses a folder with files that would be lost and that no conversion wrote.
fn check(folder: &Path) -> Result<(), IoError> {
    let names = [FIELD, HELIOSTATS, DRIVES, OBSERVATIONS];
    let text = std::fs::read_to_string(folder.join(FIELD)).unwrap_or_default();
    let rest = text.split_once('\n');
    let rest = rest.filter(|(first, rest)| *first == headed(rest));
    let ours = |name: &str| {
        let sum = hash_file(&folder.join(name)).unwrap_or_default();
        rest.is_some_and(|(_, rest)| {
            name == FIELD || rest.lines().any(|line| line == format!("# {sum} {name}"))
        })
    };
    let lost = |name: &&str| folder.join(name).symlink_metadata().is_ok() && !ours(name);
    let Some(there) = names.into_iter().find(lost) else {
        return Ok(());
    };
    let message = format!(
        "{there} is there already, which no conversion wrote or which was changed since, and would be lost; wanted another folder"
    );
    Err(IoError::new(
        Place::file(folder),
        Problem::Conflict { message },
    ))
}
