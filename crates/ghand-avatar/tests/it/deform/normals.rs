//! `normals.wgsl` against `ghand_core::skinning::skin_normals`.

use ghand_core::skinning::skin_normals;

use crate::deform::hand::{Run, assert_same};
use crate::deform::skin::skinning;

#[test]
fn posed_normals_are_those_of_the_twin() {
    Run::each(|run| {
        let twin = skin_normals(&skinning(run), &run.rest_normals);
        assert_same(run.kind, "normals", &run.normals[..], &twin);
        if run.kind.angle > 1.0 {
            assert!(run.normals.iter().zip(&run.rest_normals).any(|(posed, rest)| posed.dot(*rest) < 0.5));
        }
    });
}
