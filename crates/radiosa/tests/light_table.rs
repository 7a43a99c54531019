//! The light table of `docs/conventions.md`, held: every light on every lobe, one pixel, direct light only, to 1e-4, by every
//! method there is, against the table's formulas written out here in f64; once open, and once behind an occluder that must take away
//! exactly those lights the table calls shadowed.
#![expect(clippy::print_stderr, reason = "tests say what they measured")]

use std::f64::consts::PI;

use radiosa::bsdf::{Bsdf, FactorsOnly};
use radiosa::emitter::environment::Sky;
use radiosa::emitter::{Emitter, EnvironmentShadows, area};
use radiosa::film::{Filter, Layer, Sampling};
use radiosa::math::{CpuPath, DAffine3, DMat3, DQuat, DVec3, Vec3};
use radiosa::raytrace::{Integrator, PathTracer, RayCast, Whitted, path, ray_cast, tiles, whitted};
use radiosa::scanline::{self, ScanLine};
use radiosa::scene::{
    Attenuation, Camera, ColorMap, Cone, CookTorrance, Directional, Distribution, Environment, EnvironmentRadiance, Form,
    Fresnel, Geometry, Instance, InstanceId, Light, LightKind, Material, MaterialId, Mesh, MeshId, MetallicRoughness, Model,
    Phong, PhongLobe, PhotometricUnit, Projection, ScalarMap, Scene, Shadowing,
};
use radiosa::spectrum::Spectrum;
use radiosa::transport::{Emitters, LightSettings, Solver, Step, View, Viewer, World};
use radiosa_testkit::brdf::{self as exact, V};

type Rgb = [f64; 3];

fn rgb(s: Spectrum) -> Rgb {
    s.to_array().map(f64::from)
}

fn each(f: impl Fn(usize) -> f64) -> Rgb {
    std::array::from_fn(f)
}

// ------------------------------------------------------------------------------------------------ the place

/// The lit point, the normal of its plane on the viewer's side, and the direction to the viewer.
fn place() -> (DVec3, DVec3, DVec3) {
    (DVec3::new(0.3, -0.2, 0.1), DVec3::new(0.2, 1.0, -0.1).normalize(), DVec3::new(-0.5, 0.8, 0.4).normalize())
}

/// Radius of the shell around the point that hides the lights; the eye is inside.
const SHELL: f64 = 1.0;
const EYE_DISTANCE: f64 = 0.5;

// ------------------------------------------------------------------------------------------------ lobes

/// A material, and its reflection function times the cosine as the light table has it: (diffuse, specular), 1/sr.
struct Lobe {
    name: &'static str,
    material: Model,
    f_cos: fn(n: V, v: V, l: V) -> (Rgb, Rgb),
    /// `k_a`, and `k_d` under light without direction.
    ambient: Rgb,
    diffuse: Rgb,
}

const KD: Rgb = [0.5, 0.3, 0.7];
const KS: Rgb = [0.4, 0.9, 0.2];
const KA: Rgb = [0.1, 0.6, 0.35];
const BLACK: Rgb = [0.0; 3];

fn spectrum(c: Rgb) -> Spectrum {
    Spectrum::from(c.map(|x| x as f32))
}

fn color(c: Rgb) -> ColorMap {
    ColorMap::constant(spectrum(c))
}

fn lambert(n: V, l: V) -> Rgb {
    each(|c| KD[c] / PI * exact::dot(n, l))
}

fn cook(form: Form, distribution: Distribution, shadowing: Shadowing, fresnel: Fresnel, alpha: f32) -> Model {
    Model::CookTorrance(CookTorrance {
        ambient: Some(color(KA)),
        diffuse: color(KD),
        specular: color(KS),
        alpha: ScalarMap::constant(alpha),
        distribution,
        shadowing,
        fresnel,
        form,
        behind: None,
    })
}

fn gltf(metallic: f32) -> Model {
    Model::MetallicRoughness(MetallicRoughness {
        base_color: color(KD),
        metallic: ScalarMap::constant(metallic),
        roughness: ScalarMap::constant(0.6),
        specular: ScalarMap::constant(0.8),
        specular_color: color(KS),
        ior: 1.7,
        ..MetallicRoughness::default()
    })
}

/// The dielectric and metal of glTF's specification, roughness 0.6, mixed.
fn gltf_f_cos(metallic: f64, n: V, v: V, l: V) -> (Rgb, Rgb) {
    let (d, g) = (exact::Distribution::Ggx, exact::Shadowing::SmithCorrelated);
    let lobe = exact::cook_torrance(d, g, f64::from(0.6f32).powi(2), 1.0, n, l, v) * exact::dot(n, l);
    let cos_h = exact::dot(v, exact::half(l, v));
    let f0 = each(|c| (KS[c] * (0.7f64 / 2.7).powi(2)).min(1.0));
    let coat = each(|c| exact::schlick(cos_h, f0[c]) * 0.8);
    let strongest = coat.iter().fold(0.0, |a: f64, b| a.max(*b));
    let specular = each(|c| lobe * ((1.0 - metallic) * coat[c] + metallic * exact::schlick(cos_h, KD[c])));
    (lambert(n, l).map(|f| f * (1.0 - metallic) * (1.0 - strongest)), specular)
}

