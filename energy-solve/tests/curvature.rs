//! Projection in the reduced coordinates of an element, in lanes, against the eigenvalues of the full matrix.

use std::fmt::Debug;

use energy_compiler::Interpreted;
use energy_dsl::tape::Column;
use energy_dsl::{Block, Element, PackedPotential, Vector3};
use energy_elements::{
    AsRigidAsPossible, BaraffWitkinShear, BaraffWitkinStretch, DistanceBarrier, FlatBending, HairBend, HookeSpring,
    NeoHookean, PowerLaw, SquaredDistanceBarrier, StVK, StableNeoHookean, StableNeoHookeanLog,
};
use energy_solve::{
    Counts, Curvature, ElementList, LinearisationOptions, PotentialTerm, State, System, TapeTerm, Term, Weights,
};
use nalgebra::linalg::SymmetricEigen;
use nalgebra::{DMatrix, Dyn};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

/// Returns a term of generated elements, each with its own points.
pub(crate) fn compiled<E, const N: usize>(elements: &[E]) -> Box<dyn Term>
where
    E: PackedPotential<f64> + Debug + 'static + Send + Sync,
{
    let list = ElementList::new("elements", elements.to_vec(), &stencils::<N>(elements.len())).unwrap();
    Box::new(PotentialTerm::new(list))
}

/// An element that is read at run time: projection is the same, and generated ones take seconds each to build.
pub(crate) struct Read(Interpreted);

impl Read {
    pub(crate) fn new<E: Element>() -> Self {
        Self::of_text(&E::DECLARATION.source)
    }

    fn of_text(source: &str) -> Self {
        Self(Interpreted::from_source(source).unwrap().pop().unwrap())
    }

    /// Returns a term of equal elements, each with its own points.
    pub(crate) fn term(&self, count: usize, rest: &[&[f64]], parameters: &[f64]) -> Box<dyn Term> {
        let rest: Vec<_> = rest.iter().map(|numbers| Column::Same(numbers)).collect();
        let parameters: Vec<_> = parameters.chunks(1).map(Column::Same).collect();
        let elements = self.0.elements(count, &rest, &parameters).unwrap();
        let declaration = self.0.declaration();
        let vertices = 0..count * declaration.points.len();
        Box::new(TapeTerm::new("elements".into(), declaration, elements.tape().clone(), vertices))
    }
}

fn stencils<const N: usize>(count: usize) -> Vec<[usize; N]> {
    (0..count).map(|i| std::array::from_fn(|p| N * i + p)).collect()
}

/// Returns the Hessian of each element as a dense matrix, and the evaluation counts.
pub(crate) fn hessians<const N: usize>(
    elements: Box<dyn Term>,
    x: &[[Vector3<f64>; N]],
    curvature: Curvature,
) -> (Vec<DMatrix<f64>>, Counts) {
    let positions = x.concat();
    let mut system = System::new(vec![elements], &vec![false; positions.len()]).unwrap();
    let mut matrix = system.matrix();
    let weights = Weights { position: -1.0, velocity: 0.0 };
    let options = LinearisationOptions::new(weights, curvature);
    let v = vec![[0.0; 3]; positions.len()];
    system.linearise(State { x: &positions, v: &v }, options, &mut matrix).unwrap();
    let dense = |stencil: [usize; N]| {
        DMatrix::from_fn(3 * N, 3 * N, |row, column| {
            let block: Block<f64> = matrix.block(stencil[row / 3], stencil[column / 3]);
            block[row % 3][column % 3]
        })
    };
    let dense = stencils(x.len()).into_iter().map(dense).collect();
    (dense, system.terms().next().unwrap().1)
}

/// Returns the eigenvalues and eigenvectors of a symmetric matrix.
///
/// Entries below 1e-30 of its size become zero. nalgebra's iteration returns NaN where products of them underflow.
fn eigen(of: &DMatrix<f64>) -> SymmetricEigen<f64, Dyn> {
    let negligible = 1e-30 * of.amax();
    of.map(|entry| if entry.abs() < negligible { 0.0 } else { entry }).symmetric_eigen()
}

pub(crate) fn least_eigenvalue(of: &DMatrix<f64>) -> f64 {
    eigen(of).eigenvalues.min()
}

pub(crate) fn with_eigenvalues(of: &DMatrix<f64>, change: impl Fn(f64) -> f64) -> DMatrix<f64> {
    let mut eigen = eigen(of);
    eigen.eigenvalues.iter_mut().for_each(|value| *value = change(*value));
    eigen.recompose()
}

