//! Plate bending: exact for quadratic height fields on every mesh, with correct derivatives.

use cloth_core::physics::fabric::plate::curvatures;
use cloth_core::physics::fabric::{PlateTerm, Rigidity};
use cloth_core::physics::mesh::{Topology, TriangleMesh};
use cloth_core::validate::{MeshKind, Strip};
use energy_dsl::{Potential, Vector3};
use energy_elements::{ArcAngle, PlateBending};
use energy_solve::{Curvature, LinearisationOptions, State, System, Weights};

const WOVEN: Rigidity = Rigidity::Orthotropic { warp: 3.0, weft: 1.0, bias: 1.4, poisson_ratio: 0.2 };

fn sheet(kind: MeshKind, orientation: f64) -> TriangleMesh {
    Strip { kind, orientation, length: 1.0, width: 0.9, spacing: 0.1, clamped: false }.mesh().unwrap()
}

/// A quadratic height field of small slope.
fn lifted(mesh: &TriangleMesh, [xx, yy, xy]: [f64; 3]) -> Vec<Vector3<f64>> {
    let height = |p: &Vector3<f64>| 1e-6 * (0.5 * xx * p[0] * p[0] + 0.5 * yy * p[1] * p[1] + 0.5 * xy * p[0] * p[1]);
    mesh.vertices().iter().map(|p| [p[0], p[1], height(p)]).collect()
}

fn angles(topology: &Topology, x: &[Vector3<f64>]) -> Vec<f64> {
    let angle = ArcAngle::<f64>::new();
    topology.hinges.iter().map(|hinge| angle.value(&hinge.vertices.map(|vertex| x[vertex])).value).collect()
}

#[test]
fn quadratic_height_fields_have_their_curvature_on_every_triangle_of_every_mesh() {
    for kind in MeshKind::ALL {
        for orientation in [0.0, 30.0, 45.0] {
            let mesh = sheet(kind, orientation);
            let topology = Topology::of(&mesh);
            let curvatures = curvatures(&mesh, &topology, Some([1.0, 0.0, 0.0].into())).unwrap();
            let inner: Vec<_> = curvatures.iter().filter(|one| one.free.is_empty()).collect();
            assert!(inner.len() > 100);
            for field in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                let angles = angles(&topology, &lifted(&mesh, field));
                // The dihedral angle is positive if the surface bends down.
                for one in &inner {
                    for k in 0..3 {
                        let found: f64 = one.angles.iter().map(|(hinge, b)| -1e6 * b[k] * angles[*hinge]).sum();
                        assert!((found - field[k]).abs() < 1e-4, "{kind:?} {orientation}°: {found} for {}", field[k]);
                    }
                }
            }
        }
    }
}

#[test]
fn constant_curvature_exerts_no_force_on_interior_vertices() {
    for kind in MeshKind::ALL {
        let mesh = sheet(kind, 20.0);
        let term = PlateTerm::new("bending", &mesh, &WOVEN, [1.0, 0.0, 0.0]).unwrap();
        let mut system = System::new(vec![Box::new(term)], &vec![false; mesh.vertices().len()]).unwrap();
        let still = vec![[0.0; 3]; mesh.vertices().len()];
        for field in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, -0.7, 0.4]] {
            let x = lifted(&mesh, field);
            let force = system.forces(State { x: &x, v: &still }).unwrap();
            let largest = force.iter().map(|f| f[2].abs()).fold(0.0, f64::max);
            let inside = |p: &Vector3<f64>| (0.35..0.65).contains(&p[0]) && (0.35..0.55).contains(&p[1]);
            let inner: Vec<f64> =
                mesh.vertices().iter().zip(&force).filter(|(p, _)| inside(p)).map(|(_, f)| f[2].abs()).collect();
            assert!(inner.len() >= 4);
            let worst = inner.into_iter().fold(0.0, f64::max);
            assert!(worst < 1e-4 * largest, "{kind:?}, {field:?}: {worst:e} of {largest:e} N");
        }
    }
}

/// A triangle with its three neighbours, creased at rest; and a differently bent state.
fn star() -> (TriangleMesh, Vec<Vector3<f64>>) {
    let h = 0.75_f64.sqrt();
    let flat = [[0.0, 0.0], [1.0, 0.0], [0.5, h], [1.5, h], [-0.5, h], [0.5, -h]];
    let rest = flat.map(|[x, y]| [x, y, 0.1 * x * y]).to_vec();
    let bent = flat.map(|[x, y]| [x - 0.1 * y, y, 0.3 * x * x - 0.2 * y * y + 0.1 * x]).to_vec();
    let mesh = TriangleMesh::new(rest, vec![[0, 1, 2], [2, 1, 3], [0, 2, 4], [1, 0, 5]]).unwrap();
    (mesh, bent)
}

