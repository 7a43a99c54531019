//! `diffuse_room SCENE OUTPUT.toml LIGHT [PATH=VALUE…]`: a scene as a plain scene file in which everything is perfectly matt, so that other programs can be given the same room.
//!
//! - Every surface is Lambertian: its diffuse or base colour, averaged over its texture, plus what a mirror reflects; metals without a diffuse part reflect 0.5; nothing
//!   reflects more than 0.85. What light passes through (glass, blended alpha) is left out; masks are whole; vertex colours are ignored.
//! - Geometry is meshes with flat faces, one for each instance and material, and spheres; discs have 24 corners. Convex quadrilaterals stay whole; what is
//!   less than 10 µm high is left out.
//! - Emission leaves fronts only: what emits on both sides gets a second skin half a millimetre behind the first.
//! - Points, spots and suns are physical; soft cones become hard ones halfway. A constant environment and the first camera stay.
//!
//! All light is multiplied by LIGHT; PATH=VALUE replaces values of the scene, as `--set` does.

use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::Path;

use radiosa::bsdf::texture::sample;
use radiosa::import::{self, Options, Override};
use radiosa::math::polygon::area_vector;
use radiosa::math::{DAffine3, DVec3, Vec2};
use radiosa::scene::{
    AlphaMode, ColorMap, Cone, EnvironmentRadiance, Geometry, Instance, InstanceId, Light, LightKind, Material, MaterialId, Mesh,
    Model, PhotometricUnit, Projection, Scene, TextureRef,
};
use radiosa::spectrum::Spectrum;

const BRIGHTEST: f32 = 0.85;
const METAL: Spectrum = Spectrum::gray(0.5);
/// From a skin to that on its back, metres.
const SKIN: f64 = 5e-4;
const CORNERS: u32 = 24;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [from, to, light, changes @ ..] = &args[..] else {
        return Err("wanted: SCENE OUTPUT.toml LIGHT [PATH=VALUE…]".into());
    };
    let changes = changes.iter().map(|change| change.parse()).collect::<Result<Vec<Override>, _>>()?;
    let (scene, _) = import::load_with(Path::new(from), &changes, &Options::default())?;
    std::fs::write(to, Room { scene: &scene, light: light.parse()?, text: String::new() }.write()?)?;
    Ok(())
}

struct Room<'a> {
    scene: &'a Scene,
    /// Multiplies all light.
    light: f32,
    text: String,
}

/// Faces of one material, by corners.
#[derive(Default)]
struct Faces {
    positions: Vec<DVec3>,
    faces: Vec<Vec<u32>>,
}

type Done = Result<(), Box<dyn Error>>;

