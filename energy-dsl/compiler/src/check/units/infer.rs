//! Walks the typed program and collects the equations between units.

use super::dimension::{Dimension, LENGTH, TIME, VELOCITY};
use super::solver::Solver;
use super::{declared, rules};
use crate::check::constant::evaluate;
use crate::check::typed::{Input, Program, Source, Typed, TypedKind};
use crate::diagnostic::{Diagnostic, Diagnostics, Span};
use crate::functions::Shape;
use crate::syntax::ElementType;

/// The dimensions of a value: one; two for a dual quaternion (its parts), for a twist (θ and t) and for a motion (rotation
/// and position).
#[derive(Clone, Debug)]
pub(super) struct Units(pub(super) Vec<Dimension>);

impl Units {
    pub(super) fn one(dimension: Dimension) -> Self {
        Self(vec![dimension])
    }

    pub(super) fn two(first: Dimension, second: Dimension) -> Self {
        Self(vec![first, second])
    }

    /// Returns the first or only dimension.
    pub(super) fn main(&self) -> Dimension {
        self.0[0].clone()
    }

    /// Returns the second or only dimension.
    pub(super) fn other(&self) -> Dimension {
        self.0[self.0.len() - 1].clone()
    }

    /// Applies a change to each dimension.
    pub(super) fn map(&self, change: impl Fn(&Dimension) -> Dimension) -> Self {
        Self(self.0.iter().map(change).collect())
    }
}

/// Returns how many dimensions a value of a shape has.
fn parts(shape: Shape) -> usize {
    if matches!(shape, Shape::DualQuat | Shape::Twist | Shape::Motion) { 2 } else { 1 }
}

/// State of the walk.
pub(super) struct Inference<'a> {
    program: &'a Program,
    diagnostics: &'a mut Diagnostics,
    pub(super) solver: Solver,
    bindings: Vec<Option<Units>>,
    /// The dimensions each input received when first met, by section and first number.
    inputs: Vec<((u8, usize), Units)>,
}

impl<'a> Inference<'a> {
    pub(super) fn new(program: &'a Program, diagnostics: &'a mut Diagnostics) -> Self {
        let bindings = vec![None; program.bindings.len()];
        Self { program, diagnostics, solver: Solver::default(), bindings, inputs: Vec::new() }
    }

    /// Reports an error once per place. Functions and sums are walked again for each use.
    pub(super) fn error(&mut self, span: &Span, message: String, help: &str) {
        let place = |span: &Span| (span.token.start(), span.excerpt.as_ref().map(|e| (e.start, e.end)));
        if self.diagnostics.0.iter().all(|d| place(&d.span) != place(span)) {
            self.diagnostics.push(Diagnostic::new(span, message).help(help));
        }
    }

    /// Requires the dimension that the kind of declaration prescribes for its result.
    pub(super) fn result(&mut self, found: &Dimension, wanted: &Dimension, span: &Span, what: &str) {
        if let Err((found, _)) = self.solver.equal(found, wanted) {
            self.error(span, format!("{what}, but this is {found}"), "check the formula, or the units of the inputs");
        }
    }

    /// Creates unknown dimensions for each part of a shape.
    pub(super) fn fresh(&mut self, shape: Shape) -> Units {
        Units((0..parts(shape)).map(|_| self.solver.fresh()).collect())
    }

    pub(super) fn expression(&mut self, typed: &Typed) -> Units {
        match &typed.kind {
            // Zero and infinity have any unit.
            TypedKind::Constant(value) if *value == 0.0 || value.is_infinite() => self.fresh(typed.shape),
            TypedKind::Constant(_) | TypedKind::Pi => Units::one(Dimension::default()),
            TypedKind::Input(source, first) => self.input(*source, *first, typed.shape),
            TypedKind::Binding(number) => self.binding(*number),
            TypedKind::Call(function, arguments) => {
                let units: Vec<Units> = arguments.iter().map(|a| self.expression(a)).collect();
                let call = rules::Call {
                    name: function.name,
                    arguments,
                    units: &units,
                    span: &typed.span,
                    constant: arguments.last().and_then(|last| evaluate(&self.program.bindings, last)),
                };
                rules::apply(self, &call, function.units)
            }
            TypedKind::Select(condition, yes, no) => {
                self.expression(condition);
                let (yes, no) = (self.expression(yes), self.expression(no));
                self.same("if", &[&yes, &no], &typed.span)
            }
            TypedKind::Array(entries) => {
                entries.iter().for_each(|entry| drop(self.expression(entry)));
                Units::one(Dimension::default())
            }
            TypedKind::Gradient(of, source, first) => {
                let of = self.expression(of).main();
                let by = self.input(*source, *first, typed.shape).main();
                Units::one(of.over(&by))
            }
        }
    }

