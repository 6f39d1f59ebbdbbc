//! Times the tracking kernel on the peers' input: `kernel FILE [THREADS [REPEATS [ANSWERS]]]`.
#![allow(clippy::print_stdout)]

use std::io::Write;
use std::path::Path;

use helio_bench::{nanoseconds, read_peer_input};
use helio_core::{OffsetForm, SimdLevel, TrackOptions, Tracker, Tracking};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: usize| {
        arguments
            .get(index)
            .map_or(Ok(default), |text| text.parse::<usize>())
    };
    let path = arguments.first().ok_or("give the input file")?;
    let input = read_peer_input(Path::new(path))?;
    let (threads, repeats) = (number(1, 1)?, number(2, 11)?);
    let tracker = Tracker::new(&input.field, OffsetForm::Exact)?;
    for &level in SimdLevel::available().iter().rev() {
        let options = TrackOptions {
            threads,
            level: Some(level),
        };
        let mut out = Tracking::default();
        let suns = [input.sun];
        tracker.track_into(&suns, None, &options, &mut out)?;
        let (least, median) = nanoseconds(repeats, || {
            let _ = std::hint::black_box(tracker.track_into(&suns, None, &options, &mut out));
        });
        let n = tracker.len() as f64;
        println!(
            "{{\"peer\": \"helio-core {level}\", \"n\": {n}, \"threads\": {threads}, \
             \"ns_per_heliostat_min\": {:.4}, \"ns_per_heliostat_median\": {:.4}}}",
            least / n,
            median / n
        );
        if let (Some(answers), true) = (arguments.get(3), level == SimdLevel::best()) {
            let mut file = std::io::BufWriter::new(std::fs::File::create(answers)?);
            for column in [out.axis1_rad(), out.axis2_rad(), out.incidence_rad()] {
                for value in column {
                    file.write_all(&value.to_le_bytes())?;
                }
            }
            for status in out.status() {
                file.write_all(&[status.code()])?;
            }
        }
    }
    Ok(())
}
