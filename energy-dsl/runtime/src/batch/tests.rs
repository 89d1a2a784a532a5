//! Batches of an element that is written by hand.

use std::borrow::Cow;
use std::ops::Range;

use super::*;
use crate::declaration::{Declaration, Kind};
use crate::element::{
    Block, Element, ForceLaw, Inputs, MixedPotential, Outputs, Potential, ReducedPotential, Residual, RestError,
    Vector3,
};
use crate::numbers::{Flags, Lane, Level, Real};
use crate::results::{
    ForceJacobians, ForceValue, Gradient, Hessian, MixedGradient, MixedHessian, MixedProduct, ReducedHessian,
    ResidualJacobian, ResidualValue, Value,
};

/// U = k/2 ‖x₀ − x₁‖² + l, degenerate where the points coincide. As a force, −∂U/∂x − (v₀ − v₁) on the first point. As
/// a residual, (k u₀ − u₁, u₀ u₁). As a potential of two scalars, k u₀² u₁ + l, with a kink where they are equal.
#[derive(Clone, Copy)]
struct Spring<T>(T, T);

static SPRING: Declaration = Declaration {
    name: Cow::Borrowed("Spring"),
    kind: Kind::Energy,
    docs: Cow::Borrowed(""),
    formula: Cow::Borrowed(""),
    source: Cow::Borrowed(""),
    points: Cow::Borrowed(&[]),
    rest: Cow::Borrowed(&[]),
    parameters: Cow::Borrowed(&[]),
    state: Cow::Borrowed(&[]),
    rows: 1,
    properties: Cow::Borrowed(&[]),
    translation_invariant: true,
    curved: true,
    quadratic: true,
    velocity_dependent: true,
    symmetric: true,
    reduced_coordinates: 3,
    reduced_vectors: Cow::Borrowed(&[]),
    dihedral: None,
    primitives: Cow::Borrowed(&[]),
    routines: Cow::Borrowed(&[]),
};

impl<T: Real> Element for Spring<T> {
    const DECLARATION: &'static Declaration = &SPRING;
    type Over<S: Real> = Spring<S>;

    fn evaluate<S: Real>(_: &Inputs<'_, S>) -> Result<Outputs<S>, RestError> {
        unreachable!("batches do not use it")
    }
}

impl<T: Real> Spring<T> {
    fn difference([p, q]: &[Vector3<T>; 2]) -> Vector3<T> {
        [0, 1, 2].map(|axis| p[axis] - q[axis])
    }

    /// Returns a multiple of the identity.
    fn diagonal(by: T) -> Block<T> {
        [0, 1, 2].map(|row| [0, 1, 2].map(|column| if row == column { by } else { T::from_f64(0.0) }))
    }
}

impl<T: Real> Potential<T> for Spring<T> {
    type Points = [Vector3<T>; 2];
    type Triangle = [Block<T>; 3];

    fn value(&self, x: &Self::Points) -> Value<T> {
        let Gradient { value, flags, .. } = Potential::gradient(self, x);
        Value { value, flags }
    }

    fn gradient(&self, x: &Self::Points) -> Gradient<T, Self::Points> {
        let d = Self::difference(x);
        let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        let flags = Flags { degenerate: square.equal(T::from_f64(0.0)), ..Flags::clear() };
        let value = T::from_f64(0.5) * self.0 * square + self.1;
        Gradient { value, gradient: [d.map(|c| self.0 * c), d.map(|c| -self.0 * c)], flags }
    }

    fn hessian(&self, x: &Self::Points) -> Hessian<T, Self::Points, Self::Triangle> {
        let Gradient { value, gradient, flags } = Potential::gradient(self, x);
        Hessian { value, gradient, hessian: [self.0, -self.0, self.0].map(Self::diagonal), flags }
    }
}

impl<T: Real> ReducedPotential<T> for Spring<T> {
    type Coordinates = [T; 3];
    type Upper = [T; 6];

    fn reduced_hessian(&self, _: &Self::Points) -> ReducedHessian<T, [T; 3], [T; 6]> {
        unreachable!("batches do not use it")
    }