const GLTF_COAT: f64 = 0.8 * 0.9 * (0.7 / 2.7) * (0.7 / 2.7);

fn lobes() -> Vec<Lobe> {
    let phong = |lobe| {
        Model::Phong(Phong {
            ambient: Some(color(KA)),
            diffuse: color(KD),
            specular: color(KS),
            exponent: ScalarMap::constant(7.0),
            lobe,
            ..Phong::default()
        })
    };
    let (gold_n, gold_k) = (Spectrum::new(0.14, 0.43, 1.38), Spectrum::new(3.697, 2.455, 1.914));
    vec![
        Lobe {
            name: "Lambert",
            material: Model::Phong(Phong { diffuse: color(KD), ..Phong::default() }),
            f_cos: |n, _, l| (lambert(n, l), BLACK),
            ambient: KD,
            diffuse: KD,
        },
        Lobe {
            name: "Phong",
            material: phong(PhongLobe::Phong),
            f_cos: |n, v, l| (lambert(n, l), each(|c| KS[c] / PI * exact::phong(n, l, v, 7.0))),
            ambient: KA,
            diffuse: KD,
        },
        Lobe {
            name: "Blinn–Phong",
            material: phong(PhongLobe::BlinnPhong),
            f_cos: |n, v, l| (lambert(n, l), each(|c| KS[c] / PI * exact::blinn(n, l, v, 7.0))),
            ambient: KA,
            diffuse: KD,
        },
        Lobe {
            name: "mirror, on which no delta light shows",
            material: Model::Phong(Phong {
                ambient: Some(color(BLACK)),
                diffuse: color(BLACK),
                mirror: Spectrum::gray(0.9),
                ..Phong::default()
            }),
            f_cos: |_, _, _| (BLACK, BLACK),
            ambient: BLACK,
            diffuse: BLACK,
        },
        Lobe {
            name: "Cook–Torrance, modern",
            material: cook(Form::Modern, Distribution::Ggx, Shadowing::SmithCorrelated, Fresnel::Dielectric { ior: 1.5 }, 0.4),
            f_cos: |n, v, l| {
                let f = exact::fresnel_dielectric(exact::dot(v, exact::half(l, v)), 1.0, 1.5);
                let (d, g) = (exact::Distribution::Ggx, exact::Shadowing::SmithCorrelated);
                let lobe = exact::cook_torrance(d, g, f64::from(0.4f32), f, n, l, v) * exact::dot(n, l);
                (lambert(n, l), KS.map(|k| k * lobe))
            },
            ambient: KA,
            diffuse: KD,
        },
        Lobe {
            name: "Cook–Torrance, 1982, gold",
            material: cook(
                Form::Paper1982,
                Distribution::Beckmann,
                Shadowing::VCavity,
                Fresnel::Conductor { n: gold_n, k: gold_k },
                0.5,
            ),
            f_cos: |n, v, l| {
                let cos_h = exact::dot(v, exact::half(l, v));
                let (d, g) = (exact::Distribution::Beckmann, exact::Shadowing::VCavity);
                let index = [(0.14, 3.697), (0.43, 2.455), (1.38, 1.914)];
                let specular = each(|c| {
                    let f = exact::fresnel_conductor(cos_h, index[c].0, index[c].1);
                    KS[c] * exact::cook_torrance_1982(d, g, 0.5, f, n, l, v) * exact::dot(n, l)
                });
                (lambert(n, l), specular)
            },
            ambient: KA,
            diffuse: KD,
        },
        Lobe {
            name: "Cook–Torrance, lecture, Schlick",
            material: cook(Form::Lecture, Distribution::Beckmann, Shadowing::Smith, Fresnel::Schlick { f0: spectrum(KA) }, 0.3),
            f_cos: |n, v, l| {
                let cos_h = exact::dot(v, exact::half(l, v));
                let (d, g) = (exact::Distribution::Beckmann, exact::Shadowing::Smith);
                let specular = each(|c| {
                    let f = exact::schlick(cos_h, KA[c]);
                    KS[c] * exact::cook_torrance_1982(d, g, f64::from(0.3f32), f, n, l, v) * exact::dot(n, l).powi(2)
                });
                (lambert(n, l), specular)
            },
            ambient: KA,
            diffuse: KD,
        },
        Lobe {
            name: "glTF dielectric",
            material: gltf(0.0),
            f_cos: |n, v, l| gltf_f_cos(0.0, n, v, l),
            ambient: KD,
            diffuse: [KD[0] * (1.0 - GLTF_COAT), KD[1] * (1.0 - GLTF_COAT), KD[2] * (1.0 - GLTF_COAT)],
        },
        Lobe { name: "glTF metal", material: gltf(1.0), f_cos: |n, v, l| gltf_f_cos(1.0, n, v, l), ambient: KD, diffuse: BLACK },
    ]
}

