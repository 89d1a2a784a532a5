//! Binary glTF files that are damaged, or made to do damage: each gives a body or an error, and never a panic.

use std::path::Path;

use fusion_core::body::{SkinnedBody, parse_gltf};
use serde_json::{Value, json};

/// A small body with everything that the reader knows: two bones, indices of two sizes, weights of two types, vertices
/// that primitives share, a sparse accessor, and a stride.
struct File {
    json: Value,
    data: Vec<u8>,
}

impl File {
    fn new() -> Self {
        let mut file = Self { json: json!({}), data: Vec::new() };
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 1.0_f32]];
        // Positions with a stride of 16 bytes.
        let positions = file.view(&corners.map(|p| [p[0], p[1], p[2], -1.0].map(f32::to_le_bytes).concat()).concat());
        let small = file.view(&[0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4]);
        let wide = file.view(&[0_u16, 2, 1, 0, 3, 2].map(u16::to_le_bytes).concat());
        let joints = file.view(&[0, 0, 0, 0].repeat(5));
        let bytes = file.view(&[255, 0, 0, 0].repeat(5));
        let floats = file.view(&[1.0_f32, 0.0, 0.0, 0.0].map(f32::to_le_bytes).concat().repeat(5));
        let identity: Vec<f32> = (0..16).map(|i| f32::from(u8::from(i % 5 == 0))).collect();
        let binds = file.view(&identity.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>().repeat(2));
        let sparse_indices = file.view(&[4]);
        let sparse_joints = file.view(&[1, 0, 0, 0]);
        let buffer_views = file.json["bufferViews"].as_array().unwrap().clone();
        file.json = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": file.data.len()}],
            "bufferViews": buffer_views,
            "accessors": [
                {"bufferView": positions, "componentType": 5126, "count": 5, "type": "VEC3",
                 "min": [0, 0, 0], "max": [1, 1, 1]},
                {"bufferView": small, "componentType": 5121, "count": 12, "type": "SCALAR"},
                {"bufferView": wide, "componentType": 5123, "count": 6, "type": "SCALAR"},
                {"bufferView": joints, "componentType": 5121, "count": 5, "type": "VEC4", "sparse": {"count": 1,
                 "indices": {"bufferView": sparse_indices, "componentType": 5121},
                 "values": {"bufferView": sparse_joints}}},
                {"bufferView": bytes, "componentType": 5121, "count": 5, "type": "VEC4", "normalized": true},
                {"bufferView": floats, "componentType": 5126, "count": 5, "type": "VEC4"},
                {"bufferView": binds, "componentType": 5126, "count": 2, "type": "MAT4"},
            ],
            "meshes": [{"primitives": [
                {"attributes": {"POSITION": 0, "JOINTS_0": 3, "WEIGHTS_0": 4}, "indices": 1},
                {"attributes": {"POSITION": 0, "JOINTS_0": 3, "WEIGHTS_0": 4}, "indices": 2},
                {"attributes": {"POSITION": 0, "JOINTS_0": 3, "WEIGHTS_0": 5}, "indices": 1},
            ]}],
            "nodes": [{"mesh": 0, "skin": 0}, {"name": "root", "children": [2]}, {"name": "tip"}],
            "skins": [{"joints": [1, 2], "inverseBindMatrices": 6}],
        });
        file.json["bufferViews"][0]["byteStride"] = json!(16);
        file
    }

    /// Adds a buffer view of these bytes, and returns its index.
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.data.len(), "byteLength": bytes.len()});
        self.data.extend(bytes);
        let views = &mut self.json["bufferViews"];
        if views.is_null() {
            *views = json!([]);
        }
        let views = views.as_array_mut().unwrap();
        views.push(view);
        views.len() - 1
    }

    fn bytes(&self) -> Vec<u8> {
        let mut json = serde_json::to_vec(&self.json).unwrap();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut data = self.data.clone();
        data.resize(data.len().next_multiple_of(4), 0);
        let mut file = [&b"glTF"[..], &2_u32.to_le_bytes(), &[0; 4]].concat();
        for (name, chunk) in [(b"JSON", json), (b"BIN\0", data)] {
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend(name);
            file.extend(chunk);
        }
        let length = file.len() as u32;
        file[8..12].copy_from_slice(&length.to_le_bytes());
        file
    }
}

fn read(bytes: &[u8]) -> Result<SkinnedBody, String> {
    parse_gltf(bytes, Path::new("body.glb")).map_err(|error| {
        let cause = std::error::Error::source(&error).map(|cause| format!(": {cause}"));
        format!("{error}{}", cause.unwrap_or_default())
    })
}

