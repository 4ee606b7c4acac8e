//! The words and numbers that a joint's name consists of.

use ghand_core::Side;

use super::Finger;

/// A word that says something about a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Word {
    Finger(Finger),
    /// Another finger's name, or that of a middle part.
    Middle,
    /// A finger that a number tells.
    AnyFinger,
    Part(Part),
    Wrist,
    Hand,
    Palm,
    Side(Side),
    /// Its value and its count of digits.
    Number(usize, usize),
    /// A single letter that may count parts, from 1.
    Letter(usize),
    /// Says nothing, in any place.
    Neutral,
    /// Part of another limb, or of something that only helps to move or to measure a hand.
    Other,
    Unknown,
}

/// A part of a finger, as a word says it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Metacarpal,
    /// The carpometacarpal joint of anatomy.
    Cmc,
    Start,
    Knuckle,
    /// The metacarpophalangeal joint of anatomy.
    Mcp,
    Proximal,
    /// The thumb's interphalangeal joint of anatomy.
    Ip,
    Pip,
    Intermediate,
    /// Start and end of the middle phalanx.
    IntermediateBase,
    IntermediateTip,
    Dip,
    Distal,
    Tip,
}

/// Words that names are made of, also without anything between them (`rightindex`).
const WORDS: &[(&str, Word)] = &[
    ("thumb", Word::Finger(Finger::Thumb)),
    ("index", Word::Finger(Finger::Index)),
    ("pointer", Word::Finger(Finger::Index)),
    ("fore", Word::Finger(Finger::Index)),
    ("ring", Word::Finger(Finger::Ring)),
    ("third", Word::Finger(Finger::Ring)),
    ("pinky", Word::Finger(Finger::Little)),
    ("pinkie", Word::Finger(Finger::Little)),
    ("little", Word::Finger(Finger::Little)),
    ("middle", Word::Middle),
    ("mid", Word::Middle),
    ("親指", Word::Finger(Finger::Thumb)),
    ("人指", Word::Finger(Finger::Index)),
    ("人差指", Word::Finger(Finger::Index)),
    ("中指", Word::Middle),
    ("薬指", Word::Finger(Finger::Ring)),
    ("小指", Word::Finger(Finger::Little)),
    ("finger", Word::AnyFinger),
    ("fingers", Word::Neutral),
    ("digit", Word::AnyFinger),
    ("metacarpal", Word::Part(Part::Metacarpal)),
    ("metacarpus", Word::Part(Part::Metacarpal)),
    ("carpal", Word::Part(Part::Metacarpal)),
    ("meta", Word::Part(Part::Metacarpal)),
    ("cmc", Word::Part(Part::Cmc)),
    ("base", Word::Part(Part::Start)),
    ("start", Word::Part(Part::Start)),
    ("root", Word::Part(Part::Start)),
    ("knuckle", Word::Part(Part::Knuckle)),
    ("mcp", Word::Part(Part::Mcp)),
    ("proximal", Word::Part(Part::Proximal)),
    ("prox", Word::Part(Part::Proximal)),
    ("ip", Word::Part(Part::Ip)),
    ("pip", Word::Part(Part::Pip)),
    ("intermediate", Word::Part(Part::Intermediate)),
    ("inter", Word::Part(Part::Intermediate)),
    ("medial", Word::Part(Part::Intermediate)),
    ("dip", Word::Part(Part::Dip)),
    ("distal", Word::Part(Part::Distal)),
    ("dist", Word::Part(Part::Distal)),
    ("tip", Word::Part(Part::Tip)),
    ("end", Word::Part(Part::Tip)),
    ("nub", Word::Part(Part::Tip)),
    ("null", Word::Part(Part::Tip)),
    ("leaf", Word::Part(Part::Tip)),
    ("site", Word::Part(Part::Tip)),
    ("先", Word::Part(Part::Tip)),
    ("wrist", Word::Wrist),
    ("手首", Word::Wrist),
    ("hand", Word::Hand),
    ("palm", Word::Palm),
    ("left", Word::Side(Side::Left)),
    ("right", Word::Side(Side::Right)),
    ("左", Word::Side(Side::Left)),
    ("右", Word::Side(Side::Right)),
    ("phalanx", Word::Neutral),
    ("phalange", Word::Neutral),
    ("joint", Word::Neutral),
    ("bone", Word::Neutral),
    ("arm", Word::Other),
    ("forearm", Word::Other),
    ("upperarm", Word::Other),
    ("lowerarm", Word::Other),
    ("elbow", Word::Other),
    ("shoulder", Word::Other),
    ("clavicle", Word::Other),
    ("spine", Word::Other),
    ("chest", Word::Other),
    ("neck", Word::Other),
    ("head", Word::Other),
    ("hip", Word::Other),
    ("hips", Word::Other),
    ("pelvis", Word::Other),
    ("leg", Word::Other),
    ("knee", Word::Other),
    ("foot", Word::Other),
    ("toe", Word::Other),
    ("toes", Word::Other),
    ("eye", Word::Other),
    ("brow", Word::Other),
    ("lip", Word::Other),
    ("ear", Word::Other),
    ("tail", Word::Other),
    ("wing", Word::Other),
    ("nail", Word::Other),
    ("twist", Word::Other),
    ("ik", Word::Other),
    ("pole", Word::Other),
    ("target", Word::Other),
    ("ctrl", Word::Other),
    ("control", Word::Other),
    ("helper", Word::Other),
    ("aux", Word::Other),
    ("marker", Word::Other),
];

