//! Materials and the textures they use.

use schemars::JsonSchema;
use serde::Deserialize;

use super::Reading;
use super::medium::MediumTable;
use super::value::{
    Asymmetry, At, Color, Exponent, Fraction, Index, NonNegative, Number, OrTable, Pair, Positive, Priority, UvSet,
};
use crate::import::ImportError;
use crate::math::{DVec2, Vec2};
use crate::scene::{
    Alpha, AlphaMode, Behind, ColorMap, CookTorrance, Distribution, Filter, Form, Fresnel, Inside, Material, Metal,
    MetallicRoughness, Model, NormalMap, Phong, PhongLobe, Sampler, ScalarMap, Shadowing, Texture, TextureRef, TextureSource,
    UvTransform, Wrap,
};
use crate::spectrum::Spectrum;

/// A material: at most one of the keys `lambert`, `phong`, `blinn_phong`, `cook_torrance`, `metallic_roughness`, `mirror`, `glass`,
/// `thin_glass`, `medium`, and what holds for all of them. Without one: matt, reflectance 0.8.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct MaterialTable {
    /// Starts as a copy of another material of this file.
    pub(super) like: Option<At<String>>,
    /// Perfectly matt, of this reflectance.
    lambert: Option<OrTable<Spectrum, TexturedColor>>,
    /// Matt with a highlight around the mirror direction (Phong 1975): `k_d (n·l) + k_s (r·v)^n`.
    phong: Option<PhongTable>,
    /// Matt with a highlight around the halfway vector (Blinn 1977): `k_d (n·l) + k_s (n·h)^n`.
    blinn_phong: Option<PhongTable>,
    /// Matt with a microfacet highlight (Cook and Torrance 1982).
    cook_torrance: Option<CookTorranceTable>,
    /// glTF's metallic–roughness; the defaults are glTF's.
    metallic_roughness: Option<MetallicRoughnessTable>,
    /// A perfect mirror of this reflectance.
    mirror: Option<Color>,
    /// Glass with an inside: reflects and refracts by Fresnel's equations.
    glass: Option<GlassTable>,
    /// A sheet of glass without an inside: light goes straight on.
    thin_glass: Option<GlassTable>,
    /// Bounds a body of a medium, of smoke for example, without reflecting or bending light.
    medium: Option<MediumTable>,
    /// Radiance it emits from its front, W/(m² sr) or cd/m².
    emission: Option<OrTable<Spectrum, TexturedColor>>,
    /// Emission leaves both sides.
    two_sided: Option<bool>,
    /// How much of the surface is there, 0 to 1; a texture's alpha channel unless it says otherwise.
    opacity: Option<OrTable<f64, TexturedScalar>>,
    /// What opacity means; `"blend"` when `opacity` is given and this is not.
    alpha: Option<AlphaKind>,
    /// With `alpha = "mask"`: there where opacity is at least this; 0.5 when not given.
    alpha_cutoff: Option<Fraction>,
    /// Bends the shading normal.
    normal_map: Option<NormalMapTable>,
    /// Shows its colour whatever the light.
    unlit: Option<bool>,
}

/// What opacity means.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum AlphaKind {
    /// Nothing: the surface is whole.
    Opaque,
    /// There or not, at a cutoff.
    Mask,
    /// Covers that part of what lies behind.
    Blend,
}

/// A colour multiplied by a texture.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TexturedColor {
    /// Name of a texture of this file.
    texture: At<String>,
    /// Multiplies the texture; white when not given.
    color: Option<Color>,
    /// Which set of texture coordinates; 0 when not given.
    uv_set: Option<UvSet>,
    /// Moves texture coordinates, after `uv_scale` and `uv_rotate`.
    uv_offset: Option<Pair>,
    /// Turns texture coordinates, degrees, as glTF's `KHR_texture_transform` does.
    uv_rotate: Option<Number>,
    /// Multiplies texture coordinates: the texture repeats that often.
    uv_scale: Option<Pair>,
}

/// A number multiplied by one channel of a texture.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TexturedScalar {
    /// Name of a texture of this file.
    texture: At<String>,
    /// Multiplies the texture; 1 when not given.
    value: Option<NonNegative>,
    /// Which channel of the texture.
    channel: Option<Channel>,
    /// Which set of texture coordinates; 0 when not given.
    uv_set: Option<UvSet>,
    /// Moves texture coordinates, after `uv_scale` and `uv_rotate`.
    uv_offset: Option<Pair>,
    /// Turns texture coordinates, degrees.
    uv_rotate: Option<Number>,
    /// Multiplies texture coordinates.
    uv_scale: Option<Pair>,
}