    fn expand<L: Level, const FREE: u32>(
        _: &ReducedHessian<T, [T; 3], [T; 6]>,
    ) -> Hessian<T, Self::Points, Self::Triangle> {
        unreachable!("batches do not use it")
    }
}

impl<T: Real> ForceLaw<T> for Spring<T> {
    type Points = [Vector3<T>; 2];
    type Square = [Block<T>; 4];

    fn force(&self, x: &Self::Points, v: &Self::Points) -> ForceValue<T, Self::Points> {
        let ForceJacobians { force, flags, .. } = self.jacobians(x, v);
        ForceValue { force, flags }
    }

    fn jacobians(&self, x: &Self::Points, v: &Self::Points) -> ForceJacobians<T, Self::Points, Self::Square> {
        let (Gradient { gradient, flags, .. }, w) = (Potential::gradient(self, x), Self::difference(v));
        let one = T::from_f64(1.0);
        let force =
            [[0, 1, 2].map(|axis| -gradient[0][axis] - w[axis]), [0, 1, 2].map(|axis| -gradient[1][axis] + w[axis])];
        let by_position = [-self.0, self.0, self.0, -self.0].map(Self::diagonal);
        ForceJacobians { force, by_position, by_velocity: [-one, one, one, -one].map(Self::diagonal), flags }
    }
}

impl<T: Real> Residual<T> for Spring<T> {
    type Unknowns = [T; 2];
    type Rows = [T; 2];
    type Jacobian = [T; 4];

    fn residual(&self, u: &[T; 2]) -> ResidualValue<T, [T; 2]> {
        let ResidualJacobian { value, flags, .. } = self.jacobian(u);
        ResidualValue { value, flags }
    }

    fn jacobian(&self, &[a, b]: &[T; 2]) -> ResidualJacobian<T, [T; 2], [T; 4]> {
        let flags = Flags { kink: a.equal(b), ..Flags::clear() };
        ResidualJacobian { value: [self.0 * a - b, a * b], jacobian: [self.0, T::from_f64(-1.0), b, a], flags }
    }
}

impl<T: Real> MixedPotential<T> for Spring<T> {
    type Unknowns = [T; 2];
    type Increments = [T; 2];
    type Upper = [T; 3];

    fn value(&self, u: &[T; 2]) -> Value<T> {
        let MixedHessian { value, flags, .. } = MixedPotential::hessian(self, u);
        Value { value, flags }
    }

    fn value_at<L: Level>(&self, u: &[T; 2]) -> Value<T> {
        MixedPotential::value(self, u)
    }

    fn gradient(&self, u: &[T; 2]) -> MixedGradient<T, [T; 2]> {
        let MixedHessian { value, gradient, flags, .. } = MixedPotential::hessian(self, u);
        MixedGradient { value, gradient, flags }
    }

    fn gradient_at<L: Level>(&self, u: &[T; 2]) -> MixedGradient<T, [T; 2]> {
        MixedPotential::gradient(self, u)
    }

    fn hessian(&self, &[a, b]: &[T; 2]) -> MixedHessian<T, [T; 2], [T; 3]> {
        let (k, zero, flags) = (self.0, T::from_f64(0.0), Flags { kink: a.equal(b), ..Flags::clear() });
        let (gradient, hessian) = ([(k + k) * a * b, k * a * a], [(k + k) * b, (k + k) * a, zero]);
        MixedHessian { value: k * a * a * b + self.1, gradient, hessian, flags }
    }

    fn hessian_at<L: Level>(&self, u: &[T; 2]) -> MixedHessian<T, [T; 2], [T; 3]> {
        MixedPotential::hessian(self, u)
    }

    fn hessian_vector(&self, _: &[T; 2], _: &[T; 2]) -> MixedProduct<T, [T; 2]> {
        unreachable!("batches do not use it")
    }

    fn hessian_vector_at<L: Level>(&self, _: &[T; 2], _: &[T; 2]) -> MixedProduct<T, [T; 2]> {
        unreachable!("batches do not use it")
    }
}

impl Stored<f64> for Spring<f64> {
    const NUMBERS: usize = 2;

    fn store(&self, numbers: &mut [f64], stride: usize) {
        (numbers[0], numbers[stride]) = (self.0, self.1);
    }
}

