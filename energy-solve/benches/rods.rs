//! Time of Newton's method for rods of 1,000 and 10,000 nodes: points and twists by turns, 10 off-diagonals.
//!
//! `cargo bench -p energy-solve --bench rods`

use std::borrow::Cow::Borrowed;
use std::time::{Duration, Instant};

use energy_dsl::{
    Declaration, Element, Field, FieldKind, Flags, Inputs, Kind, Lane, Level, MixedGradient, MixedHessian,
    MixedPotential, MixedProduct, Outputs, PackedMixed, Real, RestError, Stored, Value,
};
use energy_solve::{
    BandOrder, BorderedSolver, Curvature, Inertia, KindSolver, MixedBody, MixedIntegrator, MixedNewtonError,
    MixedNewtonOptions, MixedNewtonReport, MixedScheme, MixedState, MixedSystem, MixedTerm, UnknownKind,
};

/// Runs of each measurement, of which the fastest counts.
const RUNS: usize = 15;

const BAND: KindSolver = KindSolver::Band(BandOrder::Narrowest);

/// Distance of nodes, in m.
const SPACING: f64 = 0.01;

/// Stretch k/2 (‖x₁ − x₀‖ − l)², bending b/2 ‖x₀ − 2 x₁ + x₂‖², twist c/2 (θ₁ − θ₀)², coupling c (θ₁ − θ₀) (x₂ − x₁)₃/l,
/// and weight w (x₁)₃.
#[derive(Clone, Copy, Debug)]
struct Rod<T> {
    numbers: [T; 5],
}

const POINT: Field = Field { name: Borrowed("x"), kind: FieldKind::Point, shared: false, size: 3, unit: Borrowed("m") };
const ANGLE: Field =
    Field { name: Borrowed("θ"), kind: FieldKind::Numbers, shared: false, size: 1, unit: Borrowed("rad") };

static ROD: Declaration = Declaration {
    name: Borrowed("Rod"),
    kind: Kind::Energy,
    docs: Borrowed(""),
    formula: Borrowed(""),
    source: Borrowed(""),
    points: Borrowed(&[POINT, POINT, POINT, ANGLE, ANGLE]),
    rest: Borrowed(&[]),
    parameters: Borrowed(&[]),
    state: Borrowed(&[]),
    rows: 1,
    properties: Borrowed(&[]),
    translation_invariant: false,
    curved: true,
    quadratic: false,
    velocity_dependent: false,
    symmetric: true,
    reduced_coordinates: 0,
    reduced_vectors: Borrowed(&[]),
    dihedral: None,
    primitives: Borrowed(&[]),
    routines: Borrowed(&[]),
};

impl<T: Real> Element for Rod<T> {
    const DECLARATION: &'static Declaration = &ROD;
    type Over<R: Real> = Rod<R>;

    fn evaluate<R: Real>(_: &Inputs<'_, R>) -> Result<Outputs<R>, RestError> {
        Err(RestError { element: "Rod".into() })
    }
}

impl<T: Real> Rod<T> {
    /// Returns the energy, with the vectors and numbers of its derivatives: d, stretch, ‖d‖, bending vector, twist.
    #[inline(always)]
    fn parts(&self, u: &[T; 11]) -> (T, [T; 3], T, T, [T; 3], T) {
        let [k, b, c, w, l] = self.numbers;
        let d = [u[3] - u[0], u[4] - u[1], u[5] - u[2]];
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let stretch = length - l;
        let mut bend = d;
        for i in 0..3 {
            bend[i] = u[6 + i] - u[3 + i] - d[i];
        }
        let twist = u[10] - u[9];
        let square = bend[0] * bend[0] + bend[1] * bend[1] + bend[2] * bend[2];
        let energy = T::from_f64(0.5) * (k * stretch * stretch + b * square + c * twist * twist)
            + c * twist * (u[8] - u[5]) / l
            + w * u[5];
        (energy, d, stretch, length, bend, twist)
    }

    #[inline(always)]
    fn first(&self, u: &[T; 11]) -> (T, [T; 11]) {
        let ([k, b, c, w, l], (energy, d, stretch, length, bend, twist)) = (self.numbers, self.parts(u));
        let mut g = [T::from_f64(0.0); 11];
        for i in 0..3 {
            let (along, across) = (k * stretch * d[i] / length, b * bend[i]);
            (g[i], g[3 + i], g[6 + i]) = (across - along, along - (across + across), across);
        }
        let (coupled, turned) = (c * twist / l, c * twist + c * (u[8] - u[5]) / l);
        (g[5], g[8]) = (g[5] - coupled + w, g[8] + coupled);
        (g[9], g[10]) = (-turned, turned);
        (energy, g)
    }
}

