//! Materials, as the scene stores them: coefficients and textures. `bsdf` turns them into functions at a point.

use super::{Inside, TextureRef};
use crate::spectrum::Spectrum;

/// An RGB coefficient, optionally multiplied by a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorMap {
    /// Linear.
    pub factor: Spectrum,
    /// Multiplies `factor`.
    pub texture: Option<TextureRef>,
}

/// A scalar coefficient, optionally multiplied by one channel of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalarMap {
    /// Linear.
    pub factor: f32,
    /// Multiplies `factor`.
    pub texture: Option<TextureRef>,
    /// 0 red … 3 alpha.
    pub channel: u8,
}

impl ColorMap {
    /// Without a texture.
    pub const fn constant(factor: Spectrum) -> Self {
        Self { factor, texture: None }
    }
}

impl ScalarMap {
    /// Without a texture.
    pub const fn constant(factor: f32) -> Self {
        Self { factor, texture: None, channel: 0 }
    }
}

/// What a surface is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the source.
    pub name: String,
    /// How it reflects and transmits.
    pub model: Model,
    /// Emitted radiance `L_e`, W/(m² sr) or cd/m²; leaves the front, or both sides when `two_sided`.
    pub emission: ColorMap,
    /// Emission leaves both sides (glTF `doubleSided`).
    pub two_sided: bool,
    /// Coverage.
    pub alpha: Alpha,
    /// Perturbs the shading normal.
    pub normal_map: Option<NormalMap>,
    /// Shows its base colour as it is, whatever the light (`KHR_materials_unlit`).
    pub unlit: bool,
    /// What fills a body of it beside what absorbs, which the models have.
    pub inside: Inside,
}

/// Coverage: how much of the surface is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alpha {
    /// How `value` is used.
    pub mode: AlphaMode,
    /// Opacity in `[0, 1]`; multiplied by the vertex colour's alpha.
    pub value: ScalarMap,
}

/// What opacity means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Ignored: the surface is whole.
    Opaque,
    /// There where opacity ≥ the cutoff, absent elsewhere.
    Mask {
        /// glTF `alphaCutoff`.
        cutoff: f32,
    },
    /// Covers that fraction of what lies behind.
    Blend,
}

/// A tangent-space normal map: texel `2c − 1`, x and y scaled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// Its picture.
    pub texture: TextureRef,
    /// Scales x and y.
    pub scale: f32,
    /// The texture holds heights, not normals (MTL `bump`): the normal follows from its gradient times `scale`.
    pub is_height: bool,
}

/// The families of reflection models.
#[derive(Clone, Debug, PartialEq)]
pub enum Model {
    /// Ambient, diffuse and a classic highlight; mirror and glass by constants: the model of Whitted's paper and of MTL.
    Phong(Phong),
    /// Diffuse and a Cook–Torrance highlight.
    CookTorrance(CookTorrance),
    /// glTF's metallic–roughness.
    MetallicRoughness(MetallicRoughness),
}

/// `I_a k_a + Σ I f (k_d (n·l) + k_s lobe) + k_r I_r + k_t I_t`.
#[derive(Clone, Debug, PartialEq)]
pub struct Phong {
    /// `k_a`; `None`: the same as `diffuse`.
    pub ambient: Option<ColorMap>,
    /// `k_d`.
    pub diffuse: ColorMap,
    /// `k_s`.
    pub specular: ColorMap,
    /// `n`, the exponent; above zero.
    pub exponent: ScalarMap,
    /// By reflection vector or halfway vector.
    pub lobe: PhongLobe,
    /// `k_r`, perfect mirror reflection.
    pub mirror: Spectrum,
    /// `k_t`, perfect refraction.
    pub transmission: Spectrum,
    /// Index of refraction inside.
    pub ior: f32,
    /// Weighs `k_r` and `k_t` by Fresnel instead of using them as constants.
    pub fresnel: bool,
    /// An opaque mirror reflects `k_r + (1 − k_r)(1 − cosθ)⁵` (MTL `illum 5`); a black one nothing.
    pub schlick: bool,
    /// Absorption inside (Beer), 1/m.
    pub absorption: Spectrum,
    /// Refraction does not bend (a sheet of glass).
    pub thin: bool,
    /// Nested dielectrics: the higher priority wins where two overlap.
    pub priority: i32,
}