// ------------------------------------------------------------------------------------------------ lights

/// Light from one direction: unit vector to it, irradiance at normal incidence for diffuse and for specular lobes.
type Arrival = (V, Rgb, Rgb);

/// One row of the table: how to put the light into a scene, and what it does by the table's formula.
struct Row {
    name: &'static str,
    add: fn(&mut Scene),
    arrivals: fn() -> Vec<Arrival>,
    /// Irradiance without direction on the normal.
    everywhere: fn(n: V) -> Rgb,
    /// `I_a`.
    ambient: Rgb,
    shadowed: bool,
    /// The option that gives environments shadows.
    environment_shadows: EnvironmentShadows,
}

impl Default for Row {
    fn default() -> Self {
        Self {
            name: "",
            add: |_| {},
            arrivals: Vec::new,
            everywhere: |_| BLACK,
            ambient: BLACK,
            shadowed: true,
            environment_shadows: EnvironmentShadows::Off,
        }
    }
}

const ID: Rgb = [2.0, 1.5, 0.7];
const IS: Rgb = [0.6, 1.1, 1.9];
const IA: Rgb = [0.05, 0.2, 0.4];
const POSITION: DVec3 = DVec3::new(1.4, 1.9, -0.8);
/// Direction the spots shine in, some way off the point.
const AIM: DVec3 = DVec3::new(0.9, -0.2, -0.3);

fn light(kind: LightKind) -> Light {
    Light { name: "light".into(), ambient: spectrum(IA), diffuse: spectrum(ID), specular: spectrum(IS), kind }
}

fn axis() -> DVec3 {
    (AIM - POSITION).normalize()
}

const FALLOFF: Attenuation = Attenuation { c1: 0.3, c2: 0.4, c3: 0.2 };
const RANGE: f64 = 4.0;

/// The arrival of a light at [`POSITION`]: its two intensities times a factor of distance and of the angle from the spots' axis.
fn from_position(factor: fn(d: f64, angle: f64) -> f64) -> Vec<Arrival> {
    let (p, ..) = place();
    let (wi, d) = ((POSITION - p).normalize(), POSITION.distance(p));
    let f = factor(d, (-wi).dot(axis()).acos());
    vec![(wi.to_array(), ID.map(|i| i * f), IS.map(|i| i * f))]
}

fn point(unit: PhotometricUnit, range: f64) -> LightKind {
    LightKind::Point { position: POSITION, unit, attenuation: FALLOFF, range }
}

fn spot(cone: Cone, unit: PhotometricUnit, range: f64) -> LightKind {
    LightKind::Spot { position: POSITION, axis: axis(), cone, unit, attenuation: FALLOFF, range }
}

const CLASSIC_CONE: Cone = Cone::Classic { exponent: 12.0, cutoff: 0.4 };
const GLTF_CONE: Cone = Cone::Gltf { inner: 0.05, outer: 0.5 };

fn classic(d: f64) -> f64 {
    PI * exact::attenuation(FALLOFF.c1, FALLOFF.c2, FALLOFF.c3, d)
}

fn directions() -> Vec<Directional> {
    let one = |x, y, z, r, g, b| Directional { to_light: DVec3::new(x, y, z).normalize(), intensity: Spectrum::new(r, g, b) };
    // The last is below the horizon of the point.
    vec![one(0.3, 0.9, 0.2, 0.5, 0.25, 0.125), one(-0.7, 0.4, 0.5, 1.0, 2.0, 0.5), one(0.1, -1.0, 0.2, 9.0, 9.0, 9.0)]
}

fn from_directions() -> Vec<Arrival> {
    directions()
        .iter()
        .map(|d| (d.to_light.to_array(), each(|c| PI * rgb(d.intensity)[c] * ID[c]), each(|c| PI * rgb(d.intensity)[c] * IS[c])))
        .collect()
}

const SKY_RADIANCE: Rgb = [0.8, 1.0, 1.3];

fn constant_sky(scene: &mut Scene, n_directions: u32) {
    scene.environment = Some(Environment {
        radiance: EnvironmentRadiance::Constant,
        scale: spectrum(SKY_RADIANCE),
        rotation: DQuat::IDENTITY,
        visible: true,
        n_directions,
    });
}