/// Replaces a value of the description, and asserts that the file is refused with these words.
fn refused(path: &str, value: Value, words: &[&str]) {
    let mut file = File::new();
    let (parent, key) = path.rsplit_once('/').unwrap();
    match file.json.pointer_mut(parent).unwrap() {
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value.clone(),
        parent => parent[key] = value.clone(),
    }
    let error = read(&file.bytes()).expect_err(path);
    for word in words {
        assert!(error.contains(word), "{path} = {value}: `{word}` not in: {error}");
    }
}

#[test]
fn a_file_with_everything_is_read() {
    let body = read(&File::new().bytes()).unwrap();
    // Two primitives share their vertices.
    assert_eq!((body.mesh.vertices.len(), body.mesh.triangles.len(), body.bones.len()), (10, 10, 2));
    assert_eq!(body.mesh.triangles[4..6], [[0, 2, 1], [0, 3, 2]]);
    assert_eq!(body.mesh.triangles[6], [5, 6, 9]);
    assert_eq!((&body.weights[4], &body.weights[3]), (&vec![(1, 1.0)], &vec![(0, 1.0)]));
    assert_eq!(body.bones[1].parent, Some(0));
}

#[test]
fn accessors_of_other_formats_are_refused() {
    for index in ["1", "2", "3", "4", "5", "6", "0"] {
        // Every other type of components, and every other shape.
        let file = File::new();
        let own = file.json.pointer(&format!("/accessors/{index}")).unwrap().clone();
        for component in [5120, 5121, 5122, 5123, 5125, 5126] {
            // Smaller indices have room where larger ones are, and glTF allows them.
            if own["componentType"] == component || (index, component) == ("2", 5121) {
                continue;
            }
            refused(&format!("/accessors/{index}/componentType"), json!(component), &["body.glb: ", "accessor"]);
        }
        for shape in ["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"].iter().filter(|s| own["type"] != **s) {
            refused(&format!("/accessors/{index}/type"), json!(shape), &["accessor", "expected"]);
        }
        refused(&format!("/accessors/{index}/normalized"), json!(own["normalized"] != true), &["accessor"]);
        refused(&format!("/accessors/{index}/componentType"), json!(7), &["accessors[", "componentType"]);
        for count in [0_u64, 1_000, 1 << 32, u64::MAX] {
            refused(&format!("/accessors/{index}/count"), json!(count), &["accessor"]);
        }
        refused(&format!("/accessors/{index}/bufferView"), json!(99), &["accessors["]);
        refused(&format!("/accessors/{index}/byteOffset"), json!(u64::MAX), &["accessor"]);
        refused(&format!("/accessors/{index}/byteOffset"), json!(4096), &["exceed"]);
    }
    refused("/accessors/0/byteOffset", json!(2), &["accessor 0 (positions)", "multiple of 4 bytes"]);
    // Bytes at a wrong place are noticed by the bounds.
    refused("/accessors/0/byteOffset", json!(4), &["accessor 0 (positions)", "is the file damaged?"]);
}

#[test]
fn what_does_not_exist_is_refused() {
    for semantic in ["POSITION", "JOINTS_0", "WEIGHTS_0"] {
        refused(&format!("/meshes/0/primitives/0/attributes/{semantic}"), json!(99), &["body.glb"]);
    }
    refused("/meshes/0/primitives/0/indices", json!(99), &["meshes[0].primitives[0].indices"]);
    // Indices of another format are not taken for no indices.
    refused("/meshes/0/primitives/0/indices", json!(0), &["primitive 0", "(indices)", "expected Scalar"]);
    refused("/nodes/0/mesh", json!(7), &["nodes[0].mesh"]);
    refused("/nodes/0/skin", json!(7), &["nodes[0].skin"]);
    refused("/nodes/1/children/0", json!(7), &["nodes[1].children[0]"]);
    refused("/skins/0/joints/0", json!(7), &["skins[0].joints[0]"]);
    refused("/skins/0/joints/0", json!(2), &["node 2 is a joint twice"]);
    refused("/skins/0/inverseBindMatrices", Value::Null, &["no inverse bind matrices"]);
    refused("/skins/0/inverseBindMatrices", json!(5), &["accessor 5 (inverse bind matrices)"]);
    refused("/nodes/2/children", json!([1]), &["its joints are a cycle"]);
    refused("/nodes/1/children", json!([2, 2]), &["node 2 is a child twice"]);
    refused("/bufferViews/1/buffer", json!(1), &["bufferViews[1].buffer"]);
    refused("/bufferViews/1/byteLength", json!(u64::MAX), &["buffer view 1"]);
    refused("/bufferViews/1/byteOffset", json!(1_u64 << 40), &["buffer view 1"]);
    refused("/bufferViews/0/byteStride", json!(4), &["stride of at least 12"]);
    refused("/buffers/0/byteLength", json!(4), &["buffer view", "only 4 bytes"]);
    refused("/buffers/0/uri", json!("body.bin"), &["data outside the file"]);
    refused("/accessors/3/sparse/count", json!(9), &["1 to 5 sparse elements, got 9"]);
    refused("/accessors/3/sparse/indices/bufferView", json!(4), &["sparse index 255"]);
    refused("/accessors/3/sparse/values/bufferView", json!(99), &["accessors[3].sparse"]);
    refused("/meshes/0/primitives/1/mode", json!(5), &["primitive 1", "export triangles"]);
    refused("/accessors/1/count", json!(11), &["expected 3 for each triangle, got 11"]);
    refused("/extensionsRequired", json!(["KHR_draco_mesh_compression"]), &["extensionsRequired"]);
}

