//! The unknowns of a declaration: which numbers hold them, and in which coordinates they move.

use crate::check::Input as DeclaredInput;
use crate::graph::{Graph, Input, NodeId, Op, Origin, Primitive, Rule, symmetric_index};
use energy_runtime::FieldKind;

/// One unknown: a point, a number, a rotation, ….
#[derive(Clone, Copy, Debug)]
pub struct Unknown {
    /// Number of coordinates in which it moves.
    pub increments: usize,
    /// Number of the first of them among those of all unknowns.
    pub first_increment: usize,
    /// Number of the first number that holds it among those of all unknowns.
    pub first_number: usize,
    /// How it moves.
    pub kind: FieldKind,
}

/// A component of an unknown: linear functions of unknowns add components that are alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Axis {
    /// Number of coordinates of the unknowns.
    pub(super) of: usize,
    pub(super) number: usize,
}

/// The unknowns of a declaration, in declared order.
#[derive(Clone, Debug)]
pub struct Unknowns {
    /// The unknowns.
    pub list: Vec<Unknown>,
}

/// The inputs that derivatives are taken with respect to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moving {
    /// The unknowns.
    Unknowns,
    /// The velocities of the unknowns.
    Velocities,
}

impl Unknowns {
    /// Lists the unknowns that some inputs declare.
    #[must_use]
    pub fn of(inputs: &[DeclaredInput]) -> Self {
        let (mut list, mut increments) = (Vec::with_capacity(inputs.len()), 0);
        for input in inputs {
            let element = input.input_type.element;
            let (own, kind) = (element.increments(), element.field_kind());
            list.push(Unknown { increments: own, first_increment: increments, first_number: input.first, kind });
            increments += own;
        }
        Self { list }
    }

    /// Returns the unknown that a number belongs to, and its component.
    fn at(&self, number: usize, first: impl Fn(&Unknown) -> usize) -> Option<(usize, Axis)> {
        let unknown = self.list.partition_point(|unknown| first(unknown) <= number).checked_sub(1)?;
        let found = &self.list[unknown];
        Some((unknown, Axis { of: found.increments, number: number - first(found) }))
    }

    /// Returns the unknown and the component that an input is one coordinate of. The numbers of a rotation are none:
    /// its increments are.
    pub(super) fn coordinate(&self, g: &Graph, node: NodeId, moving: Moving) -> Option<(usize, Axis)> {
        let Op::Input(input) = g.op(node) else { return None };
        match (input, moving) {
            (Input::Position(number), Moving::Unknowns) => {
                let (unknown, axis) = self.at(number.into(), |unknown| unknown.first_number)?;
                (self.list[unknown].kind != FieldKind::Rotation).then_some((unknown, axis))
            }
            (Input::Increment(number), Moving::Unknowns) | (Input::Velocity(number), Moving::Velocities) => {
                self.at(number.into(), |unknown| unknown.first_increment)
            }
            _ => None,
        }
    }

    /// Returns whether a translation of the scene moves an unknown.
    pub(super) fn translates(&self, unknown: usize) -> bool {
        self.list[unknown].kind == FieldKind::Point
    }

    /// Returns the input of each coordinate.
    pub(super) fn inputs(&self) -> Vec<Input> {
        let input = |of: fn(u16) -> Input, number: usize| of(u16::try_from(number).expect("few unknowns"));
        let of_unknown = |unknown: &Unknown| {
            let (of, first): (fn(u16) -> Input, usize) = match unknown.kind {
                FieldKind::Rotation => (Input::Increment, unknown.first_increment),
                _ => (Input::Position, unknown.first_number),
            };
            (first..first + unknown.increments).map(move |number| input(of, number)).collect::<Vec<_>>()
        };
        self.list.iter().flat_map(of_unknown).collect()
    }

