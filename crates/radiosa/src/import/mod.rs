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
mod stl;
mod vs3;

pub use error::{ImportError, Location, Warning, Warnings};
pub use picture::decode as decode_picture;
pub use resolve::Resolver;
pub use scene_file::schema as scene_file_schema;
pub use scene_file::{Override, OverrideError, nearest};

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
pub const ENDINGS: [&str; 6] = ["toml", "obj", "gltf", "glb", "stl", "vs3"];

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

/// Reads a scene of any known format with values of its scene file replaced. Of glTF and OBJ, which are none, the materials can be changed
/// (`material.NAME.lambert`, as an include does it), objects (`object.NAME.hidden`), and what stands at the top of a scene file (`ambient`).
///
/// # Errors
/// As [`load`]; and when a path leads nowhere or a value does not fit: the error names the override.
pub fn load_with(path: &Path, overrides: &[Override], options: &Options) -> Result<(Scene, Vec<Warning>), ImportError> {
    if overrides.is_empty() {
        return load(path, options);
    }
    reader(path)?;
    let resolver = Resolver::new(path, options);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return read_with(&resolver.read_main()?, overrides, &resolver);
    }
    let name = path.file_name().and_then(|n| n.to_str()).ok_or_else(|| ImportError::Unsupported {
        path: path.to_path_buf(),
        feature: "changing values of a file whose name is not UTF-8".into(),
        help: "give it another name".into(),
    })?;
    let text = format!("[include]\nfile = {}\n", toml::Value::from(name));
    let inside: Vec<Override> = overrides.iter().map(Override::inside_include).collect();
    read_with(text.as_bytes(), &inside, &resolver)
}

/// Reads a scene file from bytes as if they were the content of the file at `path`, with values replaced.
///
/// # Errors
/// As [`load_with`].
pub fn load_bytes_with(
    bytes: &[u8],
    path: &Path,
    overrides: &[Override],
    options: &Options,
) -> Result<(Scene, Vec<Warning>), ImportError> {
    read_with(bytes, overrides, &Resolver::new(path, options))
}

fn read_with(bytes: &[u8], overrides: &[Override], resolver: &Resolver) -> Result<(Scene, Vec<Warning>), ImportError> {
    let at = Location::file(resolver.path());
    let read = |overrides: &[Override]| match std::str::from_utf8(bytes) {
        Ok(text) if !overrides.is_empty() => {
            let text = scene_file::replace(text, overrides, &at)?;
            finish(scene_file::read, text.as_bytes(), resolver)
        }
        _ => finish(scene_file::read, bytes, resolver),
    };
    let error = match read(overrides) {
        Ok(done) => return Ok(done),
        Err(error) => error,
    };
    // Whose fault is it? The first that makes the file wrong; the file itself when it is wrong without any.
    read(&[])?;
    for n in 1..=overrides.len() {
        if let Err(ImportError::Invalid { at, message, help }) = read(&overrides[..n]) {
            return Err(ImportError::Invalid { at, message: format!("{}: {message}", overrides[n - 1].shortened()), help });
        }
    }
    Err(error)
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
        "stl" => Ok(stl::read),
        "vs3" => Ok(vs3::read),
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