macro_rules! packed {
    ($($name:ident)*) => {
        $(impl $name<f64> for Spring<f64> {
            type Wide<V: Lane<f64>> = Spring<V>;

            fn load<V: Lane<f64>>(numbers: &[f64], stride: usize) -> Spring<V> {
                Spring(V::load(numbers), V::load(&numbers[stride..]))
            }
        })*
    };
}

packed!(PackedPotential PackedForce PackedResidual PackedMixed);

/// Enough springs for three blocks, of which the last is not full. Spring 20 and the last one have one point twice.
const COUNT: usize = 37;
const FLAGGED: [usize; 2] = [20, COUNT - 1];

fn springs() -> (Vec<Spring<f64>>, Vec<[u32; 2]>) {
    let spring = |number: usize| Spring(2.0 + number as f64, 0.25 * number as f64);
    let stencil =
        |number: usize| [number as u32, if FLAGGED.contains(&number) { number } else { 2 * number + 1 } as u32];
    ((0..COUNT).map(spring).collect(), (0..COUNT).map(stencil).collect())
}

/// Places or velocities of all points, with few bits, so that no result is rounded.
fn vectors(seed: u64) -> Vec<Vector3<f64>> {
    let mut random = fastrand::Rng::with_seed(seed);
    (0..2 * COUNT).map(|_| [0; 3].map(|_| f64::from(random.i32(-100..100)))).collect()
}

/// The ranges to evaluate: all, single blocks, and ranges that end within a block.
const RANGES: [Range<usize>; 6] = [0..COUNT, 0..16, 16..32, 16..COUNT, 32..34, 16..16];

fn indices(flagged: &Flagged) -> Vec<usize> {
    assert!(flagged.iter().all(|(_, flags)| flags.degenerate != flags.kink));
    flagged.iter().map(|(index, _)| *index).collect()
}

fn flagged_in(range: &Range<usize>) -> Vec<usize> {
    FLAGGED.into_iter().filter(|index| range.contains(index)).collect()
}

#[test]
fn potentials_are_those_of_single_elements() {
    let ((springs, stencils), x) = (springs(), vectors(1));
    let packed = Packed::new(&springs, &stencils);
    for range in RANGES {
        let n = range.len();
        let (mut energies, mut gradients, mut triangles) = (vec![0.0; n], vec![0.0; 6 * n], vec![0.0; 27 * n]);
        let flagged = packed.hessians(range.clone(), &x, &mut energies, &mut gradients, &mut triangles).unwrap();
        assert_eq!(indices(&flagged), flagged_in(&range));
        let (mut again, mut energies_alone) = (vec![0.0; 6 * n], vec![0.0; n]);
        packed.gradients(range.clone(), &x, &mut energies_alone, &mut again).unwrap();
        assert_eq!((&energies_alone, &again), (&energies, &gradients));
        energies_alone.fill(0.0);
        packed.values(range.clone(), &x, &mut energies_alone).unwrap();
        assert_eq!(energies_alone, energies);
        for (place, index) in range.enumerate() {
            let points = stencils[index].map(|point| x[point as usize]);
            let single = Potential::hessian(&springs[index], &points);
            assert_eq!(energies[place], single.value);
            assert_eq!(gradients[6 * place..][..6], *single.gradient.as_flattened());
            assert_eq!(triangles[27 * place..][..27], *single.hessian.as_flattened().as_flattened());
        }
    }
}

#[test]
fn forces_are_those_of_single_elements() {
    let ((springs, stencils), x, v) = (springs(), vectors(1), vectors(2));
    let packed = Packed::new(&springs, &stencils);
    for range in RANGES {
        let n = range.len();
        let (mut forces, mut by_position, mut by_velocity) = (vec![0.0; 6 * n], vec![0.0; 36 * n], vec![0.0; 36 * n]);
        let all = range.clone();
        let flagged = packed.force_jacobians(all, &x, &v, &mut forces, &mut by_position, &mut by_velocity).unwrap();
        assert_eq!(indices(&flagged), flagged_in(&range));
        let mut again = vec![0.0; 6 * n];
        packed.forces(range.clone(), &x, &v, &mut again).unwrap();
        assert_eq!(again, forces);
        for (place, index) in range.enumerate() {
            let [x, v] = [&x, &v].map(|of| stencils[index].map(|point| of[point as usize]));
            let single = springs[index].jacobians(&x, &v);
            assert_eq!(forces[6 * place..][..6], *single.force.as_flattened());
            assert_eq!(by_position[36 * place..][..36], *single.by_position.as_flattened().as_flattened());
            assert_eq!(by_velocity[36 * place..][..36], *single.by_velocity.as_flattened().as_flattened());
        }
    }
}

