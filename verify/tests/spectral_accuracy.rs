//! Rotations, stretches and singular values of matrices of any condition, against multi-precision: needles, near mirror
//! images, and singular values that nearly meet, in both precisions.
//!
//! With κ = σ₁/(σ₂ + σ₃) and roundoff u, errors of R are within 50 u κ. Those of its derivatives are within 50 u κ and
//! 100 u κ of their largest possible entries, 1/(σ₂ + σ₃) and its square. Errors of S are within 50 u σ₁, those of
//! singular values within 8 u σ₁. A flag is raised only where 50 u κ > 0.1.
//!
//! `SPECTRAL_MATRICES=100000 cargo test --release -p verify --test all spectral_accuracy:: -- --nocapture` takes more
//! matrices and prints the largest errors.

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use energy_compiler::Interpreted;
use energy_dsl::{Float, Inputs, Mask};

type Big = FBig<HalfEven, 2>;
type Matrix = [[Big; 3]; 3];

/// Bits of the significand. The squares of condition numbers up to 1e24, and differences of steps of 2⁻¹⁵⁰, keep their
/// digits.
const PRECISION: usize = 640;

fn big(x: f64) -> Big {
    Big::try_from(x).expect("a finite number").with_precision(PRECISION).value()
}

fn double(x: &Big) -> f64 {
    x.to_f64().value()
}

fn root(x: &Big) -> Big {
    x.sqrt()
}

fn sum(terms: impl IntoIterator<Item = Big>) -> Big {
    terms.into_iter().fold(big(0.0), |sum, term| sum + term)
}

fn matrix(mut entry: impl FnMut(usize, usize) -> Big) -> Matrix {
    let mut row = |i: usize| [entry(i, 0), entry(i, 1), entry(i, 2)];
    [row(0), row(1), row(2)]
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    matrix(|i, j| sum((0..3).map(|k| &a[i][k] * &b[k][j])))
}

fn transposed(a: &Matrix) -> Matrix {
    matrix(|i, j| a[j][i].clone())
}

/// F = Σ σᵢ uᵢ vᵢᵀ with det U = det V = 1: the vectors are the columns of U and V.
struct Decomposition {
    values: [Big; 3],
    left: Matrix,
    right: Matrix,
}

impl Decomposition {
    /// Computes the eigenvectors of FᵀF by Jacobi's method.
    fn new(f: &Matrix) -> Self {
        let mut gram = product(&transposed(f), f);
        let mut v = matrix(|i, j| big(if i == j { 1.0 } else { 0.0 }));
        for _ in 0..14 {
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                if gram[p][q] == big(0.0) {
                    continue;
                }
                let ratio = (&gram[q][q] - &gram[p][p]) / (&gram[p][q] * big(2.0));
                let size = root(&(&ratio * &ratio + big(1.0)));
                let tangent = if ratio < big(0.0) { big(-1.0) / (size - &ratio) } else { big(1.0) / (size + &ratio) };
                let cosine = big(1.0) / root(&(&tangent * &tangent + big(1.0)));
                let sine = &tangent * &cosine;
                let turn = matrix(|i, j| match (i, j) {
                    _ if (i, j) == (p, q) => sine.clone(),
                    _ if (i, j) == (q, p) => -&sine,
                    _ if i == j && (i == p || i == q) => cosine.clone(),
                    _ => big(if i == j { 1.0 } else { 0.0 }),
                });
                gram = product(&transposed(&turn), &product(&gram, &turn));
                v = product(&v, &turn);
            }
        }
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| gram[b][b].partial_cmp(&gram[a][a]).expect("numbers"));
        let columns = transposed(&v);
        let [first, second] = [0, 1].map(|k| columns[order[k]].clone());
        let axes = [first.clone(), second.clone(), cross(&first, &second)];
        let images: Vec<[Big; 3]> =
            axes.iter().map(|axis| std::array::from_fn(|i| sum((0..3).map(|k| &f[i][k] * &axis[k])))).collect();
        let unit = |image: &[Big; 3]| {
            let length = root(&sum(image.iter().map(|x| x * x)));
            (image.clone().map(|x| x / &length), length)
        };
        let ((u, s), (w, t)) = (unit(&images[0]), unit(&images[1]));
        let normal = cross(&u, &w);
        let third = sum((0..3).map(|k| &normal[k] * &images[2][k]));
        let left = transposed(&[u, w, normal]);
        Self { values: [s, t, third], left, right: transposed(&axes) }
    }

    fn rotation(&self) -> Matrix {
        product(&self.left, &transposed(&self.right))
    }

    fn stretch(&self) -> Matrix {
        let scaled = matrix(|i, j| &self.right[i][j] * &self.values[j]);
        product(&scaled, &transposed(&self.right))
    }

    /// Returns the derivatives of R by all entries of F, row by row: dR(X) = U Ω Vᵀ with Ωᵢⱼ = (xᵢⱼ − xⱼᵢ)/(σᵢ + σⱼ)
    /// and x = UᵀXV.
    fn rotation_rates(&self) -> Vec<Matrix> {
        let rate = |entry: usize| {
            let x = matrix(|i, j| &self.left[entry / 3][i] * &self.right[entry % 3][j]);
            let turn = matrix(|i, j| match i == j {
                true => big(0.0),
                false => (&x[i][j] - &x[j][i]) / (&self.values[i] + &self.values[j]),
            });
            product(&self.left, &product(&turn, &transposed(&self.right)))
        };
        (0..9).map(rate).collect()
    }
}

