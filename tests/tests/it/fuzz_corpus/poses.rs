//! Runs the readers of the fuzz targets `poses` and `pose_arrays` on the inputs of their folders in `fuzz/corpus` and
//! changed copies of them: the result is finite poses or an error that names the file, never a panic.

use std::path::Path;

use ghand_core::HandModel;
use ghand_motion::pose_sequence::read_poses_bytes;
use ghand_motion::{PoseError, PoseOptions, PoseSequence};
use ghand_test_support::fuzz_corpus::{Content, changed, inputs};
use ghand_test_support::procedural_hand::ProceduralHand;
use rand::SeedableRng;

use super::arrays::read_pose_arrays;

/// Number of changed copies per input: enough that every reader gets a few hundred, few enough to take only a few
/// seconds.
pub(crate) const CHANGES: usize = 300;

/// Runs the inputs of a corpus folder and changed copies; all unchanged inputs must be readable except the `hopeless`
/// ones.
fn run(target: &str, hopeless: &[&str], read: impl Fn(&[u8], &HandModel) -> Result<PoseSequence, PoseError>) {
    let inputs = inputs(target);
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(22);
    let check = |bytes: &[u8]| match read(bytes, &model) {
        Ok(sequence) => {
            assert!(!sequence.frames.is_empty() && sequence.fps > 0.0);
            for frame in &sequence.frames {
                assert_eq!(frame.pose.rotations.len(), model.joint_count());
                assert!(frame.pose.rotations.iter().all(|rotation| rotation.is_finite()));
                assert!(frame.pose.translation.is_finite());
            }
            true
        }
        Err(error) => {
            assert!(error.to_string().starts_with("file: "), "{error}");
            false
        }
    };
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    let mut found = Vec::new();
    for (path, bytes) in &inputs {
        println!("{}", path.display());
        found.extend(check(bytes).then(|| name(path)));
        for _ in 0..CHANGES {
            check(&changed(bytes, Content::Text, &mut random));
        }
    }
    let names = inputs.iter().map(|(path, _)| name(path));
    let expected: Vec<String> = names.filter(|name| !hopeless.contains(&name.as_str())).collect();
    assert_eq!(found, expected);
}

#[test]
fn corpus_poses_and_changed_copies_give_finite_poses_or_an_error() {
    let hopeless = ["deep.json", "list_in_itself.pkl", "nan_of_python.json", "no_poses.json"];
    run("poses", &hopeless, |bytes, model| read_poses_bytes("file", bytes, model, &PoseOptions::default()));
}

#[test]
fn corpus_arrays_and_changed_copies_give_finite_poses_or_an_error() {
    run("pose_arrays", &["frames_without_joints.arrays", "half_of_infinite_frames.arrays"], read_pose_arrays);
}
