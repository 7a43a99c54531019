//! Materials: metallic–roughness and its extensions.

use super::super::{ImportError, Warnings};
use super::json::Item;
use super::texture::Textures;
use crate::math::function;
use crate::scene::{Alpha, AlphaMode, ColorMap, Inside, Material, MetallicRoughness, Model, NormalMap, ScalarMap, TextureRef};
use crate::spectrum::Spectrum;

/// Stands for the infinite index of `"ior": 0` and of specular–glossiness: F₀ = 0.9996 before the specular colour scales it, and
/// a finite number wherever a ratio of indices is formed.
const MIRROR_IOR: f32 = 1e4;

/// Smallest attenuation colour whose logarithm is taken: 16 attenuation lengths per `attenuationDistance`, black for any purpose.
const DARKEST: f64 = 1e-7;

/// To f32 without becoming infinite.
pub(super) fn narrow(v: f64) -> f32 {
    v.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}

/// Reads one material.
pub(super) fn read<'a>(item: &Item<'a>, textures: &mut Textures<'a>, warnings: &mut Warnings) -> Result<Material, ImportError> {
    let mut reader = Reader { textures, warnings };
    let (model, alpha) = match item.extension("KHR_materials_pbrSpecularGlossiness")? {
        Some(extension) => reader.specular_glossiness(&extension)?,
        None => reader.metallic_roughness(item)?,
    };
    let model = reader.extensions(item, model)?;
    let strength = match item.extension("KHR_materials_emissive_strength")? {
        Some(e) => e.number("emissiveStrength")?.unwrap_or(1.0).max(0.0),
        None => 1.0,
    };
    let emissive = item.numbers::<3>("emissiveFactor")?.unwrap_or([0.0; 3]);
    let emission = ColorMap {
        factor: Spectrum::from(emissive.map(|v| narrow(v.max(0.0) * strength))),
        texture: reader.texture(item, "emissiveTexture", true)?,
    };
    let normal_map = match item.object("normalTexture")? {
        Some(info) => reader.texture(item, "normalTexture", false)?.map(|texture| (texture, info)),
        None => None,
    };
    let normal_map = match normal_map {
        Some((texture, info)) => {
            Some(NormalMap { texture, scale: narrow(info.number("scale")?.unwrap_or(1.0)), is_height: false })
        }
        None => None,
    };
    let mode = item.get("alphaMode")?;
    let mode = match mode.as_ref().map(Item::as_text).transpose()? {
        None | Some("OPAQUE") => AlphaMode::Opaque,
        Some("MASK") => AlphaMode::Mask { cutoff: narrow(item.number("alphaCutoff")?.unwrap_or(0.5)) },
        Some("BLEND") => AlphaMode::Blend,
        Some(other) => {
            let what = format!("{other:?} is no alpha mode (at {}/alphaMode); the surface is opaque", item.pointer());
            reader.warnings.add("unknown-alpha-mode", item.file(), what);
            AlphaMode::Opaque
        }
    };
    Ok(Material {
        name: item.name(),
        model: Model::MetallicRoughness(model),
        emission,
        two_sided: item.flag("doubleSided")?.unwrap_or(false),
        alpha: Alpha { mode, value: alpha },
        normal_map,
        unlit: item.extension("KHR_materials_unlit")?.is_some(),
        inside: Inside::default(),
    })
}

struct Reader<'r, 'a> {
    textures: &'r mut Textures<'a>,
    warnings: &'r mut Warnings,
}