/// Returns the index of entry (i, j), i ≤ j, of the triangle.
const fn at(i: usize, j: usize) -> usize {
    i * (21 - i) / 2 + j
}

impl<T: Real> MixedPotential<T> for Rod<T> {
    type Unknowns = [T; 11];
    type Increments = [T; 11];
    type Upper = [T; 66];

    fn value(&self, u: &[T; 11]) -> Value<T> {
        Value { value: self.parts(u).0, flags: Flags::clear() }
    }

    #[inline(always)]
    fn value_at<L: Level>(&self, u: &[T; 11]) -> Value<T> {
        Value { value: self.parts(u).0, flags: Flags::clear() }
    }

    fn gradient(&self, u: &[T; 11]) -> MixedGradient<T, [T; 11]> {
        let (value, gradient) = self.first(u);
        MixedGradient { value, gradient, flags: Flags::clear() }
    }

    #[inline(always)]
    fn gradient_at<L: Level>(&self, u: &[T; 11]) -> MixedGradient<T, [T; 11]> {
        let (value, gradient) = self.first(u);
        MixedGradient { value, gradient, flags: Flags::clear() }
    }

    fn hessian(&self, u: &[T; 11]) -> MixedHessian<T, [T; 11], [T; 66]> {
        self.hessian_at::<energy_dsl::Baseline>(u)
    }

    #[inline(always)]
    fn hessian_at<L: Level>(&self, u: &[T; 11]) -> MixedHessian<T, [T; 11], [T; 66]> {
        let ([k, b, c, _, l], (value, gradient)) = (self.numbers, self.first(u));
        let (_, d, stretch, length, ..) = self.parts(u);
        let mut h = [T::from_f64(0.0); 66];
        let across = k * stretch / length;
        let part = k * l / (length * length * length);
        let (twice, four) = (b + b, T::from_f64(4.0) * b);
        for i in 0..3 {
            for j in 0..3 {
                let along = part * d[i] * d[j];
                if i < j {
                    (h[at(i, j)], h[at(3 + i, 3 + j)]) = (along, along);
                }
                h[at(i, 3 + j)] = -along;
            }
            let along = part * d[i] * d[i] + across;
            (h[at(i, i)], h[at(i, 3 + i)], h[at(i, 6 + i)]) = (along + b, -along - twice, b);
            (h[at(3 + i, 3 + i)], h[at(3 + i, 6 + i)], h[at(6 + i, 6 + i)]) = (along + four, -twice, b);
        }
        let coupled = c / l;
        (h[at(9, 9)], h[at(9, 10)], h[at(10, 10)]) = (c, -c, c);
        (h[at(5, 9)], h[at(5, 10)], h[at(8, 9)], h[at(8, 10)]) = (coupled, -coupled, -coupled, coupled);
        MixedHessian { value, gradient, hessian: h, flags: Flags::clear() }
    }

    fn hessian_vector(&self, _: &[T; 11], _: &[T; 11]) -> MixedProduct<T, [T; 11]> {
        unreachable!("a direct solver does not use it")
    }

    fn hessian_vector_at<L: Level>(&self, _: &[T; 11], _: &[T; 11]) -> MixedProduct<T, [T; 11]> {
        unreachable!("a direct solver does not use it")
    }
}

impl Stored<f64> for Rod<f64> {
    const NUMBERS: usize = 5;

    fn store(&self, numbers: &mut [f64], stride: usize) {
        self.numbers.iter().enumerate().for_each(|(i, own)| numbers[i * stride] = *own);
    }
}

impl PackedMixed<f64> for Rod<f64> {
    type Wide<V: Lane<f64>> = Rod<V>;

    #[inline(always)]
    fn load<V: Lane<f64>>(numbers: &[f64], stride: usize) -> Rod<V> {
        let mut own = [V::splat(0.0); 5];
        for i in 0..5 {
            own[i] = V::load(&numbers[i * stride..]);
        }
        Rod { numbers: own }
    }
}

