//! The look of a hand's skin as a material of glTF.

use serde_json::json;

use crate::files::glb_document::GlbDocument;

/// Roughness of skin that has none of its own.
const ROUGHNESS: f64 = 0.6;
/// Index of refraction of skin: 0.028 of the light is mirrored head-on.
const REFRACTION: f64 = 1.4;

/// The look of a hand's skin.
#[derive(Debug, Clone, PartialEq)]
pub struct Skin {
    /// A PNG file: the colours on the UV atlas.
    pub png: Vec<u8>,
    /// Whether light is part of the colours, so that programs must not light them again.
    pub is_lit: bool,
    /// What the skin mirrors.
    pub gloss: Option<Gloss>,
}

/// What skin mirrors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gloss {
    /// Roughness, from 0 to 1: the square root of that of the GGX distribution, as in glTF.
    pub roughness: f64,
    /// How strong it is, from 0 to 1.
    pub strength: f64,
}

impl Skin {
    /// Adds image, texture and material; returns the material's number.
    pub(super) fn add(&self, document: &mut GlbDocument<'_>) -> usize {
        let view = document.bytes(&self.png);
        let image = document.push("images", json!({"bufferView": view, "mimeType": "image/png", "name": "skin"}));
        // Linear with mipmaps; the atlas has no neighbours beyond its edges.
        let sampler =
            document.push("samplers", json!({"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}));
        let texture = document.push("textures", json!({"source": image, "sampler": sampler}));
        let roughness = self.gloss.map_or(ROUGHNESS, |gloss| gloss.roughness);
        let mut material = json!({
            "name": "skin",
            "pbrMetallicRoughness": {
                "baseColorTexture": {"index": texture}, "metallicFactor": 0.0, "roughnessFactor": roughness
            },
        });
        if self.is_lit {
            document.use_extension("KHR_materials_unlit");
            material["extensions"] = json!({"KHR_materials_unlit": {}});
        } else {
            document.use_extension("KHR_materials_ior");
            document.use_extension("KHR_materials_specular");
            let strength = self.gloss.map_or(1.0, |gloss| gloss.strength);
            material["extensions"] = json!({
                "KHR_materials_ior": {"ior": REFRACTION}, "KHR_materials_specular": {"specularFactor": strength}
            });
        }
        document.push("materials", material)
    }
}
