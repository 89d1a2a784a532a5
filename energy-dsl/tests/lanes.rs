//! Lanes are bit-identical to scalars, at every level of the machine.

use std::fmt::Debug;

use energy_dsl::energy;
use energy_dsl::{
    Array, BLOCK_NUMBERS, Block, BlockSum, Hessian, Kernel, Lane, Level, LevelName, Mask, Number, Potential, Vector3,
    available, dispatch, dispatch_at, level,
};

/// A scalar with comparable bits.
trait Bits: Lane<Self> + Number<Mask = bool> + Into<f64> {
    fn bits(self) -> u64;
    /// Returns examples of every kind of number.
    fn examples() -> Vec<Self>;
}

macro_rules! bits {
    ($float:ident) => {
        impl Bits for $float {
            fn bits(self) -> u64 {
                // The processor chooses which of two NaNs it returns.
                if self.is_nan() { u64::MAX } else { u64::from(self.to_bits()) }
            }
            fn examples() -> Vec<Self> {
                let positive = [
                    0.0,
                    $float::from_bits(1),
                    $float::MIN_POSITIVE / 3.0,
                    $float::MIN_POSITIVE,
                    1e-30,
                    $float::EPSILON,
                    0.1,
                    0.75,
                    1.0,
                    1.0 + $float::EPSILON,
                    3.0,
                    12345.678,
                    8e7,
                    1e30,
                    $float::MAX,
                    $float::INFINITY,
                ];
                positive.into_iter().flat_map(|x| [x, -x]).chain([$float::NAN]).collect()
            }
        }
    };
}

bits!(f64);
bits!(f32);

/// A check of the lanes of both precisions at a level.
trait Check {
    fn check<S: Bits, V: Lane<S>, L: Level>();
}

struct At<C>(std::marker::PhantomData<C>);

impl<C: Check> Kernel for At<C> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        C::check::<f64, L::F64, L>();
        C::check::<f32, L::F32, L>();
        C::check::<f64, f64, L>();
        C::check::<f32, f32, L>();
    }
}

fn at_every_level<C: Check>() {
    for name in available() {
        dispatch_at(name, At::<C>(std::marker::PhantomData)).expect("the level is available");
    }
}

/// Asserts that lane i equals the scalar `expected(i)`.
#[track_caller]
fn assert_lanes<S: Bits, V: Lane<S>>(actual: V, expected: impl Fn(usize) -> S, what: impl Debug) {
    for lane in 0..V::LANES {
        let (actual, expected) = (actual.extract(lane), expected(lane));
        assert_eq!(actual.bits(), expected.bits(), "{what:?}, lane {lane}: {actual:?} instead of {expected:?}");
    }
}

#[track_caller]
fn assert_mask<M: Mask>(actual: M, lanes: usize, expected: impl Fn(usize) -> bool, what: impl Debug) {
    for lane in 0..lanes {
        assert_eq!(actual.lane(lane), expected(lane), "{what:?}, lane {lane}");
    }
    assert_eq!(actual.any(), (0..lanes).any(&expected), "{what:?}");
    assert_eq!(actual.all(), (0..lanes).all(&expected), "{what:?}");
}

struct Arithmetic;