#[test]
fn numbers_out_of_range_are_refused() {
    let broken = |place: usize, bytes: &[u8], words: &str| {
        let mut file = File::new();
        let view = &file.json["bufferViews"][place]["byteOffset"];
        let start = view.as_u64().unwrap() as usize;
        file.data[start..start + bytes.len()].copy_from_slice(bytes);
        let error = read(&file.bytes()).expect_err(words);
        assert!(error.contains(words), "{words}: {error}");
    };
    broken(1, &[5], "one is vertex 5, but there are only 5 vertices");
    broken(2, &u16::MAX.to_le_bytes(), "one is vertex 65535");
    broken(3, &[2], "vertex 0 has joint 2, but the skin has only 2 joints");
    broken(4, &[0], "vertex 0: expected at least one positive skinning weight");
    for weight in [f32::NAN, f32::INFINITY, -1.0] {
        broken(5, &weight.to_le_bytes(), "vertex 5: expected at least one positive skinning weight");
    }
    broken(6, &f32::NAN.to_le_bytes(), "the inverse bind matrix of joint 0 cannot be inverted");
    broken(6, &[0; 64], "the inverse bind matrix of joint 0 cannot be inverted");
    broken(0, &f32::NAN.to_le_bytes(), "vertex 0 is not finite");
    broken(7, &[5], "sparse index 5");
}

#[test]
fn headers_are_checked() {
    let good = File::new().bytes();
    for cut in 0..good.len() {
        assert!(read(&good[..cut]).is_err(), "cut at {cut}");
    }
    // A length below that of the header has been a subtraction with overflow.
    for length in [0_u32, 11, 12, 20, u32::MAX] {
        let mut file = good.clone();
        file[8..12].copy_from_slice(&length.to_le_bytes());
        let error = read(&file).unwrap_err();
        assert!(error.contains("is it complete?"), "{error}");
    }
    let mut other = good.clone();
    other[4] = 1;
    assert!(read(&other).unwrap_err().contains("expected version 2 of glTF, got 1"));
}

/// Accessors without bytes, or with the same ones, must not become more memory than the file has.
#[test]
fn small_files_do_not_become_large_bodies() {
    let mut file = File::new();
    let sparse = file.json["accessors"][3]["sparse"].clone();
    let views = [7, 0].map(|view| json!({"bufferView": view, "componentType": 5121}));
    file.json["accessors"][0] = json!({"componentType": 5126, "count": 4_000_000_000_u64, "type": "VEC3",
        "min": [0, 0, 0], "max": [1, 1, 1],
        "sparse": {"count": sparse["count"], "indices": views[0], "values": {"bufferView": 0}}});
    assert!(read(&file.bytes()).unwrap_err().contains("more numbers than its"));
    let mut many = File::new();
    let primitive = many.json["meshes"][0]["primitives"][0].clone();
    many.json["meshes"][0]["primitives"] = json!(vec![primitive; 10_000]);
    assert!(read(&many.bytes()).unwrap_err().contains("more numbers than its"));
}

#[test]
fn forty_thousand_joints_take_no_time() {
    let joints = 40_000;
    let mut file = File::new();
    let nodes = (1..joints).map(|i| json!({"children": [i + 1]})).chain([json!({})]);
    file.json["nodes"] = [json!({"mesh": 0, "skin": 0})].into_iter().chain(nodes).collect();
    file.json["skins"][0]["joints"] = (1..=joints).rev().collect();
    let identity: Vec<u8> = (0..16).flat_map(|i| f32::from(u8::from(i % 5 == 0)).to_le_bytes()).collect();
    let view = file.view(&identity.repeat(joints));
    file.json["buffers"][0]["byteLength"] = json!(file.data.len());
    file.json["accessors"][6] = json!({"bufferView": view, "componentType": 5126, "count": joints, "type": "MAT4"});
    let start = std::time::Instant::now();
    assert_eq!(read(&file.bytes()).unwrap().bones.len(), joints);
    let seconds = start.elapsed().as_secs_f64();
    assert!(seconds < 5.0, "{seconds} s, where a search per joint takes minutes");
}
