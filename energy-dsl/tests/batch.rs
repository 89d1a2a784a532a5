//! Batches of any size give the results of single elements.

use energy_dsl::energy;
use energy_dsl::{
    BLOCK, BatchError, Batches, Float, ForceLaw, Hessians, Packed, PackedPotential, Potential, Real, Residual,
    available, dispatch_at,
};

energy! {
    energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) { k / 2 * (norm(p - q) - L)^2 }
    energy Hinge(x1, x2, x3, x4: Point; k: Scalar[J], θ0: Scalar[rad]) {
        let θ = dihedral(x1, x2, x3, x4);
        k * (θ - θ0)^2
    }
    force Drag(p, q: Point, v, w: Velocity; b: Scalar[kg/s]) {
        let d = p - q;
        let f = b * dot(v - w, d) / norm_squared(d) * d;
        [-f, f]
    }
    residual Circle(x: Scalar, y: Scalar, r: Scalar) { vector(sqrt(x^2 + y^2) - r, x * y) }
    energy Angle(x1, x2, x3, x4: Point) { dihedral(x1, x2, x3, x4) }
}

fn positions() -> Vec<[f64; 3]> {
    let number = |i: usize| (1.3 * i as f64).sin() * 2.0;
    (0..30).map(|i| [number(3 * i), number(3 * i + 1), number(3 * i + 2)]).collect()
}

/// Returns the stencils of `count` elements. In every seventh, all points coincide.
fn stencils<const N: usize>(count: usize) -> Vec<[u32; N]> {
    let point = |element: usize, point: usize| if element % 7 == 6 { 3 } else { (element * 5 + point * 4) as u32 % 30 };
    (0..count).map(|element| std::array::from_fn(|p| point(element, p))).collect()
}

fn check<E, const N: usize, const TRIANGLE: usize>(element: impl Fn(usize) -> E)
where
    E: PackedPotential<f64> + Potential<f64, Points = [[f64; 3]; N], Triangle = [[[f64; 3]; 3]; TRIANGLE]>,
{
    let positions = positions();
    for level in available() {
        for count in 0..=35 {
            let elements: Vec<E> = (0..count).map(&element).collect();
            let stencils = stencils::<N>(count);
            let (mut energies, mut gradients) = (vec![0.0; count], vec![[[0.0; 3]; N]; count]);
            let mut triangles = vec![[[[0.0; 3]; 3]; TRIANGLE]; count];
            let mut work = Hessians {
                energies: &mut energies,
                gradients: gradients.as_flattened_mut().as_flattened_mut(),
                triangles: triangles.as_flattened_mut().as_flattened_mut().as_flattened_mut(),
                flagged: Vec::new(),
            };
            let packed = Packed::new(&elements, &stencils);
            let batches = Batches { elements: &packed, range: 0..packed.len(), positions: &positions, work: &mut work };
            dispatch_at(level, batches).expect("the level is available");
            let flagged: Vec<usize> = work.flagged.iter().map(|(element, _)| *element).collect();
            let mut expected_flags = Vec::new();
            for (i, element) in elements.iter().enumerate() {
                let points: [[f64; 3]; N] = stencils[i].map(|point| positions[point as usize]);
                let call = scalar::Hessian(element, &points);
                let expected = dispatch_at(level, call).expect("the level is available");
                let bits = |x: &[f64]| x.iter().map(|x| (x + 0.0).to_bits()).collect::<Vec<_>>();
                assert_eq!(energies[i].to_bits(), expected.value.to_bits());
                assert_eq!(bits(gradients[i].as_flattened()), bits(expected.gradient.as_flattened()));
                let triangle = bits(triangles[i].as_flattened().as_flattened());
                assert_eq!(triangle, bits(expected.hessian.as_flattened().as_flattened()), "{level} {i}");
                if expected.flags.any() {
                    expected_flags.push(i);
                }
            }
            assert_eq!(flagged, expected_flags);
        }
    }
}

mod scalar {
    use energy_dsl::{Kernel, Level, Potential};

    /// The call of a scalar routine at a level.
    pub struct Hessian<'a, E: Potential<f64>>(pub &'a E, pub &'a E::Points);

    impl<E: Potential<f64>> Kernel for Hessian<'_, E> {
        type Output = energy_dsl::Hessian<f64, E::Points, E::Triangle>;

        #[inline(always)]
        fn run<L: Level>(self) -> Self::Output {
            self.0.hessian_at::<L>(self.1)
        }
    }
}

#[test]
fn batches_of_springs_are_springs() {
    check::<_, 2, 3>(|i| Spring { k: 1.0 + i as f64, L: 0.1 * i as f64 });
}

#[test]
fn batches_of_hinges_are_hinges() {
    check::<_, 4, 10>(|i| Hinge { k: 1.0 + i as f64, θ0: 0.1 * i as f64 });
}

#[test]
fn batches_of_elements_without_parameters_are_such_elements() {
    check::<_, 4, 10>(|_| Angle::new());
}

#[test]
#[should_panic(expected = "every element needs a stencil")]
fn a_missing_stencil_is_noticed() {
    let _ = Packed::new::<2>(&[Spring { k: 1.0, L: 1.0 }], &[]);
}

