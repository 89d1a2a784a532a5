//! Refuses equalities that hold at single inputs only, such as `p.x == 0`. Where a formula has a limit, that is its
//! value, so the branch for such an input would never count.

use std::collections::BTreeMap;

use super::typed::{Binding, Source, Typed, TypedKind};

/// How an expression depends on what moves.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Motion {
    Fixed,
    Smooth,
    /// Constant in some regions, as `max(x, 0)` is.
    Piecewise,
}

/// Returns whether two numbers are equal on a set without volume: at least one moves, and neither has pieces.
pub(super) fn is_measureless(bindings: &[Binding], operands: &[Typed]) -> bool {
    let mut motions = Motions { bindings, known: BTreeMap::new() };
    let all = operands.iter().map(|operand| motions.of(operand));
    all.fold(Motion::Fixed, larger) == Motion::Smooth
}

fn larger(a: Motion, b: Motion) -> Motion {
    if a < b { b } else { a }
}

struct Motions<'a> {
    bindings: &'a [Binding],
    known: BTreeMap<usize, Motion>,
}

impl Motions<'_> {
    fn of(&mut self, typed: &Typed) -> Motion {
        match &typed.kind {
            TypedKind::Input(Source::Position | Source::Velocity, _) => Motion::Smooth,
            TypedKind::Binding(number) => {
                if let Some(&known) = self.known.get(number) {
                    return known;
                }
                let bindings = self.bindings;
                let motion = self.of(&bindings[*number].value);
                self.known.insert(*number, motion);
                motion
            }
            _ => {
                let motion = typed.parts().into_iter().map(|part| self.of(part)).fold(Motion::Fixed, larger);
                if motion == Motion::Smooth && has_pieces(&typed.kind) { Motion::Piecewise } else { motion }
            }
        }
    }
}

/// Returns whether a function may be constant in a region where its arguments are not.
fn has_pieces(kind: &TypedKind) -> bool {
    match kind {
        TypedKind::Select(..) => true,
        TypedKind::Call(function, _) => {
            matches!(
                function.name,
                "abs" | "min" | "max" | "clamp" | "sign" | "power_of_two" | "huber" | "asin" | "acos"
            )
        }
        _ => false,
    }
}
