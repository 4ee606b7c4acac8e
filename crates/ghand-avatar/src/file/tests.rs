//! Files of avatars: what is written is read, and what is damaged is rejected.

use super::*;
use crate::light::{AvatarLight, Gloss, Lamp, Lamps, Light, LightKind, Trust};
use crate::properties::PropertyTables;
use crate::properties::direct::DirectTables;
use crate::properties::direct::table_lengths;
use crate::template::AvatarConfig;
use ghand_core::pose_offsets::{PoseOffsets, TrackerOffsets};
use ghand_hand_model::surface::sample_surface;
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::{DMat3, DQuat, DVec3};
use safetensors::SafeTensors;
use safetensors::tensor::Dtype;

/// A small avatar in a light from directions.
fn lit() -> Avatar {
    let mut avatar = small();
    let samples = sample_surface(&avatar.model, 16).unwrap();
    let coefficients = (0..64).map(|k| [k as f32 / 31.5, 1.0, 0.0]).collect();
    let trust = Trust::new((0..64).map(|k| [k as f32 / 63.0, 5.0]).collect());
    avatar.light = Some(AvatarLight::new(
        Light { kind: LightKind::Transfer, turn: DQuat::from_rotation_x(0.3), coefficients, lamps: None, trust },
        Some(Gloss { roughness: 0.5, strengths: vec![[0.5, 0.0, 1.5]; avatar.template.joint_count()] }),
        &samples,
    ));
    avatar
}

/// The same with lamps, and light that skin throws on skin.
fn near() -> Avatar {
    let mut avatar = lit();
    let on_avatar = avatar.light.as_mut().unwrap();
    let lamp = |x: f64| Lamp { offset: DVec3::new(x, 0.3, 0.0), radius: 0.1, radiance: [3.0, 2.0, 0.5] };
    let lamps = vec![lamp(0.5), lamp(-0.7)];
    on_avatar.light.lamps = Some(Lamps { place: DVec3::new(0.1, 0.2, 0.3), reach: 0.2, lamps });
    on_avatar.interreflection = [0.5, 0.25, 0.0];
    avatar
}

#[test]
fn lamps_are_read_as_they_were_written_and_damaged_ones_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.ghand");
    near().save(&path).unwrap();
    assert_eq!(Avatar::load(&path).unwrap().light, near().light);
    fn lamps(light: &mut AvatarLight) -> &mut Lamps {
        light.light.lamps.as_mut().unwrap()
    }
    type Damage = (&'static str, fn(&mut AvatarLight));
    let spoil: [Damage; 10] = [
        ("light.lamps", |l| lamps(l).lamps[1].radius = -0.1),
        ("light.lamps", |l| lamps(l).lamps[0].radiance[2] = -1.0),
        ("light.lamps", |l| lamps(l).lamps[0].radiance[1] = f32::INFINITY),
        ("light.lamps", |l| lamps(l).lamps[0].offset.y = f64::NAN),
        ("light.lamps", |l| lamps(l).lamps[1].offset = DVec3::ZERO),
        ("light.lamps", |l| lamps(l).reach = 3.0),
        ("light.place", |l| lamps(l).reach = -1.0),
        ("light.place", |l| lamps(l).place.z = f64::INFINITY),
        ("light.interreflection", |l| l.interreflection[0] = 1.5),
        ("light.interreflection", |l| l.interreflection[1] = f32::NAN),
    ];
    for (field, spoil) in spoil {
        let mut avatar = near();
        spoil(avatar.light.as_mut().unwrap());
        let error = avatar.save(&path).unwrap_err();
        assert!(matches!(&error, AvatarFileError::Unreadable { field: f, .. } if f == field), "{field}: {error}");
    }
    assert_eq!(Avatar::load(&path).unwrap().light, near().light, "the file is as it was");
}

