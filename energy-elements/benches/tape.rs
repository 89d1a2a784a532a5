//! Compares the block tape with compiled lanes: `cargo bench -p energy-elements --bench tape`. Names of elements after
//! `--` select some.
//!
//! Prints nanoseconds per element for each routine, the ratio of tape to compiled lanes, the geometric mean and the
//! largest ratio, and the time from the text of the hinge to its first number. Both sides evaluate the same elements
//! in the same order and write the same layout; rounds alternate, and the fastest of each side counts.
#![allow(missing_docs)]

use std::hint::black_box;
use std::time::{Duration, Instant};

use energy_compiler::{Elements, InputKind, InputNumbers, Interpreted};
use energy_dsl::tape::{Column, Output, Places, TapeElements, stencil_blocks};
use energy_dsl::{
    Declaration, Inputs, Kind, Packed, PackedForce, PackedPotential, PackedResidual, RoutineKind, Vector3,
};
use energy_elements::*;

/// Elements per call.
const COUNT: usize = 512;

/// Returns random numbers from −1 to 1.
fn numbers() -> impl FnMut() -> f64 {
    let mut random = fastrand::Rng::with_seed(5);
    move || 2.0 * random.f64() - 1.0
}

/// Returns a sound rest shape.
fn rest_shape(declaration: &Declaration) -> Vec<f64> {
    match declaration.rest.iter().map(|field| field.size).sum::<usize>() {
        0 => vec![],
        6 => vec![0.0, 0.0, 1.0, 0.25, 0.25, 1.0],
        12 if declaration.name.starts_with("Tet") => {
            vec![0.0, 0.0, 0.0, 1.0, 0.25, 0.0, 0.0, 1.0, 0.25, 0.25, 0.0, 1.0]
        }
        12 => vec![0.5, -1.0, 0.0, 0.25, 0.75, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        18 => vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.25, 1.0, 0.0, 1.0, 1.0, 0.0, -0.75, 0.75, 0.0, 0.5, -1.0, 0.0],
        other => panic!("{}: no rest shape of {other} numbers here", declaration.name),
    }
}

/// Returns places near the rest shape; distinct ones without a rest shape.
fn places(declaration: &Declaration) -> Vec<f64> {
    let points = declaration.points.len();
    let shape = rest_shape(declaration);
    if declaration.points.iter().any(|field| field.size != 3) || declaration.kind == Kind::Residual {
        return vec![0.5; declaration.points.iter().map(|field| field.size).sum()];
    }
    match shape.len() {
        6 => shape.chunks(2).flat_map(|corner| [corner[0], corner[1], 0.0]).collect(),
        size if size == 3 * points && size > 0 => shape,
        _ => [0.5, -1.0, 0.0, 0.25, 0.75, 0.25, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0][..3 * points].to_vec(),
    }
}

/// Measured routine of an element.
struct Line {
    element: String,
    routine: &'static str,
    /// Nanoseconds per element.
    compiled: f64,
    tape: f64,
}

/// The same elements with their places, in the form of the tape.
struct Case {
    tape: TapeElements<f64>,
    elements: Elements<f64>,
    /// Parameters and stored numbers of each element.
    numbers: Vec<Vec<f64>>,
    /// Coordinates and velocities of each element, one element after the other.
    positions: Vec<f64>,
    velocities: Vec<f64>,
}

