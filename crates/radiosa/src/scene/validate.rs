//! What a scene must fulfil before a `World` can be built from it.

use thiserror::Error;

use super::{Geometry, Scene, TextureSource};

/// Why a scene is refused. Importers only build scenes that pass; builder code learns here what it got wrong.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SceneError {
    /// An index points outside its vector.
    #[error("{what} refers to {kind} {index}, but the scene has only {count}")]
    OutOfRange {
        /// What holds the index.
        what: String,
        /// What it points to.
        kind: &'static str,
        /// The index.
        index: u64,
        /// The length of the vector.
        count: u64,
    },
    /// Two columns of a mesh differ in length.
    #[error("mesh {mesh} ({name:?}): its column of {column} has {len} entries where {expected} are needed")]
    ColumnLength {
        /// Index of the mesh.
        mesh: u32,
        /// Its name.
        name: String,
        /// Which column.
        column: &'static str,
        /// What it has.
        len: u64,
        /// What it needs.
        expected: u64,
    },
    /// A number that must be finite is not.
    #[error("{what} is not finite")]
    NotFinite {
        /// Which.
        what: String,
    },
    /// Too wide for the arithmetic of light transport.
    #[error(
        "the scene is {extent:e} m wide; at most {limit:e} m can be handled: look for a vertex or a transform gone wrong, or set the scale"
    )]
    TooWide {
        /// Its largest side, metres.
        extent: f64,
        /// The limit, metres.
        limit: f64,
    },
    /// More triangles than ray queries can number.
    #[error("the scene places {count} primitives; at most {limit} can be handled")]
    TooLarge {
        /// What it has.
        count: u64,
        /// The limit.
        limit: u64,
    },
}

impl Scene {
    /// The largest number of placed primitives.
    pub const MAX_PRIMITIVES: u64 = 1 << 30;

    /// Checks every index, length and number that later stages rely on.
    ///
    /// # Errors
    /// The first thing found wrong. Vertices that are not finite are allowed only where no face uses them.
    pub fn validate(&self) -> Result<(), SceneError> {
        let inside = |what: &dyn Fn() -> String, kind, index: usize, count: usize| {
            if index < count {
                Ok(())
            } else {
                Err(SceneError::OutOfRange { what: what(), kind, index: index as u64, count: count as u64 })
            }
        };
        for (m, mesh) in self.meshes.iter().enumerate() {
            let n = mesh.positions.len();
            let column = |column, len: Option<usize>, expected: usize| match len {
                Some(len) if len != expected => Err(SceneError::ColumnLength {
                    mesh: m as u32,
                    name: mesh.name.clone(),
                    column,
                    len: len as u64,
                    expected: expected as u64,
                }),
                _ => Ok(()),
            };
            column("normals", mesh.normals.as_ref().map(Vec::len), n)?;
            column("tangents", mesh.tangents.as_ref().map(Vec::len), n)?;
            column("colours", mesh.colors.as_ref().map(Vec::len), n)?;
            for set in &mesh.uvs {
                column("texture coordinates", Some(set.len()), n)?;
            }
            if mesh.materials.len() > 1 {
                column("materials", Some(mesh.materials.len()), mesh.triangles.len())?;
            }
            for material in mesh.materials.iter().flatten() {
                inside(&|| format!("mesh {m} ({:?})", mesh.name), "material", material.index(), self.materials.len())?;
            }
            for (t, &i) in mesh.triangles.iter().enumerate().flat_map(|(t, tri)| tri.iter().map(move |i| (t, i))) {
                inside(&|| format!("triangle {t} of mesh {m} ({:?})", mesh.name), "vertex", i as usize, n)?;
                if !mesh.positions[i as usize].is_finite() {
                    return Err(SceneError::NotFinite { what: format!("vertex {i} of mesh {m} ({:?})", mesh.name) });
                }
            }
            if let Some(polygons) = &mesh.polygons {
                column("polygons of triangles", Some(polygons.of_triangle.len()), mesh.triangles.len())?;
                let n_polygons = polygons.offsets.len().saturating_sub(1);
                for &p in &polygons.of_triangle {
                    inside(&|| format!("a triangle of mesh {m} ({:?})", mesh.name), "polygon", p as usize, n_polygons)?;
                }
                for &v in &polygons.vertices {
                    inside(&|| format!("a polygon of mesh {m} ({:?})", mesh.name), "vertex", v as usize, n)?;
                }
            }
        }
        for (i, instance) in self.instances.iter().enumerate() {
            let what = || format!("instance {i} ({:?})", instance.name);
            if let Geometry::Mesh(mesh) = instance.geometry {
                inside(&what, "mesh", mesh.index(), self.meshes.len())?;
            }
            if let Some(material) = instance.material {
                inside(&what, "material", material.index(), self.materials.len())?;
            }
            if let Some(node) = instance.node {
                inside(&what, "node", node.index(), self.nodes.len())?;
            }
            if !instance.transform.is_finite() {
                return Err(SceneError::NotFinite { what: format!("the transform of {}", what()) });
            }
        }
        for (t, texture) in self.textures.iter().enumerate() {
            if let TextureSource::Image(image) = texture.source {
                inside(&|| format!("texture {t}"), "image", image.index(), self.images.len())?;
            }
        }
        if let Some(super::EnvironmentRadiance::Map(image)) = self.environment.as_ref().map(|e| e.radiance) {
            inside(&|| "the environment".into(), "image", image.index(), self.images.len())?;
        }
        let count = self.n_primitives();
        if count > Self::MAX_PRIMITIVES {
            return Err(SceneError::TooLarge { count, limit: Self::MAX_PRIMITIVES });
        }
        Ok(())
    }
}
