//! Runs the fuzz target `live` on the inputs of its folder in `fuzz/corpus` and changed copies of them.

use ghand_test_support::fuzz_corpus::{Content, changed, inputs};
use ghand_test_support::procedural_hand::ProceduralHand;
use rand::SeedableRng;

use super::arrays::read_live_packets;
use super::poses::CHANGES;

#[test]
fn corpus_packets_and_changed_copies_give_finite_poses_or_an_error() {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(23);
    for (path, bytes) in inputs("live") {
        println!("{}", path.display());
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let expected = if name == "broken.jsonl" { 0 } else { bytes.split(|byte| *byte == b'\n').count() };
        assert_eq!(read_live_packets(&bytes, &model), expected, "{name}");
        for _ in 0..CHANGES {
            read_live_packets(&changed(&bytes, Content::Text, &mut random), &model);
        }
    }
}
