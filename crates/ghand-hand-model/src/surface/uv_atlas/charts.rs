//! Cuts a surface into charts that are completely visible along one direction.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap, VecDeque};

use glam::{DVec2, DVec3};

use super::raster::touched_cells;
use super::{SMALLEST_AREA, STEEPEST};

/// Directions that charts are seen from: about 18 degrees apart, a third of the steepest angle.
const DIRECTIONS: usize = 128;

/// A connected piece of the surface, projected.
pub(super) struct Chart {
    /// Faces of the mesh.
    pub faces: Vec<u32>,
    /// Vertices of the mesh.
    pub vertices: Vec<u32>,
    /// The projected vertices, y up, in units of the mesh.
    pub points: Vec<DVec2>,
    /// The faces as indices into `points`, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
}

/// A mesh that is being cut.
struct Mesh<'a> {
    vertices: &'a [DVec3],
    faces: &'a [[u32; 3]],
    /// Unit normals; zero for a face without area.
    normals: Vec<DVec3>,
    areas: Vec<f64>,
    neighbours: Vec<[Option<u32>; 3]>,
    /// Faces that do not belong to a chart yet.
    free: Vec<bool>,
    /// For [`Mesh::flood`]: the index of the flood that each face is marked for.
    marks: Vec<u32>,
    floods: u32,
}

/// A connected set of faces that are well visible from one direction.
struct Candidate {
    /// The visible area.
    seen: f64,
    direction: usize,
    faces: Vec<u32>,
}

/// Cuts a mesh whose longest side is 1: repeatedly takes the largest piece that is well visible from one direction.
/// Faces without area do not become part of a chart.
pub(super) fn cut(vertices: &[DVec3], faces: &[[u32; 3]]) -> Vec<Chart> {
    let doubled = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|i| vertices[i as usize]);
        (b - a).cross(c - a)
    };
    let doubled: Vec<DVec3> = faces.iter().map(doubled).collect();
    let areas: Vec<f64> = doubled.iter().map(|n| 0.5 * n.length()).collect();
    let has_area = |k: usize| areas[k] >= SMALLEST_AREA;
    let mut mesh = Mesh {
        vertices,
        faces,
        normals: (0..faces.len()).map(|k| if has_area(k) { doubled[k].normalize() } else { DVec3::ZERO }).collect(),
        neighbours: neighbours(faces),
        free: (0..faces.len()).map(has_area).collect(),
        areas,
        marks: vec![0; faces.len()],
        floods: 0,
    };
    let directions = directions();
    let mut charts = vec![];
    let mut heap = BinaryHeap::new();
    for (k, direction) in directions.iter().enumerate() {
        let seen = (0..faces.len() as u32).filter(|&f| mesh.normals[f as usize].dot(*direction) >= STEEPEST).collect();
        mesh.push_pieces(&mut heap, k, *direction, seen);
    }
    while let Some(Candidate { direction: k, faces, .. }) = heap.pop() {
        let direction = directions[k];
        // Charts taken since then may have removed parts of this piece; the rest is queued again.
        let whole = faces.len();
        let faces: Vec<u32> = faces.into_iter().filter(|&f| mesh.free[f as usize]).collect();
        if faces.len() < whole {
            mesh.push_pieces(&mut heap, k, direction, faces);
            continue;
        }
        let chart = mesh.project(&faces, direction);
        for &f in &chart.faces {
            mesh.free[f as usize] = false;
        }
        charts.push(chart);
        let hidden = faces.into_iter().filter(|&f| mesh.free[f as usize]).collect();
        mesh.push_pieces(&mut heap, k, direction, hidden);
    }
    charts
}

impl Mesh<'_> {
    /// Splits faces into connected pieces and queues them.
    fn push_pieces(&mut self, heap: &mut BinaryHeap<Candidate>, k: usize, direction: DVec3, faces: Vec<u32>) {
        self.mark(&faces);
        for &start in &faces {
            let mut piece = vec![];
            let mut seen = 0.0;
            self.flood(start, |mesh, face| {
                seen += mesh.areas[face as usize] * mesh.normals[face as usize].dot(direction);
                piece.push(face);
                true
            });
            if !piece.is_empty() {
                heap.push(Candidate { seen, direction: k, faces: piece });
            }
        }
    }

    /// Marks faces for [`Mesh::flood`].
    fn mark(&mut self, faces: &[u32]) {
        self.floods += 1;
        for &face in faces {
            self.marks[face as usize] = self.floods;
        }
    }

    /// Visits the marked faces that are connected to `start`, removes their marks, and continues from those that
    /// `visit` accepts.
    fn flood(&mut self, start: u32, mut visit: impl FnMut(&Mesh, u32) -> bool) {
        let mut queue = VecDeque::from([start]);
        while let Some(face) = queue.pop_front() {
            if self.marks[face as usize] != self.floods {
                continue;
            }
            self.marks[face as usize] = 0;
            if visit(self, face) {
                queue.extend(self.neighbours[face as usize].iter().flatten());
            }
        }
    }

    /// Projects a connected piece; faces that would cover others of the piece are excluded.
    fn project(&mut self, piece: &[u32], direction: DVec3) -> Chart {
        let right = direction.any_orthonormal_vector();
        let up = direction.cross(right);
        let vertices = self.vertices;
        let faces = self.faces;
        let project = |face: u32| {
            faces[face as usize].map(|v| DVec2::new(vertices[v as usize].dot(right), vertices[v as usize].dot(up)))
        };
        let mut kept = Disjoint::new(piece.iter().flat_map(|&face| project(face)), piece.len());
        let seen = |k: &usize| self.areas[piece[*k] as usize] * self.normals[piece[*k] as usize].dot(direction);
        // The piece grows from its largest face, so that excluded faces are at its ends.
        let start = (0..piece.len()).max_by(|a, b| seen(a).total_cmp(&seen(b)).then(b.cmp(a))).unwrap_or(0);
        self.mark(piece);
        let mut chart = Chart { faces: vec![], vertices: vec![], points: vec![], triangles: vec![] };
        let mut point_of_vertex = HashMap::new();
        self.flood(piece[start], |_, face| {
            let face_vertices = faces[face as usize];
            let corners = project(face);
            if !kept.insert(corners) {
                return false;
            }
            chart.faces.push(face);
            chart.triangles.push(std::array::from_fn(|c| {
                *point_of_vertex.entry(face_vertices[c]).or_insert_with(|| {
                    chart.vertices.push(face_vertices[c]);
                    chart.points.push(corners[c]);
                    chart.points.len() as u32 - 1
                })
            }));
            true
        });
        chart
    }
}

