//! The methods of computing an element's Hessian. Each is in its best form: differences at their best step, num-dual on
//! the plain formula with all derivatives at once. The others run the same generated code.

use std::cell::RefCell;
use std::hint::black_box;
use std::time::{Duration, Instant};

use energy_compiler::{Elements, InputKind, InputNumbers};
use energy_dsl::tape::Column;
use energy_dsl::{
    Array, Batch, BatchWork, Block, Level, Packed, PackedPotential, Potential, Real, Vector3, for_each_batch,
    triangle_index,
};
use serde::Serialize;

use verify::audit::Subject;
use verify::blocks::BlockName;
use verify::formula::expected_blocks;
use verify::geometry::longest_distance;
use verify::multiprecision::{TrueBlock, truth, worse};
use verify::sample::Sample;

use crate::complex::Complex;

/// Digits of the method multi-precision.
const DIGITS: usize = 30;
/// Digits of the reference value, with which all methods are compared.
const REFERENCE_DIGITS: usize = 60;
/// Elements in a batch over SIMD lanes.
const MANY: usize = 1024;

/// Run time and error of a method for one element.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Name of the element.
    pub element: String,
    /// Name of the method.
    pub method: &'static str,
    /// Nanoseconds per Hessian.
    pub nanoseconds: f64,
    /// Largest error over all inputs, relative to the largest entry.
    pub error: f64,
}

/// Data shared by all methods of one element.
pub(super) struct Methods<'a> {
    pub(super) subject: &'a Subject,
    pub(super) samples: &'a [Sample],
    truths: Vec<TrueBlock>,
}

type Make<'a, E> = &'a dyn Fn(&Sample) -> E;

impl<'a> Methods<'a> {
    pub(super) fn new(subject: &'a Subject, samples: &'a [Sample]) -> Self {
        let truths = samples.iter().map(|sample| hessian(subject, sample, REFERENCE_DIGITS)).collect();
        Self { subject, samples, truths }
    }

    /// Measures every method, from the least to the most exact.
    pub(super) fn all<D, S, C>(
        &self,
        double: Make<'_, D>,
        single: Make<'_, S>,
        complex: Make<'_, C>,
        dual: &dyn Fn(&Sample) -> Vec<f64>,
    ) -> Vec<Measured>
    where
        D: PackedPotential<f64>,
        S: Potential<f32>,
        C: Potential<Complex>,
    {
        let doubles: Vec<(D, D::Points)> = self.samples.iter().map(|s| (double(s), points(s))).collect();
        let singles: Vec<(S, S::Points)> = self.samples.iter().map(|s| (single(s), points(s))).collect();
        let complexes: Vec<(C, C::Points)> = self.samples.iter().map(|s| (complex(s), points(s))).collect();
        let sizes: Vec<f64> = self.samples.iter().map(|s| longest_distance(&s.positions).unwrap_or(1.0)).collect();
        let differences = |method, stencil: &[(f64, f64)]| {
            self.at_best_step(method, |i, step| by_differences(&doubles[i], stencil, step * sizes[i]))
        };
        let mut list = vec![
            differences("forward differences", &[(0.0, -1.0), (1.0, 1.0)]),
            differences("central differences", &[(-1.0, -0.5), (1.0, 0.5)]),
            differences(
                "Richardson's differences",
                &[(-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0)],
            ),
            self.measure("complex step", |i| by_complex_step(&complexes[i])),
            self.measure("num-dual", |i| dual(&self.samples[i])),
        ];
        let timed = self.time(|i| discard(singles[i].0.hessian(black_box(&singles[i].1)).hessian));
        let error = self.error(|i| full(singles[i].0.hessian(&singles[i].1).hessian.as_ref(), f64::from));
        list.push(self.measured("generated, f32", timed, error));
        let timed = self.time(|i| discard(doubles[i].0.hessian(black_box(&doubles[i].1)).hessian));
        let error = self.error(|i| full(doubles[i].0.hessian(&doubles[i].1).hessian.as_ref(), |x| x));
        list.push(self.measured("generated, f64", timed, error));
        let lanes = Lanes::new(&doubles);
        let error = self.error(|i| full(&lanes.triangle(i), |x| x));
        list.push(self.measured("generated, f64 lanes", lanes.time(), error));
        list.push(self.multiprecision());
        list
    }

