use energy_dsl::Declaration;
use fastrand::Rng;

use super::subject::Subject;
use crate::blocks::{Answer, BlockName};
use crate::multiprecision::{TrueBlock, truth_of_extreme, worse};
use crate::sample::{Sample, has_points};

pub(super) const ROUNDOFF: f64 = f64::EPSILON / 2.0;
/// Digits of multi-precision blocks near singularities.
pub(super) const DIGITS: usize = 25;

/// Returns the largest error in units of roundoff of the block's largest number. Errors of a zero block are relative to
/// its natural size.
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

/// Returns κ of a block: the amplification, in the maximum norm, of relative componentwise perturbations of the inputs.
/// Edges between points are perturbed in place of points, also in the rest shape. κ is the maximum over sixteen random
/// sign patterns, and over eight in which only the parameters are perturbed. Code that computes edges in working
/// precision, or multiples of angles that it compares with a parameter, cannot in general be more accurate than κ
/// roundoffs.
pub fn amplification(subject: &Subject, sample: &Sample, answer: &Answer, block: BlockName) -> f64 {
    let here = answer.block(block);
    let mut random = Rng::with_seed(1);
    let mut most = 0.0_f64;
    let geometry = (0..16).map(|_| Perturbed::Geometry);
    let parameters = (0..8).map(|_| Perturbed::Parameters);
    // If points do not enter as edges, parameters are perturbed with them.
    let by_edges = enters_as_edges(&subject.declaration) && !sample.parameters.is_empty();
    for what in geometry.chain(parameters.filter(|_| by_edges)) {
        let moved = perturbed(&subject.declaration, sample, what, &mut random);
        let Ok(there) = subject.answer(&moved) else { continue };
        let change = here.numbers.iter().zip(&there.block(block).numbers).map(|(a, b)| (a - b).abs()).fold(0.0, worse);
        let kappa = change / here.largest() / PERTURBATION;
        if kappa.is_finite() {
            most = most.max(kappa);
        }
    }
    most
}

/// Large compared with rounding, small compared with everything else.
const PERTURBATION: f64 = 1.0 / (1 << 20) as f64;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Perturbed {
    /// Points, rest shape and velocities; also the parameters if points do not enter as edges.
    Geometry,
    Parameters,
}

/// Returns whether the points enter as differences of two points only.
pub(super) fn enters_as_edges(declaration: &Declaration) -> bool {
    let is_edge = |points: &[(usize, f64)]| matches!(points, [(_, 1.0), (_, -1.0)]);
    let are_edges = declaration.reduced_vectors.iter().all(|points| is_edge(points));
    has_points(declaration) && declaration.translation_invariant && are_edges
}

fn perturbed(declaration: &Declaration, sample: &Sample, what: Perturbed, random: &mut Rng) -> Sample {
    let offset = offset(declaration, sample, (what, PERTURBATION), random);
    let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + b).collect();
    Sample {
        parameters: sum(&sample.parameters, &offset.parameters),
        rest: sum(&sample.rest, &offset.rest),
        positions: sum(&sample.positions, &offset.positions),
        velocities: sum(&sample.velocities, &offset.velocities),
    }
}

/// Returns perturbations of a relative size and random signs.
fn offset(declaration: &Declaration, sample: &Sample, (what, size): (Perturbed, f64), random: &mut Rng) -> Sample {
    let mut nudge = |x: f64| if random.bool() { x * size } else { -x * size };
    let edges = |numbers: &[f64], dimension: usize, nudge: &mut dyn FnMut(f64) -> f64| -> Vec<f64> {
        let origin = &numbers[..dimension];
        numbers.iter().enumerate().map(|(i, &x)| nudge(x - origin[i % dimension])).collect()
    };
    let all = |numbers: &[f64], nudge: &mut dyn FnMut(f64) -> f64| -> Vec<f64> {
        numbers.iter().map(|&x| nudge(x)).collect()
    };
    let none = |numbers: &[f64]| vec![0.0; numbers.len()];
    if what == Perturbed::Parameters {
        return Sample {
            parameters: all(&sample.parameters, &mut nudge),
            rest: none(&sample.rest),
            positions: none(&sample.positions),
            velocities: none(&sample.velocities),
        };
    }
    let by_edges = enters_as_edges(declaration);
    let positions = match by_edges {
        true => edges(&sample.positions, 3, &mut nudge),
        false => all(&sample.positions, &mut nudge),
    };
    let rest = match declaration.rest_points() {
        Some((dimension, _)) => edges(&sample.rest, dimension, &mut nudge),
        None => all(&sample.rest, &mut nudge),
    };
    let velocities = match has_points(declaration) && !sample.velocities.is_empty() {
        true => edges(&sample.velocities, 3, &mut nudge),
        false => all(&sample.velocities, &mut nudge),
    };
    let parameters = if by_edges { none(&sample.parameters) } else { all(&sample.parameters, &mut nudge) };
    Sample { parameters, rest, positions, velocities }
}

