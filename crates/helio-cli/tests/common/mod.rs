//! A folder with a small field, and the program to run in it.

// Each test file uses its own part of this.
#![allow(dead_code, missing_docs, clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

pub const FIELD: &str = r#"[site]
name = "Test"
latitude_deg = 37.4
longitude_deg = -6.25
elevation_m = 20.0

[targets.receiver]
centre_enu_m = [0.0, 0.0, 120.0]
normal_enu = [0.0, 1.0, -0.3]
width_m = 12.0
height_m = 12.0

[heliostats]
table = "heliostats.csv"
aim = "receiver"
mirror_offset_m = 0.2
"#;

pub const HELIOSTATS: &str = "id,east_m,north_m,up_m\n\
                              A1,-40.0,100.0,3.0\n\
                              A2,0.5,110.0,3.0\n\
                              \"B, 3\",60.0,240.0,3.0\n";

pub const DRIVES: &str = r#"
[heliostats.drive.axis1]
type = "encoder"
steps_per_deg = 1000.0
[heliostats.drive.axis2]
type = "encoder"
steps_per_deg = 1000.0
"#;

pub const NOON: &[&str] = &["--time", "2026-06-21T12:00:00Z"];

pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn empty() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn new() -> Self {
        let folder = Self::empty();
        folder.write("field.toml", FIELD);
        folder.write("heliostats.csv", HELIOSTATS);
        folder
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) {
        std::fs::write(self.path().join(name), contents).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path().join(name)).unwrap()
    }

    /// Every file with its contents; folders without.
    pub fn contents(&self) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
        let entries = std::fs::read_dir(self.path()).unwrap();
        entries
            .map(|entry| {
                let path = entry.unwrap().path();
                // Links to devices are not read.
                let plain = path.symlink_metadata().unwrap().is_file();
                (path.clone(), plain.then(|| std::fs::read(path).unwrap()))
            })
            .collect()
    }

    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_helio-rs"));
        command
            .args(args)
            .current_dir(self.path())
            .stdin(Stdio::null());
        command
    }

    pub fn run(&self, args: &[&str]) -> Run {
        Run(self.command(args).output().unwrap())
    }

    /// `track --field field.toml` with more arguments.
    pub fn track(&self, more: &[&str]) -> Run {
        self.run(&[&["track", "--field", "field.toml"], more].concat())
    }
}

pub struct Run(pub Output);

impl Run {
    pub fn code(&self) -> i32 {
        self.0.status.code().expect("ended by a signal")
    }

    pub fn stdout(&self) -> String {
        String::from_utf8(self.0.stdout.clone()).unwrap()
    }

    pub fn stderr(&self) -> String {
        String::from_utf8(self.0.stderr.clone()).unwrap()
    }

    /// Standard output of a run that must have been good.
    pub fn good(&self) -> String {
        assert_eq!(self.code(), 0, "{}", self.stderr());
        self.stdout()
    }
}

/// Copies a folder and all in it.
pub fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let there = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy_folder(&path, &there);
        } else {
            std::fs::copy(path, there).unwrap();
        }
    }
}

/// Rows of a CSV text as maps from heading to cell.
pub fn rows(csv: &str) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let headings = reader.headers().unwrap().clone();
    let cell = |(heading, cell): (&str, &str)| (heading.to_owned(), cell.to_owned());
    reader
        .records()
        .map(|row| headings.iter().zip(&row.unwrap()).map(cell).collect())
        .collect()
}
