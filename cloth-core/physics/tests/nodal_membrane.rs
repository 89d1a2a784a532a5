use energy_dsl::Vector3;
use energy_solve::{BlockMatrix, Curvature, LinearisationOptions, State, System, Weights};

use cloth_physics::fabric::{
    Arap, BaraffWitkin, Bending, Fabric, Material, Membrane, Rigidity, Strain, Surroundings, Woven, terms,
};
use cloth_physics::mesh::{Diagonals, Plane, Sheet, SpringNetwork, TriangleMesh};

const NOTHING: Surroundings = Surroundings { gravity: [0.0; 3], drag: 0.0 };

/// A sheet of one square metre whose inner vertices are shifted at random.
fn irregular(cells: usize, seed: u64) -> TriangleMesh {
    let (diagonals, plane) = (Diagonals::Regular, Plane::Horizontal);
    let mesh = Sheet { cells: [cells; 2], size: [1.0; 2], diagonals, plane, pleats: None }.mesh().unwrap();
    let mut random = fastrand::Rng::with_seed(seed);
    let mut shift = |at: f64| if at.abs() < 0.49 { at + 0.4 * (random.f64() - 0.5) / cells as f64 } else { at };
    let vertices = mesh.vertices().iter().map(|&[x, y, z]| [shift(x), shift(y), z]).collect();
    TriangleMesh::new(vertices, mesh.triangles().to_vec()).unwrap()
}

/// Membranes of every kind, of 100 to 2,000 N/m, with almost no plate.
fn materials() -> Vec<Material> {
    let bending = Bending::Plate(Rigidity::Flexural { rigidity: 1e-9, poisson_ratio: 0.0 });
    let isotropic = || Membrane { stretch_stiffness: 1e3, poisson_ratio: 0.3, bending };
    vec![
        Material::Stvk(isotropic()),
        Material::NeoHookean(isotropic()),
        Material::StableNeoHookean(isotropic()),
        Material::StableNeoHookeanLog(isotropic()),
        Material::Arap(Arap { stretch_stiffness: 1e3, bending }),
        Material::OrthotropicStvk(Woven { warp: 2e3, weft: 700.0, bias: 100.0, poisson_ratio: 0.2, bending }),
        Material::BaraffWitkin(BaraffWitkin { stretch: 1e3, shear: 100.0, rest_stretch: [1.0; 2], bending }),
    ]
}

fn system(mesh: &TriangleMesh, material: Material, strain: Strain) -> System {
    let fabric = Fabric { strain, warp: [0.8, 0.6, 0.0].into(), ..Fabric::new(0.1, material) };
    let garment = terms(&fabric, mesh, &SpringNetwork::default(), &NOTHING).unwrap();
    System::new(garment.terms, &vec![false; mesh.vertices().len()]).unwrap()
}

fn energy(system: &mut System, x: &[Vector3<f64>]) -> f64 {
    system.energies(x).unwrap().iter().filter_map(|term| term.energy).sum()
}

fn linearised(system: &mut System, x: &[Vector3<f64>], curvature: Curvature) -> (Vec<Vector3<f64>>, BlockMatrix) {
    let still = vec![[0.0; 3]; x.len()];
    let mut matrix = system.matrix();
    let options = LinearisationOptions::new(Weights { position: -1.0, velocity: 0.0 }, curvature);
    let force = system.linearise(State { x, v: &still }, options, &mut matrix).unwrap().force.to_vec();
    (force, matrix)
}

/// Moves each vertex at random, after a rotation that leads out of the plane.
fn deformed(mesh: &TriangleMesh, size: f64, seed: u64) -> Vec<Vector3<f64>> {
    let mut random = fastrand::Rng::with_seed(seed);
    let turned =
        |&[x, y, z]: &Vector3<f64>| [0.8 * x - 0.6 * z, 0.48 * x + 0.6 * y + 0.64 * z, 0.36 * x - 0.8 * y + 0.48 * z];
    mesh.vertices().iter().map(|x| turned(x).map(|component| component + size * (random.f64() - 0.5))).collect()
}