    /// Measures the methods that need no compilation, from the least to the most exact.
    pub(super) fn interpreted(&self) -> Result<Vec<Measured>, String> {
        let Self { subject, samples, .. } = self;
        for sample in *samples {
            subject.answer(sample).map_err(|why| why.to_string())?;
        }
        let block = |sample: &Sample, name: BlockName| {
            let answer = subject.answer(sample).expect("it has an answer at this input");
            answer.block(name).numbers.clone()
        };
        let central = |i: usize, step: f64| {
            let h = longest_distance(&samples[i].positions).unwrap_or(1.0) * step;
            let n = samples[i].positions.len();
            let mut matrix = vec![0.0; n * n];
            for column in 0..n {
                let slope = |offset: f64| {
                    let mut moved = samples[i].clone();
                    moved.positions[column] += offset;
                    block(&moved, BlockName::Gradient)
                };
                for (row, (ahead, behind)) in slope(h).into_iter().zip(slope(-h)).enumerate() {
                    matrix[row * n + column] = (ahead - behind) / (2.0 * h);
                }
            }
            matrix
        };
        let dual = |i: usize| {
            let blocks = expected_blocks(&subject.declaration, &subject.formula, &samples[i]);
            let hessian = blocks.into_iter().find(|block| block.name == BlockName::Hessian);
            hessian.expect("energies have Hessians").numbers
        };
        let tape = TapeLanes::new(subject, samples)?;
        let error = self.error(|i| tape.hessian(i));
        Ok(vec![
            self.at_best_step("central differences, interpreted", central),
            self.measure("dual numbers, interpreted", dual),
            self.measure("tape, one element at a time", |i| block(&samples[i], BlockName::Hessian)),
            self.measured("tape, f64 lanes", tape.time(), error),
            self.multiprecision(),
        ])
    }

    /// Measures multi-precision, whose error doubles cannot hold.
    fn multiprecision(&self) -> Measured {
        let found = |i: usize| hessian(self.subject, &self.samples[i], DIGITS);
        let of = |(i, truth): (usize, &TrueBlock)| truth.relative_difference(&found(i));
        let error = self.truths.iter().enumerate().map(of).fold(0.0, worse);
        self.measured("multi-precision, 30 digits", self.time(|i| discard(found(i))), error)
    }

    /// Measures differences at the step, relative to the size of the element, whose largest error is least.
    fn at_best_step(&self, method: &'static str, run: impl Fn(usize, f64) -> Vec<f64>) -> Measured {
        let steps = (2..=40).map(|k| f64::from(-k).exp2());
        let errors = steps.map(|step| (step, self.error(|i| run(i, step))));
        let least = errors.filter(|(_, error)| !error.is_nan()).min_by(|a, b| a.1.total_cmp(&b.1));
        let (step, error) = least.unwrap_or((f64::EPSILON.cbrt(), f64::NAN));
        self.measured(method, self.time(|i| discard(run(i, step))), error)
    }

    fn measured(&self, method: &'static str, nanoseconds: f64, error: f64) -> Measured {
        Measured { element: self.subject.declaration.name.to_string(), method, nanoseconds, error }
    }

    fn measure(&self, method: &'static str, run: impl Fn(usize) -> Vec<f64>) -> Measured {
        let error = self.error(&run);
        self.measured(method, self.time(|i| discard(run(i))), error)
    }

    /// Returns the nanoseconds per run: the minimum over some rounds, each over all inputs.
    fn time(&self, run: impl Fn(usize)) -> f64 {
        let count = self.samples.len();
        least(count, || (0..count).for_each(&run))
    }

    fn error(&self, run: impl Fn(usize) -> Vec<f64>) -> f64 {
        let of = |(i, truth): (usize, &TrueBlock)| {
            let error = truth.block.numbers.iter().zip(run(i)).map(|(t, got)| t.error_of(got)).fold(0.0, worse);
            // A zero Hessian (a barrier out of reach) has no relative error.
            if error == 0.0 { 0.0 } else { error / truth.largest() }
        };
        self.truths.iter().enumerate().map(of).fold(0.0, worse)
    }
}

