//! From files to a [`Scene`]. Each format is one module; file shapes stay private to it and are converted here.
//!
//! A reader never panics, hangs or allocates without bound whatever bytes it is given: sizes are checked against what the
//! file really holds before anything is reserved, and decoders of other people that are known to panic are contained.
//! To add a format: one module with a `read` of the same shape, one line in `reader`.

mod error;
mod gltf;
mod obj;
mod picture;
mod resolve;
pub mod sample;
mod scene_file;

pub use error::{ImportError, Location, Warning, Warnings};
pub use picture::decode as decode_picture;
pub use resolve::Resolver;
pub use scene_file::schema as scene_file_schema;

use std::path::{Path, PathBuf};

use crate::scene::{Image, Scene};

/// What an import may touch and spend.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folders outside the scene's own that it may refer to.
    pub allow_outside: Vec<PathBuf>,
    /// Upper bound of what decoding may allocate, bytes.
    pub max_memory: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { allow_outside: Vec::new(), max_memory: 16 << 30 }
    }
}

/// The endings [`load`] knows.
pub const ENDINGS: [&str; 4] = ["toml", "obj", "gltf", "glb"];

/// Reads a scene of any known format; the ending says which.
///
/// # Errors
/// When the file cannot be read, is malformed, or needs something unsupported; what is merely odd comes back as warnings.
pub fn load(path: &Path, options: &Options) -> Result<(Scene, Vec<Warning>), ImportError> {
    let read = reader(path)?;
    let resolver = Resolver::new(path, options);
    let bytes = resolver.read_main()?;
    finish(read, &bytes, &resolver)
}

/// Reads a scene from bytes as if they were the content of the file at `path`, which need not exist: its ending says the
/// format, its folder is where other files are looked for.
///
/// # Errors
/// As [`load`].
pub fn load_bytes(bytes: &[u8], path: &Path, options: &Options) -> Result<(Scene, Vec<Warning>), ImportError> {
    finish(reader(path)?, bytes, &Resolver::new(path, options))
}

type Read = fn(&[u8], &Resolver, &mut Warnings) -> Result<Scene, ImportError>;

fn reader(path: &Path) -> Result<Read, ImportError> {
    let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).unwrap_or_default();
    match ending.as_str() {
        "gltf" | "glb" => Ok(gltf::read),
        "obj" => Ok(obj::read),
        "toml" => Ok(scene_file::read),
        _ => Err(ImportError::Unsupported {
            path: path.to_path_buf(),
            feature: if ending.is_empty() { "a file ending".into() } else { format!("a reader for .{ending} files") },
            help: format!("scenes end in .{}", ENDINGS.join(", .")),
        }),
    }
}

fn finish(read: Read, bytes: &[u8], resolver: &Resolver) -> Result<(Scene, Vec<Warning>), ImportError> {
    let path = resolver.path();
    let mut warnings = Warnings::default();
    let mut scene = read(bytes, resolver, &mut warnings)?;
    if scene.name.is_empty() {
        scene.name = path.file_stem().and_then(|s| s.to_str()).unwrap_or("scene").to_owned();
    }
    scene.validate().map_err(|e| ImportError::invalid(Location::file(path), e.to_string()))?;
    Ok((scene, warnings.into_vec()))
}

/// Reads one picture from a file, for an environment given on the command line.
///
/// # Errors
/// When the file cannot be read or is no picture.
pub fn load_picture(path: &Path, options: &Options) -> Result<Image, ImportError> {
    let bytes = Resolver::new(path, options).read_main()?;
    decode_picture(&bytes, &Location::file(path), options.max_memory)
}
