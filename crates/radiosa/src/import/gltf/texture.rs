//! Pictures, and how materials refer to them.

use rayon::prelude::*;

use super::super::{ImportError, Resolver, Warnings, decode_picture};
use super::budget::Budget;
use super::buffer::{Buffers, fetch};
use super::json::{Item, Table};
use crate::math::DVec2;
use crate::scene::{Filter, Image, ImageId, Pixels, Sampler, Texture, TextureId, TextureRef, TextureSource, UvTransform, Wrap};

/// Pictures decoded at once: enough to keep processors busy, few enough to bound what is in flight.
const BATCH: usize = 8;

/// The textures of a document, made for the scene as materials ask for them.
#[derive(Debug)]
pub(super) struct Textures<'a> {
    table: Table<'a>,
    samplers: Table<'a>,
    images: Table<'a>,
    /// The scene's picture of each of the document's, where it could be read.
    image_ids: Vec<Option<ImageId>>,
    /// (texture of the document, is sRGB) of each texture made so far.
    keys: std::collections::HashMap<(usize, bool), TextureId>,
    /// For the scene.
    pub made: Vec<Texture>,
    /// For the scene.
    pub decoded: Vec<Image>,
}

impl<'a> Textures<'a> {
    /// Decodes every picture that a texture of the document uses. One that cannot be read is a warning, not an error:
    /// the material's factor then stands alone.
    pub(super) fn load(
        root: &Item<'a>,
        buffers: &Buffers<'a>,
        resolver: &Resolver,
        budget: &mut Budget,
        warnings: &mut Warnings,
    ) -> Result<Self, ImportError> {
        let mut this = Self {
            table: Table::new(root, "textures", "texture")?,
            samplers: Table::new(root, "samplers", "sampler")?,
            images: Table::new(root, "images", "image")?,
            image_ids: Vec::new(),
            keys: Default::default(),
            made: Vec::new(),
            decoded: Vec::new(),
        };
        let mut wanted = vec![false; this.images.len()];
        for texture in this.table.iter() {
            if let Some(image) = this.image_of(&texture)? {
                wanted[image] = true;
            }
        }
        this.image_ids = vec![None; wanted.len()];
        let wanted: Vec<usize> = (0..wanted.len()).filter(|&i| wanted[i]).collect();
        for batch in wanted.chunks(BATCH) {
            // Each may take its share; only one that needs more gets all that is left, alone.
            let share = budget.left() / batch.len() as u64;
            let images = &this.images;
            let results: Vec<_> =
                batch.par_iter().map(|&i| images.get(i).map(|image| (decode(&image, buffers, resolver, share), image))).collect();
            for (&i, result) in batch.iter().zip(results) {
                let Some((mut result, item)) = result else { continue };
                if matches!(result, Err(ImportError::TooLarge { .. })) {
                    result = decode(&item, buffers, resolver, budget.left());
                }
                let reserved = result.and_then(|image| {
                    budget.reserve(&|| format!("picture {}", item.pointer()), n_bytes(&image))?;
                    Ok(image)
                });
                match reserved {
                    Ok(image) => {
                        this.image_ids[i] = Some(ImageId(this.decoded.len() as u32));
                        this.decoded.push(image);
                    }
                    Err(e) => {
                        let help = e.help();
                        let help = if help.is_empty() { String::new() } else { format!(" ({help})") };
                        let what = format!("the picture at {} is left out, its factor alone is used: {e}{help}", item.pointer());
                        warnings.add("unreadable-picture", root.file(), what);
                    }
                }
            }
        }
        Ok(this)
    }

    /// The picture a texture shows: the WebP one where there is one. A reference to a picture that does not exist counts as none:
    /// the rest of the material is worth showing.
    fn image_of(&self, texture: &Item<'a>) -> Result<Option<usize>, ImportError> {
        let webp = texture.extension("EXT_texture_webp")?;
        for holder in webp.iter().chain([texture]) {
            let source = holder.count("source")?.and_then(|i| usize::try_from(i).ok());
            if let Some(image) = source.filter(|&i| i < self.images.len()) {
                return Ok(Some(image));
            }
        }
        Ok(None)
    }

