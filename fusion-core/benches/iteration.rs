//! Time of a Gauss–Newton iteration on one core: derivatives, assembly, solution. Also the time of the data term's
//! derivatives by finite differences and by dual numbers. Run by `cargo bench -p fusion-core`.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

use energy_dsl::Residual;
use energy_elements::NonrigidPlane4;
use energy_solve::{GaussNewton, GaussNewtonOptions, NormalSolverKind};
use fusion_core::body::{Bone, Mesh, SkinnedBody};
use fusion_core::energy::{BoneTargets, EnergyOptions, FusionEnergy, Pair};
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::twist::{AngleConvention, Twist};
use nalgebra::{Isometry3, SVector, Vector3};
use num_dual::DualNum;

/// Creates a tall closed surface of about this many vertices, as wide as a body, with four bones along it.
fn body(vertices: usize) -> SkinnedBody {
    const HEIGHT: f64 = 1.8;
    let around = (vertices as f64 / 2.3).sqrt().round() as usize;
    let rings = vertices / around;
    let mut places = Vec::new();
    let mut weights = Vec::new();
    for ring in 0..rings {
        let part = (ring as f64 + 0.5) / rings as f64;
        let radius = 0.17 * (1.0 - (2.0 * part - 1.0).powi(4)).sqrt() * (1.0 + 0.2 * (9.0 * part).sin());
        let bone = ((4.0 * part) as usize).min(3);
        for step in 0..around {
            let angle = TAU * step as f64 / around as f64;
            places.push(Vector3::new(radius * angle.cos(), HEIGHT * (part - 0.5), radius * angle.sin()));
            weights.push(vec![(bone, 1.0)]);
        }
    }
    let mut triangles = Vec::new();
    for ring in 0..rings - 1 {
        for step in 0..around {
            let [p, q] = [step, (step + 1) % around].map(|at| (ring * around + at) as u32);
            let [r, s] = [p, q].map(|at| at + around as u32);
            triangles.extend([[p, r, q], [q, r, s]]);
        }
    }
    let bone = |i: usize| Bone {
        name: format!("bone {i}"),
        parent: i.checked_sub(1),
        head: [0.0, HEIGHT * (i as f64 / 4.0 - 0.5), 0.0],
        tail: [0.0, HEIGHT * ((i + 1) as f64 / 4.0 - 0.5), 0.0],
    };
    SkinnedBody::new(Mesh::new(places, triangles), (0..4).map(bone).collect(), weights).expect("the parts fit")
}