impl Room<'_> {
    fn write(mut self) -> Result<String, Box<dyn Error>> {
        writeln!(self.text, "about = \"{}, everything matt\"\n", self.scene.name)?;
        self.camera()?;
        self.environment()?;
        for (k, light) in self.scene.lights.iter().enumerate() {
            self.light(k, light)?;
        }
        let default = Material::default();
        for (k, material) in self.scene.materials.iter().chain([&default]).enumerate() {
            self.material(k, material)?;
        }
        for (k, instance) in self.scene.instances.iter().enumerate() {
            self.instance(InstanceId(k as u32), instance)?;
        }
        Ok(self.text)
    }

    fn camera(&mut self) -> Done {
        let camera = self.scene.cameras.first().ok_or("the scene has no camera")?;
        let Projection::Perspective { fov_y } = camera.projection else {
            return Err("the first camera is no perspective one".into());
        };
        let ahead = camera.position + camera.forward();
        let (position, look_at) = (triple(camera.position), triple(ahead));
        writeln!(self.text, "[camera.main]\nposition = {position}\nlook_at = {look_at}\nfov_y = {}\n", fov_y.to_degrees())?;
        Ok(())
    }

    fn environment(&mut self) -> Done {
        let Some(environment) = &self.scene.environment else {
            return Ok(());
        };
        if environment.radiance != EnvironmentRadiance::Constant {
            return Err("the environment is a map".into());
        }
        writeln!(self.text, "[environment]\nradiance = {}\n", color(environment.scale * self.light))?;
        Ok(())
    }

    fn light(&mut self, k: usize, light: &Light) -> Done {
        let (place, unit) = match &light.kind {
            LightKind::Ambient => return Ok(()),
            LightKind::Point { position, unit, .. } => (format!("point = {}", triple(*position)), *unit),
            LightKind::Distant { to_light, unit } => (format!("distant = {{ to_light = {} }}", triple(*to_light)), *unit),
            LightKind::Spot { position, axis, cone, unit, .. } => {
                let cutoff = match *cone {
                    Cone::Classic { cutoff, .. } => cutoff,
                    Cone::Gltf { inner, outer } => 0.5 * (inner + outer),
                };
                let (at, to, cutoff) = (triple(*position), triple(*position + *axis), cutoff.to_degrees());
                (format!("spot = {{ position = {at}, look_at = {to}, cutoff = {cutoff} }}"), *unit)
            }
            _ => return Err(format!("light {:?} is of a kind that only local models know", light.name).into()),
        };
        if unit != PhotometricUnit::Physical {
            return Err(format!("light {:?} is a classic one", light.name).into());
        }
        writeln!(self.text, "[light.l{k}]\n{place}\nunit = \"physical\"\nintensity = {}\n", color(light.diffuse * self.light))?;
        Ok(())
    }

    fn material(&mut self, k: usize, material: &Material) -> Done {
        let reflectance = match &material.model {
            Model::Phong(m) => self.average(&m.diffuse) + m.mirror,
            Model::CookTorrance(m) if m.diffuse.factor.is_black() => METAL,
            model => self.average(model.base_color()),
        };
        writeln!(
            self.text,
            "# {}\n[material.m{k}]\nlambert = {}",
            material.name,
            color(reflectance.map(|v| v.clamp(0.0, BRIGHTEST)))
        )?;
        if material.is_emissive() {
            writeln!(self.text, "emission = {}", color(self.average(&material.emission) * self.light))?;
        }
        writeln!(self.text)?;
        Ok(())
    }

    /// The mean over the whole texture.
    fn average(&self, map: &ColorMap) -> Spectrum {
        const N: u16 = 64;
        let Some(reference) = map.texture else {
            return map.factor;
        };
        let whole = TextureRef::new(reference.texture);
        let places = (0..N * N).map(|i| Vec2::new(f32::from(i % N) + 0.5, f32::from(i / N) + 0.5) / f32::from(N));
        let sum = places.fold(Spectrum::BLACK, |sum, uv| {
            let [r, g, b, _] = sample(self.scene, &whole, uv);
            sum + Spectrum::new(r, g, b)
        });
        map.factor * sum / f32::from(N * N)
    }

    fn instance(&mut self, id: InstanceId, instance: &Instance) -> Done {
        match instance.geometry {
            Geometry::Sphere => {
                let (scale, _, center) = instance.transform.to_scale_rotation_translation();
                if (scale.max_element() - scale.min_element()).abs() > 1e-9 * scale.max_element() {
                    return Err(format!("{:?} is no sphere", instance.name).into());
                }
                let material = self.scene.material_of(id, 0);
                let Some(name) = self.shown(material) else { return Ok(()) };
                let center = triple(center);
                writeln!(
                    self.text,
                    "[[shape]]\nmaterial = \"{name}\"\nsphere = {{ center = {center}, radius = {} }}\n",
                    scale.x
                )?;
            }
            Geometry::Disc => self.faces(self.scene.material_of(id, 0), &disc(&instance.transform))?,
            Geometry::Mesh(mesh) => {
                let mesh = &self.scene.meshes[mesh.index()];
                let mut of_triangles: Vec<(Option<MaterialId>, u32)> =
                    (0..mesh.triangles.len() as u32).map(|t| (self.scene.material_of(id, t), t)).collect();
                of_triangles.sort();
                for same in of_triangles.chunk_by(|a, b| a.0 == b.0) {
                    let triangles: Vec<u32> = same.iter().map(|t| t.1).collect();
                    self.faces(same[0].0, &faces(mesh, &triangles, &instance.transform))?;
                }
            }
        }
        Ok(())
    }

    /// The name of a material; `None` for what light passes through.
    fn shown(&self, material: Option<MaterialId>) -> Option<String> {
        let of = material.map(|id| &self.scene.materials[id.index()]);
        let is_seen_through = of.is_some_and(|m| m.transmits() || m.alpha.mode == AlphaMode::Blend);
        (!is_seen_through).then(|| format!("m{}", material.map_or(self.scene.materials.len(), |id| id.index())))
    }

    fn faces(&mut self, material: Option<MaterialId>, faces: &Faces) -> Done {
        let Some(name) = self.shown(material) else { return Ok(()) };
        self.mesh(&name, faces)?;
        let of = material.map(|id| &self.scene.materials[id.index()]);
        if of.is_some_and(|m| m.is_emissive() && m.two_sided) {
            self.mesh(&name, &faces.back())?;
        }
        Ok(())
    }

    fn mesh(&mut self, material: &str, faces: &Faces) -> Done {
        if faces.faces.is_empty() {
            return Ok(());
        }
        let positions: Vec<String> = faces.positions.iter().map(|p| triple(*p)).collect();
        let corners: Vec<String> = faces.faces.iter().map(|face| format!("{face:?}")).collect();
        writeln!(
            self.text,
            "[[shape]]\nmaterial = \"{material}\"\n[shape.mesh]\npositions = [{}]\nfaces = [{}]\n",
            positions.join(","),
            corners.join(",")
        )?;
        Ok(())
    }
}

