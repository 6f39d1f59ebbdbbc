//! Spots of the pictures of Jülich against the two references there are, `HeliOS` and `UTIS`, beside plain Otsu.
//!
//! ```text
//! HELIO_DATA=DIR juelich_spots [even|odd|all|table]
//! ```
//!
//! `table` writes the table of docs/spots.md, and nothing else.
//!
//! Choices were made on pictures whose number is even; odd ones are told apart. Distances are in centimetres on the
//! target. Plain Otsu is the gray-weighted centroid of all pixels above Otsu's threshold.
#![allow(clippy::print_stdout)]

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use helio_spot::{
    Board, Corners, Frame, Limits, Marks, Plane, RobustOptions, SpotScratch, SpotStatus, View,
    decode, find_spot,
};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// References that lie further apart \[m\] do not agree.
const AGREE_M: f64 = 0.20;
/// A spot further than this from both \[m\] is wrong.
const WRONG_M: f64 = 0.25;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Half {
    Even,
    Odd,
}

impl Half {
    /// By the picture's number; a picture without one is not for choices either.
    fn of(name: &str) -> Self {
        let digits: String = name.chars().take_while(char::is_ascii_digit).collect();
        match digits.parse::<u64>() {
            Ok(number) if number % 2 == 0 => Self::Even,
            _ => Self::Odd,
        }
    }
}

struct Gray {
    pixels: Vec<u8>,
    width: usize,
    height: usize,
}

impl Gray {
    fn read(path: &Path) -> Result<Self> {
        let frame = decode(&fs::read(path)?, &Limits::default())
            .map_err(|error| format!("{}: {error}", path.display()))?;
        let Frame::Gray8(picture) = frame else {
            return Err(format!("{}: expected 8 bits", path.display()).into());
        };
        let (width, height) = (picture.view().width(), picture.view().height());
        let pixels = picture.into_pixels();
        Ok(Self {
            pixels,
            width,
            height,
        })
    }

    /// Gray-weighted centroid \[px\] of what is above Otsu's threshold, of the pixels that `inside` takes.
    fn otsu(&self, inside: impl Fn([f64; 2]) -> bool) -> Option<[f64; 2]> {
        let pixels = || {
            let at = |k: usize| [(k % self.width) as f64, (k / self.width) as f64];
            let all = self.pixels.iter().enumerate();
            all.map(move |(k, &gray)| (at(k), gray))
                .filter(|(at, _)| inside(*at))
        };
        let mut histogram = [0.0_f64; 256];
        for (_, gray) in pixels() {
            histogram[gray as usize] += 1.0;
        }
        let total: f64 = histogram.iter().sum();
        let sum: f64 = (0..256).map(|k| k as f64 * histogram[k]).sum();
        let (mut below, mut below_sum) = (0.0, 0.0);
        let (mut best, mut threshold) = (0.0, None);
        for (gray, count) in histogram.iter().enumerate() {
            below += count;
            below_sum += gray as f64 * count;
            let between = (sum * below / total - below_sum).powi(2) / (below * (total - below));
            if between > best {
                (best, threshold) = (between, Some(gray as u8));
            }
        }
        let threshold = threshold?;
        let (mut weight, mut at) = (0.0, [0.0; 2]);
        for (place, gray) in pixels().filter(|(_, gray)| *gray > threshold) {
            weight += f64::from(gray);
            at[0] += f64::from(gray) * place[0];
            at[1] += f64::from(gray) * place[1];
        }
        Some(at.map(|sum| sum / weight))
    }
}

