//! The JSON block of an avatar file: its version and what its tensors do not say.

use ghand_core::Side;
use ghand_files::json_error::plain_json_error;
use serde::{Deserialize, Serialize};

use crate::avatar::{Avatar, Provenance};
use crate::light::LightKind;
use crate::properties::PropertyTables;
use crate::properties::baked::tensors::{self as baked, BakedMetadata};
use crate::template::AvatarConfig;

/// The newest version that this program writes and reads: that of avatars whose light falls on a divided mesh.
const NEWEST_VERSION: u32 = 7;
/// Version of avatars with lamps near the hand or light that skin throws on skin.
const NEAR_VERSION: u32 = 6;
/// Version of avatars with plain skinning, which have no tables of residual terms.
const PLAIN_VERSION: u32 = 5;
/// Version of baked avatars.
const BAKED_VERSION: u32 = 4;
/// Version of avatars in a light. Version 1 had no `response_limits`, and its response
/// depended on the root's rotation; version 2 had no light.
const LIT_VERSION: u32 = 3;
/// Version of avatars without light, which other programs may read.
const UNLIT_VERSION: u32 = 2;

/// The JSON block.
#[derive(Serialize, Deserialize)]
pub(super) struct Metadata {
    pub(super) format: String,
    pub(super) version: u32,
    pub(super) units: String,
    pub(super) model: ModelMetadata,
    pub(super) config: AvatarConfig,
    /// The property model, which determines the tensors. Omitted for the first model, `direct`.
    #[serde(default, skip_serializing_if = "ModelTag::is_first")]
    pub(super) property_model: ModelTag,
    /// The kind of light, if light is apart from skin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) light: Option<LightKind>,
    /// Whether it falls on the mesh with each triangle divided into four. Omitted where it falls on the mesh itself.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) light_divided: bool,
    /// What the tensors of a baked avatar do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) baked: Option<BakedMetadata>,
    pub(super) provenance: Provenance,
}

impl Metadata {
    /// What the file of an avatar says about it.
    pub(super) fn of(avatar: &Avatar) -> Metadata {
        Metadata {
            format: "ghand-avatar".into(),
            version: match (&avatar.tables, &avatar.light) {
                (_, Some(lit)) if lit.divided => NEWEST_VERSION,
                (_, Some(lit)) if lit.light.lamps.is_some() || lit.interreflection != [0.0; 3] => NEAR_VERSION,
                (PropertyTables::Baked(_), _) => BAKED_VERSION,
                _ if avatar.config.plain_skinning => PLAIN_VERSION,
                (_, Some(_)) => LIT_VERSION,
                (_, None) => UNLIT_VERSION,
            },
            units: "metre".into(),
            model: ModelMetadata {
                name: avatar.template.name.clone(),
                side: if avatar.template.side == Side::Left { "left" } else { "right" }.into(),
                joint_names: avatar.template.joint_names.clone(),
                parents: avatar.template.parents.clone(),
            },
            config: avatar.config.clone(),
            property_model: ModelTag::of(&avatar.tables),
            light: avatar.light.as_ref().map(|lit| lit.light.kind),
            light_divided: avatar.light.as_ref().is_some_and(|lit| lit.divided),
            baked: match &avatar.tables {
                PropertyTables::Baked(tables) => Some(baked::metadata(tables)),
                _ => None,
            },
            provenance: avatar.provenance.clone(),
        }
    }

    /// Reads the block; the error is the wrong field, and what is wrong.
    pub(super) fn parse(block: &str) -> Result<Metadata, (&'static str, String)> {
        // The version comes first: an unknown version may have other fields.
        let fields: serde_json::Value = serde_json::from_str(block).map_err(|e| broken(&e))?;
        let reads = format!("this program reads version {NEWEST_VERSION}");
        match fields.get("version").and_then(serde_json::Value::as_u64) {
            Some(v) if (u64::from(UNLIT_VERSION)..=u64::from(NEWEST_VERSION)).contains(&v) => {}
            Some(v) if v < u64::from(UNLIT_VERSION) => {
                return Err(("version", format!("is {v}, {reads}; train the avatar again")));
            }
            other => {
                let found = other.map_or("none".to_owned(), |v| v.to_string());
                return Err(("version", format!("is {found}, {reads}; use the ghand that wrote it")));
            }
        }
        if fields.pointer("/config/residual_support").is_some() {
            let problem = "was removed in 0.2; train the avatar again, or use ghand 0.1";
            return Err(("residual_support", problem.into()));
        }
        serde_json::from_str(block).map_err(|e| ("metadata", plain_json_error(&e)))
    }
}

/// That the file is none of an avatar.
pub(super) fn broken(error: &dyn std::fmt::Display) -> (&'static str, String) {
    ("file", format!("is not an avatar, or is truncated ({error}); export it again"))
}

/// The property model of an avatar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ModelTag {
    #[default]
    Direct,
    Network,
    Baked,
}

impl ModelTag {
    fn of(tables: &PropertyTables) -> ModelTag {
        match tables {
            PropertyTables::Direct(_) => ModelTag::Direct,
            PropertyTables::Network(_) => ModelTag::Network,
            PropertyTables::Baked(_) => ModelTag::Baked,
        }
    }

    fn is_first(&self) -> bool {
        *self == ModelTag::default()
    }
}

/// The skeleton.
#[derive(Serialize, Deserialize)]
pub(super) struct ModelMetadata {
    pub(super) name: String,
    pub(super) side: String,
    pub(super) joint_names: Vec<String>,
    pub(super) parents: Vec<Option<usize>>,
}