    /// A material's reference to a texture in member `key`; `None` when there is none or its picture could not be read.
    pub(super) fn reference(
        &mut self,
        owner: &Item<'a>,
        key: &str,
        is_srgb: bool,
        warnings: &mut Warnings,
    ) -> Result<Option<TextureRef>, ImportError> {
        let Some(info) = owner.object(key)? else { return Ok(None) };
        let index = info.require("index")?;
        let (number, texture) = self.table.resolve(&index)?;
        let mut uv_set = info.count("texCoord")?.unwrap_or(0);
        let mut transform = None;
        if let Some(t) = info.extension("KHR_texture_transform")? {
            uv_set = t.count("texCoord")?.unwrap_or(uv_set);
            let offset = DVec2::from(t.numbers::<2>("offset")?.unwrap_or([0.0; 2]));
            let scale = DVec2::from(t.numbers::<2>("scale")?.unwrap_or([1.0; 2]));
            let rotation = t.number("rotation")?.unwrap_or(0.0);
            let identity = offset == DVec2::ZERO && scale == DVec2::ONE && rotation == 0.0;
            transform = (!identity).then(|| UvTransform::new(offset, rotation, scale));
        }
        let Some(image) = self.image_of(&texture)? else {
            let what =
                format!("the texture at {} has no picture of a kind that is read; its factor alone is used", texture.pointer());
            warnings.add("texture-without-picture", owner.file(), what);
            return Ok(None);
        };
        let Some(image) = self.image_ids[image] else { return Ok(None) };
        let id = match self.keys.get(&(number, is_srgb)) {
            Some(&id) => id,
            None => {
                let sampler = match self.samplers.resolve_in(&texture, "sampler")? {
                    Some((_, item)) => sampler(&item, warnings)?,
                    None => Sampler::default(),
                };
                let id = TextureId(self.made.len() as u32);
                self.made.push(Texture { source: TextureSource::Image(image), sampler, is_srgb });
                self.keys.insert((number, is_srgb), id);
                id
            }
        };
        let uv_set = u32::try_from(uv_set).map_err(|_| info.error("the set of texture coordinates has an absurd number"))?;
        Ok(Some(TextureRef { texture: id, uv_set, transform }))
    }
}

fn n_bytes(image: &Image) -> u64 {
    let texel = match image.pixels {
        Pixels::Rgba8(_) => 4,
        Pixels::Rgba16(_) => 8,
        Pixels::Rgba32F(_) => 16,
    };
    u64::from(image.width) * u64::from(image.height) * texel
}

fn decode(image: &Item<'_>, buffers: &Buffers<'_>, resolver: &Resolver, max_memory: u64) -> Result<Image, ImportError> {
    let mut name = image.name();
    let mut at = image.location();
    let mut picture = match (image.get("uri")?, image.get("bufferView")?) {
        (Some(uri), _) => {
            let text = uri.as_text()?;
            if !text.starts_with("data:") {
                if let Ok(path) = resolver.find(&percent_encoding::percent_decode_str(text).decode_utf8_lossy()) {
                    at.path = path;
                    at.pointer = None;
                }
                name = text.to_owned();
            }
            decode_picture(&fetch(&uri, resolver)?, &at, max_memory)?
        }
        (None, Some(view)) => decode_picture(buffers.view(&view)?.bytes, &at, max_memory)?,
        (None, None) => return Err(image.error("the image has neither `uri` nor `bufferView`")),
    };
    picture.name = if name.is_empty() { image.pointer().to_owned() } else { name };
    Ok(picture)
}

fn sampler(item: &Item<'_>, warnings: &mut Warnings) -> Result<Sampler, ImportError> {
    let mut odd = |key: &str, value: u64| {
        let what = format!("{value} is no {key} (at {}); the default is used", item.pointer());
        warnings.add("unknown-sampler-value", item.file(), what);
    };
    let mut wrap = |key: &str| -> Result<Wrap, ImportError> {
        Ok(match item.count(key)? {
            None | Some(10497) => Wrap::Repeat,
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            Some(other) => {
                odd(key, other);
                Wrap::Repeat
            }
        })
    };
    let (wrap_u, wrap_v) = (wrap("wrapS")?, wrap("wrapT")?);
    let filter = match item.count("magFilter")? {
        Some(9728) => Filter::Nearest,
        None | Some(9729) => Filter::Bilinear,
        Some(other) => {
            odd("magFilter", other);
            Filter::Bilinear
        }
    };
    Ok(Sampler { wrap_u, wrap_v, filter })
}
