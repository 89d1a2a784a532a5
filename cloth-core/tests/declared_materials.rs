//! Materials that a file declares: the motion of the built-in ones, memory, and errors.

use super::runs::{REPEATABLE, SCENE, kill_after_first_checkpoint, read, refused, succeeds, with_scene};

const OWN: &str = r#"
/// The library's membrane, as a file.
energy OwnMembrane(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar[N/m]) {
    rest {
        let D_m = columns(u1 - u0, u2 - u0);
        let s = power_of_two(det(D_m));
        let B = adjugate(D_m) * s;
        let d = (det(D_m) * s)^2;
        let per_d = 1 / (2 * d);
        let A = det(D_m) / 2;
    }
    let F = columns(x1 - x0, x2 - x0) * B;
    let E = per_d * (transpose(F) * F - d * identity(2));
    A * (μ * ddot(E, E) + λ / 2 * trace(E)^2)
}
"#;

#[test]
fn a_material_from_a_file_moves_like_the_built_in_one() {
    let folder = with_scene(SCENE);
    let lame = |y: f64, nu: f64| (y * nu / (1.0 - nu * nu), y / (2.0 * (1.0 + nu)));
    let (lambda, mu) = lame(40.0, 0.3);
    let own = format!(
        "[garment.fabric.material.file]\npath = \"own.energy\"\nparameters = {{ lambda = {lambda}, \"μ\" = {mu} }}"
    );
    let text = SCENE.replace("[garment.fabric.material.stvk]\nstretch_stiffness = 40.0\npoisson_ratio = 0.3", &own);
    assert_ne!(text, SCENE);
    std::fs::write(folder.path().join("own.toml"), &text).unwrap();
    std::fs::write(folder.path().join("own.energy"), OWN).unwrap();
    succeeds(&["run", "scene.toml", "-o", "built"], folder.path());
    let told = succeeds(&["run", "own.toml", "-o", "own"], folder.path());
    assert!(told.contains("OwnMembrane"), "{told}");
    let points = |run: &str| -> Vec<f64> {
        let obj = String::from_utf8(read(&folder.path().join(run), "frames/cloth_0015.obj")).unwrap();
        let rows = obj.lines().filter_map(|line| line.strip_prefix("v ").map(str::to_owned)).collect::<Vec<_>>();
        rows.iter().flat_map(|row| row.split(' ').map(|word| word.parse().unwrap()).collect::<Vec<f64>>()).collect()
    };
    for (own, built) in points("own").iter().zip(points("built")) {
        assert!((own - built).abs() < 1e-7, "{own} {built}");
    }
    let page = succeeds(&["report", "own"], folder.path());
    assert!(page.contains("report.html"));
    // The same with --material, which replaces the material of the scene.
    let parameter = format!("lambda={lambda},mu={mu}");
    succeeds(
        &["run", "scene.toml", "-o", "replaced", "--material", "own.energy", "--parameters", &parameter],
        folder.path(),
    );
    assert_eq!(points("replaced").len(), points("own").len());
    // Its points as arrays.
    let mut arrays = OWN.replace("x0, x1, x2: Point; rest u0, u1, u2: Vec2", "x: [Point; 3]; rest u: [Vec2; 3]");
    for (name, entry) in
        [("x0", "x[0]"), ("x1", "x[1]"), ("x2", "x[2]"), ("u0", "u[0]"), ("u1", "u[1]"), ("u2", "u[2]")]
    {
        arrays = arrays.replace(name, entry);
    }
    std::fs::write(folder.path().join("arrays.energy"), arrays).unwrap();
    succeeds(
        &["run", "scene.toml", "-o", "arrays", "--material", "arrays.energy", "--parameters", &parameter],
        folder.path(),
    );
    assert_eq!(points("arrays"), points("replaced"));
    let expect = |text: &str, energy: &str, parts: &[&str]| {
        std::fs::write(folder.path().join("bad.toml"), text).unwrap();
        std::fs::write(folder.path().join("own.energy"), energy).unwrap();
        let message = refused(&["run", "bad.toml", "-o", "bad"], folder.path());
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    };
    expect(
        &text.replace("lambda = ", "lamda = "),
        OWN,
        &["no element has a parameter `lamda`; expected `lambda`, `mu`"],
    );
    expect(&text.replace(&format!("lambda = {lambda}, "), ""), OWN, &["OwnMembrane needs the parameter `λ` [N/m]"]);
    expect(&text, &OWN.replace("trace(E)", "trac(E)"), &["own.energy", "trac"]);
    expect(&text.replace("own.energy", "none.energy"), OWN, &["cannot read none.energy"]);
    expect(
        &text,
        "force F(_x: Point, v: Velocity; λ, μ: Scalar[N s/m]) { -(λ + μ) * v }",
        &["F is a force; a material consists of energies"],
    );
    for (unknowns, formula) in [
        ("θ: Scalar", "θ^2"),
        ("x: Point, shared p: Scalar", "p * x.z"),
        ("q: Rotation", "rotate(q, vector(0, 0, 1)).z"),
    ] {
        let energy = format!("energy A({unknowns}; λ, μ: Scalar) {{ λ * μ * {formula} }}");
        expect(&text, &energy, &["A is an energy with unknowns that are not points of each element"]);
    }
}

