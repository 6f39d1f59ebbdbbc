//! `target.toml`: a target in the pictures of a camera.

use std::path::Path;

use helio_spot::{Board, Corners, Lens, LensValues, Marks, Plane};

use crate::error::{IoError, Problem};
use crate::keys;
use crate::table::read_text;
use crate::toml::{Section, Source};

/// How well corners are known whose file does not say so \[px\].
const CORNERS_SIGMA_PX: f64 = 0.5;
/// How well the places of marks on a target are known whose file does not say so \[m\]. On the boards of the Jülich
/// tower that is how far the corners of marks lie from the published ones.
const MARKS_SIGMA_M: f64 = 0.01;
/// No corner is seen farther away \[px\].
const FAR_PX: f64 = 1e6;

/// A target in the pictures of a camera.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CameraTarget {
    /// What it is called.
    pub name: Option<String>,
    /// Its size and marks.
    pub board: Board,
    /// Where a fixed camera sees it, if that is known; otherwise its marks are to be looked for.
    pub plane: Option<Plane>,
    /// How well the places of its marks on the target are known: one standard deviation right as down \[m\].
    pub marks_sigma_m: f64,
    /// The camera's lens, where its distortion is known.
    pub lens: Option<Lens>,
    /// Width and height of the frames for which all this holds \[px\], where they are stated.
    pub frame_px: [Option<usize>; 2],
}

impl CameraTarget {
    /// Why a frame of this size \[px\] is none of this camera's; nothing where it may be one.
    #[must_use]
    pub fn refuses_size(&self, width_px: usize, height_px: usize) -> Option<String> {
        let sides = [width_px, height_px].into_iter().zip(self.frame_px);
        let mut stated = sides.filter_map(|(found, stated)| Some((found, stated?)));
        if stated.all(|(found, stated)| found == stated) {
            return None;
        }
        let word = |side: Option<usize>| side.map_or("any".to_owned(), |n| n.to_string());
        let [width, height] = self.frame_px.map(word);
        Some(format!(
            "a frame of {width_px} x {height_px} pixels: the target is described for {width} x {height}"
        ))
    }
}

/// Reads a `target.toml`.
///
/// # Errors
/// [`IoError`] with file, line and column for text that is no TOML, an unknown or missing key, a number out of range,
/// and corners through which no picture of a rectangle goes.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("target.toml");
/// std::fs::write(&path, r#"
///     width_m = 8.6
///     height_m = 7.2
///     corners_px = [[100, 100], [960, 100], [960, 820], [100, 820]]
/// "#)?;
/// let target = helio_io::load_target(&path)?;
/// assert_eq!(target.plane.unwrap().to_target([530.0, 460.0]), Some([0.0, 0.0]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load_target(path: &Path) -> Result<CameraTarget, IoError> {
    target_of_text(path, &read_text(path)?)
}

/// The same of the text that such a file would have; `path` is what messages call it.
///
/// # Errors
/// As [`load_target`].
pub fn target_of_text(path: &Path, text: &str) -> Result<CameraTarget, IoError> {
    let source = Source { path, text };
    let document = source.parse()?;
    let file = Section::new(
        source,
        String::new(),
        document.as_table(),
        None,
        keys::TARGET_FILE,
    )?;
    let size = |key| file.number(key)?.ok_or_else(|| file.missing(key));
    let board = Board {
        width_m: size(&keys::BOARD_WIDTH)?,
        height_m: size(&keys::BOARD_HEIGHT)?,
        marks: match file.text(&keys::MARKS)? {
            Some("two-panel-upper") => Marks::TwoPanelUpper,
            Some("two-panel-lower") => Marks::TwoPanelLower,
            _ => Marks::FourCorners,
        },
    };
    let lens = match file.section(&keys::CAMERA)? {
        Some(camera) => Some(lens(&camera)?),
        None => None,
    };
    let sigma_px = file.number(&keys::CORNERS_SIGMA)?;
    let marks_sigma_m = file.number(&keys::MARKS_SIGMA)?;
    let plane = match file.corners(&keys::CORNERS, FAR_PX)? {
        Some(_) if marks_sigma_m.is_some() => {
            let message = "marks are not looked for where corners_px is given".into();
            return Err(file.error(&keys::MARKS_SIGMA, Problem::Conflict { message }));
        }
        Some(at_px) => {
            let corners = Corners::given(at_px, sigma_px.unwrap_or(CORNERS_SIGMA_PX));
            let plane = Plane::new(board, corners, lens).map_err(|error| {
                let message = error.to_string();
                file.error(&keys::CORNERS, Problem::Conflict { message })
            })?;
            Some(plane)
        }
        None if sigma_px.is_some() => {
            let problem = Problem::Missing {
                what: file.dotted(&keys::CORNERS),
                wanted: "corners_sigma_px says how well it is known".into(),
            };
            return Err(file.error(&keys::CORNERS_SIGMA, problem));
        }
        None => None,
    };
    let side = |key: &'static keys::Key| {
        let side = file.whole(key, "a whole number of pixels")?;
        Ok::<_, IoError>(side.map(|side| side as usize))
    };
    let frame_px = [side(&keys::FRAME_WIDTH)?, side(&keys::FRAME_HEIGHT)?];
    Ok(CameraTarget {
        name: file.text(&keys::BOARD_NAME)?.map(str::to_string),
        board,
        plane,
        marks_sigma_m: marks_sigma_m.unwrap_or(MARKS_SIGMA_M),
        lens,
        frame_px,
    })
}