struct Row {
    name: String,
    half: Half,
    status: SpotStatus,
    flags: String,
    sigma_m: f64,
    /// To HeliOS and UTIS \[m\], where there are references.
    distances_m: Option<[f64; 2]>,
    otsu_m: Option<[f64; 2]>,
    agree: bool,
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn look(
    name: String,
    half: Half,
    picture: &Gray,
    plane: &Plane,
    references: Option<[[f64; 2]; 2]>,
    scratch: &mut SpotScratch,
) -> Result<Row> {
    let view = View::new(&picture.pixels, picture.width, picture.height)?;
    let spot = find_spot(view, plane, &RobustOptions::default(), scratch)?;
    let to = |at: [f64; 2]| references.map(|both| both.map(|reference| distance(at, reference)));
    let board = *plane.board();
    let otsu = picture
        .otsu(|pixel| {
            plane.to_target(pixel).is_some_and(|[u, v]| {
                u.abs() <= 0.5 * board.width_m && v.abs() <= 0.5 * board.height_m
            })
        })
        .and_then(|pixel| plane.to_target(pixel));
    Ok(Row {
        name,
        half,
        status: spot.status,
        flags: spot.flags.words().collect::<Vec<_>>().join("+"),
        sigma_m: spot.sigma_m(),
        distances_m: to([spot.u_m, spot.v_m]).filter(|_| spot.status.has_position()),
        otsu_m: otsu.and_then(to),
        agree: references.is_some_and(|[a, b]| distance(a, b) <= AGREE_M),
    })
}

/// A plane of a picture that is the target and nothing else.
fn whole(picture: &Gray, board: Board) -> Result<Plane> {
    let (right, below) = (picture.width as f64 - 0.5, picture.height as f64 - 0.5);
    let corners = [[-0.5, -0.5], [right, -0.5], [right, below], [-0.5, below]];
    Ok(Plane::new(board, Corners::given(corners, 0.0), None)?)
}

/// A table whose last column may hold commas between quotation marks.
fn table(path: &Path) -> Result<Vec<BTreeMap<String, String>>> {
    let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let mut lines = text.lines().filter(|line| !line.is_empty());
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    Ok(lines
        .map(|line| {
            let cells = line.splitn(header.len(), ',');
            let names = header.iter().map(|name| (*name).to_owned());
            names.zip(cells.map(str::to_owned)).collect()
        })
        .collect())
}

fn boards(folder: &Path) -> Result<BTreeMap<String, Board>> {
    let text = fs::read_to_string(folder.join("target_planes.json"))?;
    let planes: serde_json::Value = serde_json::from_str(&text)?;
    let planes = planes.as_object().ok_or("target_planes.json: no object")?;
    let mut boards = BTreeMap::new();
    for (name, plane) in planes {
        let size = |key: &str| {
            plane[key]
                .as_f64()
                .ok_or_else(|| format!("target_planes.json: {name} has no {key}"))
        };
        let board = Board {
            width_m: size("width_m")?,
            height_m: size("height_m")?,
            marks: match name.as_str() {
                "solar_tower_juelich_upper" => Marks::TwoPanelUpper,
                "solar_tower_juelich_lower" => Marks::TwoPanelLower,
                _ => Marks::FourCorners,
            },
        };
        boards.insert(name.clone(), board);
    }
    Ok(boards)
}

fn references(row: &BTreeMap<String, String>) -> Option<[[f64; 2]; 2]> {
    let number = |key: &str| row.get(key)?.parse::<f64>().ok();
    Some([
        [number("helios_right_m")?, number("helios_down_m")?],
        [number("utis_right_m")?, number("utis_down_m")?],
    ])
}

fn pictures(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder)? {
        paths.push(entry?.path());
    }
    paths.sort();
    Ok(paths)
}

fn corners(table: &[BTreeMap<String, String>], frame: &str, target: &str) -> Option<Corners> {
    let at = |corner: &str| {
        let row = table.iter().find(|row| {
            row.get("frame").is_some_and(|f| f == frame)
                && row.get("target").is_some_and(|t| t == target)
                && row.get("corner").is_some_and(|c| c == corner)
        })?;
        Some([
            row.get("x_px")?.parse().ok()?,
            row.get("y_px")?.parse().ok()?,
        ])
    };
    let four = [
        at("upper_left")?,
        at("upper_right")?,
        at("lower_right")?,
        at("lower_left")?,
    ];
    Some(Corners::given(four, 1.0))
}