/// Returns κ of all blocks in multi-precision, in the order of the blocks, and the bits spent. Inputs are perturbed by
/// a roundoff: near a singularity, larger perturbations would leave its neighbourhood.
pub(super) fn true_amplifications(subject: &Subject, sample: &Sample, here: &[TrueBlock]) -> (Vec<f64>, usize) {
    let mut random = Rng::with_seed(1);
    let parameters = enters_as_edges(&subject.declaration) && !sample.parameters.is_empty();
    let patterns = [Perturbed::Geometry; 3].into_iter().chain(parameters.then_some(Perturbed::Parameters));
    let (mut most, mut bits) = (vec![0.0_f64; here.len()], 0);
    for what in patterns {
        let offset = offset(&subject.declaration, sample, (what, ROUNDOFF), &mut random);
        let there = truth_of_extreme(&subject.declaration, &subject.formula, sample, Some(&offset), DIGITS);
        bits += there.bits;
        for (number, (a, b)) in here.iter().zip(&there.blocks).enumerate() {
            let pairs = a.block.numbers.iter().zip(&b.block.numbers);
            let change = pairs.map(|(a, b)| (a.clone() - b.clone()).to_f64().abs()).fold(0.0, worse);
            let kappa = change / a.largest() / ROUNDOFF;
            if kappa.is_finite() {
                most[number] = most[number].max(kappa);
            }
        }
    }
    (most, bits)
}

#[cfg(test)]
mod tests {
    use super::super::Target;
    use super::super::auditor::Auditor;
    use super::*;
    use crate::multiprecision::truth_of_ordinary;
    use crate::sample::Sampler;
    use energy_dsl::{AnyElement, Element, Inputs, Outputs, RestError};

    const SINGLE_ROUNDOFF: f64 = f32::EPSILON as f64 / 2.0;

    fn single(numbers: &[f64]) -> Vec<f32> {
        numbers.iter().map(|&x| x as f32).collect()
    }

    type EvaluateSingle = fn(&Inputs<'_, f32>) -> Result<Outputs<f32>, RestError>;

    macro_rules! single_precision {
        ($($name:ident),* $(,)?) => { &[$((
            AnyElement::of::<energy_elements::$name<f64>>(),
            energy_elements::$name::<f32>::evaluate::<f32> as EvaluateSingle,
        )),*] };
    }

    const ELEMENTS: &[(AnyElement, EvaluateSingle)] = energy_elements::for_each_element!(single_precision);

    /// Evaluates an element's blocks in single precision.
    fn in_single_precision(evaluate: EvaluateSingle, sample: &Sample) -> Vec<(&'static str, Vec<f64>)> {
        let lists = [&sample.parameters, &sample.rest, &sample.positions, &sample.velocities].map(|list| single(list));
        let [parameters, rest, positions, velocities] = lists.each_ref().map(Vec::as_slice);
        let outputs = evaluate(&Inputs { parameters, rest, positions, velocities }).unwrap();
        let doubles = |numbers: Vec<f32>| numbers.into_iter().map(f64::from).collect();
        outputs.blocks.into_iter().map(|(name, numbers)| (name, doubles(numbers))).collect()
    }

    /// Each element is within 8 u·max(1, κ), with u of single precision, at inputs that single precision represents
    /// exactly.
    #[test]
    fn elements_are_as_accurate_in_single_precision() {
        let mut beyond = Vec::new();
        for (entry, evaluate) in ELEMENTS {
            let declaration = entry.declaration;
            let subject = Target::of_element(entry).subject().unwrap();
            let auditor = Auditor::new(&subject);
            let mut sampler = Sampler::new(declaration, 5);
            for _ in 0..6 {
                let Sample { parameters, rest, positions, velocities } = sampler.sample();
                let rounded = |numbers: Vec<f64>| single(&numbers).into_iter().map(f64::from).collect::<Vec<_>>();
                let [parameters, rest, positions, velocities] = [parameters, rest, positions, velocities].map(rounded);
                let sample = Sample { parameters, rest, positions, velocities };
                let answer = subject.answer(&sample).unwrap();
                let got = in_single_precision(*evaluate, &sample);
                for truth in truth_of_ordinary(declaration, &subject.formula, &sample, 12).blocks {
                    let name = truth.block.name;
                    let numbers = &got.iter().find(|(found, _)| *found == name.name()).unwrap().1;
                    let error = truth.block.numbers.iter().zip(numbers).map(|(t, &g)| t.error_of(g)).fold(0.0, worse);
                    let natural = auditor.natural_size(&sample, &answer, name);
                    let largest = truth.largest();
                    let scale = if largest > SINGLE_ROUNDOFF * natural { largest } else { natural };
                    let kappa = amplification(&subject, &sample, &answer, name).max(1.0);
                    let error = if error == 0.0 { 0.0 } else { error / scale / SINGLE_ROUNDOFF / kappa };
                    if error.is_nan() || error > 8.0 {
                        beyond.push(format!(
                            "{} {name}: {error:.1} u·κ, κ = {kappa:.1}, at {sample:?}",
                            declaration.name
                        ));
                    }
                }
            }
        }
        assert!(beyond.is_empty(), "{}", beyond.join("\n"));
    }
}
