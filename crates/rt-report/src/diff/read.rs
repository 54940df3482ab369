//! Reading what a run left behind, with errors that name file and field.

use crate::ReportError;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// A file that was read.
pub(super) struct File<'a> {
    path: &'a Path,
    value: Value,
}

/// A place in it.
#[derive(Clone)]
pub(super) struct At<'a> {
    file: &'a Path,
    /// Names of the fields that lead there, such as `streams[0].makespan_s`.
    name: String,
    value: &'a Value,
}

impl<'a> File<'a> {
    pub(super) fn read(path: &'a Path) -> Result<Self, ReportError> {
        let text = fs::read(path).map_err(|error| ReportError::read(path, error))?;
        let value = serde_json::from_slice(&text)
            .map_err(|error| ReportError::content(path, format!("it is no JSON: {error}: {WANTED}")))?;
        Ok(Self { path, value })
    }

    pub(super) fn root(&self) -> At<'_> {
        At { file: self.path, name: String::new(), value: &self.value }
    }
}

/// What files are expected.
pub(super) const WANTED: &str = "name a report.json of `raybalance render`, or a compare.json of `raybalance compare`";

impl<'a> At<'a> {
    /// An error about this place.
    pub(super) fn wrong(&self, what: &str) -> ReportError {
        let place = if self.name.is_empty() { "it".to_owned() } else { format!("`{}`", self.name) };
        ReportError::content(self.file, format!("{place} {what}"))
    }

    /// A field, if it is there and not null.
    pub(super) fn known(&self, field: &str) -> Option<Self> {
        let name = if self.name.is_empty() { field.to_owned() } else { format!("{}.{field}", self.name) };
        let value = self.value.get(field).filter(|value| !value.is_null())?;
        Some(Self { file: self.file, name, value })
    }

    pub(super) fn field(&self, field: &str) -> Result<Self, ReportError> {
        let missing = || {
            let place = if self.name.is_empty() { String::new() } else { format!("{}.", self.name) };
            ReportError::content(self.file, format!("`{place}{field}` is missing"))
        };
        self.known(field).ok_or_else(missing)
    }

    pub(super) fn list(&self) -> Result<Vec<Self>, ReportError> {
        let entries = self.value.as_array().ok_or_else(|| self.wrong("is no list"))?;
        let entry = |(index, value)| Self { file: self.file, name: format!("{}[{index}]", self.name), value };
        Ok(entries.iter().enumerate().map(entry).collect())
    }

    pub(super) fn number(&self) -> Result<f64, ReportError> {
        self.value.as_f64().ok_or_else(|| self.wrong("is no number"))
    }

    pub(super) fn text(&self) -> Result<&'a str, ReportError> {
        self.value.as_str().ok_or_else(|| self.wrong("is no text"))
    }

    /// The number of a field that may be null.
    pub(super) fn known_number(&self, field: &str) -> Result<Option<f64>, ReportError> {
        self.known(field).map(|at| at.number()).transpose()
    }

    /// Whatever is there, as people read it.
    pub(super) fn shown(&self) -> String {
        match self.value {
            Value::String(text) => text.clone(),
            Value::Array(entries) if entries.iter().all(|entry| !entry.is_object()) => {
                let shown = |entry: &Value| entry.as_str().map_or_else(|| entry.to_string(), str::to_owned);
                entries.iter().map(shown).collect::<Vec<_>>().join(", ")
            }
            value => value.to_string(),
        }
    }

    /// What a dotted path leads to, if it is there and not null.
    pub(super) fn path(&self, path: &str) -> Option<Self> {
        path.split('.').try_fold(self.clone(), |at, field| at.known(field))
    }
}