impl Check for Arithmetic {
    fn check<S: Bits, V: Lane<S>, L: Level>() {
        let examples = S::examples();
        let count = examples.len();
        for i in 0..count {
            // All lanes differ, so that a mix-up of lanes is noticed.
            let a = |lane: usize| examples[(i + lane) % count];
            let va = V::from_fn(a);
            assert_lanes(va.sqrt(), |l| a(l).sqrt(), ("sqrt", va));
            assert_lanes(va.abs(), |l| a(l).abs(), ("abs", va));
            assert_lanes(-va, |l| -a(l), ("neg", va));
            assert_lanes(va.power_of_two_scale(), |l| a(l).power_of_two_scale(), ("power_of_two_scale", va));
            for degree in 1..=9 {
                let what = ("is_moderate", degree, va);
                assert_mask(va.is_moderate(degree), V::LANES, |l| a(l).is_moderate(degree), what);
            }
            for j in 0..count {
                let b = |lane: usize| examples[(j + 3 * lane) % count];
                let vb = V::from_fn(b);
                assert_lanes(va + vb, |l| a(l) + b(l), ("+", va, vb));
                assert_lanes(va - vb, |l| a(l) - b(l), ("-", va, vb));
                assert_lanes(va * vb, |l| a(l) * b(l), ("*", va, vb));
                assert_lanes(va / vb, |l| a(l) / b(l), ("/", va, vb));
                assert_lanes(va.min(vb), |l| a(l).min(b(l)), ("min", va, vb));
                assert_lanes(va.max(vb), |l| a(l).max(b(l)), ("max", va, vb));
                assert_lanes(va.sum_error(vb), |l| a(l).sum_error(b(l)), ("sum_error", va, vb));
                assert_lanes(va.difference_error(vb), |l| a(l).sum_error(-b(l)), ("difference_error", va, vb));
                assert_lanes(va.product_error::<L>(vb), |l| a(l).product_error::<L>(b(l)), ("product_error", va, vb));
                assert_mask(va.less(vb), V::LANES, |l| a(l).less(b(l)), ("<", va, vb));
                assert_mask(va.less_or_equal(vb), V::LANES, |l| a(l).less_or_equal(b(l)), ("<=", va, vb));
                assert_mask(va.equal(vb), V::LANES, |l| a(l).equal(b(l)), ("=", va, vb));
                let (less, equal) = (va.less(vb), va.equal(vb));
                let (sl, se) = (|l: usize| a(l).less(b(l)), |l: usize| a(l).equal(b(l)));
                assert_mask(less | equal, V::LANES, |l| sl(l) | se(l), ("|", va, vb));
                assert_mask(less & equal, V::LANES, |l| sl(l) & se(l), ("&", va, vb));
                assert_mask(!less, V::LANES, |l| !sl(l), ("!", va, vb));
                assert_lanes(V::select(less, va, vb), |l| S::select(sl(l), a(l), b(l)), ("select", va, vb));
                for k in [0, 9, 17, 28] {
                    let c = |lane: usize| examples[(k + 5 * lane) % count];
                    let vc = V::from_fn(c);
                    let what = ("mul_add", va, vb, vc);
                    assert_lanes(va.mul_add::<L>(vb, vc), |l| a(l).mul_add::<L>(b(l), c(l)), what);
                }
            }
        }
        assert!(!V::Mask::none().any());
    }
}

#[test]
fn arithmetic_is_that_of_scalars() {
    at_every_level::<Arithmetic>();
}

struct RaggedTails;

impl Check for RaggedTails {
    fn check<S: Bits, V: Lane<S>, L: Level>() {
        let (examples, mark) = (S::examples(), S::from_f64(77.0));
        for length in 0..=2 * V::LANES + 1 {
            let values = &examples[..length.min(examples.len())];
            let mut copy = vec![mark; values.len() + 1];
            for (from, to) in values.chunks(V::LANES).zip(copy[..values.len()].chunks_mut(V::LANES)) {
                let lanes = V::load_ragged(from);
                assert_lanes(lanes, |lane| from[lane.min(from.len() - 1)], "load");
                lanes.store_ragged(to);
            }
            assert!(copy.iter().zip(values).all(|(a, b)| a.bits() == b.bits()));
            assert_eq!(copy[values.len()].bits(), mark.bits(), "a store went too far");
        }
        V::splat(mark).store_ragged(&mut []);
    }
}

#[test]
fn ragged_tails_repeat_the_last_number_and_store_what_fits() {
    at_every_level::<RaggedTails>();
}

struct ElementaryFunctions;

