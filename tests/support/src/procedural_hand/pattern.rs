//! The flat cloth pattern of the glove: the outline of one side, triangulated.
//!
//! An equilateral lattice is cut at the outline. Lattice points near the outline move onto it first, so that no slivers
//! remain ("isosurface stuffing" in the plane).

use std::collections::{BTreeMap, BTreeSet, HashMap};

use glam::DVec2;

/// A triangulated region of the plane; all triangles turn the same way (counter-clockwise).
#[derive(Debug, Clone)]
pub(super) struct Pattern {
    pub points: Vec<DVec2>,
    pub triangles: Vec<[u32; 3]>,
    /// Whether a point lies on the outline.
    pub on_outline: Vec<bool>,
}

/// Lattice points closer to a crossing than this part of an edge move onto it. Larger leaves fewer slivers but bends
/// lattice triangles more; isosurface stuffing proves bounds on the angles near this value.
const SNAP: f64 = 0.3;

impl Pattern {
    /// Triangulates `{p: inside(p) < 0}` between `low` and `high` with edges of about `edge` metres. `None` if the
    /// region is not one piece without holes at that resolution.
    pub(super) fn triangulate(low: DVec2, high: DVec2, edge: f64, inside: impl Fn(DVec2) -> f64) -> Option<Pattern> {
        let row_height = edge * 0.75f64.sqrt();
        let columns = ((high.x - low.x) / edge).ceil() as usize + 3;
        let rows = ((high.y - low.y) / row_height).ceil() as usize + 3;
        let origin = low - DVec2::new(edge, row_height);
        let mut points = Vec::with_capacity(rows * columns);
        for row in 0..rows {
            let shift = if row % 2 == 0 { 0.0 } else { 0.5 };
            points
                .extend((0..columns).map(|c| origin + DVec2::new((c as f64 + shift) * edge, row as f64 * row_height)));
        }
        let mut values: Vec<f64> = points.iter().map(|&p| inside(p)).collect();
        let mut triangles = Vec::new();
        for row in 0..rows - 1 {
            for c in 0..columns - 1 {
                let (a, b) = (row * columns + c, row * columns + c + 1);
                let (d, e) = (a + columns, b + columns);
                // Odd rows are shifted by half an edge, which flips the diagonal.
                if row % 2 == 0 {
                    triangles.extend([[a, b, d], [b, e, d]]);
                } else {
                    triangles.extend([[a, b, e], [a, e, d]]);
                }
            }
        }
        snap_to_outline(&mut points, &mut values, &triangles, &inside);
        let clipped = clip(&mut points, &mut values, &triangles, &inside);
        let mut pattern = compact(&points, &clipped)?;
        pattern.smooth(12);
        pattern.split_chords();
        pattern.is_sound().then_some(pattern)
    }

    /// Edges that only one triangle uses, with the direction in which it does.
    pub(super) fn outline_edges(&self) -> Vec<[u32; 2]> {
        let mut uses: BTreeMap<[u32; 2], [u32; 2]> = BTreeMap::new();
        for edge in self.triangles.iter().flat_map(edges) {
            let key = [edge[0].min(edge[1]), edge[0].max(edge[1])];
            if uses.remove(&key).is_none() {
                uses.insert(key, edge);
            }
        }
        uses.into_values().collect()
    }

    /// Moves inner points to the middle of their neighbours.
    fn smooth(&mut self, rounds: usize) {
        let neighbours = neighbours(self.points.len(), &self.triangles);
        for _ in 0..rounds {
            let before = self.points.clone();
            for (i, list) in neighbours.iter().enumerate() {
                if !self.on_outline[i] && !list.is_empty() {
                    let mean = list.iter().map(|&j| before[j as usize]).sum::<DVec2>() / list.len() as f64;
                    self.points[i] = 0.5 * (before[i] + mean);
                }
            }
        }
    }

    /// Splits inner edges between two outline points: sewn to the other side, such an edge would be shared by four
    /// triangles.
    fn split_chords(&mut self) {
        let outline: BTreeSet<[u32; 2]> =
            self.outline_edges().iter().map(|e| [e[0].min(e[1]), e[0].max(e[1])]).collect();
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut work: Vec<[u32; 3]> = std::mem::take(&mut self.triangles);
        work.reverse();
        while let Some(triangle) = work.pop() {
            let chord = (0..3).find(|&k| {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                self.on_outline[a as usize] && self.on_outline[b as usize] && !outline.contains(&[a.min(b), a.max(b)])
            });
            let Some(k) = chord else {
                self.triangles.push(triangle);
                continue;
            };
            let [a, b, c] = [triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]];
            let middle = *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                self.points.push(0.5 * (self.points[a as usize] + self.points[b as usize]));
                self.on_outline.push(false);
                self.points.len() as u32 - 1
            });
            work.push([middle, b, c]);
            work.push([a, middle, c]);
        }
    }

    /// Every triangle turns left, and the outline is one simple loop: a disc.
    fn is_sound(&self) -> bool {
        let turned = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.points[i as usize]);
            (b - a).perp_dot(c - a) > 0.0
        };
        let next: BTreeMap<u32, u32> = self.outline_edges().iter().map(|e| (e[0], e[1])).collect();
        let Some(&start) = next.keys().next() else { return false };
        let mut at = start;
        let mut steps = 0;
        loop {
            let Some(&to) = next.get(&at) else { return false };
            (at, steps) = (to, steps + 1);
            if at == start || steps > next.len() {
                break;
            }
        }
        steps == self.outline_edges().len() && self.triangles.iter().all(turned)
    }
}