#[test]
fn constant_strain_has_the_energy_of_plain_triangles() {
    let mesh = irregular(6, 1);
    let affine = |&[u, v, _]: &Vector3<f64>| [1.1 * u + 0.05 * v, 0.02 * u + 0.9 * v, 0.3 * u - 0.2 * v];
    let x: Vec<Vector3<f64>> = mesh.vertices().iter().map(affine).collect();
    for material in materials() {
        let [nodal, plain] = [Strain::Nodal, Strain::PerTriangle].map(|strain| {
            let mut system = system(&mesh, material.clone(), strain);
            (energy(&mut system, &x), linearised(&mut system, &x, Curvature::Exact).0)
        });
        assert!((nodal.0 / plain.0 - 1.0).abs() < 1e-12, "{material:?}: {} for {}", nodal.0, plain.0);
        let largest = plain.1.as_flattened().iter().fold(0.0_f64, |largest, f| largest.max(f.abs()));
        for (a, b) in nodal.1.as_flattened().iter().zip(plain.1.as_flattened()) {
            assert!((a - b).abs() < 1e-12 * largest, "{material:?}: {a} for {b}");
        }
    }
}

#[test]
fn derivatives_are_those_of_the_energy() {
    let mesh = irregular(4, 2);
    for (number, material) in materials().into_iter().enumerate() {
        let mut system = system(&mesh, material.clone(), Strain::Nodal);
        let x = deformed(&mesh, 0.05, number as u64);
        let (force, matrix) = linearised(&mut system, &x, Curvature::Exact);
        let scale = force.as_flattened().iter().fold(0.0_f64, |largest, f| largest.max(f.abs()));
        let mut random = fastrand::Rng::with_seed(7);
        for _ in 0..4 {
            let direction: Vec<Vector3<f64>> = x.iter().map(|_| [0; 3].map(|_: i32| random.f64() - 0.5)).collect();
            let moved = |by: f64| -> Vec<Vector3<f64>> {
                let one = |(x, d): (&Vector3<f64>, &Vector3<f64>)| std::array::from_fn(|axis| x[axis] + by * d[axis]);
                x.iter().zip(&direction).map(one).collect()
            };
            let step = 1e-5;
            let slope = (energy(&mut system, &moved(step)) - energy(&mut system, &moved(-step))) / (2.0 * step);
            let exact: f64 =
                -force.as_flattened().iter().zip(direction.as_flattened()).map(|(f, d)| f * d).sum::<f64>();
            assert!((slope - exact).abs() < 1e-7 * scale, "{material:?}: {slope} for {exact}");
            let mut product = vec![[0.0; 3]; x.len()];
            matrix.multiply(&direction, &mut product);
            let [after, before] = [step, -step].map(|by| linearised(&mut system, &moved(by), Curvature::Exact).0);
            let largest = product.as_flattened().iter().fold(0.0_f64, |largest, f| largest.max(f.abs()));
            for vertex in 0..x.len() {
                for axis in 0..3 {
                    let difference = (before[vertex][axis] - after[vertex][axis]) / (2.0 * step);
                    let exact = product[vertex][axis];
                    assert!((difference - exact).abs() < 1e-6 * largest, "{material:?}: {difference} for {exact}");
                }
            }
        }
    }
}

#[test]
fn matrices_with_both_triangles_hold_the_same_hessian() {
    let mesh = irregular(4, 9);
    let x = deformed(&mesh, 0.05, 3);
    let bending = Bending::BridsonForce { stiffness: 1e-3, damping: 1e-4 };
    let woven = Woven { warp: 2e3, weft: 700.0, bias: 100.0, poisson_ratio: 0.2, bending };
    let mut system = system(&mesh, Material::OrthotropicStvk(woven), Strain::Nodal);
    assert!(!system.character().symmetric);
    let (_, matrix) = linearised(&mut system, &x, Curvature::Exact);
    let mut random = fastrand::Rng::with_seed(7);
    let direction: Vec<Vector3<f64>> = x.iter().map(|_| [0; 3].map(|_: i32| random.f64() - 0.5)).collect();
    let mut product = vec![[0.0; 3]; x.len()];
    matrix.multiply(&direction, &mut product);
    let [after, before] = [1e-5, -1e-5].map(|by| {
        let one = |(x, d): (&Vector3<f64>, &Vector3<f64>)| std::array::from_fn(|axis| x[axis] + by * d[axis]);
        let moved: Vec<Vector3<f64>> = x.iter().zip(&direction).map(one).collect();
        linearised(&mut system, &moved, Curvature::Exact).0
    });
    let largest = product.as_flattened().iter().fold(0.0_f64, |largest, f| largest.max(f.abs()));
    for (exact, (after, before)) in
        product.as_flattened().iter().zip(after.as_flattened().iter().zip(before.as_flattened()))
    {
        assert!(((before - after) / 2e-5 - exact).abs() < 1e-6 * largest, "{before}, {after} for {exact}");
    }
}

