//! Solutions as meshes with light at their vertices: glTF (`.glb`, `.gltf`) and PLY.
//!
//! | | glTF | PLY |
//! |---|---|---|
//! | positions | the scene's: metres, y up | the source file's own coordinates |
//! | colours | `COLOR_0`: radiance times exposure, linear, cut off at 1; unlit | `red green blue`: the same, not cut off |
//! | quantities | `_IRRADIANCE`, `_RADIOSITY` | `irradiance_r` … `radiosity_b` |
//!
//! All numbers are 32-bit floats. The elements of a surface make one mesh; each is a quadrilateral (cut into two triangles) or a triangle that faces the side whose light
//! it carries.

mod gltf;
mod ply;

use std::collections::HashMap;
use std::path::Path;

use super::target::{ExportError, check_writable, write_atomically};
use crate::film::tone_map;
use crate::math::{DVec3, Vec3};
use crate::radiosity::{Solution, display};
use crate::spectrum::Spectrum;
use crate::transport::World;

/// A kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Binary glTF.
    Glb,
    /// glTF with its buffer inside.
    Gltf,
    /// Binary PLY.
    Ply,
}

impl Format {
    fn of(path: &Path) -> Result<Self, ExportError> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("glb") => Ok(Self::Glb),
            Some("gltf") => Ok(Self::Gltf),
            Some("ply") => Ok(Self::Ply),
            _ => Err(ExportError::UnknownEnding { path: path.to_path_buf(), known: &["glb", "gltf", "ply"] }),
        }
    }
}

/// Finds out whether a mesh can be written to `path`.
///
/// # Errors
/// When the ending is unknown or the folder does not let us write.
pub fn check_target(path: &Path) -> Result<Format, ExportError> {
    let format = Format::of(path)?;
    check_writable(path)?;
    Ok(format)
}

/// A vertex and its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Scene coordinates.
    pub position: DVec3,
    /// Unit, on the side that carries the light.
    pub normal: Vec3,
    /// H, W/m² or lux.
    pub irradiance: Spectrum,
    /// B = E + ρ H, W/m² or lm/m².
    pub radiosity: Spectrum,
}

impl Vertex {
    /// Equal bits, equal vertex.
    fn key(&self) -> [u64; 12] {
        let mut key = [0; 12];
        for (k, x) in self.position.to_array().into_iter().enumerate() {
            key[k] = x.to_bits();
        }
        let floats = [self.normal.to_array(), self.irradiance.to_array(), self.radiosity.to_array()];
        for (k, x) in floats.into_iter().flatten().enumerate() {
            key[3 + k] = u64::from(x.to_bits());
        }
        key
    }
}

/// The elements of one surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LitSurface {
    /// The instance's name; may be empty.
    pub name: String,
    /// Shared by triangles where everything about them is the same.
    pub vertices: Vec<Vertex>,
    /// Counter-clockwise seen from the side that carries the light.
    pub triangles: Vec<[u32; 3]>,
}

/// All elements of a solution with the light at their corners.
#[derive(Clone, Debug)]
pub struct LitMesh<'a> {
    world: &'a World,
    /// In the order of instances; those without elements are left out.
    pub surfaces: Vec<LitSurface>,
    /// What radiances are multiplied by to be colours.
    pub exposure: f32,
}

impl<'a> LitMesh<'a> {
    /// The elements of `solution`; without an exposure it is chosen as for pictures ([`tone_map::automatic_exposure_of`]).
    pub fn new(world: &'a World, solution: &Solution, exposure: Option<f32>) -> Self {
        let corners = display::corner_values(world, &solution.mesh, &solution.irradiance);
        let mut surfaces: Vec<LitSurface> = world
            .scene()
            .instances
            .iter()
            .map(|instance| LitSurface { name: instance.name.clone(), ..LitSurface::default() })
            .collect();
        let mut known = HashMap::new();
        let mut at = u32::MAX;
        let rgb = |v: [f64; 3]| Spectrum::from(v.map(|v| v as f32));
        for (i, element) in solution.mesh.elements().iter().enumerate() {
            let instance = solution.mesh.patches()[element.patch as usize].instance;
            if !element.normal.is_finite() {
                continue;
            }
            // Vertices are shared within a surface; patches come in the order of instances.
            if std::mem::replace(&mut at, instance.0) != instance.0 {
                known.clear();
            }
            let surface = &mut surfaces[instance.index()];
            let (emission, reflectance) = (rgb(solution.system.emission[i]), rgb(solution.system.reflectance[i]));
            let mut index = [0; 4];
            for (k, (corner, irradiance)) in element.corners().iter().zip(corners[i]).enumerate() {
                let position = *corner + world.origin();
                let normal = element.normal.as_vec3();
                let vertex = Vertex { position, normal, irradiance, radiosity: emission + reflectance * irradiance };
                index[k] = *known.entry(vertex.key()).or_insert_with(|| {
                    surface.vertices.push(vertex);
                    surface.vertices.len() as u32 - 1
                });
            }
            surface.triangles.push([index[0], index[1], index[2]]);
            if element.corners().len() == 4 {
                surface.triangles.push([index[0], index[2], index[3]]);
            }
        }
        surfaces.retain(|surface| !surface.triangles.is_empty());
        let exposure = exposure.unwrap_or_else(|| {
            let vertices = surfaces.iter().flat_map(|s| &s.vertices);
            tone_map::automatic_exposure_of(vertices.map(|v| v.radiosity.luminance() * std::f32::consts::FRAC_1_PI).collect())
        });
        Self { world, surfaces, exposure }
    }

    /// What a screen should show at a vertex, linear.
    pub fn color(&self, vertex: &Vertex) -> Spectrum {
        vertex.radiosity * (self.exposure * std::f32::consts::FRAC_1_PI)
    }
}

/// Writes a mesh in the format the ending says. `path` holds the whole file or what it held before.
///
/// # Errors
/// When the ending is unknown or the file cannot be written.
pub fn write(mesh: &LitMesh, path: &Path) -> Result<(), ExportError> {
    match Format::of(path)? {
        Format::Glb => write_atomically(path, |file| gltf::write_glb(mesh, file)),
        Format::Gltf => write_atomically(path, |file| gltf::write_gltf(mesh, file)),
        Format::Ply => write_atomically(path, |file| ply::write(mesh, file)),
    }
}
