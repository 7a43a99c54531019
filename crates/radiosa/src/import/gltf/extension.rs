//! Which extensions are read, which can be left out, and what to do about the others.

use std::path::Path;

use super::super::{ImportError, Warnings};
use super::json::Item;

/// Read and honoured.
const SUPPORTED: [&str; 14] = [
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "FB_ngon_encoding",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Known by name, not read: a file can be shown without them even where it requires them, with what is then missing.
const LEFT_OUT: [(&str, &str); 16] = [
    ("KHR_animation_pointer", "animation is not read"),
    ("KHR_materials_anisotropy", "highlights are isotropic"),
    ("KHR_materials_clearcoat", "the clear coat is left out"),
    ("KHR_materials_diffuse_transmission", "nothing is transmitted diffusely"),
    ("KHR_materials_dispersion", "all colours refract alike"),
    ("KHR_materials_iridescence", "the thin film is left out"),
    ("KHR_materials_sheen", "the sheen is left out"),
    ("KHR_materials_subsurface", "no light travels below the surface"),
    ("KHR_materials_variants", "the default materials are shown"),
    ("KHR_materials_volume_scatter", "volumes absorb and do not scatter"),
    ("KHR_node_hoverability", "it concerns interaction only"),
    ("KHR_node_selectability", "it concerns interaction only"),
    ("KHR_xmp", "it holds metadata only"),
    ("KHR_xmp_json_ld", "it holds metadata only"),
    ("EXT_structural_metadata", "it holds metadata only"),
    ("EXT_mesh_features", "it holds metadata only"),
];

/// The same, where a file also carries what is needed without them; required, they are refused. With what to do then.
const PACKED: [(&str, &str); 9] = [
    ("KHR_draco_mesh_compression", "unpack it first: `gltf-transform copy in.glb out.glb`, or export without compression"),
    ("EXT_meshopt_compression", "unpack it first: `gltf-transform copy in.glb out.glb`, or `gltfpack` without -c"),
    ("KHR_meshopt_compression", "unpack it first: `gltf-transform copy in.glb out.glb`, or `gltfpack` without -c"),
    ("KHR_texture_basisu", "convert its pictures first: `gltf-transform ktxdecompress in.glb out.glb`"),
    ("KHR_texture_ktx", "convert its pictures to PNG, JPEG or WebP"),
    ("EXT_texture_astc", "convert its pictures to PNG, JPEG or WebP"),
    ("EXT_texture_avif", "convert its pictures first: `gltf-transform png in.glb out.glb`"),
    ("MSFT_texture_dds", "convert its pictures to PNG, JPEG or WebP"),
    ("MSFT_packing_occlusionRoughnessMetallic", "export with the textures of core glTF"),
];

/// The error for a required extension that is not supported.
pub(super) fn unsupported(file: &Path, name: &str) -> ImportError {
    let help = PACKED.iter().find(|(n, _)| *n == name).map_or(
        "export without it; if the file makes sense without it, move its name from extensionsRequired to extensionsUsed",
        |(_, help)| help,
    );
    ImportError::Unsupported { path: file.into(), feature: format!("the extension {name}"), help: help.into() }
}

/// Refuses required extensions that are not supported and warns about others that are left out.
pub(super) fn check(root: &Item<'_>, warnings: &mut Warnings) -> Result<(), ImportError> {
    let left_out = |name: &str| LEFT_OUT.iter().find(|(n, _)| *n == name).map(|&(_, what)| what);
    for item in root.array("extensionsRequired")?.iter() {
        let name = item.as_text()?;
        if SUPPORTED.contains(&name) {
            continue;
        }
        // Some can be left out and the file still be shown; that is said, whether or not it is listed as used too.
        let what = left_out(name).ok_or_else(|| unsupported(root.file(), name))?;
        warnings.add("ignored-extension", root.file(), format!("{name} is not supported: {what}"));
    }
    for item in root.array("extensionsUsed")?.iter() {
        let name = item.as_text()?;
        if SUPPORTED.contains(&name) {
            continue;
        }
        let what = if PACKED.iter().any(|(n, _)| *n == name) {
            "what the file provides without it is read instead"
        } else {
            left_out(name).unwrap_or("its data are left out")
        };
        warnings.add("ignored-extension", root.file(), format!("{name} is not supported: {what}"));
    }
    Ok(())
}