/// The emissive parallelogram: corner and edges, facing down on the point.
const CORNER: DVec3 = DVec3::new(0.9, 1.7, 0.3);
const EDGES: [DVec3; 2] = [DVec3::new(0.8, 0.1, 0.2), DVec3::new(-0.1, 0.0, 0.6)];
const EMITTED: Rgb = [3.0, 5.0, 2.0];
const POINTS_A_SIDE: u32 = 3;

fn emissive_quad(scene: &mut Scene) {
    let material = MaterialId(scene.materials.len() as u32);
    scene.materials.push(Material {
        emission: color(EMITTED),
        model: Model::Phong(Phong { diffuse: color(BLACK), ..Phong::default() }),
        ..Material::default()
    });
    add_quad(scene, CORNER, EDGES[0], EDGES[1], material);
}

fn from_emissive_quad() -> Vec<Arrival> {
    let (p, ..) = place();
    let (normal, n) = (EDGES[0].cross(EDGES[1]), POINTS_A_SIDE);
    let at = |k: u32| (f64::from(k) + 0.5) / f64::from(n);
    let mut arrivals = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let to_piece = CORNER + EDGES[0] * at(i) + EDGES[1] * at(j) - p;
            let (wi, d) = (to_piece.normalize(), to_piece.length());
            // L A cos θ′/d², the vector product being the area times the normal.
            let factor = (-wi).dot(normal) / f64::from(n * n) / (d * d);
            assert!(factor > 0.0, "the emitter faces the point");
            arrivals.push((wi.to_array(), EMITTED.map(|l| l * factor), EMITTED.map(|l| l * factor)));
        }
    }
    arrivals
}

fn rows() -> Vec<Row> {
    use PhotometricUnit::{Classic, Physical};
    vec![
        Row { name: "global ambient", add: |scene| scene.ambient = spectrum(IA), ambient: IA, shadowed: false, ..Row::default() },
        Row {
            name: "ambient of its own",
            add: |scene| scene.lights.push(light(LightKind::Ambient)),
            ambient: IA,
            shadowed: false,
            ..Row::default()
        },
        Row {
            name: "point, classic",
            add: |scene| scene.lights.push(light(point(Classic, f64::INFINITY))),
            arrivals: || from_position(|d, _| classic(d)),
            ambient: IA,
            ..Row::default()
        },
        Row {
            name: "point, physical",
            add: |scene| scene.lights.push(light(point(Physical, f64::INFINITY))),
            arrivals: || from_position(|d, _| 1.0 / (d * d)),
            ambient: IA,
            ..Row::default()
        },
        Row {
            name: "point, physical, with a range",
            add: |scene| scene.lights.push(light(point(Physical, RANGE))),
            arrivals: || from_position(|d, _| exact::gltf_falloff(RANGE, d)),
            ambient: IA,
            ..Row::default()
        },
        Row {
            name: "spot, classic",
            add: |scene| scene.lights.push(light(spot(CLASSIC_CONE, Classic, f64::INFINITY))),
            arrivals: || from_position(|d, angle| classic(d) * exact::spotlight(12.0, 0.4, angle)),
            ambient: IA,
            ..Row::default()
        },
        Row {
            name: "spot, glTF",
            add: |scene| scene.lights.push(light(spot(GLTF_CONE, Physical, RANGE))),
            arrivals: || from_position(|d, angle| exact::gltf_falloff(RANGE, d) * exact::gltf_cone(0.05, 0.5, angle)),
            ambient: IA,
            ..Row::default()
        },
        Row {
            name: "spot that looks away",
            add: |scene| {
                let narrow = Cone::Classic { exponent: 1.0, cutoff: 0.05 };
                scene.lights.push(light(spot(narrow, Classic, f64::INFINITY)));
            },
            ambient: IA,
            ..Row::default()
        },
        Row {
            name: "distant, classic",
            add: |scene| scene.lights.push(light(LightKind::Distant { to_light: -axis(), unit: Classic })),
            arrivals: || vec![((-axis()).to_array(), ID.map(|i| PI * i), IS.map(|i| PI * i))],
            ambient: IA,
            ..Row::default()
        },
        Row {
            name: "distant, physical",
            add: |scene| scene.lights.push(light(LightKind::Distant { to_light: -axis(), unit: Physical })),
            arrivals: || vec![((-axis()).to_array(), ID, IS)],
            ambient: IA,
            ..Row::default()
        },
        Row {
            name: "distant, from behind",
            add: |scene| scene.lights.push(light(LightKind::Distant { to_light: DVec3::NEG_Y, unit: Classic })),
            arrivals: || vec![([0.0, -1.0, 0.0], ID.map(|i| PI * i), IS.map(|i| PI * i))],
            ambient: IA,
            ..Row::default()
        },
        Row {
            name: "hemispherical",
            add: |scene| {
                let axis = DVec3::new(0.6, 0.8, 0.0);
                scene.lights.push(light(LightKind::Hemispherical { axis, down: spectrum(SKY_RADIANCE) }));
            },
            everywhere: |n| {
                let tilt = exact::dot(n, [0.6, 0.8, 0.0]).acos();
                each(|c| exact::hemisphere(tilt, ID[c], SKY_RADIANCE[c]))
            },
            ambient: IA,
            shadowed: false,
            ..Row::default()
        },
        Row {
            name: "discrete environment",
            add: |scene| scene.lights.push(light(LightKind::Discrete { directions: directions() })),
            arrivals: from_directions,
            ambient: IA,
            shadowed: false,
            ..Row::default()
        },
        Row {
            name: "discrete environment, with shadows",
            add: |scene| scene.lights.push(light(LightKind::Discrete { directions: directions() })),
            arrivals: from_directions,
            ambient: IA,
            environment_shadows: EnvironmentShadows::On,
            ..Row::default()
        },
        Row {
            name: "constant environment",
            add: |scene| constant_sky(scene, 0),
            everywhere: |_| SKY_RADIANCE.map(|l| PI * l),
            shadowed: false,
            ..Row::default()
        },
        Row { name: "emissive surface", add: emissive_quad, arrivals: from_emissive_quad, ..Row::default() },
    ]
}

