//! Lanes compute what scalars compute, bit for bit, at every level of the machine.

use std::fmt::Debug;

use energy_dsl::{Kernel, Lane, Level, Mask, Number, available, dispatch, dispatch_at, level};

/// A scalar whose bits can be compared.
trait Bits: Lane<Self> + Number<Mask = bool> {
    fn bits(self) -> u64;
    /// Numbers of every kind there is.
    fn examples() -> Vec<Self>;
}

macro_rules! bits {
    ($float:ident) => {
        impl Bits for $float {
            fn bits(self) -> u64 {
                // Which NaN comes out of two is the processor's business.
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

/// A check that is run for the lanes of both precisions at a level.
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

/// Asserts that lanes hold what the scalars `expected(i)` are.
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
            // Every lane has another number, so that no lane can stand in for its neighbour.
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