fn lens(camera: &Section<'_>) -> Result<Lens, IoError> {
    let needed = |key| camera.number(key)?.ok_or_else(|| camera.missing(key));
    let zero = |key| Ok::<f64, IoError>(camera.number(key)?.unwrap_or(0.0));
    let values = LensValues {
        fx_px: needed(&keys::FX)?,
        fy_px: needed(&keys::FY)?,
        cx_px: needed(&keys::CX)?,
        cy_px: needed(&keys::CY)?,
        k1: zero(&keys::K1)?,
        k2: zero(&keys::K2)?,
        p1: zero(&keys::P1)?,
        p2: zero(&keys::P2)?,
        k3: zero(&keys::K3)?,
    };
    Lens::new(values).map_err(|error| {
        let message = error.to_string();
        camera.error(&keys::FX, Problem::Conflict { message })
    })
}

/// The text of a `target.toml` whose camera, with frames of `frame_px` (width and height), sees the corners of a board
/// at given places.
///
/// Reading it back gives the same doubles.
#[must_use]
pub fn target_toml(
    board: &Board,
    corners_px: &[[f64; 2]; 4],
    frame_px: [usize; 2],
    lens: Option<&Lens>,
) -> String {
    let [width_px, height_px] = frame_px;
    let mut text = format!(
        "width_m = {:?}\nheight_m = {:?}\nmarks = \"{}\"\nframe_width_px = {width_px}\n\
         frame_height_px = {height_px}\n# upper left, upper right, lower right, lower left\n\
         corners_px = {:?}\ncorners_sigma_px = 0.1\n",
        board.width_m,
        board.height_m,
        board.marks.as_str(),
        corners_px
    );
    if let Some(lens) = lens {
        let LensValues {
            fx_px,
            fy_px,
            cx_px,
            cy_px,
            k1,
            k2,
            p1,
            p2,
            k3,
        } = lens.values();
        text.push_str(&format!(
            "\n[camera]\nfx_px = {fx_px:?}\nfy_px = {fy_px:?}\ncx_px = {cx_px:?}\ncy_px = {cy_px:?}\n\
             k1 = {k1:?}\nk2 = {k2:?}\np1 = {p1:?}\np2 = {p2:?}\nk3 = {k3:?}\n"
        ));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "width_m = 8.6\nheight_m = 7.2\n";

    fn refused(text: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.toml");
        std::fs::write(&path, text).unwrap();
        let error = load_target(&path).unwrap_err().to_string();
        error.replace(&folder.path().display().to_string(), "")
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.toml");
        let board = Board {
            width_m: 8.625,
            height_m: 7.211,
            marks: Marks::TwoPanelLower,
        };
        let corners = [
            [133.84, 444.41],
            [1303.88, 407.1],
            [1329.95, 1367.16],
            [161.62, 1402.31],
        ];
        let lens = Lens::new(LensValues {
            fx_px: 2710.0,
            fy_px: 2704.0,
            cx_px: 756.0,
            cy_px: 1344.0,
            k1: -0.18,
            ..LensValues::default()
        })
        .unwrap();
        std::fs::write(
            &path,
            target_toml(&board, &corners, [1512, 2688], Some(&lens)),
        )
        .unwrap();
        let read = load_target(&path).unwrap();
        assert_eq!(read.frame_px, [Some(1512), Some(2688)]);
        assert_eq!(read.refuses_size(1512, 2688), None);
        let said = read.refuses_size(2688, 1512).unwrap();
        assert!(
            said.contains("2688 x 1512") && said.contains("for 1512 x 2688"),
            "{said}"
        );
        assert_eq!(read.board, board);
        assert_eq!(read.lens, Some(lens));
        assert_eq!(read.plane.unwrap().corners().at_px, corners);
    }

    #[test]
    fn what_is_wrong_is_shown_with_its_line() {
        let unknown = refused(&format!("{GOOD}corner_px = []\n"));
        assert!(
            unknown.contains("t.toml:3:1") && unknown.contains("did you mean `corners_px`?"),
            "{unknown}"
        );
        assert!(refused("width_m = 8.6\n").contains("height_m is missing"));
        let range = refused("width_m = -8.6\nheight_m = 7.2\n");
        assert!(
            range.contains(":1:11") && range.contains("0.01..=10000 m"),
            "{range}"
        );
        let three = refused(&format!("{GOOD}corners_px = [[1, 2], [3, 4], [5, 6]]\n"));
        assert!(
            three.contains("four corners") && three.contains("3 of them"),
            "{three}"
        );
        let text = refused(&format!(
            "{GOOD}corners_px = [[1, 2], [3, 4], [5, 6], [\"a\", 0]]\n"
        ));
        assert!(
            text.contains("t.toml:3:40") && text.contains("text `a`"),
            "{text}"
        );
        let crossed = refused(&format!(
            "{GOOD}corners_px = [[0, 0], [9, 9], [9, 0], [0, 9]]\n"
        ));
        assert!(
            crossed.contains("t.toml:3:14") && crossed.contains("corners"),
            "{crossed}"
        );
        let word = refused(&format!("{GOOD}marks = \"two-panels-upper\"\n"));
        assert!(word.contains("did you mean `two-panel-upper`?"), "{word}");
        let half = refused(&format!("{GOOD}frame_width_px = 10.5\n"));
        assert!(half.contains("a whole number of pixels"), "{half}");
        let alone = refused(&format!("{GOOD}corners_sigma_px = 1\n"));
        assert!(alone.contains("corners_px is missing"), "{alone}");
        let both = refused(&format!(
            "{GOOD}corners_px = [[0, 0], [9, 0], [9, 9], [0, 9]]\nmarks_sigma_m = 0.1\n"
        ));
        assert!(both.contains("marks are not looked for"), "{both}");
        let camera = refused(&format!("{GOOD}[camera]\nfx_px = 1000\n"));
        assert!(camera.contains("camera.fy_px is missing"), "{camera}");
        assert!(refused("width_m 3\n").contains("not valid TOML"));
    }
}