// ------------------------------------------------------------------------------------------------ scenes and methods

/// Two triangles, counter-clockwise from the side of `a × b`.
fn add_quad(scene: &mut Scene, corner: DVec3, a: DVec3, b: DVec3, material: MaterialId) {
    scene.meshes.push(Mesh {
        positions: vec![corner, corner + a, corner + a + b, corner + b],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    });
    let mesh = MeshId(scene.meshes.len() as u32 - 1);
    add_instance(scene, Geometry::Mesh(mesh), DAffine3::IDENTITY, material);
}

fn add_instance(scene: &mut Scene, geometry: Geometry, transform: DAffine3, material: MaterialId) {
    scene.instances.push(Instance { name: String::new(), geometry, transform, material: Some(material), node: None });
}

/// What is compared: a scene whose one pixel shows the lit point.
struct Case {
    scene: Scene,
    row: Row,
    lobe: Lobe,
    /// The shell hides the lights.
    hidden: bool,
}

impl Case {
    fn new(row: Row, lobe: Lobe, hidden: bool) -> Self {
        let (p, n, v) = place();
        let mut scene = Scene::new("light table");
        scene.materials.push(Material { model: lobe.material.clone(), ..Material::default() });
        let a = n.cross(DVec3::X).normalize() * 3.0;
        let b = n.cross(a);
        let (a, b) = if a.cross(b).dot(n) > 0.0 { (a, b) } else { (b, a) };
        // Seen from the front, and not through the diagonal.
        add_quad(&mut scene, p - a * 0.4 - b * 0.5, a, b, MaterialId(0));
        (row.add)(&mut scene);
        if hidden {
            let shell = DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::splat(SHELL)), p);
            let material = MaterialId(scene.materials.len() as u32);
            scene.materials.push(Material::lambert("shell", Spectrum::WHITE));
            add_instance(&mut scene, Geometry::Sphere, shell, material);
        }
        let projection = Projection::Orthographic { height: 0.01 };
        scene.cameras.push(Camera::look_at("camera", p + v * EYE_DISTANCE, p, DVec3::Y, projection));
        Self { scene, row, lobe, hidden }
    }

    /// What the table says the pixel shows.
    fn expected(&self) -> Rgb {
        let (_, n, v) = place();
        let (n, v) = (n.to_array(), v.to_array());
        let mut light = each(|c| self.row.ambient[c] * self.lobe.ambient[c]);
        if self.hidden && self.row.shadowed {
            return light;
        }
        for (l, diffuse, specular) in (self.row.arrivals)() {
            if exact::dot(n, l) <= 0.0 {
                continue;
            }
            let f = (self.lobe.f_cos)(n, v, l);
            light = each(|c| light[c] + f.0[c] * diffuse[c] + f.1[c] * specular[c]);
        }
        let everywhere = (self.row.everywhere)(n);
        each(|c| light[c] + self.lobe.diffuse[c] / PI * everywhere[c])
    }

    fn copy(&self) -> Self {
        Self { scene: self.scene.clone(), row: row_named(self.row.name), lobe: lobe_named(self.lobe.name), hidden: self.hidden }
    }

    fn settings(&self) -> LightSettings {
        LightSettings {
            emitters: Emitters::Points { n: POINTS_A_SIDE, max: 1000 },
            environment_shadows: self.row.environment_shadows,
        }
    }
}

