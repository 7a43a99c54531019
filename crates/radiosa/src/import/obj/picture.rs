//! Pictures that materials name: each file is read and decoded once.

use std::collections::HashMap;
use std::path::PathBuf;

use super::text::shown;
use crate::import::{ImportError, Location, Resolver, Warnings, decode_picture};
use crate::scene::{Image, ImageId, Pixels, Sampler, Texture, TextureId, TextureSource, Wrap};

/// The pictures and textures of a scene in the making.
pub(super) struct Pictures<'a> {
    resolver: &'a Resolver,
    pub images: Vec<Image>,
    pub textures: Vec<Texture>,
    /// By folder and name, and by the path found; `None`: cannot be used, which has been said.
    known_names: HashMap<(String, String), Option<ImageId>>,
    known: HashMap<PathBuf, Option<ImageId>>,
    known_textures: HashMap<(ImageId, bool, bool), TextureId>,
    surveys: HashMap<ImageId, Survey>,
    memory: u64,
    missing: Vec<String>,
    outside: Vec<String>,
}

/// How many pictures may be missing before no more are looked for: each costs looks at the disk.
const MAX_MISSING: usize = 1000;

/// What a picture's pixels tell about its use.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Survey {
    /// As blue as no map of heights or opacities is.
    pub looks_like_normals: bool,
    /// Some pixel is not opaque.
    pub has_alpha: bool,
}

impl<'a> Pictures<'a> {
    pub(super) fn new(resolver: &'a Resolver) -> Self {
        let memory = resolver.options().max_memory;
        Self {
            resolver,
            images: Vec::new(),
            textures: Vec::new(),
            known_names: HashMap::new(),
            known: HashMap::new(),
            surveys: HashMap::new(),
            known_textures: HashMap::new(),
            memory,
            missing: Vec::new(),
            outside: Vec::new(),
        }
    }

    /// Says once what could not be found.
    pub(super) fn report(&self, warnings: &mut Warnings) {
        for (list, name, what) in [
            (&self.missing, "picture-missing", "missing: factors alone are used"),
            (&self.outside, "picture-outside", "outside the scene's folder and not used: allow it with --allow-outside DIR"),
        ] {
            let shown = |name: &String| format!("{:?}", shown(name.as_bytes()));
            let message = match list.as_slice() {
                [] => continue,
                [one] => format!("the picture {} is {what}", shown(one)),
                many => {
                    let first: Vec<_> = many.iter().take(4).map(shown).collect();
                    let more = if many.len() > first.len() { ", …" } else { "" };
                    let least = if many.len() == MAX_MISSING { "at least " } else { "" };
                    format!("{least}{} pictures are {what} ({}{more})", many.len(), first.join(", "))
                }
            };
            warnings.add(name, self.resolver.path(), message);
        }
    }

    /// The picture of some name, relative to `folder` (that of the MTL file, itself relative to the OBJ file's).
    /// `None` when it cannot be used, with a warning.
    pub(super) fn image(&mut self, name: &str, folder: &str, warnings: &mut Warnings) -> Option<ImageId> {
        let key = (folder.to_owned(), name.to_owned());
        if let Some(known) = self.known_names.get(&key) {
            return *known;
        }
        let image = self.load(name, folder, warnings);
        self.known_names.insert(key, image);
        image
    }

    fn load(&mut self, name: &str, folder: &str, warnings: &mut Warnings) -> Option<ImageId> {
        if self.missing.len() + self.outside.len() >= MAX_MISSING {
            return None;
        }
        let main = self.resolver.path();
        let path = match find(self.resolver, name, folder) {
            Ok((path, moved)) => {
                if moved {
                    let message = format!("{name:?} is not where the material says; {} is used", path.display());
                    warnings.add("picture-moved", main, message);
                }
                path
            }
            Err(reason) => {
                let list = if matches!(reason, ImportError::Unsupported { .. }) { &mut self.outside } else { &mut self.missing };
                list.push(name.to_owned());
                return None;
            }
        };
        if let Some(known) = self.known.get(&path) {
            return *known;
        }
        let image = self.decode(&path).map_err(|error| {
            let message = format!("the picture {name:?} cannot be read and its factor alone is used: {error}");
            warnings.add("picture-unreadable", main, message);
        });
        let id = image.ok().map(|mut image| {
            image.name = name.to_owned();
            self.images.push(image);
            ImageId(self.images.len() as u32 - 1)
        });
        self.known.insert(path, id);
        id
    }

