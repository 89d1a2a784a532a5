//! Batches of any size give the results of single elements.

#![allow(mixed_script_confusables)]

use energy_dsl::energy;
use energy_dsl::{Batches, Hessians, Packed, PackedPotential, Potential, available, dispatch_at};

energy! {
    energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) { k / 2 * (norm(p - q) - L)^2 }
    energy Hinge(x1, x2, x3, x4: Point; k: Scalar[J], θ0: Scalar[rad]) {
        let θ = dihedral(x1, x2, x3, x4);
        k * (θ - θ0)^2
    }
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