impl<'a> Reader<'_, 'a> {
    fn texture(&mut self, owner: &Item<'a>, key: &str, is_srgb: bool) -> Result<Option<TextureRef>, ImportError> {
        self.textures.reference(owner, key, is_srgb, self.warnings)
    }

    /// A factor between 0 and 1.
    fn unit(&mut self, owner: &Item<'a>, key: &str, default: f64) -> Result<f32, ImportError> {
        let value = owner.number(key)?.unwrap_or(default);
        self.clamp(owner, key, value)
    }

    fn clamp(&mut self, owner: &Item<'a>, key: &str, value: f64) -> Result<f32, ImportError> {
        if !(0.0..=1.0).contains(&value) {
            let what = format!("{value} at {}/{key} is brought into 0 to 1", owner.pointer());
            self.warnings.add("value-out-of-range", owner.file(), what);
        }
        Ok(value.clamp(0.0, 1.0) as f32)
    }

    /// A colour with opacity; white when absent.
    fn rgba(&mut self, owner: &Item<'a>, key: &str) -> Result<(Spectrum, f32), ImportError> {
        let [r, g, b, a] = owner.numbers::<4>(key)?.unwrap_or([1.0; 4]);
        let color = Spectrum::new(self.clamp(owner, key, r)?, self.clamp(owner, key, g)?, self.clamp(owner, key, b)?);
        Ok((color, self.clamp(owner, key, a)?))
    }

    fn metallic_roughness(&mut self, item: &Item<'a>) -> Result<(MetallicRoughness, ScalarMap), ImportError> {
        let Some(pbr) = item.object("pbrMetallicRoughness")? else {
            return Ok((MetallicRoughness::default(), ScalarMap::constant(1.0)));
        };
        let (factor, opacity) = self.rgba(&pbr, "baseColorFactor")?;
        let texture = self.texture(&pbr, "baseColorTexture", true)?;
        let packed = self.texture(&pbr, "metallicRoughnessTexture", false)?;
        let model = MetallicRoughness {
            base_color: ColorMap { factor, texture },
            metallic: ScalarMap { factor: self.unit(&pbr, "metallicFactor", 1.0)?, texture: packed, channel: 2 },
            roughness: ScalarMap { factor: self.unit(&pbr, "roughnessFactor", 1.0)?, texture: packed, channel: 1 },
            ..MetallicRoughness::default()
        };
        Ok((model, ScalarMap { factor: opacity, texture, channel: 3 }))
    }

    /// The archived extension, by way of the specular one: index without bound, so that the specular colour is F₀ itself.
    fn specular_glossiness(&mut self, item: &Item<'a>) -> Result<(MetallicRoughness, ScalarMap), ImportError> {
        let (factor, opacity) = self.rgba(item, "diffuseFactor")?;
        let texture = self.texture(item, "diffuseTexture", true)?;
        let specular = item.numbers::<3>("specularFactor")?.unwrap_or([1.0; 3]);
        let specular_texture = self.texture(item, "specularGlossinessTexture", true)?;
        if specular_texture.is_some() {
            let what = "the glossiness channel of KHR_materials_pbrSpecularGlossiness is left out, its factor alone is used";
            self.warnings.add("ignored-glossiness-texture", item.file(), what);
        }
        let model = MetallicRoughness {
            base_color: ColorMap { factor, texture },
            metallic: ScalarMap::constant(0.0),
            roughness: ScalarMap::constant(1.0 - self.unit(item, "glossinessFactor", 1.0)?),
            ior: MIRROR_IOR,
            specular_color: ColorMap {
                factor: Spectrum::from(specular.map(|v| narrow(v).clamp(0.0, 1.0))),
                texture: specular_texture,
            },
            ..MetallicRoughness::default()
        };
        Ok((model, ScalarMap { factor: opacity, texture, channel: 3 }))
    }

    fn extensions(&mut self, item: &Item<'a>, mut model: MetallicRoughness) -> Result<MetallicRoughness, ImportError> {
        if let Some(occlusion) = item.object("occlusionTexture")?
            && let Some(texture) = self.texture(item, "occlusionTexture", false)?
        {
            let map = ScalarMap { factor: 1.0, texture: Some(texture), channel: 0 };
            model.occlusion = Some((map, self.unit(&occlusion, "strength", 1.0)?));
        }
        if let Some(e) = item.extension("KHR_materials_ior")? {
            let ior = e.number("ior")?.unwrap_or(1.5);
            model.ior = match narrow(ior) {
                0.0 => MIRROR_IOR,
                ior if ior >= 1.0 => ior.min(MIRROR_IOR),
                _ => {
                    let what = format!("an index of refraction of {ior} (at {}) is taken as 1", e.pointer());
                    self.warnings.add("value-out-of-range", e.file(), what);
                    1.0
                }
            };
        }
        if let Some(e) = item.extension("KHR_materials_specular")? {
            let texture = self.texture(&e, "specularTexture", false)?;
            model.specular = ScalarMap { factor: self.unit(&e, "specularFactor", 1.0)?, texture, channel: 3 };
            let color = e.numbers::<3>("specularColorFactor")?.unwrap_or([1.0; 3]);
            let texture = self.texture(&e, "specularColorTexture", true)?;
            model.specular_color = ColorMap { factor: Spectrum::from(color.map(|v| narrow(v).max(0.0))), texture };
        }
        if let Some(e) = item.extension("KHR_materials_transmission")? {
            let texture = self.texture(&e, "transmissionTexture", false)?;
            model.transmission = ScalarMap { factor: self.unit(&e, "transmissionFactor", 0.0)?, texture, channel: 0 };
        }
        if let Some(e) = item.extension("KHR_materials_volume")? {
            model.thick = e.number("thicknessFactor")?.unwrap_or(0.0) > 0.0;
            let color = e.numbers::<3>("attenuationColor")?.unwrap_or([1.0; 3]);
            if let Some(distance) = e.number("attenuationDistance")? {
                if distance > 0.0 {
                    let absorption = |c: f64| narrow(-function::ln_f64(c.clamp(DARKEST, 1.0)) / distance).max(0.0);
                    model.absorption = Spectrum::from(color.map(absorption));
                } else {
                    let what = format!("an attenuation distance of {distance} (at {}) is taken as no absorption", e.pointer());
                    self.warnings.add("value-out-of-range", e.file(), what);
                }
            }
        }
        Ok(model)
    }
}
