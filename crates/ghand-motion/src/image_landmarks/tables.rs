//! Tables of one camera: those of DeepLabCut and anipose, with header rows `scorer`, (`individuals`,) `bodyparts`, `coords`,
//! and tables with columns `NAME_x`, `NAME_y` and perhaps `NAME_likelihood`.

use std::collections::BTreeSet;

use ghand_core::Side;

use super::LANDMARK_COUNT;
use super::joint_names::Joint;
use super::view::{Content, Problem, View, Views, point, problem};

/// Fewer landmarks than this, of a side, are not a hand.
const LEAST_NAMES: usize = 8;
/// Most rows of a table.
const MOST_ROWS: usize = 1_000_000;
/// Most names in a message.
const MOST_SHOWN: usize = 6;

/// Whether these are the bytes of a table with such a header.
pub(super) fn recognises(bytes: &[u8]) -> bool {
    let head = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let line = head.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let Ok(line) = std::str::from_utf8(line) else { return false };
    let cells: Vec<&str> = line.trim_end().split(delimiter(line)).map(|cell| cell.trim_matches('"')).collect();
    cells.len() > 2
        && (cells[0] == "scorer" || cells.iter().filter(|cell| axis_of(cell).is_some()).count() >= LEAST_NAMES)
}

fn delimiter(line: &str) -> char {
    [',', ';', '\t'].into_iter().max_by_key(|mark| line.matches(*mark).count()).unwrap_or(',')
}

/// What a column is of its joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Axis {
    X,
    Y,
    Score,
}

fn axis(text: &str) -> Option<Axis> {
    match text.to_lowercase().as_str() {
        "x" => Some(Axis::X),
        "y" => Some(Axis::Y),
        "likelihood" | "score" | "confidence" | "conf" | "c" => Some(Axis::Score),
        _ => None,
    }
}

/// The joint's name and the axis of a column `NAME_x`.
fn axis_of(cell: &str) -> Option<(&str, Axis)> {
    let (name, end) = cell.rsplit_once(['_', '.', ' '])?;
    Some((name, axis(end)?))
}

pub(super) fn read(bytes: &[u8], side: Side) -> Result<Content, Problem> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let first = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let mark = delimiter(&String::from_utf8_lossy(first)) as u8;
    let mut reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).delimiter(mark).from_reader(bytes);
    let mut records = reader.records();
    let mut next = || records.next().transpose().map_err(|error| ("table".to_owned(), format!("is damaged: {error}")));
    let Some(first) = next()? else { return problem("table", "is empty") };
    let columns: Vec<Option<(String, Axis)>> = if first.get(0) == Some("scorer") {
        let mut parts = vec![];
        let mut individuals: Option<Vec<String>> = None;
        loop {
            let Some(row) = next()? else { return problem("header", "has no row \"coords\"") };
            let cells: Vec<String> = row.iter().map(str::to_owned).collect();
            match row.get(0) {
                Some("individuals") => individuals = Some(cells),
                Some("bodyparts") => parts = cells,
                Some("coords") => {
                    let one = |(number, cell): (usize, &String)| {
                        let part = parts.get(number)?;
                        let owner =
                            individuals.as_ref().and_then(|all| all.get(number)).filter(|name| *name != "single");
                        let name = owner.map_or(part.clone(), |owner| format!("{owner} {part}"));
                        Some((name, axis(cell)?))
                    };
                    break cells.iter().enumerate().map(one).collect();
                }
                _ => return problem("header", "must have rows that begin with scorer, bodyparts and coords"),
            }
        }
    } else {
        first.iter().map(|cell| axis_of(cell).map(|(name, axis)| (name.to_owned(), axis))).collect()
    };
    let places = places(&columns, side)?;
    let mut rows = vec![];
    while let Some(row) = next()? {
        if rows.len() == MOST_ROWS {
            return problem("table", format!("has more than {MOST_ROWS} rows; cut it into parts"));
        }
        let number = |column: &Option<usize>| -> Option<f64> { row.get((*column)?)?.trim().parse().ok() };
        let landmark = |columns: &[Option<usize>; 3]| {
            let [x, y, score] = columns;
            let score = if score.is_some() { number(score).unwrap_or(0.0) } else { 1.0 };
            point(number(x)?, number(y)?, score)
        };
        rows.push((row.get(0).and_then(last_number), std::array::from_fn(|k| landmark(&places[k]))));
    }
    // The first column is the number of the frame, or the name of its image; without that, it is a joint's.
    let has_numbers = columns.first().is_some_and(Option::is_none)
        && rows.windows(2).all(|pair| pair[0].0.is_some() && pair[0].0 < pair[1].0);
    let view: View = (0..)
        .zip(rows)
        .map(|(row, (number, points))| (number.filter(|_| has_numbers).unwrap_or(row), points))
        .collect();
    if view.is_empty() {
        return problem("table", "has no rows of numbers");
    }
    Ok(Content::new(Views::One(view), 0.0))
}

/// The last whole number in a text: of `12`, `12.0` or `labeled-data/img0012.png` it is 12.
fn last_number(text: &str) -> Option<u64> {
    let text = text.trim().trim_end_matches(".0");
    let end = text.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = text[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    text.get(start..end)?.parse().ok()
}

/// The columns of each landmark: x, y and score.
fn places(columns: &[Option<(String, Axis)>], side: Side) -> Result<[[Option<usize>; 3]; LANDMARK_COUNT], Problem> {
    let names: BTreeSet<&str> = columns.iter().flatten().map(|(name, _)| name.as_str()).collect();
    let starts_at_zero = names.iter().any(|name| Joint::counts_from_zero(name));
    let joints: Vec<Option<Joint>> =
        columns.iter().map(|column| column.as_ref().and_then(|(name, _)| Joint::of(name, starts_at_zero))).collect();
    let mut places = [[None; 3]; LANDMARK_COUNT];
    for (number, (column, joint)) in columns.iter().zip(&joints).enumerate() {
        let (Some((_, axis)), Some(joint)) = (column, joint) else { continue };
        if joint.side.is_none_or(|own| own == side) {
            places[joint.landmark][*axis as usize].get_or_insert(number);
        }
    }
    let count = places.iter().filter(|[x, y, _]| x.is_some() && y.is_some()).count();
    if count >= LEAST_NAMES {
        return Ok(places);
    }
    let shown: Vec<&str> = names.iter().copied().take(MOST_SHOWN).collect();
    let text = format!(
        "names {count} of the {LANDMARK_COUNT} landmarks of a {side} hand, at least {LEAST_NAMES} are needed; name them \
         wrist, thumb_cmc, thumb_mcp, thumb_ip, thumb_tip, index_mcp, index_pip, index_dip, index_tip and so on (it has {})",
        shown.join(", ")
    );
    problem("bodyparts", text)
}
