//! Arrays, their entries, components of vectors, and sums over indices. All of them are unrolled: an array is the list
//! of its entries.

use std::ops::Range;

use super::expression::{Checker, Meaning, constant};
use super::typed::{Typed, TypedKind};
use crate::diagnostic::{Diagnostic, Span};
use crate::functions::{self, Shape};
use crate::syntax::{Expression, ExpressionKind, Name, Sum};

/// Maximum number of terms that the sums of a declaration unroll to.
const MOST_TERMS: usize = 1024;

impl<'a> Checker<'a> {
    /// Checks `[a, b, …]`.
    #[inline(never)]
    pub(super) fn list(&mut self, items: &'a [Expression], span: &Span) -> Option<Typed> {
        let checked: Vec<_> = items.iter().map(|item| self.expression(item)).collect();
        let checked: Vec<_> = checked.into_iter().collect::<Option<_>>()?;
        if let Some((item, _)) = items.iter().zip(&checked).find(|(_, c)| c.shape == Shape::Truth) {
            return self.error(&item.span, "an array entry cannot be a comparison");
        }
        let Ok(length) = u16::try_from(checked.len()) else {
            return self.error(span, "this array is too long");
        };
        Some(Typed { kind: TypedKind::Array(checked), shape: Shape::Array(length), span: span.clone() })
    }

    /// Checks `a[i]`: an entry of an array, a component of a vector, or a row of a matrix, so that `M[i][j]` is an
    /// entry.
    #[inline(never)]
    pub(super) fn index(&mut self, of: &'a Expression, index: &'a Expression) -> Option<Typed> {
        let value = self.expression(of)?;
        let number = self.whole_number(index, "an index")?;
        let length = match value.shape {
            Shape::Vector(_) | Shape::Quat | Shape::DualQuat | Shape::Twist => value.shape.size(),
            Shape::Array(n) => n.into(),
            Shape::Matrix(rows, _) => rows.into(),
            other => {
                return self
                    .error(&of.span, format!("only arrays, vectors and matrices have entries, but this is {other}"));
            }
        };
        if number >= length {
            let message =
                format!("the index {number} is out of range: there are {length} entries, 0 to {}", length - 1);
            return self.error(&index.span, message);
        }
        match value.kind {
            TypedKind::Array(mut entries) => Some(entries.swap_remove(number)),
            _ => self.component_of(value, number, &index.span),
        }
    }

    /// Checks `v.x` and `q.w`.
    #[inline(never)]
    pub(super) fn component(&mut self, of: &'a Expression, name: &Name) -> Option<Typed> {
        let value = self.expression(of)?;
        let letters = match value.shape {
            Shape::Vector(n) => &"xyzw"[..n.into()],
            Shape::Quat => "wxyz",
            other => {
                let message = format!(
                    "`.{}`: only vectors and quaternions have named components, but this is {other}",
                    name.text
                );
                self.diagnostics.push(Diagnostic::new(&name.span, message).help("array entries are a[0], a[1], …"));
                return None;
            }
        };
        match letters.find(&name.text).filter(|_| name.text.len() == 1) {
            Some(number) => self.component_of(value, number, &name.span),
            None => {
                let known = letters.chars().map(|c| format!(".{c}")).collect::<Vec<_>>().join(", ");
                let message = format!("{} has the components {known}, not .{}", value.shape, name.text);
                self.error(&name.span, message)
            }
        }
    }

    fn component_of(&mut self, value: Typed, number: usize, span: &Span) -> Option<Typed> {
        let function = functions::find("[]").expect("compiler bug: no function `[]`");
        let shape = match value.shape {
            Shape::Matrix(_, columns @ 2..) => Shape::Vector(columns),
            _ => Shape::Scalar,
        };
        let arguments = vec![value, constant(number as f64, span)];
        Some(Typed { kind: TypedKind::Call(function, arguments), shape, span: span.clone() })
    }

    /// Checks `len(a)`, the number of entries of an array.
    #[inline(never)]
    pub(super) fn length(&mut self, name: &Name, arguments: &'a [Expression]) -> Option<Typed> {
        let [of] = arguments else {
            return self.error(&name.span, "`len` takes an array, as in len(ring)");
        };
        // The name of an array suffices, also where its entries are unknown: in the length of another array.
        if let ExpressionKind::Name(array) = &of.kind
            && let Some(Some(Meaning::Input(_, _, _, Some(length)))) = self.find(&array.text)
        {
            return Some(constant(length as f64, &name.span));
        }
        let found = self.expression(of)?.shape;
        match found {
            Shape::Array(length) => Some(constant(length.into(), &name.span)),
            _ => self.error(&of.span, format!("`len` takes an array, but this is {found}")),
        }
    }

