//! Garments as exporters write them: texture coordinates, groups, doubled seam vertices, comments, Latin-1.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::process::Command;

use gltf_json::mesh::Semantic;
use gltf_json::validation::Checked::Valid;
use tempfile::TempDir;

use super::other_programs::ask;

/// Columns of a tube, of which the last doubles the first, and its rows.
const AROUND: usize = 12;
const ROWS: usize = 6;

/// A skirt: a closed tube of 0.4 m whose seam of texture coordinates doubles a column of vertices.
fn skirt() -> Vec<u8> {
    let mut text = "# Exported by a modeller\nmtllib skirt.mtl\no R#ck\n".to_owned();
    let mut line = |line: std::fmt::Arguments<'_>| writeln!(text, "{line}").unwrap();
    line(format_args!("v 9 9 9 # a stray vertex"));
    for row in 0..=ROWS {
        for column in 0..=AROUND {
            let (sine, cosine) = (TAU * (column as f64 + 0.5) / AROUND as f64).sin_cos();
            line(format_args!("v {:.6} {:.6} {:.6} 1.0", 0.1 * cosine, 0.1 * sine, -0.4 * row as f64 / ROWS as f64));
            line(format_args!("vt {:.6} {:.6}", row as f64 / ROWS as f64, column as f64 / AROUND as f64));
            line(format_args!("vn {cosine:.6} {sine:.6} 0"));
        }
    }
    for row in 0..ROWS {
        line(format_args!("g {}\nusemtl denim\ns 1", if row == 0 { "G\u{fc}rtel waist" } else { "body" }));
        for column in 0..AROUND {
            let at = |row: usize, column: usize| row * (AROUND + 1) + column + 1;
            let corner = |n: usize| format!("{}/{n}/{n}", n + 1);
            let corners =
                [at(row, column), at(row + 1, column), at(row + 1, column + 1), at(row, column + 1)].map(corner);
            line(format_args!("f {} {} \\\n  {} {}", corners[0], corners[1], corners[2], corners[3]));
        }
    }
    // Latin-1: one byte per character.
    text.chars().map(|character| u8::try_from(u32::from(character)).unwrap()).collect()
}

const SCENE: &str = r#"dt = 0.01
duration = 0.04
frames_per_second = 50
integrator = "newton"
contact = "obstacles"

[[garment]]
name = "skirt"
mesh.obj = { path = "skirt.obj", weld = 1e-5 }
fabric = "denim"
warp = "uv"

[[pins]]
group = "Gürtel"
of = "skirt"

[output]
picture = false
velocities = true
pc2 = true
mdd = true
apng = true
size = [64, 48]
background = [1.0, 0.0, 0.0]
colours = [[0.5, 0.5, 1.0]]
"#;

fn run(scene: &str) -> (TempDir, String, String) {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    std::fs::write(folder.path().join("skirt.obj"), skirt()).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cloth"));
    let output = command.args(["run", "scene.toml", "-o", "out"]).current_dir(folder.path()).output().unwrap();
    let [told, message] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    (folder, told, message)
}

