//! The peak of memory of the readers of meshes, over a seeded family of hostile files: at most 20 times the file and
//! 300 MB, and 2 s until a file is refused. This test is a separate program, because it counts the bytes of all
//! allocations: each file is read in another process.
#![cfg(target_os = "linux")]

use std::alloc::System;
use std::path::Path;
use std::process::Command;

use cap::Cap;
use cloth_core::physics::mesh::{ObjOptions, read_obj_surface};
use fastrand::Rng;
use fusion_core::body::{read_gltf, read_makehuman, read_obj};
use mesh_io::gltf::{LARGEST_DESCRIPTION, MOST_COMMAS, MOST_PARTS};
use serde_json::{Value, json};

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

/// The bound, in bytes: a factor of the size of the file, and a summand.
const FACTOR: usize = 20;
const SUMMAND: usize = 300_000_000;
/// The longest time until a file is refused, in s.
const PATIENCE: f64 = 2.0;
/// The variable that tells a process which reader to measure, and the file.
const TASK: &str = "MEMORY_OF";
const PATH: &str = "MEMORY_PATH";

/// Reads a file. Returns whether it was accepted.
fn read(reader: &str, path: &Path) -> bool {
    let beside = |name| path.with_file_name(name);
    match reader {
        "cloth" => read_obj_surface(path, ObjOptions::default()).is_ok(),
        "welded" => {
            let mut options = ObjOptions::default();
            options.weld = Some(1e-6);
            read_obj_surface(path, options).is_ok()
        }
        "body" => read_obj(path).is_ok(),
        "human" => read_makehuman(path, &beside("rig.json"), &beside("weights.json")).is_ok(),
        "glTF" => read_gltf(path).is_ok(),
        other => panic!("no reader {other}"),
    }
}

/// Returns the time that this thread has run, in s, without what other processes took.
fn seconds() -> f64 {
    let schedule = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    schedule.split_whitespace().next().unwrap().parse::<f64>().unwrap() / 1e9
}

/// Measures a reader in a process that was started for it.
#[test]
fn measured() {
    let Ok(reader) = std::env::var(TASK) else { return };
    let path = std::env::var(PATH).unwrap();
    let (before, start) = (MEMORY.allocated(), seconds());
    let accepted = read(&reader, Path::new(&path));
    println!("\nmeasured {} {} {accepted}", MEMORY.max_allocated() - before, seconds() - start);
}

/// Reads a file in another process, and asserts the bounds.
fn check(name: &str, contents: &[u8], readers: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile");
    std::fs::write(&path, contents).unwrap();
    std::fs::write(folder.path().join("rig.json"), "{}").unwrap();
    std::fs::write(folder.path().join("weights.json"), r#"{"weights": {}}"#).unwrap();
    for reader in readers {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "measured", "--nocapture"]).env(TASK, reader).env(PATH, &path);
        let output = String::from_utf8(command.output().unwrap().stdout).unwrap();
        let line = output.lines().find_map(|line| line.strip_prefix("measured "));
        let line = line.unwrap_or_else(|| panic!("{name}, {reader}: the reader ended the process: {output}"));
        let [peak, seconds, accepted] = line.split(' ').collect::<Vec<_>>().try_into().unwrap();
        let (peak, seconds): (usize, f64) = (peak.parse().unwrap(), seconds.parse().unwrap());
        let (size, bound) = (contents.len(), FACTOR * contents.len() + SUMMAND);
        let megabytes = |bytes: usize| bytes as f64 / 1e6;
        let [size, peak_size, most] = [size, peak, bound].map(megabytes);
        println!("{name}, {reader}: {size:.1} MB, peak {peak_size:.0} of {most:.0} MB, {seconds:.2} s, {accepted}");
        assert!(peak <= bound, "{name}, {reader}: {size:.1} MB take {peak_size:.0} MB, more than {most:.0} MB");
        assert!(accepted == "true" || seconds < PATIENCE, "{name}, {reader}: refused after {seconds:.2} s");
    }
}