/// Compares all three treatments of negative eigenvalues on the same elements.
fn check<const N: usize>(elements: impl Fn() -> Box<dyn Term>, x: &[[Vector3<f64>; N]]) -> Result<(), TestCaseError> {
    let (exact, none) = hessians(elements(), x, Curvature::Exact);
    prop_assert_eq!(none.hessian.projected, 0);
    for curvature in [Curvature::Clamped, Curvature::Absolute] {
        let change = |value: f64| if curvature == Curvature::Clamped { value.max(0.0) } else { value.abs() };
        let (found, counts) = hessians(elements(), x, curvature);
        let mut indefinite = 0;
        for (element, (found, exact)) in found.iter().zip(&exact).enumerate() {
            let size = exact.amax();
            let least = least_eigenvalue(exact);
            indefinite += u64::from(least < -1e-12 * size);
            let expected = with_eigenvalues(exact, change);
            let error = (found - &expected).amax();
            prop_assert!(error <= 1e-11 * size, "{curvature:?}, element {element}: off by {error:e} of {size:e}");
            prop_assert!(least_eigenvalue(found) >= -1e-12 * size);
            if least >= 0.0 {
                prop_assert_eq!(found, exact, "element {} has nothing to change", element);
            }
        }
        prop_assert!(counts.hessian.projected >= indefinite, "{} of {indefinite}", counts.hessian.projected);
    }
    Ok(())
}

/// Enough elements for a full batch and a ragged one.
pub(crate) const COUNT: usize = 19;

pub(crate) fn points<const N: usize>() -> impl Strategy<Value = Vec<[Vector3<f64>; N]>> {
    let one = proptest::collection::vec(-1.0..1.0_f64, 3 * N)
        .prop_map(|numbers| std::array::from_fn(|p| std::array::from_fn(|axis| numbers[3 * p + axis])));
    proptest::collection::vec(one, COUNT)
}

/// Runs a test on random inputs.
pub(crate) fn on_random<S: Strategy>(inputs: &S, test: impl Fn(S::Value) -> Result<(), TestCaseError>) {
    TestRunner::new(ProptestConfig::with_cases(24)).run(inputs, test).unwrap();
}

#[test]
fn springs() {
    on_random(&(points::<2>(), 0.1..2.0_f64), |(x, length)| {
        check(|| compiled::<_, 2>(&[HookeSpring { K: 3.0, L: length }; COUNT]), &x)
    });
}

#[test]
fn hair() {
    let hair = Read::new::<HairBend>();
    on_random(&points::<3>(), |x| check(|| hair.term(COUNT, &[], &[2.0]), &x));
}

#[test]
fn membranes() {
    let (arap, stretch, shear) =
        (Read::new::<AsRigidAsPossible>(), Read::new::<BaraffWitkinStretch>(), Read::new::<BaraffWitkinShear>());
    let isotropic = [Read::new::<StableNeoHookean>(), Read::new::<StableNeoHookeanLog>(), Read::new::<NeoHookean>()];
    on_random(&(points::<3>(), 0.5..2.0_f64), |(x, size)| {
        let (u0, u1, u2) = ([0.0, 0.0], [size, 0.0], [0.3, size]);
        check(|| compiled::<_, 3>(&[StVK::new(u0, u1, u2, 1.0, 2.0).unwrap(); COUNT]), &x)?;
        let rest: [&[f64]; 3] = [&u0, &u1, &u2];
        for element in &isotropic {
            check(|| element.term(COUNT, &rest, &[1.0, 2.0]), &x)?;
        }
        check(|| arap.term(COUNT, &rest, &[1.0]), &x)?;
        check(|| stretch.term(COUNT, &rest, &[1.0, 1.1, 0.9]), &x)?;
        check(|| shear.term(COUNT, &rest, &[1.0]), &x)
    });
}

#[test]
fn barriers_and_powers() {
    let barriers = [Read::new::<DistanceBarrier>(), Read::new::<SquaredDistanceBarrier>()];
    let power = Read::new::<PowerLaw>();
    on_random(&(points::<2>(), 0.1..3.0_f64), |(x, near)| {
        for barrier in &barriers {
            check(|| barrier.term(COUNT, &[], &[2.0, near]), &x)?;
        }
        check(|| power.term(COUNT, &[], &[near]), &x)
    });
}

/// Measures of two vectors. Their Hessians have constant entries, and equal ones.
const MEASURES: [&str; 7] = [
    "dot(a, b)",
    "norm_squared(a + 2 * b)",
    "norm(2 * a - b)",
    "a.x * b.y",
    "dot(cross(a, b), vector(1, 2, 3))",
    "(a.z - b.x)",
    "det(columns(a, b, a + vector(1, 0, 2)))",
];
const FUNCTIONS: [&str; 5] = ["?", "sin(?)", "exp(-(?)^2)", "(?)^3", "1 / (1 + (?)^2)"];

