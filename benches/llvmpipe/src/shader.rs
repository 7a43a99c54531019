//! The programs: the reflection models of `radiosa::bsdf` and the lights of `radiosa::emitter`, written for OpenGL.
//!
//! As in our own kernels, what does not depend on the light is taken out of the sums: Schlick's reflectance is `A + (B − A)(1 − v·h)⁵`, so that two sums over
//! the lights suffice. The numbers of lights are constants, so that the compiler may unroll.

use std::error::Error;
use std::fmt::Write as _;

use radiosa::emitter::Emitter;
use radiosa::emitter::area::PointSample;
use radiosa::emitter::distant::Distant;
use radiosa::emitter::hemispherical::Hemispherical;
use radiosa::emitter::point::{Falloff, Point};
use radiosa::emitter::spot::{Profile, Spot};
use radiosa::math::Vec3;
use radiosa::scanline::Interpolation;
use radiosa::scene::{AlphaMode, Material, Model, PhongLobe};
use radiosa::spectrum::Spectrum;

use crate::stage::Lights;

/// The kinds of material that have a program each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Kind {
    lobe: Lobe,
    pub is_textured: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Lobe {
    Lambert,
    Phong,
    Blinn,
    Rough,
}

/// A uniform and its numbers, three for each element.
pub type Uniform = (&'static str, Vec<f32>);

/// The kind of a material, and what its program is told of it.
pub fn of_material(material: &Material) -> Result<(Kind, Vec<Uniform>), Box<dyn Error>> {
    let plain = || format!("material \"{}\" has something that is not drawn here", material.name);
    let rgb = |s: Spectrum| s.to_array().to_vec();
    if material.unlit || material.emission.texture.is_some() || material.alpha.mode != AlphaMode::Opaque {
        return Err(plain().into());
    }
    let emission = ("emission", rgb(material.emission.factor));
    match &material.model {
        Model::Phong(m) if m.specular.texture.is_none() && m.exponent.texture.is_none() && m.ambient.is_none() => {
            let lobe = match m.lobe {
                _ if m.specular.factor.is_black() => Lobe::Lambert,
                PhongLobe::Phong => Lobe::Phong,
                PhongLobe::BlinnPhong => Lobe::Blinn,
            };
            let coat = vec![m.exponent.factor.max(0.0), 0.0, 0.0];
            let uniforms =
                vec![("base", rgb(m.diffuse.factor)), ("specular_a", rgb(m.specular.factor)), ("coat", coat), emission];
            Ok((Kind { lobe, is_textured: m.diffuse.texture.is_some() }, uniforms))
        }
        Model::MetallicRoughness(m)
            if [m.metallic, m.roughness, m.specular].iter().all(|map| map.texture.is_none())
                && m.specular_color.texture.is_none()
                && m.occlusion.is_none() =>
        {
            let f0 = radiosa::bsdf::fresnel::f0_of_ior(m.ior);
            let f0 = (m.specular_color.factor * f0).map(|f| f.min(1.0));
            let (metallic, w) = (m.metallic.factor.clamp(0.0, 1.0), m.specular.factor.clamp(0.0, 1.0));
            let alpha = m.roughness.factor.clamp(0.0, 1.0).powi(2);
            let alpha2 = if alpha < radiosa::bsdf::microfacet::MIN_ALPHA { 0.0 } else { alpha * alpha };
            // `A` of the coat, and `A` of the metal without its base colour; `B` of both.
            let uniforms = vec![
                ("base", rgb(m.base_color.factor)),
                ("specular_a", rgb(f0 * (w * (1.0 - metallic)))),
                ("coat", vec![alpha2, w, f0.max_channel()]),
                ("metal", vec![metallic, w * (1.0 - metallic) + metallic, 1.0 - metallic]),
                emission,
            ];
            Ok((Kind { lobe: Lobe::Rough, is_textured: m.base_color.texture.is_some() }, uniforms))
        }
        _ => Err(plain().into()),
    }
}

/// The uniforms of the lights, and the constants that say how many there are.
pub fn of_lights(lights: &Lights) -> Result<(String, Vec<Uniform>), Box<dyn Error>> {
    let mut points: Vec<Point> = Vec::new();
    let mut spots: Vec<Spot> = Vec::new();
    let mut distants: Vec<Distant> = Vec::new();
    let mut skies: Vec<Hemispherical> = Vec::new();
    let mut samples: Vec<PointSample> = Vec::new();
    for emitter in &lights.emitters {
        match emitter {
            Emitter::Ambient(_) => {}
            Emitter::Point(l) => points.push(*l),
            Emitter::Spot(l) => spots.push(*l),
            Emitter::Distant(l) => distants.push(*l),
            Emitter::Hemispherical(l) => skies.push(*l),
            Emitter::Area(l) => samples.extend(&l.samples),
            Emitter::Discrete(_) | Emitter::Environment(_) => return Err("environments are not drawn here".into()),
        }
    }
    let differ = points.iter().chain(spots.iter().map(|s| &s.point)).any(|p| p.diffuse != p.specular)
        || distants.iter().any(|d| d.diffuse != d.specular);
    if differ {
        return Err("lights of two intensities are not drawn here".into());
    }
    let columns = |v: &mut dyn Iterator<Item = [f32; 3]>| v.flatten().collect::<Vec<f32>>();
    let all = || points.iter().chain(spots.iter().map(|s| &s.point));
    let profile = |s: &Spot| match s.profile {
        Profile::Gltf { q_outer, scale } => Ok([q_outer, scale, 0.0]),
        Profile::Classic { .. } => Err("classic spot lights are not drawn here"),
    };
    let profiles: Vec<[f32; 3]> = spots.iter().map(profile).collect::<Result<_, _>>()?;
    let uniforms = vec![
        ("ambient", lights.ambient.to_array().to_vec()),
        ("point_at", columns(&mut all().map(|p| p.position.to_array()))),
        ("point_e", columns(&mut all().map(|p| p.diffuse.to_array()))),
        ("point_falloff", columns(&mut all().map(|p| falloff(p.falloff).0))),
        ("point_limits", columns(&mut all().map(|p| falloff(p.falloff).1))),
        ("spot_axis", columns(&mut spots.iter().map(|s| s.axis.to_array()))),
        ("spot_profile", columns(&mut profiles.into_iter())),
        ("distant_to", columns(&mut distants.iter().map(|d| d.to_light.to_array()))),
        ("distant_e", columns(&mut distants.iter().map(|d| d.diffuse.to_array()))),
        ("sky_axis", columns(&mut skies.iter().map(|s| s.axis.to_array()))),
        ("sky_up", columns(&mut skies.iter().map(|s| s.up.to_array()))),
        ("sky_down", columns(&mut skies.iter().map(|s| s.down.to_array()))),
        ("area_at", columns(&mut samples.iter().map(|s| s.position.to_array()))),
        ("area_n", columns(&mut samples.iter().map(|s| s.normal.to_array()))),
        ("area_e", columns(&mut samples.iter().map(|s| (s.radiance * s.area).to_array()))),
        ("area_sides", columns(&mut samples.iter().map(|s| [f32::from(u8::from(s.two_sided)), 0.0, 0.0]))),
    ];
    let mut constants = String::new();
    let is_endless = all().all(|p| falloff(p.falloff).1[1] == 0.0);
    for (name, n) in [
        ("N_SPOTS", spots.len()),
        ("N_POINTS", points.len() + spots.len()),
        ("N_DISTANT", distants.len()),
        ("N_SKIES", skies.len()),
        ("N_AREA", samples.len()),
        ("IS_ENDLESS", usize::from(is_endless)),
    ] {
        writeln!(constants, "#define {name} {n}")?;
    }
    Ok((constants, uniforms))
}

/// One formula for both kinds: `1/max(least, c1 + c2 d + c3 d²)`; then `least` and `1/range`.
fn falloff(f: Falloff) -> ([f32; 3], [f32; 3]) {
    match f {
        Falloff::Classic { c1, c2, c3, inverse_range } => ([c1, c2, c3], [1.0, inverse_range, 0.0]),
        Falloff::InverseSquare { inverse_range } => ([0.0, 0.0, 1.0], [0.0, inverse_range, 0.0]),
    }
}

/// Shaders for vertices and pixels.
pub fn sources(kind: Kind, interpolation: Interpolation, constants: &str) -> [String; 2] {
    let lobe = match kind.lobe {
        Lobe::Lambert => "LAMBERT",
        Lobe::Phong => "PHONG",
        Lobe::Blinn => "BLINN",
        Lobe::Rough => "ROUGH",
    };
    let place = match interpolation {
        Interpolation::Flat => "FLAT",
        Interpolation::Gouraud => "GOURAUD",
        Interpolation::Phong => "AT_PIXELS",
    };
    let textured = if kind.is_textured { "#define TEXTURED\n" } else { "" };
    let head = format!("#version 450 core\n#define {lobe}\n#define {place}\n{textured}{constants}\n");
    [format!("{head}{LIGHT}{VERTEX}"), format!("{head}{LIGHT}{PIXEL}")]
}

/// Shaders of the pass for depth alone.
pub fn depth_sources() -> [String; 2] {
    let vertex = "#version 450 core
        layout(location = 0) in vec3 position;
        uniform mat4 projection;
        invariant gl_Position;
        void main() { gl_Position = projection * vec4(position, 1.0); }";
    [vertex.into(), "#version 450 core\nvoid main() {}".into()]
}

/// What the eye is.
pub fn of_eye(eye: Vec3) -> Uniform {
    ("eye", eye.to_array().to_vec())
}

/// `light(p, n, v)`: ambient, diffuse and specular light, before textures where these are laid over it.
const LIGHT: &str = "
const float PI = 3.14159265358979;
uniform vec3 eye, ambient, base, specular_a, coat, metal, emission;
#if N_POINTS > 0
uniform vec3 point_at[N_POINTS], point_e[N_POINTS], point_falloff[N_POINTS], point_limits[N_POINTS];
#endif
#if N_SPOTS > 0
uniform vec3 spot_axis[N_SPOTS], spot_profile[N_SPOTS];
#endif
#if N_DISTANT > 0
uniform vec3 distant_to[N_DISTANT], distant_e[N_DISTANT];
#endif
#if N_SKIES > 0
uniform vec3 sky_axis[N_SKIES], sky_up[N_SKIES], sky_down[N_SKIES];
#endif
#if N_AREA > 0
uniform vec3 area_at[N_AREA], area_n[N_AREA], area_e[N_AREA], area_sides[N_AREA];
#endif

struct Sums { vec3 diffuse, a, b; };

void add(inout Sums sums, vec3 n, vec3 v, float n_v, vec3 l, vec3 e) {
    float n_l = max(dot(n, l), 0.0);
#ifdef LAMBERT
    sums.diffuse += e * n_l;
#endif
#ifdef PHONG
    sums.diffuse += e * n_l;
    float c = dot(2.0 * n_l * n - l, v);
    sums.a += e * (n_l > 0.0 && c > 0.0 ? pow(min(c, 1.0), coat.x) : 0.0);
#endif
#ifdef BLINN
    sums.diffuse += e * n_l;
    float c = dot(n, normalize(v + l));
    sums.a += e * (n_l > 0.0 && c > 0.0 ? pow(min(c, 1.0), coat.x) : 0.0);
#endif
#ifdef ROUGH
    vec3 h = normalize(v + l);
    float n_h = dot(n, h), v_h = clamp(dot(v, h), 0.0, 1.0);
    float m = 1.0 - v_h, m2 = m * m, m5 = m2 * m2 * m;
    bool is_seen = n_v > 0.0;
    sums.diffuse += e * (n_l * (1.0 - coat.y * (coat.z + (1.0 - coat.z) * (is_seen ? m5 : 0.0))));
    vec3 across = cross(n, h);
    float s = coat.x * n_h * n_h + dot(across, across);
    float smith = n_l * sqrt(n_v * n_v + coat.x * (1.0 - n_v * n_v)) + n_v * sqrt(n_l * n_l + coat.x * (1.0 - n_l * n_l));
    float q = is_seen && n_l > 0.0 && coat.x > 0.0 ? 0.5 * coat.x * n_l / (PI * s * s * smith) : 0.0;
    sums.a += e * q;
    sums.b += e * (q * m5);
#endif
}

void light(vec3 p, vec3 n, vec3 v, vec3 color, out vec3 diffuse, out vec3 specular) {
    Sums sums = Sums(vec3(0.0), vec3(0.0), vec3(0.0));
    float n_v = dot(n, v);
#if N_POINTS > 0
    for (int i = 0; i < N_POINTS; i++) {
        vec3 to = point_at[i] - p;
        float d2 = dot(to, to), d = sqrt(d2);
        vec3 l = to / d, c = point_falloff[i];
        float f = 1.0 / max(point_limits[i].x, c.x + c.y * d + c.z * d2);
#if IS_ENDLESS == 0
        float x = d * point_limits[i].y, x2 = x * x;
        f *= clamp(1.0 - x2 * x2, 0.0, 1.0);
#endif
#if N_SPOTS > 0
        if (i >= N_POINTS - N_SPOTS) {
            int k = i - (N_POINTS - N_SPOTS);
            vec3 off = spot_axis[k] + l;
            float a = clamp((spot_profile[k].x - 0.5 * dot(off, off)) * spot_profile[k].y, 0.0, 1.0);
            f *= a * a;
        }
#endif
        add(sums, n, v, n_v, l, point_e[i] * f);
    }
#endif
#if N_DISTANT > 0
    for (int i = 0; i < N_DISTANT; i++) add(sums, n, v, n_v, distant_to[i], distant_e[i]);
#endif
#if N_AREA > 0
    for (int i = 0; i < N_AREA; i++) {
        vec3 to = area_at[i] - p;
        float d2 = dot(to, to);
        vec3 l = to * inversesqrt(d2);
        float cos_l = -dot(area_n[i], l);
        cos_l = max(area_sides[i].x > 0.0 ? abs(cos_l) : cos_l, 0.0);
        add(sums, n, v, n_v, l, area_e[i] * (cos_l / d2));
    }
#endif
#ifdef ROUGH
    diffuse = color * (sums.diffuse * (metal.z / PI));
    vec3 a = specular_a + color * metal.x;
    specular = a * sums.a + (vec3(metal.y) - a) * sums.b;
#else
    diffuse = color * sums.diffuse / PI;
    specular = specular_a * sums.a / PI;
#endif
#if N_SKIES > 0
#ifdef ROUGH
    vec3 rho = color * (metal.z * (1.0 - coat.y * coat.z));
#else
    vec3 rho = color;
#endif
    for (int i = 0; i < N_SKIES; i++) {
        diffuse += rho * mix(sky_down[i], sky_up[i], 0.5 + 0.5 * clamp(dot(n, sky_axis[i]), -1.0, 1.0));
    }
#endif
    diffuse += color * ambient;
}
";

const VERTEX: &str = "
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec3 lit_at;
uniform mat4 projection;
invariant gl_Position;
#ifdef TEXTURED
out vec2 at;
#endif
#ifdef AT_PIXELS
out vec3 p, n;
#endif
#ifdef GOURAUD
out vec3 diffuse, specular;
#endif
#ifdef FLAT
flat out vec3 diffuse, specular;
#endif
void main() {
    gl_Position = projection * vec4(position, 1.0);
#ifdef TEXTURED
    at = uv;
#endif
#ifdef AT_PIXELS
    p = position;
    n = normal;
#endif
#ifdef GOURAUD
    vec3 v = normalize(eye - position);
    light(position, dot(normal, v) < 0.0 ? -normal : normal, v, base, diffuse, specular);
#endif
#ifdef FLAT
    vec3 v = normalize(eye - lit_at);
    light(lit_at, dot(normal, v) < 0.0 ? -normal : normal, v, base, diffuse, specular);
#endif
}
";

const PIXEL: &str = "
#ifdef TEXTURED
in vec2 at;
uniform sampler2D picture;
#endif
#ifdef AT_PIXELS
in vec3 p, n;
#endif
#ifdef GOURAUD
in vec3 diffuse, specular;
#endif
#ifdef FLAT
flat in vec3 diffuse, specular;
#endif
uniform float emits_behind;
layout(location = 0) out vec4 color;
void main() {
    vec3 texel = vec3(1.0);
#ifdef TEXTURED
    texel = texture(picture, at).rgb;
#endif
    vec3 shown = gl_FrontFacing ? emission : emission * emits_behind;
#ifdef AT_PIXELS
    vec3 d, s, m = normalize(n);
    light(p, gl_FrontFacing ? m : -m, normalize(eye - p), base * texel, d, s);
    color = vec4(shown + d + s, 1.0);
#else
    vec3 d = diffuse, s = specular;
#ifdef ROUGH
    s *= mix(vec3(1.0), texel, metal.x);
#endif
    color = vec4(shown + d * texel + s, 1.0);
#endif
}
";
