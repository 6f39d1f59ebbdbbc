//! What a run remembers for its figures.

use std::io::Write;
use std::path::{Path, PathBuf};

use helio_core::angle::degrees;
use helio_core::{Field, Status, TrackingMode};
use helio_io::{AtomicFile, IoError, LoadedField, format_time};
use helio_report::{
    AngleCurves, Curve, CurveAxis, FieldMap, Figure, MapColour, Page, angle_curves, field_map,
    stack,
};

use crate::args::{NO_SHADING, PlotColour};
use crate::commands::track::Answers;
use crate::failure::Failure;
use crate::plan::{SunBlock, Suns, not_an_input};
use crate::printer::{Grouped, Tally};

/// Suns kept for curves: many more than a screen has columns.
const MOST_SUNS: usize = 20_000;
/// Heliostats whose curves are drawn if none are named.
const CURVES: usize = 4;
/// Curves that can still be told apart.
const MOST_CURVES: usize = 21;

/// The figures of a run, remembered while it goes on.
pub(crate) struct Plot {
    file: AtomicFile,
    html: bool,
    colour: PlotColour,
    /// Rows of the heliostats with curves.
    rows: Vec<usize>,
    curves: Vec<[Vec<f64>; 3]>,
    at: Vec<i64>,
    /// One of so many suns is kept.
    stride: usize,
    suns: usize,
    map: Option<Map>,
}

/// The field at the highest sun so far.
struct Map {
    elevation_deg: f64,
    sun: String,
    values_deg: Vec<f64>,
    status: Vec<Status>,
}

impl Plot {
    /// Checks what was asked for and opens the file, before anything is computed.
    pub(crate) fn new(
        path: &Path,
        colour: PlotColour,
        ids: Option<&[String]>,
        field: &Field,
        suns: usize,
        inputs: &[PathBuf],
    ) -> Result<Self, Failure> {
        let suffix = path.extension().and_then(|suffix| suffix.to_str());
        let html = match suffix.map(str::to_ascii_lowercase).as_deref() {
            Some("svg") => false,
            Some("html" | "htm") => true,
            _ => {
                let path = path.display();
                return Err(Failure::refused(format!(
                    "--plot {path}: wanted a .svg or .html file"
                )));
            }
        };
        let n = field.len();
        let mut rows = match ids {
            Some(ids) => ids
                .iter()
                .map(|id| {
                    field.row_of(id).ok_or_else(|| {
                        let (n, first) = (field.len(), field.ids().first());
                        let first = first.map_or("", String::as_str);
                        Failure::refused(format!(
                            "--plot-heliostats: unknown heliostat `{id}`; the field has {n}, the \
                             first is `{first}`"
                        ))
                    })
                })
                .collect::<Result<Vec<_>, _>>()?,
            None => (0..CURVES)
                .map(|i| i * n.saturating_sub(1) / (CURVES - 1))
                .collect(),
        };
        if rows.len() > MOST_CURVES {
            return Err(Failure::refused(format!(
                "--plot-heliostats: {} heliostats, at most {MOST_CURVES} can be told apart",
                rows.len()
            )));
        }
        let mut seen = Vec::new();
        rows.retain(|row| {
            let new = !seen.contains(row);
            seen.push(*row);
            new
        });
        not_an_input(path, inputs)?;
        Ok(Self {
            file: AtomicFile::create(path)?,
            html,
            colour,
            curves: vec![Default::default(); rows.len()],
            rows,
            at: Vec::new(),
            stride: suns.div_ceil(MOST_SUNS).max(1),
            suns: 0,
            map: None,
        })
    }

    /// Takes what it needs of a block.
    pub(crate) fn take(&mut self, block: &SunBlock, answers: &Answers<'_>) {
        let n = answers.status.len() / block.suns.len().max(1);
        let highest = (0..block.suns.len())
            .max_by(|&a, &b| block.elevation_deg[a].total_cmp(&block.elevation_deg[b]));
        if let Some(sun) = highest
            && self
                .map
                .as_ref()
                .is_none_or(|map| map.elevation_deg < block.elevation_deg[sun])
        {
            let rows = sun * n..(sun + 1) * n;
            let values = match self.colour {
                PlotColour::Azimuth => answers.axis1_rad,
                PlotColour::Elevation => answers.axis2_rad,
                PlotColour::Incidence | PlotColour::Status => answers.incidence_rad,
            };
            self.map = Some(Map {
                elevation_deg: block.elevation_deg[sun],
                sun: block.describe(sun),
                values_deg: values[rows.clone()].iter().map(|&v| degrees(v)).collect(),
                status: answers.status[rows].to_vec(),
            });
        }
        for sun in 0..block.suns.len() {
            if (self.suns + sun).is_multiple_of(self.stride) {
                let at = block.unix_ns.get(sun).copied();
                self.at.push(at.unwrap_or((self.suns + sun) as i64));
                for (curve, row) in self.curves.iter_mut().zip(&self.rows) {
                    let row = sun * n + row;
                    let ok = answers.status[row] == Status::Ok;
                    let of = |column: &[f64]| if ok { degrees(column[row]) } else { f64::NAN };
                    curve[0].push(of(answers.axis1_rad));
                    curve[1].push(of(answers.axis2_rad));
                    curve[2].push(of(answers.incidence_rad));
                }
            }
        }
        self.suns += block.suns.len();
    }