#[test]
#[should_panic(expected = "point 8 of 5")]
fn a_missing_point_is_noticed() {
    let packed = Packed::new(&[Spring { k: 1.0, L: 1.0 }], &[[2, 7]]);
    let mut work =
        Hessians { energies: &mut [0.0; 1], gradients: &mut [0.0; 6], triangles: &mut [0.0; 27], flagged: Vec::new() };
    energy_dsl::for_each_batch(&packed, &[[0.0; 3]; 5], &mut work);
}

#[test]
fn replaced_elements_are_those_computed_with() {
    let spring = |i: usize| Spring { k: 1.0 + i as f64, L: 0.1 };
    let elements: Vec<Spring> = (0..19).map(spring).collect();
    let mut packed = Packed::new(&elements, &stencils::<2>(19));
    packed.set(18, &Spring { k: 7.0, L: 0.3 });
    packed.set(4, &Spring { k: 9.0, L: 0.2 });
    let mut changed = elements.clone();
    changed[18] = Spring { k: 7.0, L: 0.3 };
    changed[4] = Spring { k: 9.0, L: 0.2 };
    let energies = |packed: &Packed<Spring>| {
        let (mut energies, mut gradients, mut triangles) = (vec![0.0; 19], vec![0.0; 19 * 6], vec![0.0; 19 * 27]);
        let mut work = Hessians {
            energies: &mut energies,
            gradients: &mut gradients,
            triangles: &mut triangles,
            flagged: Vec::new(),
        };
        energy_dsl::for_each_batch(packed, &positions(), &mut work);
        energies
    };
    assert_eq!(energies(&packed), energies(&Packed::new(&changed, &stencils::<2>(19))));
}

/// The positions in another precision.
fn positions_in<S: Real>() -> Vec<[S; 3]> {
    positions().into_iter().map(|point| point.map(S::from_f64)).collect()
}

/// Returns ranges that begin at whole blocks and cover `count` elements: one, one block each, uneven ones.
fn partitions(count: usize) -> [Vec<std::ops::Range<usize>>; 3] {
    let blocks = (0..count).step_by(BLOCK).map(|start| start..(start + BLOCK).min(count)).collect();
    let whole = std::iter::once(0..count).collect();
    [whole, blocks, vec![0..2 * BLOCK, 2 * BLOCK..2 * BLOCK, 2 * BLOCK..count]]
}

/// Parts of outputs that belong to a range alone receive the results of single elements, in `S`.
fn check_potential<S: Float + PartialEq + Default>(spring: impl Fn(usize) -> Spring<S>) {
    let (count, x, stencils) = (43, positions_in::<S>(), stencils::<2>(43));
    let elements: Vec<Spring<S>> = (0..count).map(&spring).collect();
    let packed = Packed::new(&elements, &stencils);
    for ranges in partitions(count) {
        for range in ranges {
            let (mut energies, mut gradients) = (vec![S::default(); range.len()], vec![S::default(); 6 * range.len()]);
            let (mut triangles, mut values) = (vec![S::default(); 27 * range.len()], energies.clone());
            let flagged =
                packed.hessians(range.clone(), &x, &mut energies, &mut gradients, &mut triangles).expect("they fit");
            let expected: Vec<usize> = range.clone().filter(|element| element % 7 == 6).collect();
            assert_eq!(flagged.iter().map(|(element, _)| *element).collect::<Vec<_>>(), expected);
            packed.values(range.clone(), &x, &mut values).expect("they fit");
            assert!(values == energies);
            let mut forces = vec![S::default(); gradients.len()];
            let flagged = packed.gradients(range.clone(), &x, &mut values, &mut forces).expect("they fit");
            assert!(values == energies && forces == gradients);
            assert_eq!(flagged.len(), expected.len());
            for (place, element) in range.enumerate() {
                let points = stencils[element].map(|point| x[point as usize]);
                let single = elements[element].hessian(&points);
                assert!(single.value == energies[place]);
                assert!(single.gradient.as_flattened() == &gradients[6 * place..][..6]);
                assert!(single.hessian.as_flattened().as_flattened() == &triangles[27 * place..][..27]);
            }
        }
    }
}

#[test]
fn ranges_are_relative_to_their_outputs_in_both_precisions() {
    check_potential::<f64>(|i| Spring { k: 1.0 + i as f64, L: 0.1 * i as f64 });
    check_potential::<f32>(|i| Spring { k: 1.0 + i as f32, L: 0.1 * i as f32 });
}

#[test]
fn work_in_a_later_range_writes_from_its_first_place_on() {
    let packed = Packed::new(&[Spring { k: 1.0, L: 1.0 }; 40], &stencils::<2>(40));
    let (mut energies, mut gradients, mut triangles) = ([0.0; 16], [0.0; 96], [0.0; 432]);
    let mut work =
        Hessians { energies: &mut energies, gradients: &mut gradients, triangles: &mut triangles, flagged: Vec::new() };
    energy_dsl::for_each_batch_in(&packed, 16..32, &positions(), &mut work);
    let flagged: Vec<usize> = work.flagged.iter().map(|(element, _)| *element).collect();
    assert_eq!(flagged, [20, 27]);
    let mut expected = [0.0; 40];
    packed.values(0..40, &positions(), &mut expected).expect("they fit");
    assert_eq!(energies, expected[16..32]);
}

