//! Files in TOML whose every refusal names file, line and field.

use std::fmt;
use std::ops::Range;

use nalgebra::Vector3;
use serde::de::DeserializeOwned;
use toml::Spanned;

use crate::input_file::InputFileError;

/// The text of a file, for turning a place in it into a message.
pub(crate) struct Source<'a> {
    pub(crate) text: &'a str,
    pub(crate) path: &'a str,
}

impl Source<'_> {
    pub(crate) fn deserialize<D: DeserializeOwned>(&self) -> Result<D, InputFileError> {
        let document = toml::Deserializer::parse(self.text)
            .map_err(|error| self.refuse(error.span().unwrap_or(0..0), "TOML", error.message()))?;
        serde_path_to_error::deserialize(document).map_err(|error| {
            let field = from_one(error.path());
            let error = error.into_inner();
            // A message like "missing field" belongs to the table named by the path.
            self.refuse(error.span().unwrap_or(0..0), &field, error.message())
        })
    }

    pub(crate) fn refuse(
        &self,
        place: Range<usize>,
        field: &str,
        message: impl fmt::Display,
    ) -> InputFileError {
        let before = self.text.get(..place.start).unwrap_or_default();
        InputFileError::Content {
            path: self.path.to_owned(),
            line: 1 + before.matches('\n').count(),
            field: field.to_owned(),
            message: message.to_string(),
        }
    }

    pub(crate) fn number(
        &self,
        value: &Spanned<f64>,
        field: &str,
        good: impl Fn(f64) -> bool,
        need: &str,
    ) -> Result<f64, InputFileError> {
        let number = *value.get_ref();
        if good(number) {
            Ok(number)
        } else {
            Err(self.refuse(value.span(), field, format_args!("{number} is not {need}")))
        }
    }

    pub(crate) fn positive(
        &self,
        value: &Spanned<f64>,
        field: &str,
    ) -> Result<f64, InputFileError> {
        self.number(value, field, |v| v > 0.0 && v.is_finite(), "positive and finite")
    }

    pub(crate) fn not_negative(
        &self,
        value: &Spanned<f64>,
        field: &str,
    ) -> Result<f64, InputFileError> {
        self.number(value, field, |v| v >= 0.0 && v.is_finite(), "finite and not negative")
    }

    /// Positive, or infinite for "no limit".
    pub(crate) fn positive_or_infinite(
        &self,
        value: &Spanned<f64>,
        field: &str,
    ) -> Result<f64, InputFileError> {
        self.number(value, field, |v| v > 0.0, "positive")
    }

    pub(crate) fn vector(
        &self,
        value: &Spanned<Vec<f64>>,
        field: &str,
    ) -> Result<Vector3<f64>, InputFileError> {
        // Not an array of three: serde would read [8,826, ...] and drop what is too many.
        let &[x, y, z] = value.get_ref().as_slice() else {
            let count = value.get_ref().len();
            let message = format_args!("{count} numbers given, three needed");
            return Err(self.refuse(value.span(), field, message));
        };
        let vector = Vector3::new(x, y, z);
        if vector.iter().all(|c| c.is_finite()) {
            Ok(vector)
        } else {
            Err(self.refuse(value.span(), field, "a coordinate is not finite"))
        }
    }
}

/// The path of a field with array indices counted from 1, like cables everywhere else.
fn from_one(path: &serde_path_to_error::Path) -> String {
    use serde_path_to_error::Segment;
    let segments = path.iter().filter_map(|segment| match segment {
        Segment::Seq { index } => Some(format!("[{}]", index + 1)),
        // The inside of a value that remembers its place.
        Segment::Map { key } if key.starts_with('$') => None,
        Segment::Map { key } | Segment::Enum { variant: key } => Some(format!(".{key}")),
        Segment::Unknown => Some(".?".to_owned()),
    });
    let text: String = segments.collect();
    if text.is_empty() { "top level".to_owned() } else { text.trim_start_matches('.').to_owned() }
}