    /// Draws everything into the temporary file; what it returns only has to be put in place.
    pub(crate) fn draw(
        mut self,
        loaded: &LoadedField,
        suns: &Suns,
        tally: &Tally,
    ) -> Result<AtomicFile, Failure> {
        let figures = self.figures(loaded, suns)?;
        let text = if self.html {
            let facts = self.facts(loaded);
            let title = name(loaded);
            let page = Page {
                title: &title,
                facts: &facts,
                statuses: &tally.rows(),
                figures: &figures,
            };
            page.to_html()
        } else {
            stack(&figures).to_svg()
        };
        let path = self.file.path().to_owned();
        self.file
            .write_all(text.as_bytes())
            .and_then(|()| self.file.flush())
            .map_err(|e| IoError::write(&path, e))?;
        Ok(self.file)
    }

    fn figures(&self, loaded: &LoadedField, suns: &Suns) -> Result<Vec<Figure>, Failure> {
        let field = &loaded.field;
        let axis_names = axis_names(field.mode());
        let mut figures = Vec::new();
        if let Some(map) = &self.map {
            let heliostats = field.heliostats();
            let east_m: Vec<f64> = heliostats.iter().map(|h| h.pivot.east).collect();
            let north_m: Vec<f64> = heliostats.iter().map(|h| h.pivot.north).collect();
            let name = match self.colour {
                PlotColour::Azimuth => axis_names[0],
                PlotColour::Elevation => axis_names[1],
                PlotColour::Incidence | PlotColour::Status => "incidence",
            };
            let colour = match self.colour {
                PlotColour::Status => MapColour::Status,
                _ => MapColour::Angle {
                    values_deg: &map.values_deg,
                    name,
                    cyclic: self.colour == PlotColour::Azimuth,
                },
            };
            figures.push(field_map(&FieldMap {
                title: &format!("Sun at {}", map.sun),
                east_m: &east_m,
                north_m: &north_m,
                status: &map.status,
                colour,
                tower_m: tower(loaded),
            })?);
        }
        if self.at.len() > 1 {
            let clock;
            let axis = match suns {
                Suns::Times { offset_s, .. } => {
                    clock = clock_name(*offset_s, &self.at);
                    CurveAxis::Time {
                        offset_s: *offset_s,
                        name: &clock,
                    }
                }
                Suns::Angles { .. } => CurveAxis::Row,
            };
            let curves: Vec<Curve<'_>> = self
                .rows
                .iter()
                .zip(&self.curves)
                .map(|(&row, [axis1_deg, axis2_deg, incidence_deg])| Curve {
                    id: &field.ids()[row],
                    axis1_deg,
                    axis2_deg,
                    incidence_deg,
                })
                .collect();
            figures.push(angle_curves(&AngleCurves {
                title: "Angles of some heliostats",
                axis,
                at: &self.at,
                curves: &curves,
                axis1_turns: true,
                axis_names,
            })?);
        }
        Ok(figures)
    }

    fn facts(&self, loaded: &LoadedField) -> Vec<(&'static str, String)> {
        let file = loaded.files.first().map(|path| path.display().to_string());
        let mut facts = vec![
            ("field", file.unwrap_or_default()),
            ("heliostats", Grouped(loaded.field.len() as u64).to_string()),
            ("tracking mode", loaded.field.mode().as_str().to_owned()),
            ("suns", Grouped(self.suns as u64).to_string()),
        ];
        if let Some(map) = &self.map {
            facts.push(("highest sun", map.sun.clone()));
        }
        facts.push(("not included", NO_SHADING.to_owned()));
        facts
    }
}

fn axis_names(mode: TrackingMode) -> [&'static str; 2] {
    match mode {
        TrackingMode::AzimuthElevation => ["azimuth", "elevation"],
        _ => ["axis 1", "axis 2"],
    }
}

/// What the field is called.
fn name(loaded: &LoadedField) -> String {
    let site = loaded.site.as_ref().and_then(|site| site.name.clone());
    site.unwrap_or_else(|| "Heliostat field".to_owned())
}

/// The middle of what is aimed at.
fn tower(loaded: &LoadedField) -> Option<(f64, f64)> {
    let centres: Vec<_> = loaded
        .targets
        .values()
        .map(|target| target.centre)
        .collect();
    let n = centres.len() as f64;
    (n > 0.0).then(|| {
        let east_m: f64 = centres.iter().map(|c| c.east).sum();
        let north_m: f64 = centres.iter().map(|c| c.north).sum();
        (east_m / n, north_m / n)
    })
}

fn clock_name(offset_s: i32, at: &[i64]) -> String {
    let sign = if offset_s < 0 { '\u{2212}' } else { '+' };
    let minutes = offset_s.unsigned_abs() / 60;
    let offset = match (minutes / 60, minutes % 60) {
        (0, 0) => "UTC".to_owned(),
        (h, m) => format!("UTC{sign}{h:02}:{m:02}"),
    };
    let shifted = |unix_ns: &i64| {
        let local = format_time(unix_ns.saturating_add(i64::from(offset_s) * 1_000_000_000));
        local.split('T').next().unwrap_or_default().to_owned()
    };
    let (first, last) = (at.first().map(shifted), at.last().map(shifted));
    match (first, last) {
        (Some(first), Some(last)) if first != last => format!("{first} to {last}, {offset}"),
        (Some(first), _) => format!("{first}, {offset}"),
        _ => offset,
    }
}