fn centimetres(pair: Option<[f64; 2]>) -> String {
    pair.map_or_else(
        || "     -      -".to_owned(),
        |[a, b]| format!("{:6.1} {:6.1}", 100.0 * a, 100.0 * b),
    )
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

fn summary(what: &str, rows: &[Row], half: Half) {
    let rows: Vec<&Row> = rows.iter().filter(|row| row.half == half).collect();
    let with: Vec<&&Row> = rows.iter().filter(|row| row.agree).collect();
    let found = |pick: fn(&Row) -> Option<[f64; 2]>, value: fn([f64; 2]) -> f64| {
        median(with.iter().filter_map(|row| pick(row)).map(value))
    };
    let wrong = |pick: fn(&Row) -> Option<[f64; 2]>| {
        let pairs = with.iter().filter_map(|row| pick(row));
        pairs.filter(|[a, b]| a.min(*b) > WRONG_M).count()
    };
    let claims = rows.iter().filter(|row| row.status.has_position()).count();
    println!(
        "{what:14} {:4}: {:3} pictures, {claims:3} claims; {:3} with references that agree",
        if half == Half::Even { "even" } else { "odd" },
        rows.len(),
        with.len()
    );
    for (method, pick) in [
        ("robust", (|row: &Row| row.distances_m) as fn(&Row) -> _),
        ("otsu", |row: &Row| row.otsu_m),
    ] {
        if !with.is_empty() {
            println!(
                "    {method:8} median cm to HeliOS {:5.1}, UTIS {:5.1}, nearer {:5.1}; further than 25 cm from both: {}",
                100.0 * found(pick, |d| d[0]),
                100.0 * found(pick, |d| d[1]),
                100.0 * found(pick, |d| d[0].min(d[1])),
                wrong(pick)
            );
        }
    }
    if !with.is_empty() {
        let ratios = with.iter().filter_map(|row| {
            let [a, b] = row.distances_m?;
            Some(a.min(b) / row.sigma_m)
        });
        println!(
            "    sigma median cm {:5.2}; nearer distance over sigma, median {:5.2}",
            100.0 * median(with.iter().map(|row| row.sigma_m)),
            median(ratios)
        );
    }
}

/// A line for each method of pictures of a kind and half: claims, distances, how many are far from both references.
fn lines(kind: &str, rows: &[Row], half: Half) {
    let rows: Vec<&Row> = rows.iter().filter(|row| row.half == half).collect();
    if rows.is_empty() {
        return;
    }
    let word = if half == Half::Even { "even" } else { "odd" };
    let claims = rows.iter().filter(|row| row.status.has_position()).count();
    for (method, pick) in [
        ("`robust`", (|row: &Row| row.distances_m) as fn(&Row) -> _),
        ("plain Otsu", |row: &Row| row.otsu_m),
    ] {
        let claims = if method == "plain Otsu" {
            rows.len()
        } else {
            claims
        };
        let pairs: Vec<[f64; 2]> = rows
            .iter()
            .filter(|row| row.agree)
            .filter_map(|row| pick(row))
            .collect();
        print!(
            "| {kind}, {word} | {method} | {claims} of {} | ",
            rows.len()
        );
        if pairs.is_empty() {
            println!("| | | | |");
            continue;
        }
        let of = |value: fn(&[f64; 2]) -> f64| pairs.iter().map(value);
        let nearer: fn(&[f64; 2]) -> f64 = |[a, b]| a.min(*b);
        println!(
            "{} | {:.1} | {:.1} | {:.1} | {:.1} |",
            pairs.len(),
            100.0 * median(of(|d| d[0])),
            100.0 * median(of(|d| d[1])),
            100.0 * median(of(nearer)),
            100.0 * of(nearer).fold(0.0, f64::max),
        );
    }
}

fn main() -> Result<()> {
    let root = std::env::var_os("HELIO_DATA").ok_or("HELIO_DATA is not set")?;
    let folder = Path::new(&root).join("juelich");
    let wanted = std::env::args().nth(1).unwrap_or_else(|| "all".to_owned());
    let take = |half: Half| match wanted.as_str() {
        "even" => half == Half::Even,
        "odd" => half == Half::Odd,
        _ => true,
    };
    let boards = boards(&folder)?;
    let board = |target: &str| boards.get(target).copied().ok_or("unknown target");
    let spots = table(&folder.join("spots.csv"))?;
    let corner_table = table(&folder.join("frames/corner_pixels.csv"))?;
    let mut scratch = SpotScratch::default();

    let (mut crops, mut frames) = (Vec::new(), Vec::new());
    for row in &spots {
        let cell = |key: &str| row.get(key).map_or("", String::as_str);
        let half = Half::of(cell("image_id"));
        if !take(half) {
            continue;
        }
        let board = board(cell("target"))?;
        if !cell("crop").is_empty() {
            let picture = Gray::read(&folder.join(cell("crop")))?;
            let plane = whole(&picture, board)?;
            let name = cell("crop").trim_start_matches("crops/").to_owned();
            crops.push(look(
                name,
                half,
                &picture,
                &plane,
                references(row),
                &mut scratch,
            )?);
        }
        if !cell("frame").is_empty() {
            let picture = Gray::read(&folder.join(cell("frame")))?;
            let Some(corners) = corners(&corner_table, cell("frame"), cell("target")) else {
                println!("{}: no corners of {}", cell("frame"), cell("target"));
                continue;
            };
            let plane = Plane::new(board, corners, None)?;
            let name = cell("frame").trim_start_matches("frames/").to_owned();
            frames.push(look(
                name,
                half,
                &picture,
                &plane,
                references(row),
                &mut scratch,
            )?);
        }
    }
    let mut others = Vec::new();
    for kind in ["empty_targets", "unlabelled_spots"] {
        let mut rows = Vec::new();
        for path in pictures(&folder.join(kind))? {
            let name = path
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let half = Half::of(&name);
            if !take(half) {
                continue;
            }
            let picture = Gray::read(&path)?;
            let plane = whole(&picture, board("solar_tower_juelich_lower")?)?;
            rows.push(look(name, half, &picture, &plane, None, &mut scratch)?);
        }
        others.push((kind, rows));
    }

    if wanted == "table" {
        println!(
            "| pictures | method | positions | with both references | to HeliOS, cm | to UTIS, cm | to the nearer, cm | farthest |"
        );
        println!("|---|---|---|---|---|---|---|---|");
        for half in [Half::Even, Half::Odd] {
            lines("crops", &crops, half);
            lines("frames", &frames, half);
            for (kind, rows) in &others {
                lines(&kind.replace('_', " "), rows, half);
            }
        }
        return Ok(());
    }
    println!("distances in cm                                     robust          otsu");
    println!(
        "picture                      half  status     HeliOS   UTIS  HeliOS   UTIS  sigma  flags"
    );
    let of_others = others.iter().map(|(kind, rows)| (*kind, rows));
    let all = [("crops", &crops), ("frames", &frames)];
    for (kind, rows) in all.into_iter().chain(of_others) {
        println!("{kind}");
        for row in rows {
            println!(
                "  {:26} {:4}  {:9} {} {}  {:5.1}  {}{}",
                row.name,
                if row.half == Half::Even {
                    "even"
                } else {
                    "odd"
                },
                row.status.as_str(),
                centimetres(row.distances_m),
                centimetres(row.otsu_m),
                100.0 * row.sigma_m,
                row.flags,
                if row.distances_m.is_some() && !row.agree {
                    "  (references disagree)"
                } else {
                    ""
                },
            );
        }
    }
    for half in [Half::Even, Half::Odd] {
        if take(half) {
            summary("crops", &crops, half);
            summary("frames", &frames, half);
            for (kind, rows) in &others {
                summary(kind, rows, half);
            }
        }
    }
    Ok(())
}
