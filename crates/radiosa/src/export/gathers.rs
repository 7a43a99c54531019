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

use super::container::{self, Kind, damaged};
use super::solution::{BYTES_AN_ELEMENT, described, fingerprint};
use super::target::{ExportError, check_ending};
use crate::hybrid::{self, Kept};
use crate::radiosity::{Settings, Solution};
use crate::stream::In;
use crate::transport::World;

/// What a gather takes in memory, in the cache and its tree.
const BYTES_A_GATHER: u64 = 500;

const KIND: Kind = Kind { magic: b"RADGATHR", version: 2, name: "file of gathers" };

/// An error when the ending of `path` is another one, or no file can be put there.
///
/// # Errors
/// As said.
pub fn check_target(path: &Path) -> Result<(), ExportError> {
    check_ending(path, &["gathers"])
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
        // (Mirrors show the background to gathers; solutions do not know it.)
        format!("{}, {rays} {cache} {seed} {:?}", described(self.radiosity, world), world.scene().background)
    }
}

/// Writes what was found of the light of `world`.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, world: &World, by: MadeBy, solution: &Solution, kept: &Kept) -> Result<(), ExportError> {
    container::write(path, &KIND, |out| {
        container::write_origin(out, fingerprint(world.scene()), &by.described(world))?;
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
    let others = [
        "it is of another scene, or the scene has changed since: remove it, or name another file",
        "its gathers were made with other options (--gather, --cache, --seed, --cpu-path, --background, or those of radiosity): remove it, or name another file",
    ];
    container::check_origin(&mut input, path, (fingerprint(world.scene()), &by.described(world)), others)?;
    let mut rest = || -> io::Result<(Solution, Kept)> {
        let found = (
            Solution::restore(world, max_memory / BYTES_AN_ELEMENT, &mut input)?,
            Kept::restore(max_memory / BYTES_A_GATHER, &mut input)?,
        );
        // The checksum stands at the end.
        io::copy(&mut input.0, &mut io::sink())?;
        Ok(found)
    };
    rest().map_err(|e| damaged(path, &e))
}
