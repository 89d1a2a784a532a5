//! The cost of making element Hessians positive semi-definite: assembly of many elements of one type, of which none,
//! a tenth or all are indefinite, against assembly without projection.
//!
//! `cargo bench -p energy-solve --bench clamping`

use std::fmt::Debug;
use std::time::Instant;

use energy_compiler::Interpreted;
use energy_dsl::tape::Column;
use energy_dsl::{PackedPotential, Vector3};
use energy_elements::{
    DistanceBarrier, HairBend, OrthotropicStVK, PlateBending, QuadraticHinge, TetStVK, TetStableNeoHookean,
};
use energy_solve::{
    Curvature, ElementList, LinearisationOptions, PotentialTerm, State, System, TapeTerm, Term, Weights,
};
use nalgebra::DMatrix;

/// Elements of a system.
const COUNT: usize = 2048;

/// Runs of each measurement, of which the fastest counts.
const RUNS: usize = 15;

/// Squared deformations of a cube at two opposite corners, and of a diagonal: 21 reduced coordinates.
const BRICK: &str = "energy Brick(a, b, c, d, e, f, g, h: Point; k: Scalar) {
    let p = b - a; let q = c - a; let r = e - a;
    let s = g - h; let t = f - h; let u = d - h;
    k * ((dot(p, p) - 1)^2 + (dot(q, q) - 1)^2 + (dot(r, r) - 1)^2 + dot(p, q)^2 + dot(q, r)^2 + dot(p, r)^2
       + (dot(s, s) - 1)^2 + (dot(t, t) - 1)^2 + (dot(u, u) - 1)^2 + dot(s, t)^2 + dot(t, u)^2 + dot(s, u)^2
       + (norm_squared(h - a) - 3)^2)
}";

fn main() {
    println!("{:<21} {:>8} {:>16} {:>16} {:>16}", "ns per element", "exact", "none indefinite", "a tenth", "all");
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.2, 0.9, 0.0]];
    let [c0, c1, c2] = triangle.map(|[x, y, _]| [x, y]);
    let tetrahedron = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.1, 1.0, 0.0], [0.2, 0.3, 0.9]];
    let [t0, t1, t2, t3] = tetrahedron;
    compare("DistanceBarrier", &compiled(DistanceBarrier::new(1.0, 1.0)), [[0.0; 3], [0.6, 0.0, 0.0]], 0.3);
    compare("HairBend", &compiled(HairBend::new(1.0)), [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.1, 0.0]], 0.5);
    let membrane = OrthotropicStVK::new(c0, c1, c2, 3.0, 2.0, 0.5, 1.0).expect("a sound rest shape");
    compare("OrthotropicStVK", &compiled(membrane), triangle, 0.4);
    let hinge = [[0.3, 1.0, 0.1], [0.6, -0.9, 0.1], [0.0; 3], [1.0, 0.0, 0.0]];
    compare("QuadraticHinge", &compiled(QuadraticHinge::new(1.0, 0.0)), hinge, 0.3);
    let solid = TetStVK::new(t0, t1, t2, t3, 1.0, 1.0).expect("a sound rest shape");
    compare("TetStVK", &compiled(solid), tetrahedron, 0.4);
    let solid = TetStableNeoHookean::new(t0, t1, t2, t3, 1.0, 1.0).expect("a sound rest shape");
    compare("TetStableNeoHookean", &compiled(solid), tetrahedron, 0.5);
    let plate = [[0.0; 3], [1.0, 0.0, 0.0], [0.2, 0.9, 0.0], [1.1, 0.8, 0.0], [-0.7, 0.6, 0.0], [0.5, -0.8, 0.0]];
    let [p0, p1, p2, p3, p4, p5] = plate;
    let bending = PlateBending::new(p0, p1, p2, p3, p4, p5, 1.0, 1.0).expect("a sound rest shape");
    compare("PlateBending", &compiled(bending), plate, 0.3);
    let brick = std::array::from_fn::<Vector3<f64>, 8, _>(|corner| [0, 1, 2].map(|axis| (corner >> axis & 1) as f64));
    compare("brick, as text", &|count| bricks(count), brick, 0.3);
}

