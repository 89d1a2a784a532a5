//! Finds out whether a function of singular values stays the same after a reflection, by trying numbers.

use crate::graph::{Graph, Input, Interpreter, NodeId, Op, Substitution};
use energy_runtime::Inputs;

/// Number of random points.
const POINTS: u32 = 6;
/// Functions that differ by less, relative to their size, are equal.
const TOLERANCE: f64 = 1e-9;

/// Returns whether ψ is the same after a reflection, which maps all singular values to images.
pub(super) fn is_unchanged(g: &mut Graph, psi: NodeId, images: &[(NodeId, NodeId)]) -> bool {
    // Each singular value becomes an input.
    let inputs: Vec<NodeId> = (0..images.len()).map(|i| g.input(Input::Position(i as u16))).collect();
    let mut plain = Substitution::new(g, images.iter().map(|(value, _)| *value).zip(inputs));
    let mirrored: Vec<(NodeId, NodeId)> = images.iter().map(|&(value, image)| (value, plain.of(g, image))).collect();
    let before = plain.of(g, psi);
    let after = Substitution::new(g, mirrored).of(g, psi);
    if before == after {
        return true;
    }
    let both = Interpreter::new(g, &[before, after]);
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let sizes = Sizes::of(g);
    let equal = |_| {
        let [positions, parameters, rest, precomputed] =
            [images.len(), sizes.parameters, sizes.rest, sizes.precomputed].map(|count| random.numbers(count));
        let inputs = Inputs { parameters: &parameters, rest: &rest, positions: &positions, velocities: &[] };
        let both = both.evaluate(&inputs, &precomputed);
        (both[0] - both[1]).abs() <= TOLERANCE * both[0].abs().max(both[1].abs())
    };
    (0..POINTS).all(equal)
}

/// Counts of the inputs that a graph reads.
#[derive(Default)]
struct Sizes {
    parameters: usize,
    rest: usize,
    precomputed: usize,
}

impl Sizes {
    fn of(g: &Graph) -> Self {
        let mut sizes = Self::default();
        for op in g.ops() {
            let (size, index) = match op {
                Op::Input(Input::Parameter(index)) => (&mut sizes.parameters, index),
                Op::Input(Input::Rest(index)) => (&mut sizes.rest, index),
                Op::Input(Input::Precomputed(index)) => (&mut sizes.precomputed, index),
                _ => continue,
            };
            *size = (*size).max(usize::from(index) + 1);
        }
        sizes
    }
}

/// Numbers in [½, 3/2), the same in every build.
struct Random(u64);

impl Random {
    fn numbers(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.number()).collect()
    }

    fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        0.5 + (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}
