//! A GLB file in the making: its buffer, the accessors into it, and the lists of its JSON.

use ghand_core::HandModel;
use ghand_core::mesh::RenderMesh;
use glam::{DVec3, Mat4, Vec3};
use serde_json::{Map, Value, json};

use crate::HandModelError;

// Numbers of the glTF standard.
const F32: u32 = 5126;
const U32: u32 = 5125;
const U16: u32 = 5123;
const VERTEX_BUFFER: u32 = 34962;
const INDEX_BUFFER: u32 = 34963;

/// The buffer of a GLB file with its views and accessors, one view for each accessor. All parts begin at multiples of
/// four bytes, so that every one is aligned. [`GlbDocument::push`] adds to the lists of glTF: nodes, meshes, skins.
pub struct GlbDocument<'a> {
    model: &'a HandModel,
    binary: Vec<u8>,
    accessors: Vec<Value>,
    root: Map<String, Value>,
}

/// The number of an accessor.
pub type Accessor = usize;

impl<'a> GlbDocument<'a> {
    /// An empty file; the model is named in errors.
    pub fn new(model: &'a HandModel) -> GlbDocument<'a> {
        GlbDocument { model, binary: vec![], accessors: vec![], root: Map::new() }
    }

    /// Adds to a list of glTF, such as `meshes`; returns the number that it has there.
    pub fn push(&mut self, list: &str, item: Value) -> usize {
        let list = self.root.entry(list).or_insert_with(|| json!([]));
        match list.as_array_mut() {
            Some(items) => {
                items.push(item);
                items.len() - 1
            }
            None => 0,
        }
    }

    /// Names an extension that the file uses.
    pub fn use_extension(&mut self, name: &str) {
        let is_named = self
            .root
            .get("extensionsUsed")
            .and_then(Value::as_array)
            .is_some_and(|names| names.iter().any(|own| own == name));
        if !is_named {
            self.push("extensionsUsed", name.into());
        }
    }

    /// Adds the root's part of an extension.
    pub fn extend_root(&mut self, name: &str, value: Value) {
        self.use_extension(name);
        self.root.entry("extensions").or_insert_with(|| json!({}))[name] = value;
    }

    /// Adds bytes of another format, such as a picture; returns the number of their buffer view.
    pub fn bytes(&mut self, bytes: &[u8]) -> usize {
        let begin = self.binary.len();
        self.binary.extend(bytes);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": begin, "byteLength": bytes.len()}))
    }

    /// The primitive of a mesh split at UV seams, with normals, and with morph targets that displace the model's
    /// vertices by `directions` (`[n][V]`, metres). `positions` (`V`, metres) are the model's vertices.
    ///
    /// # Errors
    /// [`HandModelError::Invalid`] if a direction is too large for single precision.
    pub fn primitive(
        &mut self,
        mesh: &RenderMesh,
        positions: &[DVec3],
        directions: &[DVec3],
    ) -> Result<Value, HandModelError> {
        let normals = self.model.vertex_normals(positions);
        // glTF requires a unit vector, even for a vertex whose faces have no area.
        let normals = mesh.gather(&normals).into_iter().map(|n| if n == DVec3::ZERO { DVec3::Z } else { n });
        let normals: Vec<DVec3> = normals.collect();
        let uvs = mesh.uvs.iter().flat_map(|uv| uv.as_vec2().to_array());
        let corners = mesh.triangles.iter().flatten().copied();
        let mut primitive = json!({
            "attributes": {
                "POSITION": self.displacements(&mesh.gather(positions), "positions")?,
                "NORMAL": self.vectors(&normals, "normals", Some(VERTEX_BUFFER))?,
                "TEXCOORD_0": self.floats(uvs, "VEC2", Some(VERTEX_BUFFER)),
            },
            "indices": self.add(corners.flat_map(u32::to_le_bytes), U32, "SCALAR", Some(INDEX_BUFFER)),
        });
        if !directions.is_empty() {
            let directions = directions.chunks_exact(positions.len());
            let targets: Result<Vec<Value>, HandModelError> = directions
                .map(|d| Ok(json!({"POSITION": self.displacements(&mesh.gather(d), "shape directions")?})))
                .collect();
            primitive["targets"] = targets?.into();
        }
        Ok(primitive)
    }

    /// A mesh of one primitive with these weights of its morph targets, and their names if there are any.
    pub fn mesh(&self, primitive: Value, weights: &[f64], names: &[String]) -> Value {
        let mut mesh = json!({"name": self.model.name, "primitives": [primitive]});
        if !weights.is_empty() {
            mesh["weights"] = weights.into();
        }
        if !names.is_empty() {
            mesh["extras"] = json!({"targetNames": names});
        }
        mesh
    }

    /// Points or displacements of vertices, with the bounds that glTF requires for them.
    ///
    /// # Errors
    /// [`HandModelError::Invalid`] names the field if a number is too large for single precision.
    pub fn displacements(&mut self, values: &[DVec3], field: &str) -> Result<Accessor, HandModelError> {
        let accessor = self.vectors(values, field, Some(VERTEX_BUFFER))?;
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for p in values.iter().map(|v| v.as_vec3()) {
            low = low.min(p);
            high = high.max(p);
        }
        self.accessors[accessor]["min"] = json!(low.to_array());
        self.accessors[accessor]["max"] = json!(high.to_array());
        Ok(accessor)
    }

    /// Vectors that are no vertex attribute.
    ///
    /// # Errors
    /// As for [`GlbDocument::displacements`].
    pub fn plain_vectors(&mut self, values: &[DVec3], field: &str) -> Result<Accessor, HandModelError> {
        self.vectors(values, field, None)
    }

    fn vectors(&mut self, values: &[DVec3], field: &str, target: Option<u32>) -> Result<Accessor, HandModelError> {
        if values.iter().any(|v| !v.as_vec3().is_finite()) {
            let problem = "have a number that is too large for the file; check the model";
            return Err(HandModelError::invalid(self.model.name.clone(), field, problem));
        }
        Ok(self.floats(values.iter().flat_map(|v| v.as_vec3().to_array()), "VEC3", target))
    }

    /// One of the sets of four joints and four weights of each vertex: its two accessors.
    pub fn joints_and_weights(&mut self, joints: &[[u16; 4]], weights: &[[f32; 4]]) -> [Accessor; 2] {
        let joints = joints.iter().flatten().flat_map(|joint| joint.to_le_bytes());
        let joints = self.add(joints, U16, "VEC4", Some(VERTEX_BUFFER));
        [joints, self.floats(weights.iter().flatten().copied(), "VEC4", Some(VERTEX_BUFFER))]
    }

    /// Indices that are not those of triangles.
    pub fn plain_indices(&mut self, values: &[u32]) -> Accessor {
        self.add(values.iter().flat_map(|i| i.to_le_bytes()), U32, "SCALAR", None)
    }

    /// Translations as 4x4 matrices.
    pub fn translations(&mut self, translations: impl Iterator<Item = Vec3>) -> Accessor {
        self.floats(translations.flat_map(|t| Mat4::from_translation(t).to_cols_array()), "MAT4", None)
    }

    /// Numbers of each vertex; `kind` is glTF's, such as `VEC4`.
    pub fn vertex_floats(&mut self, values: impl Iterator<Item = f32>, kind: &str) -> Accessor {
        self.floats(values, kind, Some(VERTEX_BUFFER))
    }

    /// Values of an animation's channel.
    pub fn channel(&mut self, values: impl Iterator<Item = f32>, kind: &str) -> Accessor {
        self.floats(values, kind, None)
    }

    /// Times of an animation, seconds, ascending.
    pub fn times(&mut self, seconds: &[f32]) -> Accessor {
        let accessor = self.floats(seconds.iter().copied(), "SCALAR", None);
        self.accessors[accessor]["min"] = json!([seconds.first().copied().unwrap_or_default()]);
        self.accessors[accessor]["max"] = json!([seconds.last().copied().unwrap_or_default()]);
        accessor
    }

    fn floats(&mut self, values: impl Iterator<Item = f32>, kind: &str, target: Option<u32>) -> Accessor {
        self.add(values.flat_map(f32::to_le_bytes), F32, kind, target)
    }

    fn add(&mut self, bytes: impl Iterator<Item = u8>, component: u32, kind: &str, target: Option<u32>) -> Accessor {
        let begin = self.binary.len();
        self.binary.extend(bytes);
        let length = self.binary.len() - begin;
        let size = if component == U16 { 2 } else { 4 };
        let components = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let mut view = json!({"buffer": 0, "byteOffset": begin, "byteLength": length});
        if let Some(target) = target {
            view["target"] = target.into();
        }
        let count = length / (size * components);
        let view = self.push("bufferViews", view);
        self.accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": kind}));
        self.accessors.len() - 1
    }

    /// The bytes of the file. Its first scene is the one that programs show.
    ///
    /// # Errors
    /// [`HandModelError::Invalid`] if the file would be larger than GLB's 4 GiB.
    pub fn finish(mut self) -> Result<Vec<u8>, HandModelError> {
        let lists = [
            ("asset", json!({"version": "2.0", "generator": "ghand"})),
            ("scene", json!(0)),
            ("buffers", json!([{"byteLength": self.binary.len()}])),
            ("accessors", self.accessors.into()),
        ];
        self.root.extend(lists.map(|(name, value)| (name.to_owned(), value)));
        let document = Value::Object(self.root);
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        // File header, and a header for each of the two chunks.
        let total = 12 + 8 + text.len() + 8 + self.binary.len();
        let too_large = |_| {
            HandModelError::invalid(
                self.model.name.clone(),
                "mesh",
                format!("takes {total} bytes, more than a GLB file can have; write it as OBJ"),
            )
        };
        let mut glb = Vec::with_capacity(total);
        glb.extend(b"glTF");
        glb.extend(2u32.to_le_bytes());
        glb.extend(u32::try_from(total).map_err(too_large)?.to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.binary)] {
            glb.extend(u32::try_from(chunk.len()).map_err(too_large)?.to_le_bytes());
            glb.extend(kind);
            glb.extend(chunk);
        }
        Ok(glb)
    }
}