/// Which vector the classic highlight measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhongLobe {
    /// `(r·v)^n`, Phong 1975.
    Phong,
    /// `(n·h)^n`, Blinn 1977.
    BlinnPhong,
}

/// Diffuse plus `k_s D G F / (4 n·l n·v)` or a historical form of it.
#[derive(Clone, Debug, PartialEq)]
pub struct CookTorrance {
    /// `k_a`; `None`: the same as `diffuse`.
    pub ambient: Option<ColorMap>,
    /// `k_d`.
    pub diffuse: ColorMap,
    /// `k_s`.
    pub specular: ColorMap,
    /// Roughness α (Beckmann's m), above zero; not squared again.
    pub alpha: ScalarMap,
    /// `D`.
    pub distribution: Distribution,
    /// `G`.
    pub shadowing: Shadowing,
    /// `F`.
    pub fresnel: Fresnel,
    /// Normalisation.
    pub form: Form,
    /// A dielectric ([`Fresnel::Dielectric`]) lets light through: rough glass. Without meaning for others.
    pub behind: Option<Behind>,
}

/// What lies behind a rough surface that lets light through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Behind {
    /// `k_t`: multiplies what Fresnel's equations let through.
    pub weight: Spectrum,
    /// Absorption inside (Beer), 1/m.
    pub absorption: Spectrum,
    /// A sheet: light is scattered, but goes on as it came.
    pub thin: bool,
    /// Nested dielectrics: the higher priority wins where two overlap.
    pub priority: i32,
}

/// Distribution of microfacet normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// Beckmann–Spizzichino, as in Cook and Torrance's paper.
    Beckmann,
    /// Trowbridge–Reitz.
    Ggx,
}

/// Shadowing and masking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shadowing {
    /// Torrance–Sparrow's V-cavities: `min(1, 2(n·h)(n·v)/(v·h), 2(n·h)(n·l)/(v·h))`.
    VCavity,
    /// Smith, separable: `G1(l) G1(v)`.
    Smith,
    /// Smith, height-correlated: `1/(1 + Λ(l) + Λ(v))`.
    SmithCorrelated,
}

/// Reflectance of one facet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fresnel {
    /// `F = 1`.
    One,
    /// Exact, real index (inside over outside).
    Dielectric {
        /// Index of refraction.
        ior: f32,
    },
    /// Exact, complex index per channel.
    Conductor {
        /// Real part.
        n: Spectrum,
        /// Imaginary part.
        k: Spectrum,
    },
    /// Schlick's approximation from the reflectance at normal incidence.
    Schlick {
        /// `F₀`.
        f0: Spectrum,
    },
}

/// Metals with tabulated complex indices, see [`Metal::indices`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Metal {
    /// Au.
    Gold,
    /// Cu.
    Copper,
    /// Al.
    Aluminium,
    /// Ag.
    Silver,
}

impl Metal {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Gold, Self::Copper, Self::Aluminium, Self::Silver];

    /// The complex index of refraction `n + i k`, as (`n`, `k`): at the tabulated wavelengths nearest 0.65, 0.55 and 0.45 µm for
    /// red, green and blue.
    ///
    /// Gold, copper and silver: P. B. Johnson and R. W. Christy, *Optical constants of the noble metals*, Phys. Rev. B 6, 4370
    /// (1972). Aluminium: A. D. Rakić, *Algorithm for the determination of intrinsic optical constants of metal films: application
    /// to aluminum*, Appl. Opt. 34, 4755 (1995).
    pub const fn indices(self) -> (Spectrum, Spectrum) {
        match self {
            Self::Gold => (Spectrum::new(0.14, 0.43, 1.38), Spectrum::new(3.697, 2.455, 1.914)),
            Self::Copper => (Spectrum::new(0.22, 1.02, 1.24), Spectrum::new(3.747, 2.577, 2.397)),
            Self::Aluminium => (Spectrum::new(1.5724, 1.0728, 0.6079), Spectrum::new(7.7354, 6.7839, 5.3676)),
            Self::Silver => (Spectrum::new(0.05, 0.06, 0.04), Spectrum::new(4.483, 3.586, 2.657)),
        }
    }
}