/// Emitters and reflection functions alone, without a scene around them: what every method sums.
fn by_hand(case: &Case) -> Option<Rgb> {
    if case.hidden {
        return None;
    }
    let scene = &case.scene;
    let (p, n, v) = place();
    let (p, n, v) = (p.as_vec3(), n.as_vec3(), v.as_vec3());
    let bsdf = Bsdf::resolve(&scene.materials[0], &FactorsOnly);
    let settings = case.settings();
    let mut emitters: Vec<_> =
        scene.lights.iter().map(|light| Emitter::prepare(light, DVec3::ZERO, settings.environment_shadows)).collect();
    emitters.extend(scene.environment.as_ref().map(|e| Sky::new(e, &[]).emitter(settings.environment_shadows)));
    let emissive: Vec<_> = scene
        .instances
        .iter()
        .filter(|i| i.material != Some(MaterialId(0)))
        .flat_map(|instance| {
            let Geometry::Mesh(mesh) = instance.geometry else { unreachable!("only quads emit") };
            let mesh = &scene.meshes[mesh.index()];
            mesh.triangles.iter().map(|t| area::EmissiveSurface {
                shape: area::EmissiveShape::Triangle(t.map(|i| mesh.positions[i as usize].as_vec3())),
                radiance: spectrum(EMITTED),
                two_sided: false,
                instance: InstanceId(1),
                primitive: 0,
            })
        })
        .collect();
    emitters.push(Emitter::Area(area::sample_points(&emissive, POINTS_A_SIDE, 1000)));
    let mut light = bsdf.ambient() * scene.ambient;
    for emitter in &emitters {
        light += bsdf.ambient() * emitter.ambient();
        light += bsdf.diffuse_reflectance() * emitter.irradiance(n) * (1.0 / PI as f32);
        emitter.for_each_incident(p, &mut |incident| {
            let f = bsdf.evaluate_cos(n, v, incident.wi);
            light += f.diffuse * incident.diffuse + f.specular * incident.specular;
        });
    }
    Some(rgb(light))
}

/// Ray casting, through the world, the camera, the tiles and the film.
fn by_ray_casting(case: &Case, shadows: bool) -> Rgb {
    one_pixel(case, |world, forward| {
        let lights = case.settings();
        let settings = ray_cast::Settings { shadows, lights, ..ray_cast::Settings::default() };
        RayCast::new(world, &settings, forward)
    })
}

/// Whitted's method, likewise. What rough lobes reflect beside light sources is another matter than the table's, and left out by the depth.
fn by_whitted(case: &Case) -> Rgb {
    one_pixel(case, |world, forward| {
        let settings = whitted::Settings { lights: case.settings(), max_depth: 0, ..whitted::Settings::default() };
        Whitted::new(world, &settings, forward)
    })
}

/// Path tracing of light scattered once. It ignores ambient light, which is added as the table has it; what comes from all directions at once or from an
/// area it finds by chance, so that one sample does not show it (`tests/path.rs` has those); and to it all lights are shadowed.
fn by_paths(case: &Case) -> Option<Rgb> {
    let is_by_chance = case.row.name == "emissive surface" || (case.row.everywhere)([0.0, 1.0, 0.0]) != BLACK;
    let is_open_to_others = case.hidden && !case.row.shadowed && !(case.row.arrivals)().is_empty();
    if is_by_chance || is_open_to_others {
        return None;
    }
    let settings = path::Settings { max_depth: Some(1), ..path::Settings::default() };
    let traced = one_pixel(case, |world, _| PathTracer::new(world, &settings));
    Some(each(|c| traced[c] + case.row.ambient[c] * case.lobe.ambient[c]))
}

/// Scan line at every interpolation; it has no shadows, so nothing hides its lights.
fn by_scan_line(case: &Case, interpolation: scanline::Interpolation) -> Option<Rgb> {
    if case.hidden {
        return None;
    }
    let world = World::prepare(case.scene.clone(), CpuPath::detect()).expect("the case is valid");
    let view = View::new(&world.scene().cameras[0], world.origin(), 1, 1);
    let settings = scanline::Settings { interpolation, lights: case.settings(), ..scanline::Settings::default() };
    let sampling = Sampling { width: 1, height: 1, spp: 1, filter: Filter::Box, seed: 0, layers: vec![Layer::Color] };
    let mut render = ScanLine::new(&world, &view, &settings, sampling).expect("it can be drawn");
    while let Step::Working { .. } = render.step(&world) {}
    Some(rgb(render.into_film().color(0, 0)))
}

