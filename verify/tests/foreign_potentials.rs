//! Potentials that other tools and papers print: random inputs are right to 2e-13. Results at singular inputs are the
//! limits, or flagged where no limit exists. Limits are checked along rays in multi-precision.
//!
//! `POTENTIAL_INPUTS=20,8 cargo test --release -p verify --test all foreign_potentials:: -- --nocapture` takes 20
//! random and 8 singular inputs for each, and prints the time at singular inputs. `POTENTIAL_SEED` chooses others.

use std::time::Instant;

use energy_compiler::{Interpreted, Textbook};
use energy_dsl::{Declaration, Field};
use fastrand::Rng;
use verify::Sample;
use verify::multiprecision::{self, Big, TrueBlock};

use crate::singular_programs::{Blocks, Limit, full, largest, limit, spread_between};

const POTENTIALS: &str = include_str!("../data/foreign_potentials.energy");
/// Rays through a singular input.
const RAYS: usize = 10;
/// Digits of true values.
const DIGITS: usize = 60;
/// Largest error at random inputs, relative to the largest number of a block.
const ACCURACY: f64 = 2e-13;
/// Potentials that lose digits: 1 − e⁻ˣ Σ xᵏ/k! cancels for small x, and singular vectors turn fast where stretches
/// nearly meet.
const CANCELLING: [(&str, f64); 2] = [("TangToennies", 1e-6), ("Ogden", 1e-10)];
const ROUTINES: [&str; 3] = ["value", "gradient", "hessian"];

/// Reads a number, or two, from the environment.
fn numbers<const N: usize>(variable: &str, default: [usize; N]) -> [usize; N] {
    let text = std::env::var(variable).unwrap_or_default();
    let mut given = text.split(',').filter_map(|number| number.parse().ok());
    default.map(|number| given.next().unwrap_or(number))
}

/// A potential, and random inputs for it.
struct Potential {
    element: Interpreted,
    textbook: Textbook,
    random: Rng,
}

fn potentials() -> Vec<Potential> {
    let [seed] = numbers("POTENTIAL_SEED", [1]);
    let elements = Interpreted::from_source(POTENTIALS).unwrap_or_else(|errors| panic!("{errors}"));
    let with_textbook = |(number, element): (usize, Interpreted)| {
        let textbook = Textbook::from_source(&element.declaration().source).expect("it compiled before");
        Potential { element, textbook, random: Rng::with_seed((1000 * seed + number) as u64) }
    };
    elements.into_iter().enumerate().map(with_textbook).collect()
}

impl Potential {
    fn declaration(&self) -> &Declaration {
        self.element.declaration()
    }

    fn accuracy(&self) -> f64 {
        let name = &self.declaration().name;
        CANCELLING.iter().find(|(other, _)| *other == name).map_or(ACCURACY, |(_, accuracy)| *accuracy)
    }

    /// Returns random parameters and a triangle at rest, with positions.
    fn sample(&mut self, positions: Vec<f64>) -> Sample {
        let count = |fields: &[Field]| fields.iter().map(|field| field.size).sum::<usize>();
        let parameters = (0..count(&self.declaration().parameters)).map(|_| 0.5 + self.random.f64()).collect();
        let rest = if self.declaration().rest.is_empty() { vec![] } else { vec![0.0, 0.0, 1.0, 0.0, 0.0, 1.0] };
        Sample { parameters, rest, positions, velocities: vec![] }
    }

    /// Returns an input near the unit simplex.
    fn ordinary(&mut self) -> Sample {
        let corner = |i: usize| if i >= 3 && i % 4 == 3 { 1.0 } else { 0.0 };
        let positions = (0..self.element.coordinates()).map(|i| corner(i) + 0.6 * (self.random.f64() - 0.5)).collect();
        self.sample(positions)
    }

    /// Returns an input with few different coordinates, so that points coincide, align, lie in a plane and fold.
    fn singular(&mut self) -> Sample {
        let others = self.random.u8(9..14);
        let positions = (0..self.element.coordinates()).map(|_| match self.random.u8(0..others) {
            0..=4 => 0.0,
            5 | 6 => 1.0,
            7 => -1.0,
            8 => 0.5,
            _ => self.random.f64(),
        });
        let positions = positions.collect();
        self.sample(positions)
    }

    /// Returns the blocks along all rays at a distance; `None` if one has no value.
    fn around(&mut self, sample: &Sample, distance: f64) -> Option<Vec<Blocks>> {
        let mut random = Rng::with_seed(7);
        let ray = |_| {
            let positions = sample.positions.iter().map(|_| distance * (random.f64() - 0.5)).collect();
            let zeros = |numbers: &[f64]| vec![0.0; numbers.len()];
            let offset = Sample {
                positions,
                parameters: zeros(&sample.parameters),
                rest: zeros(&sample.rest),
                velocities: vec![],
            };
            let blocks = multiprecision::truth_beside(self.declaration(), &self.textbook, sample, &offset, DIGITS);
            blocks.iter().all(|block| block.is_defined).then(|| [0, 1, 2].map(|k| doubles(&blocks[k])))
        };
        (0..RAYS).map(ray).collect()
    }
}

fn doubles(block: &TrueBlock) -> Vec<f64> {
    block.block.numbers.iter().map(Big::to_f64).collect()
}

/// Expands the triangle of blocks of a Hessian, if there is one.
fn expanded(mut blocks: Vec<Vec<f64>>, coordinates: usize) -> Vec<Vec<f64>> {
    if let Some(triangle) = blocks.get_mut(2) {
        *triangle = full(triangle, coordinates / 3);
    }
    blocks
}

