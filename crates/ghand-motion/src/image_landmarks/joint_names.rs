//! Joints of a hand by the names that people give them in tables.

use ghand_core::Side;

use super::LANDMARK_COUNT;

/// A landmark, and the side if its name has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Joint {
    pub side: Option<Side>,
    pub landmark: usize,
}

impl Joint {
    /// The joint of a name such as `right_hand_index_finger_mcp`, `IndexPIP`, `L_thumb_tip`, `ring2` or `keypoint_7`.
    /// `from_zero`: the joints of a finger are counted from 0, else from 1, at the palm.
    pub fn of(name: &str, from_zero: bool) -> Option<Joint> {
        let words = words(name);
        let has = |names: &[&str]| words.iter().any(|word| names.contains(&word.as_str()));
        let side = match (has(&["left", "l", "lh"]), has(&["right", "r", "rh"])) {
            (true, false) => Some(Side::Left),
            (false, true) => Some(Side::Right),
            _ => None,
        };
        let number = words.iter().rev().find_map(|word| word.parse::<usize>().ok());
        let finger = finger(&words);
        let landmark = match finger {
            None if has(&["wrist", "carpus"]) => 0,
            None => number.filter(|number| *number < LANDMARK_COUNT && is_plain(&words))?,
            Some(finger) => {
                let part = match () {
                    () if has(&["tip", "end"]) => 3,
                    () if has(&["cmc"]) => 0,
                    () if has(&["mcp"]) => usize::from(finger == 0),
                    () if has(&["pip"]) => 1,
                    () if has(&["ip"]) => 2,
                    () if has(&["dip"]) => 2,
                    () => number?.checked_sub(usize::from(!from_zero)).filter(|part| *part < 4)?,
                };
                1 + 4 * finger + part
            }
        };
        Some(Joint { side, landmark })
    }

    /// Whether the name is of a joint 0 of a finger.
    pub fn counts_from_zero(name: &str) -> bool {
        let words = words(name);
        finger(&words).is_some() && words.last().is_some_and(|word| word == "0")
    }
}

fn finger(words: &[String]) -> Option<usize> {
    const NAMES: [&[&str]; 5] = [
        &["thumb", "pollex"],
        &["index", "forefinger", "pointer"],
        &["middle"],
        &["ring"],
        &["little", "pinky", "pinkie", "small"],
    ];
    words.iter().find_map(|word| NAMES.iter().position(|names| names.contains(&word.as_str())))
}

/// Whether a name says nothing but a number, as `keypoint_7` does.
fn is_plain(words: &[String]) -> bool {
    const PLAIN: [&str; 14] =
        ["hand", "keypoint", "kp", "landmark", "lm", "joint", "point", "left", "right", "l", "r", "lh", "rh", "p"];
    words.iter().all(|word| word.parse::<usize>().is_ok() || PLAIN.contains(&word.as_str()))
}

/// The words and numbers of a name, in lower case: `IndexPIP_2` has index, pip and 2.
fn words(name: &str) -> Vec<String> {
    let characters: Vec<char> = name.chars().collect();
    let mut words = vec![];
    let mut word = String::new();
    for (k, c) in characters.iter().enumerate() {
        let before = k.checked_sub(1).and_then(|k| characters.get(k));
        let begins = before.is_some_and(|before| {
            let begins_after_small = before.is_lowercase() && c.is_uppercase();
            // The last capital of several begins a word, if a small letter follows: `MCPThumb`.
            let next_is_small = characters.get(k + 1).is_some_and(|next| next.is_lowercase());
            let ends_capitals = before.is_uppercase() && c.is_uppercase() && next_is_small;
            begins_after_small || ends_capitals || before.is_ascii_digit() != c.is_ascii_digit()
        });
        if (begins || !c.is_alphanumeric()) && !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
        if c.is_alphanumeric() {
            word.extend(c.to_lowercase());
        }
    }
    if !word.is_empty() {
        words.push(word);
    }
    words.iter().flat_map(|word| split_known(word)).collect()
}

/// Words written together in small letters, such as `indextip`.
fn split_known(word: &str) -> Vec<String> {
    const ENDS: [&str; 7] = ["tip", "dip", "pip", "mcp", "cmc", "ip", "finger"];
    for end in ENDS {
        if let Some(start) = word.strip_suffix(end).filter(|start| start.len() > 3 || *start == "mid") {
            return [split_known(start), vec![end.to_owned()]].concat();
        }
    }
    vec![word.to_owned()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_spellings_are_known() {
        for (name, side, landmark) in [
            ("wrist", None, 0),
            ("right_hand_wrist", Some(Side::Right), 0),
            ("THUMB_CMC", None, 1),
            ("thumb_mcp", None, 2),
            ("ThumbIP", None, 3),
            ("left_hand.thumb_tip", Some(Side::Left), 4),
            ("INDEX_FINGER_MCP", None, 5),
            ("L_IndexPIP", Some(Side::Left), 6),
            ("right_hand_index_finger_dip", Some(Side::Right), 7),
            ("indextip", None, 8),
            ("middle1", None, 9),
            ("Ring-3", None, 15),
            ("pinkyTip", None, 20),
            ("little_finger_4", None, 20),
            ("hand_7", None, 7),
            ("20", None, 20),
        ] {
            assert_eq!(Joint::of(name, false), Some(Joint { side, landmark }), "{name}");
        }
        assert_eq!(Joint::of("thumb0", true).map(|joint| joint.landmark), Some(1));
        assert!(Joint::counts_from_zero("index_0") && !Joint::counts_from_zero("index_10"));
        for name in ["left_elbow", "nose", "21", "index", "index_9", "", "spine1"] {
            assert_eq!(Joint::of(name, false), None, "{name}");
        }
    }
}
