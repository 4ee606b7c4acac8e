//! The meshes of a hand as stored in the file, with vertices split at seams.

use ::gltf::Semantic;
use ::gltf::mesh::{Mode, Primitive};
use glam::{DMat3, DVec2, DVec3};

use super::buffers::Buffers;
use super::{Source, dvec3, morph_targets};
use crate::HandModelError;

/// Most weights (vertices x joints), half a gigabyte: a million vertices with 64 joints.
const MAX_WEIGHTS: usize = 1 << 26;
/// Most triangles.
const MAX_TRIANGLES: usize = 1 << 24;
/// Most sets of four joints that a vertex may be bound to.
const MAX_SETS: u32 = 64;

/// What moves the vertices that are bound to a joint of a skin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Moves {
    /// A joint of the hand, by its place in the model.
    Hand(usize),
    /// A joint of the arm next to the wrist, by its place in the skeleton.
    Arm(usize),
    /// Any other joint, by its place in the skeleton.
    Body(usize),
}

/// How a mesh becomes part of the hand.
pub(super) struct Binding {
    /// One per joint of the skin.
    pub joints: Vec<Moves>,
    /// From the mesh's axes to the model's, and where its origin then is; `None` leaves it as it is.
    pub model_from_mesh: Option<(DMat3, DVec3)>,
}

impl Binding {
    pub(super) fn point(&self, point: DVec3) -> DVec3 {
        self.model_from_mesh.map_or(point, |(turn, origin)| turn * point + origin)
    }

    /// Whether a primitive may have vertices of the hand or of the arm next to it. What cannot be read is left to the
    /// reader of the primitive.
    pub(super) fn may_move(&self, primitive: &Primitive, buffers: &Buffers) -> bool {
        if !self.joints.iter().any(|moves| matches!(moves, Moves::Body(_))) {
            return true;
        }
        (0..MAX_SETS).map_while(|set| Some((primitive.get(&Semantic::Joints(set))?, set))).any(|(joints, set)| {
            let weights = primitive.get(&Semantic::Weights(set)).and_then(|w| buffers.floats::<4>(&w, "").ok());
            let (Ok(joints), Some(weights)) = (buffers.integers::<4>(&joints, ""), weights) else { return true };
            let mut bound = joints.iter().flatten().zip(weights.iter().flatten());
            let is_of_body = |joint: u32| matches!(self.joints.get(joint as usize), Some(Moves::Body(_)));
            bound.any(|(joint, weight)| *weight != 0.0 && !is_of_body(*joint))
        })
    }

    pub(super) fn direction(&self, direction: DVec3) -> DVec3 {
        self.model_from_mesh.map_or(direction, |(turn, _)| turn * direction)
    }
}

/// A morph target of one or more meshes.
pub(super) struct RawTarget {
    pub name: Option<String>,
    /// Displacements of all vertices, metres.
    pub displacements: Vec<DVec3>,
}

/// All vertices, in the order of the file.
#[derive(Default)]
pub(super) struct RawMesh {
    /// Metres, model axes.
    pub positions: Vec<DVec3>,
    pub uvs: Vec<DVec2>,
    /// `[V][n_b]`, in the model's order of joints.
    pub weights: Vec<f64>,
    /// Weights of joints that are not the hand's.
    pub outside: Vec<Outside>,
    pub triangles: Vec<[u32; 3]>,
    pub targets: Vec<RawTarget>,
}

/// How much of a vertex follows joints that are not the hand's.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Outside {
    pub arm: f64,
    pub body: f64,
    /// The heaviest of these joints, by its place in the skeleton, with its weight.
    pub heaviest: Option<(usize, f64)>,
}

impl Outside {
    pub(super) fn total(&self) -> f64 {
        self.arm + self.body
    }
}