#[test]
fn a_light_on_a_divided_mesh_may_name_four_times_the_triangles() {
    let mut avatar = near();
    let count = avatar.model.faces.len() as u32;
    let on_avatar = avatar.light.as_mut().unwrap();
    on_avatar.faces.iter_mut().for_each(|face| *face = 4 * *face + 3);
    on_avatar.faces[0] = 4 * count - 1;
    on_avatar.divided = true;
    let bytes = avatar.to_bytes(Path::new("a")).unwrap();
    assert_eq!(from_bytes(Path::new("a"), &bytes).unwrap().light, avatar.light);
    let version = |avatar: &Avatar| {
        let bytes = avatar.to_bytes(Path::new("a")).unwrap();
        let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
        let blocks: Vec<String> = header.metadata().clone().unwrap().into_values().collect();
        let version = |block: &String| serde_json::from_str::<serde_json::Value>(block).ok()?["version"].as_u64();
        blocks.iter().find_map(version).unwrap()
    };
    assert_eq!([version(&avatar), version(&near())], [7, 6]);
    avatar.light.as_mut().unwrap().faces[0] = 4 * count;
    let error = avatar.save(Path::new("/dev/null/x")).unwrap_err();
    assert!(matches!(&error, AvatarFileError::Unreadable { field: f, .. } if f == "light.faces"), "{error}");
}

#[test]
fn a_light_is_read_as_it_was_written_and_a_damaged_one_is_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.ghand");
    lit().save(&path).unwrap();
    let read = Avatar::load(&path).unwrap();
    assert_eq!(read.light, lit().light);
    assert!(read.light.is_some());
    type Damage = (&'static str, fn(&mut AvatarLight));
    let spoil: [Damage; 12] = [
        ("light.roughness", |l| l.gloss.as_mut().unwrap().roughness = 0.0),
        ("light.roughness", |l| l.gloss.as_mut().unwrap().roughness = f64::NAN),
        ("light.gloss", |l| l.gloss.as_mut().unwrap().strengths[1][2] = -0.1),
        ("light.gloss", |l| l.gloss.as_mut().unwrap().strengths.truncate(2)),
        ("light.coefficients", |l| l.light.coefficients[3][1] = -0.1),
        ("light.coefficients", |l| l.light.coefficients[3][1] = f32::NAN),
        ("light.coefficients", |l| l.light.coefficients.truncate(9)),
        ("light.turn", |l| l.light.turn.w = 2.0),
        ("light.turn", |l| l.light.turn.x = f64::NAN),
        ("light.faces", |l| l.faces[2] = 1 << 30),
        ("light.faces", |l| l.faces.truncate(3)),
        ("light.barycentric", |l| l.barycentric[0][0] = f32::INFINITY),
    ];
    for (field, spoil) in spoil {
        let mut avatar = lit();
        spoil(avatar.light.as_mut().unwrap());
        let error = avatar.save(&path).unwrap_err();
        assert!(matches!(&error, AvatarFileError::Unreadable { field: f, .. } if f == field), "{field}: {error}");
    }
}

/// The bytes of an avatar's file without one of its tensors.
fn without_tensor(avatar: &Avatar, name: &str) -> Vec<u8> {
    let bytes = avatar.to_bytes(Path::new("a")).unwrap();
    let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
    let all = SafeTensors::deserialize(&bytes).unwrap();
    assert!(all.tensor(name).is_ok(), "{name}");
    let others = all.tensors().into_iter().filter(|(other, _)| other != name);
    serialize(others, header.metadata().clone()).unwrap()
}

#[test]
fn files_from_before_a_light_could_be_turned_have_an_unturned_one() {
    let read = from_bytes(Path::new("a"), &without_tensor(&lit(), "light.turn")).unwrap().light.unwrap();
    let mut expected = lit().light.unwrap();
    expected.light.turn = DQuat::IDENTITY;
    assert_eq!(read, expected);
}

#[test]
fn a_light_of_a_file_that_says_nothing_of_trust_is_trusted_everywhere() {
    let read = from_bytes(Path::new("a"), &without_tensor(&lit(), "light.trust")).unwrap().light.unwrap();
    let mut expected = lit().light.unwrap();
    expected.light.trust = None;
    assert_eq!(read, expected);
}

