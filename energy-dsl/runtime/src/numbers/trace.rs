//! Numbers that note the operations of elementary functions, for renderers of other languages.
//!
//! The functions are generic over the type of a lane and do not branch. So one run over [`Traced`] numbers gives all
//! operations of a function, and code that repeats them has its bits.

use std::cell::RefCell;
use std::collections::HashMap;
use std::fmt::Debug;
use std::marker::PhantomData;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::cpu::{Fused, Scalar};
use super::elementary::{Atan2, Binary, Bits, Cos, Exp, Format, Ln, ModerateAtan2, Pow, Sin, Unary};
use super::lane::Lane;
use super::level::Level;
use super::real::{Mask, Number};

/// A statement of an elementary function. Operands are numbers of earlier statements.
#[derive(Clone, Debug, PartialEq)]
pub enum TraceStep {
    /// An argument, by number.
    Argument(usize),
    /// A numeric constant. Those of single precision are exact.
    Constant(f64),
    /// An operation by name: that of the method of [`Number`] or of bit patterns that computes it.
    Operation(&'static str, Vec<usize>),
}

/// An elementary function as straight-line code.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Name of the function, as the table of operations has it.
    pub name: &'static str,
    /// Number of arguments.
    pub arguments: usize,
    /// Statements in the order of execution. The last one is the result.
    pub steps: Vec<TraceStep>,
}

/// Operations whose result is a mask.
pub const MASKS: [&str; 6] = ["less", "less_or_equal", "equal", "both", "either", "not"];

/// Returns all elementary functions at the levels that have fused operations: in double or in single precision.
#[must_use]
pub fn elementary_functions(single: bool) -> Vec<Trace> {
    if single { functions::<f32>() } else { functions::<f64>() }
}

fn functions<S: Format>() -> Vec<Trace> {
    type T<S> = Traced<S>;
    let unary = |name, of: fn(T<S>) -> T<S>| trace(name, 1, move |x: &[T<S>]| of(x[0]));
    let binary = |name, of: fn(T<S>, T<S>) -> T<S>| trace(name, 2, move |x: &[T<S>]| of(x[0], x[1]));
    vec![
        unary("sin", Sin::of::<T<S>, Fused>),
        unary("cos", Cos::of::<T<S>, Fused>),
        unary("exp", Exp::of::<T<S>, Fused>),
        unary("ln", Ln::of::<T<S>, Fused>),
        binary("atan2", Atan2::of::<T<S>, Fused>),
        binary("moderate_atan2", ModerateAtan2::of::<T<S>, Fused>),
        binary("powf", Pow::of::<T<S>, Fused>),
    ]
}

/// A number of a trace, by the number of its statement.
struct Traced<S>(usize, PhantomData<S>);

/// A mask of a trace.
#[derive(Clone, Copy, Debug)]
struct TracedMask(usize);

/// The statements so far.
#[derive(Default)]
struct Steps {
    list: Vec<TraceStep>,
    /// Equal operations are one statement.
    known: HashMap<(&'static str, Vec<usize>), usize>,
}

thread_local! {
    static STEPS: RefCell<Steps> = RefCell::default();
}

fn trace<S>(name: &'static str, arguments: usize, function: impl Fn(&[Traced<S>]) -> Traced<S>) -> Trace {
    STEPS.take();
    let inputs: Vec<Traced<S>> = (0..arguments).map(|number| Traced::new(push(TraceStep::Argument(number)))).collect();
    let result = function(&inputs);
    let list = STEPS.take().list;
    Trace { name, arguments, steps: needed(&list, result.0) }
}

fn push(step: TraceStep) -> usize {
    STEPS.with_borrow_mut(|steps| {
        steps.list.push(step);
        steps.list.len() - 1
    })
}

fn operation(name: &'static str, operands: &[usize]) -> usize {
    let key = (name, operands.to_vec());
    if let Some(known) = STEPS.with_borrow(|steps| steps.known.get(&key).copied()) {
        return known;
    }
    let number = push(TraceStep::Operation(name, operands.to_vec()));
    STEPS.with_borrow_mut(|steps| steps.known.insert(key, number));
    number
}

/// Returns the statements that a result needs.
fn needed(list: &[TraceStep], result: usize) -> Vec<TraceStep> {
    let mut is_needed = vec![false; list.len()];
    is_needed[result] = true;
    for (number, step) in list.iter().enumerate().rev() {
        match step {
            TraceStep::Operation(_, operands) if is_needed[number] => {
                operands.iter().for_each(|&operand| is_needed[operand] = true);
            }
            _ => {}
        }
    }
    let mut places = vec![0; list.len()];
    let mut steps = Vec::new();
    for (number, step) in list.iter().enumerate().filter(|(number, _)| is_needed[*number]) {
        places[number] = steps.len();
        steps.push(match step {
            TraceStep::Operation(name, operands) => {
                TraceStep::Operation(name, operands.iter().map(|&operand| places[operand]).collect())
            }
            other => other.clone(),
        });
    }
    steps
}

impl<S> Traced<S> {
    fn new(number: usize) -> Self {
        Self(number, PhantomData)
    }