impl RawMesh {
    /// Adds a primitive; `names` are those of its mesh's targets, and `first_target` the place of the first of them.
    pub(super) fn append(
        &mut self,
        primitive: &Primitive,
        names: &[Option<String>],
        n_b: usize,
        binding: &Binding,
        buffers: &Buffers,
        source: &Source,
    ) -> Result<(), HandModelError> {
        if primitive.mode() != Mode::Triangles {
            return Err(source.invalid("mesh", format!("is of {:?}; export plain triangles", primitive.mode())));
        }
        let accessor = |semantic: &Semantic, remedy: &str| {
            primitive.get(semantic).ok_or_else(|| source.invalid(&format!("{semantic:?}"), remedy.into()))
        };
        let positions = buffers.floats::<3>(&accessor(&Semantic::Positions, "is missing")?, "POSITION")?;
        let uvs = accessor(&Semantic::TexCoords(0), "is missing; unwrap the mesh (one UV atlas) and export UVs")?;
        let uvs = buffers.floats::<2>(&uvs, "TEXCOORD_0")?;
        let count = positions.len();
        let first = self.positions.len();
        if uvs.len() != count {
            return Err(mismatch("TEXCOORD_0", uvs.len(), count, source));
        }
        if (first + count).saturating_mul(n_b) > MAX_WEIGHTS {
            let problem = format!("has {} vertices for {n_b} joints, too many; decimate the mesh", first + count);
            return Err(source.invalid("mesh", problem));
        }
        self.append_weights(primitive, count, n_b, binding, buffers, source)?;
        let corners: Vec<u32> = match primitive.indices() {
            Some(accessor) => buffers.integers::<1>(&accessor, "indices")?.into_iter().map(|[i]| i).collect(),
            None => (0..count as u32).collect(),
        };
        if let Some(bad) = corners.iter().find(|&&i| i as usize >= count) {
            return Err(source.invalid("indices", format!("refer to vertex {bad} of {count}; export the hand again")));
        }
        if self.triangles.len() + corners.len() / 3 > MAX_TRIANGLES {
            return Err(source.invalid("mesh", format!("has more than {MAX_TRIANGLES} triangles; decimate the mesh")));
        }
        let targets = morph_targets::displacements(primitive, count, first, buffers, source)?;
        self.append_targets(targets, names, count, binding);
        self.positions.extend(positions.into_iter().map(|p| binding.point(dvec3(p))));
        self.uvs.extend(uvs.iter().map(|uv| DVec2::new(f64::from(uv[0]), f64::from(uv[1]))));
        // A mirror turns triangles inside out.
        let is_mirror = binding.model_from_mesh.is_some_and(|(turn, _)| turn.determinant() < 0.0);
        let triangle = |[a, b, c]: &[u32; 3]| if is_mirror { [*a, *c, *b] } else { [*a, *b, *c] };
        self.triangles.extend(corners.as_chunks::<3>().0.iter().map(|t| triangle(t).map(|i| i + first as u32)));
        Ok(())
    }

    fn append_weights(
        &mut self,
        primitive: &Primitive,
        count: usize,
        n_b: usize,
        binding: &Binding,
        buffers: &Buffers,
        source: &Source,
    ) -> Result<(), HandModelError> {
        let mut weights = vec![0.0; count * n_b];
        let mut outside = vec![Outside::default(); count];
        let mut set = 0;
        while let Some(indices) = primitive.get(&Semantic::Joints(set)) {
            let field = format!("WEIGHTS_{set}");
            let parts = primitive.get(&Semantic::Weights(set)).ok_or_else(|| {
                source.invalid(&field, format!("is missing beside JOINTS_{set}; export skin weights"))
            })?;
            let indices = buffers.integers::<4>(&indices, &format!("JOINTS_{set}"))?;
            let parts = buffers.floats::<4>(&parts, &field)?;
            if indices.len() != count || parts.len() != count {
                return Err(mismatch(&field, indices.len().min(parts.len()), count, source));
            }
            let rows = weights.chunks_exact_mut(n_b).zip(&mut outside);
            for ((row, outside), (joints, parts)) in rows.zip(indices.iter().zip(&parts)) {
                for (joint, &part) in joints.iter().zip(parts) {
                    let part = f64::from(part);
                    if !(part >= 0.0 && part.is_finite()) {
                        return Err(source.invalid(&field, format!("has {part}; weights must be 0 or more")));
                    }
                    // Unused entries may name any joint.
                    if part == 0.0 {
                        continue;
                    }
                    let Some(&moves) = binding.joints.get(*joint as usize) else {
                        let problem = format!("refers to joint {joint} of {}", binding.joints.len());
                        return Err(source.invalid(&format!("JOINTS_{set}"), problem));
                    };
                    match moves {
                        Moves::Hand(to) => row[to] += part,
                        Moves::Arm(joint) => outside.add(joint, part, true),
                        Moves::Body(joint) => outside.add(joint, part, false),
                    }
                }
            }
            set += 1;
            if set > MAX_SETS {
                return Err(source.invalid("JOINTS_n", format!("more than {MAX_SETS} sets; bind to fewer joints")));
            }
        }
        if set == 0 {
            return Err(source.invalid("JOINTS_0", "is missing; export the mesh with its skin weights".into()));
        }
        for (k, (row, outside)) in weights.chunks_exact_mut(n_b).zip(&mut outside).enumerate() {
            let sum: f64 = row.iter().sum::<f64>() + outside.total();
            if sum <= 0.0 {
                return Err(
                    source.invalid("WEIGHTS_0", format!("vertex {k} is not bound to any joint; bind every vertex"))
                );
            }
            row.iter_mut().for_each(|w| *w /= sum);
            (outside.arm, outside.body) = (outside.arm / sum, outside.body / sum);
        }
        self.weights.extend(weights);
        self.outside.extend(outside);
        Ok(())
    }