impl Fresnel {
    /// The exact reflectance of a metal.
    pub const fn metal(metal: Metal) -> Self {
        let (n, k) = metal.indices();
        Self::Conductor { n, k }
    }
}

/// The three normalisations of Cook–Torrance in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `k_s D G F / (4 n·l n·v)`.
    Modern,
    /// `k_s D₀ G F / (π n·l n·v)`, `D₀ = π D` unnormalised: four times the modern form.
    Paper1982,
    /// The 1982 form times `n·l`, as often taught; not reciprocal.
    Lecture,
}

/// glTF's metallic–roughness with the extensions for index, specular and transmission.
#[derive(Clone, Debug, PartialEq)]
pub struct MetallicRoughness {
    /// Base colour.
    pub base_color: ColorMap,
    /// 0 dielectric … 1 metal.
    pub metallic: ScalarMap,
    /// Perceptual roughness; α is its square.
    pub roughness: ScalarMap,
    /// Index of refraction (`KHR_materials_ior`), 1.5 by default.
    pub ior: f32,
    /// `KHR_materials_specular` strength.
    pub specular: ScalarMap,
    /// `KHR_materials_specular` colour.
    pub specular_color: ColorMap,
    /// `KHR_materials_transmission`.
    pub transmission: ScalarMap,
    /// Occlusion map and its strength: multiplies ambient light only.
    pub occlusion: Option<(ScalarMap, f32)>,
    /// `KHR_materials_volume`: absorption 1/m; zero thickness means thin walled.
    pub absorption: Spectrum,
    /// `KHR_materials_volume`: has an inside.
    pub thick: bool,
}

impl Default for Phong {
    /// Matt, reflectance 0.8.
    fn default() -> Self {
        Self {
            ambient: None,
            diffuse: ColorMap::constant(Spectrum::gray(0.8)),
            specular: ColorMap::constant(Spectrum::BLACK),
            exponent: ScalarMap::constant(1.0),
            lobe: PhongLobe::Phong,
            mirror: Spectrum::BLACK,
            transmission: Spectrum::BLACK,
            ior: 1.5,
            fresnel: false,
            schlick: false,
            absorption: Spectrum::BLACK,
            thin: false,
            priority: 0,
        }
    }
}

impl Default for CookTorrance {
    /// Grey plastic: diffuse 0.5, α = 0.3, index 1.5.
    fn default() -> Self {
        Self {
            ambient: None,
            diffuse: ColorMap::constant(Spectrum::gray(0.5)),
            specular: ColorMap::constant(Spectrum::WHITE),
            alpha: ScalarMap::constant(0.3),
            distribution: Distribution::Ggx,
            shadowing: Shadowing::SmithCorrelated,
            fresnel: Fresnel::Dielectric { ior: 1.5 },
            form: Form::Modern,
            behind: None,
        }
    }
}

impl CookTorrance {
    /// Index and what lies behind, of a dielectric that lets light through.
    pub fn refraction(&self) -> Option<(f32, Behind)> {
        match self.fresnel {
            Fresnel::Dielectric { ior } => self.behind.filter(|behind| !behind.weight.is_black()).map(|behind| (ior, behind)),
            _ => None,
        }
    }
}

impl Default for MetallicRoughness {
    /// glTF's defaults: white metal, roughness 1.
    fn default() -> Self {
        Self {
            base_color: ColorMap::constant(Spectrum::WHITE),
            metallic: ScalarMap::constant(1.0),
            roughness: ScalarMap::constant(1.0),
            ior: 1.5,
            specular: ScalarMap::constant(1.0),
            specular_color: ColorMap::constant(Spectrum::WHITE),
            transmission: ScalarMap::constant(0.0),
            occlusion: None,
            absorption: Spectrum::BLACK,
            thick: false,
        }
    }
}