#[test]
fn on_a_lattice_it_equals_the_declared_element() {
    let h = 0.75_f64.sqrt();
    let (_, bent) = star();
    let rest: Vec<Vector3<f64>> =
        [[0.0, 0.0], [1.0, 0.0], [0.5, h], [1.5, h], [-0.5, h], [0.5, -h]].map(|[x, y]| [x, y, 0.0]).to_vec();
    let mesh = TriangleMesh::new(rest.clone(), vec![[0, 1, 2], [2, 1, 3], [0, 2, 4], [1, 0, 5]]).unwrap();
    let topology = Topology::of(&mesh);
    let one = &curvatures(&mesh, &topology, None).unwrap()[0];
    let angles = angles(&topology, &bent);
    let kappa: [f64; 3] = std::array::from_fn(|k| one.angles.iter().map(|(hinge, b)| b[k] * angles[*hinge]).sum());
    let (rigidity, nu) = (2.0, 0.3);
    let d = Rigidity::Flexural { rigidity, poisson_ratio: nu }.matrix().unwrap();
    let energy: f64 = (0..3)
        .flat_map(|i| (0..3).map(move |j| (i, j)))
        .map(|(i, j)| 0.5 * one.area * kappa[i] * d[i][j] * kappa[j])
        .sum();
    // x₀ x₁ x₂, then the corners opposite each.
    let order = [0, 1, 2, 3, 4, 5];
    let [x0, x1, x2, y0, y1, y2] = order.map(|vertex| rest[vertex]);
    let element = PlateBending::new(x0, x1, x2, y0, y1, y2, nu * rigidity, 0.5 * (1.0 - nu) * rigidity).unwrap();
    let declared = element.value(&order.map(|vertex| bent[vertex])).value;
    assert!((energy / declared - 1.0).abs() < 1e-12, "{energy} {declared}");
}

#[test]
fn forces_and_hessians_are_derivatives_of_the_energy() {
    let (mesh, bent) = star();
    let random = sheet(MeshKind::Random, 0.0);
    let wavy = random.vertices().iter().map(|p| [p[0], 1.1 * p[1], 0.05 * (9.0 * p[0] + 5.0 * p[1]).sin()]).collect();
    for (mesh, x) in [(mesh, bent), (random, wavy)] {
        let count = mesh.vertices().len();
        let term = PlateTerm::new("bending", &mesh, &WOVEN, [1.0, 0.0, 0.0]).unwrap();
        let mut pinned = vec![false; count];
        pinned[1] = true;
        let mut system = System::new(vec![Box::new(term)], &pinned).unwrap();
        let still = vec![[0.0; 3]; count];
        let v: Vec<Vector3<f64>> = (0..count).map(|i| [0.3, (i as f64).sin(), (2.0 * i as f64).cos()]).collect();
        let mut matrix = system.matrix();
        let weights = Weights { position: 1.0, velocity: 0.0 };
        let mut options = LinearisationOptions::new(weights, Curvature::Exact).with_stiffness_times_velocity(true);
        let linear = system.linearise(State { x: &x, v: &v }, options, &mut matrix).unwrap();
        let scale = linear.force.as_flattened().iter().fold(0.0_f64, |scale, f| scale.max(f.abs()));
        let free = system.dofs().free().to_vec();
        let mut moving = v.clone();
        moving[1] = [0.0; 3];
        let mut product = vec![[0.0; 3]; free.len()];
        matrix.multiply(&system.dofs().gather(&moving), &mut product);
        let step = 1e-5;
        let stepped = |steps: f64| -> Vec<Vector3<f64>> {
            x.iter().zip(&moving).map(|(x, v)| std::array::from_fn(|axis| x[axis] + steps * step * v[axis])).collect()
        };
        let (after, before) = (stepped(1.0), stepped(-1.0));
        let mut energy = |steps: f64| system.energies(&stepped(steps)).unwrap()[0].energy.unwrap();
        // Extrapolated central differences, because the energy of a fine mesh is strongly curved.
        let (whole, half) = ((energy(1.0) - energy(-1.0)) / (2.0 * step), (energy(0.5) - energy(-0.5)) / step);
        let slope = (4.0 * half - whole) / 3.0;
        let power: f64 = linear.force.iter().zip(&moving).map(|(f, v)| (0..3).map(|k| f[k] * v[k]).sum::<f64>()).sum();
        assert!((slope + power).abs() < 1e-6 * power.abs().max(scale), "{slope} {power}");
        let forces = |system: &mut System, x: &[Vector3<f64>]| system.forces(State { x, v: &still }).unwrap();
        let (after, before) = (forces(&mut system, &after), forces(&mut system, &before));
        let largest = product.as_flattened().iter().fold(0.0_f64, |largest, f| largest.max(f.abs()));
        for (&vertex, found) in free.iter().zip(&product) {
            for axis in 0..3 {
                let expected = (after[vertex][axis] - before[vertex][axis]) / (2.0 * step);
                assert!((found[axis] - expected).abs() < 1e-5 * largest, "{vertex}: {} {expected}", found[axis]);
            }
        }
        // Without pins, the product with the velocities must agree.
        let mut whole = vec![[0.0; 3]; free.len()];
        options.curvature = Curvature::Exact;
        let along = system.linearise(State { x: &x, v: &moving }, options, &mut matrix).unwrap();
        matrix.multiply(&system.dofs().gather(&moving), &mut whole);
        for (&vertex, found) in free.iter().zip(&whole) {
            for axis in 0..3 {
                let other = along.stiffness_times_velocity[vertex][axis];
                assert!((found[axis] - other).abs() < 1e-10 * largest, "{vertex}: {} {other}", found[axis]);
            }
        }
        // With clamped curvature, −∂f/∂x is positive semi-definite.
        options.curvature = Curvature::Clamped;
        system.linearise(State { x: &x, v: &still }, options, &mut matrix).unwrap();
        matrix.multiply(&system.dofs().gather(&moving), &mut whole);
        let quadratic: f64 =
            free.iter().zip(&whole).map(|(&i, f)| (0..3).map(|k| f[k] * moving[i][k]).sum::<f64>()).sum();
        assert!(quadratic < 0.0);
    }
}

