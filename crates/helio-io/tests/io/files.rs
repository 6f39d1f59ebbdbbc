//! A folder with files, and a field to begin from.

use std::path::PathBuf;
use std::sync::Arc;

use arrow::array::{ArrayRef, RecordBatch};
use helio_io::{IoError, LoadedField};
use parquet::arrow::ArrowWriter;

/// A small field whose every line can be spoiled.
pub const FIELD: &str = r#"[site]
name = "Test"
latitude_deg = 40.0
longitude_deg = 94.4
elevation_m = 1100

[targets.receiver]
centre_enu_m = [0.0, 0.0, 100.0]

[targets.white]
centre_enu_m = [0.0, 2.0, 60.0]
normal_enu = [0.0, 1.0, 0.0]
width_m = 8.0
height_m = 6.0

[heliostats]
table = "layout.csv"
aim = "receiver"
mirror_offset_m = 0.2
"#;

pub const LAYOUT: &str = "id,east_m,north_m,up_m
A1,10,80,4
A2,20,80,4
A3,30,80,4.5
";

pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// With [`FIELD`] and [`LAYOUT`] in it.
    pub fn of_field() -> Self {
        Self::new()
            .with("field.toml", FIELD)
            .with("layout.csv", LAYOUT)
    }

    pub fn with(self, name: &str, contents: impl AsRef<[u8]>) -> Self {
        // Written over, a file is flushed to the disk by some systems; these tests write thousands.
        let _ = std::fs::remove_file(self.path(name));
        std::fs::write(self.path(name), contents).unwrap();
        self
    }

    /// The field with some text replaced by another, and more text behind it.
    pub fn edited(self, edits: &[(&str, &str)], more: &str) -> Self {
        let mut text = FIELD.to_string();
        for (from, to) in edits {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        self.with("field.toml", text + more)
    }

    pub fn with_parquet(self, name: &str, columns: Vec<(&str, ArrayRef)>) -> Self {
        let batch = RecordBatch::try_from_iter(columns).unwrap();
        let file = std::fs::File::create(self.path(name)).unwrap();
        let mut writer = ArrowWriter::try_new(file, batch.schema(), None).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        self
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn load(&self) -> Result<LoadedField, IoError> {
        helio_io::load_field(&self.path("field.toml"))
    }

    /// A message without the name of the folder.
    pub fn redact(&self, error: &IoError) -> String {
        error
            .to_string()
            .replace(&self.0.path().display().to_string(), "DIR")
    }
}

pub fn floats(values: &[f64]) -> ArrayRef {
    Arc::new(arrow::array::Float64Array::from(values.to_vec()))
}

pub fn texts(values: &[&str]) -> ArrayRef {
    Arc::new(arrow::array::StringArray::from(values.to_vec()))
}
