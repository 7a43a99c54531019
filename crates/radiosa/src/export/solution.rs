//! Radiosity solutions in files (`.radiosa`): the light of a scene, finished or on its way.
//!
//! ```text
//! "RADIOSA\0"  version (u32)                     little-endian, as everything
//! zstd frame with checksum:
//!     recipe            pairs of key and text     how it was made
//!     scene             u128                      hash of all that decides about its light
//!     settings          text                      those that decide about the result, and the processor's kernels
//!     mesh, system, radiosities, history          radiosity::Solution
//!     0 or 1            u64                       whether a solver's state follows, to go on from
//!     state                                       radiosity::Progress
//! ```
//!
//! The scene itself is not inside: whoever reads the light brings it, and the hash tells whether it is the same.

use std::fmt::Write as _;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use xxhash_rust::xxh3::Xxh3;

use super::container::{self, Kind, damaged, unreadable};
use super::image::Recipe;
use super::target::{ExportError, check_ending};
use crate::radiosity::solve::Stop;
use crate::radiosity::{Division, Progress, Settings, Solution};
use crate::scene::{Pixels, Scene};
use crate::stream::In;
use crate::transport::World;

const KIND: Kind = Kind { magic: b"RADIOSA\0", version: 3, name: "radiosity solution" };
/// What an element takes in memory, with its columns.
pub const BYTES_AN_ELEMENT: u64 = 600;
/// Bytes for [`open`] alone: a recipe is small, and a file that is not is none of ours.
pub const HEAD: u64 = 64 << 20;

/// An error when the ending of `path` is another one, or no file can be put there.
///
/// # Errors
/// As said.
pub fn check_target(path: &Path) -> Result<(), ExportError> {
    check_ending(path, &["radiosa"])
}

/// A solution, and what a solver needs to go on with it.
#[derive(Clone, Copy, Debug)]
pub struct State<'a> {
    /// What is known.
    pub solution: &'a Solution,
    /// `None` when nobody is to go on.
    pub progress: Option<&'a Progress>,
}

/// Writes a solution of `world` by `settings`.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, recipe: &Recipe, world: &World, settings: &Settings, state: State) -> Result<(), ExportError> {
    container::write(path, &KIND, |out| {
        out.number(recipe.entries().len() as u64)?;
        for (key, text) in recipe.entries() {
            out.array(key.as_bytes())?;
            out.array(text.as_bytes())?;
        }
        out.array(&fingerprint(world.scene()).to_le_bytes())?;
        out.array(described(settings, world).as_bytes())?;
        state.solution.store(out)?;
        out.number(u64::from(state.progress.is_some()))?;
        state.progress.map_or(Ok(()), |progress| progress.store(out))
    })
}

/// A file that was opened: what it says of itself has been read.
pub struct Saved {
    path: PathBuf,
    recipe: Recipe,
    scene: u128,
    settings: String,
    body: Box<dyn Read>,
    max_memory: u64,
}

impl std::fmt::Debug for Saved {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Saved").field("path", &self.path).field("recipe", &self.recipe).finish_non_exhaustive()
    }
}

/// Opens a file; at most `max_memory` bytes of content are read.
///
/// # Errors
/// When it cannot be read, is no such file, or of another version.
pub fn open(path: &Path, max_memory: u64) -> Result<Saved, ExportError> {
    let mut body = container::open(path, &KIND, max_memory)?;
    let mut start = || -> io::Result<(Recipe, u128, String)> {
        let mut input = In(&mut body);
        let mut recipe = Recipe::new();
        for _ in 0..input.number()?.min(1000) {
            let key = container::text(&mut input)?;
            recipe.set(&key, container::text(&mut input)?);
        }
        let scene: Vec<u8> = input.array(16)?;
        let scene = scene.try_into().map(u128::from_le_bytes).unwrap_or_default();
        Ok((recipe, scene, container::text(&mut input)?))
    };
    let (recipe, scene, settings) = start().map_err(|e| damaged(path, &e))?;
    Ok(Saved { path: path.to_path_buf(), recipe, scene, settings, body, max_memory })
}

