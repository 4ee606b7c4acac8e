//! The minimum cut of a grid of pixels, by the algorithm of Boykov and Kolmogorov (An Experimental Comparison of
//! Min-Cut/Max-Flow Algorithms for Energy Minimization in Vision, 2004): two search trees, one from the source and one
//! from the sink, that are kept when a path between them is saturated. In integers: the same cut everywhere.

use std::collections::VecDeque;

/// The eight neighbours of a pixel: columns and rows to the right and below. The fourth after each is its opposite.
pub(super) const NEIGHBOURS: [[isize; 2]; 8] = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]];

/// Parent of a node: a direction below 8, or one of these.
const TERMINAL: u8 = 8;
const NONE: u8 = 9;
const ORPHAN: u8 = 10;

/// To which tree a node belongs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Tree {
    Free,
    Source,
    Sink,
}

/// A grid whose pixels are to be parted into two sets.
pub(super) struct GridCut {
    width: usize,
    stride: usize,
    /// Offsets of the neighbours in the arrays, which have a border of one pixel around the grid.
    offsets: [isize; 8],
    /// What is left of the capacity from the source (positive) or to the sink (negative).
    terminal: Vec<i32>,
    /// What is left of the capacities to the neighbours.
    capacity: Vec<[i32; 8]>,
    tree: Vec<Tree>,
    parent: Vec<u8>,
    /// When a node's distance from its root was last known, and that distance.
    stamp: Vec<u32>,
    distance: Vec<u32>,
    is_active: Vec<bool>,
    active: VecDeque<u32>,
    orphans: VecDeque<u32>,
    time: u32,
}

impl GridCut {
    /// A grid without any capacity.
    pub fn new(width: usize, height: usize) -> GridCut {
        let stride = width + 2;
        let count = stride * (height + 2);
        GridCut {
            width,
            stride,
            offsets: NEIGHBOURS.map(|[x, y]| x + y * stride as isize),
            terminal: vec![0; count],
            capacity: vec![[0; 8]; count],
            tree: vec![Tree::Free; count],
            parent: vec![NONE; count],
            stamp: vec![0; count],
            distance: vec![0; count],
            is_active: vec![false; count],
            active: VecDeque::new(),
            orphans: VecDeque::new(),
            time: 0,
        }
    }

    fn node(&self, x: usize, y: usize) -> usize {
        (y + 1) * self.stride + x + 1
    }

    /// What it costs more to have a pixel on the sink's side than on the source's; may be negative.
    pub fn set_preference(&mut self, x: usize, y: usize, preference: i32) {
        let node = self.node(x, y);
        self.terminal[node] = preference;
    }

    /// What it costs to part a pixel from its neighbour in a direction, either way; not negative. The neighbour must be
    /// in the grid.
    pub fn set_cost(&mut self, x: usize, y: usize, direction: usize, cost: i32) {
        let node = self.node(x, y);
        let other = self.beside(node, direction);
        self.capacity[node][direction] = cost;
        self.capacity[other][(direction + 4) % 8] = cost;
    }

    fn beside(&self, node: usize, direction: usize) -> usize {
        node.wrapping_add_signed(self.offsets[direction])
    }

    fn activate(&mut self, node: usize) {
        if !self.is_active[node] {
            self.is_active[node] = true;
            self.active.push_back(node as u32);
        }
    }

    /// Whether each pixel, row-major, is on the source's side of a cut of least cost.
    pub fn cut(mut self) -> Vec<bool> {
        for node in 0..self.terminal.len() {
            self.tree[node] = match self.terminal[node].signum() {
                1 => Tree::Source,
                -1 => Tree::Sink,
                _ => continue,
            };
            self.parent[node] = TERMINAL;
            self.distance[node] = 1;
            self.activate(node);
        }
        while let Some(&node) = self.active.front() {
            let node = node as usize;
            match self.grow(node) {
                // The node stays in front: it may have other paths.
                Some(direction) => {
                    self.time += 1;
                    self.augment(node, direction);
                    while let Some(orphan) = self.orphans.pop_front() {
                        self.adopt(orphan as usize);
                    }
                }
                None => {
                    self.active.pop_front();
                    self.is_active[node] = false;
                }
            }
        }
        let height = self.terminal.len() / self.stride - 2;
        let on_source_side = |i: usize| self.tree[self.node(i % self.width, i / self.width)] == Tree::Source;
        (0..self.width * height).map(on_source_side).collect()
    }

