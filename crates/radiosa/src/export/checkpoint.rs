//! Pictures in the making, in files: what is needed to go on to the same bits.
//!
//! ```text
//! "RADPICT\0"  version, zstd frame              container
//!     scene       u128                           hash of all that decides about its light
//!     settings    text                           those of the picture that decide about its bits
//!     state                                      raytrace::progressive
//! ```

use std::io;
use std::path::{Path, PathBuf};

use super::container::{self, Kind, damaged};
use super::solution::fingerprint;
use super::target::ExportError;
use crate::raytrace::progressive::ProgressiveRender;
use crate::scene::Scene;
use crate::stream::In;
use crate::transport::Integrator;

const KIND: Kind = Kind { magic: b"RADPICT\0", version: 2, name: "picture in the making" };

/// Where the checkpoint of a picture goes: beside it, under its name.
pub fn path_of(picture: &Path) -> PathBuf {
    let mut name = picture.as_os_str().to_owned();
    name.push(".checkpoint");
    name.into()
}

/// Writes how far a picture of a scene is. `settings` are all that decide about its bits, in words.
///
/// # Errors
/// When the file cannot be written.
pub fn write<I: Integrator>(
    path: &Path,
    scene: &Scene,
    settings: &str,
    render: &ProgressiveRender<'_, I>,
) -> Result<(), ExportError> {
    container::write(path, &KIND, |out| {
        container::write_origin(out, fingerprint(scene), settings)?;
        render.store(out)
    })
}

/// Goes on from what [`write`] wrote of the same picture.
///
/// # Errors
/// When the file cannot be read, is damaged, or of another scene or other settings.
pub fn resume<I: Integrator>(
    path: &Path,
    scene: &Scene,
    settings: &str,
    render: &mut ProgressiveRender<'_, I>,
    max_memory: u64,
) -> Result<(), ExportError> {
    let mut body = container::open(path, &KIND, max_memory)?;
    let mut input = In(&mut body);
    let others = [
        "it is of another scene, or the scene has changed since",
        "it is of a picture with other settings: only --time, --threads, --save-every and the value of --noise or, without --noise, of --spp may differ to go on",
    ];
    container::check_origin(&mut input, path, (fingerprint(scene), settings), others)?;
    render.restore(&mut input).map_err(|e| damaged(path, &e))?;
    // The checksum stands behind the state.
    io::copy(&mut body, &mut io::sink()).map_err(|e| damaged(path, &e))?;
    Ok(())
}
