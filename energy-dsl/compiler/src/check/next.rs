//! Checks `next { … }`: the state of an element after an accepted step. All right sides read the old state.

use std::collections::BTreeSet;

use super::expression::Checker;
use super::result::rows;
use super::signature::{InputName, Signature};
use super::typed::{Binding, Source, Typed, TypedKind};
use crate::diagnostic::{Diagnostic, Diagnostics, nearest};
use crate::functions::Shape;
use crate::syntax::{Body, Declaration, Expression, Let, Name, Next};

impl<'a> Checker<'a> {
    /// Returns the new values of the state, row by row; `None` after an error.
    pub(super) fn next_state(&mut self, next: &'a Next) -> Option<Typed> {
        for statement in &next.lets {
            let value = self.expression(&statement.value);
            self.define(&statement.name, value, false);
        }
        let states: Vec<&InputName> = self.signature.names.iter().filter(|name| name.is_state).collect();
        let mut values: Vec<Option<Typed>> = vec![None; states.len()];
        let mut is_sound = true;
        for assignment in &next.assignments {
            match self.assigned(assignment, &states) {
                Some((state, value)) if values[state].is_none() => values[state] = Some(value),
                Some(_) => {
                    let name = &assignment.name;
                    self.error(&name.span, format!("`next` gives the state `{}` two new values", name.text));
                    is_sound = false;
                }
                None => is_sound = false,
            }
        }
        if !is_sound {
            return None;
        }
        let missing: Vec<&str> = states
            .iter()
            .zip(&values)
            .filter(|(_, value)| value.is_none())
            .map(|(state, _)| state.name.text.as_str())
            .collect();
        if let Some(first) = missing.first() {
            let message = format!("`next` gives no new value to the state: {}", missing.join(", "));
            let help = format!("a state that stays as it is has {first} = {first};");
            self.diagnostics.push(Diagnostic::new(&next.span, message).help(help));
            return None;
        }
        let bindings = &self.bindings;
        if values.iter().flatten().any(|value| reads(bindings, value, &[Source::Velocity], &mut BTreeSet::new())) {
            let message = "`next` depends on velocities, which it does not know";
            let help = "keep the positions of the last step in a state, and take their difference";
            self.diagnostics.push(Diagnostic::new(&next.span, message).help(help));
            return None;
        }
        let entries = values.into_iter().flatten().flat_map(Typed::into_entries);
        Some(rows(entries.collect(), &next.span))
    }

    /// Returns the value of the state at rest, row by row; `None` if it is given with each element.
    pub(super) fn state_at_rest(&mut self) -> Option<Typed> {
        let states: Vec<&InputName> = self.signature.names.iter().filter(|name| name.is_state).collect();
        let given: usize = self.initial.iter().map(|(names, _)| names.len()).sum();
        let was = std::mem::replace(&mut self.in_rest, true);
        let mut entries = Vec::new();
        let mut is_sound = !states.is_empty() && given == states.len();
        for (names, value) in std::mem::take(&mut self.initial) {
            for name in names {
                let checked = self.expression(value);
                let fits = checked.and_then(|checked| self.fitting(name, value, checked, &states));
                let Some((_, found)) = fits else {
                    is_sound = false;
                    continue;
                };
                if reads(&self.bindings, &found, &[Source::Position, Source::Velocity], &mut BTreeSet::new()) {
                    let message = format!("the value of `{}` at rest depends on what moves", name.text);
                    let help = "it is computed once, from the rest shape and parameters";
                    self.diagnostics.push(Diagnostic::new(&value.span, message).help(help));
                    is_sound = false;
                }
                entries.extend(found.into_entries());
            }
        }
        self.in_rest = was;
        let span = states.first()?.name.span.clone();
        is_sound.then(|| rows(entries, &span))
    }

    /// Returns the number of the state that is assigned to, and its new value.
    fn assigned(&mut self, Let { name, value, .. }: &'a Let, states: &[&InputName]) -> Option<(usize, Typed)> {
        let checked = self.expression(value);
        if !states.iter().any(|state| state.canonical == name.canonical()) {
            let near = nearest(&name.text, states.iter().map(|state| state.name.text.as_str()));
            let help = match near {
                Some(near) => format!("did you mean `{near}`?"),
                None => "declare it after a `;`, as in (x, y: Point; state a: Scalar), or write `let`".into(),
            };
            let message = format!("`{}` is not a state", name.text);
            self.diagnostics.push(Diagnostic::new(&name.span, message).help(help));
            return None;
        };
        self.fitting(name, value, checked?, states)
    }

    /// Returns the number of a state and its value, if that has the state's shape.
    fn fitting(
        &mut self,
        name: &Name,
        value: &Expression,
        checked: Typed,
        states: &[&InputName],
    ) -> Option<(usize, Typed)> {
        let number = states.iter().position(|state| state.canonical == name.canonical())?;
        let state = states[number];
        let wanted =
            state.length.map_or(state.shape, |length| Shape::Array(u16::try_from(length).expect("arrays are short")));
        let entries = match &checked.kind {
            TypedKind::Array(entries) if matches!(wanted, Shape::Array(_)) => entries.as_slice(),
            _ => std::slice::from_ref(&checked),
        };
        let wrong = entries.iter().find(|entry| entry.shape != state.shape);
        if checked.shape != wanted || wrong.is_some() {
            let found = if checked.shape == wanted { wrong.map_or(checked.shape, |w| w.shape) } else { checked.shape };
            let message = format!("the state `{}` is {wanted}, but its value is {found}", name.text);
            self.error(&value.span, message);
            return None;
        }
        Some((number, checked))
    }
}

/// Returns whether a value depends on inputs of some sections, through bindings too.
fn reads(bindings: &[Binding], typed: &Typed, sources: &[Source], seen: &mut BTreeSet<usize>) -> bool {
    match &typed.kind {
        TypedKind::Input(source, _) => sources.contains(source),
        TypedKind::Binding(number) => seen.insert(*number) && reads(bindings, &bindings[*number].value, sources, seen),
        _ => typed.parts().into_iter().any(|part| reads(bindings, part, sources, seen)),
    }
}

/// Reports a state without `next`, and `next` without a state.
pub(super) fn check_presence(
    declaration: &Declaration,
    signature: &Signature,
    body: &Body,
    diagnostics: &mut Diagnostics,
) {
    let state = signature.names.iter().find(|name| name.is_state);
    let diagnostic = match (state, &body.next) {
        (Some(state), None) => Diagnostic::new(
            &state.name.span,
            format!("`{}` is a state, but nothing says how it goes on", state.name.text),
        )
        .help(format!("add next {{ {} = …; }} before the result", state.name.text)),
        (None, Some(next)) => Diagnostic::new(&next.span, format!("{} has no state", declaration.name.text))
            .help("declare it after a `;`, as in (x, y: Point; state a: Scalar), or remove `next`"),
        _ => return,
    };
    diagnostics.push(diagnostic);
}
