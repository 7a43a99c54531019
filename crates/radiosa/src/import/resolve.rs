//! Which files a scene may pull in, and how they are found.

use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use super::{ImportError, Options};

/// Opens what a scene file refers to: only regular files, only below the folder of the file that names them or below a
/// folder that was allowed, and never more bytes than the budget.
#[derive(Clone, Debug)]
pub struct Resolver {
    path: PathBuf,
    folder: PathBuf,
    options: Options,
    confined: bool,
}

impl Resolver {
    /// For the references inside the file at `path`.
    pub fn new(path: &Path, options: &Options) -> Self {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_path_buf();
        Self { path: path.to_path_buf(), folder, options: options.clone(), confined: true }
    }

    /// The same for a format that may refer to any regular file (the scene file is the user's own).
    pub fn unconfined(mut self) -> Self {
        self.confined = false;
        self
    }

    /// The file whose references are resolved.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Limits and permissions.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The bytes of the file itself.
    ///
    /// # Errors
    /// When it cannot be read or is larger than the memory budget.
    pub fn read_main(&self) -> Result<Vec<u8>, ImportError> {
        self.read_path(&self.path)
    }

    /// The bytes of a file named inside it. Backslashes count as slashes (files made on Windows); percent escapes are the caller's concern.
    ///
    /// # Errors
    /// When the name leads outside what is allowed, or the file cannot be read or is larger than the memory budget.
    pub fn read(&self, name: &str) -> Result<Vec<u8>, ImportError> {
        self.read_path(&self.find(name)?)
    }

    /// The bytes of a file at a path that [`Resolver::find`] gave.
    ///
    /// # Errors
    /// When it cannot be read or is larger than the memory budget.
    pub(super) fn read_found(&self, found: &Path) -> Result<Vec<u8>, ImportError> {
        self.read_path(found)
    }

    /// The path of a file named inside it, checked against what is allowed.
    ///
    /// # Errors
    /// When the name leads outside what is allowed, or nothing is there.
    pub fn find(&self, name: &str) -> Result<PathBuf, ImportError> {
        let io = |path: &Path, source| ImportError::Io { path: path.to_path_buf(), source };
        let direct = self.folder.join(name);
        let path = if direct.exists() { direct } else { self.folder.join(name.replace('\\', "/")) };
        let outside = || ImportError::Unsupported {
            path: self.path.clone(),
            feature: format!("the file {name:?}, which lies outside its folder"),
            help: "allow it with --allow-outside DIR if you trust the scene".into(),
        };
        if self.confined {
            // The text alone decides first, so that nothing outside is even looked at.
            let relative = path.strip_prefix(&self.folder).unwrap_or(&path);
            let mut depth = 0i64;
            let mut leaves = relative.is_absolute();
            for component in relative.components() {
                match component {
                    Component::ParentDir => depth -= 1,
                    Component::Normal(_) => depth += 1,
                    _ => {}
                }
                leaves |= depth < 0;
            }
            if leaves && self.options.allow_outside.is_empty() {
                return Err(outside());
            }
            let real = path.canonicalize().map_err(|e| io(&path, e))?;
            let allowed = std::iter::once(&self.folder).chain(&self.options.allow_outside);
            if !allowed.filter_map(|d| d.canonicalize().ok()).any(|d| real.starts_with(d)) {
                return Err(outside());
            }
        }
        Ok(path)
    }

    fn read_path(&self, path: &Path) -> Result<Vec<u8>, ImportError> {
        let io = |source| ImportError::Io { path: path.to_path_buf(), source };
        let meta = std::fs::metadata(path).map_err(io)?;
        if !meta.is_file() {
            return Err(io(std::io::Error::new(std::io::ErrorKind::InvalidInput, "it is not a regular file")));
        }
        let allowed = self.options.max_memory;
        let too_large = |needed| ImportError::TooLarge { what: path.display().to_string(), needed, allowed };
        if meta.len() > allowed {
            return Err(too_large(meta.len()));
        }
        let mut bytes = Vec::new();
        // One byte more than allowed tells a file that grew from one that fits.
        let n = File::open(path).map_err(io)?.take(allowed + 1).read_to_end(&mut bytes).map_err(io)?;
        if n as u64 > allowed { Err(too_large(n as u64)) } else { Ok(bytes) }
    }
}