/// The three directed edges of a triangle.
pub(super) fn edges(t: &[u32; 3]) -> [[u32; 2]; 3] {
    [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]
}

/// Neighbours of every point, ascending.
pub(super) fn neighbours(count: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); count];
    for [a, b] in triangles.iter().flat_map(edges) {
        lists[a as usize].push(b);
        lists[b as usize].push(a);
    }
    for list in &mut lists {
        list.sort_unstable();
        list.dedup();
    }
    lists
}

/// Where the outline crosses the edge from `a` (inside) to `b` (outside), as a fraction of the edge.
fn crossing(a: DVec2, b: DVec2, inside: &impl Fn(DVec2) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if inside(a.lerp(b, middle)) < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

fn snap_to_outline(points: &mut [DVec2], values: &mut [f64], triangles: &[[usize; 3]], inside: &impl Fn(DVec2) -> f64) {
    let mut best: BTreeMap<usize, (f64, DVec2)> = BTreeMap::new();
    for t in triangles {
        for k in 0..3 {
            let (mut a, mut b) = (t[k], t[(k + 1) % 3]);
            if values[b] < 0.0 {
                (a, b) = (b, a);
            }
            if !(values[a] < 0.0 && values[b] >= 0.0) {
                continue;
            }
            let at = crossing(points[a], points[b], inside);
            let target = points[a].lerp(points[b], at);
            let (end, way) = if at < 0.5 { (a, at) } else { (b, 1.0 - at) };
            if way < SNAP && best.get(&end).is_none_or(|old| way < old.0) {
                best.insert(end, (way, target));
            }
        }
    }
    for (i, (_, target)) in best {
        points[i] = target;
        values[i] = 0.0;
    }
}

fn clip(
    points: &mut Vec<DVec2>,
    values: &mut Vec<f64>,
    triangles: &[[usize; 3]],
    inside: &impl Fn(DVec2) -> f64,
) -> Vec<[usize; 3]> {
    let mut cuts: HashMap<(usize, usize), usize> = HashMap::new();
    let mut clipped = Vec::new();
    for t in triangles {
        if !t.iter().any(|&i| values[i] < 0.0) {
            continue;
        }
        let mut polygon: Vec<usize> = Vec::with_capacity(4);
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            if values[a] <= 0.0 {
                polygon.push(a);
            }
            if (values[a] < 0.0 && values[b] > 0.0) || (values[a] > 0.0 && values[b] < 0.0) {
                let (from, to) = if values[a] < 0.0 { (a, b) } else { (b, a) };
                let cut = *cuts.entry((from, to)).or_insert_with(|| {
                    let at = crossing(points[from], points[to], inside);
                    points.push(points[from].lerp(points[to], at));
                    values.push(0.0);
                    points.len() - 1
                });
                polygon.push(cut);
            }
        }
        match *polygon.as_slice() {
            [a, b, c] => clipped.push([a, b, c]),
            [a, b, c, d] => {
                if points[a].distance_squared(points[c]) <= points[b].distance_squared(points[d]) {
                    clipped.extend([[a, b, c], [a, c, d]]);
                } else {
                    clipped.extend([[a, b, d], [b, c, d]]);
                }
            }
            _ => {}
        }
    }
    clipped
}

/// Renumbers the used points and marks the outline.
fn compact(points: &[DVec2], triangles: &[[usize; 3]]) -> Option<Pattern> {
    let mut index: HashMap<usize, u32> = HashMap::new();
    let mut pattern = Pattern { points: vec![], triangles: vec![], on_outline: vec![] };
    for t in triangles {
        let triangle = t.map(|i| {
            *index.entry(i).or_insert_with(|| {
                pattern.points.push(points[i]);
                pattern.points.len() as u32 - 1
            })
        });
        pattern.triangles.push(triangle);
    }
    pattern.on_outline = vec![false; pattern.points.len()];
    for edge in pattern.outline_edges() {
        pattern.on_outline[edge[0] as usize] = true;
    }
    (!pattern.triangles.is_empty()).then_some(pattern)
}