fn cross(a: &[Big; 3], b: &[Big; 3]) -> [Big; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        &a[j] * &b[k] - &a[k] * &b[j]
    })
}

/// Returns second derivatives of R by entries x and y of F: differences of first derivatives.
fn second_rates(f: &Matrix, rates: &[Matrix], gap: f64) -> Vec<Vec<Matrix>> {
    let step = big(gap.abs()) * big(2.0_f64.powi(-150));
    let by = |entry: usize| {
        let mut moved = f.clone();
        moved[entry / 3][entry % 3] = &moved[entry / 3][entry % 3] + &step;
        let there = Decomposition::new(&moved).rotation_rates();
        let difference = |(there, here): (&Matrix, &Matrix)| matrix(|i, j| (&there[i][j] - &here[i][j]) / &step);
        there.iter().zip(rates).map(difference).collect()
    };
    (0..9).map(by).collect()
}

/// The routines under test.
struct Subjects {
    rotation: Interpreted,
    entry: Interpreted,
    stretch: Interpreted,
    values: Interpreted,
}

impl Subjects {
    fn new() -> Self {
        let compiled = |source: &str| Interpreted::from_source(source).expect("a sound program").remove(0);
        Self {
            rotation: compiled("residual Turn(F: Mat3x3) { let R = rotation_of(F); [R[0], R[1], R[2]] }"),
            entry: compiled("energy Entry(a, b, c: Point; W: Mat3x3) { ddot(W, rotation_of(columns(a, b, c))) }"),
            stretch: compiled("residual Stretch(F: Mat3x3) { let S = stretch_of(F); [S[0], S[1], S[2]] }"),
            values: compiled("residual Values(F: Mat3x3) { singular_values(F) }"),
        }
    }
}