fn one_pixel<I: Integrator>(case: &Case, method: impl FnOnce(&World, Vec3) -> I) -> Rgb {
    let world = World::prepare(case.scene.clone(), CpuPath::detect()).expect("a valid scene");
    let view = View::new(&world.scene().cameras[0], world.origin(), 1, 1);
    let integrator = method(&world, view.forward());
    let picture = tiles::Settings { width: 1, height: 1, spp: 1, filter: Filter::Box, seed: 0, layers: vec![Layer::Color] };
    let mut render = tiles::TiledRender::new(&integrator, &view, picture).expect("a film of one pixel");
    while render.step(&world) != Step::Converged {}
    rgb(render.into_film().color(0, 0))
}

/// The methods that the table holds for: each gives the pixel, or `None` where it does not apply.
type Method = fn(&Case) -> Option<Rgb>;
const METHODS: [(&str, Method); 8] = [
    ("emitters and lobes", by_hand),
    ("ray casting", |case| Some(by_ray_casting(case, true))),
    ("Whitted", |case| Some(by_whitted(case))),
    ("paths", by_paths),
    ("scan line, Phong", |case| by_scan_line(case, scanline::Interpolation::Phong)),
    ("ray casting from behind", |case| {
        // Reflection works on both sides: what is seen and lit from behind looks the same.
        let mut case = case.copy();
        let plane = &mut case.scene.meshes[0];
        plane.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        Some(by_ray_casting(&case, true))
    }),
    ("ray casting far from the origin", |case| {
        let mut case = case.copy();
        translate(&mut case.scene, DVec3::new(1.0e6, -2.0e5, 3.0e5));
        Some(by_ray_casting(&case, true))
    }),
    ("ray casting, the whole scene turned", |case| {
        let mut case = case.copy();
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 2.1);
        case.scene.transform(DMat3::from_quat(turn), 1.0);
        Some(by_ray_casting(&case, true))
    }),
];

/// Moves everything that has a place.
fn translate(scene: &mut Scene, t: DVec3) {
    scene.instances.iter_mut().for_each(|instance| instance.transform.translation += t);
    scene.cameras.iter_mut().for_each(|camera| camera.position += t);
    for light in &mut scene.lights {
        if let LightKind::Point { position, .. } | LightKind::Spot { position, .. } = &mut light.kind {
            *position += t;
        }
    }
}

/// Relative to the brightest channel, so that a channel that is nearly dark does not decide.
fn difference(computed: Rgb, expected: Rgb) -> f64 {
    let scale = expected.iter().fold(1e-9, |a: f64, b| a.max(*b));
    (0..3).map(|c| (computed[c] - expected[c]).abs() / scale).fold(0.0, f64::max)
}

/// Every row × lobe × (open, hidden) through a method; `expected` may be tampered with by the twin. Returns how many there were, and what is
/// off by more than 1e-4.
fn check(method: Method, expected: &dyn Fn(&Case) -> Rgb) -> (usize, Vec<String>) {
    let (mut n, mut wrong, mut worst) = (0, Vec::new(), 0f64);
    for row in 0..rows().len() {
        for lobe in 0..lobes().len() {
            for hidden in [false, true] {
                let case = Case::new(rows().swap_remove(row), lobes().swap_remove(lobe), hidden);
                let Some(computed) = method(&case) else { continue };
                let expected = expected(&case);
                n += 1;
                let off = difference(computed, expected);
                worst = worst.max(off);
                if off.is_nan() || off > 1e-4 {
                    let (row, lobe) = (case.row.name, case.lobe.name);
                    wrong.push(format!("{row} on {lobe}, hidden: {hidden}: {computed:?} instead of {expected:?}"));
                }
            }
        }
    }
    eprintln!("largest difference of {n}: {worst:.1e}");
    (n, wrong)
}

#[test]
fn every_light_on_every_lobe_by_every_method_shows_what_the_table_says() {
    for (name, method) in METHODS {
        let (n, wrong) = check(method, &Case::expected);
        assert!(wrong.is_empty(), "{name}: {} of {n}: {wrong:#?}", wrong.len());
        assert!(n >= rows().len() * lobes().len());
    }
}

#[test]
fn a_wrong_table_is_caught() {
    // π twice: everything that is not black.
    let (_, wrong) = check(by_hand, &|case| case.expected().map(|x| x * PI));
    assert!(wrong.len() > rows().len() * (lobes().len() - 2), "{}", wrong.len());

    // No shadow rays: every shadowed row on every lobe that shows it. Light from behind shows nowhere, nothing shows on a mirror.
    let (_, wrong) = check(|case| Some(by_ray_casting(case, false)), &Case::expected);
    let n_shadowed = rows().iter().filter(|row| row.shadowed && !(row.arrivals)().is_empty()).count();
    assert_eq!(wrong.len(), (n_shadowed - 1) * (lobes().len() - 1), "{wrong:#?}");

    // Shadows where the table has none: what is hidden is expected to be black.
    let shadowed = |case: &Case| if case.hidden { BLACK } else { case.expected() };
    let (_, wrong) = check(|case| Some(by_ray_casting(case, true)), &shadowed);
    assert!(wrong.len() > 2 * lobes().len(), "{}", wrong.len());

    // I_d where I_s belongs.
    let swapped = |case: &Case| {
        let mut case = case.copy();
        case.scene.lights.iter_mut().for_each(|light| std::mem::swap(&mut light.diffuse, &mut light.specular));
        by_hand(&case)
    };
    let (_, wrong) = check(swapped, &Case::expected);
    assert!(wrong.len() > 50, "{}", wrong.len());
}

