//! TOML values asked for by [`Key`], with the place of every problem.

use std::ops::Range;
use std::path::Path;

use toml_edit::{Item, TableLike, Value};

use crate::error::{IoError, Problem, quoted};
use crate::keys::{Key, Kind, names};

/// Longest id, target or set name accepted, in bytes.
pub(crate) const MAX_NAME_BYTES: usize = 256;

/// A file and its text, for places.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub(crate) path: &'a Path,
    pub(crate) text: &'a str,
}

impl<'a> Source<'a> {
    /// The TOML of the text.
    pub(crate) fn parse(self) -> Result<toml_edit::Document<&'a str>, IoError> {
        toml_edit::Document::parse(self.text).map_err(|error| {
            let message = error.message().trim().replace('\n', "; ");
            let problem = Problem::Syntax {
                format: "TOML",
                message,
            };
            self.error(error.span(), problem)
        })
    }

    pub(crate) fn error(self, span: Option<Range<usize>>, problem: Problem) -> IoError {
        IoError::in_text(self.path, self.text, span, problem)
    }
}

/// One table of the file whose keys are known.
#[derive(Clone)]
pub(crate) struct Section<'a> {
    source: Source<'a>,
    /// Dotted name, empty for the whole file.
    name: String,
    table: &'a dyn TableLike,
    span: Option<Range<usize>>,
    keys: &'static [&'static Key],
}