/// A quarter of a tube, whose triangles start at any of their corners.
fn tube(cells: usize, first_corner: impl Fn(usize) -> usize) -> TriangleMesh {
    let flat = irregular(cells, 3);
    let roll = |&[x, y, _]: &Vector3<f64>| [x.sin(), y, 1.0 - x.cos()];
    let turned = |(number, &[a, b, c]): (usize, &[usize; 3])| [[a, b, c], [b, c, a], [c, a, b]][first_corner(number)];
    let triangles = flat.triangles().iter().enumerate().map(turned).collect();
    TriangleMesh::new(flat.vertices().iter().map(roll).collect(), triangles).unwrap()
}

#[test]
fn isotropic_membranes_have_no_preferred_corner() {
    let meshes = [tube(5, |_| 0), tube(5, |triangle| triangle * 7 % 3)];
    let x = deformed(&meshes[0], 0.05, 5);
    for material in materials().into_iter().take(5) {
        let [first, second] =
            [0, 1].map(|mesh| energy(&mut system(&meshes[mesh], material.clone(), Strain::Nodal), &x));
        assert!((first / second - 1.0).abs() < 1e-12, "{material:?}: {first} and {second}");
    }
    // The rest shape is at rest.
    let mut stvk = system(&meshes[1], materials().remove(0), Strain::Nodal);
    assert!(energy(&mut stvk, meshes[1].vertices()).abs() < 1e-20);
}

#[test]
fn clamped_hessians_have_no_negative_curvature() {
    let mesh = irregular(4, 4);
    // Compressed by a third, and bent.
    let crushed: Vec<Vector3<f64>> = deformed(&mesh, 0.1, 1).iter().map(|x| x.map(|c| 0.66 * c)).collect();
    for material in materials() {
        let mut system = system(&mesh, material.clone(), Strain::Nodal);
        let [exact, clamped] = [Curvature::Exact, Curvature::Clamped].map(|curvature| {
            let (_, matrix) = linearised(&mut system, &crushed, curvature);
            let mut random = fastrand::Rng::with_seed(3);
            let mut least = f64::INFINITY;
            for _ in 0..200 {
                let direction: Vec<Vector3<f64>> = crushed
                    .iter()
                    .map(|_| [random.f64() - 0.5, random.f64() - 0.5, 4.0 * (random.f64() - 0.5)])
                    .collect();
                let mut product = vec![[0.0; 3]; direction.len()];
                matrix.multiply(&direction, &mut product);
                let bend: f64 = product.as_flattened().iter().zip(direction.as_flattened()).map(|(p, d)| p * d).sum();
                least = least.min(bend);
            }
            least
        });
        assert!(clamped >= 0.0 && exact < clamped, "{material:?}: {exact} and {clamped}");
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let mesh = irregular(40, 6);
    let x = deformed(&mesh, 0.002, 8);
    for material in [materials().remove(1), materials().remove(6)] {
        let [alone, others @ ..] = [1, 2, 3].map(|threads| {
            let mut system = system(&mesh, material.clone(), Strain::Nodal);
            system.set_threads(threads);
            let energy = energy(&mut system, &x);
            let mut matrix = system.matrix();
            let weights = Weights { position: -1.0, velocity: 0.0 };
            let mut options = LinearisationOptions::new(weights, Curvature::Clamped);
            options.stiffness_times_velocity = true;
            let linear = system.linearise(State { x: &x, v: &x }, options, &mut matrix).unwrap();
            let mut product = vec![[0.0; 3]; x.len()];
            matrix.multiply(&x, &mut product);
            (energy, linear.force.to_vec(), linear.stiffness_times_velocity.to_vec(), product)
        });
        assert!(alone.2.as_flattened().iter().any(|rate| rate.abs() > 0.0));
        others.iter().for_each(|other| assert!(*other == alone, "{material:?}"));
    }
}