fn row_named(name: &str) -> Row {
    rows().into_iter().find(|row| row.name == name).expect("a row of the table")
}

fn lobe_named(name: &str) -> Lobe {
    lobes().into_iter().find(|lobe| lobe.name == name).expect("a lobe of the table")
}

#[test]
fn in_the_strict_local_model_emissive_surfaces_light_nothing() {
    let case = Case::new(row_named("emissive surface"), lobe_named("Lambert"), false);
    let world = World::prepare(case.scene.clone(), CpuPath::detect()).expect("a valid scene");
    let view = View::new(&world.scene().cameras[0], world.origin(), 1, 1);
    let lights = LightSettings { emitters: Emitters::Ignore, ..case.settings() };
    let settings = ray_cast::Settings { lights, ..ray_cast::Settings::default() };
    let integrator = RayCast::new(&world, &settings, view.forward());
    let shown = |target: DVec3| {
        let (p, _, v) = place();
        let eye = p + v * EYE_DISTANCE;
        let ray = radiosa::math::Ray::new(eye.as_vec3(), (target - eye).normalize().as_vec3());
        let mut stream = radiosa::sampling::Stream::new(0, 0, 0);
        rgb(radiosa::transport::Integrator::sample(&integrator, &world, &ray, &mut stream, &mut 0).color)
    };
    assert_eq!(shown(place().0), BLACK);
    assert_eq!(shown(CORNER + (EDGES[0] + EDGES[1]) * 0.4), EMITTED, "it glows all the same");
}

#[test]
fn a_viewer_at_infinity_keeps_the_direction_to_it() {
    // Off the middle of a perspective picture the two viewers differ; the highlight follows the constant one.
    let (p, n, v) = place();
    let mut case = Case::new(row_named("distant, physical"), lobe_named("Phong"), false);
    let eye = p + v * EYE_DISTANCE;
    // It looks past the point; the pixel that shows the point is found by its own camera, so only `forward` differs.
    let target = p + n.cross(v).normalize() * 0.1;
    case.scene.cameras[0] = Camera::look_at("camera", eye, target, DVec3::Y, Projection::Perspective { fov_y: 1.0 });
    let world = World::prepare(case.scene.clone(), CpuPath::detect()).expect("a valid scene");
    let view = View::new(&world.scene().cameras[0], world.origin(), 1, 1);
    let shown = |viewer| {
        let settings = ray_cast::Settings { viewer, lights: case.settings(), ..ray_cast::Settings::default() };
        let integrator = RayCast::new(&world, &settings, view.forward());
        let ray = radiosa::math::Ray::new(eye.as_vec3(), -v.as_vec3());
        let mut stream = radiosa::sampling::Stream::new(0, 0, 0);
        rgb(radiosa::transport::Integrator::sample(&integrator, &world, &ray, &mut stream, &mut 0).color)
    };
    let with_viewer = |v: DVec3| {
        let (l, diffuse, specular) = (case.row.arrivals)().remove(0);
        let f = (case.lobe.f_cos)(n.to_array(), v.to_array(), l);
        each(|c| f.0[c] * diffuse[c] + f.1[c] * specular[c] + IA[c] * KA[c])
    };
    let constant = (eye - target).normalize();
    assert!(difference(shown(Viewer::Local), with_viewer(v)) < 1e-4);
    assert!(difference(shown(Viewer::Infinite), with_viewer(constant)) < 1e-4);
    assert!(difference(with_viewer(v), with_viewer(constant)) > 1e-3, "the case tells the two apart");
}

#[test]
fn the_normal_of_the_place_and_the_shell_are_where_the_cases_need_them() {
    let (p, n, v) = place();
    assert!(n.dot(v) > 0.3 && POSITION.distance(p) > SHELL && (CORNER - p).length() > SHELL);
    assert!((0..=1).all(|i| (0..=1).all(|j| (CORNER + EDGES[0] * f64::from(i) + EDGES[1] * f64::from(j) - p).length() > SHELL)));
    assert!(EDGES[0].cross(EDGES[1]).dot(p - CORNER) > 0.0);
}
