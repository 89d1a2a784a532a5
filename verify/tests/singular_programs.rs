//! Random programs at random singular inputs: coincident, collinear, flat, folded and infinite points. Results are
//! finite or flagged, and equal the limit wherever multi-precision finds one.
//!
//! `PROPTEST_CASES=10000 cargo test --release -p verify --test all singular_programs::` is the long run.

use std::sync::LazyLock;

use energy_compiler::{Interpreted, Textbook};
use energy_dsl::{Declaration, Inputs, triangle_index};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use verify::Sample;
use verify::multiprecision::{self, Big};

/// Generates a scalar expression with singularities.
fn scalar(depth: u32) -> BoxedStrategy<String> {
    let leaf = prop_oneof![
        2 => Just("p.x".to_owned()),
        1 => Just("(q.y - p.y)".to_owned()),
        1 => Just("k".to_owned()),
        2 => vector(0).prop_map(|v| format!("norm({v})")),
        1 => vector(0).prop_map(|v| format!("norm_squared({v})")),
        1 => (vector(0), vector(0)).prop_map(|(a, b)| format!("dot({a}, {b})")),
    ];
    if depth == 0 {
        return leaf.boxed();
    }
    let less = || scalar(depth - 1);
    let vectors = || vector(depth - 1);
    prop_oneof![
        1 => leaf,
        2 => (less(), less()).prop_map(|(a, b)| format!("({a} + {b})")),
        1 => (less(), less()).prop_map(|(a, b)| format!("({a} - {b})")),
        3 => (less(), less()).prop_map(|(a, b)| format!("({a} * {b})")),
        3 => (less(), less()).prop_map(|(a, b)| format!("({a} / {b})")),
        2 => less().prop_map(|a| format!("sqrt({a})")),
        1 => less().prop_map(|a| format!("log({a})")),
        1 => less().prop_map(|a| format!("sin({a})")),
        1 => less().prop_map(|a| format!("exp(-{a})")),
        1 => less().prop_map(|a| format!("tanh({a})")),
        1 => less().prop_map(|a| format!("(1 - cos({a}))")),
        1 => (less(), less()).prop_map(|(a, b)| format!("atan2({a}, ({b})^2)")),
        2 => less().prop_map(|a| format!("abs({a})")),
        1 => (less(), less()).prop_map(|(a, b)| format!("max({a}, {b})")),
        1 => (less(), less(), less()).prop_map(|(a, b, c)| format!("(if {a} < {b} {{ {c} }} else {{ ({c})^2 }})")),
        2 => (less(), 2..4_u8).prop_map(|(a, n)| format!("({a})^{n}")),
        1 => less().prop_map(|a| format!("({a})^1.5")),
        2 => (vectors(), vectors()).prop_map(|(a, b)| format!("dot(unit({a}), {b})")),
        1 => (vectors(), vectors()).prop_map(|(a, b)| format!("(1 - dot(unit({a}), unit({b})))")),
        1 => (vectors(), vectors()).prop_map(|(a, b)| format!("(1 + dot(unit({a}), unit({b})))")),
        2 => (vectors(), vectors()).prop_map(|(a, b)| format!("angle({a}, {b})")),
        1 => vectors().prop_map(|v| format!("(norm({v}) - k)^2")),
        1 => (vectors(), vectors(), vectors()).prop_map(|(a, b, c)| format!("det(columns({a}, {b}, {c}))")),
    ]
    .boxed()
}

fn vector(depth: u32) -> BoxedStrategy<String> {
    let leaf = prop_oneof![
        3 => Just("(q - p)".to_owned()),
        3 => Just("(r - q)".to_owned()),
        1 => Just("p".to_owned()),
    ];
    if depth == 0 {
        return leaf.boxed();
    }
    let less = || vector(depth - 1);
    prop_oneof![
        3 => leaf,
        1 => (less(), less()).prop_map(|(a, b)| format!("({a} + {b})")),
        1 => (less(), less()).prop_map(|(a, b)| format!("cross({a}, {b})")),
        1 => (scalar(depth - 1), less()).prop_map(|(s, a)| format!("({s} * {a})")),
        1 => less().prop_map(|a| format!("unit({a})")),
    ]
    .boxed()
}