impl Saved {
    /// How it was made.
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// The solution, for the scene it was made of.
    ///
    /// # Errors
    /// When the scene is another one, or the file is damaged.
    pub fn into_solution(mut self, world: &World) -> Result<Solution, ExportError> {
        self.check_scene(world)?;
        let solution = self.solution(world)?;
        // The checksum stands behind the state.
        io::copy(&mut self.body, &mut io::sink()).map_err(|e| damaged(&self.path, &e))?;
        Ok(solution)
    }

    /// All that is needed to go on with the same settings, but perhaps to another end.
    ///
    /// # Errors
    /// When the scene or the settings are others, or the file is damaged.
    pub fn to_resume(
        mut self,
        world: &World,
        settings: &Settings,
    ) -> Result<(Division, Solution, Option<Progress>), ExportError> {
        self.check_scene(world)?;
        if self.settings != described(settings, world) {
            let why = "it was solved with other settings or kernels (--cpu-path): only --residual, --change, --unshot, --error, --steps, --time may differ to go on";
            return Err(unreadable(&self.path, why));
        }
        let solution = self.solution(world)?;
        let division = Division::of(solution.mesh.clone(), &settings.solver);
        let mut input = In(&mut self.body);
        let mut rest = || -> io::Result<Option<Progress>> {
            let progress = match input.number()? {
                0 => None,
                _ => Some(Progress::restore(&division, settings, &solution.system, &mut input)?),
            };
            io::copy(&mut input.0, &mut io::sink())?;
            Ok(progress)
        };
        let progress = rest().map_err(|e| damaged(&self.path, &e))?;
        Ok((division, solution, progress))
    }

    fn check_scene(&self, world: &World) -> Result<(), ExportError> {
        if self.scene == fingerprint(world.scene()) {
            Ok(())
        } else {
            Err(unreadable(&self.path, "it is of another scene, or the scene has changed since"))
        }
    }

    fn solution(&mut self, world: &World) -> Result<Solution, ExportError> {
        Solution::restore(world, self.max_memory / BYTES_AN_ELEMENT, &mut In(&mut self.body)).map_err(|e| damaged(&self.path, &e))
    }
}

/// Everything that decides about the result, but for when to stop.
pub(super) fn described(settings: &Settings, world: &World) -> String {
    let settings = Settings { stop: Stop::default(), ..settings.clone() };
    format!("{settings:?}, {}", world.cpu_path())
}

/// A hash of everything in a scene that decides about its light.
pub fn fingerprint(scene: &Scene) -> u128 {
    struct Hasher(Xxh3);
    impl std::fmt::Write for Hasher {
        fn write_str(&mut self, text: &str) -> std::fmt::Result {
            self.0.update(text.as_bytes());
            Ok(())
        }
    }
    let mut hasher = Hasher(Xxh3::new());
    // Writing to a hash cannot fail. Numbers are written so that no two look alike.
    let Scene { quantity, instances, materials, textures, lights, environment, .. } = scene;
    let _ = write!(hasher, "{quantity:?}{instances:?}{materials:?}{textures:?}{lights:?}{environment:?}");
    for image in &scene.images {
        let _ = write!(hasher, "{} {}", image.width, image.height);
        match &image.pixels {
            Pixels::Rgba8(p) => hasher.0.update(bytemuck::cast_slice(p)),
            Pixels::Rgba16(p) => hasher.0.update(bytemuck::cast_slice(p)),
            Pixels::Rgba32F(p) => hasher.0.update(bytemuck::cast_slice(p)),
        }
    }
    for mesh in &scene.meshes {
        for p in &mesh.positions {
            p.to_array().iter().for_each(|x| hasher.0.update(&x.to_le_bytes()));
        }
        hasher.0.update(bytemuck::cast_slice(&mesh.triangles));
        let crate::scene::Mesh { normals, tangents, uvs, colors, materials, polygons, .. } = mesh;
        let _ = write!(hasher, "{normals:?}{tangents:?}{uvs:?}{colors:?}{materials:?}{polygons:?}");
    }
    hasher.0.digest128()
}