impl Faces {
    /// The same seen from behind, a skin's thickness away.
    fn back(&self) -> Self {
        let mut back = Self::default();
        for face in &self.faces {
            let corners: Vec<DVec3> = face.iter().map(|i| self.positions[*i as usize]).collect();
            let behind = area_vector(&corners).normalize_or_zero() * -SKIN;
            let first = back.positions.len() as u32;
            back.positions.extend(corners.iter().rev().map(|p| *p + behind));
            back.faces.push((first..first + corners.len() as u32).collect());
        }
        back
    }
}

/// Triangles of a mesh, or the convex quadrilaterals they are parts of.
fn faces(mesh: &Mesh, triangles: &[u32], transform: &DAffine3) -> Faces {
    let mut number = vec![u32::MAX; mesh.positions.len()];
    let mut out = Faces::default();
    let mut last = None;
    for &t in triangles {
        let polygon = mesh.polygons.as_ref().map(|p| {
            let i = p.of_triangle[t as usize] as usize;
            (i, &p.vertices[p.offsets[i] as usize..p.offsets[i + 1] as usize])
        });
        let corners = match polygon {
            Some((i, corners)) if is_convex_quadrilateral(mesh, corners) => {
                if last.replace(i) == Some(i) {
                    continue;
                }
                corners
            }
            _ => &mesh.triangles[t as usize],
        };
        let place = |i: &u32| rounded(transform.transform_point3(mesh.positions[*i as usize]));
        if is_sliver(&corners.iter().map(place).collect::<Vec<_>>()) {
            continue;
        }
        let mut face: Vec<u32> = corners
            .iter()
            .map(|i| {
                let n = &mut number[*i as usize];
                if *n == u32::MAX {
                    *n = out.positions.len() as u32;
                    out.positions.push(place(i));
                }
                *n
            })
            .collect();
        if transform.matrix3.determinant() < 0.0 {
            face.reverse();
        }
        out.faces.push(face);
    }
    out
}

/// Less high than anything that could be seen.
fn is_sliver(corners: &[DVec3]) -> bool {
    let longest = corners.iter().flat_map(|p| corners.iter().map(|q| p.distance(*q))).fold(0.0, f64::max);
    2.0 * area_vector(corners).length() <= 1e-5 * longest
}

fn is_convex_quadrilateral(mesh: &Mesh, corners: &[u32]) -> bool {
    let [a, b, c, d] = corners else { return false };
    let [a, b, c, d] = [a, b, c, d].map(|i| mesh.positions[*i as usize]);
    let normals = [(a, b, c), (b, c, d), (c, d, a), (d, a, b)].map(|(p, q, r)| (q - p).cross(r - q));
    let n = normals.iter().sum::<DVec3>().normalize_or_zero();
    normals.iter().all(|m| m.dot(n) > 0.999 * m.length() && m.length() > 0.0)
}

fn disc(transform: &DAffine3) -> Faces {
    let corner = |k: u32| {
        let phi = -TAU * f64::from(k) / f64::from(CORNERS);
        transform.transform_point3(DVec3::new(phi.cos(), 0.0, phi.sin()))
    };
    // As large as the disc.
    let wider = (PI / (0.5 * f64::from(CORNERS) * (TAU / f64::from(CORNERS)).sin())).sqrt();
    let center = transform.translation;
    let mut positions: Vec<DVec3> = (0..CORNERS).map(|k| center + (corner(k) - center) * wider).collect();
    if transform.matrix3.determinant() < 0.0 {
        positions.reverse();
    }
    Faces { positions, faces: vec![(0..CORNERS).collect()] }
}

/// To a micrometre, as it is written.
fn rounded(p: DVec3) -> DVec3 {
    (p * 1e6).round() / 1e6 + DVec3::ZERO
}

fn triple(p: DVec3) -> String {
    let [x, y, z] = rounded(p).to_array();
    format!("[{x},{y},{z}]")
}

fn color(c: Spectrum) -> String {
    format!("{:?}", c.to_array())
}