    fn decode(&mut self, path: &std::path::Path) -> Result<Image, ImportError> {
        let bytes = self.resolver.read_found(path)?;
        let image = decode_picture(&bytes, &Location::file(path), self.memory)?;
        let bytes_per_pixel = match image.pixels {
            Pixels::Rgba8(_) => 4,
            Pixels::Rgba16(_) => 8,
            Pixels::Rgba32F(_) => 16,
        };
        self.memory = self.memory.saturating_sub(u64::from(image.width) * u64::from(image.height) * bytes_per_pixel);
        Ok(image)
    }

    /// What the picture of a texture looks like.
    pub(super) fn survey(&mut self, texture: TextureId) -> Survey {
        match self.textures[texture.index()].source {
            TextureSource::Image(id) => *self.surveys.entry(id).or_insert_with(|| survey(&self.images[id.index()])),
            TextureSource::Checker { .. } => Survey::default(),
        }
    }

    /// A picture as a texture.
    pub(super) fn texture(&mut self, image: ImageId, is_srgb: bool, clamp: bool) -> TextureId {
        let next = TextureId(self.textures.len() as u32);
        let id = *self.known_textures.entry((image, is_srgb, clamp)).or_insert(next);
        if id == next {
            let wrap = if clamp { Wrap::Clamp } else { Wrap::Repeat };
            let sampler = Sampler { wrap_u: wrap, wrap_v: wrap, ..Sampler::default() };
            self.textures.push(Texture { source: TextureSource::Image(image), sampler, is_srgb });
        }
        id
    }
}

/// Where a file named in an MTL or OBJ file is: as written from the MTL's folder, then from the OBJ's, then (files that were
/// moved here from elsewhere) by its last part beside either. True when only the last succeeded.
pub(super) fn find(resolver: &Resolver, name: &str, folder: &str) -> Result<(PathBuf, bool), ImportError> {
    let inside = |name: &str| if folder.is_empty() { name.to_owned() } else { format!("{folder}/{name}") };
    let first = match resolver.find(&inside(name)) {
        Ok(path) if path.is_file() => return Ok((path, false)),
        Ok(path) => ImportError::Io { path, source: std::io::ErrorKind::NotFound.into() },
        Err(error) => error,
    };
    let last = name.rsplit(['/', '\\']).next().unwrap_or(name);
    for (candidate, moved) in [(name.to_owned(), false), (inside(last), true), (last.to_owned(), true)] {
        if let Ok(path) = resolver.find(&candidate)
            && path.is_file()
        {
            return Ok((path, moved));
        }
    }
    Err(first)
}

/// Looks at the pixels; those of more than 8 bits are not looked at.
fn survey(image: &Image) -> Survey {
    /// Pixels looked at for the mean: enough to tell a map of normals from one of heights.
    const SAMPLES: usize = 4096;
    let Pixels::Rgba8(pixels) = &image.pixels else { return Survey::default() };
    let n = pixels.len() / 4;
    let mut sum = [0u64; 3];
    let mut count = 0;
    for pixel in pixels.chunks_exact(4).step_by(n.div_ceil(SAMPLES).max(1)) {
        for (s, &c) in sum.iter_mut().zip(pixel) {
            *s += u64::from(c);
        }
        count += 1;
    }
    let [r, g, b] = sum.map(|s| s as f64 / f64::from(255 * count.max(1)));
    Survey {
        looks_like_normals: (r - 0.5).abs() < 0.1 && (g - 0.5).abs() < 0.1 && b > 0.8,
        has_alpha: pixels.chunks_exact(4).any(|pixel| pixel[3] != 255),
    }
}
