//! Linear solvers: all choices give the same motion, also after a restart.

use std::path::Path;

use cloth_core::Simulation;
use cloth_core::scene::Scene;

/// A stiff sheet that hangs by two corners.
fn hanging(integrator: &str, solver: &str, cells: usize, stiffness: f64, tolerances: [f64; 2]) -> Simulation {
    let [velocity, linear] = tolerances;
    let text = format!(
        r#"dt = 0.01
duration = 1.0
integrator = "{integrator}"
linear_solver = "{solver}"
tolerances = {{ velocity = {velocity:e}, linear = {linear:e} }}

[mesh.sheet]
cells = [{cells}, {cells}]
size = [1.0, 1.0]
[fabric]
density = 0.15
[fabric.material.neo-hookean]
stretch_stiffness = {stiffness:e}
poisson_ratio = 0.25
bending.flat.stiffness = 1e-6

[[pins]]
nearest = [-0.5, 0.5, 0.0]
[[pins]]
nearest = [0.5, 0.5, 0.0]
"#
    );
    Simulation::new(&Scene::parse(&text, Path::new("scene.toml")).unwrap()).unwrap()
}

#[test]
fn all_solvers_give_the_same_motion() {
    for (integrator, solvers) in [
        ("newton", &["auto", "over-relaxation", "multigrid", "cholesky"][..]),
        ("implicit-euler", &["auto", "multigrid", "cholesky"]),
        ("bdf2", &["auto", "multigrid"]),
        ("implicit-midpoint", &["auto", "multigrid"]),
        ("trapezoid", &["auto", "multigrid"]),
    ] {
        let mut ends = Vec::new();
        for solver in solvers {
            let mut simulation = hanging(integrator, solver, 10, 3e3, [1e-5; 2]);
            for _ in 0..5 {
                simulation.step().unwrap();
            }
            let summary = simulation.summary().unwrap();
            let by = summary.totals.solved_by;
            let all = by.over_relaxation + by.multigrid + by.cholesky;
            let asked = match *solver {
                "multigrid" => by.multigrid,
                "cholesky" => by.cholesky,
                _ => by.over_relaxation,
            };
            assert!(
                asked == all && (integrator == "implicit-euler" || all == summary.totals.solves),
                "{solver}: {by:?}"
            );
            ends.push(simulation.positions().to_vec());
        }
        for (end, solver) in ends.iter().zip(solvers) {
            let apart = end.iter().flatten().zip(ends[0].iter().flatten()).map(|(a, b)| (a - b).abs());
            let apart = apart.fold(0.0, f64::max);
            assert!(apart < 2e-6, "{integrator} by {solver}: {apart:e} m");
        }
    }
}

#[test]
fn the_choice_of_solver_is_saved() {
    for integrator in ["newton", "bdf2", "implicit-euler"] {
        let start = || hanging(integrator, "auto", 40, 3e4, [1e-3, 1e-2]);
        let mut whole = start();
        let mut half = None;
        for step in 0..16 {
            if step == 7 {
                half = Some(whole.save());
            }
            whole.step().unwrap();
        }
        let theirs = whole.summary().unwrap();
        let by = theirs.totals.solved_by;
        assert!(by.multigrid > 0 && by.over_relaxation > 0, "{integrator}: not both tried, {by}");
        let text = serde_json::to_string(&half.unwrap()).unwrap();
        let mut resumed = start();
        resumed.restore(serde_json::from_str(&text).unwrap()).unwrap();
        for _ in 7..16 {
            resumed.step().unwrap();
        }
        assert!(resumed.positions() == whole.positions(), "{integrator}");
        let mine = resumed.summary().unwrap();
        assert_eq!(
            (mine.totals.solves, mine.totals.iterations, mine.totals.solved_by),
            (theirs.totals.solves, theirs.totals.iterations, theirs.totals.solved_by)
        );
    }
}

#[test]
fn an_unknown_solver_is_rejected() {
    let text = "dt = 0.01\nduration = 1.0\nlinear_solver = \"gauss\"\n[mesh.sheet]\n";
    let error = Scene::parse(text, Path::new("scene.toml")).unwrap_err().to_string();
    assert!(error.contains("gauss") && error.contains("multigrid"), "{error}");
}