/// A channel of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum Channel {
    /// The first.
    Red,
    /// The second.
    Green,
    /// The third.
    Blue,
    /// The fourth.
    Alpha,
}

/// A tangent-space normal map, or a height map.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NormalMapTable {
    /// Name of a texture of this file.
    texture: At<String>,
    /// Scales the slope; 1 when not given.
    scale: Option<Number>,
    /// The texture holds heights instead of normals.
    #[serde(default)]
    height: bool,
    /// Which set of texture coordinates; 0 when not given.
    uv_set: Option<UvSet>,
    /// Moves texture coordinates, after `uv_scale` and `uv_rotate`.
    uv_offset: Option<Pair>,
    /// Turns texture coordinates, degrees.
    uv_rotate: Option<Number>,
    /// Multiplies texture coordinates.
    uv_scale: Option<Pair>,
}

/// The classic model: ambient, diffuse, a highlight, and the constants of Whitted's recursion.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PhongTable {
    /// `k_a`; the same as `diffuse` when not given.
    ambient: Option<OrTable<Spectrum, TexturedColor>>,
    /// `k_d`; 0.8 when not given.
    diffuse: Option<OrTable<Spectrum, TexturedColor>>,
    /// `k_s`; 0 when not given.
    specular: Option<OrTable<Spectrum, TexturedColor>>,
    /// `n`, the exponent; 10 when not given.
    exponent: Option<Exponent>,
    /// `k_r`, perfect mirror reflection; 0 when not given.
    mirror: Option<Color>,
    /// `k_t`, perfect refraction; 0 when not given.
    transmission: Option<Color>,
    /// Index of refraction inside; 1.5 when not given.
    ior: Option<Index>,
    /// Weighs `mirror` and `transmission` by Fresnel's equations instead of using them as constants.
    fresnel: bool,
    /// Absorption inside (Beer), per unit of length of the file.
    absorption: Option<Color>,
    /// Refraction does not bend: a sheet.
    thin: bool,
    /// Where two insides overlap the higher priority wins; 0 when not given.
    priority: Option<Priority>,
}

/// Glass, smooth or rough.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct GlassTable {
    /// Index of refraction; 1.5 when not given.
    ior: Option<Index>,
    /// Multiplies what Fresnel's equations reflect; 1 when not given.
    reflection: Option<Color>,
    /// Multiplies what they let through; 1 when not given.
    transmission: Option<Color>,
    /// Absorption inside (Beer), per unit of length of the file.
    absorption: Option<Color>,
    /// Scattering inside, per unit of length of the file; path tracing.
    scattering: Option<Color>,
    /// The mean cosine of the angle by which light is scattered inside: above 0 forward, below 0 back; 0 when not given.
    asymmetry: Option<Asymmetry>,
    /// Where two insides overlap the higher priority wins; 0 when not given.
    priority: Option<Priority>,
    /// Roughness α of its facets (not squared again); smooth when not given.
    alpha: Option<Positive>,
    /// Distribution of facet normals of rough glass, D; `"ggx"` when not given.
    distribution: Option<DistributionKind>,
    /// Shadowing and masking of rough glass, G; `"smith-correlated"` when not given.
    shadowing: Option<ShadowingKind>,
}