#[test]
fn residuals_are_those_of_single_elements() {
    let (springs, stencils) = springs();
    let unknowns = vectors(3).into_iter().map(|[x, y, z]| 1000.0 * x + 10.0 * y + z).collect::<Vec<f64>>();
    let packed = Packed::new(&springs, &stencils);
    for range in RANGES {
        let n = range.len();
        let (mut residuals, mut jacobians) = (vec![0.0; 2 * n], vec![0.0; 4 * n]);
        let flagged = packed.jacobians(range.clone(), &unknowns, &mut residuals, &mut jacobians).unwrap();
        assert_eq!(indices(&flagged), flagged_in(&range));
        let mut again = vec![0.0; 2 * n];
        packed.residuals(range.clone(), &unknowns, &mut again).unwrap();
        assert_eq!(again, residuals);
        for (place, index) in range.enumerate() {
            let single = springs[index].jacobian(&stencils[index].map(|unknown| unknowns[unknown as usize]));
            assert_eq!(residuals[2 * place..][..2], single.value);
            assert_eq!(jacobians[4 * place..][..4], single.jacobian);
        }
    }
}

#[test]
fn mixed_potentials_are_those_of_single_elements() {
    let (springs, stencils) = springs();
    let unknowns = vectors(3).into_iter().map(|[x, y, z]| 1000.0 * x + 10.0 * y + z).collect::<Vec<f64>>();
    let packed = Packed::new(&springs, &stencils);
    for range in RANGES {
        let n = range.len();
        let (mut energies, mut gradients, mut triangles) = (vec![0.0; n], vec![0.0; 2 * n], vec![0.0; 3 * n]);
        let all = range.clone();
        let flagged = packed.mixed_hessians(all, &unknowns, &mut energies, &mut gradients, &mut triangles).unwrap();
        assert_eq!(indices(&flagged), flagged_in(&range));
        let (mut again, mut energies_alone) = (vec![0.0; 2 * n], vec![0.0; n]);
        packed.mixed_gradients(range.clone(), &unknowns, &mut energies_alone, &mut again).unwrap();
        assert_eq!((&energies_alone, &again), (&energies, &gradients));
        energies_alone.fill(0.0);
        packed.mixed_values(range.clone(), &unknowns, &mut energies_alone).unwrap();
        assert_eq!(energies_alone, energies);
        for (place, index) in range.enumerate() {
            let own = stencils[index].map(|unknown| unknowns[unknown as usize]);
            let single = MixedPotential::hessian(&springs[index], &own);
            assert_eq!(energies[place], single.value);
            assert_eq!(gradients[2 * place..][..2], single.gradient);
            assert_eq!(triangles[3 * place..][..3], single.hessian);
        }
    }
}

