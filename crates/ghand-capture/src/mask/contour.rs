//! The largest part of a mask.

/// Keeps the part of a row-major mask inside the contour that encloses most pixels. Holes stay holes, but count as
/// enclosed. Pixels that touch at corners are connected.
pub(super) fn keep_largest(mask: &mut [bool], width: usize) {
    let width = width.max(1);
    let mut label: Vec<u32> = vec![0; mask.len()];
    // Pixels that can be reached from the border without crossing the mask are outside all contours.
    let on_border = |i: usize| i < width || i + width >= mask.len() || [0, width - 1].contains(&(i % width));
    let mut pending: Vec<usize> = (0..mask.len()).filter(|&i| on_border(i) && !mask[i]).collect();
    pending.iter().for_each(|&i| label[i] = OUTSIDE);
    while let Some(i) = pending.pop() {
        for n in neighbours(i, width, mask.len()).into_iter().take(4).flatten() {
            if !mask[n] && label[n] == 0 {
                label[n] = OUTSIDE;
                pending.push(n);
            }
        }
    }
    let mut best = 0;
    let mut largest = 0;
    let mut next = OUTSIDE + 1;
    for start in 0..mask.len() {
        if label[start] != 0 {
            continue;
        }
        label[start] = next;
        pending.push(start);
        let mut size = 0;
        while let Some(i) = pending.pop() {
            size += 1;
            for n in neighbours(i, width, mask.len()).into_iter().flatten() {
                if label[n] == 0 {
                    label[n] = next;
                    pending.push(n);
                }
            }
        }
        if size > largest {
            (best, largest) = (next, size);
        }
        next += 1;
    }
    mask.iter_mut().zip(label).for_each(|(inside, label)| *inside &= label == best);
}

/// The connected parts of a mask, each as its pixels. Pixels that touch at corners are connected.
pub(crate) fn parts(mask: &[bool], width: usize) -> Vec<Vec<usize>> {
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
            for n in neighbours(i, width.max(1), mask.len()).into_iter().flatten() {
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

const OUTSIDE: u32 = 1;

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
        let mut sizes: Vec<usize> = parts(&mask, 4).iter().map(Vec::len).collect();
        sizes.sort_unstable();
        assert_eq!(sizes, [1, 3]);
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