impl Default for Material {
    /// Matt, reflectance 0.8, opaque.
    fn default() -> Self {
        Self {
            name: String::new(),
            model: Model::Phong(Phong::default()),
            emission: ColorMap::constant(Spectrum::BLACK),
            two_sided: false,
            alpha: Alpha { mode: AlphaMode::Opaque, value: ScalarMap::constant(1.0) },
            normal_map: None,
            unlit: false,
            inside: Inside::default(),
        }
    }
}

impl Model {
    /// The diffuse or base colour.
    pub const fn base_color(&self) -> &ColorMap {
        match self {
            Self::Phong(m) => &m.diffuse,
            Self::CookTorrance(m) => &m.diffuse,
            Self::MetallicRoughness(m) => &m.base_color,
        }
    }

    /// True for those of its own maps whose textures light can be multiplied by after it was computed without them.
    pub(crate) fn is_laid_over(&self, map: &ColorMap) -> bool {
        let is = |own: &ColorMap| std::ptr::eq(own, map);
        match self {
            Self::Phong(Phong { ambient, diffuse, specular, .. })
            | Self::CookTorrance(CookTorrance { ambient, diffuse, specular, .. }) => {
                is(diffuse) || is(specular) || ambient.as_ref().is_some_and(is)
            }
            Self::MetallicRoughness(m) => is(&m.base_color),
        }
    }
}

impl Material {
    /// Calls `f` on every texture it uses.
    pub fn for_each_texture(&mut self, f: &mut dyn FnMut(&mut super::TextureId)) {
        let mut color = |map: &mut ColorMap| map.texture.iter_mut().for_each(|t| f(&mut t.texture));
        color(&mut self.emission);
        match &mut self.model {
            Model::Phong(p) => {
                p.ambient.iter_mut().for_each(&mut color);
                color(&mut p.diffuse);
                color(&mut p.specular);
            }
            Model::CookTorrance(c) => {
                c.ambient.iter_mut().for_each(&mut color);
                color(&mut c.diffuse);
                color(&mut c.specular);
            }
            Model::MetallicRoughness(m) => {
                color(&mut m.base_color);
                color(&mut m.specular_color);
            }
        }
        let mut scalar = |map: &mut ScalarMap| map.texture.iter_mut().for_each(|t| f(&mut t.texture));
        scalar(&mut self.alpha.value);
        match &mut self.model {
            Model::Phong(p) => scalar(&mut p.exponent),
            Model::CookTorrance(c) => scalar(&mut c.alpha),
            Model::MetallicRoughness(m) => {
                for map in [&mut m.metallic, &mut m.roughness, &mut m.specular, &mut m.transmission] {
                    scalar(map);
                }
                m.occlusion.iter_mut().for_each(|(map, _)| scalar(map));
            }
        }
        self.normal_map.iter_mut().for_each(|n| f(&mut n.texture.texture));
    }

    /// A Lambertian surface.
    pub fn lambert(name: impl Into<String>, reflectance: Spectrum) -> Self {
        Self {
            name: name.into(),
            model: Model::Phong(Phong { diffuse: ColorMap::constant(reflectance), ..Phong::default() }),
            ..Self::default()
        }
    }

    /// True when light may pass through it as through glass.
    pub fn transmits(&self) -> bool {
        match &self.model {
            Model::Phong(m) => !m.transmission.is_black(),
            Model::CookTorrance(m) => m.refraction().is_some(),
            Model::MetallicRoughness(m) => m.transmission.factor > 0.0,
        }
    }

    /// True when it bounds a body, and is no sheet.
    pub fn has_inside(&self) -> bool {
        match &self.model {
            Model::Phong(m) => !m.thin,
            Model::CookTorrance(m) => m.refraction().is_some_and(|(_, behind)| !behind.thin),
            Model::MetallicRoughness(m) => m.thick,
        }
    }

    /// True when some part of it may emit.
    pub fn is_emissive(&self) -> bool {
        self.emission.factor != Spectrum::BLACK
    }
}