/// Few coordinates, so that points coincide, align, lie in a plane and fold.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![5 => Just(0.0), 2 => Just(1.0), 1 => Just(-1.0), 1 => Just(0.5)]
}

const SIGNATURE: &str = "p, q, r: Point; k: Scalar";
/// The same formula at points moved by ε along a direction.
const MOVED: &str = "a, b, c: Point; k, e: Scalar, da, db, dc: Vec3";
const MOVES: &str = "let p = a + e * da; let q = b + e * db; let r = c + e * dc;";
/// A formula must use all inputs.
const USES: &str = "0 * (k + norm_squared(p) + norm_squared(q) + norm_squared(r))";

/// Returns the declaration that all moved formulas have. To compile each would take most of the time of this test.
fn moved_declaration() -> &'static Declaration {
    static MOVED_SIGNATURE: LazyLock<Interpreted> = LazyLock::new(|| {
        let source = format!("energy Moved({MOVED}) {{ {MOVES} {USES} }}");
        Interpreted::from_source(&source).expect("a valid signature").remove(0)
    });
    MOVED_SIGNATURE.declaration()
}

/// Directions whose components are dyadic, so that doubles hold them, and differ from point to point.
const DIRECTIONS: [[f64; 9]; 10] = [
    [-0.5625, -0.65625, 0.40625, -0.34375, -0.46875, 0.3125, -0.78125, 0.53125, -0.375],
    [0.5625, 0.65625, -0.40625, 0.34375, 0.46875, -0.3125, 0.78125, -0.53125, 0.375],
    [0.46875, -0.90625, 0.53125, -0.4375, 0.5625, 0.34375, 0.9375, 0.78125, -0.4375],
    [-0.46875, 0.90625, -0.53125, 0.4375, -0.5625, -0.34375, -0.9375, -0.78125, 0.4375],
    [-0.75, 0.34375, 0.28125, 0.84375, 0.78125, -0.6875, 0.875, 0.6875, 0.4375],
    [0.75, -0.34375, -0.28125, -0.84375, -0.78125, 0.6875, -0.875, -0.6875, -0.4375],
    [-0.5625, 0.3125, -0.3125, 0.90625, 0.78125, 0.96875, 0.40625, -0.34375, 0.46875],
    [0.5625, -0.3125, 0.3125, -0.90625, -0.78125, -0.96875, -0.40625, 0.34375, -0.46875],
    [0.53125, -0.625, 0.84375, 0.90625, -0.59375, -0.3125, -0.53125, -0.375, 0.4375],
    [0.71875, -0.3125, 0.96875, -0.5625, 0.28125, 0.5625, 0.40625, 0.875, -0.5625],
];

/// Digits of true values.
const DIGITS: usize = 70;

/// Value, gradient and Hessian.
pub(crate) type Blocks = [Vec<f64>; 3];

/// A point x with the formula moved from it.
struct Place<'a> {
    textbook: &'a Textbook,
    k: f64,
    x: &'a [f64],
}

impl Place<'_> {
    /// Computes the blocks along all directions at a distance; `None` if the formula has no value somewhere.
    fn around(&self, distance: f64) -> Option<Vec<Blocks>> {
        DIRECTIONS.iter().map(|direction| self.beside(direction, distance, DIGITS)).collect()
    }

    /// Returns whether blocks depend on the number of digits: rounding decides a comparison whose sides are equal, such
    /// as `norm(p)^3 < norm(p) * norm_squared(p)`.
    fn has_equal_sides(&self, distance: f64) -> bool {
        DIRECTIONS.iter().any(|direction| {
            let digits = [DIGITS, DIGITS + 9, DIGITS + 31].map(|digits| self.beside(direction, distance, digits));
            let Some(blocks) = digits.into_iter().collect::<Option<Vec<Blocks>>>() else { return true };
            let differs = |block: usize| spread(block, &blocks) > 1e-6 * largest(&blocks[0][block]).max(1e-3);
            (0..3).any(differs)
        })
    }

    /// Computes the blocks at x + ε d with at least this many digits; `None` if the formula has no value there.
    fn beside(&self, direction: &[f64; 9], distance: f64, digits: usize) -> Option<Blocks> {
        let blocks =
            multiprecision::truth(moved_declaration(), self.textbook, &self.sample(direction, distance), digits);
        let numbers = |k: usize| blocks[k].block.numbers.iter().map(Big::to_f64).collect::<Vec<f64>>();
        blocks.iter().all(|block| block.is_defined).then(|| [numbers(0), numbers(1), numbers(2)])
    }

    /// Returns the inputs of [`MOVED`] at x + ε d.
    fn sample(&self, direction: &[f64; 9], distance: f64) -> Sample {
        let parameters = [&[self.k, distance], &direction[..]].concat();
        Sample { parameters, rest: vec![], positions: self.x.into(), velocities: vec![] }
    }
}