/// The words of a name, in order. Words end where the kind of characters or the case changes; what is then no word
/// may be several without anything between them.
pub(super) fn words(name: &str) -> Vec<Word> {
    runs(name).iter().flat_map(|run| meaning(run)).collect()
}

/// The side that the words of a name say, if it is one.
pub fn side_in_name(name: &str) -> Option<Side> {
    let words = words(name);
    let says = |side| words.contains(&Word::Side(side));
    match (says(Side::Left), says(Side::Right)) {
        (true, false) => Some(Side::Left),
        (false, true) => Some(Side::Right),
        _ => None,
    }
}

/// What a name without a finger and without another limb is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Limb {
    Wrist,
    Hand,
}

/// Whether a word of the name is `wrist`, or else `hand`.
pub(crate) fn limb(name: &str) -> Option<Limb> {
    let words = words(name);
    let is_of_other = |word: &Word| matches!(word, Word::Finger(_) | Word::Middle | Word::AnyFinger | Word::Other);
    if words.iter().any(is_of_other) {
        None
    } else if words.contains(&Word::Wrist) {
        Some(Limb::Wrist)
    } else {
        words.contains(&Word::Hand).then_some(Limb::Hand)
    }
}

/// Letters of one case, or digits; `HTMLHand` is `HTML` and `Hand`.
fn runs(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().map(ascii_digit).collect();
    let mut runs: Vec<String> = vec![];
    let mut before: Option<char> = None;
    for (k, &c) in letters.iter().enumerate() {
        if c.is_alphanumeric() {
            let starts = before.is_none_or(|before| {
                let next_is_lower = letters.get(k + 1).is_some_and(|next| next.is_lowercase());
                before.is_ascii_digit() != c.is_ascii_digit()
                    || (c.is_uppercase() && (!before.is_uppercase() || next_is_lower))
            });
            match runs.last_mut() {
                Some(run) if !starts => run.push(c),
                _ => runs.push(c.to_string()),
            }
        }
        before = c.is_alphanumeric().then_some(c);
    }
    runs
}

/// Digits of full width as ASCII's.
fn ascii_digit(c: char) -> char {
    match u32::from(c).checked_sub(u32::from('０')) {
        Some(digit @ 0..=9) => char::from(b'0' + digit as u8),
        _ => c,
    }
}

fn meaning(run: &str) -> Vec<Word> {
    if run.starts_with(|c: char| c.is_ascii_digit()) {
        return vec![run.parse().map_or(Word::Unknown, |number| Word::Number(number, run.len()))];
    }
    let run = run.to_lowercase();
    match run.as_str() {
        "l" => vec![Word::Side(Side::Left)],
        "r" => vec![Word::Side(Side::Right)],
        "a" | "b" | "c" | "d" => vec![Word::Letter(usize::from(run.as_bytes()[0] - b'a') + 1)],
        _ => whole(&run).or_else(|| of_side(&run)).unwrap_or_else(|| vec![Word::Unknown]),
    }
}

/// `lhand`, `rindex`: a side's letter before words.
fn of_side(run: &str) -> Option<Vec<Word>> {
    let (side, rest) = match run.as_bytes().first()? {
        b'l' => (Side::Left, &run[1..]),
        b'r' => (Side::Right, &run[1..]),
        _ => return None,
    };
    let rest = whole(rest)?;
    let is_of_hand = matches!(
        rest.first(),
        Some(Word::Finger(_) | Word::Middle | Word::AnyFinger | Word::Hand | Word::Wrist | Word::Palm)
    );
    is_of_hand.then(|| [&[Word::Side(side)], &rest[..]].concat())
}

/// The words that a run is made of from beginning to end, the longest first.
fn whole(run: &str) -> Option<Vec<Word>> {
    if run.is_empty() {
        return Some(vec![]);
    }
    let mut starts: Vec<&(&str, Word)> = WORDS.iter().filter(|(word, _)| run.starts_with(word)).collect();
    starts.sort_by_key(|(word, _)| std::cmp::Reverse(word.len()));
    starts.into_iter().find_map(|(word, meaning)| Some([&[*meaning], &whole(&run[word.len()..])?[..]].concat()))
}
