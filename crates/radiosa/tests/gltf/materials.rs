//! Materials, textures and pictures.

use base64::Engine;
use radiosa::math::Vec2;
use radiosa::scene::{
    AlphaMode, Filter, Material, MaterialId, MetallicRoughness, Model, Pixels, Scene, TextureRef, TextureSource, Wrap,
};
use radiosa::spectrum::Spectrum;
use serde_json::{Value, json};

use super::document::Document;
use super::warned;

/// A picture of 1 × 1 pixels.
fn png() -> String {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(1, 1, image::Rgba([10, 20, 30, 40]))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .expect("a PNG");
    format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes.into_inner()))
}

/// A triangle of this material, with two textures of one picture at hand.
fn document(material: Value) -> Document {
    let mut document = Document::triangle();
    document.push("images", json!({"uri": png(), "name": "pixel"}));
    document.push("samplers", json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}));
    document.push("textures", json!({"source": 0, "sampler": 0}));
    document.push("textures", json!({"source": 0}));
    document.push("materials", material);
    document.json["meshes"][0]["primitives"][0]["material"] = 0.into();
    document
}

fn read(material: Value) -> (Material, MetallicRoughness, Scene) {
    let (scene, warnings) = document(material).load();
    assert!(warnings.is_empty(), "{warnings:?}");
    let material = scene.materials[0].clone();
    let Model::MetallicRoughness(model) = material.model.clone() else { panic!("{material:?}") };
    (material, model, scene)
}

#[test]
fn defaults_are_the_formats() {
    let (material, model, scene) = read(json!({"name": "plain"}));
    assert_eq!(model, MetallicRoughness::default());
    assert_eq!(material.name, "plain");
    assert!(!material.two_sided && !material.unlit && !material.is_emissive() && material.normal_map.is_none());
    assert_eq!(scene.meshes[0].materials, [Some(MaterialId(0))]);
    assert!(Document::triangle().load().0.meshes[0].materials.is_empty());
}

#[test]
fn textures_say_how_they_are_read() {
    let (material, model, scene) = read(json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "baseColorTexture": {"index": 0},
            "metallicFactor": 0.5, "roughnessFactor": 0.25, "metallicRoughnessTexture": {"index": 1, "texCoord": 1},
        },
        "normalTexture": {"index": 0, "scale": 2.0}, "occlusionTexture": {"index": 1, "strength": 0.5},
        "emissiveFactor": [1.0, 2.0, 3.0], "emissiveTexture": {"index": 0},
        "alphaMode": "MASK", "alphaCutoff": 0.75, "doubleSided": true,
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 10.0}, "KHR_materials_unlit": {}},
    }));
    let texture = |r: Option<TextureRef>| scene.textures[r.expect("a texture").texture.index()].clone();
    let base = texture(model.base_color.texture);
    assert!(base.is_srgb && texture(material.emission.texture).is_srgb);
    assert_eq!((base.sampler.wrap_u, base.sampler.wrap_v, base.sampler.filter), (Wrap::Clamp, Wrap::Mirror, Filter::Nearest));
    assert_eq!(model.base_color.texture, material.emission.texture, "made once");
    let normal = material.normal_map.expect("a normal map");
    assert!(!texture(Some(normal.texture)).is_srgb && normal.scale == 2.0 && !normal.is_height);
    assert_eq!((model.metallic.factor, model.metallic.channel), (0.5, 2));
    assert_eq!((model.roughness.factor, model.roughness.channel), (0.25, 1));
    assert_eq!(model.roughness.texture.map(|t| t.uv_set), Some(1));
    assert!(!texture(model.roughness.texture).is_srgb);
    assert!(matches!(model.occlusion, Some((map, 0.5)) if map.channel == 0));
    assert_eq!(model.base_color.factor, Spectrum::new(0.1, 0.2, 0.3));
    assert_eq!(
        (material.alpha.mode, material.alpha.value.factor, material.alpha.value.channel),
        (AlphaMode::Mask { cutoff: 0.75 }, 0.4, 3)
    );
    assert_eq!(material.alpha.value.texture, model.base_color.texture);
    assert_eq!(material.emission.factor, Spectrum::new(10.0, 20.0, 30.0));
    assert!(material.two_sided && material.unlit);
    assert_eq!((scene.images.len(), scene.textures.len()), (1, 3), "one picture, read as colours and as numbers");
    assert_eq!(scene.images[0].name, "pixel");
    let TextureSource::Image(image) = base.source else { panic!("{base:?}") };
    assert!(matches!(&scene.images[image.index()].pixels, Pixels::Rgba8(p) if p[..] == [10, 20, 30, 40]));
}