impl Case {
    fn of(declaration: &'static Declaration) -> Self {
        let element = Interpreted::from_source(&declaration.source).expect("it compiles").pop().expect("it is there");
        let mut draw = numbers();
        let mut column =
            |input: &InputNumbers| -> Vec<f64> { (0..COUNT * input.size()).map(|_| 1.0 + 0.5 * draw()).collect() };
        let of = |kind| element.inputs().iter().filter(move |input| input.kind == kind);
        let parameters: Vec<Vec<f64>> = of(InputKind::Parameter).map(&mut column).collect();
        let shape = rest_shape(declaration);
        let mut first = 0;
        let rest: Vec<Vec<f64>> = of(InputKind::Rest)
            .map(|input| {
                first += input.size();
                let own = &shape[first - input.size()..first];
                (0..COUNT).flat_map(|_| own.iter().map(|x| x + 0.05 * draw()).collect::<Vec<_>>()).collect()
            })
            .collect();
        let [rest, parameters] =
            [&rest, &parameters].map(|list| list.iter().map(|numbers| Column::Each(numbers)).collect::<Vec<_>>());
        let elements = element.elements(COUNT, &rest, &parameters).expect("sound rest shapes");
        let tape = elements.tape().clone();
        let (n, at_rest) = (element.coordinates(), places(declaration));
        Self {
            numbers: (0..COUNT).map(|i| tape.numbers_of(i)).collect(),
            tape,
            elements,
            positions: (0..COUNT * n).map(|i| at_rest[i % n] + 0.2 * draw()).collect(),
            velocities: (0..COUNT * n).map(|_| draw()).collect(),
        }
    }

    fn points(&self) -> (&[Vector3<f64>], &[Vector3<f64>]) {
        (self.positions.as_chunks().0, self.velocities.as_chunks().0)
    }

    fn packed<E: energy_dsl::Stored<f64>>(&self, elements: &[E], points: usize) -> Packed<E> {
        Packed::from_fn(COUNT, points, |i| &elements[i], |i, p| (points * i + p) as u32)
    }

    fn line(&self, routine: &'static str, compiled: impl FnMut(), tape: impl FnMut()) -> Line {
        let element = self.elements.element().declaration().name.to_string();
        let [compiled, tape] = fastest(compiled, tape).map(|seconds| 1e9 * seconds / COUNT as f64);
        Line { element, routine, compiled, tape }
    }
}

/// Returns the seconds of the fastest round of both sides, which alternate.
fn fastest(mut one: impl FnMut(), mut other: impl FnMut()) -> [f64; 2] {
    let mut best = [f64::INFINITY; 2];
    let mut round = |side: usize, run: &mut dyn FnMut()| {
        let start = Instant::now();
        let mut runs = 0_u32;
        while runs == 0 || start.elapsed() < Duration::from_micros(200) {
            run();
            runs += 1;
        }
        best[side] = best[side].min(start.elapsed().as_secs_f64() / f64::from(runs));
    };
    for _ in 0..40 {
        round(0, &mut one);
        round(1, &mut other);
    }
    best
}

fn output<'a>(layout: &'a [u16], numbers: &'a mut [f64]) -> Output<'a, f64> {
    Output { name: "results", layout, numbers }
}

fn potential<E: PackedPotential<f64, Wide<f64> = E>>() -> Vec<Line> {
    let case = Case::of(E::DECLARATION);
    let elements: Vec<E> = case.numbers.iter().map(|numbers| E::load::<f64>(&padded(numbers), 1)).collect();
    let points = E::DECLARATION.points.len();
    let (packed, (x, _)) = (case.packed(&elements, points), case.points());
    let stencils = stencil_blocks(COUNT, points, |i, p| (points * i + p) as u32);
    let places = Places::Gathered { vectors: x, stencils: &stencils };
    let triangle = 9 * points * (points + 1) / 2;
    let index = |range: std::ops::Range<usize>| range.map(|i| i as u16).collect::<Vec<_>>();
    let (value, gradient) = (index(0..1), index(1..1 + 3 * points));
    let upper = index(1 + 3 * points..1 + 3 * points + triangle);
    let mut e = [vec![0.0; COUNT], vec![0.0; COUNT]];
    let mut g = [vec![0.0; COUNT * 3 * points], vec![0.0; COUNT * 3 * points]];
    let mut h = [vec![0.0; COUNT * triangle], vec![0.0; COUNT * triangle]];
    let [(e0, e1), (g0, g1), (h0, h1)] = [&mut e, &mut g, &mut h].map(|pair| {
        let [one, other] = pair;
        (one, other)
    });
    let all = 0..COUNT;
    let mut lines = vec![case.line(
        "value",
        || drop(black_box(packed.values(all.clone(), black_box(x), e0))),
        || {
            let outputs = &mut [output(&value, e1)];
            drop(black_box(case.tape.evaluate(RoutineKind::Value, all.clone(), black_box(places), None, outputs)));
        },
    )];
    assert_same(&lines, &[(e0, e1)]);
    lines.push(case.line(
        "gradient",
        || drop(black_box(packed.gradients(all.clone(), black_box(x), e0, g0))),
        || {
            let outputs = &mut [output(&value, e1), output(&gradient, g1)];
            drop(black_box(case.tape.evaluate(RoutineKind::Gradient, all.clone(), black_box(places), None, outputs)));
        },
    ));
    assert_same(&lines, &[(e0, e1), (g0, g1)]);
    lines.push(case.line(
        "hessian",
        || drop(black_box(packed.hessians(all.clone(), black_box(x), e0, g0, h0))),
        || {
            let outputs = &mut [output(&value, e1), output(&gradient, g1), output(&upper, h1)];
            drop(black_box(case.tape.evaluate(RoutineKind::Hessian, all.clone(), black_box(places), None, outputs)));
        },
    ));
    assert_same(&lines, &[(e0, e1), (g0, g1), (h0, h1)]);
    lines
}

