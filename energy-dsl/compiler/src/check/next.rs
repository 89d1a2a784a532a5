//! Checks `next { … }`: the state of an element after an accepted step. All right sides read the old state.

use std::collections::BTreeSet;

use super::expression::Checker;
use super::result::rows;
use super::signature::{InputName, Signature};
use super::typed::{Binding, Source, Typed, TypedKind};
use crate::diagnostic::{Diagnostic, Diagnostics, nearest};
use crate::functions::Shape;
use crate::syntax::{Assignment, Body, Declaration, Expression, Next};

impl<'a> Checker<'a> {
    /// Returns the new values of the state, row by row; `None` after an error.
    pub(super) fn next_state(&mut self, next: &'a Next) -> Option<Typed> {
        for statement in &next.lets {
            let value = self.expression(&statement.value);
            self.define(&statement.name, value, false);
        }
        let states: Vec<&InputName> = self.signature.names.iter().filter(|name| name.is_state).collect();
        let mut values: NewValues = states.iter().map(|state| vec![None; state.length.unwrap_or(1)]).collect();
        let mut is_sound = true;
        for assignment in &next.assignments {
            is_sound &= self.assign(assignment, &states, &mut values).is_some();
        }
        if !is_sound {
            return None;
        }
        let missing: Vec<String> =
            states.iter().zip(&values).flat_map(|(state, values)| without_value(state, values)).collect();
        if let Some(first) = missing.first() {
            let message = format!("`next` gives no new value to the state: {}", missing.join(", "));
            let help = format!("a state that stays as it is has {first} = {first};");
            self.diagnostics.push(Diagnostic::new(&next.span, message).help(help));
            return None;
        }
        let entries: Vec<Typed> = values.into_iter().flatten().flatten().collect();
        let bindings = &self.bindings;
        if entries.iter().any(|value| reads(bindings, value, &[Source::Velocity], &mut BTreeSet::new())) {
            let message = "`next` depends on velocities, which it does not know";
            let help = "keep the positions of the last step in a state, and take their difference";
            self.diagnostics.push(Diagnostic::new(&next.span, message).help(help));
            return None;
        }
        Some(rows(entries, &next.span))
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
                let state = states.iter().find(|state| state.canonical == name.canonical());
                let fits = checked.zip(state).and_then(|(checked, state)| self.fitting(state, value, checked));
                let Some(found) = fits else {
                    is_sound = false;
                    continue;
                };
                let moving = [Source::Position, Source::Velocity];
                if found.iter().any(|entry| reads(&self.bindings, entry, &moving, &mut BTreeSet::new())) {
                    let message = format!("the value of `{}` at rest depends on what moves", name.text);
                    let help = "it is computed once, from the rest shape and parameters";
                    self.diagnostics.push(Diagnostic::new(&value.span, message).help(help));
                    is_sound = false;
                }
                entries.extend(found);
            }
        }
        self.in_rest = was;
        let span = states.first()?.name.span.clone();
        is_sound.then(|| rows(entries, &span))
    }

    /// Checks an assignment, and keeps the new values. `None` after an error.
    fn assign(&mut self, assignment: &'a Assignment, states: &[&InputName], values: &mut NewValues) -> Option<()> {
        let Assignment { name, entry, range, value } = assignment;
        let Some(number) = states.iter().position(|state| state.canonical == name.canonical()) else {
            let near = nearest(&name.text, states.iter().map(|state| state.name.text.as_str()));
            let help = match near {
                Some(near) => format!("did you mean `{near}`?"),
                None => "declare it after a `;`, as in (x, y: Point; state a: Scalar), or write `let`".into(),
            };
            let message = format!("`{}` is not a state", name.text);
            self.diagnostics.push(Diagnostic::new(&name.span, message).help(help));
            return None;
        };
        let new = match (entry, range) {
            (None, _) => {
                let checked = self.expression(value)?;
                self.fitting(states[number], value, checked)?.into_iter().enumerate().collect()
            }
            (Some(entry), None) => vec![self.new_entry(entry, value, states[number])?],
            (Some(entry), Some((index, first, end))) => {
                let range = self.range(first, end, &name.span)?;
                let new = |at| self.at_index(index, at, |checker| checker.new_entry(entry, value, states[number]));
                range.map(new).collect::<Option<_>>()?
            }
        };
        for (entry, value) in new {
            if values[number][entry].replace(value).is_some() {
                let what = state_entry(states[number], entry);
                self.error(&name.span, format!("`next` gives the state `{what}` two new values"));
                return None;
            }
        }
        Some(())
    }

    /// Returns the index of an entry of a state, and its new value.
    fn new_entry(&mut self, entry: &'a Expression, value: &'a Expression, state: &InputName) -> Option<(usize, Typed)> {
        let name = &state.name.text;
        let number = self.whole_number(entry, "an index")?;
        let Some(length) = state.length else {
            let message = format!("the state `{name}` is {}: it is assigned as a whole", state.shape);
            self.error(&entry.span, message);
            return None;
        };
        if number >= length {
            let message =
                format!("the index {number} is out of range: `{name}` has {length} entries, 0 to {}", length - 1);
            self.error(&entry.span, message);
            return None;
        }
        let checked = self.expression(value)?;
        if checked.shape != state.shape {
            let message =
                format!("an entry of the state `{name}` is {}, but its value is {}", state.shape, checked.shape);
            self.error(&value.span, message);
            return None;
        }
        Some((number, checked))
    }

    /// Returns the entries of a state's value, if it has the state's shape.
    fn fitting(&mut self, state: &InputName, value: &Expression, checked: Typed) -> Option<Vec<Typed>> {
        let wanted =
            state.length.map_or(state.shape, |length| Shape::Array(u16::try_from(length).expect("arrays are short")));
        let entries = match &checked.kind {
            TypedKind::Array(entries) if matches!(wanted, Shape::Array(_)) => entries.as_slice(),
            _ => std::slice::from_ref(&checked),
        };
        let wrong = entries.iter().find(|entry| entry.shape != state.shape);
        if checked.shape != wanted || wrong.is_some() {
            let found = if checked.shape == wanted { wrong.map_or(checked.shape, |w| w.shape) } else { checked.shape };
            let message = format!("the state `{}` is {wanted}, but its value is {found}", state.name.text);
            self.error(&value.span, message);
            return None;
        }
        Some(checked.into_entries())
    }
}

/// The new values of each state, entry by entry.
type NewValues = Vec<Vec<Option<Typed>>>;

/// Returns a state, or the entries of one, that have no new value.
fn without_value(state: &InputName, values: &[Option<Typed>]) -> Vec<String> {
    if values.iter().all(Option::is_none) {
        return vec![state.name.text.clone()];
    }
    let missing = values.iter().enumerate().filter(|(_, value)| value.is_none());
    missing.map(|(entry, _)| state_entry(state, entry)).collect()
}

fn state_entry(state: &InputName, entry: usize) -> String {
    match state.length {
        Some(_) => format!("{}[{entry}]", state.name.text),
        None => state.name.text.clone(),
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