    /// Checks `interpolate(K, t)` and `interpolate(K, x, t)` of arrays K and x.
    #[inline(never)]
    pub(super) fn interpolate(&mut self, name: &Name, arguments: &'a [Expression]) -> Option<Typed> {
        let (table, knots, place) = match arguments {
            [table, place] => (table, None, place),
            [table, knots, place] => (table, Some(knots), place),
            _ => {
                return self
                    .error(&name.span, "write interpolate(K, t), or interpolate(K, x, t) with an array x of knots");
            }
        };
        let values = self.numbers_of(table);
        let knots = knots.map(|knots| self.numbers_of(knots).map(|numbers| (knots, numbers)));
        let at = self.expression(place);
        let (mut values, at) = (values?, at?);
        let knots = match knots {
            None => (0..values.len()).map(|number| constant(number as f64, &name.span)).collect(),
            Some(given) => {
                let (expression, numbers) = given?;
                if numbers.len() != values.len() {
                    let message = format!("{} knots for {} numbers", numbers.len(), values.len());
                    return self.error(&expression.span, message);
                }
                let known: Vec<Option<f64>> =
                    numbers.iter().map(|number| super::constant::evaluate(&self.bindings, number)).collect();
                let falls = |pair: &[Option<f64>]| matches!(pair, [Some(a), Some(b)] if a >= b);
                if known.windows(2).any(falls) {
                    return self.error(&expression.span, "the knots must increase");
                }
                numbers
            }
        };
        if values.len() < 2 {
            return self.error(&table.span, "a table has two numbers or more");
        }
        values.extend(knots);
        values.push(at);
        self.apply("interpolate", &name.span, values)
    }

    /// Returns the entries of an array of numbers.
    fn numbers_of(&mut self, array: &'a Expression) -> Option<Vec<Typed>> {
        let Typed { kind, shape, .. } = self.expression(array)?;
        match kind {
            TypedKind::Array(entries) if entries.iter().all(|entry| entry.shape == Shape::Scalar) => Some(entries),
            _ => {
                let help = "write the table as [a, b, c], or declare it: K: [Scalar[N]; 8]";
                let message = format!("a table is an array of numbers, but this is {shape}");
                self.diagnostics.push(Diagnostic::new(&array.span, message).help(help));
                None
            }
        }
    }

    /// Checks `a % b` of constants, as in an index that runs around a ring.
    #[inline(never)]
    pub(super) fn remainder(&mut self, name: &Name, arguments: &'a [Expression]) -> Option<Typed> {
        let [a, b] = arguments else { return self.error(&name.span, "`%` stands between two numbers") };
        let (dividend, divisor) = (self.whole_number(a, "the left side of `%`"), self.whole_number(b, "a divisor"));
        let (dividend, divisor) = (dividend?, divisor?);
        match dividend.checked_rem(divisor) {
            Some(rest) => Some(constant(rest as f64, &name.span)),
            None => self.error(&b.span, "`%` by 0"),
        }
    }

    /// Returns the range of an index, and counts its terms.
    pub(super) fn range(&mut self, first: &'a Expression, end: &'a Expression, span: &Span) -> Option<Range<usize>> {
        let (from, to) = (self.whole_number(first, "a range"), self.whole_number(end, "a range"));
        let (from, to) = (from?, to?);
        if from >= to {
            let message = format!("the range {from}..{to} is empty");
            self.error(&end.span, message);
            return None;
        }
        self.terms += to - from;
        if self.terms > MOST_TERMS {
            self.error(span, format!("the sums and loops unroll to more than {MOST_TERMS} terms"));
            return None;
        }
        Some(from..to)
    }

    /// Returns what `check` finds where an index has a value.
    pub(super) fn at_index<T>(&mut self, index: &Name, number: usize, check: impl FnOnce(&mut Self) -> T) -> T {
        let scope = [(index.canonical(), Some(Meaning::Index(number)))];
        self.scopes.push(scope.into_iter().collect());
        let found = check(self);
        self.scopes.pop();
        found
    }

    /// Checks and unrolls `[term for j in first..end]` to the array of the terms.
    #[inline(never)]
    pub(super) fn each(&mut self, each: &'a Sum, span: &Span) -> Option<Typed> {
        let range = self.range(&each.first, &each.end, span)?;
        let length = u16::try_from(range.len()).expect("sums have few terms");
        let term = |number| self.at_index(&each.index, number, |checker| checker.expression(&each.term));
        let terms: Vec<Typed> = range.map(term).collect::<Option<_>>()?;
        if let Some(term) = terms.iter().find(|term| term.shape == Shape::Truth) {
            return self.error(&term.span, "an array entry cannot be a comparison");
        }
        Some(Typed { kind: TypedKind::Array(terms), shape: Shape::Array(length), span: span.clone() })
    }

    /// Checks and unrolls `sum(j in first..end, term)`.
    #[inline(never)]
    pub(super) fn sum(&mut self, sum: &'a Sum, span: &Span) -> Option<Typed> {
        let range = self.range(&sum.first, &sum.end, span)?;
        let mut total: Option<Typed> = None;
        for number in range {
            let term = self.at_index(&sum.index, number, |checker| checker.expression(&sum.term))?;
            total = Some(match total {
                None => term,
                Some(total) => self.apply("+", span, vec![total, term])?,
            });
        }
        total
    }
}
