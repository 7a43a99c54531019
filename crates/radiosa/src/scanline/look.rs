//! What of a material is the same wherever it is seen.

use super::surfaces::Kind;
use crate::bsdf::{Bsdf, FactorsOnly};
use crate::scene::{Material, Model, TextureRef};
use crate::spectrum::Spectrum;
use crate::transport::Tinted;

/// A material as most faces show it: constants, and at most the base colour varies over them.
#[derive(Debug)]
pub(super) struct Look {
    /// By its factors alone.
    pub(super) bsdf: Bsdf,
    /// The same with its base colour tinted, point by point; `None` where it is not lit in lanes.
    pub(super) tinted: Option<Tinted>,
    /// More than its base colour varies, or is shown.
    pub(super) is_odd: bool,
    /// What varies the base colour.
    pub(super) base: Option<TextureRef>,
    /// No texture is read where light is computed at vertices.
    pub(super) is_even_at_vertices: bool,
    /// How far the texture of the base colour, which is that of ambient light, is that of highlights, too; `None` where that varies or they have their own.
    pub(super) tints_highlights: Option<Spectrum>,
    /// It reflects light, and shows nothing beside it.
    pub(super) only_reflects: bool,
}

impl Look {
    pub(super) fn new(material: &Material, kind: Kind) -> Self {
        let bsdf = Bsdf::resolve(material, &FactorsOnly);
        let base = material.model.base_color().texture;
        let (ambient, specular, has_even_highlights) = match &material.model {
            Model::Phong(m) => (m.ambient.as_ref(), m.specular.texture, true),
            Model::CookTorrance(m) => (m.ambient.as_ref(), m.specular.texture, true),
            Model::MetallicRoughness(m) => {
                let maps = [m.metallic.texture, m.specular.texture, m.specular_color.texture];
                (None, None, maps.iter().all(Option::is_none))
            }
        };
        let has_own_ambient = ambient.is_some_and(|map| map.texture.is_some() || base.is_some());
        let is_even = has_even_highlights && specular.is_none() && !has_own_ambient;
        let tints_highlights = is_even.then(|| bsdf.share_of_metal());
        // Its emission and alpha are looked at where it does more than reflect.
        let mut n_textures = 0;
        material.clone().for_each_texture(&mut |_| n_textures += 1);
        let allowed = [base, material.emission.texture, material.alpha.value.texture];
        let varies = n_textures > allowed.iter().flatten().count() || has_own_ambient;
        let laid_over = [specular, ambient.and_then(|map| map.texture), material.normal_map.as_ref().map(|map| map.texture)];
        let is_even_at_vertices = n_textures == allowed.iter().chain(&laid_over).flatten().count();
        let only_reflects = kind != Kind::Transparent && !material.unlit && !material.is_emissive();
        let is_odd = varies || !only_reflects;
        Self { tinted: Tinted::new(&bsdf), bsdf, is_odd, base, is_even_at_vertices, tints_highlights, only_reflects }
    }
}
