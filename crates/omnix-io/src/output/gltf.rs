//! A glTF 2.0 document in the making and its binary container.
//!
//! One buffer; points and lines without normals, so one unlit material; vertex colours are linear light in 16 bits, as glTF wants
//! them. Morph targets are positions relative to the base.

use glam::DVec3;
use serde_json::{Value, json};

use super::{atomic::AtomicFile, colour};
use crate::IoError;

pub(super) const POINTS: u32 = 0;
pub(super) const LINES: u32 = 1;
const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const ARRAY_BUFFER: u32 = 34962;

/// Bytes of the buffer for a point, and for each of its morph targets.
pub(super) const POINT_BYTES: usize = 12 + 8;
pub(super) const TARGET_BYTES: usize = 12;

/// Bytes of points that a file may hold: sizes in a glb file are 32 bits wide, and the rest of the document needs room.
pub(super) const MAX_BYTES: usize = 3 << 30;

/// Turns OpenCV camera axes into glTF's: y up, z backward.
pub(super) const TO_GLTF: DVec3 = DVec3::new(1.0, -1.0, -1.0);

/// Parts of the document so far.
#[derive(Default)]
pub(super) struct Scene {
    buffer: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    cameras: Vec<Value>,
    samplers: Vec<Value>,
    channels: Vec<Value>,
}

impl Scene {
    /// Adds positions and sRGB colours as one primitive and returns its node; nothing if there are none, since empty accessors are not
    /// valid. Each of `targets` holds as many positions relative to `positions`.
    pub(super) fn add(
        &mut self,
        name: &str,
        mode: u32,
        positions: &[DVec3],
        colours: &[[u8; 3]],
        targets: &[Vec<[f32; 3]>],
    ) -> Option<usize> {
        let mesh = self.mesh(name, mode, positions, colours, targets)?;
        Some(self.node(json!({ "name": name, "mesh": mesh })))
    }

    /// The same without a node.
    pub(super) fn mesh(
        &mut self,
        name: &str,
        mode: u32,
        positions: &[DVec3],
        colours: &[[u8; 3]],
        targets: &[Vec<[f32; 3]>],
    ) -> Option<usize> {
        if positions.is_empty() {
            return None;
        }
        let positions: Vec<[f32; 3]> = positions.iter().map(|p| p.as_vec3().to_array()).collect();
        let position = self.vectors(&positions);
        let rgba = |c: &[u8; 3]| [colour::linear16(c[0]), colour::linear16(c[1]), colour::linear16(c[2]), u16::MAX];
        let bytes = colours.iter().flat_map(rgba).flat_map(u16::to_le_bytes);
        let accessor = json!({ "componentType": UNSIGNED_SHORT, "normalized": true, "type": "VEC4" });
        let colour = self.accessor(bytes, colours.len(), Some(ARRAY_BUFFER), accessor);
        let mut primitive =
            json!({ "attributes": { "POSITION": position, "COLOR_0": colour }, "mode": mode, "material": 0 });
        let mut mesh = json!({ "name": name });
        if !targets.is_empty() {
            let targets: Vec<Value> = targets.iter().map(|t| json!({ "POSITION": self.vectors(t) })).collect();
            mesh["weights"] = json!(vec![0.0; targets.len()]);
            primitive["targets"] = json!(targets);
        }
        mesh["primitives"] = json!([primitive]);
        self.meshes.push(mesh);
        Some(self.meshes.len() - 1)
    }