/// The largest errors, as multiples of their bounds, with their matrices.
#[derive(Default)]
struct Worst(Vec<(&'static str, f64, String)>);

impl Worst {
    fn record(&mut self, what: &'static str, error: f64, at: impl Fn() -> String) {
        let error = if error.is_nan() { f64::INFINITY } else { error };
        match self.0.iter_mut().find(|(name, ..)| *name == what) {
            Some((_, most, _)) if *most >= error => {}
            Some((_, most, place)) => (*most, *place) = (error, at()),
            None => self.0.push((what, error, at())),
        }
    }
}

fn largest(pairs: impl Iterator<Item = (f64, Big)>) -> f64 {
    pairs
        .map(|(got, truth)| if got.is_finite() { double(&(big(got) - truth)).abs() } else { f64::INFINITY })
        .fold(0.0, f64::max)
}

/// Compares all functions of one matrix. Returns whether it was flagged.
fn compare<S: Float + Into<f64>>(
    subjects: &Subjects,
    entries: [f64; 9],
    u: f64,
    with_second: bool,
    worst: &mut Worst,
) -> bool {
    let f: Matrix = matrix(|i, j| big(entries[3 * i + j]));
    let truth = Decomposition::new(&f);
    let sums = [(0, 1), (0, 2), (1, 2)].map(|(i, j)| double(&(&truth.values[i] + &truth.values[j])));
    let (size, gap) = (double(&truth.values[0]), sums[2]);
    let kappa = size / gap;
    let numbers = entries.map(|x| S::from_f64(x));
    let place = || format!("κ = {kappa:.2e}, σ = {:?}, {entries:?}", truth.values.clone().map(|x| double(&x)));
    let unknowns = Inputs { parameters: &[], rest: &[], positions: &numbers[..], velocities: &[] };
    let run = |subject: &Interpreted, routine: &str, inputs: &Inputs<'_, S>| {
        let (groups, flags) = subject.routine(routine, inputs).expect("no rest shape").expect("a routine");
        (groups.into_iter().map(|group| group.into_iter().map(S::into).collect()).collect::<Vec<Vec<f64>>>(), flags)
    };
    let (values, _) = run(&subjects.values, "residual", &unknowns);
    let error = largest(values[0].iter().copied().zip(truth.values.clone()));
    worst.record("singular values", error / (8.0 * u * size), place);
    let (turn, flags) = run(&subjects.rotation, "jacobian", &unknowns);
    let (stretch, stretch_flags) = run(&subjects.stretch, "residual", &unknowns);
    if (flags.degenerate | stretch_flags.degenerate).any() {
        let allowed = 50.0 * u * kappa > 0.1;
        worst.record("flags", if allowed { 0.0 } else { f64::INFINITY }, place);
        return true;
    }
    let (rotation, rates) = (truth.rotation(), truth.rotation_rates());
    let flat = |m: &Matrix| m.clone().into_iter().flatten().collect::<Vec<Big>>();
    let error = largest(turn[0].iter().copied().zip(flat(&rotation)));
    worst.record("R", error / (50.0 * u * kappa.max(1.0)), place);
    let error = largest(stretch[0].iter().copied().zip(flat(&truth.stretch())));
    worst.record("S", error / (50.0 * u * size), place);
    let error = largest((0..81).map(|k| (turn[1][k], rates[k % 9][k / 9 / 3][k / 9 % 3].clone())));
    worst.record("first derivatives", error * gap / (50.0 * u * kappa.max(1.0)), place);
    // In single precision, the inverse square of a gap may be infinite or have lost digits.
    let is_normal = 1e-30 < gap * gap && gap * gap < 1e30;
    if with_second && (is_normal || u < 1e-10) {
        let second = second_rates(&f, &rates, gap);
        for entry in 0..9 {
            let mut weights = [S::from_f64(0.0); 9];
            weights[entry] = S::from_f64(1.0);
            // Points are columns.
            let columns: [S; 9] = std::array::from_fn(|k| numbers[3 * (k % 3) + k / 3]);
            let inputs = Inputs { parameters: &weights[..], rest: &[], positions: &columns[..], velocities: &[] };
            let (groups, _) = run(&subjects.entry, "reduced_hessian", &inputs);
            let mut pairs = Vec::new();
            let mut index = 0;
            for a in 0..9 {
                for b in a..9 {
                    let [x, y] = [a, b].map(|k| 3 * (k % 3) + k / 3);
                    pairs.push((groups[2][index], second[x][y][entry / 3][entry % 3].clone()));
                    index += 1;
                }
            }
            let error = largest(pairs.into_iter());
            worst.record("second derivatives", error * gap * gap / (100.0 * u * kappa.max(1.0)), place);
        }
    }
    false
}

/// Returns the rotation of a random quaternion.
fn rotation(rng: &mut fastrand::Rng) -> [[f64; 3]; 3] {
    let q: [f64; 4] = std::array::from_fn(|_| rng.f64() * 2.0 - 1.0);
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|c| c / length);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// Returns a random matrix. Singular values have any size within `decades` from 1, or two of them nearly meet.
fn sample(rng: &mut fastrand::Rng, decades: f64, closest: f64, power: i32) -> [f64; 9] {
    let mut any = || 10.0_f64.powf(decades * (2.0 * rng.f64() - 1.0));
    let mut values = [any(), any(), any()];
    let apart = 10.0_f64.powf(-3.0 - (closest - 3.0) * rng.f64());
    let mut triple = false;
    match rng.u8(0..6) {
        0 => values[1] = values[0] * (1.0 - apart),
        1 | 2 => values[2] = values[1] * (1.0 - apart),
        3 => triple = true,
        _ => {}
    }
    if triple {
        // Near a point reflection, errors of S are amplified twice.
        let apart = apart.max(1e-5);
        values = [values[0], values[0] * (1.0 - apart), values[0] * (1.0 - apart * rng.f64())];
    }
    if rng.bool() {
        let smallest = (0..3).min_by(|&a, &b| values[a].total_cmp(&values[b])).expect("three");
        values[smallest] = -values[smallest];
    }
    let scale = 2.0_f64.powi(rng.i32(-power..=power));
    let (u, v) = match rng.u8(0..4) {
        0 => ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        _ => (rotation(rng), rotation(rng)),
    };
    std::array::from_fn(|e| (0..3).map(|k| u[e / 3][k] * values[k] * v[e % 3][k]).sum::<f64>() * scale)
}

fn matrices() -> usize {
    std::env::var("SPECTRAL_MATRICES").ok().and_then(|count| count.parse().ok()).unwrap_or(150)
}

/// Compares random matrices, one in ten with second derivatives.
fn all_within<S: Float + Into<f64>>(u: f64, decades: f64, closest: f64, power: i32) {
    let subjects = Subjects::new();
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(8);
    let parts: Vec<(Worst, usize)> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads)
            .map(|thread| {
                let subjects = &subjects;
                scope.spawn(move || {
                    let (mut worst, mut flagged) = (Worst::default(), 0);
                    for number in (thread..matrices()).step_by(threads) {
                        let mut rng = fastrand::Rng::with_seed(number as u64);
                        let entries = sample(&mut rng, decades, closest, power).map(|x| S::from_f64(x).into());
                        let with_second = number.is_multiple_of(10);
                        flagged += usize::from(compare::<S>(subjects, entries, u, with_second, &mut worst));
                    }
                    (worst, flagged)
                })
            })
            .collect();
        handles.into_iter().map(|handle| handle.join().expect("no panic")).collect()
    });
    let mut worst = Worst::default();
    for (what, error, place) in parts.iter().flat_map(|(worst, _)| &worst.0) {
        worst.record(what, *error, || place.clone());
    }
    let flagged: usize = parts.iter().map(|(_, flagged)| flagged).sum();
    println!("{flagged} of {} matrices flagged", matrices());
    for (what, error, place) in &worst.0 {
        println!("{what}: {error:.3} of the bound, at {place}");
    }
    for (what, error, place) in &worst.0 {
        assert!(*error <= 1.0, "{what}: {error:.3} times the bound, at {place}");
    }
}

#[test]
fn errors_in_double_precision_are_within_the_condition() {
    all_within::<f64>(2.0_f64.powi(-53), 12.0, 15.0, 0);
}

#[test]
fn errors_in_single_precision_are_within_the_condition() {
    all_within::<f32>(2.0_f64.powi(-24), 3.0, 7.0, 60);
}

/// The matrix of 10⁵ whose rotation takes the most steps: κ = 1.6e13, nearly a mirror image.
#[test]
fn the_slowest_refinement_converges() {
    let entries = [
        -49_068_264_790.600_174,
        -10_974_649_391.859_84,
        124_814_796_806.436_14,
        122_838_891_748.694_3,
        67_391_510_708.432_19,
        -12_370_729_742.532_782,
        -16_663_666_172.713_287,
        -154_990_792_269.807_6,
        77_236_823_374.584_84,
    ];
    let mut worst = Worst::default();
    let flagged = compare::<f64>(&Subjects::new(), entries, 2.0_f64.powi(-53), true, &mut worst);
    for (what, error, place) in &worst.0 {
        assert!(*error <= 1.0, "{what}: {error:.3} times the bound, at {place}");
    }
    assert!(!flagged);
}
