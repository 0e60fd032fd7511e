//! Files that people write: every refusal names file, line and field.

use std::path::Path;

/// Why a file was refused.
#[derive(Debug, thiserror::Error)]
pub enum InputFileError {
    /// The file could not be read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// Something in the file is wrong.
    #[error("{path}:{line}: {field}: {message}")]
    Content {
        /// The file.
        path: String,
        /// Line, counted from 1.
        line: usize,
        /// The field, as a path from the top of the file; what stands in a row is counted from 1; or the column.
        field: String,
        /// What is wrong with it.
        message: String,
    },
}

/// The text of a file, and its name for messages.
///
/// # Errors
/// [`InputFileError::Read`].
pub(crate) fn read(path: &Path) -> Result<(String, String), InputFileError> {
    let name = path.display().to_string();
    match std::fs::read_to_string(path) {
        Ok(text) => Ok((text, name)),
        Err(source) => Err(InputFileError::Read { path: name, source }),
    }
}