/// Returns a function that makes a term of equal elements, each with its own points.
fn compiled<E, const N: usize>(element: E) -> impl Fn(usize) -> Box<dyn Term>
where
    E: PackedPotential<f64> + energy_dsl::Potential<f64, Points = [Vector3<f64>; N]> + Debug + Send + Sync + 'static,
{
    move |count| {
        let stencils: Vec<[usize; N]> = (0..count).map(|i| std::array::from_fn(|p| N * i + p)).collect();
        let list = ElementList::new("elements", vec![element; count], &stencils).expect("the points exist");
        Box::new(PotentialTerm::new(list))
    }
}

fn bricks(count: usize) -> Box<dyn Term> {
    let element = Interpreted::from_source(BRICK).expect("a formula").remove(0);
    let list = element.elements(count, &[], &[Column::Same(&[1.0])]).expect("one parameter");
    Box::new(TapeTerm::new("bricks".into(), element.declaration(), list.tape().clone(), 0..8 * count))
}

/// Prints the times of elements whose points are `around` some place, up to a `spread` in each direction.
fn compare<const N: usize>(name: &str, term: &dyn Fn(usize) -> Box<dyn Term>, around: [Vector3<f64>; N], spread: f64) {
    let mut random = fastrand::Rng::with_seed(1);
    let shapes: Vec<[Vector3<f64>; N]> =
        (0..COUNT).map(|_| around.map(|point| point.map(|x| x + spread * (2.0 * random.f64() - 1.0)))).collect();
    let (indefinite, definite): (Vec<_>, Vec<_>) =
        shapes.iter().zip(least_eigenvalues(term(COUNT), &shapes)).partition(|(_, least)| *least < -1e-9);
    if indefinite.is_empty() {
        println!("{name:<21} no indefinite element among {COUNT}");
        return;
    }
    // Stretched elements, if random ones are never definite.
    let stretched = around.map(|point| point.map(|x| 1.1 * x));
    let mixed = |tenths: usize| -> Vec<Vector3<f64>> {
        let shape = |i: usize| match (i % 10 < tenths, definite.len()) {
            (true, _) => *indefinite[i % indefinite.len()].0,
            (false, 0) => stretched,
            (false, count) => *definite[i % count].0,
        };
        // Spread over the lanes.
        (0..COUNT).flat_map(|i| shape(i * 7 % COUNT)).collect()
    };
    let exact = assembled(term(COUNT), &mixed(1), Curvature::Exact);
    print!("{name:<21} {exact:>8.0}");
    for tenths in [0, 1, 10] {
        let time = assembled(term(COUNT), &mixed(tenths), Curvature::Clamped);
        print!(" {time:>8.0} {:>5.2} ×", time / exact);
    }
    println!("   {} of {COUNT} random ones are indefinite", indefinite.len());
}

/// Returns the least eigenvalue of each element's Hessian over its largest entry.
fn least_eigenvalues<const N: usize>(term: Box<dyn Term>, shapes: &[[Vector3<f64>; N]]) -> Vec<f64> {
    let x = shapes.concat();
    let mut system = System::new(vec![term], &vec![false; x.len()]).expect("a system");
    let mut matrix = system.matrix();
    let v = vec![[0.0; 3]; x.len()];
    system.linearise(State { x: &x, v: &v }, options(Curvature::Exact), &mut matrix).expect("finite energies");
    let least = |element: usize| {
        let dense = DMatrix::from_fn(3 * N, 3 * N, |row, column| {
            matrix.block(N * element + row / 3, N * element + column / 3)[row % 3][column % 3]
        });
        let size = dense.amax();
        dense.symmetric_eigenvalues().min() / size
    };
    (0..shapes.len()).map(least).collect()
}

/// Returns the least time of an assembly in nanoseconds per element.
fn assembled(term: Box<dyn Term>, x: &[Vector3<f64>], curvature: Curvature) -> f64 {
    let mut system = System::new(vec![term], &vec![false; x.len()]).expect("a system");
    system.set_threads(1);
    let mut matrix = system.matrix();
    let v = vec![[0.0; 3]; x.len()];
    let mut least = f64::INFINITY;
    for _ in 0..RUNS {
        let start = Instant::now();
        system.linearise(State { x, v: &v }, options(curvature), &mut matrix).expect("finite energies");
        least = least.min(start.elapsed().as_secs_f64());
    }
    1e9 * least / COUNT as f64
}

fn options(curvature: Curvature) -> LinearisationOptions {
    let weights = Weights { position: -1.0, velocity: 0.0 };
    LinearisationOptions::new(weights, curvature)
}