/// Forces and Jacobians in `S`.
fn check_force<S: Float + PartialEq + Default>(drag: impl Fn(usize) -> Drag<S>) {
    let (count, x, stencils) = (43, positions_in::<S>(), stencils::<2>(43));
    let v: Vec<[S; 3]> = x.iter().map(|&[a, b, c]| [c, a, b]).collect();
    let elements: Vec<Drag<S>> = (0..count).map(&drag).collect();
    let packed = Packed::new(&elements, &stencils);
    for range in partitions(count).concat() {
        let numbers = |each: usize| vec![S::default(); each * range.len()];
        let (mut alone, mut forces, mut by_position, mut by_velocity) =
            (numbers(6), numbers(6), numbers(36), numbers(36));
        packed
            .force_jacobians(range.clone(), &x, &v, &mut forces, &mut by_position, &mut by_velocity)
            .expect("they fit");
        packed.forces(range.clone(), &x, &v, &mut alone).expect("they fit");
        for (place, element) in range.enumerate().filter(|(_, element)| element % 7 != 6) {
            let [x, v] = [&x, &v].map(|all| stencils[element].map(|point| all[point as usize]));
            let single = elements[element].jacobians(&x, &v);
            assert!(single.force.as_flattened() == &forces[6 * place..][..6]);
            assert!(single.force.as_flattened() == &alone[6 * place..][..6]);
            assert!(single.by_position.as_flattened().as_flattened() == &by_position[36 * place..][..36]);
            assert!(single.by_velocity.as_flattened().as_flattened() == &by_velocity[36 * place..][..36]);
        }
    }
}

#[test]
fn batches_of_forces_are_forces_in_both_precisions() {
    check_force::<f64>(|i| Drag { b: 1.0 + i as f64 });
    check_force::<f32>(|i| Drag { b: 1.0 + i as f32 });
}

/// Residuals and Jacobians in `S`.
fn check_residual<S: Float + PartialEq + Default>(circle: impl Fn() -> Circle<S>) {
    let (count, unknowns) = (43, positions_in::<S>().concat());
    let stencils: Vec<[u32; 3]> = (0..count).map(|i| [i + 1, 2 * i % 89 + 1, 5 * i % 89 + 1]).collect();
    let elements: Vec<Circle<S>> = stencils.iter().map(|_| circle()).collect();
    let packed = Packed::new(&elements, &stencils);
    for range in partitions(count as usize).concat() {
        let numbers = |each: usize| vec![S::default(); each * range.len()];
        let (mut alone, mut residuals, mut jacobians) = (numbers(2), numbers(2), numbers(6));
        packed.jacobians(range.clone(), &unknowns, &mut residuals, &mut jacobians).expect("they fit");
        packed.residuals(range.clone(), &unknowns, &mut alone).expect("they fit");
        assert!(alone == residuals);
        for (place, element) in range.enumerate() {
            let single = elements[element].jacobian(&stencils[element].map(|unknown| unknowns[unknown as usize]));
            assert!(single.value == residuals[2 * place..][..2]);
            assert!(single.jacobian == jacobians[6 * place..][..6]);
        }
    }
}

#[test]
fn batches_of_residuals_are_residuals_in_both_precisions() {
    check_residual::<f64>(Circle::new);
    check_residual::<f32>(Circle::new);
}

#[test]
fn misfits_are_errors_with_their_numbers() {
    let packed = Packed::new(&[Spring { k: 1.0, L: 1.0 }; 40], &stencils::<2>(40));
    let (x, mut out) = (positions(), [0.0; 40]);
    let range = |range: std::ops::Range<usize>| BatchError::Range { range, elements: 40, block: BLOCK };
    assert_eq!(packed.values(8..40, &x, &mut out[8..]).unwrap_err(), range(8..40));
    assert_eq!(packed.values(0..41, &x, &mut out).unwrap_err(), range(0..41));
    let backwards = std::ops::Range { start: 32, end: 16 };
    assert_eq!(packed.values(backwards.clone(), &x, &mut []).unwrap_err(), range(backwards));
    let missing = packed.values(0..40, &x[..7], &mut out).unwrap_err();
    assert!(matches!(missing, BatchError::Missing { given: 7, .. }), "{missing}");
    let short = packed.values(16..40, &x, &mut out[..20]).unwrap_err();
    assert_eq!(short, BatchError::Output { of: "energies", needed: 24, given: 20 });
    assert_eq!(out, [0.0; 40]);
    let wrong = Packed::new(&[Spring { k: 1.0, L: 1.0 }], &[[0, 1, 2]]);
    assert_eq!(wrong.values(0..1, &x, &mut out[..1]).unwrap_err(), BatchError::Stencil { needed: 2, given: 3 });
    assert_eq!((packed.chunk_len(1), packed.chunk_len(2), packed.chunk_len(100)), (48, 32, 16));
}