impl Check for ElementaryFunctions {
    fn check<S: Bits, V: Lane<S>, L: Level>() {
        // Every kind of number, angles of every size, and numbers between them.
        let mut numbers = S::examples();
        numbers.extend((-60..60).flat_map(|i| {
            let x = f64::from(i) * 0.37;
            [x, x.exp2(), x.exp2().exp2() - 3.0, 1.0 + x * 1e-5, 3e7 * x].map(S::from_f64)
        }));
        let count = numbers.len();
        for i in 0..count {
            let a = |lane: usize| numbers[(i + 7 * lane) % count];
            let va = V::from_fn(a);
            assert_lanes(va.sin::<L>(), |l| a(l).sin::<L>(), ("sin", va));
            assert_lanes(va.cos::<L>(), |l| a(l).cos::<L>(), ("cos", va));
            assert_lanes(va.sin_cos::<L>().0, |l| a(l).sin::<L>(), ("sin_cos", va));
            assert_lanes(va.sin_cos::<L>().1, |l| a(l).cos::<L>(), ("sin_cos", va));
            assert_lanes(va.exp::<L>(), |l| a(l).exp::<L>(), ("exp", va));
            assert_lanes(va.ln::<L>(), |l| a(l).ln::<L>(), ("ln", va));
            for j in (i % 7..count).step_by(7) {
                let b = |lane: usize| numbers[(j + 11 * lane) % count];
                let vb = V::from_fn(b);
                assert_lanes(va.atan2::<L>(vb), |l| a(l).atan2::<L>(b(l)), ("atan2", va, vb));
                assert_lanes(va.powf::<L>(vb), |l| a(l).powf::<L>(b(l)), ("powf", va, vb));
            }
        }
    }
}

#[test]
fn elementary_functions_are_those_of_scalars() {
    at_every_level::<ElementaryFunctions>();
}

struct ModerateAngles;

impl Check for ModerateAngles {
    fn check<S: Bits, V: Lane<S>, L: Level>() {
        let mut numbers = S::examples();
        let powers = (-330..330).step_by(11).map(|i| (f64::from(i) + 0.3).exp2());
        numbers.extend(powers.flat_map(|x| [x, -1.1 * x]).map(S::from_f64));
        let mut moderate = 0;
        for &y in &numbers {
            for &x in &numbers {
                if (x * x + y * y).is_moderate(8).all() {
                    moderate += 1;
                    let lanes = V::splat(y).moderate_atan2::<L>(V::splat(x));
                    assert_lanes(lanes, |_| y.atan2::<L>(x), ("moderate atan2", y, x));
                    assert_eq!(y.moderate_atan2::<L>(x).bits(), y.atan2::<L>(x).bits(), "{y:?}, {x:?}");
                }
            }
        }
        assert!(moderate > 1000, "{moderate} points");
    }
}

#[test]
fn the_angle_of_a_moderate_point_is_the_same_bit_for_bit() {
    at_every_level::<ModerateAngles>();
}

struct SpecialCases;

impl Check for SpecialCases {
    fn check<S: Bits, V: Lane<S>, L: Level>() {
        let mut numbers = S::examples();
        numbers
            .extend([-3.0, -2.5, 0.5, 2.0, 1e15, 4_503_599_627_370_497.0, -9_007_199_254_740_993.0].map(S::from_f64));
        // The standard library is right in the special cases; `verify` tests the errors of all others.
        let check = |actual: V, expected: f64, what: &str, a: S, b: S| {
            let (actual, expected): (f64, f64) = (actual.extract(0).into(), S::from_f64(expected).into());
            let same = actual == expected && actual.is_sign_negative() == expected.is_sign_negative();
            let tolerance = 1e-6 * expected.abs() + 1e-44;
            let close = expected != 0.0 && (actual - expected).abs() <= tolerance;
            let both_nan = actual.is_nan() && expected.is_nan();
            assert!(same || close || both_nan, "{}: {what} of {a:?}, {b:?}: {actual:e}, not {expected:e}", L::NAME);
        };
        for &a in &numbers {
            let (va, fa): (V, f64) = (V::splat(a), a.into());
            check(va.sin::<L>(), fa.sin(), "sin", a, a);
            check(va.cos::<L>(), fa.cos(), "cos", a, a);
            check(va.exp::<L>(), fa.exp(), "exp", a, a);
            check(va.ln::<L>(), fa.ln(), "ln", a, a);
            for &b in &numbers {
                let (vb, fb): (V, f64) = (V::splat(b), b.into());
                check(va.atan2::<L>(vb), fa.atan2(fb), "atan2", a, b);
                check(va.powf::<L>(vb), fa.powf(fb), "powf", a, b);
            }
        }
    }
}