#[test]
fn a_trust_that_is_no_part_is_rejected() {
    let bytes = lit().to_bytes(Path::new("a")).unwrap();
    let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
    let all = SafeTensors::deserialize(&bytes).unwrap();
    let with = |values: &[[f32; 2]]| {
        let raw: &[u8] = bytemuck::cast_slice(values);
        let trust = TensorView::new(Dtype::F32, vec![values.len(), 2], raw).unwrap();
        let tensors = all.tensors().into_iter().map(|(name, view)| {
            let view = if name == "light.trust" { trust.clone() } else { view };
            (name, view)
        });
        from_bytes(Path::new("a"), &serialize(tensors, header.metadata().clone()).unwrap())
    };
    assert!(with(&[[0.5; 2]; 64]).is_ok());
    let mut values = [[0.5; 2]; 64];
    for bad in [[-0.1, 1.0], [1.5, 1.0], [f32::NAN, 1.0], [0.5, -1.0]] {
        values[7] = bad;
        let error = with(&values).unwrap_err().to_string();
        assert!(error.contains("light.trust"), "{bad:?}: {error}");
    }
    assert!(with(&[[0.5; 2]; 9]).unwrap_err().to_string().contains("light.trust"));
}

#[test]
fn what_training_saw_is_optional_and_not_negative() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.ghand");
    let mut avatar = small();
    assert_eq!(avatar.seen, None);
    let seen: Vec<f32> = (0..avatar.template.len()).map(|p| p as f32 / 7.0).collect();
    avatar.seen = Some(seen.clone());
    avatar.save(&path).unwrap();
    assert_eq!(Avatar::load(&path).unwrap().seen, Some(seen));
    let without = without_tensor(&avatar, "seen");
    assert_eq!(from_bytes(Path::new("a"), &without).unwrap(), small());
    type Damage = fn(&mut Vec<f32>);
    let spoil: [Damage; 3] = [|seen| seen[2] = -0.5, |seen| seen[2] = f32::NAN, |seen| seen.truncate(3)];
    for spoil in spoil {
        spoil(avatar.seen.as_mut().unwrap());
        let error = avatar.save(&path).unwrap_err();
        assert!(matches!(&error, AvatarFileError::Unreadable { field, .. } if field == "seen"), "{error}");
        avatar.seen = Some(vec![1.0; avatar.template.len()]);
    }
}

#[test]
fn a_trackers_offsets_are_optional_and_of_all_joints() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.ghand");
    let mut avatar = small();
    let joints = avatar.template.joint_count();
    let turns: Vec<DMat3> = (0..joints).map(|k| DMat3::from_rotation_y(0.01 * k as f64)).collect();
    let offsets = PoseOffsets { turns, shift: DVec3::new(0.001, 0.0, -0.002), root_shift: DVec3::Y };
    let tracker = TrackerOffsets { offsets, errors: vec![0.003; joints], frames: 24 };
    avatar.tracker = Some(tracker.clone());
    avatar.save(&path).unwrap();
    let read = Avatar::load(&path).unwrap().tracker.unwrap();
    assert_eq!((&read.errors, read.frames, read.offsets.shift), (&tracker.errors, 24, tracker.offsets.shift));
    assert_eq!(read.offsets.root_shift, tracker.offsets.root_shift);
    let same = |(a, b): (&DMat3, &DMat3)| a.abs_diff_eq(*b, 1e-12);
    assert!(read.offsets.turns.iter().zip(&tracker.offsets.turns).all(same));
    let without = without_tensor(&avatar, "tracker.turns");
    assert_eq!(from_bytes(Path::new("a"), &without).unwrap().tracker, None);
    type Damage = (&'static str, fn(&mut TrackerOffsets));
    let spoil: [Damage; 5] = [
        ("tracker.turns", |tracker| tracker.offsets.turns.truncate(2)),
        ("tracker.turns", |tracker| tracker.offsets.turns[1] = DMat3::from_diagonal(DVec3::splat(f64::NAN))),
        ("tracker.errors", |tracker| tracker.errors[1] = -1.0),
        ("tracker.errors", |tracker| tracker.errors.truncate(1)),
        ("tracker.shifts", |tracker| tracker.offsets.shift.x = 1e9),
    ];
    for (name, spoil) in spoil {
        let mut spoilt = tracker.clone();
        spoil(&mut spoilt);
        avatar.tracker = Some(spoilt);
        let error = avatar.save(&path).unwrap_err();
        assert!(matches!(&error, AvatarFileError::Unreadable { field, .. } if field == name), "{name}: {error}");
    }
}

