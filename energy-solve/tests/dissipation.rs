//! Forces of declared dissipation functions: the elements that act change from step to step.

use energy_dsl::{Potential, Vector3};
use energy_elements::WindDrag;
use energy_solve::{
    Curvature, DissipationLaw, DissipationTerm, LinearisationOptions, State, StepStart, System, Weights,
};

/// Vertices per side: enough for two threads.
const SIDE: usize = 70;

fn triangles() -> Vec<[usize; 3]> {
    let corner = |i: usize, j: usize| j * SIDE + i;
    let cells = (0..SIDE - 1).flat_map(|j| (0..SIDE - 1).map(move |i| (i, j)));
    cells
        .flat_map(|(i, j)| {
            [
                [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)],
                [corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)],
            ]
        })
        .collect()
}

fn element(number: usize, time: f64) -> WindDrag {
    let angle = 0.1 * number as f64;
    WindDrag::new([angle.cos(), 0.0, angle.sin()], [time, 0.5, -0.2], 0.3 + 1e-3 * number as f64, 0.01)
}

fn acts(number: usize, time: f64) -> bool {
    number % 5 < if time < 1.0 { 2 } else { 3 }
}

/// Two or three of five triangles feel the wind, depending on the time.
#[derive(Debug)]
struct Gusts;

impl DissipationLaw for Gusts {
    type Element = WindDrag;

    fn elements(&self, start: &StepStart<'_>, is_free: &[bool]) -> Vec<(usize, WindDrag)> {
        let numbers = (0..is_free.len()).filter(|&number| is_free[number] && acts(number, start.time));
        numbers.map(|number| (number, element(number, start.time))).collect()
    }
}

/// Returns the largest difference of forces, relative to the largest force.
fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let components = |forces: &[Vector3<f64>]| forces.iter().flatten().copied().collect::<Vec<f64>>();
    let (a, b) = (components(a), components(b));
    let largest = b.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    a.iter().zip(&b).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs())) / largest
}

#[test]
fn acting_elements_are_summed_for_any_number_of_threads() {
    let triangles = triangles();
    let is_pinned = |vertex: usize| vertex.is_multiple_of(13);
    let pinned: Vec<bool> = (0..SIDE * SIDE).map(is_pinned).collect();
    let x = vec![[0.0; 3]; SIDE * SIDE];
    let v: Vec<Vector3<f64>> = (0..x.len()).map(|i| [i as f64, 2.0 * i as f64, 0.3 * i as f64].map(f64::sin)).collect();
    let state = State { x: &x, v: &v };
    let options = LinearisationOptions::new(Weights { position: -1e-4, velocity: -1e-2 }, Curvature::Clamped);
    for time in [0.5, 2.0] {
        let mut found = Vec::new();
        for threads in [1, 2] {
            let term = DissipationTerm::new("gusts".to_owned(), Gusts, &triangles);
            let mut system = System::new(vec![Box::new(term)], &pinned).unwrap();
            system.set_threads(threads);
            system.begin_step(StepStart { time, dt: 0.01, state }).unwrap();
            let mut matrix = system.matrix();
            let linear = system.linearise(state, options, &mut matrix).unwrap().force;
            // Routes to the gradient and to the Hessian may round differently.
            let forces = system.forces(state).unwrap();
            assert!(distance(&linear, &forces) <= 1e-15);
            assert_eq!(system.energies(&x).unwrap()[0].energy, None);
            let dissipation = system.dissipation(state).unwrap();
            let counts = system.terms().next().unwrap().1;
            assert_eq!(counts.hessian.evaluated + counts.hessian.skipped, triangles.len() as u64);
            found.push((forces, dissipation, (linear, matrix.values().to_vec()), counts));
        }
        assert!(found[0] == found[1], "{time} s");

        // The same sums, element by element.
        let mut force = vec![[0.0; 3]; x.len()];
        let (mut dissipation, mut evaluated) = (0.0, 0);
        for (number, corners) in triangles.iter().enumerate() {
            if acts(number, time) && !corners.iter().all(|&corner| is_pinned(corner)) {
                let one = element(number, time).gradient(&corners.map(|corner| v[corner]));
                dissipation += one.value;
                evaluated += 1;
                for (corner, gradient) in corners.iter().zip(one.gradient) {
                    (0..3).for_each(|axis| force[*corner][axis] -= gradient[axis]);
                }
            }
        }
        assert!(found[0].0 == force, "{time} s");
        assert!((found[0].1 - dissipation).abs() < 1e-12 * dissipation, "{} {dissipation}", found[0].1);
        assert_eq!(found[0].3.hessian.evaluated, evaluated);
    }
}