    /// Extends the tree from an active node. Returns the direction to a node of the other tree, if there is one.
    fn grow(&mut self, node: usize) -> Option<usize> {
        let tree = self.tree[node];
        if tree == Tree::Free {
            return None;
        }
        for direction in 0..8 {
            let other = self.beside(node, direction);
            let back = (direction + 4) % 8;
            let left = match tree {
                Tree::Source => self.capacity[node][direction],
                _ => self.capacity[other][back],
            };
            if left == 0 {
                continue;
            }
            if self.tree[other] == Tree::Free {
                self.tree[other] = tree;
                self.connect(other, back, node);
                self.activate(other);
            } else if self.tree[other] != tree {
                return Some(direction);
            } else if self.stamp[other] <= self.stamp[node] && self.distance[other] > self.distance[node] {
                // Shorter trees are cheaper to repair.
                self.connect(other, back, node);
            }
        }
        None
    }

    fn connect(&mut self, child: usize, to_parent: usize, parent: usize) {
        self.parent[child] = to_parent as u8;
        self.stamp[child] = self.stamp[parent];
        self.distance[child] = self.distance[parent] + 1;
    }

    /// Saturates the path that goes through a node and its neighbour in the other tree.
    fn augment(&mut self, node: usize, direction: usize) {
        let other = self.beside(node, direction);
        let back = (direction + 4) % 8;
        let (source, sink, forwards) = match self.tree[node] {
            Tree::Source => (node, other, direction),
            _ => (other, node, back),
        };
        let mut flow = self.capacity[source][forwards];
        flow = flow.min(self.bottleneck(source, Tree::Source)).min(self.bottleneck(sink, Tree::Sink));
        self.capacity[source][forwards] -= flow;
        self.capacity[sink][(forwards + 4) % 8] += flow;
        self.push(source, Tree::Source, flow);
        self.push(sink, Tree::Sink, flow);
    }

    fn bottleneck(&self, mut node: usize, tree: Tree) -> i32 {
        let mut least = i32::MAX;
        while self.parent[node] != TERMINAL {
            let direction = self.parent[node] as usize;
            let parent = self.beside(node, direction);
            least = least.min(match tree {
                Tree::Source => self.capacity[parent][(direction + 4) % 8],
                _ => self.capacity[node][direction],
            });
            node = parent;
        }
        least.min(self.terminal[node].abs())
    }

    fn push(&mut self, mut node: usize, tree: Tree, flow: i32) {
        while self.parent[node] != TERMINAL {
            let direction = self.parent[node] as usize;
            let parent = self.beside(node, direction);
            let back = (direction + 4) % 8;
            let sign = if tree == Tree::Source { 1 } else { -1 };
            self.capacity[node][direction] += sign * flow;
            self.capacity[parent][back] -= sign * flow;
            let left = if tree == Tree::Source { self.capacity[parent][back] } else { self.capacity[node][direction] };
            if left == 0 {
                self.parent[node] = ORPHAN;
                self.orphans.push_front(node as u32);
            }
            node = parent;
        }
        self.terminal[node] -= if tree == Tree::Source { flow } else { -flow };
        if self.terminal[node] == 0 {
            self.parent[node] = ORPHAN;
            self.orphans.push_front(node as u32);
        }
    }

    /// Finds another parent for a node, or frees it and makes its children orphans.
    fn adopt(&mut self, node: usize) {
        let tree = self.tree[node];
        let mut best: Option<(u32, usize)> = None;
        for direction in 0..8 {
            let other = self.beside(node, direction);
            let left = match tree {
                Tree::Source => self.capacity[other][(direction + 4) % 8],
                _ => self.capacity[node][direction],
            };
            if left > 0
                && self.tree[other] == tree
                && let Some(distance) = self.distance_to_root(other)
                && best.is_none_or(|(least, _)| distance < least)
            {
                best = Some((distance, direction));
            }
        }
        if let Some((distance, direction)) = best {
            self.parent[node] = direction as u8;
            self.stamp[node] = self.time;
            self.distance[node] = distance + 1;
            return;
        }
        for direction in 0..8 {
            let other = self.beside(node, direction);
            if self.tree[other] != tree {
                continue;
            }
            let back = (direction + 4) % 8;
            let left = if tree == Tree::Source { self.capacity[other][back] } else { self.capacity[node][direction] };
            if left > 0 {
                self.activate(other);
            }
            if self.parent[other] as usize == back {
                self.parent[other] = ORPHAN;
                self.orphans.push_back(other as u32);
            }
        }
        self.tree[node] = Tree::Free;
        self.parent[node] = NONE;
    }

