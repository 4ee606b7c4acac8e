//! `ghand-lab stress`: extreme cases through the whole pipeline. The figures of a long run are in docs/numerics.md.

use ghand_test_support::cases;

use crate::common::*;

#[test]
fn extreme_cases_stay_within_the_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("stress");
    let stress = |arguments: &[&str]| {
        let output =
            run(env!("CARGO_BIN_EXE_ghand-lab"), folder.path(), &[&["stress", "--seed", "3"], arguments].concat());
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
        text
    };
    let count = cases("200", "1500");
    let text = stress(&["--cases", count, "--out", "stress"]);
    assert!(text.contains(&format!("{count} cases, seed 3")), "{text}");
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("stress.json")).unwrap()).unwrap();
    // Each stage was compared, and each kind of view and pose was drawn.
    assert!(report["all"]["worst"].as_array().unwrap().iter().all(|worst| worst["roundings"].as_f64().unwrap() > 0.0));
    assert_eq!(report["views"].as_object().unwrap().len(), 9);
    assert_eq!(report["poses"].as_object().unwrap().len(), 7);
    assert!(report["hands"]["built-in, lit"]["cases"].as_u64().is_some_and(|cases| cases > 0));
    let kinds = |of: &str| report[of].as_object().unwrap().len();
    assert!(kinds("hands") > cases(2, 9) && kinds("models") > cases(1, 2), "{report}");

    // The worst of a stage can be drawn again, with the same result.
    let worst = &report["all"]["worst"][0];
    let text = stress(&["--only", &worst["case"].to_string()]);
    let figure = format!("{:.1} ({})", worst["roundings"].as_f64().unwrap(), worst["case"]);
    assert!(text.contains(&figure), "{figure} is not in {text}");
}