    /// Adds a node at the root of the scene and returns its number.
    pub(super) fn node(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Adds a camera and returns its number.
    pub(super) fn camera(&mut self, camera: Value) -> usize {
        self.cameras.push(camera);
        self.cameras.len() - 1
    }

    /// Key times of an animation in seconds, ascending.
    pub(super) fn keys(&mut self, seconds: &[f32]) -> usize {
        let (min, max) = (seconds.first(), seconds.last());
        let accessor = json!({ "componentType": FLOAT, "type": "SCALAR", "min": [min], "max": [max] });
        self.accessor(seconds.iter().flat_map(|v| v.to_le_bytes()), seconds.len(), None, accessor)
    }

    /// Animates `path` of `node` through `values` at the key times, linearly; `kind` is the values' glTF type.
    pub(super) fn animate(&mut self, node: usize, path: &str, keys: usize, kind: &str, values: &[f32]) {
        let components = match kind {
            "VEC4" => 4,
            "VEC3" => 3,
            _ => 1,
        };
        let accessor = json!({ "componentType": FLOAT, "type": kind });
        let bytes = values.iter().flat_map(|v| v.to_le_bytes());
        let output = self.accessor(bytes, values.len() / components, None, accessor);
        self.channels.push(json!({ "sampler": self.samplers.len(), "target": { "node": node, "path": path } }));
        self.samplers.push(json!({ "input": keys, "output": output, "interpolation": "LINEAR" }));
    }

    /// Vertex positions, which must state their bounds.
    fn vectors(&mut self, vectors: &[[f32; 3]]) -> usize {
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..3).map(|a| vectors.iter().map(|p| p[a]).fold(vectors[0][a], pick)).collect()
        };
        let (min, max) = (bound(f32::min), bound(f32::max));
        let bytes = vectors.iter().flatten().flat_map(|v| v.to_le_bytes());
        let accessor = json!({ "componentType": FLOAT, "type": "VEC3", "min": min, "max": max });
        self.accessor(bytes, vectors.len(), Some(ARRAY_BUFFER), accessor)
    }

    /// Appends the bytes (a multiple of 4, so that all views stay aligned) and returns the accessor's number.
    fn accessor(
        &mut self,
        bytes: impl Iterator<Item = u8>,
        count: usize,
        target: Option<u32>,
        mut accessor: Value,
    ) -> usize {
        let start = self.buffer.len();
        self.buffer.extend(bytes);
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": self.buffer.len() - start });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.views.push(view);
        accessor["bufferView"] = json!(self.views.len() - 1);
        accessor["count"] = json!(count);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// The document, all nodes being roots; `extras` go into its asset.
    fn document(&self, extras: Value) -> Value {
        let nodes: Vec<usize> = (0..self.nodes.len()).collect();
        let mut scene = json!({ "name": "scene" });
        let mut document = json!({
            "asset": { "version": "2.0", "generator": concat!("omnix ", env!("CARGO_PKG_VERSION")), "extras": extras },
            "scene": 0,
        });
        if !nodes.is_empty() {
            scene["nodes"] = json!(nodes);
            document["nodes"] = json!(self.nodes);
        }
        if !self.meshes.is_empty() {
            document["meshes"] = json!(self.meshes);
            // Points and lines have no normals to be lit by.
            document["materials"] = json!([{
                "name": "unlit",
                "extensions": { "KHR_materials_unlit": {} },
                "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
            }]);
            document["extensionsUsed"] = json!(["KHR_materials_unlit"]);
        }
        if !self.cameras.is_empty() {
            document["cameras"] = json!(self.cameras);
        }
        if !self.channels.is_empty() {
            document["animations"] =
                json!([{ "name": "motion", "samplers": self.samplers, "channels": self.channels }]);
        }
        if !self.buffer.is_empty() {
            document["accessors"] = json!(self.accessors);
            document["bufferViews"] = json!(self.views);
            document["buffers"] = json!([{ "byteLength": self.buffer.len() }]);
        }
        document["scenes"] = json!([scene]);
        document
    }

    /// The GLB container: 12-byte header, JSON chunk padded with spaces, binary chunk (glTF 2.0, section 4).
    pub(super) fn write(self, file: &mut AtomicFile, extras: Value) -> Result<(), IoError> {
        let mut text = self.document(extras).to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let binary = if self.buffer.is_empty() { 0 } else { 8 + self.buffer.len() };
        let total = 12 + 8 + text.len() + binary;
        let size = |n: usize| u32::try_from(n).expect("BUG: MAX_BYTES keeps the file below 4 GiB").to_le_bytes();
        let (total, json_size, binary_size) = (size(total), size(text.len()), size(self.buffer.len()));
        for bytes in [b"glTF".as_slice(), &2u32.to_le_bytes(), &total, &json_size, b"JSON", &text] {
            file.put(bytes)?;
        }
        if binary > 0 {
            for bytes in [binary_size.as_slice(), b"BIN\0", &self.buffer] {
                file.put(bytes)?;
            }
        }
        Ok(())
    }
}