/// Cook and Torrance's model.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct CookTorranceTable {
    /// `k_a`; the same as `diffuse` when not given.
    ambient: Option<OrTable<Spectrum, TexturedColor>>,
    /// `k_d`; 0 for metals, 0.5 for others when not given.
    diffuse: Option<OrTable<Spectrum, TexturedColor>>,
    /// `k_s`; 1 when not given.
    specular: Option<OrTable<Spectrum, TexturedColor>>,
    /// Roughness α (Beckmann's m; not squared again), above zero; 0.3 when not given.
    alpha: Option<Positive>,
    /// Distribution of facet normals, D; `"ggx"` when not given.
    distribution: Option<DistributionKind>,
    /// Shadowing and masking, G; `"smith-correlated"` when not given.
    shadowing: Option<ShadowingKind>,
    /// Reflectance of a facet, F: a metal by name, `"none"` for 1, or a table; `{ ior = 1.5 }` when not given.
    fresnel: Option<At<OrTable<String, FresnelTable>>>,
    /// Normalisation; `"modern"` when not given.
    form: Option<FormKind>,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum DistributionKind {
    /// Beckmann's, as in the paper.
    Beckmann,
    /// Trowbridge and Reitz's.
    Ggx,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum ShadowingKind {
    /// Torrance and Sparrow's V-shaped cavities, as in the paper.
    VCavity,
    /// Smith's, towards light and viewer independently.
    Smith,
    /// Smith's, correlated by height.
    SmithCorrelated,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
enum FormKind {
    /// `k_s D G F / (4 n·l n·v)`.
    #[serde(rename = "modern")]
    Modern,
    /// `k_s D G F / (π n·l n·v)` with D as the paper has it.
    #[serde(rename = "1982")]
    Paper1982,
    /// The 1982 form times n·l, as it is often taught.
    #[serde(rename = "lecture")]
    Lecture,
}

/// Reflectance of a facet: `ior`, or `n` and `k`, or `f0`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct FresnelTable {
    /// A dielectric of this index, exact.
    ior: Option<Index>,
    /// A conductor: the real part of its index for red, green and blue, exact.
    n: Option<Color>,
    /// A conductor: the imaginary part of its index.
    k: Option<Color>,
    /// Schlick's approximation from the reflectance head-on.
    f0: Option<Color>,
}

/// glTF's material.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct MetallicRoughnessTable {
    /// Colour of the matt part of dielectrics, and of metals' reflection; 1 when not given.
    base_color: Option<OrTable<Spectrum, TexturedColor>>,
    /// 0 dielectric to 1 metal; 1 when not given. A texture's blue channel unless it says otherwise.
    metallic: Option<OrTable<f64, TexturedScalar>>,
    /// Perceptual roughness, the root of α; 1 when not given. A texture's green channel unless it says otherwise.
    roughness: Option<OrTable<f64, TexturedScalar>>,
    /// Index of refraction; 1.5 when not given.
    ior: Option<Index>,
    /// Strength of the dielectric reflection; 1 when not given. A texture's alpha channel unless it says otherwise.
    specular: Option<OrTable<f64, TexturedScalar>>,
    /// Colour of the dielectric reflection; 1 when not given.
    specular_color: Option<OrTable<Spectrum, TexturedColor>>,
    /// The part of light that goes through instead of being scattered; 0 when not given. A texture's red channel unless it says otherwise.
    transmission: Option<OrTable<f64, TexturedScalar>>,
    /// Ambient occlusion of ambient light only. A texture's red channel unless it says otherwise; its `value` is the strength.
    occlusion: Option<TexturedScalar>,
    /// Absorption inside (Beer), per unit of length of the file.
    absorption: Option<Color>,
    /// Has an inside; otherwise it is a thin sheet.
    thick: bool,
}

/// A texture: either `file` or `checker`.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct TextureTable {
    /// A picture: PNG, JPEG, WebP, HDR or EXR, found from the folder of this file.
    pub(super) file: Option<At<String>>,
    /// Squares of two colours.
    checker: Option<CheckerTable>,
    /// What lies outside the picture; `"repeat"` when not given.
    wrap: Option<WrapKind>,
    /// Between texels; `"bilinear"` when not given.
    filter: Option<FilterKind>,
    /// How its bytes are meant. When not given: sRGB where it is used as a colour, linear where it is used as numbers or normals.
    color_space: Option<ColorSpace>,
}

/// Squares of two colours.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CheckerTable {
    /// Colour of the square at the origin of the texture coordinates.
    even: Color,
    /// The other colour.
    odd: Color,
    /// Squares per unit of texture coordinates: one number, or one for each direction.
    squares: Option<CheckerSquares>,
}

/// Squares in u and v.
#[derive(Clone, Copy, Debug)]
struct CheckerSquares(Vec2);

