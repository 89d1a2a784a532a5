use energy_dsl::{Declaration, Field};
use fastrand::Rng;

use super::subject::Subject;
use crate::blocks::{Answer, BlockName};
use crate::multiprecision::{TrueBlock, worse};
use crate::sample::{Sample, has_points};

const ROUNDOFF: f64 = f64::EPSILON / 2.0;

/// The largest error in units of roundoff of the block's largest number. A block that vanishes has rounding errors of its
/// natural size.
pub(super) fn in_roundoffs(truth: &TrueBlock, got: &[f64], natural: f64) -> f64 {
    let error = truth.block.numbers.iter().zip(got).map(|(t, &g)| t.error_of(g)).fold(0.0, worse);
    let largest = truth.largest();
    let scale = if largest > ROUNDOFF * natural { largest } else { natural };
    match error {
        0.0 => 0.0,
        _ if scale == 0.0 => f64::INFINITY,
        _ => error / scale.max(f64::MIN_POSITIVE) / ROUNDOFF,
    }
}

/// κ of a block: how much a relative componentwise perturbation of the edges between points (and of those of the rest shape; of
/// what is no point, of every number) is amplified, in the largest norm; the most of sixteen random patterns of signs. What forms
/// edges in working precision cannot in general be more accurate than κ roundoffs.
pub(crate) fn amplification(subject: &Subject, sample: &Sample, answer: &Answer, block: BlockName) -> f64 {
    // Large against rounding, small against all else.
    const PERTURBATION: f64 = 1.0 / (1 << 20) as f64;
    let here = answer.block(block);
    let mut random = Rng::with_seed(1);
    let mut most = 0.0_f64;
    for _ in 0..16 {
        let moved = perturbed(subject.declaration, sample, PERTURBATION, &mut random);
        let Ok(there) = subject.answer(&moved) else { continue };
        let change = here.numbers.iter().zip(&there.block(block).numbers).map(|(a, b)| (a - b).abs()).fold(0.0, worse);
        let kappa = change / here.largest() / PERTURBATION;
        if kappa.is_finite() {
            most = most.max(kappa);
        }
    }
    most
}

fn perturbed(declaration: &Declaration, sample: &Sample, by: f64, random: &mut Rng) -> Sample {
    let mut nudge = |x: f64| if random.bool() { x * by } else { -x * by };
    let edges = |numbers: &[f64], dimension: usize, nudge: &mut dyn FnMut(f64) -> f64| -> Vec<f64> {
        let origin = &numbers[..dimension];
        numbers.iter().enumerate().map(|(i, &x)| x + nudge(x - origin[i % dimension])).collect()
    };
    let all = |numbers: &[f64], nudge: &mut dyn FnMut(f64) -> f64| -> Vec<f64> {
        numbers.iter().map(|&x| x + nudge(x)).collect()
    };
    let by_edges = has_points(declaration) && declaration.translation_invariant;
    let positions = match by_edges {
        true => edges(&sample.positions, 3, &mut nudge),
        false => all(&sample.positions, &mut nudge),
    };
    let rest = match dimension(declaration.rest) {
        Some(dimension) => edges(&sample.rest, dimension, &mut nudge),
        None => all(&sample.rest, &mut nudge),
    };
    let velocities = if sample.velocities.is_empty() { Vec::new() } else { edges(&sample.velocities, 3, &mut nudge) };
    let parameters = if by_edges { sample.parameters.clone() } else { all(&sample.parameters, &mut nudge) };
    Sample { parameters, rest, positions, velocities }
}

/// That of a rest shape of points.
fn dimension(rest: &[Field]) -> Option<usize> {
    let dimension = rest.first()?.size;
    ((2..=3).contains(&dimension) && rest.iter().all(|field| field.size == dimension)).then_some(dimension)
}