const TRIANGLE: &str = "g body\nv 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// Returns an OBJ file of this size: lines that repeat, between vertices and a valid face.
fn repeated(lines: &str, size: usize) -> Vec<u8> {
    format!("{TRIANGLE}{}f 1 2 3\n", lines.repeat(size / lines.len())).into_bytes()
}

/// Returns polygons of many triangles, none of which is degenerate: the most triangles for its size.
fn fans(size: usize) -> Vec<u8> {
    let vertices: String = (0..9).map(|i| format!("v {i} {} 0\n", i * i)).collect();
    let fan = format!("f 1{}\n", " 2 3 4 5 6 7 8 9".repeat(8_000));
    format!("{vertices}{}", fan.repeat(size / fan.len())).into_bytes()
}

/// Returns a grid of squares with short coordinates, each a valid pair of triangles, in this many groups.
fn grid(side: usize, groups: usize) -> Vec<u8> {
    let names: String = (0..groups).map(|group| format!(" g{group}")).collect();
    let mut text: String = (0..side * side).map(|i| format!("v {} {} 0\n", i % side, i / side)).collect();
    text += &format!("g{names}\no o\nusemtl m\n");
    for corner in (1..side * (side - 1)).filter(|corner| corner % side != 0) {
        text += &format!("f {corner} {} {} {}\n", corner + 1, corner + side + 1, corner + side);
    }
    text.into_bytes()
}

const OBJ_READERS: [&str; 4] = ["cloth", "welded", "body", "human"];

#[test]
fn obj_files() {
    let fan = format!("f {}\n", "1 2 3 ".repeat(21_845));
    let all = "g a b c d e f g h i j k l m n o p\no q\nusemtl r\n";
    let lines =
        ["v 0 0 0\n", "vt 0\n", "vn\n", "g a\n", "f 1 1 1\n", "f 1 2 3\n", "\n", "f 1\\\n2\\\n3\n", "#\u{ff}\n"];
    for line in lines.into_iter().chain(["g a\nf 1 2 3\n", "o\nf 1 2 3\n", "v 0 0 0\nf -1 -2 -3\n", fan.as_str()]) {
        let name = format!("{:?}", line.chars().take(20).collect::<String>());
        check(&name, &repeated(line, 8_000_000), &OBJ_READERS);
    }
    check(
        "Latin-1",
        &[TRIANGLE.as_bytes(), &[b"#", &[0xff; 70][..], b"\n"].concat().repeat(160_000)].concat(),
        &OBJ_READERS,
    );
    check("fans in 18 groups", &repeated(&format!("{all}{fan}"), 8_000_000), &OBJ_READERS);
    check("faces in 18 groups", &repeated(&format!("{all}f 1 2 3\n"), 8_000_000), &OBJ_READERS);
    let names: String =
        (0..1_500_000).map(|name| format!("{}{name:x}", if name % 16 == 0 { "\ng " } else { " " })).collect();
    check("names", format!("{TRIANGLE}{names}\nf 1 2 3\n").as_bytes(), &OBJ_READERS);
    check("a grid", &grid(400, 1), &OBJ_READERS);
    // Here, the summand is a small part of the bound.
    check("30 MB of fans", &fans(30_000_000), &["cloth", "welded", "body"]);
    check("40 MB of vertices", &repeated("v 0 0 0\n", 40_000_000), &["cloth", "welded", "body"]);
    check("40 MB of a grid", &grid(1_000, 3), &["cloth", "body"]);
}

#[test]
fn random_obj_files() {
    let mut random = Rng::with_seed(1);
    for number in 0..12 {
        let mut text = format!("{TRIANGLE}vt 0 0\nvn 0 0 1\n");
        while text.len() < 4_000_000 {
            let line = match random.u32(0..10) {
                0 => format!("v {} {} {}\n", random.u32(0..1000), random.u32(0..1000), random.u32(0..10)),
                1 => "vt 0 1\nvt 1\n".into(),
                2 => "vn 0 0 1\n".into(),
                3 => format!("g {:x} {:x}\n", random.u32(0..1 << 16), random.u32(0..16)),
                4 => format!("o {:x}\n", random.u32(0..1 << 12)),
                5 => format!("f {}\n", "-1 -2 -3 ".repeat(random.usize(1..100))),
                6 => "f -1/-1/-1 -2/-1/-1 -3/-1/-1\n".into(),
                7 => "f -1 -2 -3\n".into(),
                8 => format!("f 1 \\\n 2{}\n", " \\\n3".repeat(random.usize(1..9))),
                _ => "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\n".into(),
            };
            text += &line.repeat(if random.bool() { 1 } else { random.usize(1..2000) });
        }
        check(&format!("random OBJ {number}"), text.as_bytes(), &OBJ_READERS);
    }
}

