//! A folder of simulated frames, which knows again what was written into it.

use std::collections::HashMap;
use std::path::Path;

use helio_spot::simulate::Truth;
use rayon::prelude::*;

use super::images::{ImagesError, SimulatedImages, name};
use crate::output::{Destination, Format};
use crate::{IoError, Sha256, hash_file, target_toml, write_file, write_frame};

const TARGET: &str = "target.toml";
const TRUTH: &str = "truth.csv";
const LOG: &str = "log.csv";

/// The first line of a target.toml that this program may write over.
const OURS: &str = "# Written by helio-rs simulate images, which replaces what it wrote as long as these sums (SHA-256) hold:";
/// What the last of the sums is of.
const REST: &str = "the lines below";

impl SimulatedImages {
    /// Writes 000001.png, …, truth.csv, target.toml and, of observations, log.csv into a folder, which is made if it does
    /// not exist; answers what is true of the frames. What an earlier call wrote there is replaced, and frames of it
    /// beyond those of this one are removed. `watch` is told of frames done and in all.
    ///
    /// # Errors
    /// [`ImagesError::Held`] before anything is written for a folder with a file that would be lost and that no such call
    /// wrote, or that was changed since; [`ImagesError::Stopped`] if `watch` wanted an end: frames are then there, but
    /// nothing that tells of them.
    ///
    /// ```
    /// use helio_io::{ImagePlan, ImagesError, SimulatedImages, load_target};
    /// let folder = tempfile::tempdir()?;
    /// let plan = ImagePlan { frames: 2, size_px: [160, 120], ..ImagePlan::default() };
    /// let images = SimulatedImages::new(plan)?;
    /// images.write(folder.path(), &|_, _| true)?;
    /// assert!(folder.path().join("000002.png").exists());
    /// assert_eq!(load_target(&folder.path().join("target.toml"))?.frame_px, [Some(160), Some(120)]);
    /// std::fs::write(folder.path().join("truth.csv"), "mine")?;
    /// let refused = images.write(folder.path(), &|_, _| true);
    /// assert!(matches!(refused, Err(ImagesError::Held { name, .. }) if name == "truth.csv"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn write(
        &self,
        folder: &Path,
        watch: &(dyn Fn(u64, u64) -> bool + Sync),
    ) -> Result<Vec<Truth>, ImagesError> {
        let earlier = check_folder(folder, self.len(), self.log.is_some())?;
        std::fs::create_dir_all(folder).map_err(|error| IoError::write(folder, error))?;
        let all = self.len() as u64;
        // Threads may have been busy until now: whoever has gone meanwhile loses nothing.
        if !watch(0, all) {
            return Err(ImagesError::Stopped);
        }
        for name in &earlier.more {
            let path = folder.join(name);
            std::fs::remove_file(&path).map_err(|error| IoError::write(&path, error))?;
        }
        let truths: Vec<Result<Truth, ImagesError>> = (1..=self.len())
            .into_par_iter()
            .map(|number| {
                if !watch(0, all) {
                    return Err(ImagesError::Stopped);
                }
                let simulated = self.frame(number)?;
                // A frame may take long: whoever has gone meanwhile wants no file of it.
                if !watch(0, all) {
                    return Err(ImagesError::Stopped);
                }
                write_frame(&folder.join(name(number)), &simulated.frame)?;
                watch(1, all);
                Ok(simulated.truth)
            })
            .collect();
        // The first of several failures is the one to report, whichever thread was first.
        let truths: Vec<Truth> = truths.into_iter().collect::<Result<_, _>>()?;
        let to = |name: &str| Destination::File(folder.join(name));
        self.write_truth(to(TRUTH), Format::Csv, &truths)?;
        if self.log.is_some() {
            self.write_log(to(LOG), Format::Csv)?;
        }
        let text = self.target_text()?;
        let text = sums(folder, self.log.is_some() || earlier.log, &text)? + &text;
        write_file(&folder.join(TARGET), text.as_bytes())?;
        Ok(truths)
    }

    /// The text of `target.toml`, but for what it says of the folder.
    fn target_text(&self) -> Result<String, ImagesError> {
        let text = target_toml(
            &self.scene.board,
            &self.corners_px()?,
            self.plan.size_px,
            self.lens(),
        );
        if !self.plan.find_marks {
            return Ok(text);
        }
        Ok(text
            .lines()
            .filter(|line| !line.starts_with("corners_px") && !line.starts_with('#'))
            .map(|line| match line.starts_with("corners_sigma_px") {
                true => "marks_sigma_m = 0.0",
                false => line,
            })
            .fold(String::new(), |text, line| text + line + "\n"))
    }
}

/// The lines that tell next time what was written: the sums of the tables, and of the text they stand before.
fn sums(folder: &Path, log: bool, text: &str) -> Result<String, IoError> {
    let mut lines = format!("{OURS}\n");
    for name in [Some(TRUTH), log.then_some(LOG)].into_iter().flatten() {
        let sum = hash_file(&folder.join(name))?;
        lines.push_str(&format!("# {sum} {name}\n"));
    }
    lines.push_str(&format!("# {} {REST}\n", sum_of(text)));
    Ok(lines)
}

fn sum_of(text: &str) -> String {
    let mut sum = Sha256::default();
    sum.update(text.as_bytes());
    sum.finish()
}

/// The sums that a target.toml of this program begins with, by what they are of; none if it is somebody else's or was
/// changed.
fn sums_of(text: &str) -> Option<HashMap<&str, &str>> {
    let mut rest = text.strip_prefix(OURS)?.strip_prefix('\n')?;
    let mut sums = HashMap::new();
    while !sums.contains_key(REST) {
        let (line, after) = rest.split_once('\n')?;
        let (sum, of) = line.strip_prefix("# ")?.split_once(' ')?;
        sums.insert(of, sum);
        rest = after;
    }
    (sums.get(REST).copied() == Some(sum_of(rest).as_str())).then_some(sums)
}

/// What an earlier run left that this one does not replace.
#[derive(Default)]
struct Earlier {
    /// Whether there is a log.csv.
    log: bool,
    /// Frames beyond those of this run, which would be taken for some of it.
    more: Vec<String>,
}

/// Refuses a folder with a file that would be lost and that this program did not write, or that was changed since.
fn check_folder(folder: &Path, frames: usize, log: bool) -> Result<Earlier, ImagesError> {
    let refuse = |name: &str| -> Result<Earlier, ImagesError> {
        Err(ImagesError::Held {
            folder: folder.to_owned(),
            name: name.to_owned(),
        })
    };
    let text = std::fs::read_to_string(folder.join(TARGET)).unwrap_or_default();
    let sums = sums_of(&text).unwrap_or_default();
    if folder.join(TARGET).exists() && sums.is_empty() {
        return refuse(TARGET);
    }
    let mut earlier = Earlier::default();
    for (name, replaced) in [(TRUTH, true), (LOG, log)] {
        let path = folder.join(name);
        if !path.exists() {
            continue;
        }
        let own = sums.get(name).copied() == Some(hash_file(&path)?.as_str());
        if replaced && !own {
            return refuse(name);
        }
        earlier.log |= own && name == LOG;
    }
    // frames that the truth names are ours
    let truth = std::fs::read_to_string(folder.join(TRUTH)).unwrap_or_default();
    let ours = truth.lines().skip(1).count();
    let exists = |name: &String| folder.join(name).exists();
    if let Some(name) = (ours + 1..=frames).map(name).find(exists) {
        return refuse(&name);
    }
    earlier.more = (frames + 1..=ours).map(name).filter(exists).collect();
    Ok(earlier)
}