#[test]
fn random_inputs_are_right_to_2e_13() {
    let [count, _] = numbers("POTENTIAL_INPUTS", [2, 1]);
    let (mut worst, mut inputs) = (0.0_f64, 0);
    for mut potential in potentials() {
        let coordinates = potential.element.coordinates();
        let accuracy = potential.accuracy();
        for _ in 0..count {
            let sample = potential.ordinary();
            let (blocks, flags) = potential.element.routine("hessian", &sample.inputs()).unwrap().unwrap();
            if flags.degenerate {
                // Outside of the domain.
                continue;
            }
            let blocks = expanded(blocks, coordinates);
            let truth = multiprecision::truth(potential.declaration(), &potential.textbook, &sample, 40);
            for (found, truth) in blocks.iter().zip(&truth) {
                let error = spread_between(found, &doubles(truth)) / truth.largest().max(1e-3);
                assert!(error <= accuracy, "{} at {sample:?}: {error:e}", potential.declaration().name);
                if accuracy == ACCURACY {
                    worst = worst.max(error);
                }
            }
            inputs += 1;
        }
    }
    println!("{inputs} inputs, largest error {worst:.1e}");
    assert!(inputs >= 30);
}

/// Findings at singular inputs.
#[derive(Default)]
struct Seen {
    limits: usize,
    flagged: usize,
    /// Results of one side where an angle jumps by 2π, as that of an exactly folded hinge.
    cuts: usize,
    /// Blocks that are flagged although rays in multi-precision agree.
    exceptions: Vec<String>,
    wrong: Vec<String>,
}

impl Potential {
    fn check_singular(&mut self, sample: &Sample, seen: &mut Seen) -> f64 {
        let mut slowest = 0.0_f64;
        let found: Vec<_> = ROUTINES
            .iter()
            .map(|routine| {
                let timed = |_| {
                    let start = Instant::now();
                    let found = self.element.routine(routine, &sample.inputs()).unwrap().unwrap();
                    (start.elapsed().as_secs_f64(), found)
                };
                let fastest = (0..5).map(timed).reduce(|a, b| if b.0 < a.0 { b } else { a }).unwrap();
                slowest = slowest.max(fastest.0);
                fastest.1
            })
            .collect();
        let rays = self.around(sample, 2.0_f64.powi(-100));
        for (order, (blocks, flags)) in found.into_iter().enumerate() {
            let flagged = flags.degenerate || flags.kink;
            let blocks = expanded(blocks, self.element.coordinates());
            let what = || format!("{} {} at {sample:?}", self.declaration().name, ROUTINES[order]);
            if !flagged && !blocks.iter().flatten().all(|number| number.is_finite()) {
                seen.wrong.push(format!("{}: not finite", what()));
            }
            // Rays that leave the domain tell nothing.
            let Some(rays) = &rays else { continue };
            let limits: Vec<Limit> = (0..=order).map(|block| limit(block, rays)).collect();
            if limits.iter().any(|limit| matches!(limit, Limit::Unknown)) {
                continue;
            }
            let exists = limits.iter().all(|limit| matches!(limit, Limit::Numbers(_)));
            match (exists, flagged) {
                (true, true) => seen.exceptions.push(what()),
                (false, false) if is_one_side(&blocks, rays) => seen.cuts += 1,
                (false, false) => seen.wrong.push(format!("{}: no flag", what())),
                (false, true) => seen.flagged += 1,
                (true, false) => seen.limits += 1,
            }
            for (found, limit) in blocks.iter().zip(&limits) {
                let Limit::Numbers(truth) = limit else { continue };
                let error = spread_between(found, truth) / largest(truth).max(1e-3);
                if !flagged && error > self.accuracy().max(1e-8) {
                    seen.wrong.push(format!("{}: error {error:e}", what()));
                }
            }
        }
        slowest
    }
}

/// Returns whether blocks are those of some rays, while all others have another value.
fn is_one_side(blocks: &[Vec<f64>], rays: &[Blocks]) -> bool {
    let is_near = |a: &[f64], b: &[f64]| spread_between(a, b) <= 1e-8 * largest(b).max(1e-3);
    let (same, others): (Vec<&Blocks>, Vec<&Blocks>) = rays.iter().partition(|ray| is_near(&blocks[0], &ray[0]));
    let are_found = same.iter().all(|ray| blocks.iter().zip(ray.iter()).all(|(found, limit)| is_near(found, limit)));
    !same.is_empty() && are_found && others.iter().all(|ray| is_near(&ray[0], &others[0][0]))
}

#[test]
fn singular_inputs_give_limits_or_flags() {
    let [_, count] = numbers("POTENTIAL_INPUTS", [2, 1]);
    let mut seen = Seen::default();
    let mut times = Vec::new();
    for mut potential in potentials() {
        for _ in 0..count {
            let sample = potential.singular();
            times.push((potential.check_singular(&sample, &mut seen), potential.declaration().name.clone()));
        }
    }
    times.sort_by(|a, b| b.0.total_cmp(&a.0));
    println!("{} limits, {} flags without a limit, {} at the cut of an angle", seen.limits, seen.flagged, seen.cuts);
    println!("flagged although a limit exists: {}", seen.exceptions.len());
    seen.exceptions.iter().for_each(|exception| println!("    {exception}"));
    times.iter().take(12).for_each(|(seconds, name)| println!("    {:7.0} µs {name}", 1e6 * seconds));
    assert!(seen.wrong.is_empty(), "{}", seen.wrong.join("\n"));
}