impl Place<'_> {
    /// Looks for directions on which some block up to this order has another limit: first any, then those on which the
    /// formula takes another branch. Narrow regions contain none of [`DIRECTIONS`].
    fn has_other_limit(&self, order: usize, limits: &[Limit]) -> bool {
        let differs = |direction: &[f64; 9]| {
            let Some(found) = self.beside(direction, 2.0_f64.powi(-100), DIGITS) else { return false };
            (0..=order).any(|block| match &limits[block] {
                Limit::Numbers(known) => spread_between(known, &found[block]) > 1e-8 * largest(known).max(1e-3),
                Limit::None | Limit::Unknown => true,
            })
        };
        let mut random = fastrand::Rng::with_seed(1);
        if (0..60).any(|_| differs(&narrow_direction(&mut random))) {
            return true;
        }
        let branches =
            |direction: &[f64; 9]| self.textbook.branches(&self.sample(direction, 2.0_f64.powi(-20)).inputs());
        let mut seen: Vec<Vec<bool>> = DIRECTIONS.iter().map(branches).collect();
        for _ in 0..50_000 {
            let direction = narrow_direction(&mut random);
            let taken = branches(&direction);
            if !seen.contains(&taken) {
                seen.push(taken);
                if differs(&direction) {
                    return true;
                }
            }
        }
        false
    }
}

/// Returns a direction along which some points nearly move together and some coordinates nearly stay.
fn narrow_direction(random: &mut fastrand::Rng) -> [f64; 9] {
    let mut direction = [0.0; 9].map(|_: f64| 2.0 * random.f64() - 1.0);
    for i in 0..9 {
        let nearly = 0.1_f64.powf(3.0 * random.f64());
        match random.u8(0..4) {
            0 => direction[i] *= nearly,
            1 if i >= 3 => direction[i] = direction[i - 3] + nearly * direction[i],
            2 if i >= 6 => direction[i] = direction[i - 6] + nearly * direction[i],
            _ => {}
        }
    }
    direction
}

pub(crate) fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |largest, x| largest.max(x.abs()))
}

pub(crate) fn spread_between(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |largest, (a, b)| largest.max((a - b).abs()))
}

/// Limit of a block along all directions.
#[derive(Debug)]
pub(crate) enum Limit {
    Numbers(Vec<f64>),
    /// Directions differ.
    None,
    /// It converges too slowly to tell.
    Unknown,
}

/// Returns the largest difference between two directions in any entry.
fn spread(block: usize, found: &[Blocks]) -> f64 {
    let of_entry = |entry: usize| {
        let values = found.iter().map(|blocks| blocks[block][entry]);
        values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
    };
    (0..found[0][block].len()).map(of_entry).fold(0.0, f64::max)
}

pub(crate) fn limit(block: usize, found: &[Blocks]) -> Limit {
    let largest = found.iter().flat_map(|blocks| &blocks[block]).fold(0.0_f64, |largest, x| largest.max(x.abs()));
    if largest > 1e25 {
        return Limit::None;
    }
    let spread = spread(block, found);
    if spread <= 1e-12 * largest.max(1e-3) {
        Limit::Numbers(found[0][block].clone())
    } else if spread > 1e-2 * largest && largest > 1e-3 && largest < 1e6 {
        Limit::None
    } else {
        Limit::Unknown
    }
}