/// Counter-clockwise triangles that do not overlap, indexed by the cells of a grid.
struct Disjoint {
    low: DVec2,
    /// Cells per unit of length.
    fineness: f64,
    columns: usize,
    /// The triangles that touch each cell, row by row.
    cells: Vec<Vec<u32>>,
    triangles: Vec<[DVec2; 3]>,
}

impl Disjoint {
    /// An empty set, with a grid for `count` triangles with those corners: about as many cells as triangles.
    fn new(corners: impl Iterator<Item = DVec2>, count: usize) -> Disjoint {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for p in corners {
            low = low.min(p);
            high = high.max(p);
        }
        let across = (count as f64).sqrt().ceil();
        let fineness = across / (high - low).max_element().max(f64::MIN_POSITIVE);
        // Two more: a triangle at the far border touches the cell beyond.
        let columns = across as usize + 2;
        Disjoint { low, fineness, columns, cells: vec![vec![]; columns * columns], triangles: vec![] }
    }

    /// Adds a triangle, unless it overlaps an existing one.
    fn insert(&mut self, corners: [DVec2; 3]) -> bool {
        let in_cells = corners.map(|p| (p - self.low) * self.fineness);
        let cells: Vec<usize> = touched_cells(in_cells)
            .flat_map(|(row, columns)| columns.map(move |c| (row, c)))
            .map(|(r, c)| r * self.columns + c)
            .collect();
        let near = cells.iter().flat_map(|&cell| &self.cells[cell]);
        if near.into_iter().any(|&other| overlap(&corners, &self.triangles[other as usize])) {
            return false;
        }
        for cell in cells {
            self.cells[cell].push(self.triangles.len() as u32);
        }
        self.triangles.push(corners);
        true
    }
}

/// Whether two counter-clockwise triangles share an area. Triangles with a common edge or corner are judged without any
/// rounding there: the area of a triangle that has the same point twice is exactly 0.
fn overlap(first: &[DVec2; 3], second: &[DVec2; 3]) -> bool {
    let separates =
        |edge: (DVec2, DVec2), other: &[DVec2; 3]| other.iter().all(|p| (edge.1 - edge.0).perp_dot(*p - edge.0) <= 0.0);
    let edges = |t: &[DVec2; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    !(edges(first).into_iter().any(|e| separates(e, second)) || edges(second).into_iter().any(|e| separates(e, first)))
}

/// The faces across the three edges of each face. An edge of one face, or of more than two, is a border.
fn neighbours(faces: &[[u32; 3]]) -> Vec<[Option<u32>; 3]> {
    let mut edges: Vec<([u32; 2], u32, usize)> = Vec::with_capacity(3 * faces.len());
    for (k, face) in faces.iter().enumerate() {
        for corner in 0..3 {
            let (a, b) = (face[corner], face[(corner + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], k as u32, corner));
        }
    }
    edges.sort_unstable();
    let mut neighbours = vec![[None; 3]; faces.len()];
    for group in edges.chunk_by(|a, b| a.0 == b.0) {
        if let &[(_, first, at_first), (_, second, at_second)] = group {
            neighbours[first as usize][at_first] = Some(second);
            neighbours[second as usize][at_second] = Some(first);
        }
    }
    neighbours
}

/// Unit vectors spread evenly: on a spiral from pole to pole, in steps of the golden angle.
fn directions() -> Vec<DVec3> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let place = |k: usize| {
        let z = 1.0 - (2 * k + 1) as f64 / DIRECTIONS as f64;
        let (sin, cos) = (golden_angle * k as f64).sin_cos();
        DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
    };
    (0..DIRECTIONS).map(place).collect()
}

impl Ord for Candidate {
    fn cmp(&self, other: &Candidate) -> Ordering {
        let earlier = (other.direction, &other.faces).cmp(&(self.direction, &self.faces));
        self.seen.total_cmp(&other.seen).then(earlier)
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Candidate) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Candidate) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}