impl<'a> Section<'a> {
    /// A table, all of whose keys must be among `keys` and all of whose required ones be there.
    pub(crate) fn new(
        source: Source<'a>,
        name: String,
        table: &'a dyn TableLike,
        span: Option<Range<usize>>,
        keys: &'static [&'static Key],
    ) -> Result<Self, IoError> {
        let section = Self {
            source,
            name,
            table,
            span,
            keys,
        };
        for (name, _) in table.iter() {
            if !names(keys).any(|known| known == name) {
                let problem = Problem::unknown("key", name, names(keys));
                return Err(source.error(section.key_span(name), problem));
            }
        }
        for key in keys {
            if key.required && table.get(key.name).is_none() {
                return Err(section.missing(key));
            }
        }
        Ok(section)
    }

    /// `section.key` as messages name it.
    pub(crate) fn dotted(&self, key: &Key) -> String {
        dotted(&self.name, key.name)
    }

    fn key_span(&self, name: &str) -> Option<Range<usize>> {
        self.table.key(name).and_then(toml_edit::Key::span)
    }

    /// Where a key's value stands; the key or the section if that is unknown.
    pub(crate) fn value_span(&self, key: &Key) -> Option<Range<usize>> {
        self.table
            .get(key.name)
            .and_then(Item::span)
            .or_else(|| self.key_span(key.name))
            .or_else(|| self.span.clone())
    }

    /// A problem with the value of a key.
    pub(crate) fn error(&self, key: &Key, problem: Problem) -> IoError {
        self.source.error(self.value_span(key), problem)
    }

    /// A key is needed that is not there.
    pub(crate) fn missing(&self, key: &Key) -> IoError {
        let about = key.about.trim_end_matches('.');
        let problem = Problem::Missing {
            what: self.dotted(key),
            wanted: lower_first(about),
        };
        self.source.error(self.span.clone(), problem)
    }

    fn wrong_kind(&self, key: &Key, item: &Item) -> IoError {
        let problem = Problem::WrongKind {
            what: self.dotted(key),
            wanted: key.wanted(),
            found: found(item),
        };
        self.error(key, problem)
    }

    fn get(&self, key: &Key) -> Option<&'a Item> {
        debug_assert!(
            names(self.keys).any(|known| known == key.name),
            "{}",
            key.name
        );
        self.table.get(key.name)
    }

    pub(crate) fn has(&self, key: &Key) -> bool {
        self.get(key).is_some()
    }

    pub(crate) fn text(&self, key: &Key) -> Result<Option<&'a str>, IoError> {
        let Some(item) = self.get(key) else {
            return Ok(None);
        };
        let text = item.as_str().ok_or_else(|| self.wrong_kind(key, item))?;
        if let Kind::Word(words) = &key.kind
            && !words.contains(&text)
        {
            let mut problem = Problem::unknown("word", text, words.iter().copied());
            if let Problem::Unknown { nearest: None, .. } = problem {
                problem = Problem::WrongKind {
                    what: self.dotted(key),
                    wanted: key.wanted(),
                    found: quoted(text),
                };
            }
            return Err(self.error(key, problem));
        }
        Ok(Some(text))
    }

    pub(crate) fn number(&self, key: &Key) -> Result<Option<f64>, IoError> {
        let Some(item) = self.get(key) else {
            return Ok(None);
        };
        let yes = item.as_bool().filter(|_| matches!(key.kind, Kind::YesNo));
        let value = item
            .as_value()
            .and_then(number)
            .or_else(|| yes.map(|yes| f64::from(u8::from(yes))))
            .ok_or_else(|| self.wrong_kind(key, item))?;
        let value = key
            .check(&self.dotted(key), value)
            .map_err(|p| self.error(key, p))?;
        Ok(Some(value))
    }

    /// A number without a fraction; `wanted` is what messages call it.
    pub(crate) fn whole(&self, key: &Key, wanted: &str) -> Result<Option<u64>, IoError> {
        let Some(number) = self.number(key)? else {
            return Ok(None);
        };
        if number.fract() != 0.0 {
            let problem = Problem::WrongKind {
                what: self.dotted(key),
                wanted: wanted.into(),
                found: number.to_string(),
            };
            return Err(self.error(key, problem));
        }
        Ok(Some(number as u64))
    }

    /// East, north, up.
    pub(crate) fn enu(&self, key: &Key, limit: f64) -> Result<Option<[f64; 3]>, IoError> {
        let Some(item) = self.get(key) else {
            return Ok(None);
        };
        let array = item.as_array().ok_or_else(|| self.wrong_kind(key, item))?;
        if array.len() != 3 {
            let found = match array.len() {
                1 => "1 number".to_string(),
                len => format!("{len} numbers"),
            };
            let (what, wanted) = (self.dotted(key), key.wanted());
            return Err(self.error(
                key,
                Problem::WrongKind {
                    what,
                    wanted,
                    found,
                },
            ));
        }
        let mut enu = [0.0; 3];
        for (slot, value) in enu.iter_mut().zip(array) {
            let what = self.dotted(key);
            let place = |problem| self.source.error(value.span(), problem);
            let given = number(value).ok_or_else(|| {
                let wanted = key.wanted();
                place(Problem::WrongKind {
                    what: what.clone(),
                    wanted,
                    found: found_value(value),
                })
            })?;
            if !given.is_finite() {
                return Err(place(Problem::NotFinite { what, value: given }));
            }
            if given.abs() > limit {
                let (min, max, unit) = (-limit, limit, key.unit());
                return Err(place(Problem::OutOfRange {
                    what,
                    min,
                    max,
                    unit,
                    value: given,
                }));
            }
            *slot = given;
        }
        Ok(Some(enu))
    }

    /// Four points [x, y].
    pub(crate) fn corners(&self, key: &Key, limit: f64) -> Result<Option<[[f64; 2]; 4]>, IoError> {
        let Some(item) = self.get(key) else {
            return Ok(None);
        };
        let wrong = |span, found| {
            let (what, wanted) = (self.dotted(key), key.wanted());
            let problem = Problem::WrongKind {
                what,
                wanted,
                found,
            };
            self.source.error(span, problem)
        };
        let array = item.as_array().ok_or_else(|| self.wrong_kind(key, item))?;
        if array.len() != 4 {
            let found = format!("{} of them", array.len());
            return Err(wrong(self.value_span(key), found));
        }
        let mut corners = [[0.0; 2]; 4];
        for (corner, value) in corners.iter_mut().zip(array) {
            let pair = value.as_array().filter(|pair| pair.len() == 2);
            let pair = pair.ok_or_else(|| wrong(value.span(), found_value(value)))?;
            for (slot, value) in corner.iter_mut().zip(pair) {
                let given = number(value).ok_or_else(|| wrong(value.span(), found_value(value)))?;
                if !(-limit..=limit).contains(&given) {
                    let problem = Problem::OutOfRange {
                        what: self.dotted(key),
                        min: -limit,
                        max: limit,
                        unit: key.unit(),
                        value: given,
                    };
                    return Err(self.source.error(value.span(), problem));
                }
                *slot = given;
            }
        }
        Ok(Some(corners))
    }

    pub(crate) fn texts(&self, key: &Key) -> Result<Vec<Spanned<'a>>, IoError> {
        let Some(item) = self.get(key) else {
            return Ok(Vec::new());
        };
        let array = item.as_array().ok_or_else(|| self.wrong_kind(key, item))?;
        let mut texts = Vec::with_capacity(array.len());
        for value in array {
            let Some(text) = value.as_str() else {
                let what = self.dotted(key);
                let problem = Problem::WrongKind {
                    what,
                    wanted: key.wanted(),
                    found: found_value(value),
                };
                return Err(self.source.error(value.span(), problem));
            };
            texts.push(Spanned {
                text,
                span: value.span(),
            });
        }
        Ok(texts)
    }

    fn table(&self, key: &Key) -> Result<Option<&'a dyn TableLike>, IoError> {
        let Some(item) = self.get(key) else {
            return Ok(None);
        };
        item.as_table_like()
            .map(Some)
            .ok_or_else(|| self.wrong_kind(key, item))
    }

    pub(crate) fn section(&self, key: &Key) -> Result<Option<Self>, IoError> {
        let Some(table) = self.table(key)? else {
            return Ok(None);
        };
        let (Kind::Table(keys) | Kind::Named(keys)) = &key.kind else {
            return Ok(None);
        };
        let span = self.value_span(key);
        Self::new(self.source, self.dotted(key), table, span, keys).map(Some)
    }

    /// The tables of a table of any names.
    pub(crate) fn named(&self, key: &Key) -> Result<Vec<(&'a str, Self)>, IoError> {
        let (Some(table), Kind::Named(keys)) = (self.table(key)?, &key.kind) else {
            return Ok(Vec::new());
        };
        let mut sections = Vec::with_capacity(table.len());
        for (name, item) in table.iter() {
            let key_span = table.key(name).and_then(toml_edit::Key::span);
            check_name("name", name)
                .map_err(|problem| self.source.error(key_span.clone(), problem))?;
            let span = item.span().or(key_span);
            let whole = dotted(&self.dotted(key), name);
            let Some(inner) = item.as_table_like() else {
                let problem = Problem::WrongKind {
                    what: whole,
                    wanted: "a table".into(),
                    found: found(item),
                };
                return Err(self.source.error(span, problem));
            };
            sections.push((name, Self::new(self.source, whole, inner, span, keys)?));
        }
        Ok(sections)
    }

    /// The pairs of a table from our column names to foreign ones.
    pub(crate) fn renames(&self, key: &Key) -> Result<Vec<(&'a str, Spanned<'a>)>, IoError> {
        let (Some(table), Kind::Renames(keys)) = (self.table(key)?, &key.kind) else {
            return Ok(Vec::new());
        };
        let mut pairs = Vec::with_capacity(table.len());
        for (name, item) in table.iter() {
            let key_span = table.key(name).and_then(toml_edit::Key::span);
            if !names(keys).any(|known| known == name) {
                let problem = Problem::unknown("column of ours", name, names(keys));
                return Err(self.source.error(key_span, problem));
            }
            let span = item.span().or(key_span);
            let Some(text) = item.as_str() else {
                let what = dotted(&self.dotted(key), name);
                let wanted = "the name of a column in quotes".to_string();
                let problem = Problem::WrongKind {
                    what,
                    wanted,
                    found: found(item),
                };
                return Err(self.source.error(span, problem));
            };
            pairs.push((name, Spanned { text, span }));
        }
        Ok(pairs)
    }

    /// Dotted name, empty for the whole file.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn source(&self) -> Source<'a> {
        self.source
    }

    /// Where the section begins.
    pub(crate) fn span(&self) -> Option<Range<usize>> {
        self.span.clone()
    }
}