/// Returns an energy of random measures, which is not quadratic.
fn of_measures(choices: [(usize, usize); 3]) -> Read {
    let term = |(measure, function): (usize, usize)| FUNCTIONS[function].replace('?', MEASURES[measure]);
    let [first, second, third] = choices.map(term);
    let text = format!("let a = x1 - x0; let b = x2 - x0; k * ({first} + ({second}) * ({third}) + sin(a.z))");
    Read::of_text(&format!("energy Random(x0, x1, x2: Point; k: Scalar) {{ {text} }}"))
}

/// Entries of a Hessian that are constant, or equal to others, may differ from them once it is projected.
#[test]
fn equal_and_constant_entries() {
    let choice = || (0..MEASURES.len(), 0..FUNCTIONS.len());
    on_random(&([choice(), choice(), choice()], points::<3>()), |(choices, x)| {
        let element = of_measures(choices);
        check(|| element.term(COUNT, &[], &[1.5]), &x)
    });
    let volume = "energy Volume(x0, x1, x2, x3: Point; k: Scalar) { k * det(columns(x1 - x0, x2 - x0, x3 - x0)) }";
    let volume = Read::of_text(volume);
    on_random(&(points::<4>(), 0.5..2.0_f64), |(x, k)| check(|| volume.term(COUNT, &[], &[k]), &x));
}

#[test]
fn flat_hinges() {
    // Functions of a dihedral angle do not get the nearest matrix: `hinges.rs` has their tests.
    let flat = Read::new::<FlatBending>();
    let rest: [&[f64]; 4] = [&[0.5, 1.0, 0.0], &[0.4, -0.9, 0.0], &[0.0; 3], &[1.0, 0.0, 0.0]];
    on_random(&points::<4>(), |x| check(|| flat.term(COUNT, &rest, &[2.0]), &x));
}

#[test]
fn an_element_at_rest_is_not_projected() {
    let rest = StVK::new([0.0, 0.0], [1.0, 0.0], [0.3, 0.9], 1.0, 2.0).unwrap();
    // Rotated, so that the zeros of its Hessian have rounding errors.
    let x = [[0.1, 0.2, 0.3], [0.1 + 0.6, 0.2, 0.3 + 0.8], [0.1 + 0.18, 0.2 + 0.9, 0.3 + 0.24]];
    let (exact, _) = hessians(compiled::<_, 3>(&[rest]), &[x], Curvature::Exact);
    let (found, counts) = hessians(compiled::<_, 3>(&[rest]), &[x], Curvature::Clamped);
    assert_eq!((counts.hessian.evaluated, counts.hessian.projected), (1, 0));
    assert_eq!(found, exact);
}

#[test]
fn lanes_do_not_affect_each_other() {
    let spring = |length| HookeSpring { K: 1.0, L: length };
    let x = [[[0.0; 3], [1.0, 0.2, 0.3]]; 2];
    let (alone, _) = hessians(compiled::<_, 2>(&[spring(2.0)]), &x[..1], Curvature::Clamped);
    let (beside, counts) = hessians(compiled::<_, 2>(&[spring(2.0), spring(0.5)]), &x, Curvature::Clamped);
    assert_eq!(alone[0], beside[0]);
    assert_eq!(counts.hessian.projected, 1);
}

/// More coordinates than arrays hold: chains of springs and angles through 5 to 8 points, drawn from a seed.
#[test]
fn elements_of_many_points() {
    fn check_chain<const N: usize>(seed: u64) {
        let weight = |i: usize| 1.0 + f64::from((seed.wrapping_mul(2_654_435_761) >> (3 * i % 24)) as u32 % 7) / 4.0;
        let names: Vec<String> = (0..N).map(|i| format!("p{i}")).collect();
        let terms: Vec<String> = (1..N)
            .map(|i| format!("{} * (norm_squared(p{i} - p{}) - 1)^2", weight(i), i - 1))
            .chain((2..N).map(|i| format!("{} * dot(p{i} - p{}, p{} - p{})^3", weight(2 * i), i - 1, i - 1, i - 2)))
            .collect();
        let source = format!("energy Chain({}: Point; k: Scalar) {{ k * ({}) }}", names.join(", "), terms.join(" + "));
        let read = Read::of_text(&source);
        on_random(&points::<N>(), |x| check(|| read.term(COUNT, &[], &[2.0]), &x));
    }
    check_chain::<5>(20_261_128);
    check_chain::<6>(31_415);
    check_chain::<8>(27_182);
}
