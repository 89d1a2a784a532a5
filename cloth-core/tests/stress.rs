//! Extreme cloths and steps: a step either completes with finite numbers, or returns an error and leaves the cloth
//! unchanged. A table pins the outcome of each combination.

use cloth_core::physics::Body;
use cloth_core::physics::fabric::{self, Bending, Fabric, Material, Membrane, Rigidity, Surroundings};
use cloth_core::physics::integrator::{Adaptive, Integrator, Scheme, StepError};
use cloth_core::physics::mesh::{Diagonals, Plane, Sheet, SpringNetwork};
use energy_solve::System;

const CELLS: usize = 8;
const STEPS: usize = 12;

/// A cloth hung by two corners, and the size of its steps.
#[derive(Clone, Copy, Debug)]
struct Case {
    name: &'static str,
    size: [f64; 2],
    /// Young's modulus times thickness, in N/m.
    stretch: f64,
    bending: f64,
    dt: f64,
    /// The mass of every other vertex is multiplied by this.
    mass_ratio: f64,
    folded: bool,
}

/// Cotton, a metre wide.
const ORDINARY: Case = Case {
    name: "ordinary",
    size: [1.0, 1.0],
    stretch: 261.0,
    bending: 1e-6,
    dt: 0.01,
    mass_ratio: 1.0,
    folded: false,
};

impl Case {
    fn materials(self) -> Vec<Material> {
        let membrane = |bending| Membrane { stretch_stiffness: self.stretch, poisson_ratio: 0.3, bending };
        vec![
            Material::NeoHookean(membrane(Bending::Flat { stiffness: self.bending })),
            Material::StableNeoHookean(membrane(Bending::Bridson { stiffness: self.bending })),
            Material::Stvk(membrane(Bending::Plate(Rigidity::Flexural { rigidity: self.bending, poisson_ratio: 0.3 }))),
        ]
    }

    fn body(self, material: Material) -> Body {
        let sheet = Sheet {
            cells: [CELLS, CELLS],
            size: self.size,
            diagonals: Diagonals::Regular,
            plane: Plane::Horizontal,
            pleats: None,
        };
        let mesh = sheet.mesh().unwrap();
        let surroundings = Surroundings { gravity: [0.0, 0.0, -9.81], drag: 0.1 };
        let fabric = Fabric::new(0.15, material);
        let mut garment = fabric::terms(&fabric, &mesh, &SpringNetwork::default(), &surroundings).unwrap();
        garment.masses.iter_mut().step_by(2).for_each(|mass| *mass *= self.mass_ratio);
        let mut x = mesh.vertices().to_vec();
        if self.folded {
            // Fold the sheet exactly onto itself along its middle line.
            x.iter_mut().for_each(|p| p[1] = -p[1].abs());
        }
        let mut pinned = vec![false; x.len()];
        for corner in [0, CELLS] {
            pinned[sheet.vertex(corner, CELLS)] = true;
        }
        let system = System::new(garment.terms, &pinned).unwrap();
        Body { v: vec![[0.0; 3]; x.len()], x, masses: garment.masses, system }
    }
}

/// Takes up to [`STEPS`] steps. Returns the error of the first step that fails.
fn run(case: Case, material: Material, integrator: &mut dyn Integrator) -> Result<(), StepError> {
    let mut body = case.body(material);
    for step in 0..STEPS {
        let before = (body.x.clone(), body.v.clone());
        let done = integrator.step(&mut body, case.dt);
        let finite = body.x.iter().chain(&body.v).flatten().all(|number| number.is_finite());
        assert!(finite, "{case:?}, {}, step {step}: not finite", integrator.name());
        if done.is_err() {
            let unchanged = (&body.x, &body.v) == (&before.0, &before.1);
            assert!(unchanged, "{case:?}, {}: a failed step moved vertices", integrator.name());
        }
        done?;
    }
    Ok(())
}

/// How a run ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Outcome {
    /// All steps complete.
    Done,
    /// The linear solver does not converge.
    NotSolved,
    /// Newton's method does not converge.
    NotConverged,
}

use Outcome::{Done, NotConverged, NotSolved};

/// Classifies a result. Checks that an error names what failed and a remedy.
fn outcome(result: &Result<(), StepError>) -> Outcome {
    let Err(error) = result else { return Done };
    let (outcome, words) = match error {
        StepError::NotSolved { .. } => (NotSolved, "the linear solver stopped after "),
        StepError::NotConverged { .. } => (NotConverged, "Newton's method did not converge in 100 iterations"),
        other => panic!("unexpected error: {other}"),
    };
    let message = error.to_string();
    assert!(message.contains(words) && error.advice().as_deref() == Some("Try a smaller dt"), "{message}");
    outcome
}

fn cases() -> Vec<Case> {
    let mut cases = vec![
        ORDINARY,
        Case { name: "a millimetre wide", size: [1e-3, 1e-3], ..ORDINARY },
        Case { name: "a kilometre wide", size: [1e3, 1e3], ..ORDINARY },
        Case { name: "needles", size: [1.0, 1e-6], ..ORDINARY },
        Case { name: "heavy and light", mass_ratio: 1e6, ..ORDINARY },
        Case { name: "folded", folded: true, ..ORDINARY },
    ];
    let stiff = |(name, stretch)| Case { name, stretch, ..ORDINARY };
    let stiffnesses = [("1e-3 N/m", 1e-3), ("1 N/m", 1.0), ("1e4 N/m", 1e4), ("1e6 N/m", 1e6), ("1e8 N/m", 1e8)];
    cases.extend(stiffnesses.map(stiff));
    let stepped = |(name, dt)| Case { name, dt, ..ORDINARY };
    let steps = [("steps of 0.01 ms", 1e-5), ("0.1 ms", 1e-4), ("1 ms", 1e-3), ("30 ms", 0.03), ("100 ms", 0.1)];
    cases.extend(steps.map(stepped));
    cases
}

/// The combinations of case and integrator that fail, with the outcomes for each material of [`Case::materials`].
///
/// A cloth a millimetre wide swings once in about ten steps of its size. The integrators of second order do not damp
/// that, and need 10 to 100 iterations per step; small changes of the Hessians decide which step needs more.
const FAILURES: [(&str, Scheme, [Outcome; 3]); 2] = [
    ("a millimetre wide", Scheme::ImplicitMidpoint, [Done, NotConverged, Done]),
    ("needles", Scheme::ImplicitEuler, [NotSolved; 3]),
];

/// The outcome of every combination is in the table, or all steps complete.
#[test]
fn outcomes_match_the_table() {
    for case in cases() {
        for scheme in [Scheme::Newton, Scheme::ImplicitEuler, Scheme::Bdf2, Scheme::ImplicitMidpoint] {
            let results = case.materials().into_iter().map(|material| run(case, material, &mut *scheme.integrator()));
            let outcomes: Vec<Outcome> = results.map(|result| outcome(&result)).collect();
            let failure = FAILURES.iter().find(|(name, failing, _)| *name == case.name && *failing == scheme);
            let expected = failure.map_or([Done; 3], |(.., outcomes)| *outcomes);
            assert_eq!(outcomes, expected, "{case:?}, {scheme:?}");
        }
    }
}

/// Implicit Euler by Newton's method completes all cases with adaptive step sizes.
#[test]
fn adaptive_newton_completes_every_case() {
    for case in cases() {
        for material in case.materials() {
            let mut integrator = Adaptive::new(Scheme::Newton.integrator());
            let result = run(case, material, &mut integrator);
            assert!(result.is_ok(), "{case:?}: {result:?}");
        }
    }
}