/// A text of the file and where it stands.
#[derive(Debug, Clone)]
pub(crate) struct Spanned<'a> {
    pub(crate) text: &'a str,
    pub(crate) span: Option<Range<usize>>,
}

/// Checks the length and characters of an id or another name.
pub(crate) fn check_name(what: &'static str, name: &str) -> Result<(), Problem> {
    if name.len() > MAX_NAME_BYTES {
        let start: String = name.chars().take(24).collect();
        let (length, limit) = (name.len(), MAX_NAME_BYTES);
        return Err(Problem::TooLong {
            what,
            length,
            limit,
            start,
        });
    }
    if name.trim().is_empty() {
        return Err(Problem::Missing {
            what: format!("the {what}"),
            wanted: String::new(),
        });
    }
    if name.chars().any(char::is_control) {
        let message = format!("the {what} {} has a control character in it", quoted(name));
        return Err(Problem::Conflict { message });
    }
    Ok(())
}

fn dotted(section: &str, key: &str) -> String {
    if section.is_empty() {
        key.to_string()
    } else {
        format!("{section}.{key}")
    }
}

fn number(value: &Value) -> Option<f64> {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|integer| integer as f64))
}

fn found(item: &Item) -> String {
    match item {
        Item::Value(value) => found_value(value),
        Item::Table(_) => "a table".into(),
        Item::ArrayOfTables(_) => "a list of tables".into(),
        Item::None => "nothing".into(),
    }
}

fn found_value(value: &Value) -> String {
    match value {
        Value::String(text) => format!("text {}", quoted(text.value())),
        Value::Integer(number) => format!("the number {}", number.value()),
        Value::Float(number) => format!("the number {}", number.value()),
        Value::Boolean(yes) => format!("{}", yes.value()),
        Value::Datetime(time) => format!("the time {}", time.value()),
        Value::Array(_) => "a list".into(),
        Value::InlineTable(_) => "a table".into(),
    }
}

fn lower_first(text: &str) -> String {
    let mut chars = text.chars();
    match (chars.next(), chars.next()) {
        // Keeps abbreviations.
        (Some(first), Some(second)) if !second.is_uppercase() => {
            first.to_lowercase().chain(text.chars().skip(1)).collect()
        }
        _ => text.to_string(),
    }
}
