//! What an MTL definition means as a scene's [`Material`].
//!
//! | MTL | here |
//! |---|---|
//! | `Ka` `Kd` `Ks` `Ns` | `k_a`, `k_d`, `k_s` and the exponent of a Blinn–Phong lobe: the format's formulas use the halfway vector |
//! | `Ke` | emitted radiance `L_e`, W/(m² sr), front side |
//! | `illum 0` | unlit: `Kd` as it is |
//! | `illum 1` | no highlight |
//! | `illum 2` | highlight |
//! | `illum 3` | highlight and mirror `k_r = k_s` |
//! | `illum 4` | the same and transparent `k_t = (1 − k_s) Tf`, rays go straight on |
//! | `illum 5` | highlight and a mirror by Schlick's `k_s + (1 − k_s)(1 − cosθ)⁵`: the format's Fresnel term starts from `Ks` whatever `Ni` |
//! | `illum 6` | the same, refracting by `Ni` |
//! | `illum 7` | refracting, `k_r = k_s` and `k_t = Tf` weighed by Fresnel |
//! | `illum 8`, `9` | 3 and 4 with reflection, but "ray trace off": no mirror |
//! | `d`, `Tr`, `map_d` | coverage, or `Tf` of grey `1 − d` where a transparent `illum` says none |
//! | `Pr` `Pm` and their maps | glTF's metallic–roughness instead |
//!
//! Without `illum`: 2 where `Ks` is not black, else 1. Reflectances above 1 are clamped.

use std::path::Path;

use super::mtl::{Definition, Map};
use super::picture::Pictures;
use crate::import::Warnings;
use crate::math::DVec2;
use crate::scene::{
    Alpha, AlphaMode, ColorMap, Inside, Material, MetallicRoughness, Model, NormalMap, Phong, PhongLobe, ScalarMap, TextureRef,
    UvTransform,
};
use crate::spectrum::Spectrum;

/// Converts one definition. `folder` is where its file lies, relative to the OBJ file's folder.
pub(super) fn convert(
    definition: &Definition,
    path: &Path,
    folder: &str,
    pictures: &mut Pictures<'_>,
    warnings: &mut Warnings,
) -> Material {
    Converter { m: definition, path, folder, pictures, warnings }.convert()
}

struct Converter<'a, 'b> {
    m: &'a Definition,
    path: &'a Path,
    folder: &'a str,
    pictures: &'a mut Pictures<'b>,
    warnings: &'a mut Warnings,
}

impl Converter<'_, '_> {
    fn convert(&mut self) -> Material {
        let m = self.m;
        let specular = self.reflectance("Ks", m.specular.unwrap_or(Spectrum::BLACK));
        let illum = match m.illum {
            Some(illum @ 0..=9) => illum,
            // 10 casts shadows onto surfaces that cannot be seen otherwise.
            Some(other) => {
                let message = format!("illum {other} of material {:?} is not supported and taken as 2", m.name);
                self.warnings.add("unsupported-illum", self.path, message);
                2
            }
            None if specular.is_black() => 1,
            None => 2,
        };
        let opacity = m.opacity.unwrap_or(1.0);
        let filter = match illum {
            4 | 6 | 7 | 9 => m.transmission.unwrap_or(Spectrum::gray(1.0 - opacity)),
            _ => Spectrum::BLACK,
        };
        // Some exporters write "illum 4, Tf 1 1 1, Ni 1" for whatever is opaque; taken at its word it could not be seen at all.
        let is_air = filter.to_array().iter().all(|c| *c >= 0.999) && m.ior.is_none_or(|ior| (ior - 1.0).abs() < 1e-4);
        let filter = if is_air && illum != 7 && opacity >= 1.0 && m.transmission.is_some() {
            let message = format!("material {:?} would be as clear as air (illum {illum}, Tf 1, Ni 1): taken as opaque", m.name);
            self.warnings.add("clear-as-air", self.path, message);
            Spectrum::BLACK
        } else {
            filter
        };
        let transmission = self.reflectance("Tf", filter);
        let is_glass = !transmission.is_black();

        let has_pbr = m.roughness.is_some() || m.metallic.is_some() || m.map_roughness.is_some() || m.map_metallic.is_some();
        let model = if has_pbr { self.metallic_roughness(transmission) } else { self.phong(illum, specular, transmission) };
        let map_opacity = self.scalar(if is_glass { 1.0 } else { opacity }, &m.map_opacity);
        let is_covering = map_opacity.texture.is_none() && map_opacity.factor >= 1.0;
        Material {
            name: m.name.clone(),
            model,
            emission: self.color(m.emission, &m.map_emission, Spectrum::BLACK, true),
            two_sided: false,
            alpha: Alpha { mode: if is_covering { AlphaMode::Opaque } else { AlphaMode::Blend }, value: map_opacity },
            normal_map: self.normal_map(),
            unlit: illum == 0,
            inside: Inside::default(),
        }
    }