#[test]
fn elementary_functions_have_the_special_cases_of_the_standard() {
    at_every_level::<SpecialCases>();
}

energy! {
    energy Stick(p, q: Point; k: Scalar[N/m], L: Scalar[m]) { k / 2 * (norm(p - q) - L)^2 }
    energy Fold(x1, x2, x3, x4: Point; k: Scalar[J], θ0: Scalar[rad]) {
        let θ = dihedral(x1, x2, x3, x4);
        k * (θ - θ0)^2
    }
}

struct Elements;

/// Points in general position, by element and point. Every fifth element is degenerate.
fn points<S: Bits, const N: usize>(element: usize) -> [[S; 3]; N] {
    let number =
        |point: usize, axis: usize| S::from_f64((1.7 * (3 * point + axis) as f64 + 0.9 * element as f64).sin());
    let all: [[S; 3]; N] = std::array::from_fn(|point| std::array::from_fn(|axis| number(point, axis)));
    if element % 5 == 4 { [all[0]; N] } else { all }
}

#[track_caller]
fn assert_routines<S: Bits, V: Lane<S>, const N: usize, Wide, Narrow>(
    lanes: &Hessian<V, Wide, impl Array<Block<V>>>,
    scalar: impl Fn(usize) -> Hessian<S, Narrow, Vec<Block<S>>>,
) where
    Wide: Array<Vector3<V>>,
    Narrow: Array<Vector3<S>>,
{
    let scalars: Vec<_> = (0..V::LANES).map(scalar).collect();
    assert_lanes(lanes.value, |l| scalars[l].value, "value");
    for point in 0..N {
        for axis in 0..3 {
            let expected = |l: usize| scalars[l].gradient.as_ref()[point][axis];
            assert_lanes(lanes.gradient.as_ref()[point][axis], expected, ("gradient", point, axis));
        }
    }
    for (i, block) in lanes.hessian.as_ref().iter().enumerate() {
        for entry in 0..9 {
            let expected = |l: usize| scalars[l].hessian[i][entry / 3][entry % 3];
            assert_lanes(block[entry / 3][entry % 3], expected, ("hessian", i, entry));
        }
    }
    assert_mask(lanes.flags.degenerate, V::LANES, |l| scalars[l].flags.degenerate, "degenerate");
    assert_mask(lanes.flags.kink, V::LANES, |l| scalars[l].flags.kink, "kink");
}

/// Returns a scalar Hessian with its triangle as a vector.
fn listed<S: Bits, P, T: Array<Block<S>>>(h: Hessian<S, P, T>) -> Hessian<S, P, Vec<Block<S>>> {
    Hessian { value: h.value, gradient: h.gradient, hessian: h.hessian.as_ref().to_vec(), flags: h.flags }
}

/// Gathers the points of elements into lanes.
fn gathered<S: Bits, V: Lane<S>, const N: usize>(element: impl Fn(usize) -> [[S; 3]; N]) -> [[V; 3]; N] {
    std::array::from_fn(|point| std::array::from_fn(|axis| V::from_fn(|lane| element(lane)[point][axis])))
}

