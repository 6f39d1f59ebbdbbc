//! Where results of `flux` go.

use std::path::{Path, PathBuf};

use helio_flux::{FluxMap, Receiver};
use helio_io::output::{Cells, Destination, Format, write_columns};
use helio_io::{AtomicFile, write_file, write_file_with, write_flux_map};
use serde_json::Value;

use super::summary::text_of;
use crate::args::FluxArgs;
use crate::failure::Failure;
use crate::plan;
use crate::printer::Printer;

/// How a map is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum MapFormat {
    Table(Format),
    Vtk,
}

/// Where results go; everything that can be known to fail is known before the work begins.
pub(super) struct Outputs<'a> {
    args: &'a FluxArgs,
    format: MapFormat,
}

pub(super) fn suffix_is(path: &Path, wanted: &[&str]) -> bool {
    let suffix = path.extension().map(|suffix| suffix.to_ascii_lowercase());
    suffix.is_some_and(|suffix| wanted.iter().any(|wanted| suffix == *wanted))
}

fn wants(path: &Path, option: &str, wanted: &[&str]) -> Result<(), Failure> {
    if suffix_is(path, wanted) {
        return Ok(());
    }
    let names: Vec<String> = wanted.iter().map(|suffix| format!(".{suffix}")).collect();
    Err(Failure::refused(format!(
        "{}: {option} wants a name that ends in {}",
        path.display(),
        names.join(", ")
    )))
}

impl<'a> Outputs<'a> {
    pub(super) fn check(args: &'a FluxArgs, inputs: &[PathBuf]) -> Result<Self, Failure> {
        let outputs = [
            ("--out", args.out.as_deref()),
            ("--summary", args.summary.as_deref()),
            ("--slopes", args.slopes.as_deref()),
            ("--plot", args.plot.as_deref()),
        ];
        for (option, path) in outputs {
            let Some(path) = path else { continue };
            if plan::is_stdout(path) {
                if option == "--summary" || (option == "--out" && args.summary.is_some()) {
                    continue;
                }
                return Err(Failure::refused(format!(
                    "{option}: standard output is for what --summary would take; give it a file"
                )));
            }
            plan::not_an_input(path, inputs)?;
            AtomicFile::check(path)?;
        }
        for (k, one) in outputs.iter().enumerate() {
            for other in &outputs[..k] {
                plan::not_the_same(*other, *one)?;
            }
        }
        let on_stdout = |path: Option<&Path>| path.is_some_and(plan::is_stdout);
        if on_stdout(args.out.as_deref()) && on_stdout(args.summary.as_deref()) {
            return Err(Failure::refused(
                "--out and --summary both go to standard output; give one a file",
            ));
        }
        if let Some(path) = &args.slopes {
            wants(path, "--slopes", &["csv", "vtk"])?;
        }
        if let Some(path) = &args.plot {
            wants(path, "--plot", &["svg", "png", "html", "htm"])?;
        }
        if let Some(path) = args
            .summary
            .as_deref()
            .filter(|path| !plan::is_stdout(path))
        {
            wants(path, "--summary", &["json"])?;
        }
        Ok(Self {
            args,
            format: Self::map_format(args)?,
        })
    }

    fn map_format(args: &FluxArgs) -> Result<MapFormat, Failure> {
        match (&args.out, args.format) {
            (Some(path), None) if suffix_is(path, &["vtk"]) => Ok(MapFormat::Vtk),
            (Some(path), None) if !plan::is_stdout(path) && path.extension().is_some() => {
                Format::of_path(path).map(MapFormat::Table).ok_or_else(|| {
                    Failure::refused(format!(
                        "{}: the suffix stands for no format; wanted .csv, .parquet, .json, .jsonl or .vtk, or \
                         --format",
                        path.display()
                    ))
                })
            }
            (_, word) => Ok(MapFormat::Table(word.map_or(Format::Csv, Format::from))),
        }
    }

    /// The map of a receiver; `axes` are the names of its frame's.
    pub(super) fn map(
        &self,
        receiver: &Receiver,
        map: &FluxMap,
        axes: [&str; 3],
        printer: &Printer,
    ) -> Result<(), Failure> {
        let Some(path) = &self.args.out else {
            return Ok(());
        };
        match self.format {
            MapFormat::Vtk => {
                let write = |out: &mut AtomicFile| helio_flux::map::write_vtk(out, receiver, map);
                Ok(write_file_with(path, write)?)
            }
            MapFormat::Table(format) => {
                let destination = Self::destination(path, printer);
                write_flux_map(destination, format, receiver, map, axes)?;
                Ok(())
            }
        }
    }

    /// A table where the map goes.
    pub(super) fn table(
        &self,
        path: &Path,
        format: Format,
        columns: &[(&str, Cells<'_>)],
        printer: &Printer,
    ) -> Result<(), Failure> {
        write_columns(Self::destination(path, printer), format, columns)?;
        Ok(())
    }

    fn destination(path: &Path, printer: &Printer) -> Destination {
        if plan::is_stdout(path) {
            printer.stdout_table()
        } else {
            Destination::File(path.to_owned())
        }
    }

    /// The format of a table that is no map of a receiver's bins.
    pub(super) fn table_format(&self) -> Result<Format, Failure> {
        match self.format {
            MapFormat::Table(format) => Ok(format),
            MapFormat::Vtk => Err(Failure::refused(
                "--out: a picture's map is a table; wanted .csv, .parquet, .json or .jsonl",
            )),
        }
    }

    pub(super) fn summary(&self, found: &Value, printer: &Printer) -> Result<(), Failure> {
        let text = text_of(found)?;
        match self
            .args
            .summary
            .as_deref()
            .filter(|path| !plan::is_stdout(path))
        {
            Some(path) => Ok(write_file(path, text.as_bytes())?),
            None => printer.data(&text),
        }
    }
}

/// Writes slope errors by the suffix of their file.
pub(super) fn slopes(
    path: &Path,
    deformed: &helio_flux::deform::Deformed,
    slopes: &helio_flux::deform::SlopeErrors,
    mirror: &helio_flux::mesh::Mirror,
) -> Result<(), Failure> {
    write_file_with(path, |out| {
        if suffix_is(path, &["vtk"]) {
            helio_flux::deform::write_vtk(out, mirror, slopes)
        } else {
            helio_flux::deform::write_csv(out, deformed, slopes)
        }
    })?;
    Ok(())
}