fn check(formula: &str, k: f64, x: &[f64]) -> Result<(), TestCaseError> {
    let source = format!("energy Random({SIGNATURE}) {{ {formula} + {USES} }}");
    let moved = format!("energy Moved({MOVED}) {{ {MOVES} {formula} + {USES} }}");
    // A formula may be refused: `log(0)` of what folds to a constant.
    let Ok(mut elements) = Interpreted::from_source(&source) else { return Err(TestCaseError::reject("refused")) };
    let element = elements.remove(0);
    let inputs = Inputs { parameters: &[k], rest: &[], positions: x, velocities: &[] };
    let results = ["value", "gradient", "hessian"]
        .map(|name| element.routine(name, &inputs).expect("no rest shape").expect("an energy"));
    for (groups, flags) in &results {
        let is_finite = groups.iter().flatten().all(|number| number.is_finite());
        prop_assert!(is_finite || flags.degenerate, "{source}\nat {x:?}: {groups:?} {flags:?}");
    }
    if x.iter().any(|x| !x.is_finite()) {
        return Ok(());
    }
    let Ok(textbook) = Textbook::from_source(&moved) else { return Err(TestCaseError::reject("refused")) };
    let place = Place { textbook: &textbook, k, x };
    // Only inputs with a neighbourhood in the domain.
    let Some(found) = place.around(2.0_f64.powi(-100)) else { return Ok(()) };
    // Directions may differ less and less, but too slowly to tell, as 1/ln ‖p‖ does.
    let settles = |block: usize| {
        let nearer = place.around(2.0_f64.powi(-200));
        nearer.is_some_and(|nearer| spread(block, &nearer) < 0.9 * spread(block, &found))
    };
    let limit = |block: usize| match limit(block, &found) {
        Limit::None if settles(block) => Limit::Unknown,
        known => known,
    };
    for (order, (groups, flags)) in results.iter().enumerate() {
        let limits: Vec<Limit> = (0..=order).map(limit).collect();
        if limits.iter().any(|limit| matches!(limit, Limit::Unknown)) {
            continue;
        }
        let exists = limits.iter().all(|limit| matches!(limit, Limit::Numbers(_)));
        let flagged = flags.degenerate || flags.kink;
        // `angle(a, a)` is a convention everywhere.
        if exists && flagged && is_flagged_nearby(&element, ["value", "gradient", "hessian"][order], k, x) {
            continue;
        }
        if exists && flagged && place.has_other_limit(order, &limits) {
            continue;
        }
        if !exists && !flagged && place.has_equal_sides(2.0_f64.powi(-100)) {
            continue;
        }
        prop_assert_eq!(
            exists,
            !flagged,
            "{}\nat {:?}, order {}: {:?}\n{:?}\n{:?}",
            source,
            x,
            order,
            flags,
            groups,
            limits
        );
        for (block, limit) in limits.iter().enumerate() {
            let Limit::Numbers(truth) = limit else { continue };
            if !exists && block > 0 {
                continue;
            }
            let found = if block == 2 { full(&groups[2], 3) } else { groups[block].clone() };
            let scale = truth.iter().fold(1e-3_f64, |scale, x| scale.max(x.abs()));
            for (a, b) in found.iter().zip(truth) {
                prop_assert!((a - b).abs() <= 1e-8 * scale, "{source}\nat {x:?}, block {block}: {a:e}, truly {b:e}");
            }
        }
    }
    Ok(())
}

fn is_flagged_nearby(element: &Interpreted, routine: &str, k: f64, x: &[f64]) -> bool {
    DIRECTIONS.iter().any(|direction| {
        let x: Vec<f64> = x.iter().zip(direction).map(|(x, d)| x + 1e-3 * d).collect();
        let inputs = Inputs { parameters: &[k], rest: &[], positions: &x, velocities: &[] };
        let found = element.routine(routine, &inputs).expect("no rest shape");
        found.is_some_and(|(_, flags)| flags.degenerate || flags.kink)
    })
}

