//! Specialisations such as `energy Stiff = Spring(k = 100);`: declarations with some parameters fixed. The values fold
//! into the formula.

use super::ast::{Constant, Declaration, ElementType, Expression, Item, Section};
use super::name::Name;
use crate::diagnostic::{Diagnostic, Diagnostics, nearest};

/// A specialisation, as written.
#[derive(Clone, Debug)]
pub struct Specialisation {
    /// The new declaration, still without inputs and body.
    pub declaration: Declaration,
    /// Name of the original declaration.
    pub of: Name,
    /// Parameters with fixed values.
    pub values: Vec<(Name, Expression)>,
}

/// Replaces each specialisation by a declaration.
pub(super) fn specialise(mut items: Vec<Item>, diagnostics: &mut Diagnostics) -> Vec<Item> {
    // Specialisations may build on each other in any order: each pass resolves those whose original is known.
    let mut copied = 0;
    let mut progress = true;
    while progress {
        progress = false;
        let mut next = 0;
        while let Some(item) = items.get(next) {
            next += 1;
            let Item::Specialisation(specialisation) = item else { continue };
            let Some(original) = find(&items, &specialisation.of) else { continue };
            copied += original.source.len();
            if copied > MOST_COPIED {
                let message =
                    format!("the specialisations of this text repeat more than {MOST_COPIED} bytes of others");
                let help = "declare what differs as a parameter";
                diagnostics.push(Diagnostic::new(&specialisation.of.span, message).help(help));
                items.retain(|item| !matches!(item, Item::Specialisation(_)));
                return items;
            }
            progress = true;
            next -= 1;
            match specialised(original, specialisation, diagnostics) {
                Some(declaration) => items[next] = Item::Declaration(declaration),
                None => drop(items.remove(next)),
            }
        }
    }
    for item in &items {
        let Item::Specialisation(specialisation) = item else { continue };
        let of = &specialisation.of;
        let names =
            items.iter().filter_map(|i| if let Item::Declaration(d) = i { Some(d.name.text.as_str()) } else { None });
        let help = nearest(&of.text, names)
            .map_or_else(|| "it must be declared in the same text".into(), |near| format!("did you mean `{near}`?"));
        diagnostics.push(Diagnostic::new(&of.span, format!("unknown declaration `{}`", of.text)).help(help));
    }
    items
}

/// Maximum size of the texts that specialisations copy, in bytes.
const MOST_COPIED: usize = 1 << 20;

fn find<'a>(items: &'a [Item], name: &Name) -> Option<&'a Declaration> {
    let mut all = items.iter().filter_map(|item| if let Item::Declaration(d) = item { Some(d) } else { None });
    all.find(|declaration| declaration.name.text == name.text)
}

fn specialised(
    original: &Declaration,
    specialisation: &Specialisation,
    diagnostics: &mut Diagnostics,
) -> Option<Declaration> {
    let Specialisation { declaration, of, values } = specialisation.clone();
    if original.kind != declaration.kind {
        let (kind, found) = (declaration.kind.keyword(), original.kind.keyword());
        let message = format!(
            "`{}` is declared as {found}, so `{}` cannot be declared as \
            {kind}",
            of.text, declaration.name.text
        );
        diagnostics
            .push(Diagnostic::new(&of.span, message).help(format!("write {found} {} = …", declaration.name.text)));
        return None;
    }
    let mut inputs = original.inputs.clone();
    let mut body = original.body.clone();
    let mut fixed = Vec::new();
    for (name, value) in values {
        let found = inputs.iter_mut().find_map(|group| {
            let place = group.names.iter().position(|n| n.canonical() == name.canonical())?;
            let scalar = group.section == Section::Parameter && group.element == ElementType::Scalar;
            (scalar && group.length.is_none()).then(|| (group.names.remove(place), group.unit.clone()))
        });
        let Some((name, unit)) = found else {
            let message = format!("`{}` is not a scalar parameter of `{}`", name.text, of.text);
            diagnostics.push(
                Diagnostic::new(&name.span, message).help("points, rest shapes, vectors and arrays cannot be fixed"),
            );
            return None;
        };
        fixed.push(name.text.clone());
        if let Some(body) = &mut body {
            body.constants.push(Constant { name, unit, value, source: String::new() });
        }
    }
    inputs.retain(|group| !group.names.is_empty());
    let mut docs = declaration.docs.clone();
    docs.push(format!(" `{}` with fixed {}: {}", of.text, fixed.join(", "), declaration.formula));
    // The original's text follows, so that this declaration comes first.
    let source = format!("{} {}", declaration.source, original.source);
    let uncompensated = declaration.uncompensated || original.uncompensated;
    let vertices = declaration.vertices || original.vertices;
    let time_step = declaration.time_step.clone().or_else(|| original.time_step.clone());
    let (limits, formula) = (declaration.limits.or(original.limits), original.formula.clone());
    Some(Declaration { docs, inputs, body, uncompensated, vertices, time_step, limits, formula, source, ..declaration })
}
