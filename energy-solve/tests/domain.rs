//! Elements outside of their formula's domain: sums are infinite, forces and matrices are refused, and no line search
//! leads there.

use std::sync::Arc;

use energy_compiler::Interpreted;
use energy_dsl::tape::Column;
use energy_dsl::{Element, energy};
use energy_solve::{
    Couplings, Curvature, ElementList, EvaluationError, GaussNewton, GaussNewtonOptions, LeastSquaresTerm,
    LinearisationOptions, Placed, PotentialTerm, Quantity, ResidualTerm, State, System, TapeTerm, Term, Weights,
};

energy! {
    /// A triangle in the plane that resists inversion.
    energy NeoHooke(x0, x1, x2: Point; μ: Scalar) {
        let a = x1 - x0;
        let b = x2 - x0;
        let J = a.x * b.y - a.y * b.x;
        μ / 2 * (norm_squared(a) + norm_squared(b) - 2 - 2 * log(J))
    }

    /// Zero at x = 2.
    residual Root(x: Vec2) { [sqrt(x[0]) - sqrt(2), x[1]] }
}

const STENCILS: [[usize; 3]; 2] = [[0, 1, 2], [1, 3, 2]];
/// The second triangle is inverted.
const INVERTED: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.3, 0.0]];
const UPRIGHT: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.2, 0.9, 0.0]];

fn compiled() -> Box<dyn Term> {
    let elements = vec![NeoHooke::new(3.0); 2];
    Box::new(PotentialTerm::<NeoHooke<f64>>::new(ElementList::new("membranes", elements, &STENCILS).unwrap()))
}

fn read() -> Box<dyn Term> {
    let element = Interpreted::from_source(&NeoHooke::<f64>::DECLARATION.source).unwrap().remove(0);
    let elements = element.elements::<f64>(2, &[], &[Column::Same(&[3.0])]).unwrap();
    let vertices = STENCILS.into_iter().flatten();
    Box::new(TapeTerm::new("membranes".into(), element.declaration(), elements.tape().clone(), vertices))
}

#[test]
fn sums_are_infinite_and_their_derivatives_are_refused() {
    for term in [compiled(), read()] {
        let mut system = System::new(vec![term], &[false; 4]).unwrap();
        assert!(system.energies(&UPRIGHT).unwrap()[0].energy.unwrap().is_finite());
        assert_eq!(system.energies(&INVERTED).unwrap()[0].energy, Some(f64::INFINITY));
        let state = State { x: &INVERTED, v: &[[0.0; 3]; 4] };
        let weights = Weights { position: -1.0, velocity: 0.0 };
        let options = LinearisationOptions::new(weights, Curvature::Exact);
        let mut matrix = system.matrix();
        let errors = [system.linearise(state, options, &mut matrix).unwrap_err(), system.forces(state).unwrap_err()];
        for error in errors {
            let EvaluationError::NonFiniteElement { term, element, vertices, what } = error else {
                panic!("another error: {error}")
            };
            assert_eq!((&*term, element, &vertices[..], what), ("membranes", 1, &[1, 3, 2][..], Quantity::Energy));
        }
        let state = State { x: &UPRIGHT, ..state };
        assert!(system.linearise(state, options, &mut matrix).is_ok() && system.forces(state).is_ok());
    }
}

#[test]
fn least_squares_never_step_outside() {
    let pattern = Arc::new(Couplings::pattern(1, [[0].as_slice()]).unwrap());
    let couplings = Arc::new(Couplings::new(&pattern, &[[0]]).unwrap());
    let mut roots = ResidualTerm::<Root, 2>::new("roots", couplings, 1.0);
    roots.set_elements([Placed { element: Root::new(), stencil: 0, weight: 1.0 }]);
    assert_eq!(roots.energy(&[[-1.0, 0.0]]).energy, f64::INFINITY);
    // From 40, the full step leads to −22.
    let mut x = [[40.0, 1.0]];
    let mut solver = GaussNewton::new(pattern, GaussNewtonOptions::default()).unwrap();
    let reports = solver.minimise(&[&roots], &mut x, 50, 1e-12).unwrap();
    assert!((x[0][0] - 2.0).abs() < 1e-6 && reports[0].fraction < 1.0, "{x:?}, {:?}", reports[0]);
    assert!(solver.iterate(&[&roots], &mut [[-1.0, 0.0]]).is_err());
}
