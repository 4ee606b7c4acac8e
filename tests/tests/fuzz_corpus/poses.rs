//! Runs the readers of the fuzz targets `poses` and `pose_arrays` on the inputs of their folders in `fuzz/corpus` and
//! changed copies of them: the result is finite poses or an error that names the file, never a panic.

use std::path::{Path, PathBuf};

use ghand_core::HandModel;
use ghand_motion::pose_sequence::read_poses_bytes;
use ghand_motion::{PoseError, PoseOptions, PoseSequence};
use ghand_procedural_hand::ProceduralHand;
use rand::{Rng, RngExt, SeedableRng};

use crate::arrays::read_pose_arrays;

/// Number of changed copies per input: enough that every reader gets a few hundred, few enough to take only a few
/// seconds.
pub(crate) const CHANGES: usize = 300;

/// Applies one to four changes that typically damage files, or that a fuzzer tries.
pub(crate) fn changed(bytes: &[u8], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..random.random_range(1..=4) {
        if bytes.is_empty() {
            break;
        }
        let at = random.random_range(0..bytes.len());
        let length = random.random_range(1..=8).min(bytes.len() - at);
        match random.random_range(0..6) {
            0 => bytes[at] ^= 1 << random.random_range(0..8),
            1 => bytes[at] = b"0123456789-.,[]{}eN\""[random.random_range(0..20)],
            2 => bytes[at..at + length].fill([0, b'9', 0xff][random.random_range(0..3)]),
            3 => drop(bytes.drain(at..at + length)),
            4 => {
                let copy = bytes[at..at + length].to_vec();
                let to = random.random_range(0..=bytes.len());
                bytes.splice(to..to, copy);
            }
            _ => bytes.truncate(at),
        }
    }
    bytes
}

/// The inputs of a corpus folder.
pub(crate) fn inputs(target: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target);
    // Inputs added by libFuzzer have hashes as names.
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some());
    paths.sort();
    paths
}

/// Runs the inputs of a corpus folder and changed copies; all unchanged inputs must be readable except the `hopeless`
/// ones.
fn run(target: &str, hopeless: &[&str], read: impl Fn(&[u8], &HandModel) -> Result<PoseSequence, PoseError>) {
    let paths = inputs(target);
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
    let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
    let mut found = Vec::new();
    for path in &paths {
        println!("{}", path.display());
        let bytes = std::fs::read(path).unwrap();
        found.extend(check(&bytes).then(|| name(path)));
        for _ in 0..CHANGES {
            check(&changed(&bytes, &mut random));
        }
    }
    let expected: Vec<String> = paths.iter().map(name).filter(|name| !hopeless.contains(&name.as_str())).collect();
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
