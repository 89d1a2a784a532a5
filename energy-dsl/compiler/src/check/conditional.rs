//! Checks `if condition { … } else { … }`: one of two values of the same shape.

use super::expression::{Checker, Meaning};
use super::typed::{Typed, TypedKind};
use crate::diagnostic::Span;
use crate::functions::Shape;
use crate::syntax::{Body, Expression};

impl<'a> Checker<'a> {
    // Checking recurses over expressions: rare cases have their own frame.
    #[inline(never)]
    pub(super) fn conditional(
        &mut self,
        [yes, no]: [&'a Body; 2],
        condition: &'a Expression,
        span: &Span,
    ) -> Option<Typed> {
        let place = &condition.span;
        let condition = self.expression(condition);
        let (yes, no) = (self.body(yes, false), self.body(no, false));
        let (condition, yes, no) = (condition?, yes?, no?);
        if condition.shape != Shape::Truth {
            return self.error(place, format!("expected a comparison after `if`, found {}", condition.shape));
        }
        if yes.shape != no.shape {
            return self.different_branches(span, &yes, &no);
        }
        // A constant condition is decided here. The other branch leaves no operations.
        if let Some(truth) = super::constant::truth(&self.bindings, &condition) {
            return Some(if truth { yes } else { no });
        }
        self.choice(condition, [yes, no], span)
    }

    /// Returns one of two values; of arrays, entry by entry.
    fn choice(&mut self, condition: Typed, [yes, no]: [Typed; 2], span: &Span) -> Option<Typed> {
        if yes.shape != no.shape {
            return self.different_branches(span, &yes, &no);
        }
        let shape = yes.shape;
        let kind = match shape {
            Shape::Truth => return self.error(span, format!("a branch must be a value, but it is {shape}")),
            Shape::Array(_) => {
                let condition = match self.bind("", condition, self.in_rest) {
                    Meaning::Binding(number, shape) => {
                        Typed { kind: TypedKind::Binding(number), shape, span: span.clone() }
                    }
                    _ => unreachable!("compiler bug: a comparison is one value"),
                };
                let entries = yes.into_entries().into_iter().zip(no.into_entries());
                let choice = |(yes, no)| self.choice(condition.clone(), [yes, no], span);
                TypedKind::Array(entries.map(choice).collect::<Option<_>>()?)
            }
            _ => TypedKind::Select(Box::new(condition), Box::new(yes), Box::new(no)),
        };
        Some(Typed { kind, shape, span: span.clone() })
    }

    fn different_branches(&mut self, span: &Span, yes: &Typed, no: &Typed) -> Option<Typed> {
        let message = format!("both branches must have the same shape, but they are {} and {}", yes.shape, no.shape);
        self.error(span, message)
    }
}
