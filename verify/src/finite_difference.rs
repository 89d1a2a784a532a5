//! Central differences with one extrapolation, over a sweep of steps.
//!
//! The error falls with the step until rounding takes over. The smallest error and the observed order tell a right
//! derivative from a wrong one. A difference across a kink or the boundary of two regions is the derivative of neither
//! side, so only steps whose inputs all lie on one side count.

use energy_dsl::{Declaration, Kind};

use crate::blocks::{BlockName, NoAnswer, largest};
use crate::chart;
use crate::sample::{Sample, state_size};

/// The inputs that are stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stepped {
    Positions,
    Velocities,
    State,
}

/// Returns the block one order below, whose differences must equal `block`, and the inputs to step.
pub(crate) fn antiderivative(block: BlockName, kind: Kind) -> Option<(BlockName, Stepped)> {
    match block {
        BlockName::Jacobian if kind == Kind::Residual => Some((BlockName::Residual, Stepped::Positions)),
        BlockName::Jacobian => Some((BlockName::Constraint, Stepped::Positions)),
        BlockName::Gradient => Some((BlockName::Energy, Stepped::Positions)),
        BlockName::Hessian => Some((BlockName::Gradient, Stepped::Positions)),
        BlockName::ForceByPosition => Some((BlockName::Force, Stepped::Positions)),
        BlockName::ForceByVelocity => Some((BlockName::Force, Stepped::Velocities)),
        BlockName::NextByUnknowns => Some((BlockName::Next, Stepped::Positions)),
        BlockName::NextByState => Some((BlockName::Next, Stepped::State)),
        BlockName::SlopesByState if kind == Kind::Residual => Some((BlockName::Residual, Stepped::State)),
        BlockName::SlopesByState => Some((BlockName::Gradient, Stepped::State)),
        BlockName::Energy | BlockName::Force | BlockName::Constraint | BlockName::Residual | BlockName::Next => None,
    }
}

/// The result of a sweep over steps.
#[derive(Clone, Debug)]
pub(crate) struct Sweep {
    /// Extrapolated differences at the step where they vary least, row-major: by row of the lower block, then stepped
    /// input.
    pub(crate) best: Vec<f64>,
    /// The step of `best`.
    pub(crate) step: f64,
    /// Observed order of the plain central difference; `None` if its error did not fall far enough to measure it.
    pub(crate) order: Option<f64>,
    /// Relative step, and the largest deviation of plain and of extrapolated differences.
    pub(crate) curve: Vec<(f64, f64, f64)>,
}

impl Sweep {
    /// Returns the largest deviation of plain differences, which long steps have.
    pub(crate) fn largest_deviation(&self) -> f64 {
        self.curve.iter().map(|&(_, plain, _)| plain).fold(0.0, f64::max)
    }
}

/// Compares differences of `lower`, a function of the stepped inputs, with `block`. `None` if hardly any step keeps all
/// its inputs on the side of the sample, by `is_on_this_side`.
pub(crate) fn sweep(
    declaration: &Declaration,
    sample: &Sample,
    stepped: Stepped,
    length: f64,
    (name, block): (BlockName, &[f64]),
    lower: impl Fn(&Sample) -> Result<Vec<f64>, NoAnswer>,
    is_on_this_side: impl Fn(&Sample) -> bool,
) -> Result<Option<Sweep>, NoAnswer> {
    const STEPS: [i32; 5] = [-6, -8, -10, -12, -14];
    // If the function has a kink or jumps nearby (a sign is chosen), only steps that stay on one side are useful.
    const FINER: [i32; 3] = [-17, -20, -23];
    const SUSPICIOUS: f64 = 1e-7;
    let inputs = match stepped {
        Stepped::Positions => declaration.increments(),
        Stepped::Velocities => sample.velocities.len(),
        Stepped::State => state_size(declaration),
    };
    let moved = |input: usize, offset: f64| {
        let mut moved = sample.clone();
        let place = match stepped {
            Stepped::Positions => {
                return (chart::step(declaration, &mut moved.positions, input, offset), moved);
            }
            Stepped::Velocities => &mut moved.velocities[input],
            Stepped::State => &mut moved.parameters[sample.parameters.len() - inputs + input],
        };
        let before = *place;
        *place += offset;
        (*place - before, moved)
    };
    let stays = |step: f64| (0..inputs).all(|i| [step, -step].iter().all(|&s| is_on_this_side(&moved(i, s).1)));
    let central = |step: f64| -> Result<Vec<f64>, NoAnswer> {
        let rows = block.len() / inputs.max(1);
        let mut differences = vec![0.0; block.len()];
        for input in 0..inputs {
            let at = |offset: f64| {
                let (there, moved) = moved(input, offset);
                lower(&moved).map(|values| (there, values))
            };
            let ((high, plus), (low, minus)) = (at(step)?, at(-step)?);
            for row in 0..rows {
                differences[row * inputs + input] = (plus[row] - minus[row]) / (high - low);
            }
        }
        if name == BlockName::Hessian {
            chart::symmetrise(declaration, &mut differences);
        }
        Ok(differences)
    };
    let deviation = |differences: &[f64]| largest_difference(differences, block);
    let (mut curve, mut plain) = (Vec::new(), Vec::new());
    let mut extrapolations: Vec<(f64, Vec<f64>)> = Vec::new();
    for exponent in STEPS.into_iter().chain(FINER) {
        let agree =
            |pair: &[(f64, Vec<f64>)]| largest_difference(&pair[0].1, &pair[1].1) <= SUSPICIOUS * largest(&pair[1].1);
        if FINER.contains(&exponent) && extrapolations.windows(2).any(agree) {
            break;
        }
        let step = length * f64::from(exponent).exp2();
        if !(stays(step) && stays(step / 2.0)) {
            continue;
        }
        let (whole, half) = (central(step)?, central(step / 2.0)?);
        plain.push((deviation(&whole), deviation(&half)));
        let extrapolated: Vec<f64> = whole.iter().zip(&half).map(|(w, h)| (4.0 * h - w) / 3.0).collect();
        curve.push((step / length, deviation(&whole), deviation(&extrapolated)));
        extrapolations.push((step, extrapolated));
    }
    if extrapolations.len() < 2 {
        return Ok(None);
    }
    // The step is chosen without the block: errors are smallest where consecutive steps agree best.
    let disagreement = |k: usize| largest_difference(&extrapolations[k].1, &extrapolations[k + 1].1);
    let chosen = (0..extrapolations.len() - 1).min_by(|&a, &b| disagreement(a).total_cmp(&disagreement(b)));
    let (step, best) = extrapolations.swap_remove(chosen.unwrap_or_default());
    let error = deviation(&best);
    // Measure the order at the first step, unless rounding dominates its error.
    let order = plain
        .first()
        .filter(|(whole, half)| *half > 1e3 * error && *half > 1e-10 * largest(block) && *whole > *half)
        .map(|(w, h)| (w / h).log2());
    Ok(Some(Sweep { best, step, order, curve }))
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, |most: f64, d| if d.is_nan() { d } else { most.max(d) })
}