/// Returns the median time of repeated runs, in ms.
fn median(mut run: impl FnMut()) -> f64 {
    run();
    let mut times: Vec<f64> = (0..15)
        .map(|_| {
            let start = Instant::now();
            run();
            1e3 * start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Creates a body, and searches the distance of nodes that gives about this many nodes.
fn model(vertices: usize, nodes: usize, k: usize) -> DeformationModel {
    let body = body(vertices);
    let (mut low, mut high) = (0.005, 0.5);
    for _ in 0..24 {
        let radius = 0.5 * (low + high);
        let found = fusion_core::model::sample_nodes(&body.mesh.vertices, radius).len();
        if found > nodes { low = radius } else { high = radius }
    }
    let options = ModelOptions { node_radius: high, nodes_per_vertex: k, ..ModelOptions::default() };
    DeformationModel::new(&body, options).expect("the model can be made")
}

fn measure(vertices: usize, nodes: usize, k: usize) {
    let model = model(vertices, nodes, k);
    let mut energy = FusionEnergy::new(&model, EnergyOptions::default()).expect("the energy can be made");
    let rest = [Isometry3::identity(); 4];
    energy.set_bones(&model, &BoneTargets { reported: Some(&rest), expected: &rest, trust: 1.0 });
    let mut random = fastrand::Rng::with_seed(1);
    let mut near = |size: f64| size * (2.0 * random.f64() - 1.0);
    let x: Vec<Twist> =
        (0..model.nodes.len()).map(|_| std::array::from_fn(|i| near(if i < 3 { 0.2 } else { 0.03 }))).collect();
    let moved = energy.moved(&x);
    let pairs: Vec<Pair> = (0..model.mesh.vertices.len())
        .map(|vertex| Pair {
            vertex: vertex as u32,
            point: moved.vertices[vertex] + Vector3::from_fn(|_, _| near(0.01)),
        })
        .collect();
    let filling = median(|| energy.set_pairs(&model, &pairs, &moved));
    let derivatives = median(|| {
        black_box(energy.evaluate_jacobians(&x));
    });
    println!(
        "\n{} nodes, {} pairs, K = {k}, KG = 8: {} blocks of JᵀJ stored",
        model.nodes.len(),
        pairs.len(),
        energy.pattern().blocks()
    );
    println!("  filling the data term             {filling:8.2} ms, after each search for correspondences");
    println!("  derivatives                       {derivatives:8.2} ms");
    let solvers = [
        ("Cholesky", NormalSolverKind::Cholesky),
        (
            "conjugate gradients, 1e-4",
            NormalSolverKind::ConjugateGradients { relative_tolerance: 1e-4, iteration_limit: 2000 },
        ),
    ];
    for (name, solver) in solvers {
        let mut options = GaussNewtonOptions::default();
        options.solver = solver;
        let mut newton = GaussNewton::<6>::new(energy.pattern().clone(), options).expect("memory suffices");
        let terms = energy.terms();
        let assembled = median(|| {
            black_box(newton.linearise(&terms, &x).expect("finite"));
        });
        let solved = median(|| {
            black_box(newton.solve(1e-3).expect("positive definite"));
        });
        let total = assembled + solved;
        println!(
            "  {name:<26} total {total:8.2} ms: derivatives and assembly {assembled:.2}, solution {solved:.2}; \
             derivatives {:.0} %",
            100.0 * derivatives / total
        );
    }
    if k == 4 {
        others(&model, &pairs, &x);
    }
}

/// Times the data term's rows by other methods, one pair after the other.
fn others(model: &DeformationModel, pairs: &[Pair], x: &[Twist]) {
    let parts = |pair: &Pair| {
        let vertex = pair.vertex as usize;
        let w: [f64; 4] = std::array::from_fn(|k| model.vertex_weights[vertex][k]);
        let nodes = &model.vertex_nodes[vertex];
        let unknowns: [f64; 24] = std::array::from_fn(|i| x[nodes[i / 6] as usize][i % 6]);
        let (v, n): ([f64; 3], [f64; 3]) = (model.mesh.vertices[vertex].into(), model.mesh.normals[vertex].into());
        (w, v, n, <[f64; 3]>::from(pair.point), unknowns)
    };
    let scalar = median(|| {
        for pair in pairs {
            let (w, v, n, u, unknowns) = parts(pair);
            black_box(NonrigidPlane4::new(1.0, w, v, n, u).jacobian(&unknowns));
        }
    });
    let differences = median(|| {
        for pair in pairs {
            let (w, v, n, u, mut unknowns) = parts(pair);
            let element = NonrigidPlane4::new(1.0, w, v, n, u);
            let row: [f64; 24] = std::array::from_fn(|i| {
                let (here, step) = (unknowns[i], 1e-6);
                unknowns[i] = here + step;
                let ahead = element.residual(&unknowns).value[0];
                unknowns[i] = here - step;
                let behind = element.residual(&unknowns).value[0];
                unknowns[i] = here;
                (ahead - behind) / (2.0 * step)
            });
            black_box(row);
        }
    });
    let mut worst = 0.0_f64;
    for pair in &pairs[..100.min(pairs.len())] {
        let (w, v, n, u, unknowns) = parts(pair);
        let ours = NonrigidPlane4::new(1.0, w, v, n, u).jacobian(&unknowns).jacobian;
        let theirs = dual_row(&w, &v, &n, &u, &unknowns);
        worst = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(worst, f64::max);
    }
    assert!(worst < 1e-12, "dual numbers and generated code differ by {worst:e}");
    let dual = median(|| {
        for pair in pairs {
            let (w, v, n, u, unknowns) = parts(pair);
            black_box(dual_row(&w, &v, &n, &u, &unknowns));
        }
    });
    println!(
        "  data term's rows alone: generated, one by one {scalar:.2} ms; central differences {differences:.2} ms; \
         num-dual {dual:.2} ms"
    );
}

/// Computes the gradient of n̂·(v̂ − u) by dual numbers through the textbook's formulas.
fn dual_row(w: &[f64; 4], v: &[f64; 3], n: &[f64; 3], u: &[f64; 3], unknowns: &[f64; 24]) -> [f64; 24] {
    let x = SVector::<f64, 24>::from_column_slice(unknowns);
    let (_, gradient) = num_dual::gradient(|x| plane(w, v, n, u, |i| x[i]), &x);
    gradient.into()
}

fn plane<D: DualNum<Primitive = f64> + Copy>(
    w: &[f64; 4],
    v: &[f64; 3],
    n: &[f64; 3],
    u: &[f64; 3],
    x: impl Fn(usize) -> D,
) -> D {
    let zero = D::from(0.0);
    let product = |a: [D; 4], b: [D; 4]| {
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ]
    };
    let (mut real, mut dual, mut pivot) = ([zero; 4], [zero; 4], [zero; 4]);
    for k in 0..4 {
        let theta = [x(6 * k), x(6 * k + 1), x(6 * k + 2)];
        let angle = (theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2]).sqrt();
        let part = angle.sin() / angle;
        let q = [angle.cos(), theta[0] * part, theta[1] * part, theta[2] * part];
        if k == 0 {
            pivot = q;
        }
        let along: f64 = (0..4).map(|i| q[i].re() * pivot[i].re()).sum();
        let weight = if along >= 0.0 { w[k] } else { -w[k] };
        let shifted = product([zero, x(6 * k + 3), x(6 * k + 4), x(6 * k + 5)], q);
        for i in 0..4 {
            real[i] += q[i] * weight;
            dual[i] += shifted[i] * (0.5 * weight);
        }
    }
    let length = (real[0] * real[0] + real[1] * real[1] + real[2] * real[2] + real[3] * real[3]).sqrt();
    let (real, dual) = (real.map(|q| q / length), dual.map(|q| q / length));
    let conjugate = [real[0], -real[1], -real[2], -real[3]];
    let turned = |p: &[f64; 3]| product(product(real, [zero, D::from(p[0]), D::from(p[1]), D::from(p[2])]), conjugate);
    let (point, normal, shift) = (turned(v), turned(n), product(dual, conjugate));
    (1..4).map(|i| normal[i] * (point[i] + shift[i] * 2.0 - u[i - 1])).fold(zero, |sum, one| sum + one)
}

fn main() {
    println!("level {}, {:?}", energy_dsl::level(), AngleConvention::default());
    measure(5_000, 241, 4);
    measure(60_000, 1000, 8);
}
