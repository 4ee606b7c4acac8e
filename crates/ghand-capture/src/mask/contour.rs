//! The connected parts of a mask, and the largest of them.

/// Keeps the part of a row-major mask inside the contour that encloses most pixels, the first of several. Holes stay
/// holes, but count as enclosed. Pixels that touch at corners are connected.
pub(super) fn keep_largest(mask: &mut [bool], width: usize) {
    let width = width.max(1);
    let free: Vec<bool> = mask.iter().map(|inside| !inside).collect();
    // Pixels that can be reached from the border without crossing the mask are outside all contours.
    let on_border = |i: &usize| *i < width || i + width >= mask.len() || [0, width - 1].contains(&(i % width));
    let mut is_enclosed = vec![true; mask.len()];
    for part in parts(&free, width, EDGES).iter().filter(|part| part.iter().any(on_border)) {
        part.iter().for_each(|&i| is_enclosed[i] = false);
    }
    let enclosed = parts(&is_enclosed, width, EDGES_AND_CORNERS);
    let mut is_kept = vec![false; mask.len()];
    // Of several, `max_by_key` takes the last.
    for &i in enclosed.iter().rev().max_by_key(|part| part.len()).into_iter().flatten() {
        is_kept[i] = true;
    }
    mask.iter_mut().zip(is_kept).for_each(|(inside, is_kept)| *inside &= is_kept);
}

/// Neighbours of a pixel: those that share an edge, and also those that share a corner.
pub(super) const EDGES: usize = 4;
pub(crate) const EDGES_AND_CORNERS: usize = 8;

/// The connected parts of a mask, each as its pixels, in the order of their first ones. [`EDGES`] or
/// [`EDGES_AND_CORNERS`] connect.
pub(crate) fn parts(mask: &[bool], width: usize, connecting: usize) -> Vec<Vec<usize>> {
    let width = width.max(1);
    let mut is_free = mask.to_vec();
    let mut parts = vec![];
    for start in 0..mask.len() {
        if !is_free[start] {
            continue;
        }
        is_free[start] = false;
        let mut part = vec![start];
        let mut next = 0;
        while let Some(&i) = part.get(next) {
            next += 1;
            for n in neighbours(i, width, mask.len()).into_iter().take(connecting).flatten() {
                if is_free[n] {
                    is_free[n] = false;
                    part.push(n);
                }
            }
        }
        parts.push(part);
    }
    parts
}

/// The pixels around one: first those that share an edge, then those that share a corner.
fn neighbours(i: usize, width: usize, count: usize) -> [Option<usize>; 8] {
    let x = i % width;
    let (left, right) = (x > 0, x + 1 < width);
    let above = i.checked_sub(width);
    let below = Some(i + width).filter(|i| *i < count);
    [
        left.then(|| i - 1),
        right.then(|| i + 1),
        above,
        below,
        above.filter(|_| left).map(|i| i - 1),
        above.filter(|_| right).map(|i| i + 1),
        below.filter(|_| left).map(|i| i - 1),
        below.filter(|_| right).map(|i| i + 1),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(rows: &[&str]) -> Vec<String> {
        let width = rows[0].len();
        let mut mask: Vec<bool> = rows.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect();
        keep_largest(&mut mask, width);
        mask.chunks(width).map(|row| row.iter().map(|i| if *i { '#' } else { '.' }).collect()).collect()
    }

    #[test]
    fn parts_are_connected_at_corners_and_the_larger_one_is_kept() {
        assert_eq!(kept(&["##..#", "##...", "..#.."]), ["##...", "##...", "..#.."]);
        assert_eq!(kept(&["#...#", "...##"]), ["....#", "...##"]);
    }

    #[test]
    fn parts_are_found_with_all_their_pixels() {
        let mask: Vec<bool> = "##..#.....#.".bytes().map(|b| b == b'#').collect();
        let mut sizes: Vec<usize> = parts(&mask, 4, EDGES_AND_CORNERS).iter().map(Vec::len).collect();
        sizes.sort_unstable();
        assert_eq!(sizes, [1, 3]);
        assert_eq!(parts(&mask, 4, EDGES).len(), 2);
    }

    #[test]
    fn a_ring_counts_with_its_enclosed_pixels_and_includes_its_contents() {
        let ring = [".#####......", ".#...#.#####", ".#.#.#.#####", ".#...#......", ".#####......"];
        let expected = [".#####......", ".#...#......", ".#.#.#......", ".#...#......", ".#####......"];
        assert_eq!(kept(&ring), expected);
    }

    #[test]
    fn empty_and_full_masks_stay_so() {
        assert_eq!(kept(&["...", "..."]), ["...", "..."]);
        assert_eq!(kept(&["###"]), ["###"]);
        keep_largest(&mut [], 0);
    }
}
