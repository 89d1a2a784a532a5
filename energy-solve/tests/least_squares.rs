//! Sums of squared residuals: assembly against finite differences, solvers against each other, and rejected inputs.

use std::sync::Arc;

use energy_dsl::energy;
use energy_solve::{
    Couplings, GaussNewton, GaussNewtonError, GaussNewtonOptions, LeastSquaresTerm, Loss, NormalSolverKind, Outcome,
    Pattern, Placed, ResidualTerm,
};

energy! {
    /// Three rows that couple two points.
    residual Link(a, b: Vec2; L: Scalar) { [norm(b - a) - L, sin(a.x) * b.y, a.y - b.x^2] }

    residual Anchor(a: Vec2; x: Vec2) { a - x }

    /// Two rows that are linear in both points.
    residual Offset(a, b: Vec2; d: Vec2) { [a.x - 2 * b.y - d.x, a.y + b.x - d.y] }
}

/// A chain of blocks with links in both directions, so that some blocks are stored transposed. The number of links
/// leaves lanes unused.
struct Chain {
    pattern: Arc<Pattern>,
    links: ResidualTerm<Link, 2>,
    anchors: ResidualTerm<Anchor, 2>,
    x: Vec<[f64; 2]>,
}

fn chain(blocks: u32, loss: Loss) -> Chain {
    let stencils: Vec<[u32; 2]> =
        (1..blocks).map(|i| if i % 3 == 0 { [i, i - 1] } else { [i - 1, i] }).chain([[blocks - 1, 0]]).collect();
    let pattern = Arc::new(Couplings::pattern(blocks as usize, stencils.iter().map(<[u32; 2]>::as_slice)).unwrap());
    let couplings = Arc::new(Couplings::new(&pattern, &stencils).unwrap());
    let mut links = ResidualTerm::new("links", couplings, 0.7);
    links.loss = loss;
    links.set_elements((0..stencils.len()).map(|i| Placed {
        element: Link::new(0.5 + 0.1 * i as f64),
        stencil: i as u32,
        weight: 1.0 + 0.2 * i as f64,
    }));
    let own: Vec<[u32; 1]> = (0..blocks).map(|i| [i]).collect();
    let mut anchors = ResidualTerm::new("anchors", Arc::new(Couplings::new(&pattern, &own).unwrap()), 0.3);
    anchors.set_elements((0..blocks).map(|i| Placed {
        element: Anchor::new([f64::from(i), 0.2]),
        stencil: i,
        weight: 1.0,
    }));
    let x = (0..blocks).map(|i| [0.9 * f64::from(i) + 0.1, 0.3 * f64::from(i % 4)]).collect();
    Chain { pattern, links, anchors, x }
}

fn energy(chain: &Chain, x: &[[f64; 2]]) -> f64 {
    chain.links.energy(x).energy + chain.anchors.energy(x).energy
}

#[test]
fn the_gradient_is_that_of_the_energy_for_every_loss() {
    for loss in [Loss::Squares, Loss::Huber(0.4), Loss::Tukey(3.0)] {
        let chain = chain(11, loss);
        let mut solver = GaussNewton::new(chain.pattern.clone(), GaussNewtonOptions::default()).unwrap();
        let costs = solver.linearise(&[&chain.links, &chain.anchors], &chain.x).unwrap();
        let total: f64 = costs.iter().map(|cost| cost.energy).sum();
        assert!((total - energy(&chain, &chain.x)).abs() < 1e-12 * total);
        for block in 0..11 {
            for i in 0..2 {
                let at = |step: f64| {
                    let mut x = chain.x.clone();
                    x[block][i] += step;
                    energy(&chain, &x)
                };
                let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                let found = 2.0 * solver.equations().right[block][i];
                assert!((slope - found).abs() < 1e-6 * (1.0 + slope.abs()), "{loss:?}, {block}.{i}: {slope}, {found}");
            }
        }
    }
}