    /// Returns whether the unknown whose numbers begin at `first` is a rotation.
    #[must_use]
    pub fn is_rotation(&self, first: usize) -> bool {
        self.list.iter().any(|unknown| unknown.first_number == first && unknown.kind == FieldKind::Rotation)
    }

    /// Returns the components of the rotation whose numbers begin at `first`, as functions of its increments; `None` if
    /// another unknown is there.
    pub fn rotation(&self, g: &mut Graph, first: usize) -> Option<Vec<NodeId>> {
        let unknown = self.list.iter().find(|unknown| unknown.first_number == first)?;
        (unknown.kind == FieldKind::Rotation).then(|| turned(g, first, unknown.first_increment))
    }
}

/// Entry (part, axis) of the quaternion eₖ q: whether it is positive, and the part of q that it is.
const TURNS: [[(bool, usize); 3]; 4] = [
    [(false, 1), (false, 2), (false, 3)],
    [(true, 0), (true, 3), (false, 2)],
    [(false, 3), (true, 0), (true, 1)],
    [(true, 2), (false, 1), (true, 0)],
];

/// Returns the derivatives by the increments of a rotation, given those by its four numbers, the first of which is
/// number `first` of the unknowns.
pub fn by_increments(g: &mut Graph, first: usize, by_numbers: &[NodeId]) -> Vec<NodeId> {
    let number = |part: usize| Input::Position(u16::try_from(first + part).expect("few unknowns"));
    let q: Vec<NodeId> = (0..4).map(|part| g.input(number(part))).collect();
    let half = g.constant(0.5);
    let of_axis = |axis: usize| {
        let terms: Vec<NodeId> = by_numbers
            .iter()
            .zip(TURNS)
            .map(|(&slope, row)| {
                let (positive, of) = row[axis];
                let term = g.mul(slope, q[of]);
                if positive { term } else { g.neg(term) }
            })
            .collect();
        let sum = g.sum(terms);
        g.mul(half, sum)
    };
    (0..3).map(of_axis).collect()
}

/// Returns the components of exp(δ) q at δ = 0, where q are four numbers of the unknowns from `first` on and δ three
/// increments. exp(δ) = (1 − |δ|²/8, δ/2) up to second order, so
///
/// ```text
/// ∂(exp(δ) q)/∂δₖ = eₖ q / 2,    ∂²(exp(δ) q)/∂δⱼ∂δₖ = −q δⱼₖ / 4.
/// ```
fn turned(g: &mut Graph, first: usize, first_increment: usize) -> Vec<NodeId> {
    let number = |number: usize| u16::try_from(number).expect("few unknowns");
    let q: Vec<NodeId> = (0..4).map(|part| g.input(Input::Position(number(first + part)))).collect();
    let increments: Vec<NodeId> =
        (0..3).map(|axis| g.input(Input::Increment(number(first_increment + axis)))).collect();
    let [half, minus_half, minus_quarter] = [0.5, -0.5, -0.25].map(|weight| g.constant(weight));
    let zero = g.constant(0.0);
    let parts: Vec<NodeId> = (0..4_u8)
        .map(|part| {
            let value = q[usize::from(part)];
            let first = TURNS[usize::from(part)]
                .map(|(positive, of)| vec![if positive { half } else { minus_half }, q[of]])
                .to_vec();
            let mut second = vec![vec![vec![zero]]; 6];
            for axis in 0..3 {
                second[symmetric_index(3, axis, axis)] = vec![vec![minus_quarter, value]];
            }
            let rule = Rule::factored(Primitive::Turned(part), increments.clone(), value, first, second);
            g.add_rule(rule, &[])
        })
        .collect();
    // Where derivatives are differentiated again, they depend on the rotation, too.
    for &part in &parts {
        g.change_rule(part, |rule| {
            for factor in rule.first.iter_mut().flatten() {
                if let Some(of) = q.iter().position(|number| number == factor) {
                    *factor = parts[of];
                }
            }
        });
    }
    g.note_origin(&parts, Origin::UnitQuaternion);
    parts
}
