//! STL, text and binary: triangles and nothing else. Each `solid` is an object; a binary file is one.
//!
//! The format's normals are not read: the winding says the same, and says it exactly.

use std::collections::HashMap;

use super::{ImportError, Location, Resolver, Warnings};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Geometry, Instance, Mesh, MeshId, Quantity, Scene, Source, SourceContent};

/// Bytes before the triangles of a binary file, and of each.
const HEAD: usize = 84;
const TRIANGLE: usize = 50;

/// Bytes of memory that a byte of text or binary turns into, at most.
const GROWTH: u64 = 8;

/// Reads a file.
///
/// # Errors
/// When a binary file is shorter than it says, or a text holds something else than STL.
pub(super) fn read(bytes: &[u8], resolver: &Resolver, warnings: &mut Warnings) -> Result<Scene, ImportError> {
    let path = resolver.path();
    let (needed, allowed) = (bytes.len() as u64 * GROWTH, resolver.options().max_memory);
    if needed > allowed {
        return Err(ImportError::TooLarge { what: format!("the content of {}", path.display()), needed, allowed });
    }
    let says = bytes.get(80..HEAD).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]) as usize);
    let is_binary_length = says.and_then(|n| n.checked_mul(TRIANGLE)).and_then(|n| n.checked_add(HEAD)) == Some(bytes.len());
    let is_text = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && !is_binary_length;
    let solids = if is_text { text(bytes, resolver)? } else { vec![binary(bytes, says, resolver)?] };
    let mut scene = Scene { quantity: Quantity::Radiometric, ..Scene::default() };
    scene.sources.push(Source { path: path.into(), content: SourceContent::Other });
    for solid in solids.into_iter().filter(|solid| !solid.mesh.triangles.is_empty()) {
        scene.instances.push(Instance {
            name: solid.mesh.name.clone(),
            geometry: Geometry::Mesh(MeshId(scene.meshes.len() as u32)),
            transform: DAffine3::IDENTITY,
            material: None,
            node: None,
        });
        scene.meshes.push(solid.mesh);
    }
    if scene.instances.is_empty() {
        warnings.add("no-faces", path, "the file has no triangle: there is nothing to see");
    }
    Ok(scene)
}

/// A mesh whose vertices are found again by their bits.
#[derive(Default)]
struct Solid {
    mesh: Mesh,
    known: HashMap<[u64; 3], u32>,
}

impl Solid {
    fn named(name: &str) -> Self {
        let name = if name.is_empty() { "solid" } else { name };
        Self { mesh: Mesh { name: name.to_owned(), ..Mesh::default() }, known: HashMap::new() }
    }

    fn vertex(&mut self, p: DVec3) -> u32 {
        // (−0 is 0)
        let key = (p + DVec3::ZERO).to_array().map(f64::to_bits);
        *self.known.entry(key).or_insert_with(|| {
            self.mesh.positions.push(p);
            self.mesh.positions.len() as u32 - 1
        })
    }

    fn triangle(&mut self, corners: [DVec3; 3]) {
        let triangle = corners.map(|p| self.vertex(p));
        self.mesh.triangles.push(triangle);
    }
}

fn binary(bytes: &[u8], says: Option<usize>, resolver: &Resolver) -> Result<Solid, ImportError> {
    let at = || Location::file(resolver.path());
    let n = says.ok_or_else(|| ImportError::invalid(at(), format!("{} bytes are too few for a binary STL file", bytes.len())))?;
    let body = &bytes[HEAD..];
    if body.len() / TRIANGLE < n {
        let message = format!("it says that it has {n} triangles, and ends after {}", body.len() / TRIANGLE);
        return Err(ImportError::invalid_with_help(at(), message, "the file may have been cut off"));
    }
    let mut solid = Solid::named("");
    for triangle in body.chunks_exact(TRIANGLE).take(n) {
        let number = |k: usize| f32::from_le_bytes([triangle[k], triangle[k + 1], triangle[k + 2], triangle[k + 3]]);
        let corner = |k: usize| DVec3::from_array([0, 4, 8].map(|axis| f64::from(number(12 + 12 * k + axis))));
        let corners = [0, 1, 2].map(corner);
        if corners.iter().all(|p| p.is_finite()) {
            solid.triangle(corners);
        }
    }
    Ok(solid)
}

fn text(bytes: &[u8], resolver: &Resolver) -> Result<Vec<Solid>, ImportError> {
    let text = String::from_utf8_lossy(bytes);
    let mut solids: Vec<Solid> = Vec::new();
    let mut corners: Vec<DVec3> = Vec::new();
    for (line, content) in text.lines().enumerate() {
        let mut words = content.split_whitespace();
        let invalid = |message: String| {
            let line = Some((line as u32 + 1, 1));
            ImportError::invalid(Location { line, ..Location::file(resolver.path()) }, message)
        };
        match words.next().unwrap_or_default().to_ascii_lowercase().as_str() {
            "" | "endsolid" | "outer" | "endloop" => {}
            "solid" => solids.push(Solid::named(&words.collect::<Vec<_>>().join(" "))),
            "facet" => corners.clear(),
            "vertex" => {
                let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).filter(|x: &f64| x.is_finite()).collect();
                let [x, y, z] = numbers[..] else {
                    return Err(invalid(format!("{:?} is not a vertex of three numbers", content.trim())));
                };
                corners.push(DVec3::new(x, y, z));
            }
            "endfacet" => match (corners[..].try_into(), solids.last_mut()) {
                (Ok(corners), Some(solid)) => solid.triangle(corners),
                _ => return Err(invalid(format!("a facet has {} corners, not three", corners.len()))),
            },
            other => return Err(invalid(format!("{other:?} is not a word of STL"))),
        }
    }
    Ok(solids)
}
