//! The method of T/GRLM 02-2014 on gray PNG frames, one thread.
//!
//! ```text
//! spots --frames FOLDER [--decode true] [--repeat R]
//! ```
//!
//! Prints a line of JSON for each frame of the folder as `peers/spot_opencv.py` does; with `--decode true` the
//! time begins with reading the file.
#![allow(clippy::print_stdout)]

use std::fs;
use std::path::Path;
use std::time::Instant;

use helio_bench::Options;
use helio_spot::{Frame, Limits, Scratch, StandardOptions, StandardSpot, decode, standard};

fn main() -> Result<(), String> {
    let options = Options::from_arguments(&["frames", "decode", "repeat"])?;
    let folder = options.path("frames")?;
    let from_file = options.text("decode") == Some("true");
    let repeat: usize = options.number("repeat", 100)?;
    let entries = fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut files: Vec<_> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|suffix| suffix == "png"))
        .collect();
    files.sort();
    for path in files {
        let frame = read(&path)?;
        let mut scratch = Scratch::default();
        let spot = find(&frame, &mut scratch)?;
        let mut times_ms = Vec::new();
        for _ in 0..repeat.max(1) {
            let start = Instant::now();
            let found = if from_file {
                find(&read(&path)?, &mut scratch)?
            } else {
                find(&frame, &mut scratch)?
            };
            times_ms.push(1e3 * start.elapsed().as_secs_f64());
            if found != spot {
                return Err(format!("{}: two answers", path.display()));
            }
        }
        times_ms.sort_by(f64::total_cmp);
        println!(
            "{{\"peer\": \"helio_rs\", \"frame\": {:?}, \"decode\": {from_file}, \"ms_per_frame\": {{\"minimum\": {:.6}, \
             \"median\": {:.6}}}, \"threshold\": {}, \"area_px\": {}, \"window_px\": {}, \"window_sum\": {}, \"row\": {}, \
             \"column\": {}}}",
            path.file_name().unwrap_or_default().to_string_lossy(),
            times_ms[0],
            times_ms[times_ms.len() / 2],
            spot.threshold,
            spot.area_px,
            spot.window_px,
            spot.window_sum,
            spot.row,
            spot.column,
        );
    }
    Ok(())
}

fn read(path: &Path) -> Result<Frame, String> {
    let bytes = fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    decode(&bytes, &Limits::default()).map_err(|error| format!("{}: {error}", path.display()))
}

fn find(frame: &Frame, scratch: &mut Scratch) -> Result<StandardSpot, String> {
    let options = StandardOptions::default();
    match frame {
        Frame::Gray8(picture) => standard(picture.view(), &options, scratch),
        Frame::Gray16(picture) => standard(picture.view(), &options, scratch),
    }
    .map_err(|error| error.to_string())
}