    fn phong(&mut self, illum: i32, specular: Spectrum, transmission: Spectrum) -> Model {
        let m = self.m;
        let defaults = Phong::default();
        let diffuse = self.diffuse();
        let specular_map = if illum >= 2 && m.specular.is_some() {
            self.color(Some(specular), &m.map_specular, Spectrum::BLACK, true)
        } else {
            ColorMap::constant(Spectrum::BLACK)
        };
        let exponent = m.exponent.unwrap_or(1.0);
        let mut exponent = self.scalar(if exponent > 0.0 { exponent } else { 1.0 }, &m.map_exponent);
        exponent.factor = exponent.factor.min(1e6);
        let ambient = (m.ambient.is_some() || m.map_ambient.is_some())
            .then(|| self.color(m.ambient, &m.map_ambient, Spectrum::BLACK, true));
        let fresnel = illum == 7;
        Model::Phong(Phong {
            ambient,
            diffuse,
            specular: specular_map,
            exponent,
            lobe: PhongLobe::BlinnPhong,
            mirror: if matches!(illum, 3..=7) { specular } else { Spectrum::BLACK },
            schlick: illum == 5,
            transmission: if fresnel { transmission } else { transmission * (Spectrum::WHITE - specular) },
            ior: self.ior(defaults.ior),
            fresnel,
            thin: matches!(illum, 4 | 9),
            ..defaults
        })
    }

    fn metallic_roughness(&mut self, transmission: Spectrum) -> Model {
        let m = self.m;
        let mut map = |value: Option<f32>, map: &Option<Map>, absent: f32| {
            let mut result = self.scalar(value.unwrap_or(1.0).clamp(0.0, 1.0), map);
            if value.is_none() && result.texture.is_none() {
                result.factor = absent;
            }
            result
        };
        let metallic = map(m.metallic, &m.map_metallic, 0.0);
        let roughness = map(m.roughness, &m.map_roughness, 0.5);
        Model::MetallicRoughness(MetallicRoughness {
            base_color: self.diffuse(),
            metallic,
            roughness,
            ior: Some(self.ior(1.5)).filter(|ior| *ior > 1.0).unwrap_or(1.5),
            transmission: ScalarMap::constant(transmission.max_channel()),
            ..MetallicRoughness::default()
        })
    }

    /// `Kd`; where it is absent: white under a picture, black for something that only emits, else a plain 0.8.
    fn diffuse(&mut self) -> ColorMap {
        let m = self.m;
        let absent = if m.emission.is_some() || m.transmission.is_some() { Spectrum::BLACK } else { Spectrum::gray(0.8) };
        let factor = m.diffuse.map(|kd| self.reflectance("Kd", kd));
        self.color(factor, &m.map_diffuse, absent, true)
    }

    fn ior(&mut self, absent: f32) -> f32 {
        let ior = self.m.ior.unwrap_or(absent);
        if (0.1..=10.0).contains(&ior) {
            ior
        } else {
            let message = format!("Ni {ior} of material {:?} is no index of refraction; {absent} is used", self.m.name);
            self.warnings.add("index-out-of-range", self.path, message);
            absent
        }
    }

    fn reflectance(&mut self, what: &str, color: Spectrum) -> Spectrum {
        if color.max_channel() > 1.0 {
            let message =
                format!("{what} of material {:?} reflects or passes more light than arrives: clamped to 1", self.m.name);
            self.warnings.add("reflectance-above-one", self.path, message);
        }
        color.map(|c| c.min(1.0))
    }

    fn color(&mut self, factor: Option<Spectrum>, map: &Option<Map>, absent: Spectrum, is_srgb: bool) -> ColorMap {
        let texture = map.as_ref().and_then(|map| self.texture(map, is_srgb));
        // A picture alone is used as it is; one that cannot be had must not leave a dazzling white.
        ColorMap { factor: factor.unwrap_or(if texture.is_some() { Spectrum::WHITE } else { absent }), texture }
    }

    fn scalar(&mut self, factor: f32, map: &Option<Map>) -> ScalarMap {
        let texture = map.as_ref().and_then(|map| self.texture(map, false));
        // Unless the file says which: a picture with an alpha channel in use carries the value there.
        let chosen = map.as_ref().and_then(|map| map.channel);
        let channel = chosen.unwrap_or_else(|| match texture {
            Some(texture) if self.pictures.survey(texture.texture).has_alpha => 3,
            _ => 0,
        });
        ScalarMap { factor, texture, channel }
    }

    fn texture(&mut self, map: &Map, is_srgb: bool) -> Option<TextureRef> {
        let image = self.pictures.image(&map.file, self.folder, self.warnings)?;
        let texture = self.pictures.texture(image, map.is_srgb.unwrap_or(is_srgb), map.clamp);
        let transform = (map.offset != [0.0; 2] || map.scale != [1.0; 2]).then(|| {
            // The file means v″ = s v′ + o with v′ upwards; the scene's v = 1 − v′, so that v → s v + (1 − s − o).
            let ([ou, ov], [su, sv]) = (map.offset, map.scale);
            UvTransform::new(DVec2::new(ou, 1.0 - sv - ov), 0.0, DVec2::new(su, sv))
        });
        Some(TextureRef { transform, ..TextureRef::new(texture) })
    }

    fn normal_map(&mut self) -> Option<NormalMap> {
        let m = self.m;
        if let Some(map) = &m.map_normal {
            let texture = self.texture(map, false)?;
            return Some(NormalMap { texture, scale: map.bump, is_height: false });
        }
        let map = m.map_bump.as_ref()?;
        let texture = self.texture(map, false)?;
        // Exporters write maps of normals as bump maps, for want of a statement.
        let is_normals = self.pictures.survey(texture.texture).looks_like_normals;
        if is_normals {
            let message = format!("the bump map {:?} holds normals, not heights, and is used so", map.file);
            self.warnings.add("bump-map-of-normals", self.path, message);
        }
        Some(NormalMap { texture, scale: map.bump, is_height: !is_normals })
    }
}