/// Returns a binary glTF file.
fn container(description: &str, data: &[u8]) -> Vec<u8> {
    let json = format!("{description}{}", " ".repeat(description.len().next_multiple_of(4) - description.len()));
    let word = |number: usize| u32::try_from(number).unwrap().to_le_bytes();
    let parts = [&b"glTF\x02\0\0\0"[..], &word(28 + json.len() + data.len()), &word(json.len()), b"JSON"];
    [&parts.concat(), json.as_bytes(), &word(data.len()), b"BIN\0", data].concat()
}

/// Returns a description with as many copies of an item as a reader may accept.
fn filled(before: &str, item: &str, after: &str) -> Vec<u8> {
    let most = [
        (LARGEST_DESCRIPTION - 1_000) / (item.len() + 1),
        (MOST_PARTS - 100).checked_div(item.matches(['{', '[']).count()).unwrap_or(usize::MAX),
        (MOST_COMMAS - 100) / (item.matches(',').count() + 1),
    ];
    let items = vec![item; most.into_iter().min().unwrap()].join(",");
    container(&format!(r#"{{"asset":{{"version":"2.0"}},{before}{items}{after}}}"#), &[0; 4])
}

/// Parts of descriptions, with the key of the list that has them.
const PARTS: [(&str, &str); 18] = [
    ("nodes", "{}"),
    ("nodes", r#"{"weights":[0],"children":[0]}"#),
    ("nodes", r#"{"name":"a"}"#),
    ("materials", "{}"),
    ("materials", r#"{"pbrMetallicRoughness":{},"normalTexture":{"index":0}}"#),
    ("images", r#"{"uri":""}"#),
    ("buffers", r#"{"byteLength":1}"#),
    ("buffers", r#"{"byteLength":1,"uri":"data:application/octet-stream;base64,AAAA"}"#),
    ("bufferViews", r#"{"buffer":0,"byteLength":1}"#),
    ("accessors", r#"{"componentType":5126,"count":1,"type":"VEC3","min":[0],"max":[0]}"#),
    (
        "accessors",
        r#"{"componentType":5126,"count":1,"type":"VEC3","sparse":{"count":1,
        "indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":0}}}"#,
    ),
    ("meshes", r#"{"primitives":[{"attributes":{}}]}"#),
    ("meshes", r#"{"primitives":[{"attributes":{"POSITION":0},"targets":[{"POSITION":0}]}]}"#),
    ("skins", r#"{"joints":[0]}"#),
    ("scenes", r#"{"nodes":[0]}"#),
    (
        "animations",
        r#"{"channels":[{"sampler":0,"target":{"node":0,"path":"scale"}}],"samplers":[{"input":0,"output":0}]}"#,
    ),
    ("cameras", r#"{"type":"perspective","perspective":{"yfov":1,"znear":1}}"#),
    ("extensionsUsed", "\"a\""),
];

#[test]
fn gltf_descriptions() {
    for (key, part) in PARTS {
        check(&format!("{key} {part:.40}"), &filled(&format!(r#""{key}":["#), part, "]"), &["glTF"]);
    }
    let bound = r#""accessors":[{"componentType":5126,"count":1,"type":"VEC3","min":["#;
    for value in ["0", "[]", "[0]", "{}", r#"{"a":0}"#, r#"{"a":[0]}"#, r#""a""#, "[[[[[[0]]]]]]"] {
        check(&format!("bounds {value}"), &filled(bound, value, "]}]"), &["glTF"]);
        let values = vec![value; (LARGEST_DESCRIPTION - 1_000) / (value.len() + 1)].join(",");
        let whole = container(&format!(r#"{{"asset":{{"version":"2.0"}},{bound}{values}]}}]}}"#), &[0; 4]);
        check(&format!("16 MiB of bounds {value}"), &whole, &["glTF"]);
    }
    let mut random = Rng::with_seed(2);
    for number in 0..10 {
        let mut lists = std::collections::BTreeMap::<&str, Vec<String>>::new();
        let (mut size, mut parts, mut commas) = (0, 100, 100);
        let kinds = [0; 3].map(|_| PARTS[random.usize(0..PARTS.len())]);
        while size < LARGEST_DESCRIPTION - 10_000 && parts < MOST_PARTS - 100 && commas < MOST_COMMAS - 2_000 {
            let (key, part) = kinds[random.usize(0..kinds.len())];
            let values = "0,".repeat(random.usize(0..50) * random.usize(0..2));
            let part = part.replacen("\"min\":[", &format!("\"min\":[{values}"), 1);
            size += part.len() + 1;
            parts += part.matches(['{', '[']).count();
            commas += part.matches(',').count() + 1;
            lists.entry(key).or_default().push(part);
        }
        let lists = lists.iter().map(|(key, parts)| format!(r#""{key}":[{}]"#, parts.join(",")));
        let lists = lists.collect::<Vec<String>>().join(",");
        let file = container(&format!(r#"{{"asset":{{"version":"2.0"}},{lists}}}"#), &[0; 4]);
        check(&format!("random description {number}"), &file, &["glTF"]);
    }
}

/// Returns a body of this size whose accessors share bytes, so that it has as many vertices as the numbers allow. All
/// bytes are 1: positions are near 0, and all vertices have joint 1 with weight 1.
fn body(size: usize, sets: usize, primitives: usize, corners: usize) -> Vec<u8> {
    let vertices = ((size - 200) / (3 + 8 * sets + corners) / primitives).min((size - 200) / 12);
    let mut data = vec![1; size.next_multiple_of(4)];
    let matrices = data.len() - 128;
    data[matrices..].fill(0);
    let diagonal = (0..32).filter(|at| at % 16 % 5 == 0);
    diagonal.for_each(|at| data[matrices + 4 * at..][..4].copy_from_slice(&1_f32.to_le_bytes()));
    let view = |start: usize| json!({"buffer": 0, "byteOffset": start, "byteLength": data.len() - start});
    let positions = json!({"bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3",
        "min": [0, 0, 0], "max": [0, 0, 0]});
    let mut accessors = vec![
        json!({"bufferView": 0, "componentType": 5121, "count": vertices, "type": "VEC4"}),
        json!({"bufferView": 0, "componentType": 5121, "count": vertices, "type": "VEC4", "normalized": true}),
        json!({"bufferView": 1, "componentType": 5126, "count": 2, "type": "MAT4"}),
        json!({"bufferView": 0, "componentType": 5121, "count": (corners * vertices / 3 * 3).max(3), "type": "SCALAR"}),
    ];
    let primitives: Vec<Value> = (0..primitives)
        .map(|_| {
            accessors.push(positions.clone());
            let mut attributes = json!({"POSITION": accessors.len() - 1});
            for set in 0..sets {
                attributes[format!("JOINTS_{set}")] = json!(0);
                attributes[format!("WEIGHTS_{set}")] = json!(1);
            }
            json!({"attributes": attributes, "indices": 3})
        })
        .collect();
    let description = json!({"asset": {"version": "2.0"}, "buffers": [{"byteLength": data.len()}],
        "bufferViews": [view(0), view(matrices)], "accessors": accessors,
        "meshes": [{"primitives": primitives}], "nodes": [{"mesh": 0, "skin": 0}, {}, {}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 2}]});
    container(&description.to_string(), &data)
}

#[test]
fn gltf_bodies() {
    for (sets, primitives, corners) in [(1, 1, 0), (3, 1, 0), (5, 1, 0), (1, 7, 0), (1, 1, 3), (1, 1, 60), (1, 1000, 1)]
    {
        let name = format!("{sets} sets of weights, {primitives} primitives, {corners} corners for each vertex");
        check(&name, &body(20_000_000, sets, primitives, corners), &["glTF"]);
    }
}
