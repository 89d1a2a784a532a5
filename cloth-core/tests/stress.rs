//! Cloths and steps far from any that are reasonable: a step is done with finite numbers, or says why it cannot be and leaves the
//! cloth as it was.

use cloth_core::Body;
use cloth_core::fabric::{self, Bending, Fabric, Material, Membrane, Rigidity, Surroundings};
use cloth_core::integrator::{Adaptive, Integrator, Scheme};
use cloth_core::mesh::{Diagonals, Plane, Sheet, SpringNetwork};
use energy_solve::System;

const CELLS: usize = 8;
const STEPS: usize = 12;

/// A cloth hung by two corners, and how it is stepped.
#[derive(Clone, Copy, Debug)]
struct Case {
    name: &'static str,
    size: [f64; 2],
    /// E h, in N/m.
    stretch: f64,
    bending: f64,
    dt: f64,
    /// Every other vertex is so many times as heavy.
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
            // On itself, along the middle line, exactly.
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

/// The steps that were done, and what ended them early.
fn run(case: Case, material: Material, integrator: &mut dyn Integrator) -> (usize, Option<String>) {
    let mut body = case.body(material);
    for step in 0..STEPS {
        let before = (body.x.clone(), body.v.clone());
        let done = integrator.step(&mut body, case.dt);
        let finite = body.x.iter().chain(&body.v).flatten().all(|number| number.is_finite());
        assert!(finite, "{case:?}, {}, step {step}: not finite", integrator.name());
        if let Err(error) = done {
            assert!(
                (&body.x, &body.v) == (&before.0, &before.1),
                "{case:?}, {}: a failed step moved it",
                integrator.name()
            );
            return (step, Some(error.to_string()));
        }
    }
    (STEPS, None)
}

fn cases() -> Vec<Case> {
    let mut cases = vec![
        ORDINARY,
        Case { name: "a millimetre wide", size: [1e-3, 1e-3], ..ORDINARY },
        Case { name: "a kilometre wide", size: [1e3, 1e3], ..ORDINARY },
        Case { name: "needles", size: [1.0, 1e-6], ..ORDINARY },
        Case { name: "heavy beside light", mass_ratio: 1e6, ..ORDINARY },
        Case { name: "folded", folded: true, ..ORDINARY },
    ];
    cases.extend([1e-3, 1.0, 1e4, 1e6, 1e8].map(|stretch| Case { name: "stiffness", stretch, ..ORDINARY }));
    cases.extend([1e-5, 1e-4, 1e-3, 0.03, 0.1].map(|dt| Case { name: "step", dt, ..ORDINARY }));
    cases
}

#[test]
fn a_step_is_done_or_says_why_not() {
    for case in cases() {
        for material in case.materials() {
            for scheme in [Scheme::Newton, Scheme::ImplicitEuler, Scheme::Bdf2, Scheme::ImplicitMidpoint] {
                let (steps, failure) = run(case, material.clone(), &mut *scheme.integrator());
                if let Some(failure) = failure {
                    println!("{} {:?}, {scheme:?}: after {steps} steps, {failure}", case.name, case.stretch);
                    assert!(failure.len() > 20, "{failure}");
                }
            }
        }
    }
}

/// Backward Euler by Newton's method copes with all of it, where it may choose its step.
#[test]
fn newtons_method_goes_through_with_everything() {
    for case in cases() {
        for material in case.materials() {
            let mut integrator = Adaptive::new(Scheme::Newton.integrator());
            let (steps, failure) = run(case, material, &mut integrator);
            assert!(steps == STEPS, "{case:?}: {failure:?}");
        }
    }
}