    /// Targets of the same name are one, as are those without a name in the same place. A mesh without a target does not
    /// move with it.
    fn append_targets(
        &mut self,
        targets: Vec<Vec<[f32; 3]>>,
        names: &[Option<String>],
        count: usize,
        binding: &Binding,
    ) {
        let first = self.positions.len();
        let mut taken = vec![false; self.targets.len()];
        for (k, target) in targets.into_iter().enumerate() {
            let name = names.get(k).cloned().flatten();
            let same = |at: &usize| !taken[*at] && self.targets[*at].name == name && (name.is_some() || *at == k);
            let at = (0..taken.len()).find(same).unwrap_or_else(|| {
                self.targets.push(RawTarget { name, displacements: vec![DVec3::ZERO; first] });
                self.targets.len() - 1
            });
            taken.resize(self.targets.len(), false);
            taken[at] = true;
            self.targets[at].displacements.extend(target.into_iter().map(|d| binding.direction(dvec3(d))));
        }
        self.targets.iter_mut().for_each(|target| target.displacements.resize(first + count, DVec3::ZERO));
    }

    /// Keeps the vertices that a rule selects, with the triangles between them.
    pub(super) fn retain(&mut self, keep: &[bool], n_b: usize) {
        let mut count = 0;
        let places: Vec<Option<u32>> = keep
            .iter()
            .map(|keep| {
                count += u32::from(*keep);
                keep.then(|| count - 1)
            })
            .collect();
        let mut rows = places.iter();
        let mut is_kept = || rows.next().is_some_and(Option::is_some);
        self.positions.retain(|_| is_kept());
        let uvs = std::mem::take(&mut self.uvs);
        let outside = std::mem::take(&mut self.outside);
        let kept = |k: usize| places[k].is_some();
        self.uvs = uvs.into_iter().enumerate().filter(|(k, _)| kept(*k)).map(|(_, uv)| uv).collect();
        self.outside = outside.into_iter().enumerate().filter(|(k, _)| kept(*k)).map(|(_, o)| o).collect();
        let weights = std::mem::take(&mut self.weights);
        let rows = weights.chunks_exact(n_b).enumerate().filter(|(k, _)| kept(*k));
        self.weights = rows.flat_map(|(_, row)| row.iter().copied()).collect();
        for target in &mut self.targets {
            let all = std::mem::take(&mut target.displacements);
            target.displacements = all.into_iter().enumerate().filter(|(k, _)| kept(*k)).map(|(_, d)| d).collect();
        }
        let triangle = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| places[i as usize]);
            Some([a?, b?, c?])
        };
        self.triangles = self.triangles.iter().filter_map(triangle).collect();
    }
}

impl Outside {
    fn add(&mut self, joint: usize, weight: f64, is_arm: bool) {
        if is_arm {
            self.arm += weight
        } else {
            self.body += weight
        }
        if self.heaviest.is_none_or(|(_, heaviest)| weight > heaviest) {
            self.heaviest = Some((joint, weight));
        }
    }
}

fn mismatch(field: &str, found: usize, count: usize, source: &Source) -> HandModelError {
    source.invalid(field, format!("has {found} entries for {count} positions; export the hand again"))
}