/// A rod along x, clamped at its first edge.
fn rod(nodes: usize) -> (MixedSystem, Vec<f64>) {
    let kind = |i: usize| if i.is_multiple_of(2) { UnknownKind::Vector3 } else { UnknownKind::Scalar };
    let kinds: Vec<UnknownKind> = (0..2 * nodes - 1).map(kind).collect();
    let body = MixedBody::new(&kinds, SPACING).with_fixed(&[0, 1, 2]).expect("these unknowns exist");
    let element = Rod { numbers: [1e3, 100.0, 1e-2, 1e-4, SPACING] };
    let stencils: Vec<[usize; 5]> = (0..nodes - 2).map(|i| 2 * i).map(|i| [i, i + 2, i + 4, i + 1, i + 3]).collect();
    let term = MixedTerm::new("rod", vec![element; nodes - 2], &stencils).expect("a stencil per element");
    let system = MixedSystem::new(body, vec![term]).expect("stencils fit");
    let point = |i: usize| [SPACING * i as f64, 1e-3 * (i as f64).sin(), 0.0];
    let u = (0..2 * nodes - 1)
        .flat_map(|i| if i % 2 == 0 { point(i / 2).to_vec() } else { vec![1e-3 * (i as f64).cos()] })
        .collect();
    (system, u)
}

/// Returns the time of the fastest run.
fn fastest(mut run: impl FnMut()) -> Duration {
    let timed = |()| {
        let start = Instant::now();
        run();
        start.elapsed()
    };
    (0..RUNS).map(|_| ()).map(timed).min().expect("some runs")
}

/// The parts of one Newton step and a whole one, in ns per node.
fn measure(nodes: usize) -> [f64; 4] {
    let (mut system, u) = rod(nodes);
    let mut matrix = system.matrix();
    let mut solver = BorderedSolver::new(system.pattern(), &BAND);
    assert_eq!(solver.half_bandwidth(), Some(10));
    let energy = fastest(|| assert!(system.energy(&u).is_ok()));
    let assembly = fastest(|| assert!(system.linearise(&u, Curvature::Exact, &mut matrix).is_ok()));
    // Inertia makes the matrix definite, as in a time step of 1 ms.
    for row in 0..system.pattern().unknowns() {
        let inertia = if system.pattern().size(row) == 1 { 1.0 } else { 1e3 };
        matrix.kinds_mut().add(row, row, |i, j| if i == j { inertia } else { 0.0 });
    }
    let right = vec![1.0; matrix.rows()];
    let mut x = right.clone();
    let solve = fastest(|| assert!(solver.solve(&matrix, &right, &mut x).is_ok()));
    // Newton steps that never meet the tolerance: the difference of 8 and 2 is 6.
    let [few, more] = [2, 8].map(|limit| newton_steps(nodes, limit));
    [energy, assembly, solve, (more - few) / 6].map(|time| time.as_secs_f64() * 1e9 / nodes as f64)
}

/// Whether all steps were full ones, with the exact Hessian.
fn is_plain(report: &MixedNewtonReport) -> bool {
    report.projected == 0 && report.halvings == 0
}

/// Returns the time of a search with this many Newton steps.
fn newton_steps(nodes: usize, limit: usize) -> Duration {
    let (system, u) = rod(nodes);
    let inertia = (0..2 * nodes - 1).map(|i| Inertia::Mass(if i % 2 == 0 { 1e-3 } else { 1e-6 })).collect();
    let options = MixedNewtonOptions::new(0.0).with_iteration_limit(limit);
    let mut integrator =
        MixedIntegrator::new(system, inertia, MixedScheme::ImplicitEuler, &BAND, options).expect("masses fit");
    let mut state = MixedState::at_rest(integrator.system(), u);
    fastest(|| match integrator.step(&mut state, 1e-3) {
        Err(MixedNewtonError::NotConverged(report)) if is_plain(&report) && report.iterations == limit => {}
        outcome => panic!("expected {limit} full steps with the exact Hessian, got {outcome:?}"),
    })
}

fn main() {
    println!("{:>8} {:>10} {:>10} {:>10} {:>16}", "ns/node", "energy", "assembly", "solve", "Newton step");
    let [short, long] = [1_000, 10_000].map(|nodes| {
        let [energy, assembly, solve, iteration] = measure(nodes);
        println!("{nodes:>8} {energy:>10.0} {assembly:>10.0} {solve:>10.0} {iteration:>16.0}");
        iteration
    });
    println!(
        "10,000 nodes: {:.2} ms per Newton step, {:.2} times the time per node of 1,000",
        long / 100.0,
        long / short
    );
}