#[test]
fn elements_are_selected_and_replaced() {
    let (springs, stencils) = springs();
    let mut packed = Packed::new(&springs, &stencils);
    let numbers = |packed: &Packed<Spring<f64>>| -> Vec<[f64; 2]> {
        (0..packed.len()).map(|index| packed.element(index)).map(|Spring(k, l)| [k, l]).collect()
    };
    let expected =
        |indices: &[usize]| -> Vec<[f64; 2]> { indices.iter().map(|&i| [springs[i].0, springs[i].1]).collect() };
    let all: Vec<usize> = (0..COUNT).collect();
    assert_eq!(numbers(&packed), expected(&all));
    let some: Vec<usize> = (0..COUNT).rev().step_by(2).collect();
    let selected = packed.selected(&some);
    assert_eq!((numbers(&selected), selected.is_empty()), (expected(&some), false));
    let index = |place: usize| some[place.min(some.len() - 1)];
    for (block, stencils_of_block) in selected.stencils().chunks(2 * BLOCK).enumerate() {
        for place in 0..BLOCK {
            let found = [stencils_of_block[place], stencils_of_block[BLOCK + place]];
            assert_eq!(found, stencils[index(block * BLOCK + place)]);
        }
    }
    assert!(packed.selected(&[]).is_empty());
    packed.set(COUNT - 1, &Spring(-1.0, -2.0));
    packed.set(17, &Spring(-3.0, -4.0));
    let mut replaced = expected(&all);
    (replaced[COUNT - 1], replaced[17]) = ([-1.0, -2.0], [-3.0, -4.0]);
    assert_eq!(numbers(&packed), replaced);
}

#[test]
fn chunks_are_whole_blocks() {
    let (springs, stencils) = springs();
    let packed = Packed::new(&springs, &stencils);
    assert_eq!([0, 1, 2, 3, 100].map(|parts| packed.chunk_len(parts)), [48, 48, 32, 16, 16]);
    assert_eq!(Packed::<Spring<f64>>::new::<2>(&[], &[]).chunk_len(4), 16);
}

#[test]
fn arguments_that_do_not_fit_are_refused() {
    let ((springs, stencils), x) = (springs(), vectors(1));
    let packed = Packed::new(&springs, &stencils);
    let mut numbers = vec![0.0; 36 * COUNT];
    let wrong = |of| Err(BatchError::Output { of, needed: 0, given: 1 });
    let [one, none] = [1, 0].map(|len| numbers[..len].to_vec());
    let [mut a, mut b, mut c] = [one, none.clone(), none].map(|all| all);
    let of = |result: Result<Flagged, BatchError>| result.map(|_| ());
    assert_eq!(of(packed.values(0..0, &x, &mut a)), wrong("energies"));
    assert_eq!(of(packed.gradients(0..0, &x, &mut b, &mut a)), wrong("gradients"));
    assert_eq!(of(packed.hessians(0..0, &x, &mut b, &mut c, &mut a)), wrong("Hessians"));
    assert_eq!(of(packed.forces(0..0, &x, &x, &mut a)), wrong("forces"));
    assert_eq!(of(packed.force_jacobians(0..0, &x, &x, &mut b, &mut a, &mut c)), wrong("Jacobians by position"));
    assert_eq!(of(packed.force_jacobians(0..0, &x, &x, &mut b, &mut c, &mut a)), wrong("Jacobians by velocity"));
    assert_eq!(of(packed.residuals(0..0, &numbers.clone(), &mut a)), wrong("residuals"));
    assert_eq!(of(packed.jacobians(0..0, &numbers.clone(), &mut b, &mut a)), wrong("Jacobians"));
    assert_eq!(of(packed.mixed_values(0..0, &numbers.clone(), &mut a)), wrong("energies"));
    assert_eq!(of(packed.mixed_gradients(0..0, &numbers.clone(), &mut b, &mut a)), wrong("gradients"));
    assert_eq!(of(packed.mixed_hessians(0..0, &numbers.clone(), &mut b, &mut c, &mut a)), wrong("Hessians"));
    for range in [1..COUNT, 0..COUNT + 1, Range { start: 16, end: 0 }] {
        let expected = BatchError::Range { range: range.clone(), elements: COUNT, block: BLOCK };
        assert_eq!(packed.values(range, &x, &mut numbers).map(|_| ()), Err(expected));
    }
    let missing = BatchError::Missing { needed: 72, given: 71 };
    assert_eq!(of(packed.values(0..0, &x[..71], &mut b)), Err(missing.clone()));
    assert_eq!(of(packed.forces(0..0, &x, &x[..71], &mut b)), Err(missing));
    assert!(packed.values(0..0, &x[..72], &mut b).is_ok());
    let triples = Packed::new(&springs, &vec![[0, 1, 2]; COUNT]);
    assert_eq!(of(triples.values(0..0, &x, &mut b)), Err(BatchError::Stencil { needed: 2, given: 3 }));
}