    fn binding(&mut self, number: usize) -> Units {
        if let Some(units) = &self.bindings[number] {
            return units.clone();
        }
        let binding = &self.program.bindings[number];
        let value = self.expression(&binding.value);
        let unit = binding.unit.as_ref().and_then(|unit| super::dimension::parse(&unit.text).ok());
        let units = unit.map_or(value, Units::one);
        self.bindings[number] = Some(units.clone());
        units
    }

    fn input(&mut self, source: Source, first: usize, shape: Shape) -> Units {
        let (section, list): (u8, &[Input]) = match source {
            Source::Position => (0, &self.program.moving),
            Source::Velocity => return Units::one(self.rate(first)),
            Source::Rest => (1, &self.program.rest),
            Source::Parameter => (2, &self.program.parameters),
        };
        let contains = |input: &&Input| (input.first..input.first + input.input_type.size()).contains(&first);
        let input = list.iter().find(contains).expect("compiler bug: inputs are numbered without gaps");
        let key = (section, input.first);
        if let Some((_, units)) = self.inputs.iter().find(|(other, _)| *other == key) {
            return units.clone();
        }
        let units = match (shape, declared(input)) {
            // A rotation is a plain number; a translation is not.
            (Shape::Twist | Shape::Motion, known) => {
                Units::two(Dimension::default(), known.unwrap_or(Dimension::of(LENGTH)))
            }
            (Shape::DualQuat, Some(known)) => Units::two(Dimension::default(), known),
            (_, Some(known)) => Units::one(known),
            (_, None) => self.fresh(shape),
        };
        self.inputs.push((key, units.clone()));
        units
    }

    /// Returns the dimension of the velocity whose first component is this increment: of its unknown, by time.
    fn rate(&mut self, first: usize) -> Dimension {
        let (mut next, program) = (0, self.program);
        let owner = program.moving.iter().find(|input| {
            next += input.input_type.element.increments();
            first < next
        });
        match owner {
            Some(unknown) => self.unknown(unknown).over(&Dimension::of(TIME)),
            None => Dimension::of(VELOCITY),
        }
    }

    /// Returns the dimension of an unknown. A rotation moves by numbers. The position of a motion shares its number with
    /// the whole motion, whose unit has two parts.
    pub(super) fn unknown(&mut self, unknown: &Input) -> Dimension {
        let is_known = matches!(unknown.input_type.element, ElementType::Point | ElementType::Rotation);
        if let Some(known) = declared(unknown).filter(|_| is_known) {
            return known;
        }
        self.input(Source::Position, unknown.first, Shape::Scalar).main()
    }

    /// Returns the dimension of a parameter.
    pub(super) fn parameter(&mut self, parameter: &Input) -> Dimension {
        self.input(Source::Parameter, parameter.first, Shape::Scalar).main()
    }

    /// Requires equal dimensions of all values, and returns them.
    pub(super) fn same(&mut self, name: &str, values: &[&Units], span: &Span) -> Units {
        let first = values[0];
        for (number, other) in values.iter().enumerate().skip(1) {
            for (a, b) in first.0.iter().zip(&other.0) {
                if let Err((a, b)) = self.solver.equal(a, b) {
                    let message = match (name, values.len()) {
                        ("if", _) => format!("`if`: one branch is {a}, the other is {b}"),
                        (_, 2) => format!("`{name}`: left is {a}, right is {b}"),
                        _ => format!("`{name}`: argument 1 is {a}, argument {} is {b}", number + 1),
                    };
                    self.error(span, message, "both need the same unit: check the formula, or the units of the inputs");
                    return Units(first.0.iter().map(|_| self.solver.fresh()).collect());
                }
            }
        }
        first.clone()
    }

    /// Requires a number without unit; returns whether it is one.
    pub(super) fn number(&mut self, name: &str, value: &Dimension, span: &Span) -> bool {
        if let Err((found, _)) = self.solver.equal(value, &Dimension::default()) {
            let message = format!("`{name}` takes a number without a unit, but this is {found}");
            self.error(span, message, "divide it by a reference value of the same unit");
            return false;
        }
        true
    }
}