/// Keeps the computation of a result that is not used.
#[inline(always)]
fn discard<T>(result: T) {
    let _ = black_box(result);
}

/// Returns the nanoseconds per item of a round of `count` items, in the fastest round.
fn least(count: usize, round: impl Fn()) -> f64 {
    const FOR: Duration = Duration::from_millis(60);
    let start = Instant::now();
    let mut best = f64::INFINITY;
    while start.elapsed() < FOR || best.is_infinite() {
        // Short rounds are repeated, because reading the clock takes time.
        let mut repeats = 0_u32;
        let round_start = Instant::now();
        while repeats < 1 || round_start.elapsed() < Duration::from_millis(2) {
            round();
            repeats += 1;
        }
        let taken = round_start.elapsed().as_secs_f64() / f64::from(repeats);
        best = best.min(1e9 * taken / count as f64);
    }
    best
}

fn hessian(subject: &Subject, sample: &Sample, digits: usize) -> TrueBlock {
    let blocks = truth(&subject.declaration, &subject.formula, sample, digits);
    blocks.into_iter().find(|truth| truth.block.name == BlockName::Hessian).expect("energies have Hessians")
}

fn points<T: Real, P: Array<Vector3<T>>>(sample: &Sample) -> P {
    P::from_fn(|point| std::array::from_fn(|axis| T::from_f64(sample.positions[3 * point + axis])))
}

/// Expands a triangle of blocks to the full matrix.
fn full<T: Copy>(triangle: &[Block<T>], number: impl Fn(T) -> f64) -> Vec<f64> {
    let points = (1..).find(|n| n * (n + 1) / 2 == triangle.len()).expect("a triangle");
    let entries = (0..9 * points * points).map(|entry| (entry / (3 * points), entry % (3 * points)));
    entries
        .map(|(row, column)| {
            let (row, column) = if row / 3 <= column / 3 { (row, column) } else { (column, row) };
            number(triangle[triangle_index(points, row / 3, column / 3)][row % 3][column % 3])
        })
        .collect()
}

/// Differences of the gradient: Σ weight · g(x + offset · h) / h.
fn by_differences<E: Potential<f64>>((element, x): &(E, E::Points), stencil: &[(f64, f64)], h: f64) -> Vec<f64> {
    let n = 3 * E::Points::LEN;
    let mut matrix = vec![0.0; n * n];
    let here = element.gradient(x).gradient;
    for column in 0..n {
        for &(offset, weight) in stencil {
            let mut moved = *x;
            moved.as_mut()[column / 3][column % 3] += offset * h;
            let at = if offset == 0.0 { here } else { element.gradient(&moved).gradient };
            for (row, g) in at.as_ref().as_flattened().iter().enumerate() {
                matrix[row * n + column] += weight * g / h;
            }
        }
    }
    matrix
}

/// Complex step: Im ∇U(x + i h e)/h.
fn by_complex_step<E: Potential<Complex>>((element, x): &(E, E::Points)) -> Vec<f64> {
    const H: f64 = 1e-100;
    let n = 3 * E::Points::LEN;
    let mut matrix = vec![0.0; n * n];
    for column in 0..n {
        let mut moved = *x;
        moved.as_mut()[column / 3][column % 3].im = H;
        for (row, g) in element.gradient(&moved).gradient.as_ref().as_flattened().iter().enumerate() {
            matrix[row * n + column] = g.im / H;
        }
    }
    matrix
}

/// Computes batches of Hessians and discards them.
struct Discarded;

impl<E: PackedPotential<f64>> BatchWork<E> for Discarded {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        black_box(&batch.element.hessian_at::<L>(batch.points));
    }
}

/// A batch of elements over SIMD lanes, which repeats some of them.
struct Lanes<E: PackedPotential<f64>> {
    packed: Packed<E>,
    positions: Vec<Vector3<f64>>,
    different: usize,
}

