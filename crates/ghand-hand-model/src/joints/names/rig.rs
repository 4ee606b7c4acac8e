//! The parts that the joints of one rig move, from all their names together: what a number or "proximal" means depends
//! on the finger's other joints.

use std::collections::{BTreeSet, HashSet};

use super::words::{Part, Word, words};
use super::{Finger, JointRole};

/// Fewer names do not show whether the numbers at their ends count the nodes of a file.
const LEAST_COUNTED: usize = 5;

/// A joint's name, understood without the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Named {
    Wrist,
    Palm,
    /// One of several bones of the palm.
    PalmBone(usize),
    Finger(Finger, Piece),
    /// A finger with a number for its name.
    NumberedFinger(usize, Piece),
    Nothing,
}

/// A piece of a finger.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Piece {
    /// As a word says it, with the number in the name.
    Part(Part, Option<usize>),
    Number(usize),
    /// The finger alone.
    Bare,
}

/// The part that each joint moves. Of joints that seem to be the same part, the one with the fewest words counts, or else
/// the first.
pub(super) fn roles(names: &[String]) -> Vec<Option<JointRole>> {
    let counted = named_joints(names);
    let named = named_joints(&without_counters(names));
    let lengths: Vec<usize> = names.iter().map(|name| words(name).len()).collect();
    let mut roles = of_palm(&named);
    for finger in Finger::ALL {
        let mut pieces = pieces_of(finger, &named);
        if pieces.iter().filter(|(_, piece)| *piece == Piece::Bare).count() > 1 {
            pieces = pieces_of(finger, &counted);
        }
        without_strangers(&mut pieces, &lengths);
        let chain = Chain::of(&pieces);
        for (k, piece) in pieces {
            roles[k] = if finger == Finger::Thumb { chain.of_thumb(piece) } else { chain.of_finger(finger, piece) };
        }
    }
    let is_best = |k: usize| {
        let rank = |k: usize| (lengths[k], k);
        (0..roles.len()).all(|other| roles[other] != roles[k] || rank(k) <= rank(other))
    };
    (0..roles.len()).map(|k| roles[k].filter(|_| is_best(k))).collect()
}

/// The finger that each joint belongs to.
pub(super) fn fingers(names: &[String]) -> Vec<Option<Finger>> {
    let finger = |named| if let Named::Finger(finger, _) = named { Some(finger) } else { None };
    named_joints(&without_counters(names)).into_iter().map(finger).collect()
}

/// Names without the numbers that some exporters append to all nodes (`RightHandIndex1_037`).
fn without_counters(names: &[String]) -> Vec<String> {
    let split = |name: &str| -> Option<(String, usize)> {
        let (start, number) = name.rsplit_once('_')?;
        let is_number = !number.is_empty() && number.bytes().all(|c| c.is_ascii_digit());
        Some((start.to_owned(), number.parse().ok().filter(|_| is_number)?))
    };
    let found: Vec<Option<(String, usize)>> = names.iter().map(|name| split(name)).collect();
    let count = found.iter().flatten().count();
    let different = found.iter().flatten().map(|(_, number)| number).collect::<HashSet<_>>().len();
    if count < LEAST_COUNTED || different < count || 10 * count < 9 * names.len() {
        return names.to_vec();
    }
    found.into_iter().zip(names).map(|(split, name)| split.map_or_else(|| name.clone(), |(start, _)| start)).collect()
}