#[test]
fn texture_transforms_do_what_the_extensions_example_says() {
    // "Only the lower left quadrant of the source image, rotated clockwise 90°", and a set of coordinates of its own.
    let transform = json!({"offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5], "texCoord": 3});
    let (_, model, _) = read(json!({"pbrMetallicRoughness": {
        "baseColorTexture": {"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": transform}},
    }}));
    let reference = model.base_color.texture.expect("a texture");
    assert_eq!(reference.uv_set, 3);
    let transform = reference.transform.expect("a transform");
    for (from, to) in [((0.0, 0.0), (0.0, 1.0)), ((1.0, 0.0), (0.0, 0.5)), ((0.0, 1.0), (0.5, 1.0)), ((1.0, 1.0), (0.5, 0.5))] {
        let found = transform.apply(Vec2::from(from));
        assert!((found - Vec2::from(to)).length() < 1e-6, "{from:?} goes to {found}");
    }
}

#[test]
fn extensions_change_the_surface() {
    let (_, model, _) = read(json!({"extensions": {
        "KHR_materials_ior": {"ior": 1.33},
        "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1.0, 0.5, 0.25], "specularTexture": {"index": 0}},
        "KHR_materials_transmission": {"transmissionFactor": 0.75},
        "KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationDistance": 0.5, "attenuationColor": [1.0, 0.5, 0.25]},
    }}));
    assert_eq!((model.ior, model.specular.factor, model.specular.channel), (1.33, 0.5, 3));
    assert_eq!((model.specular_color.factor, model.transmission.factor), (Spectrum::new(1.0, 0.5, 0.25), 0.75));
    assert!(model.thick && model.specular.texture.is_some());
    // After half a metre half of the green is left.
    let left = (-f64::from(model.absorption.g) * 0.5).exp();
    assert!((left - 0.5).abs() < 1e-6 && model.absorption.r == 0.0, "{:?}", model.absorption);
    assert!((model.absorption.b / model.absorption.g - 2.0).abs() < 1e-6);

    let (_, black, _) =
        read(json!({"extensions": {"KHR_materials_volume": {"attenuationDistance": 1e-3, "attenuationColor": [0, 0, 0]}}}));
    assert!(black.absorption.is_finite() && !black.thick);
    let (_, mirror, _) = read(json!({"extensions": {"KHR_materials_ior": {"ior": 0.0}}}));
    assert!(((mirror.ior - 1.0) / (mirror.ior + 1.0)).powi(2) > 0.999 && mirror.ior.is_finite());
}

#[test]
fn specular_glossiness_becomes_a_specular_colour() {
    let (material, model, _) = read(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
        "extensions": {"KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [0.5, 0.25, 0.125, 0.5], "specularFactor": [0.2, 0.3, 0.4], "glossinessFactor": 0.75,
        }},
    }));
    assert_eq!((model.base_color.factor, material.alpha.value.factor), (Spectrum::new(0.5, 0.25, 0.125), 0.5));
    assert_eq!((model.metallic.factor, model.roughness.factor), (0.0, 0.25));
    let f0 = ((model.ior - 1.0) / (model.ior + 1.0)).powi(2) * model.specular_color.factor.g;
    assert!((f0 - 0.3).abs() < 1e-3, "{f0}");
}

#[test]
fn pictures_that_cannot_be_read_leave_the_factor_and_a_warning() {
    let textured = json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0], "baseColorTexture": {"index": 0}}});
    let broken = [
        json!({"uri": "data:image/png;base64,iVBORw0KGgo="}),
        json!({"uri": "not there.png"}),
        json!({"uri": "../../outside.png"}),
        json!({}),
    ];
    for image in broken {
        let mut document = document(textured.clone());
        document.json["images"][0] = image.clone();
        let (scene, warnings) = document.load();
        assert!(warned(&warnings, "unreadable-picture"), "{image}: {warnings:?}");
        let Model::MetallicRoughness(model) = &scene.materials[0].model else { panic!("{scene:?}") };
        assert_eq!((model.base_color.texture, model.base_color.factor), (None, Spectrum::gray(0.5)));
        assert!(scene.images.is_empty() && scene.textures.is_empty());
    }
    let mut nothing = document(textured.clone());
    nothing.json["textures"][0] = json!({"extensions": {"KHR_texture_basisu": {"source": 0}}});
    assert!(warned(&nothing.load().1, "texture-without-picture"));
    let mut absent = document(textured);
    absent.json["textures"] = json!([]);
    assert_eq!(absent.refusal().0, "/materials/0/pbrMetallicRoughness/baseColorTexture/index");
}

#[test]
fn values_outside_their_range_are_brought_in_and_said() {
    let (scene, warnings) = document(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [2.0, 0.5, -1.0, 1.0], "roughnessFactor": 1e300},
        "alphaMode": "SOMETIMES", "extensions": {"KHR_materials_ior": {"ior": 0.5}},
    }))
    .load();
    let Model::MetallicRoughness(model) = &scene.materials[0].model else { panic!("{scene:?}") };
    assert_eq!((model.base_color.factor, model.roughness.factor, model.ior), (Spectrum::new(1.0, 0.5, 0.0), 1.0, 1.0));
    assert_eq!(scene.materials[0].alpha.mode, AlphaMode::Opaque);
    assert!(warned(&warnings, "value-out-of-range") && warned(&warnings, "unknown-alpha-mode"));
}