impl Check for Elements {
    fn check<S: Bits, V: Lane<S>, L: Level>() {
        for first in (0..40).step_by(V::LANES) {
            let parameter = |i: usize, scale: f64| S::from_f64(0.5 + scale * (i % 11) as f64);
            let stick = |l: usize| Stick { k: parameter(first + l, 3.0), L: parameter(first + l, 0.1) };
            let wide = Stick { k: V::from_fn(|l| stick(l).k), L: V::from_fn(|l| stick(l).L) };
            let ends = |l: usize| points::<S, 2>(first + l);
            assert_routines::<S, V, 2, _, _>(&wide.hessian_at::<L>(&gathered(ends)), |l| {
                listed(stick(l).hessian_at::<L>(&ends(l)))
            });
            let fold = |l: usize| Fold { k: parameter(first + l, 3.0), θ0: parameter(first + l, 0.1) };
            let wide = Fold { k: V::from_fn(|l| fold(l).k), θ0: V::from_fn(|l| fold(l).θ0) };
            let corners = |l: usize| points::<S, 4>(first + l);
            assert_routines::<S, V, 4, _, _>(&wide.hessian_at::<L>(&gathered(corners)), |l| {
                listed(fold(l).hessian_at::<L>(&corners(l)))
            });
        }
    }
}

#[test]
fn elements_over_lanes_are_those_over_scalars() {
    at_every_level::<Elements>();
}

struct Rows;

impl Check for Rows {
    fn check<S: Bits, V: Lane<S>, L: Level>() {
        let points: Vec<[S; 3]> =
            (0..20).map(|point| [0.0, 0.25, 0.5].map(|axis| S::from_f64(f64::from(point) + axis))).collect();
        // Includes the last point, so that a read past the end is noticed.
        let indices: Vec<u32> = (0..V::LANES as u32).map(|lane| (7 * lane + 19) % 20).collect();
        let gathered = V::gather(&points, &indices);
        for axis in 0..3 {
            assert_lanes(gathered[axis], |lane| points[indices[lane] as usize][axis], ("point", axis));
        }
        for numbers in 0..20_usize {
            let number = |number: usize, lane: usize| S::from_f64((100 * number + lane + 1) as f64);
            let wide: Vec<V> = (0..numbers).map(|row| V::from_fn(|lane| number(row, lane))).collect();
            for (count, gap) in (0..=V::LANES).flat_map(|count| [(count, 0), (count, 3)]) {
                let stride = numbers + gap;
                // Exactly as many places as needed.
                let mut rows = vec![S::from_f64(0.0); (count * stride).saturating_sub(gap)];
                V::store_transposed(&wide, count, &mut rows, stride);
                for (place, &stored) in rows.iter().enumerate() {
                    let (lane, row) = (place / stride, place % stride);
                    let expected = if row < numbers { number(row, lane) } else { S::from_f64(0.0) };
                    assert_eq!(stored.bits(), expected.bits(), "{numbers} numbers, {count} lanes, stride {stride}");
                }
            }
        }
    }
}

#[test]
fn rows_are_turned_to_lanes_and_lanes_to_rows() {
    at_every_level::<Rows>();
}

#[test]
#[should_panic(expected = "index out of bounds")]
fn points_that_do_not_exist_are_not_gathered() {
    struct Beyond;
    impl Kernel for Beyond {
        type Output = f64;
        fn run<L: Level>(self) -> f64 {
            L::F64::gather(&[[0.0; 3]; 4], &[4, 0, 0, 0, 0, 0, 0, 0])[0].extract(0)
        }
    }
    dispatch(Beyond);
}

#[test]
fn a_plain_call_has_the_bits_of_the_best_level() {
    struct ByLanes([[f64; 3]; 4]);
    impl Kernel for ByLanes {
        type Output = f64;
        fn run<L: Level>(self) -> f64 {
            let fold = Fold { k: L::F64::splat(2.0), θ0: L::F64::splat(0.1) };
            fold.value_at::<L>(&gathered(|_| self.0)).value.extract(0)
        }
    }
    let corners = points::<f64, 4>(1);
    let fold = Fold { k: 2.0, θ0: 0.1 };
    assert_eq!(fold.value(&corners).value.to_bits(), dispatch(ByLanes(corners)).to_bits());
}

#[test]
#[should_panic(expected = "a load of")]
fn loading_from_a_short_slice_panics() {
    struct Short;
    impl Kernel for Short {
        type Output = ();
        fn run<L: Level>(self) {
            let _ = L::F64::load(&[1.0]);
        }
    }
    dispatch(Short);
}