fn force<E: PackedForce<f64, Wide<f64> = E>>() -> Vec<Line> {
    let case = Case::of(E::DECLARATION);
    let elements: Vec<E> = case.numbers.iter().map(|numbers| E::load::<f64>(&padded(numbers), 1)).collect();
    let points = E::DECLARATION.points.len();
    let (packed, (x, v)) = (case.packed(&elements, points), case.points());
    let stencils = stencil_blocks(COUNT, points, |i, p| (points * i + p) as u32);
    let [places, speeds] = [x, v].map(|vectors| Places::Gathered { vectors, stencils: &stencils });
    let index = |from: usize, count: usize| (from..from + count).map(|i| i as u16).collect::<Vec<_>>();
    let (n, square) = (3 * points, 9 * points * points);
    let (vectors, position, velocity) = (index(0, n), index(n, square), index(n + square, square));
    let [mut f0, mut f1] = [vec![0.0; COUNT * n], vec![0.0; COUNT * n]];
    let [mut a0, mut a1, mut b0, mut b1] = [0; 4].map(|_| vec![0.0; COUNT * square]);
    let all = 0..COUNT;
    let mut lines = vec![case.line(
        "force",
        || drop(black_box(packed.forces(all.clone(), black_box(x), v, &mut f0))),
        || {
            let outputs = &mut [output(&vectors, &mut f1)];
            drop(black_box(case.tape.evaluate(
                RoutineKind::Force,
                all.clone(),
                black_box(places),
                Some(speeds),
                outputs,
            )));
        },
    )];
    assert_same(&lines, &[(&f0, &f1)]);
    lines.push(case.line(
        "jacobians",
        || drop(black_box(packed.force_jacobians(all.clone(), black_box(x), v, &mut f0, &mut a0, &mut b0))),
        || {
            let outputs = &mut [output(&vectors, &mut f1), output(&position, &mut a1), output(&velocity, &mut b1)];
            drop(black_box(case.tape.evaluate(
                RoutineKind::Jacobians,
                all.clone(),
                black_box(places),
                Some(speeds),
                outputs,
            )));
        },
    ));
    assert_same(&lines, &[(&f0, &f1), (&a0, &a1), (&b0, &b1)]);
    lines
}

