//! The whole way from a frame in memory to a spot in metres: marks, homography, `robust`; and its parts.
//!
//! `robust_speed [SECONDS]` measures for so long at each number of threads, 1 unless told, and prints Markdown. Frames are
//! simulated, eight of each size; where `HELIO_DATA` names the folder of shared data, its camera frames too.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use helio_spot::simulate::{Beam, BeamShape, Scene};
use helio_spot::{
    Board, Corners, FindOptions, Frame, Limits, MarkScratch, Marks, Plane, RobustOptions, Scratch,
    SpotScratch, StandardOptions, View, decode, find_corners, find_spot, standard,
};

type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;

struct Case {
    name: String,
    board: Board,
    frames: Vec<Frame>,
}

fn board(width_m: f64, height_m: f64, marks: Marks) -> Board {
    Board {
        width_m,
        height_m,
        marks,
    }
}

fn simulated(width_px: usize, height_px: usize) -> Result<Case> {
    let board = board(8.0, 7.0, Marks::FourCorners);
    let mut scene = Scene::plain(board, width_px, height_px)?;
    let frames = (0..8).map(|seed| {
        scene.beam = Some(Beam {
            shape: BeamShape::Gaussian { sigma_m: 0.6 },
            u_m: 0.2 * seed as f64 - 0.7,
            v_m: 0.6 - 0.15 * seed as f64,
            peak: 0.35,
        });
        Ok(scene.render(seed)?.frame)
    });
    Ok(Case {
        name: format!("simulated, {width_px} × {height_px}"),
        board,
        frames: frames.collect::<Result<_>>()?,
    })
}

fn recorded(folder: &Path) -> Result<Vec<Case>> {
    let read = |name: &str| -> Result<Frame> {
        let bytes = fs::read(folder.join("juelich/frames").join(name))?;
        Ok(decode(&bytes, &Limits::default())?)
    };
    let read_all = |names: &[&str]| names.iter().map(|name| read(name)).collect::<Result<_>>();
    Ok(vec![
        Case {
            name: "recorded, 2688 × 1512, one board".into(),
            board: board(5.412, 6.388, Marks::FourCorners),
            frames: read_all(&["102067-gray.png", "194228-gray.png"])?,
        },
        Case {
            name: "recorded, 1512 × 2688, upper of two panels".into(),
            board: board(8.625, 7.211, Marks::TwoPanelUpper),
            frames: read_all(&["137608-raw.png", "152144-raw.png", "99927-gray.png"])?,
        },
    ])
}

#[derive(Default)]
struct Room {
    marks: MarkScratch,
    robust: SpotScratch,
    standard: Scratch,
}

/// What is timed.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    Whole,
    /// The corners are those found before.
    Spot,
    /// The standard's method on the whole frame.
    Standard,
}

fn work(frame: &Frame, board: &Board, given: Corners, way: Way, room: &mut Room) -> Result<()> {
    let Frame::Gray8(picture) = frame else {
        return Err("expected frames of 8 bits".into());
    };
    let view: View<'_, u8> = picture.view();
    if way == Way::Standard {
        standard(view, &StandardOptions::default(), &mut room.standard)?;
        return Ok(());
    }
    let corners = match way {
        Way::Whole => find_corners(view, board, &FindOptions::default(), &mut room.marks)?,
        _ => given,
    };
    let plane = Plane::new(*board, corners, None)?;
    let spot = find_spot(view, &plane, &RobustOptions::default(), &mut room.robust)?;
    if !spot.status.has_position() {
        return Err(format!("a spot is {}", spot.status.as_str()).into());
    }
    Ok(())
}

/// Frames per second of so many threads.
fn rate(case: &Case, given: &[Corners], way: Way, threads: usize, lasts: Duration) -> Result<f64> {
    let (next, start) = (AtomicUsize::new(0), Instant::now());
    let run = || -> Result<Duration> {
        let mut room = Room::default();
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed) % case.frames.len();
            work(&case.frames[k], &case.board, given[k], way, &mut room)?;
            let since = start.elapsed();
            if since >= lasts {
                return Ok(since);
            }
        }
    };
    let last = std::thread::scope(|scope| {
        let runs: Vec<_> = (0..threads).map(|_| scope.spawn(run)).collect();
        let ends = runs
            .into_iter()
            .map(|run| run.join().map_err(|_| "a thread panicked")?);
        ends.collect::<Result<Vec<Duration>>>()
    })?;
    let last = last.into_iter().max().unwrap_or_default();
    Ok(next.into_inner() as f64 / last.as_secs_f64())
}

fn main() -> Result<()> {
    let seconds: f64 = match std::env::args().nth(1) {
        Some(text) => text.parse()?,
        None => 1.0,
    };
    let lasts = Duration::from_secs_f64(seconds);
    let mut cases = vec![simulated(768, 576)?, simulated(2688, 1512)?];
    if let Some(folder) = std::env::var_os("HELIO_DATA") {
        cases.extend(recorded(Path::new(&folder))?);
    }
    println!(
        "| frames | frames/s, one thread | two | ms: corners | homography and `robust` | `standard` on the whole frame |"
    );
    println!("|---|---|---|---|---|---|");
    for case in &cases {
        let mut given = Vec::new();
        for frame in &case.frames {
            let Frame::Gray8(picture) = frame else {
                return Err("expected frames of 8 bits".into());
            };
            let (options, mut room) = (FindOptions::default(), MarkScratch::default());
            given.push(find_corners(
                picture.view(),
                &case.board,
                &options,
                &mut room,
            )?);
        }
        let best = |way, threads| -> Result<f64> {
            let mut best = 0.0_f64;
            for _ in 0..3 {
                best = best.max(rate(case, &given, way, threads, lasts / 3)?);
            }
            Ok(best)
        };
        let (one, two) = (best(Way::Whole, 1)?, best(Way::Whole, 2)?);
        let spot_ms = 1e3 / best(Way::Spot, 1)?;
        let standard_ms = 1e3 / best(Way::Standard, 1)?;
        println!(
            "| {} | {one:.0} | {two:.0} | {:.2} | {spot_ms:.2} | {standard_ms:.2} |",
            case.name,
            1e3 / one - spot_ms
        );
    }
    Ok(())
}