    fn of(name: &'static str, operands: &[usize]) -> Self {
        Self::new(operation(name, operands))
    }
}

impl<S> Clone for Traced<S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<S> Copy for Traced<S> {}

impl<S> Debug for Traced<S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "statement {}", self.0)
    }
}

macro_rules! operators {
    ($($of:ident::$method:ident as $name:literal;)*) => {
        $(impl<S> $of for Traced<S> {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self::of($name, &[self.0, other.0])
            }
        })*
    };
}

operators! { Add::add as "add"; Sub::sub as "sub"; Mul::mul as "mul"; Div::div as "div"; }

impl<S> Neg for Traced<S> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::of("neg", &[self.0])
    }
}

impl BitAnd for TracedMask {
    type Output = Self;
    fn bitand(self, other: Self) -> Self {
        Self(operation("both", &[self.0, other.0]))
    }
}

impl BitOr for TracedMask {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(operation("either", &[self.0, other.0]))
    }
}

impl Not for TracedMask {
    type Output = Self;
    fn not(self) -> Self {
        Self(operation("not", &[self.0]))
    }
}

impl Mask for TracedMask {
    fn none() -> Self {
        unreachable!("{BRANCHES}")
    }
    fn bits(self) -> u32 {
        unreachable!("{BRANCHES}")
    }
    fn from_bits(_: u32) -> Self {
        unreachable!("{BRANCHES}")
    }
}

/// The panic message of operations that would make a trace depend on the numbers.
const BRANCHES: &str = "elementary functions do not look at masks or single lanes";

macro_rules! numbers {
    ($($method:ident($($operand:ident),*);)*) => {
        $(fn $method(self $(, $operand: Self)*) -> Self {
            Self::of(stringify!($method), &[self.0 $(, $operand.0)*])
        })*
    };
}

macro_rules! levelled {
    ($($method:ident($($operand:ident),*);)*) => {
        $(fn $method<L: Level>(self $(, $operand: Self)*) -> Self {
            Self::of(stringify!($method), &[self.0 $(, $operand.0)*])
        })*
    };
}

impl<S: Scalar> Number for Traced<S> {
    type Mask = TracedMask;
    type Unbounded = Self;

    fn unbounded(&self, _: usize) -> Self {
        *self
    }
    fn set_lane(&mut self, _: usize, _: Self) {
        unreachable!("{BRANCHES}")
    }
    fn from_f64(value: f64) -> Self {
        Self::splat(S::nearest(value))
    }
    fn less(self, other: Self) -> TracedMask {
        TracedMask(operation("less", &[self.0, other.0]))
    }
    fn less_or_equal(self, other: Self) -> TracedMask {
        TracedMask(operation("less_or_equal", &[self.0, other.0]))
    }
    fn equal(self, other: Self) -> TracedMask {
        TracedMask(operation("equal", &[self.0, other.0]))
    }
    fn select(mask: TracedMask, yes: Self, no: Self) -> Self {
        Self::of("select", &[mask.0, yes.0, no.0])
    }

    numbers! { sqrt(); abs(); min(other); max(other); sum_error(other); power_of_two_scale(); }
    levelled! {
        sin(); cos(); exp(); ln(); atan2(x); powf(exponent); mul_add(factor, addend); product_error(other);
        fused_mul_sub(factor, subtrahend);
    }
}

impl<S: Scalar> Lane<S> for Traced<S> {
    const LANES: usize = 1;

    fn splat(value: S) -> Self {
        let value = value.to_f64();
        let same = |step: &TraceStep| matches!(step, TraceStep::Constant(other) if other.to_bits() == value.to_bits());
        let known = STEPS.with_borrow(|steps| steps.list.iter().position(same));
        Self::new(known.unwrap_or_else(|| push(TraceStep::Constant(value))))
    }
    fn load(_: &[S]) -> Self {
        unreachable!("{BRANCHES}")
    }
    fn store(self, _: &mut [S]) {
        unreachable!("{BRANCHES}")
    }
    fn from_fn(_: impl FnMut(usize) -> S) -> Self {
        unreachable!("{BRANCHES}")
    }
    fn extract(self, _: usize) -> S {
        unreachable!("{BRANCHES}")
    }
}

impl<S: Format> Bits for Traced<S> {
    type Format = S;

