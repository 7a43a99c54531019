//! What of a material is the same wherever it is seen.

use super::surfaces::Kind;
use crate::bsdf::{Bsdf, FactorsOnly};
use crate::scene::{Material, Model, TextureRef};
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
    /// How far the texture of the base colour is that of highlights, too; `None` where they have their own.
    pub(super) tints_highlights: Option<f32>,
    /// It reflects light, and shows nothing beside it.
    pub(super) only_reflects: bool,
}

impl Look {
    pub(super) fn new(material: &Material, kind: Kind) -> Self {
        let bsdf = Bsdf::resolve(material, &FactorsOnly);
        let (base, has_own_ambient, tints_highlights) = match &material.model {
            Model::Phong(m) => (m.diffuse.texture, m.ambient.is_some(), m.specular.texture.is_none().then_some(0.0)),
            Model::CookTorrance(m) => (m.diffuse.texture, m.ambient.is_some(), m.specular.texture.is_none().then_some(0.0)),
            Model::MetallicRoughness(m) => (m.base_color.texture, false, Some(m.metallic.factor)),
        };
        // Its emission and alpha are looked at where it does more than reflect.
        let mut n_textures = 0;
        material.clone().for_each_texture(&mut |_| n_textures += 1);
        let allowed = [base, material.emission.texture, material.alpha.value.texture];
        let varies = n_textures > allowed.iter().flatten().count() || (has_own_ambient && base.is_some());
        let only_reflects = kind != Kind::Transparent && !material.unlit && !material.is_emissive();
        Self { tinted: Tinted::new(&bsdf), bsdf, is_odd: varies || !only_reflects, base, tints_highlights, only_reflects }
    }
}