/// All joints, with numbered fingers as fingers where the numbers show which.
fn named_joints(names: &[String]) -> Vec<Named> {
    let named: Vec<Named> = names.iter().map(|name| named(&words(name))).collect();
    let numbers: BTreeSet<usize> = named
        .iter()
        .filter_map(|named| if let Named::NumberedFinger(number, _) = named { Some(*number) } else { None })
        .collect();
    let has_thumb = named.iter().any(|named| matches!(named, Named::Finger(Finger::Thumb, _)));
    let finger = |number: usize| {
        let nth = numbers.iter().position(|known| *known == number)?;
        let [first, last] = [numbers.first()?, numbers.last()?];
        match (has_thumb, *first, *last) {
            (true, ..) if numbers.len() == 4 => Finger::ALL.get(nth + 1).copied(),
            (false, 0, 0..=4) => Finger::ALL.get(number).copied(),
            (false, 1, 5) => Finger::ALL.get(number - 1).copied(),
            _ => None,
        }
    };
    let with_finger = |named: Named| match named {
        Named::NumberedFinger(number, piece) => finger(number).map_or(Named::Nothing, |f| Named::Finger(f, piece)),
        other => other,
    };
    named.into_iter().map(with_finger).collect()
}

fn named(words: &[Word]) -> Named {
    if words.contains(&Word::Other) {
        return Named::Nothing;
    }
    let fingers: Vec<(usize, Finger)> = (words.iter().enumerate())
        .filter_map(|(k, word)| if let Word::Finger(finger) = word { Some((k, *finger)) } else { None })
        .collect();
    let position = |wanted: Word| words.iter().position(|word| *word == wanted);
    match (fingers.first(), position(Word::Middle)) {
        (Some((_, finger)), _) if fingers.iter().any(|(_, other)| other != finger) => return Named::Nothing,
        (Some((at, finger)), _) => return Named::Finger(*finger, piece(&words[..*at], &words[at + 1..])),
        (None, Some(at)) => return Named::Finger(Finger::Middle, piece(&words[..at], &words[at + 1..])),
        (None, None) => {}
    }
    if let Some(found) = position(Word::AnyFinger).and_then(|at| numbered_finger(&words[at + 1..])) {
        return found;
    }
    let number = |at: usize| words[at..].iter().find_map(number);
    match (position(Word::Wrist), position(Word::Palm), position(Word::Part(Part::Metacarpal))) {
        (Some(_), ..) => Named::Wrist,
        (_, Some(at), _) => number(at).map_or(Named::Palm, Named::PalmBone),
        (.., Some(at)) => number(at).map_or(Named::Nothing, Named::PalmBone),
        _ => Named::Nothing,
    }
}

fn number(word: &Word) -> Option<usize> {
    if let Word::Number(number, _) = word { Some(*number) } else { None }
}

/// The words after `finger`: its number and a piece, or one number of two digits for both (Biped's `Finger12`).
fn numbered_finger(after: &[Word]) -> Option<Named> {
    let at = after.iter().position(|word| matches!(word, Word::Number(..)))?;
    let Word::Number(value, digits) = after[at] else { return None };
    Some(match (piece(&[], &after[at + 1..]), digits) {
        (Piece::Bare, 2) => Named::NumberedFinger(value / 10, Piece::Number(value % 10)),
        (Piece::Bare, _) => Named::NumberedFinger(value, Piece::Number(0)),
        (Piece::Part(Part::Tip, None), 2) => Named::NumberedFinger(value / 10, Piece::Part(Part::Tip, None)),
        (piece, _) => Named::NumberedFinger(value, piece),
    })
}

/// The piece that the words around a finger's name tell; those after it first.
fn piece(before: &[Word], after: &[Word]) -> Piece {
    let number = after.iter().find_map(number);
    if let Some(part) = part(after) {
        return Piece::Part(part, number);
    }
    let letter = if let Some(Word::Letter(number)) = after.first() { Some(*number) } else { None };
    match (number.or(letter), part(before)) {
        (Some(number), _) => Piece::Number(number),
        (None, Some(part)) if part != Part::Start => Piece::Part(part, None),
        _ => Piece::Bare,
    }
}

fn part(words: &[Word]) -> Option<Part> {
    let parts: Vec<Part> = (words.iter())
        .filter_map(|word| match word {
            Word::Part(part) => Some(*part),
            Word::Middle => Some(Part::Intermediate),
            _ => None,
        })
        .collect();
    let has = |part| parts.contains(&part);
    match (has(Part::Tip), has(Part::Intermediate), has(Part::Start)) {
        (true, true, _) => Some(Part::IntermediateTip),
        (true, false, _) => Some(Part::Tip),
        (_, true, true) => Some(Part::IntermediateBase),
        _ => parts.iter().find(|part| **part != Part::Start).or(parts.first()).copied(),
    }
}

