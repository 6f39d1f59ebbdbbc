//! JSON objects whose keys are asked for by name, with the file in every problem.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::error::{IoError, Place, Problem};

/// A file that holds one object.
pub(super) struct Record {
    pub(super) path: PathBuf,
    value: Value,
}

impl Record {
    pub(super) fn read(path: &Path) -> Result<Self, IoError> {
        let bytes = std::fs::read(path).map_err(|error| IoError::read(path, error))?;
        let value: Value = serde_json::from_slice(&bytes).map_err(|error| {
            let place = Place {
                line: Some(error.line()),
                column: Some(error.column()),
                ..Place::file(path)
            };
            let problem = Problem::Syntax {
                format: "JSON",
                message: error.to_string(),
            };
            IoError::new(place, problem)
        })?;
        if !value.is_object() {
            let problem = Problem::Syntax {
                format: "JSON of this kind",
                message: format!("expected an object, got {}", found(&value)),
            };
            return Err(IoError::new(Place::file(path), problem));
        }
        Ok(Self {
            path: path.to_path_buf(),
            value,
        })
    }

    /// The keys and values of the object.
    pub(super) fn entries(&self) -> impl Iterator<Item = (&str, &Value)> {
        let object = self.value.as_object().into_iter().flatten();
        object.map(|(name, value)| (name.as_str(), value))
    }

    /// What stands under keys within keys.
    pub(super) fn get(&self, keys: &[&str]) -> Result<&Value, IoError> {
        self.within(&self.value, "", keys)
    }

    /// What stands under keys of a part of the file, whose own name is `part`.
    pub(super) fn within<'a>(
        &self,
        mut value: &'a Value,
        part: &str,
        keys: &[&str],
    ) -> Result<&'a Value, IoError> {
        let mut dotted = part.to_owned();
        for key in keys {
            if !dotted.is_empty() {
                dotted.push('.');
            }
            dotted.push_str(key);
            value = value.get(key).ok_or_else(|| {
                self.error(Problem::Missing {
                    what: format!("the key `{dotted}`"),
                    wanted: String::new(),
                })
            })?;
        }
        Ok(value)
    }

    /// What stands under a key if it is there and no null.
    pub(super) fn maybe(&self, key: &str) -> Option<&Value> {
        self.value.get(key).filter(|value| !value.is_null())
    }

    /// A finite number.
    pub(super) fn number(&self, what: &str, value: &Value) -> Result<f64, IoError> {
        let number = value.as_f64().filter(|number| number.is_finite());
        number.ok_or_else(|| self.wrong_kind(what, "a finite number", value))
    }

    /// Three finite numbers.
    pub(super) fn three(&self, what: &str, value: &Value) -> Result<[f64; 3], IoError> {
        let numbers: Option<Vec<f64>> = value
            .as_array()
            .and_then(|values| values.iter().map(Value::as_f64).collect());
        numbers
            .and_then(|numbers| numbers.try_into().ok())
            .ok_or_else(|| self.wrong_kind(what, "3 finite numbers", value))
    }

    /// A geodetic point: latitude and longitude \[deg\], height \[m\].
    pub(super) fn point(&self, what: &str, value: &Value) -> Result<[f64; 3], IoError> {
        let point = self.three(what, value)?;
        for (number, name, least, greatest) in [
            (point[0], "latitude", -90.0, 90.0),
            (point[1], "longitude", -180.0, 360.0),
        ] {
            if !(least..=greatest).contains(&number) {
                return Err(self.error(Problem::OutOfRange {
                    what: format!("{what}: {name}"),
                    min: least,
                    max: greatest,
                    unit: " degrees",
                    value: number,
                }));
            }
        }
        Ok(point)
    }

    pub(super) fn wrong_kind(&self, what: &str, wanted: &str, value: &Value) -> IoError {
        self.error(Problem::WrongKind {
            what: what.to_owned(),
            wanted: wanted.to_owned(),
            found: found(value),
        })
    }

    pub(super) fn conflict(&self, message: String) -> IoError {
        self.error(Problem::Conflict { message })
    }

    pub(super) fn error(&self, problem: Problem) -> IoError {
        IoError::new(Place::file(&self.path), problem)
    }
}

/// Most of a wrong value that a message shows, in characters.
const SHOWN: usize = 60;

fn found(value: &Value) -> String {
    let kind = match value {
        Value::Null => return "null".to_owned(),
        Value::Object(_) => return "an object".to_owned(),
        Value::Array(values) => format!("{} values: ", values.len()),
        _ => String::new(),
    };
    let text = value.to_string();
    if text.chars().count() <= SHOWN {
        return format!("{kind}{text}");
    }
    let start: String = text.chars().take(SHOWN).collect();
    format!("{kind}{start}…")
}