fn residual<E: PackedResidual<f64, Wide<f64> = E>>() -> Vec<Line> {
    let case = Case::of(E::DECLARATION);
    let elements: Vec<E> = case.numbers.iter().map(|numbers| E::load::<f64>(&padded(numbers), 1)).collect();
    let unknowns: usize = E::DECLARATION.points.iter().map(|field| field.size).sum();
    let rows = E::DECLARATION.rows;
    let packed = case.packed(&elements, unknowns);
    let places = Places::Rows(&case.positions);
    let index = |from: usize, count: usize| (from..from + count).map(|i| i as u16).collect::<Vec<_>>();
    let (value, jacobian) = (index(0, rows), index(rows, rows * unknowns));
    let [mut r0, mut r1] = [0; 2].map(|_| vec![0.0; COUNT * rows]);
    let [mut j0, mut j1] = [0; 2].map(|_| vec![0.0; COUNT * rows * unknowns]);
    let all = 0..COUNT;
    let mut lines = vec![case.line(
        "residual",
        || drop(black_box(packed.residuals(all.clone(), black_box(&case.positions), &mut r0))),
        || {
            let outputs = &mut [output(&value, &mut r1)];
            drop(black_box(case.tape.evaluate(RoutineKind::Residual, all.clone(), black_box(places), None, outputs)));
        },
    )];
    assert_same(&lines, &[(&r0, &r1)]);
    lines.push(case.line(
        "jacobian",
        || drop(black_box(packed.jacobians(all.clone(), black_box(&case.positions), &mut r0, &mut j0))),
        || {
            let outputs = &mut [output(&value, &mut r1), output(&jacobian, &mut j1)];
            drop(black_box(case.tape.evaluate(RoutineKind::Jacobian, all.clone(), black_box(places), None, outputs)));
        },
    ));
    assert_same(&lines, &[(&r0, &r1), (&j0, &j1)]);
    lines
}

/// Returns numbers that lanes of one can be loaded from, also without any.
fn padded(numbers: &[f64]) -> Vec<f64> {
    if numbers.is_empty() { vec![0.0] } else { numbers.to_vec() }
}

fn assert_same(lines: &[Line], results: &[(&Vec<f64>, &Vec<f64>)]) {
    let Line { element, routine, .. } = lines.last().expect("one was measured");
    for (compiled, tape) in results {
        let same = compiled.iter().zip(*tape).all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan());
        assert!(same, "{element}: the bits of `{routine}` differ");
    }
}

/// Returns the milliseconds from the text of the hinge to its energy, in the fastest of some runs.
fn first_number() -> f64 {
    let source = &<QuadraticHinge<f64> as energy_dsl::Element>::DECLARATION.source;
    let x = [1.0, 0.25, 0.5, -0.75, 0.5, 0.25, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let run = || {
        let start = Instant::now();
        let hinge = Interpreted::from_source(source).expect("it compiles").remove(0);
        let inputs = Inputs { parameters: &[1.5, 0.25], rest: &[], positions: &x, velocities: &[] };
        black_box(hinge.routine("value", &inputs).expect("no rest shape"));
        1e3 * start.elapsed().as_secs_f64()
    };
    (0..10).map(|_| run()).fold(f64::INFINITY, f64::min)
}

macro_rules! table {
    ($($kind:ident $name:ident),*) => {
        &[$((stringify!($name), $kind::<$name<f64>> as fn() -> Vec<Line>)),*]
    };
}

/// Name of an element, and the function that measures it.
type Entry = (&'static str, fn() -> Vec<Line>);

const ELEMENTS: &[Entry] = energy_elements::for_each_element!(with kinds table);

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    println!("level {}\n", energy_dsl::level());
    println!("| element | routine | compiled, ns | tape, ns | ratio |\n|---|---|---:|---:|---:|");
    let mut ratios = Vec::new();
    for (_, measure) in ELEMENTS.iter().filter(|(name, _)| wanted.is_empty() || wanted.iter().any(|w| w == name)) {
        for Line { element, routine, compiled, tape } in measure() {
            let ratio = tape / compiled;
            println!("| {element} | {routine} | {compiled:.1} | {tape:.1} | {ratio:.2} |");
            ratios.push((ratio, element, routine));
        }
    }
    let mean = (ratios.iter().map(|(ratio, ..)| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp();
    let most = ratios.iter().max_by(|a, b| a.0.total_cmp(&b.0)).expect("some element was measured");
    println!("\ngeometric mean {mean:.2}, largest {:.2} ({} of {})", most.0, most.2, most.1);
    println!("from the text of the hinge to its first number: {:.2} ms", first_number());
}