impl<'de> Deserialize<'de> for CheckerSquares {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct V;
        impl<'de> serde::de::Visitor<'de> for V {
            type Value = Vec2;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a number or two numbers [u, v]")
            }
            fn visit_f64<E: serde::de::Error>(self, v: f64) -> Result<Vec2, E> {
                let Positive(v) = Positive::deserialize(serde::de::value::F64Deserializer::new(v))?;
                Ok(Vec2::splat(v as f32))
            }
            fn visit_i64<E: serde::de::Error>(self, v: i64) -> Result<Vec2, E> {
                self.visit_f64(v as f64)
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, seq: A) -> Result<Vec2, A::Error> {
                Pair::deserialize(serde::de::value::SeqAccessDeserializer::new(seq)).map(|p| p.0)
            }
        }
        let v = deserializer.deserialize_any(V)?;
        if (1e-6..=1e6).contains(&v.x) && (1e-6..=1e6).contains(&v.y) {
            Ok(Self(v))
        } else {
            Err(serde::de::Error::custom("squares per unit must lie between 1e-6 and 1e6"))
        }
    }
}

impl JsonSchema for CheckerSquares {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "CheckerSquares".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let pair = generator.subschema_for::<Pair>();
        schemars::json_schema!({ "anyOf": [{ "type": "number", "exclusiveMinimum": 0 }, pair] })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum WrapKind {
    /// It tiles.
    Repeat,
    /// It tiles, every other tile mirrored.
    Mirror,
    /// Its border goes on.
    Clamp,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum FilterKind {
    /// The nearest texel.
    Nearest,
    /// Linear in both directions.
    Bilinear,
    /// Linear between ever smaller copies as well, by the size of a pixel.
    Mipmap,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum ColorSpace {
    /// Colours as screens show them.
    Srgb,
    /// Numbers as they are.
    Linear,
}

/// How a texture is used: decides how its bytes are meant when the file does not say.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Use {
    Color,
    Numbers,
}

impl TextureTable {
    /// The texture for one use.
    pub(super) fn build(&self, name: &At<String>, used: Use, r: &mut Reading<'_>) -> Result<Texture, ImportError> {
        let source = match (&self.file, &self.checker) {
            (Some(file), None) => TextureSource::Image(r.image(file)?),
            (None, Some(c)) => {
                TextureSource::Checker { even: c.even.0, odd: c.odd.0, scale: c.squares.map_or(Vec2::ONE, |s| s.0) }
            }
            _ => {
                return Err(r.text.error(
                    &name.span,
                    format!("the texture {:?} needs either `file` or `checker`", name.value),
                    "",
                ));
            }
        };
        let wrap = match self.wrap {
            None | Some(WrapKind::Repeat) => Wrap::Repeat,
            Some(WrapKind::Mirror) => Wrap::Mirror,
            Some(WrapKind::Clamp) => Wrap::Clamp,
        };
        let filter = match self.filter {
            Some(FilterKind::Nearest) => Filter::Nearest,
            None | Some(FilterKind::Bilinear) => Filter::Bilinear,
            Some(FilterKind::Mipmap) => Filter::Mipmap,
        };
        // Floating-point pictures and checkers are linear already.
        let is_bytes = match source {
            TextureSource::Image(image) => !matches!(r.scene.images[image.index()].pixels, crate::scene::Pixels::Rgba32F(_)),
            TextureSource::Checker { .. } => false,
        };
        let is_srgb = is_bytes && self.color_space.map_or(used == Use::Color, |c| c == ColorSpace::Srgb);
        Ok(Texture { source, sampler: Sampler { wrap_u: wrap, wrap_v: wrap, filter }, is_srgb })
    }
}

fn uv_transform(offset: Option<Pair>, rotate: Option<Number>, scale: Option<Pair>) -> Option<UvTransform> {
    if offset.is_none() && rotate.is_none() && scale.is_none() {
        return None;
    }
    let pair = |p: Option<Pair>, otherwise: f32| p.map_or(DVec2::splat(f64::from(otherwise)), |p| p.0.as_dvec2());
    Some(UvTransform::new(pair(offset, 0.0), rotate.map_or(0.0, |r| r.0).to_radians(), pair(scale, 1.0)))
}

fn uv_set(set: Option<UvSet>) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be a small whole number")]
    set.map_or(0, |s| s.0 as u32)
}

fn color_map(value: &OrTable<Spectrum, TexturedColor>, r: &mut Reading<'_>) -> Result<ColorMap, ImportError> {
    Ok(match value {
        OrTable::Plain(color) => ColorMap::constant(*color),
        OrTable::Table(t) => ColorMap {
            factor: t.color.map_or(Spectrum::WHITE, |c| c.0),
            texture: Some(TextureRef {
                texture: r.texture(&t.texture, Use::Color)?,
                uv_set: uv_set(t.uv_set),
                transform: uv_transform(t.uv_offset, t.uv_rotate, t.uv_scale),
            }),
        },
    })
}

fn color_or(
    value: Option<&OrTable<Spectrum, TexturedColor>>,
    otherwise: Spectrum,
    r: &mut Reading<'_>,
) -> Result<ColorMap, ImportError> {
    value.map_or(Ok(ColorMap::constant(otherwise)), |v| color_map(v, r))
}

fn textured_scalar(t: &TexturedScalar, channel: Channel, r: &mut Reading<'_>) -> Result<ScalarMap, ImportError> {
    Ok(ScalarMap {
        factor: t.value.map_or(1.0, |v| v.0 as f32),
        texture: Some(TextureRef {
            texture: r.texture(&t.texture, Use::Numbers)?,
            uv_set: uv_set(t.uv_set),
            transform: uv_transform(t.uv_offset, t.uv_rotate, t.uv_scale),
        }),
        channel: t.channel.unwrap_or(channel) as u8,
    })
}

fn scalar_or(
    value: Option<&OrTable<f64, TexturedScalar>>,
    otherwise: f32,
    channel: Channel,
    r: &mut Reading<'_>,
) -> Result<ScalarMap, ImportError> {
    match value {
        None => Ok(ScalarMap::constant(otherwise)),
        Some(OrTable::Plain(v)) => Ok(ScalarMap::constant(*v as f32)),
        Some(OrTable::Table(t)) => textured_scalar(t, channel, r),
    }
}

impl MaterialTable {
    /// `base` with everything changed that this table gives; `span` is where the table is named.
    pub(super) fn apply(
        &self,
        base: Material,
        span: &std::ops::Range<usize>,
        r: &mut Reading<'_>,
    ) -> Result<Material, ImportError> {
        let present = [
            ("lambert", self.lambert.is_some()),
            ("phong", self.phong.is_some()),
            ("blinn_phong", self.blinn_phong.is_some()),
            ("cook_torrance", self.cook_torrance.is_some()),
            ("metallic_roughness", self.metallic_roughness.is_some()),
            ("mirror", self.mirror.is_some()),
            ("glass", self.glass.is_some()),
            ("thin_glass", self.thin_glass.is_some()),
            ("medium", self.medium.is_some()),
        ];
        super::at_most_one(&r.text, span, "a material", &present)?;
        let mut m = base;
        if let Some(model) = self.model(span, r)? {
            m.model = model;
            m.inside = self.inside(r);
        }
        if let Some(emission) = &self.emission {
            m.emission = color_map(emission, r)?;
        }
        if let Some(two_sided) = self.two_sided {
            m.two_sided = two_sided;
        }
        if let Some(unlit) = self.unlit {
            m.unlit = unlit;
        }
        if self.opacity.is_some() {
            m.alpha = Alpha { mode: AlphaMode::Blend, value: scalar_or(self.opacity.as_ref(), 1.0, Channel::Alpha, r)? };
        }
        let cutoff = self.alpha_cutoff.map_or(0.5, |c| c.0 as f32);
        match self.alpha {
            None => {
                if let (AlphaMode::Mask { .. }, Some(_)) = (m.alpha.mode, self.alpha_cutoff) {
                    m.alpha.mode = AlphaMode::Mask { cutoff };
                }
            }
            Some(AlphaKind::Opaque) => m.alpha.mode = AlphaMode::Opaque,
            Some(AlphaKind::Mask) => m.alpha.mode = AlphaMode::Mask { cutoff },
            Some(AlphaKind::Blend) => m.alpha.mode = AlphaMode::Blend,
        }
        if let Some(n) = &self.normal_map {
            let texture = TextureRef {
                texture: r.texture(&n.texture, Use::Numbers)?,
                uv_set: uv_set(n.uv_set),
                transform: uv_transform(n.uv_offset, n.uv_rotate, n.uv_scale),
            };
            m.normal_map = Some(NormalMap { texture, scale: n.scale.map_or(1.0, |s| s.0 as f32), is_height: n.height });
        }
        Ok(m)
    }