/// Hinges that fold for good beyond a moment, and threads that creep. The step is a number of the formula.
const MEMORY: &str = r#"
energy PlasticHinge(x0, x1, x2, x3: Point; state ψ: Scalar = 0; k: Scalar[J], θ0, Y: Scalar) {
    let θ = dihedral(x0, x1, x2, x3) - θ0 - ψ;
    next { ψ = if abs(θ) > Y { ψ + θ - sign(θ) * Y } else { ψ }; }
    k / 2 * θ^2
}

#[time_step(h)]
energy Creep(p, q: Point; state l: Scalar[m] = L; c: Scalar[N/m], L: Scalar[m], τ, h: Scalar[s]) {
    let e = norm(p - q) - l;
    next { l = l + h / (h + τ) * e; }
    c / 2 * τ / (τ + h) * e^2
}
"#;

/// Memory of a file's elements is kept in checkpoints, and taken back with rejected steps.
#[test]
fn a_resumed_run_keeps_the_memory_of_declared_elements() {
    let built =
        "[garment.fabric.material.stvk]\nstretch_stiffness = 40.0\npoisson_ratio = 0.3\nbending.flat.stiffness = 1e-5";
    let text = |limit: f64| {
        let own = format!(
            "[garment.fabric.material.file]\npath = \"memory.energy\"\n\
             parameters = {{ k = 1e-4, Y = {limit}, c = 40.0, \"τ\" = 0.5 }}"
        );
        SCENE.replace(built, &own).replace("integrator = \"newton\"", "integrator = \"newton\"\nadaptive = true")
    };
    assert_ne!(text(0.02), SCENE);
    let folder = with_scene(&text(0.02));
    std::fs::write(folder.path().join("memory.energy"), MEMORY).unwrap();
    kill_after_first_checkpoint(folder.path());
    succeeds(&["run", "scene.toml", "-o", "whole"], folder.path());
    succeeds(&["resume", "half"], folder.path());
    for name in REPEATABLE {
        let [whole, half] = ["whole", "half"].map(|run| read(&folder.path().join(run), name));
        assert!(whole == half, "{name} differs");
    }
    // Without yield the cloth moves otherwise.
    std::fs::write(folder.path().join("elastic.toml"), text(100.0)).unwrap();
    succeeds(&["run", "elastic.toml", "-o", "elastic"], folder.path());
    let [plastic, elastic] = ["whole", "elastic"].map(|run| read(&folder.path().join(run), "frames/cloth_0015.obj"));
    assert!(plastic != elastic);
    // A state without a value at rest, and a time step given as a parameter.
    std::fs::write(folder.path().join("memory.energy"), MEMORY.replace("Scalar = 0;", "Scalar;")).unwrap();
    let message = refused(&["run", "scene.toml", "-o", "bad"], folder.path());
    assert!(message.contains("the state `ψ` of PlasticHinge has no value at rest"), "{message}");
    std::fs::write(folder.path().join("memory.energy"), MEMORY).unwrap();
    std::fs::write(folder.path().join("scene.toml"), text(0.02).replace("c = 40.0", "c = 40.0, h = 0.1")).unwrap();
    let message = refused(&["run", "scene.toml", "-o", "bad"], folder.path());
    assert!(message.contains("no element has a parameter `h`"), "{message}");
}