#[test]
fn both_solvers_solve() {
    let chain = chain(21, Loss::Squares);
    let kinds = [
        NormalSolverKind::Cholesky,
        NormalSolverKind::ConjugateGradients { relative_tolerance: 1e-13, iteration_limit: 500 },
    ];
    let [a, b] = kinds.map(|solver| {
        let mut options = GaussNewtonOptions::default();
        options.solver = solver;
        let mut newton = GaussNewton::new(chain.pattern.clone(), options).unwrap();
        newton.linearise(&[&chain.links, &chain.anchors], &chain.x).unwrap();
        let (step, _) = newton.solve(1e-3).unwrap();
        // (JᵀJ + μ 1) d = −Jᵀr.
        let mut product = vec![[0.0; 2]; 21];
        newton.equations().matrix.multiply_damped(1e-3, &step, &mut product);
        for (product, right) in product.as_flattened().iter().zip(newton.equations().right.as_flattened()) {
            assert!((product + right).abs() < 1e-9, "{solver:?}: {product}, {right}");
        }
        step
    });
    assert!(a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn iterations_decrease_the_energy_to_a_minimum() {
    let mut chain = chain(9, Loss::Squares);
    let mut solver = GaussNewton::new(chain.pattern.clone(), GaussNewtonOptions::default()).unwrap();
    let terms: [&dyn LeastSquaresTerm<2>; 2] = [&chain.links, &chain.anchors];
    let reports = solver.minimise(&terms, &mut chain.x, 60, 1e-14).unwrap();
    assert!(reports.iter().all(|one| one.after <= one.before), "{reports:?}");
    let last = reports.last().unwrap();
    assert!(last.after < 0.5 * reports[0].before && last.predicted_decrease < 1e-9 * last.before, "{last:?}");
}

#[test]
fn the_predicted_decrease_of_linear_residuals_is_the_decrease() {
    let pattern = Arc::new(Couplings::pattern(2, [[0, 1].as_slice()]).unwrap());
    // The second block comes first in one of the elements.
    let couplings = Arc::new(Couplings::new(&pattern, &[[0, 1], [1, 0]]).unwrap());
    let mut offsets = ResidualTerm::<Offset, 2>::new("offsets", couplings, 0.7);
    offsets.set_elements((0..2).map(|stencil| {
        let element = Offset::new([0.5, 2.0 - f64::from(stencil)]);
        Placed { element, stencil, weight: 1.0 + f64::from(stencil) }
    }));
    let terms: [&dyn LeastSquaresTerm<2>; 1] = [&offsets];
    let mut solver = GaussNewton::new(pattern, GaussNewtonOptions::default()).unwrap();
    let x = [[1.0, -0.5], [0.3, 2.0]];
    solver.linearise(&terms, &x).unwrap();
    for step in [[[0.1, 0.2], [-0.4, 0.3]], [[-3.0, 0.5], [2.0, 1.0]]] {
        let moved: [[f64; 2]; 2] = std::array::from_fn(|block| std::array::from_fn(|i| x[block][i] + step[block][i]));
        let decrease = offsets.energy(&x).energy - offsets.energy(&moved).energy;
        let predicted = solver.predicted_decrease(&step);
        assert!((predicted - decrease).abs() < 1e-12 * decrease.abs(), "{predicted}, {decrease}");
    }
}

#[test]
fn a_graph_alone_is_singular_and_needs_damping() {
    let pattern = Arc::new(Couplings::pattern(2, [[0, 1].as_slice()]).unwrap());
    let mut links = ResidualTerm::<Link, 2>::new("links", Arc::new(Couplings::new(&pattern, &[[0, 1]]).unwrap()), 1.0);
    links.set_elements([Placed { element: Link::new(1.0), stencil: 0, weight: 1.0 }]);
    // Three rows for four unknowns: a factor needs damping, so the iteration must increase it.
    let mut options = GaussNewtonOptions::default();
    options.damping = 0.0;
    let mut solver = GaussNewton::new(pattern, options).unwrap();
    let mut x = [[0.0, 0.0], [2.0, 0.5]];
    let report = solver.iterate(&[&links], &mut x).unwrap();
    assert!(report.outcome == Outcome::Decreased && report.after < report.before, "{report:?}");
    assert!(report.damping > 0.0, "{report:?}");
}

#[test]
fn non_finite_numbers_are_rejected_with_their_position() {
    let mut chain = chain(5, Loss::Squares);
    let mut solver = GaussNewton::new(chain.pattern.clone(), GaussNewtonOptions::default()).unwrap();
    let mut x = chain.x.clone();
    x[3][1] = f64::NAN;
    let error = solver.iterate(&[&chain.links], &mut x).unwrap_err();
    assert_eq!(error, GaussNewtonError::NonFiniteUnknown { block: 3, unknown: 1 });
    let error = solver.iterate(&[&chain.links], &mut chain.x[..4]).unwrap_err();
    assert_eq!(error, GaussNewtonError::WrongLength { expected: 5, found: 4 });
    assert_eq!(error.to_string(), "expected 5 blocks of unknowns, got 4");
    let place = |i: u32| Placed {
        element: Anchor::new([if i == 2 { f64::INFINITY } else { 0.0 }, 0.0]),
        stencil: i,
        weight: 1.0,
    };
    chain.anchors.set_elements((0..5).map(place));
    let before = chain.x.clone();
    let error = solver.iterate(&[&chain.links, &chain.anchors], &mut chain.x).unwrap_err();
    assert_eq!(error, GaussNewtonError::NonFiniteEnergy { term: "anchors".into(), element: Some(2) });
    assert_eq!(error.to_string(), "the energy of `anchors` is not finite, first at element 2");
    assert_eq!(chain.x, before);
}