/// Roles of wrist and palm. Four numbered bones of the palm are the metacarpals of the fingers.
fn of_palm(named: &[Named]) -> Vec<Option<JointRole>> {
    let bones: BTreeSet<usize> =
        named.iter().filter_map(|named| if let Named::PalmBone(bone) = named { Some(*bone) } else { None }).collect();
    let role = |named: &Named| match named {
        Named::Wrist => Some(JointRole::Wrist),
        Named::Palm => Some(JointRole::Palm),
        Named::PalmBone(bone) if bones.len() == 4 => {
            let nth = bones.iter().position(|known| known == bone)?;
            Some(JointRole::Metacarpal(*Finger::ALL.get(nth + 1)?))
        }
        Named::PalmBone(_) if bones.len() == 1 => Some(JointRole::Palm),
        _ => None,
    };
    named.iter().map(role).collect()
}

fn pieces_of(finger: Finger, named: &[Named]) -> Vec<(usize, Piece)> {
    let own = |(k, named): (usize, &Named)| match named {
        Named::Finger(of, piece) if *of == finger => Some((k, *piece)),
        _ => None,
    };
    named.iter().enumerate().filter_map(own).collect()
}

/// The finger alone is the first of a chain of the same words with numbers (`Index`, `Index.001`); with other words
/// (`RightInHandIndex` beside `RightHandIndex1`) it is what comes before the chain. `lengths` counts the words of names.
fn without_strangers(pieces: &mut [(usize, Piece)], lengths: &[usize]) {
    let chain: Vec<usize> = (pieces.iter())
        .filter(|(_, piece)| matches!(piece, Piece::Number(_)))
        .map(|(joint, _)| lengths[*joint])
        .collect();
    for (joint, piece) in pieces {
        if *piece == Piece::Bare && chain.len() >= 3 && chain.iter().all(|length| *length != lengths[*joint] + 1) {
            *piece = Piece::Part(Part::Metacarpal, None);
        }
    }
}

/// The pieces of one finger.
struct Chain {
    parts: Vec<Part>,
    /// Numbers in order; `None` is the finger alone, the first of a chain such as `Index`, `Index.001`, `Index.002`.
    numbers: BTreeSet<Option<usize>>,
    /// Whether a tip is told by a word, and is not the end of the joint with the highest number.
    has_separate_tip: bool,
}

impl Chain {
    fn of(pieces: &[(usize, Piece)]) -> Chain {
        let parts =
            pieces.iter().filter_map(|(_, piece)| if let Piece::Part(part, _) = piece { Some(*part) } else { None });
        let mut numbers: BTreeSet<Option<usize>> = (pieces.iter())
            .filter_map(|(_, piece)| if let Piece::Number(number) = piece { Some(Some(*number)) } else { None })
            .collect();
        if numbers.len() > 1 && pieces.iter().any(|(_, piece)| *piece == Piece::Bare) {
            numbers.insert(None);
        }
        let last = numbers.last().copied().flatten();
        let has_separate_tip = (pieces.iter())
            .any(|(_, piece)| matches!(piece, Piece::Part(Part::Tip, number) if number.is_none() || *number > last));
        Chain { parts: parts.collect(), numbers, has_separate_tip }
    }

    fn has(&self, parts: &[Part]) -> bool {
        parts.iter().any(|part| self.parts.contains(part))
    }

    /// The place of a joint among the numbered ones, and whether their first is the metacarpal's, before the knuckle's.
    fn place(&self, piece: Piece) -> (Option<usize>, bool) {
        let own = if let Piece::Number(number) = piece { Some(number) } else { None };
        let starts_at_0 = self.numbers.first() == Some(&Some(0));
        (self.numbers.iter().position(|number| *number == own), starts_at_0 || self.has_separate_tip)
    }