#[test]
fn a_creased_sheet_is_at_rest_in_its_own_shape() {
    let (mesh, _) = star();
    let term = PlateTerm::new("bending", &mesh, &WOVEN, [1.0, 0.0, 0.0]).unwrap();
    let mut system = System::new(vec![Box::new(term)], &[false; 6]).unwrap();
    let force = system.forces(State { x: mesh.vertices(), v: &[[0.0; 3]; 6] }).unwrap();
    assert!(force.as_flattened().iter().all(|f| f.abs() < 1e-14), "{force:?}");
}

#[test]
fn a_warp_across_the_cloth_is_rejected() {
    let (mesh, _) = star();
    let flat =
        TriangleMesh::new(mesh.vertices().iter().map(|p| [p[0], p[1], 0.0]).collect(), mesh.triangles().to_vec());
    let error = PlateTerm::new("bending", &flat.unwrap(), &WOVEN, [0.0, 0.0, 1.0]).unwrap_err();
    let words = "triangle 0 stands across the warp direction [0.0, 0.0, 1.0]; choose a warp direction along the cloth";
    assert!(error.to_string().starts_with(words), "{error}");
}

/// The plate of hysteresis is elastic up to its moment, and yields there, in every direction on every mesh.
#[test]
fn a_plate_that_yields_stores_the_energy_of_its_moment_and_unloads_elastically() {
    let (moment, yielding) = (2e-6, 1e-7);
    let rigidity = Rigidity::Flexural { rigidity: moment / yielding, poisson_ratio: 0.0 };
    for kind in MeshKind::ALL {
        let mesh = sheet(kind, 20.0);
        let topology = Topology::of(&mesh);
        let curvatures = curvatures(&mesh, &topology, None).unwrap();
        let still = vec![[0.0; 3]; mesh.vertices().len()];
        // A cylinder about an axis at 30°, with curvatures relative to 10⁻⁶/m.
        let (sine, cosine) = 30_f64.to_radians().sin_cos();
        let bent = |curvature: f64| {
            let amount = curvature / 1e-6;
            lifted(&mesh, [amount * cosine * cosine, amount * sine * sine, 2.0 * amount * sine * cosine])
        };
        let term = PlateTerm::new("hysteresis", &mesh, &rigidity, [1.0, 0.0, 0.0]).unwrap();
        let term = term.with_plastic_curvature(moment);
        let mut system = System::new(vec![Box::new(term)], &vec![false; mesh.vertices().len()]).unwrap();
        let mut check = |curvature: f64, elastic: f64, steps: bool| {
            let x = bent(curvature);
            if steps {
                system.end_step(State { x: &x, v: &still }).unwrap();
            }
            let (term, _) = system.terms().next().unwrap();
            for (triangle, energy) in term.element_energies(&x).unwrap() {
                let one = &curvatures[triangle];
                let exact = 0.5 * one.area * moment / yielding * elastic * elastic;
                let unit = 0.5 * one.area * moment * yielding;
                assert!(!one.free.is_empty() || (energy - exact).abs() < 1e-4 * unit, "{kind:?}: {energy} {exact}");
            }
        };
        check(0.5 * yielding, 0.5 * yielding, true);
        check(5.0 * yielding, yielding, true);
        check(4.0 * yielding, 0.0, false);
        check(2.0 * yielding, -yielding, true);
        // A checkpoint restores it.
        let histories = system.histories();
        assert_eq!(histories[0].len(), 3 * mesh.triangles().len());
        let term = PlateTerm::new("hysteresis", &mesh, &rigidity, [1.0, 0.0, 0.0]).unwrap();
        let term = term.with_plastic_curvature(moment);
        let mut restored = System::new(vec![Box::new(term)], &vec![false; mesh.vertices().len()]).unwrap();
        restored.restore_histories(&histories);
        let x = bent(3.0 * yielding);
        let energies = [&mut system, &mut restored].map(|one| one.energies(&x).unwrap()[0].energy);
        assert!(energies[0] == energies[1] && energies[0].is_some(), "{energies:?}");
    }
}
