//! Files that a command writes.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::CliError;

/// A file that appears as a whole or not at all.
pub(super) struct WholeFile {
    path: PathBuf,
    /// As it was given.
    name: String,
    option: &'static str,
}

impl WholeFile {
    /// Makes sure that `path` can be written, and leaves what is there alone.
    pub(super) fn new(path: &Path, option: &'static str) -> Result<Self, CliError> {
        // Through a link, to the file that it stands for.
        let name = path.display().to_string();
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let file = Self { path, name, option };
        if file.path.exists() && !file.path.is_file() {
            return Err(file.refuse(io::Error::other("it is there already, and is no file")));
        }
        // Gone again at once: whoever is killed before there is something to write leaves nothing behind.
        file.draft().map_err(|source| file.refuse(source))?;
        Ok(file)
    }

    fn draft(&self) -> io::Result<NamedTempFile> {
        let folder = match self.path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            // As any new file; the default is for secrets.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        builder.prefix(".cdpr-").tempfile_in(folder)
    }

    pub(super) fn refuse(&self, source: io::Error) -> CliError {
        CliError::Place { option: self.option, path: self.name.clone(), source }
    }

    pub(super) fn write(&self, bytes: &[u8]) -> io::Result<()> {
        self.write_with(|file| file.write_all(bytes))
    }

    /// Writes what `content` writes; it is on the disk when this returns.
    pub(super) fn write_with(
        &self,
        content: impl FnOnce(&mut File) -> io::Result<()>,
    ) -> io::Result<()> {
        let mut draft = self.draft()?;
        content(draft.as_file_mut())?;
        draft.as_file().sync_all()?;
        draft.persist(&self.path).map_err(|error| error.error)?;
        Ok(())
    }
}