#[test]
fn avatars_without_light_keep_the_version_that_older_programs_read() {
    let text = |avatar: Avatar| String::from_utf8_lossy(&avatar.to_bytes(Path::new("a")).unwrap()).into_owned();
    assert!(text(small()).contains(r#"\"version\":2"#) && text(lit()).contains(r#"\"version\":3"#));
    assert!(!text(small()).contains("light"));
}

#[test]
fn an_avatar_with_a_removed_form_of_residual_weights_is_refused() {
    let bytes = small().to_bytes(Path::new("a")).unwrap();
    let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
    let mut metadata = header.metadata().clone().unwrap();
    let block = metadata.get_mut(METADATA_KEY).unwrap();
    *block = block.replacen(r#""config":{"#, r#""config":{"residual_support":"local","#, 1);
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let error = from_bytes(Path::new("a"), &serialize(tensors.tensors(), Some(metadata)).unwrap()).unwrap_err();
    assert_eq!(error.to_string(), "a: residual_support: was removed in 0.2; train the avatar again, or use ghand 0.1");
}

#[test]
fn a_file_says_only_that_an_avatar_is_antialiased_so_that_older_files_are_not() {
    let read_back = |avatar: Avatar| {
        let bytes = avatar.to_bytes(Path::new("a")).unwrap();
        let says = String::from_utf8_lossy(&bytes).contains("antialias");
        (says, from_bytes(Path::new("a"), &bytes).unwrap().config.antialias)
    };
    let mut antialiased = small();
    antialiased.config.antialias = true;
    assert_eq!([read_back(small()), read_back(antialiased)], [(false, false), (true, true)]);
}

fn small() -> Avatar {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let config = AvatarConfig { uv_resolution: 16, ..Default::default() };
    Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0).unwrap()
}

#[test]
fn an_unreadable_avatar_is_not_written_and_the_old_file_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.ghand");
    small().save(&path).unwrap();
    let before = std::fs::read(&path).unwrap();
    fn tables(avatar: &mut Avatar) -> &mut DirectTables {
        let PropertyTables::Direct(tables) = &mut avatar.tables else { unreachable!() };
        tables
    }
    type Damage = (&'static str, fn(&mut Avatar));
    let spoil: [Damage; 12] = [
        ("response_bias", |a| tables(a).response[0] = f32::INFINITY),
        ("response_gain", |a| *tables(a).response.last_mut().unwrap() = f32::NAN),
        ("response_limits", |a| tables(a).response_limits[6..8].copy_from_slice(&[0.5, 0.25])),
        ("response_limits", |a| tables(a).response_limits[6..8].copy_from_slice(&[f32::NAN, 0.5])),
        ("response_limits", |a| tables(a).response_limits[6..8].copy_from_slice(&[0.5, f32::INFINITY])),
        ("shape_basis", |a| tables(a).shape_basis[5] = f32::NAN),
        ("appearance", |a| tables(a).appearance[5] = f32::NEG_INFINITY),
        ("joints", |a| a.template.joints[3].y = f64::NAN),
        ("mesh", |a| a.model.faces[0] = [u32::MAX; 3]),
        ("mesh", |a| a.model.weights[0] = -1.0),
        ("config", |a| {
            a.config.color_components = 65;
            let [_, _, _, appearance, response, limits] = table_lengths(a.template.len(), 16, &a.config);
            tables(a).appearance.resize(appearance, 0.0);
            tables(a).response.resize(response, 0.0);
            tables(a).response_limits.resize(limits, 0.0);
        }),
        ("avatar", |a| tables(a).regressor.truncate(7)),
    ];
    for (field, spoil) in spoil {
        let mut avatar = small();
        spoil(&mut avatar);
        let error = avatar.save(&path).unwrap_err();
        assert!(matches!(&error, AvatarFileError::Unreadable { field: f, .. } if f == field), "{field}: {error}");
        let sentence = error.to_string();
        assert!(sentence.contains("hand.ghand: not written") && !sentence.contains('\n'), "{sentence}");
        assert!(std::fs::read(&path).unwrap() == before, "{field}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
    Avatar::load(&path).unwrap();
}
