//! What the hybrid gathered for a view, in files (`.gathers`) that further views of the same light begin with.
//!
//! ```text
//! "RADGATHR"  version (u32)                      little-endian, as everything
//! zstd frame with checksum:
//!     scene             u128                      hash of all that decides about its light
//!     settings          text                      those that decide about its elements and gathers, and the processor's kernels
//!     mesh, system, ... radiosity::Solution
//!     light, gathers    hybrid::Kept
//! ```

use std::io;
use std::path::Path;

use super::container::{self, Kind, damaged, unreadable};
use super::solution::{BYTES_AN_ELEMENT, described, fingerprint};
use super::target::{ExportError, check_writable};
use crate::hybrid::{self, Kept};
use crate::radiosity::{Settings, Solution};
use crate::stream::In;
use crate::transport::World;

const KIND: Kind = Kind { magic: b"RADGATHR", version: 1, name: "file of gathers" };

/// An error when the ending of `path` is another one, or no file can be put there.
///
/// # Errors
/// As said.
pub fn check_target(path: &Path) -> Result<(), ExportError> {
    if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("gathers")) {
        return Err(ExportError::UnknownEnding { path: path.to_path_buf(), known: &["gathers"] });
    }
    check_writable(path)
}

/// By what gathers were made: how surfaces were divided and solved, and how the hybrid gathers from there.
#[derive(Clone, Copy, Debug)]
pub struct MadeBy<'a> {
    /// Of the elements.
    pub radiosity: &'a Settings,
    /// Of the gathers.
    pub hybrid: &'a hybrid::Settings,
}

impl MadeBy<'_> {
    /// Everything that decides about gathers, but for the view.
    fn described(&self, world: &World) -> String {
        let hybrid::Settings { rays, cache, seed, .. } = self.hybrid;
        format!("{}, {rays} {cache} {seed}", described(self.radiosity, world))
    }
}

/// Writes what was found of the light of `world`.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, world: &World, by: MadeBy, solution: &Solution, kept: &Kept) -> Result<(), ExportError> {
    container::write(path, &KIND, |out| {
        out.array(&fingerprint(world.scene()).to_le_bytes())?;
        out.array(by.described(world).as_bytes())?;
        solution.store(out)?;
        kept.store(out)
    })
}

/// Reads what [`write`] wrote of the same scene by the same settings; at most `max_memory` bytes.
///
/// # Errors
/// When it cannot be read, is damaged, or of another scene or other settings.
pub fn read(path: &Path, world: &World, by: MadeBy, max_memory: u64) -> Result<(Solution, Kept), ExportError> {
    let mut body = container::open(path, &KIND, max_memory)?;
    let mut input = In(&mut body);
    let start: io::Result<_> = input.array::<u8>(16).and_then(|scene| Ok((scene, container::text(&mut input)?)));
    let (of_scene, settings) = start.map_err(|e| damaged(path, &e))?;
    if of_scene != fingerprint(world.scene()).to_le_bytes() {
        return Err(unreadable(path, "it is of another scene, or the scene has changed since: remove it, or name another file"));
    }
    if settings != by.described(world) {
        let why = "its gathers were made with other options (--gather, --cache, --seed, --cpu-path, or those of radiosity): remove it, or name another file";
        return Err(unreadable(path, why));
    }
    let mut rest = || -> io::Result<(Solution, Kept)> {
        let found = (Solution::restore(world, max_memory / BYTES_AN_ELEMENT, &mut input)?, Kept::restore(&mut input)?);
        // The checksum stands at the end.
        io::copy(&mut input.0, &mut io::sink())?;
        Ok(found)
    };
    rest().map_err(|e| damaged(path, &e))
}