#[test]
fn kernels_run_at_the_level_asked_for() {
    struct Name;
    impl Kernel for Name {
        type Output = (&'static str, bool);
        fn run<L: Level>(self) -> Self::Output {
            (L::NAME, L::FUSED)
        }
    }
    for name in available() {
        assert_eq!(dispatch_at(name, Name).map(|(text, _)| text), Some(name.as_str()));
    }
    assert_eq!(dispatch(Name).0, level().as_str());
    assert_eq!("avx2".parse(), Ok(energy_dsl::LevelName::Avx2));
    assert!("AVX9".parse::<energy_dsl::LevelName>().is_err());
}

/// Five blocks of a row, and the vectors that they multiply.
struct Row<'a, S> {
    numbers: &'a [S],
    vectors: &'a [[S; 4]; 5],
}

impl<S: Bits> Row<'_, S> {
    /// Σ B v of the first four, and u − B v of the last.
    fn sums<B: BlockSum<S>>(&self) -> [[S; 4]; 2] {
        let block = |place: usize| self.numbers[9 * place..].first_chunk::<BLOCK_NUMBERS>().expect("enough numbers");
        let mut sum = B::zero();
        for place in 0..4 {
            sum.add(block(place), &self.vectors[place]);
        }
        [sum.total(), B::less(self.vectors[0], block(4), &self.vectors[4])]
    }
}

impl Kernel for Row<'_, f32> {
    type Output = (bool, [[f32; 4]; 2]);
    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        (L::FUSED, self.sums::<L::Sum32>())
    }
}

impl Kernel for Row<'_, f64> {
    type Output = (bool, [[f64; 4]; 2]);
    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        (L::FUSED, self.sums::<L::Sum64>())
    }
}

fn sums_of_blocks_have_the_same_bits<S: Bits>(
    numbers: Vec<S>,
    at: impl Fn(LevelName, &[S], &[[S; 4]; 5]) -> (bool, [[S; 4]; 2]),
) {
    let vectors: [[S; 4]; 5] = std::array::from_fn(|i| std::array::from_fn(|k| numbers[4 * i + k]));
    // The products in plain arithmetic, which differ a little from the fused ones.
    let entry = |place: usize, row: usize, column: usize| -> f64 { numbers[9 * place + 3 * row + column].into() };
    let product = |place: usize, row: usize| -> f64 {
        (0..3).map(|column| entry(place, row, column) * Into::<f64>::into(vectors[place][column])).sum()
    };
    let found: Vec<_> = available().map(|name| at(name, &numbers, &vectors)).collect();
    for (fused, sums) in &found {
        for row in 0..3 {
            let expected = [(0..4).map(|place| product(place, row)).sum(), vectors[0][row].into() - product(4, row)];
            for (sum, expected) in sums.iter().zip(expected) {
                let off: f64 = Into::<f64>::into(sum[row]) - expected;
                assert!(off.abs() < 1e-5 * (1.0 + expected.abs()), "{off:e} of {expected}");
            }
            for (_, others) in found.iter().filter(|(other, _)| other == fused) {
                for (sum, other) in sums.iter().zip(others) {
                    assert_eq!(sum[row].bits(), other[row].bits());
                }
            }
        }
    }
}

#[test]
fn sums_of_blocks_have_the_same_bits_at_every_level_and_are_right() {
    let numbers: Vec<f64> = (0..5 * 9 + 7).map(|i| (1.7 * f64::from(i)).sin() * 10.0).collect();
    let singles = numbers.iter().map(|&number| number as f32).collect();
    sums_of_blocks_have_the_same_bits::<f32>(singles, |name, numbers, vectors| {
        dispatch_at(name, Row { numbers, vectors }).expect("the level is available")
    });
    sums_of_blocks_have_the_same_bits::<f64>(numbers, |name, numbers, vectors| {
        dispatch_at(name, Row { numbers, vectors }).expect("the level is available")
    });
}
