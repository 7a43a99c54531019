//! Where a file goes, and how it gets there whole.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a result cannot be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The ending says no format that can be written.
    #[error("cannot tell what to write from {}: the ending must be one of .{}", path.display(), known.join(", ."))]
    UnknownEnding {
        /// The path.
        path: PathBuf,
        /// The endings that would do.
        known: &'static [&'static str],
    },
    /// The folder is missing, or is no folder, or does not let us write.
    #[error("cannot write {}: the folder {} {why}", path.display(), folder.display())]
    Folder {
        /// The file to be written.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
        /// What is the matter with it.
        why: String,
    },
    /// Writing failed, for lack of space for instance.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file of ours cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file cannot be read back.
    #[error("cannot read {}: {message}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        message: String,
    },
}

impl ExportError {
    /// What to try; empty when there is nothing to say.
    pub fn help(&self) -> &'static str {
        match self {
            Self::UnknownEnding { .. } => "rename the output",
            Self::Folder { .. } => "make the folder first, or choose another one",
            Self::Io { .. } => "look whether the disk is full",
            Self::Read { .. } => "look whether it exists and may be read",
            Self::Unreadable { .. } => "",
        }
    }
}

/// An error when the ending of `path` is none of `known`, or no file can be put there.
pub(super) fn check_ending(path: &Path, known: &'static [&'static str]) -> Result<(), ExportError> {
    if !path.extension().is_some_and(|e| known.iter().any(|ending| e.eq_ignore_ascii_case(ending))) {
        return Err(ExportError::UnknownEnding { path: path.to_path_buf(), known });
    }
    check_writable(path)
}

/// The folder that will hold `path`.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A new temporary file beside `path`, with the permissions any new file gets here.
fn temporary_beside(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".radiosa-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The process's umask takes from this what it takes from every file.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder_of(path))
}

/// Finds out whether a file can be put at `path`, by making and removing a temporary one beside it.
///
/// # Errors
/// When `path` is a folder, its own folder is missing, or does not let us write.
pub fn check_writable(path: &Path) -> Result<(), ExportError> {
    let folder = folder_of(path);
    let refuse = |why: String| ExportError::Folder { path: path.to_path_buf(), folder: folder.to_path_buf(), why };
    if path.is_dir() {
        return Err(ExportError::Io {
            path: path.to_path_buf(),
            source: io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"),
        });
    }
    if fs::metadata(path).is_ok_and(|meta| !meta.is_file()) {
        return Err(ExportError::Io {
            path: path.to_path_buf(),
            source: io::Error::new(io::ErrorKind::InvalidInput, "it is a device or a pipe; results are written to regular files"),
        });
    }
    match fs::metadata(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Err(refuse("does not exist".into())),
        Err(e) => return Err(refuse(format!("cannot be used: {e}"))),
        Ok(meta) if !meta.is_dir() => return Err(refuse("is not a folder".into())),
        Ok(_) => {}
    }
    temporary_beside(path).map(drop).map_err(|e| refuse(format!("does not let us write: {e}")))
}

/// Writes a file so that `path` holds either all of it or what it held before: `fill` writes to a temporary file in the same
/// folder, which is flushed to the disk and renamed. On any failure the temporary file is removed.
///
/// # Errors
/// When the folder cannot be written to, `fill` fails, or the disk is full.
pub fn write_atomically(path: &Path, fill: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>) -> Result<(), ExportError> {
    // What a link points to is written, not the link.
    let resolved = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let path = resolved.as_path();
    check_folder_exists(path)?;
    let io = |source| ExportError::Io { path: path.to_path_buf(), source };
    let mut temporary = temporary_beside(path).map_err(io)?;
    let mut buffered = BufWriter::with_capacity(1 << 16, temporary.as_file_mut());
    fill(&mut buffered).and_then(|()| buffered.flush()).map_err(io)?;
    drop(buffered);
    temporary.as_file().sync_all().map_err(io)?;
    temporary.persist(path).map_err(|e| io(e.error))?;
    // The name is safe only when the folder is; not every file system lets a folder be flushed, and the file is whole either way.
    if let Ok(folder) = File::open(folder_of(path)) {
        let _ = folder.sync_all();
    }
    Ok(())
}

fn check_folder_exists(path: &Path) -> Result<(), ExportError> {
    let folder = folder_of(path);
    if folder.is_dir() {
        return Ok(());
    }
    Err(ExportError::Folder { path: path.to_path_buf(), folder: folder.to_path_buf(), why: "does not exist".into() })
}