#[test]
fn an_exported_garment_is_welded_pinned_by_group_and_woven_along_its_texture() {
    let (folder, told, message) = run(SCENE);
    // The stray vertex and the doubled column are gone; the first row of faces has two rows of vertices.
    let (vertices, pinned) = (AROUND * (ROWS + 1), 2 * AROUND);
    assert!(told.contains(&format!("{vertices} vertices ({pinned} pinned)")), "{told}{message}");
    assert!(told.contains(&format!("skirt: {vertices} vertices in 1 piece, {} doubled", ROWS + 1)), "{told}");

    let usd = String::from_utf8(std::fs::read(folder.path().join("out/cloth.usda")).unwrap()).unwrap();
    let uvs = usd.split("texCoord2f[] primvars:st = [").nth(1).unwrap().split(']').next().unwrap();
    assert_eq!(uvs.matches('(').count(), 3 * 2 * AROUND * ROWS);
    assert!(usd.contains("interpolation = \"faceVarying\"") && usd.contains("normal3f[] normals.timeSamples = {"));

    assert!(usd.contains("vector3f[] velocities.timeSamples = {") && usd.contains("rel material:binding = <"));
    // The colour of the scene, linear.
    assert!(usd.contains("color3f inputs:diffuseColor = (0.2140"), "{}", &usd[usd.len() - 900..]);

    let read = |name: &str| std::fs::read(folder.path().join("out").join(name)).unwrap();
    let (frames, size) = (3, 12 * AROUND * (ROWS + 1));
    assert_eq!(read("caches/skirt.pc2").len(), 32 + frames * size);
    assert_eq!(read("caches/skirt.mdd").len(), 8 + frames * (4 + size));
    let film = read("cloth.apng");
    let has = |part: &[u8]| film.windows(part.len()).any(|window| window == part);
    assert!(has(b"acTL") && has(b"fdAT"));
    assert_eq!(film[16..24], [0, 0, 0, 64, 0, 0, 0, 48]);

    let glb = std::fs::read(folder.path().join("out/cloth.glb")).unwrap();
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let root = gltf_json::Root::from_slice(&glb[20..20 + length]).unwrap();
    let primitive = &root.meshes[0].primitives[0];
    let count = |semantic| root.accessors[primitive.attributes[&Valid(semantic)].value()].count.0 as usize;
    // Vertices along the seam are doubled again, for their texture coordinates.
    let split = (AROUND + 1) * (ROWS + 1);
    assert_eq!([Semantic::TexCoords(0), Semantic::Positions, Semantic::Normals].map(count), [split; 3]);
    let mut problems = Vec::new();
    use gltf_json::validation::Validate;
    root.validate(&root, gltf_json::Path::new, &mut |path, error| problems.push(format!("{} {error}", path())));
    assert!(problems.is_empty(), "{problems:?}");
}

/// Needs `pip install bpy usd-core`; skipped without them.
#[test]
fn a_garment_goes_to_blender_and_comes_back() {
    let (folder, ..) = run(SCENE);
    let Some(said) = ask("python3", "blender.py", &[&folder.path().join("out"), "skirt".as_ref()]) else { return };
    assert!(said.contains("3 frames of 84 vertices to Blender"), "{said}");
    // The exported file is a garment again: deformed, with its texture coordinates.
    let scene = SCENE
        .replace("skirt.obj", "out/from_blender.obj")
        .replace("group = \"Gürtel\"", "box = { min = [-1.0, -1.0, -0.1], max = [1.0, 1.0, 1.0] }");
    std::fs::write(folder.path().join("again.toml"), scene).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cloth"));
    let output = command.args(["run", "again.toml", "-o", "again"]).current_dir(folder.path()).output().unwrap();
    let [told, message] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success() && told.contains("84 vertices (24 pinned)"), "{told}{message}");
}

#[test]
fn groups_can_be_garments_and_unknown_ones_are_listed() {
    let (_, told, message) =
        run(&SCENE.replace("weld = 1e-5", "groups = [\"body\"]").replace("group = \"Gürtel\"", "vertex = 0"));
    assert!(told.contains(&format!("{} vertices (1 pinned)", (AROUND + 1) * ROWS)), "{told}{message}");
    let (_, _, message) = run(&SCENE.replace("group = \"Gürtel\"", "group = \"belt\""));
    assert!(
        message.contains("there is no group `belt` in the chosen garments; there are Gürtel, R#ck, body"),
        "{message}"
    );
    let (_, _, message) = run(&SCENE.replace("weld = 1e-5", "groups = [\"belt\"]"));
    assert!(
        message.contains("there is no group, object or material called `belt`; there are R#ck, Gürtel"),
        "{message}"
    );
    // One direction cannot lie along a closed garment.
    let (_, _, message) = run(&SCENE.replace("warp = \"uv\"", ""));
    assert!(message.contains("stands across the warp direction") && message.contains("`warp = \"uv\"`"), "{message}");
}