impl<E: PackedPotential<f64>> Lanes<E> {
    fn new(elements: &[(E, E::Points)]) -> Self {
        let n = E::Points::LEN;
        let own = |element: usize| &elements[element % elements.len()];
        let packed = Packed::from_fn(MANY, n, |element| &own(element).0, |element, point| (n * element + point) as u32);
        let positions = (0..MANY).flat_map(|element| own(element).1.as_ref().to_vec()).collect();
        Self { packed, positions, different: elements.len() }
    }

    /// Returns the nanoseconds per element.
    fn time(&self) -> f64 {
        least(MANY, || for_each_batch(black_box(&self.packed), &self.positions, &mut Discarded))
    }

    /// Returns the Hessian of one of the different elements, from its last copy in the batch.
    fn triangle(&self, element: usize) -> Vec<Block<f64>> {
        let (n, blocks) = (3 * E::Points::LEN, <E::Triangle as Array<Block<f64>>>::LEN);
        let mut energies = vec![0.0; MANY];
        let mut gradients = vec![0.0; MANY * n];
        let mut triangles = vec![[[0.0; 3]; 3]; MANY * blocks];
        let numbers = triangles.as_flattened_mut().as_flattened_mut();
        let done = self.packed.hessians(0..MANY, &self.positions, &mut energies, &mut gradients, numbers);
        done.expect("the slices fit the range");
        let of = |number: usize| &triangles[number * blocks..(number + 1) * blocks];
        let last = (element..MANY).step_by(self.different).next_back().unwrap_or(element);
        of(last).to_vec()
    }
}

/// A batch of elements of a declaration that was read, evaluated in blocks.
struct TapeLanes {
    elements: Elements<f64>,
    positions: Vec<f64>,
    coordinates: usize,
}

impl TapeLanes {
    fn new(subject: &Subject, samples: &[Sample]) -> Result<Self, String> {
        let element = subject.interpreted.as_ref().ok_or("this declaration was not read at run time")?;
        let own = |number: usize| &samples[number % samples.len()];
        let columns = |kind: InputKind, numbers: fn(&Sample) -> &[f64]| {
            let mut first = 0;
            let column = |input: &InputNumbers| {
                first += input.size();
                (0..MANY).flat_map(|i| numbers(own(i))[first - input.size()..first].to_vec()).collect::<Vec<f64>>()
            };
            element.inputs().iter().filter(|input| input.kind == kind).map(column).collect::<Vec<_>>()
        };
        let rest = columns(InputKind::Rest, |s| &s.rest);
        let parameters = columns(InputKind::Parameter, |s| &s.parameters);
        let [rest, parameters] =
            [&rest, &parameters].map(|list| list.iter().map(|numbers| Column::Each(numbers)).collect::<Vec<_>>());
        let elements = element.elements(MANY, &rest, &parameters).map_err(|error| error.to_string())?;
        let positions = (0..MANY).flat_map(|i| own(i).positions.clone()).collect();
        Ok(Self { elements, positions, coordinates: element.coordinates() })
    }

    fn outputs(&self) -> [Vec<f64>; 3] {
        let n = self.coordinates;
        [vec![0.0; MANY], vec![0.0; MANY * n], vec![0.0; MANY * n * n]]
    }

    /// Returns the nanoseconds per element.
    fn time(&self) -> f64 {
        let outputs = RefCell::new(self.outputs());
        least(MANY, || {
            let [energies, gradients, hessians] = &mut *outputs.borrow_mut();
            discard(self.elements.hessians(0..MANY, black_box(&self.positions), energies, gradients, hessians));
        })
    }

    /// Returns the Hessian of an element.
    fn hessian(&self, element: usize) -> Vec<f64> {
        let [mut energies, mut gradients, mut hessians] = self.outputs();
        let done = self.elements.hessians(0..MANY, &self.positions, &mut energies, &mut gradients, &mut hessians);
        done.expect("the slices fit the range");
        let size = self.coordinates * self.coordinates;
        hessians[element * size..(element + 1) * size].to_vec()
    }
}
