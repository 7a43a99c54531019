//! View3D's input: surfaces of three or four vertices with names.
//!
//! ```text
//! ! comment
//! T title
//! F 3                                            vertices have three coordinates
//! V n x y z
//! S n v1 v2 v3 v4 base cmb emit name             v4 is 0 in a triangle
//! O n v1 v2 v3 v4 base cmb emit name             blocks, without factors of its own
//! C option …                                     how View3D is to work: left out
//! E
//! ```
//!
//! Counter-clockwise is the front. A surface that is combined with another (`cmb`) belongs to that one's object. Surfaces that lie in another (`base`) are
//! not cut out of it: a warning says so. Emittances become reflectances, `1 − emit`.

use std::collections::{BTreeMap, HashMap};

use super::{ImportError, Location, Resolver, Warnings};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Geometry, Instance, Material, MaterialId, Mesh, MeshId, Polygons, Quantity, Scene, Source, SourceContent};
use crate::spectrum::Spectrum;

/// Bytes of memory that a byte of text turns into, at most.
const GROWTH: u64 = 16;

/// One surface as it stands in the file.
struct Surface {
    number: u32,
    vertices: Vec<u32>,
    combined: u32,
    emittance: f64,
    name: String,
}

/// Reads a file.
///
/// # Errors
/// When a line is not what it should be, or a surface has a vertex that does not exist.
pub(super) fn read(bytes: &[u8], resolver: &Resolver, warnings: &mut Warnings) -> Result<Scene, ImportError> {
    let path = resolver.path();
    let (needed, allowed) = (bytes.len() as u64 * GROWTH, resolver.options().max_memory);
    if needed > allowed {
        return Err(ImportError::TooLarge { what: format!("the content of {}", path.display()), needed, allowed });
    }
    let text = String::from_utf8_lossy(bytes);
    let mut vertices: HashMap<u32, DVec3> = HashMap::new();
    let mut surfaces: Vec<Surface> = Vec::new();
    for (line, content) in text.lines().enumerate() {
        let invalid = |message: String| {
            let line = Some((line as u32 + 1, 1));
            ImportError::invalid(Location { line, ..Location::file(path) }, message)
        };
        let content = content.split('!').next().unwrap_or_default();
        let words: Vec<&str> = content.split_whitespace().collect();
        let Some((&kind, rest)) = words.split_first() else { continue };
        match kind.chars().next().map(|c| c.to_ascii_uppercase()) {
            Some('F') if rest.first() == Some(&"2") || kind.eq_ignore_ascii_case("F2") => {
                return Err(invalid("it describes two dimensions; only three (F 3) can be read".into()));
            }
            Some('E') => break,
            Some('V') => {
                let number = rest.first().and_then(|n| n.parse::<u32>().ok());
                let x: Vec<f64> = rest.iter().skip(1).map_while(|w| w.parse().ok()).filter(|x: &f64| x.is_finite()).collect();
                let (Some(number), [x, y, z]) = (number, &x[..]) else {
                    return Err(invalid(format!("{:?} is not a vertex: V n x y z", content.trim())));
                };
                vertices.insert(number, DVec3::new(*x, *y, *z));
            }
            Some('S' | 'O') => {
                let whole: Vec<u32> = rest.iter().take(7).map_while(|w| w.parse().ok()).collect();
                let [number, corners @ .., base, combined] = &whole[..] else {
                    return Err(invalid(format!("{:?} is not a surface: S n v1 v2 v3 v4 base cmb emit name", content.trim())));
                };
                if whole.len() < 7 {
                    return Err(invalid(format!("a surface has {} whole numbers, not seven", whole.len())));
                }
                let corners: Vec<u32> = corners.iter().copied().filter(|&v| v != 0).collect();
                if let Some(missing) = corners.iter().find(|v| !vertices.contains_key(v)) {
                    return Err(invalid(format!("surface {number} has vertex {missing}, which does not exist")));
                }
                if corners.len() < 3 {
                    return Err(invalid(format!("surface {number} has fewer than three vertices")));
                }
                if *base != 0 {
                    let message = "surfaces that lie in others (base) are not cut out of them";
                    warnings.add("vs3-base", path, message);
                }
                if kind.eq_ignore_ascii_case("O") {
                    warnings.add("vs3-obstruction", path, "surfaces that only block (O) have factors here, too");
                }
                let emittance = rest.get(7).and_then(|w| w.parse().ok()).filter(|e| (0.0..=1.0).contains(e)).unwrap_or(1.0);
                let name = rest.get(8..).filter(|words| !words.is_empty()).map(|words| words.join(" "));
                let name = name.unwrap_or_else(|| number.to_string());
                surfaces.push(Surface { number: *number, vertices: corners, combined: *combined, emittance, name });
            }
            _ => {}
        }
    }
    Ok(scene(&surfaces, &vertices, resolver, warnings))
}

/// One object for each name, or for each surface others are combined with.
fn scene(surfaces: &[Surface], vertices: &HashMap<u32, DVec3>, resolver: &Resolver, warnings: &mut Warnings) -> Scene {
    let mut scene = Scene { quantity: Quantity::Radiometric, ..Scene::default() };
    scene.sources.push(Source { path: resolver.path().into(), content: SourceContent::Other });
    let names: HashMap<u32, &str> = surfaces.iter().map(|s| (s.number, s.name.as_str())).collect();
    let mut objects: HashMap<&str, usize> = HashMap::new();
    let mut materials: BTreeMap<u64, MaterialId> = BTreeMap::new();
    for surface in surfaces {
        let name = names.get(&surface.combined).copied().unwrap_or(&surface.name);
        let object = *objects.entry(name).or_insert_with(|| {
            scene.instances.push(Instance {
                name: name.to_owned(),
                geometry: Geometry::Mesh(MeshId(scene.meshes.len() as u32)),
                transform: DAffine3::IDENTITY,
                material: None,
                node: None,
            });
            let polygons = Some(Polygons { offsets: vec![0], ..Polygons::default() });
            scene.meshes.push(Mesh { name: name.to_owned(), polygons, ..Mesh::default() });
            scene.meshes.len() - 1
        });
        let material = *materials.entry(surface.emittance.to_bits()).or_insert_with(|| {
            let reflectance = Spectrum::gray((1.0 - surface.emittance) as f32);
            scene.materials.push(Material::lambert(format!("emittance {}", surface.emittance), reflectance));
            MaterialId(scene.materials.len() as u32 - 1)
        });
        let mesh = &mut scene.meshes[object];
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(surface.vertices.iter().map(|v| vertices[v]));
        let n = surface.vertices.len() as u32;
        if let Some(polygons) = &mut mesh.polygons {
            let polygon = polygons.offsets.len() as u32 - 1;
            polygons.vertices.extend(first..first + n);
            polygons.offsets.push(polygons.vertices.len() as u32);
            for i in 2..n {
                mesh.triangles.push([first, first + i - 1, first + i]);
                mesh.materials.push(Some(material));
                polygons.of_triangle.push(polygon);
            }
        }
    }
    if scene.instances.is_empty() {
        warnings.add("no-faces", resolver.path(), "the file has no surface: there is nothing to see");
    }
    scene
}
