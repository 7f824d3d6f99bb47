//! Tiny files of models.

use std::path::Path;

use serde_json::{Value, json};

/// A box of 1 x 2 x 0.5 (width, height, depth) whose front has a texture, and whose last face is of glass.
pub(crate) const BOX: &str = "mtllib box.mtl
o box
v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nv 0 0 0.5\nv 1 0 0.5\nv 1 2 0.5\nv 0 2 0.5
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
usemtl print
f 5/1 6/2 7/3 8/4
usemtl red
f 2 1 4 3
f -8 -4 -1 -5
f 2 3 7 6
f 4 8 7 3
usemtl glass
f 1 2 6 5
";

/// A picture whose left half is red.
pub(crate) fn halves(path: &Path) {
    let picture = image::RgbImage::from_fn(64, 64, |x, _| image::Rgb([if x < 32 { 255 } else { 0 }, 0, 0]));
    picture.save(path).unwrap();
}

/// The parts of a glTF file.
pub(crate) struct Parts {
    pub(crate) json: Value,
    pub(crate) bin: Vec<u8>,
}

impl Parts {
    /// Adds numbers as an accessor; its index.
    pub(crate) fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let width = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            _ => 2,
        };
        self.accessor(kind, 5126, &bytes, values.len() / width)
    }

    pub(crate) fn accessor(&mut self, kind: &str, component: u32, bytes: &[u8], count: usize) -> usize {
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }));
        let view = views.len() - 1;
        let all = self.json["accessors"].as_array_mut().unwrap();
        let mut accessor = json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
        // The format asks for the box of positions.
        accessor["min"] = json!([0, 0, 0]);
        accessor["max"] = json!([1, 1, 1]);
        all.push(accessor);
        all.len() - 1
    }

    /// Writes the file and its buffer.
    pub(crate) fn write(mut self, folder: &Path, name: &str) {
        self.json["buffers"] = json!([{ "byteLength": self.bin.len(), "uri": "a%20buffer.bin" }]);
        std::fs::write(folder.join("a buffer.bin"), &self.bin).unwrap();
        std::fs::write(folder.join(name), self.json.to_string()).unwrap();
    }

    /// The file with its buffer inside.
    pub(crate) fn glb(mut self) -> Vec<u8> {
        self.json["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        let mut text = self.json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let word = |v: usize| (v as u32).to_le_bytes();
        let all = [b"glTF".as_slice(), &word(2), &word(28 + text.len() + self.bin.len()), &word(text.len()), b"JSON"];
        let mut file = all.concat();
        file.extend([&text[..], &word(self.bin.len()), b"BIN\0", &self.bin].concat());
        file
    }
}

/// A strip 0.2 m wide and 1 m high: its upper end hangs on a joint that turns by a right angle about z within one second, and a shape
/// that a second clip blends in pushes it forward.
pub(crate) fn flower() -> Parts {
    let mut parts = Parts { json: json!({ "bufferViews": [], "accessors": [] }), bin: Vec::new() };
    let positions: Vec<f32> =
        (0..3).flat_map(|k| [[-0.1, k as f32 * 0.5, 0.0], [0.1, k as f32 * 0.5, 0.0]]).flatten().collect();
    let positions = parts.floats("VEC3", &positions);
    let indices = parts.accessor("SCALAR", 5121, &[0, 1, 3, 0, 3, 2, 2, 3, 5, 2, 5, 4], 12);
    let joints: Vec<u8> = (0..6).flat_map(|k| [0, u8::from(k > 3), 0, 0]).collect();
    let joints = parts.accessor("VEC4", 5121, &joints, 6);
    let weights: Vec<f32> =
        (0..6).flat_map(|k| if k > 3 { [0.0, 1.0, 0.0, 0.0] } else { [2.0, 0.0, 0.0, 0.0] }).collect();
    let weights = parts.floats("VEC4", &weights);
    let offsets: Vec<f32> = (0..6).flat_map(|k| [0.0, 0.0, if k > 3 { 0.4 } else { 0.0 }]).collect();
    let offsets = parts.floats("VEC3", &offsets);
    let matrix = |y: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -y, 0.0, 1.0];
    let inverse = parts.floats("MAT4", &[matrix(0.0), matrix(0.5)].concat());
    let times = parts.floats("SCALAR", &[0.0, 1.0]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turns = parts.floats("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]);
    let blends = parts.floats("SCALAR", &[0.0, 1.0]);
    let json = &mut parts.json;
    json["asset"] = json!({ "version": "2.0" });
    json["materials"] =
        json!([{ "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.8, 0.1, 1.0], "metallicFactor": 0.0 } }]);
    json["meshes"] = json!([{ "weights": [0.0], "primitives": [{ "indices": indices, "material": 0, "targets": [{ "POSITION": offsets }],
        "attributes": { "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights } }] }]);
    // The joints come after what hangs on them, and the upper one before the lower one.
    json["nodes"] = json!([{ "mesh": 0, "skin": 0 }, { "translation": [0, 0.5, 0] }, { "children": [1] }]);
    json["skins"] = json!([{ "joints": [2, 1], "inverseBindMatrices": inverse }]);
    json["scenes"] = json!([{ "nodes": [0, 2] }]);
    let sampler = |output: usize| json!([{ "input": times, "output": output }]);
    json["animations"] = json!([
        { "channels": [{ "sampler": 0, "target": { "node": 1, "path": "rotation" } }], "samplers": sampler(turns) },
        { "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }], "samplers": sampler(blends) },
    ]);
    parts
}
