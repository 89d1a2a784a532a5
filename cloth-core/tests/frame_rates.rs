//! Frames at the rate that the scene asks for, in every format.

use cloth_core::Simulation;
use cloth_core::scene::Scene;
use std::process::Command;
use tempfile::TempDir;

fn scene(rate: &str) -> String {
    format!(
        "dt = 0.01\nduration = 0.07\n{rate}\nintegrator = \"newton\"\n[mesh.sheet]\ncells = [4, 4]\nsize = [0.2, 0.2]\n\
         [fabric]\ndensity = 0.2\nmaterial.stvk = {{ stretch_stiffness = 40.0, poisson_ratio = 0.3 }}\n\
         [[pins]]\nnearest = [0.1, 0.1, 0.0]\n[output]\npicture = false\npng = true\n"
    )
}

/// Returns the times of the frames in a glTF animation.
fn gltf_times(file: &[u8]) -> Vec<f32> {
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    let root = gltf_json::Root::from_slice(&file[20..20 + word(12)]).unwrap();
    let accessor = &root.accessors[root.animations[0].samplers[0].input.value()];
    let view = &root.buffer_views[accessor.buffer_view.unwrap().value()];
    let start = 20 + word(12) + 8 + view.byte_offset.unwrap().0 as usize;
    file[start..start + view.byte_length.0 as usize]
        .chunks_exact(4)
        .map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()))
        .collect()
}

#[test]
fn every_format_has_the_frames_at_their_exact_times() {
    let text = scene("frames_per_second = 30");
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("scene.toml"), &text).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cloth"));
    let output = command.args(["run", "scene.toml", "-o", "out"]).current_dir(folder.path()).output().unwrap();
    let told = String::from_utf8(output.stdout).unwrap();
    assert!(told.contains("wrote 3 frames") && told.contains("steps were shortened from 0.01 s"), "{told}");
    let out = folder.path().join("out");
    let read = |name: &str| std::fs::read(out.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let usd = String::from_utf8(read("cloth.usda")).unwrap();
    assert!(usd.contains("timeCodesPerSecond = 30\n    framesPerSecond = 30\n") && usd.contains("endTimeCode = 2\n"));
    assert_eq!(gltf_times(&read("cloth.glb")), [0.0, 1.0 / 30.0, 2.0 / 30.0]);

    // The frames are states of the simulation at these times, not interpolated ones.
    let scene = Scene::parse(&text, "scene.toml".as_ref()).unwrap();
    let mut simulation = Simulation::new(&scene).unwrap();
    for frame in 0..3_usize {
        while simulation.time() < frame as f64 / 30.0 - 1e-9 {
            simulation.step().unwrap();
        }
        assert!((simulation.time() - frame as f64 / 30.0).abs() < 1e-15);
        let x = simulation.positions();
        let obj = String::from_utf8(read(&format!("frames/cloth_{frame:04}.obj"))).unwrap();
        let first = obj.lines().next().unwrap();
        assert_eq!(first, format!("v {:.9} {:.9} {:.9}", x[0][0], x[0][1], x[0][2]));
        let sample = format!("            {frame}: [({}, {}, {})", x[0][0] as f32, x[0][1] as f32, x[0][2] as f32);
        assert!(usd.contains(&sample), "{sample}");
        assert!(read(&format!("frames/cloth_{frame:04}.png")).starts_with(b"\x89PNG"));
    }
}

#[test]
fn steps_that_end_with_frames_keep_their_size() {
    let steps = |rate: &str| {
        let scene = Scene::parse(&scene(rate), "scene.toml".as_ref()).unwrap();
        (scene.time_grid().step, scene.time_grid().steps_per_frame, scene.time_grid().frames_per_second)
    };
    assert_eq!(steps("frames_per_second = 25"), (0.01, 4, 25.0));
    assert_eq!(steps(""), (0.01, 4, 25.0));
    assert_eq!(steps("frames_per_second = 24"), (1.0 / 120.0, 5, 24.0));
    assert_eq!(steps("frames_per_second = 60"), (1.0 / 120.0, 2, 60.0));
    assert_eq!(steps("frames_per_second = 1000"), (1e-3, 1, 1000.0));
}