    /// Steps from a node to its terminal; `None` if an orphan is between.
    fn distance_to_root(&mut self, start: usize) -> Option<u32> {
        let mut node = start;
        let mut steps = 0;
        let total = loop {
            if self.stamp[node] == self.time && self.parent[node] < NONE {
                break steps + self.distance[node];
            }
            match self.parent[node] {
                TERMINAL => {
                    self.stamp[node] = self.time;
                    self.distance[node] = 1;
                    break steps + 1;
                }
                NONE | ORPHAN => return None,
                direction => {
                    node = self.beside(node, direction as usize);
                    steps += 1;
                }
            }
        };
        let mut node = start;
        let mut distance = total;
        while self.stamp[node] != self.time {
            self.stamp[node] = self.time;
            self.distance[node] = distance;
            distance -= 1;
            node = self.beside(node, self.parent[node] as usize);
        }
        Some(total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 4;

    /// A number in `[0, most)` from a linear congruential generator.
    fn draw(state: &mut u64, most: u64) -> i32 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((*state >> 33) % most) as i32
    }

    #[test]
    fn no_other_cut_costs_less() {
        let mut state = 5;
        for case in 0..60 {
            let preferences: Vec<i32> = (0..SIZE * SIZE).map(|_| draw(&mut state, 41) - 20).collect();
            let costs: Vec<[i32; 4]> = (0..SIZE * SIZE).map(|_| [0; 4].map(|_| draw(&mut state, 3 + case))).collect();
            let beside = |i: usize, direction: usize| {
                let [x, y] = [i % SIZE, i / SIZE];
                let (x, y) = (x as isize + NEIGHBOURS[direction][0], y as isize + NEIGHBOURS[direction][1]);
                let size = SIZE as isize;
                ((0..size).contains(&x) && (0..size).contains(&y)).then_some((x + y * size) as usize)
            };
            let mut grid = GridCut::new(SIZE, SIZE);
            for i in 0..SIZE * SIZE {
                grid.set_preference(i % SIZE, i / SIZE, preferences[i]);
                for direction in (0..4).filter(|d| beside(i, *d).is_some()) {
                    grid.set_cost(i % SIZE, i / SIZE, direction, costs[i][direction]);
                }
            }
            let price = |side: &dyn Fn(usize) -> bool| -> i32 {
                let of_pixel = |i: usize| {
                    let own = if side(i) { 0 } else { preferences[i] };
                    let parted = |d: &usize| beside(i, *d).is_some_and(|j| side(i) != side(j));
                    own + (0..4).filter(parted).map(|d| costs[i][d]).sum::<i32>()
                };
                (0..SIZE * SIZE).map(of_pixel).sum()
            };
            let found = grid.cut();
            let least = (0..1 << (SIZE * SIZE)).map(|bits: u32| price(&|i| bits >> i & 1 == 1)).min().unwrap();
            assert_eq!(price(&|i| found[i]), least, "case {case}");
        }
    }

    #[test]
    fn a_large_grid_is_parted_where_it_is_cheapest() {
        // Left half prefers the source a little, some pixels the sink: the even cost between neighbours removes them.
        // At this height no odd pixel lies where the line meets the border and would save more than it costs.
        let (width, height) = (60, 39);
        let mut grid = GridCut::new(width, height);
        for y in 0..height {
            for x in 0..width {
                let odd = (7 * x + 13 * y) % 11 == 0;
                grid.set_preference(x, y, if (x < 25) == odd { -9 } else { 9 });
                for (direction, [dx, dy]) in NEIGHBOURS.iter().enumerate().take(4) {
                    let (x2, y2) = (x as isize + dx, y as isize + dy);
                    if (0..width as isize).contains(&x2) && (0..height as isize).contains(&y2) {
                        grid.set_cost(x, y, direction, 5);
                    }
                }
            }
        }
        let found = grid.cut();
        assert!((0..width * height).all(|i| found[i] == (i % width < 25)));
    }
}