    /// What fills the body, beside what absorbs.
    fn inside(&self, r: &Reading<'_>) -> Inside {
        match (&self.glass, &self.medium) {
            (Some(g), _) => Inside {
                scattering: r.per_metre(g.scattering),
                asymmetry: g.asymmetry.map_or(0.0, |a| a.0 as f32),
                emission: Spectrum::BLACK,
            },
            (None, Some(medium)) => medium.build(r).inside,
            (None, None) => Inside::default(),
        }
    }

    fn model(&self, span: &std::ops::Range<usize>, r: &mut Reading<'_>) -> Result<Option<Model>, ImportError> {
        let black = || ColorMap::constant(Spectrum::BLACK);
        Ok(Some(if let Some(reflectance) = &self.lambert {
            Model::Phong(Phong { diffuse: color_map(reflectance, r)?, ..Phong::default() })
        } else if let Some(p) = &self.phong {
            p.build(PhongLobe::Phong, r)?
        } else if let Some(p) = &self.blinn_phong {
            p.build(PhongLobe::BlinnPhong, r)?
        } else if let Some(c) = &self.cook_torrance {
            c.build(r)?
        } else if let Some(m) = &self.metallic_roughness {
            m.build(r)?
        } else if let Some(reflectance) = self.mirror {
            Model::Phong(Phong { diffuse: black(), mirror: reflectance.0, ..Phong::default() })
        } else if let Some((g, thin)) = self.glass.as_ref().map(|g| (g, false)).or(self.thin_glass.as_ref().map(|g| (g, true))) {
            if thin && (g.absorption.is_some() || g.scattering.is_some() || g.asymmetry.is_some()) {
                return Err(r.text.error(
                    span,
                    "thin glass has no inside that could absorb or scatter",
                    "use `transmission` to tint it, or `glass`",
                ));
            }
            g.build(thin, span, r)?
        } else if let Some(medium) = &self.medium {
            // Light passes as it came.
            Model::Phong(Phong {
                diffuse: black(),
                transmission: Spectrum::WHITE,
                ior: 1.0,
                absorption: medium.build(r).absorption,
                ..Phong::default()
            })
        } else {
            return Ok(None);
        }))
    }
}

impl PhongTable {
    fn build(&self, lobe: PhongLobe, r: &mut Reading<'_>) -> Result<Model, ImportError> {
        Ok(Model::Phong(Phong {
            ambient: self.ambient.as_ref().map(|a| color_map(a, r)).transpose()?,
            diffuse: color_or(self.diffuse.as_ref(), Spectrum::gray(0.8), r)?,
            specular: color_or(self.specular.as_ref(), Spectrum::BLACK, r)?,
            exponent: ScalarMap::constant(self.exponent.map_or(10.0, |e| e.0 as f32)),
            lobe,
            mirror: self.mirror.map_or(Spectrum::BLACK, |c| c.0),
            transmission: self.transmission.map_or(Spectrum::BLACK, |c| c.0),
            ior: self.ior.map_or(1.5, |i| i.0 as f32),
            fresnel: self.fresnel,
            schlick: false,
            absorption: r.per_metre(self.absorption),
            thin: self.thin,
            priority: self.priority.map_or(0, |p| p.0 as i32),
        }))
    }
}

impl GlassTable {
    fn build(&self, thin: bool, span: &std::ops::Range<usize>, r: &mut Reading<'_>) -> Result<Model, ImportError> {
        let reflection = self.reflection.map_or(Spectrum::WHITE, |c| c.0);
        let weight = self.transmission.map_or(Spectrum::WHITE, |c| c.0);
        let ior = self.ior.map_or(1.5, |i| i.0 as f32);
        let absorption = r.per_metre(self.absorption);
        let priority = self.priority.map_or(0, |p| p.0 as i32);
        let black = ColorMap::constant(Spectrum::BLACK);
        Ok(match self.alpha.map(|a| a.0 as f32) {
            None if self.distribution.is_some() || self.shadowing.is_some() => {
                return Err(r.text.error(span, "smooth glass has no facets", "give its roughness as `alpha`"));
            }
            Some(alpha) => Model::CookTorrance(CookTorrance {
                diffuse: black,
                specular: ColorMap::constant(reflection),
                alpha: ScalarMap::constant(alpha),
                distribution: distribution(self.distribution),
                shadowing: shadowing(self.shadowing),
                fresnel: Fresnel::Dielectric { ior },
                behind: Some(Behind { weight, absorption, thin, priority }),
                ..CookTorrance::default()
            }),
            None => Model::Phong(Phong {
                diffuse: black,
                mirror: reflection,
                transmission: weight,
                ior,
                fresnel: true,
                absorption,
                thin,
                priority,
                ..Phong::default()
            }),
        })
    }
}

fn distribution(kind: Option<DistributionKind>) -> Distribution {
    match kind {
        Some(DistributionKind::Beckmann) => Distribution::Beckmann,
        None | Some(DistributionKind::Ggx) => Distribution::Ggx,
    }
}

fn shadowing(kind: Option<ShadowingKind>) -> Shadowing {
    match kind {
        Some(ShadowingKind::VCavity) => Shadowing::VCavity,
        Some(ShadowingKind::Smith) => Shadowing::Smith,
        None | Some(ShadowingKind::SmithCorrelated) => Shadowing::SmithCorrelated,
    }
}

impl CookTorranceTable {
    fn build(&self, r: &mut Reading<'_>) -> Result<Model, ImportError> {
        let fresnel = match &self.fresnel {
            None => Fresnel::Dielectric { ior: 1.5 },
            Some(At { value: OrTable::Plain(name), span }) => match name.as_str() {
                "none" => Fresnel::One,
                "gold" => Fresnel::metal(Metal::Gold),
                "copper" => Fresnel::metal(Metal::Copper),
                "aluminium" | "aluminum" => Fresnel::metal(Metal::Aluminium),
                "silver" => Fresnel::metal(Metal::Silver),
                _ => {
                    let known = ["none", "gold", "copper", "aluminium", "silver"];
                    let name = At { value: name.clone(), span: span.clone() };
                    return Err(r.text.unknown(&name, "metal", known.into_iter()));
                }
            },
            Some(At { value: OrTable::Table(t), span }) => match (t.ior, t.n, t.k, t.f0) {
                (Some(ior), None, None, None) => Fresnel::Dielectric { ior: ior.0 as f32 },
                (None, Some(n), Some(k), None) => Fresnel::Conductor { n: n.0, k: k.0 },
                (None, None, None, Some(f0)) => Fresnel::Schlick { f0: f0.0 },
                _ => return Err(r.text.error(span, "`fresnel` needs `ior`, or `n` and `k`, or `f0`", "")),
            },
        };
        let is_metal = matches!(fresnel, Fresnel::Conductor { .. });
        Ok(Model::CookTorrance(CookTorrance {
            ambient: self.ambient.as_ref().map(|a| color_map(a, r)).transpose()?,
            diffuse: color_or(self.diffuse.as_ref(), Spectrum::gray(if is_metal { 0.0 } else { 0.5 }), r)?,
            specular: color_or(self.specular.as_ref(), Spectrum::WHITE, r)?,
            alpha: ScalarMap::constant(self.alpha.map_or(0.3, |a| a.0 as f32)),
            distribution: distribution(self.distribution),
            shadowing: shadowing(self.shadowing),
            fresnel,
            form: match self.form {
                None | Some(FormKind::Modern) => Form::Modern,
                Some(FormKind::Paper1982) => Form::Paper1982,
                Some(FormKind::Lecture) => Form::Lecture,
            },
            behind: None,
        }))
    }
}

impl MetallicRoughnessTable {
    fn build(&self, r: &mut Reading<'_>) -> Result<Model, ImportError> {
        let occlusion = self.occlusion.as_ref().map(|o| {
            let strength = o.value.map_or(1.0, |v| v.0 as f32);
            textured_scalar(o, Channel::Red, r).map(|map| (ScalarMap { factor: 1.0, ..map }, strength))
        });
        Ok(Model::MetallicRoughness(MetallicRoughness {
            base_color: color_or(self.base_color.as_ref(), Spectrum::WHITE, r)?,
            metallic: scalar_or(self.metallic.as_ref(), 1.0, Channel::Blue, r)?,
            roughness: scalar_or(self.roughness.as_ref(), 1.0, Channel::Green, r)?,
            ior: self.ior.map_or(1.5, |i| i.0 as f32),
            specular: scalar_or(self.specular.as_ref(), 1.0, Channel::Alpha, r)?,
            specular_color: color_or(self.specular_color.as_ref(), Spectrum::WHITE, r)?,
            transmission: scalar_or(self.transmission.as_ref(), 0.0, Channel::Red, r)?,
            occlusion: occlusion.transpose()?,
            absorption: r.per_metre(self.absorption),
            thick: self.thick,
        }))
    }
}
