//! EXR files as named channels of floats, read without Radiosa's own reader.

use std::collections::BTreeMap;
use std::path::Path;

/// The first part of an EXR file.
#[derive(Clone, Debug)]
pub struct ExrFile {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Every channel by its name, row-major from the top left; halves and whole numbers converted.
    pub channels: BTreeMap<String, Vec<f32>>,
}

impl ExrFile {
    /// Reads a file.
    ///
    /// # Panics
    /// When it is missing or damaged: a test that needs it cannot go on.
    pub fn read(path: &Path) -> Self {
        let picture =
            exr::prelude::read_first_flat_layer_from_file(path).unwrap_or_else(|e| panic!("cannot read {}: {e}", path.display()));
        let layer = picture.layer_data;
        let channels =
            layer.channel_data.list.into_iter().map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect();
        Self { width: layer.size.width(), height: layer.size.height(), channels }
    }

    /// Three channels, interleaved: `R`, `G`, `B` of a layer, or with an empty name the main ones.
    ///
    /// # Panics
    /// When one is missing.
    pub fn rgb(&self, layer: &str) -> Vec<f32> {
        let [r, g, b] = ["R", "G", "B"].map(|c| {
            let name = if layer.is_empty() { c.to_owned() } else { format!("{layer}.{c}") };
            self.channels.get(&name).unwrap_or_else(|| panic!("no channel {name} among {:?}", self.channels.keys()))
        });
        r.iter().zip(g).zip(b).flat_map(|((r, g), b)| [*r, *g, *b]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_picture_of_the_cornell_box_has_its_size_and_brightness() {
        let file = ExrFile::read(&crate::data_dir().join("cornell-box/reference.exr"));
        assert_eq!((file.width, file.height), (512, 512));
        let rgb = file.rgb("");
        assert_eq!(rgb.len(), 3 * 512 * 512);
        // The usual ε of 0.01 is what this picture has.
        let eps = crate::image::epsilon(&rgb);
        assert!((0.005..0.02).contains(&eps), "{eps}");
    }
}
