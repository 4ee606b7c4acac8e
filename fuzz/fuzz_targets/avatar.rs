//! Any bytes, read as an avatar, give one whose parts fit or an error that names the file; a baked one can be posed.
#![no_main]

use ghand_avatar::{Avatar, PropertyTables};
use ghand_core::Pose;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| match Avatar::from_bytes("file".as_ref(), bytes) {
    Ok(avatar) => {
        if let PropertyTables::Baked(tables) = &avatar.tables {
            let template = &avatar.template;
            let pose = Pose::rest(template.joint_count());
            assert_eq!(tables.posed(&template.parents, &template.joints, &pose).len(), template.len());
        }
    }
    Err(error) => assert!(error.to_string().starts_with("file: ")),
});