/// Expands the triangle of blocks of some points to a matrix.
pub(crate) fn full(triangle: &[f64], points: usize) -> Vec<f64> {
    let entry = |row: usize, column: usize| {
        let (row, column) = if row / 3 <= column / 3 { (row, column) } else { (column, row) };
        let block = triangle_index(points, row / 3, column / 3);
        triangle[9 * block + 3 * (row % 3) + column % 3]
    };
    let size = 3 * points;
    (0..size * size).map(|i| entry(i / size, i % size)).collect()
}

/// `max` returns the other number where one is NaN, but its derivatives are NaN.
#[test]
fn derivatives_at_infinite_inputs_are_flagged() {
    let mut x = [0.0; 9];
    x[1] = f64::INFINITY;
    for formula in ["max(p.x, dot((r - q), (q - p)))", "exp(-norm_squared(p))", "tanh(norm_squared(p))", "atan(p.y^2)"]
    {
        check(formula, 1.0, &x).unwrap_or_else(|error| panic!("{error}"));
    }
}

/// No fixed ray meets the narrower branch. A jump of the value, and a kink.
#[test]
fn branches_in_narrow_cones_are_noticed() {
    let mut x = [0.0; 9];
    for formula in [
        "if p.x < norm(q - p) { k } else { k^2 }",
        "if p.x < norm(r - p) { p.y } else { norm_squared(q - p) }",
        "if 20 * norm(q - p) < p.x { p.y } else { 2 * p.y }",
        "max(p.x - 20 * norm(r - q), 0)",
    ] {
        check(formula, 2.0, &x).unwrap_or_else(|error| panic!("{error}"));
        let source = format!("energy Narrow({SIGNATURE}) {{ {formula} + {USES} }}");
        let element = Interpreted::from_source(&source).expect("a valid formula").remove(0);
        let inputs = Inputs { parameters: &[2.0], rest: &[], positions: &x, velocities: &[] };
        let (_, flags) = element.routine("gradient", &inputs).expect("no rest shape").expect("an energy");
        assert!(flags.kink || flags.degenerate, "{formula}");
    }
    x[0] = 1e-3;
    check("if p.x < norm(q - p) { k } else { k^2 }", 2.0, &x).unwrap_or_else(|error| panic!("{error}"));
}

/// Its limit 0 is approached as slowly as a logarithm grows.
#[test]
fn slow_limits_raise_no_alarm() {
    check("atan2((k)^3, (log(norm(p)))^2)", 2.0, &[0.0; 9]).expect("no flag is asked for");
}

/// Programs of long runs at which the test or the code was once wrong.
#[test]
fn identities_are_exact() {
    let x = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 1.0];
    check("1 + dot(unit(q - p), unit(unit(q - p)))", 1.0, &x).unwrap_or_else(|error| panic!("{error}"));
    let x = [1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    let tie = "if norm(q - p)^3 < norm(q - p) * norm_squared(q - p) { p.x } else { p.x^2 }";
    check(tie, 1.0, &x).unwrap_or_else(|error| panic!("{error}"));
    let x = [0.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0, -1.0];
    // Opposite on some directions, along none of the fixed ones.
    let parallel = "1 - dot(unit(p.x * (r - q)), unit(dot(p, (q - p)) * (r - q)))";
    check(parallel, 1.0, &x).unwrap_or_else(|error| panic!("{error}"));
}

/// The same programs each time, or as many others as `PROPTEST_CASES` asks for.
fn config() -> ProptestConfig {
    let asked = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok());
    let rng_seed = if asked.is_some() { RngSeed::Random } else { RngSeed::Fixed(7) };
    ProptestConfig {
        cases: asked.unwrap_or(256),
        rng_seed,
        failure_persistence: None,
        max_global_rejects: 100_000,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn results_are_finite_or_flagged_and_equal_the_limit_where_there_is_one(
        formula in (1..3_u32).prop_flat_map(scalar),
        k in prop_oneof![Just(1.0), Just(0.5), Just(2.0)],
        x in prop::collection::vec(coordinate(), 9),
        infinite in prop_oneof![15 => Just(None), 1 => (0..9_usize).prop_map(Some)],
    ) {
        let mut x = x;
        if let Some(i) = infinite {
            x[i] = f64::INFINITY;
        }
        check(&formula, k, &x)?;
    }
}