    fn of_finger(&self, finger: Finger, piece: Piece) -> Option<JointRole> {
        let bend = |k: usize| Some(JointRole::Bend(finger, k as u8));
        let metacarpal = Some(JointRole::Metacarpal(finger));
        let tip = Some(JointRole::Tip(finger));
        if let Piece::Part(part, _) = piece {
            let is_before_knuckle = self.numbers.len() >= 3 || self.has(&[Part::Proximal, Part::Knuckle, Part::Mcp]);
            return match part {
                Part::Metacarpal | Part::Cmc => metacarpal,
                Part::Start if is_before_knuckle => metacarpal,
                Part::Start | Part::Knuckle | Part::Mcp | Part::Proximal => bend(1),
                Part::Ip | Part::Pip | Part::Intermediate | Part::IntermediateBase => bend(2),
                Part::Dip | Part::Distal | Part::IntermediateTip => bend(3),
                Part::Tip => tip,
            };
        }
        let has_metacarpal = self.has(&[Part::Metacarpal, Part::Cmc, Part::Start]);
        match (self.numbers.len(), self.place(piece), piece) {
            (3, (Some(k), _), _) => bend(k + 1),
            (4, (Some(0), true), _) if !has_metacarpal => metacarpal,
            (4, (Some(k), true), _) if !has_metacarpal => bend(k),
            (4, (Some(k), _), _) => {
                if k < 3 {
                    bend(k + 1)
                } else {
                    tip
                }
            }
            (5, (Some(k), _), _) => match k {
                0 => metacarpal,
                4 => tip,
                _ => bend(k),
            },
            (.., Piece::Number(0)) => metacarpal,
            (.., Piece::Number(k @ 1..=3)) => bend(k),
            (.., Piece::Number(4)) => tip,
            _ => None,
        }
    }

    /// Of the thumb, the metacarpal bends, and what some rigs have before it is no role.
    fn of_thumb(&self, piece: Piece) -> Option<JointRole> {
        let bend = |k: usize| Some(JointRole::Bend(Finger::Thumb, k as u8));
        let tip = Some(JointRole::Tip(Finger::Thumb));
        let has_all_numbers = self.numbers.len() >= 3;
        if let Piece::Part(part, _) = piece {
            // Unity's, VRM 0's and Leap's thumbs have a proximal, an intermediate and a distal joint, WebXR's, OpenXR's
            // and VRM 1's a metacarpal, a proximal and a distal one.
            let has_intermediate = self.has(&[Part::Intermediate]);
            let before_proximal = has_intermediate && self.has(&[Part::Proximal]);
            return match part {
                Part::Metacarpal | Part::Cmc | Part::Start if before_proximal || has_all_numbers => None,
                Part::Metacarpal | Part::Cmc | Part::Start => bend(1),
                Part::Proximal => bend(if has_intermediate { 1 } else { 2 }),
                Part::Knuckle => bend(if self.has(&[Part::Metacarpal, Part::Cmc]) { 2 } else { 1 }),
                Part::Mcp | Part::Intermediate | Part::IntermediateBase | Part::Pip => bend(2),
                Part::Ip | Part::Dip | Part::Distal | Part::IntermediateTip => bend(3),
                Part::Tip => tip,
            };
        }
        let starts = self.has(&[Part::Metacarpal, Part::Cmc, Part::Start]);
        match (self.numbers.len(), self.place(piece), piece) {
            (2, (Some(k), _), _) if starts => bend(k + 2),
            (3, (Some(k), _), _) => bend(k + 1),
            (4, (Some(0), true), _) => None,
            (4, (Some(k), true), _) => bend(k),
            (4, (Some(k), false), _) => {
                if k < 3 {
                    bend(k + 1)
                } else {
                    tip
                }
            }
            (.., Piece::Number(k @ 1..=3)) => bend(k),
            (.., Piece::Number(4)) => tip,
            _ => None,
        }
    }
}