    fn and(self, other: Self) -> Self {
        Self::of("and", &[self.0, other.0])
    }
    fn or(self, other: Self) -> Self {
        Self::of("or", &[self.0, other.0])
    }
    fn xor(self, other: Self) -> Self {
        Self::of("xor", &[self.0, other.0])
    }
    fn add_bits(self, other: Self) -> Self {
        Self::of("add_bits", &[self.0, other.0])
    }
    fn low_bits_to_exponent(self) -> Self {
        Self::of("low_bits_to_exponent", &[self.0])
    }
    fn exponent_to_low_bits(self) -> Self {
        Self::of("exponent_to_low_bits", &[self.0])
    }
    fn bit_1_to_sign(self) -> Self {
        Self::of("bit_1_to_sign", &[self.0])
    }
    fn reduced_if_huge(self, huge: TracedMask, [quadrant, high, low]: [Self; 3]) -> [Self; 3] {
        let part = |name, ordinary: Self| Self::of(name, &[huge.0, self.0, ordinary.0]);
        [part("quadrant_if_huge", quadrant), part("high_remainder_if_huge", high), part("low_remainder_if_huge", low)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Baseline;

    /// Runs a trace with plain numbers.
    fn run(trace: &Trace, arguments: &[f64]) -> f64 {
        let mut numbers: Vec<f64> = Vec::new();
        for step in &trace.steps {
            let mask = |is_true: bool| f64::from(u8::from(is_true));
            let number = match step {
                TraceStep::Argument(number) => arguments[*number],
                TraceStep::Constant(value) => *value,
                TraceStep::Operation(name, operands) => {
                    let a: Vec<f64> = operands.iter().map(|&operand| numbers[operand]).collect();
                    match *name {
                        "add" => a[0] + a[1],
                        "sub" => a[0] - a[1],
                        "mul" => a[0] * a[1],
                        "div" => a[0] / a[1],
                        "neg" => -a[0],
                        "abs" => a[0].abs(),
                        "min" => Number::min(a[0], a[1]),
                        "max" => Number::max(a[0], a[1]),
                        "mul_add" => a[0].mul_add(a[1], a[2]),
                        "sum_error" => a[0].sum_error(a[1]),
                        "product_error" => a[0].product_error::<Fused>(a[1]),
                        "fused_mul_sub" => a[0].fused_mul_sub::<Fused>(a[1], a[2]),
                        "and" => a[0].and(a[1]),
                        "or" => a[0].or(a[1]),
                        "xor" => a[0].xor(a[1]),
                        "add_bits" => a[0].add_bits(a[1]),
                        "low_bits_to_exponent" => a[0].low_bits_to_exponent(),
                        "exponent_to_low_bits" => a[0].exponent_to_low_bits(),
                        "bit_1_to_sign" => a[0].bit_1_to_sign(),
                        "less" => mask(a[0] < a[1]),
                        "less_or_equal" => mask(a[0] <= a[1]),
                        "equal" => mask(a[0] == a[1]),
                        "both" => a[0] * a[1],
                        "either" => a[0].max(a[1]),
                        "not" => 1.0 - a[0],
                        "select" => [a[2], a[1]][usize::from(a[0] == 1.0)],
                        "quadrant_if_huge" | "high_remainder_if_huge" | "low_remainder_if_huge" => a[2],
                        other => unreachable!("{other}"),
                    }
                }
            };
            numbers.push(number);
        }
        numbers[numbers.len() - 1]
    }

    #[test]
    fn traces_have_the_bits_of_the_functions() {
        let mut random = fastrand::Rng::with_seed(9);
        let traces = elementary_functions(false);
        for _ in 0..2_000 {
            let mut draw = || (2.0 * random.f64() - 1.0) * 2.0_f64.powi(random.i32(-9..=6));
            let (a, b) = (draw(), draw());
            let expected = [
                Number::sin::<Fused>(a),
                Number::cos::<Fused>(a),
                Number::exp::<Fused>(a),
                Number::ln::<Fused>(a),
                Number::atan2::<Fused>(a, b),
                Number::moderate_atan2::<Fused>(a, b),
                Number::powf::<Fused>(a.abs(), b),
            ];
            for (trace, expected) in traces.iter().zip(expected) {
                let arguments = if trace.name == "powf" { [a.abs(), b] } else { [a, b] };
                let found = run(trace, &arguments);
                assert!(found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan(), "{}", trace.name);
            }
        }
        // Single precision is not a level: its traces have other constants and operations.
        let single = &elementary_functions(true)[2];
        assert!(single.steps.len() < traces[2].steps.len(), "a shorter polynomial");
        assert!(Number::exp::<Baseline>(1.0_f32) > 2.7);
    }
}
