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
    // Specialisations may build on each other in any order. Those whose original is known go first.
    loop {
        let known: Vec<Declaration> = items
            .iter()
            .filter_map(|item| if let Item::Declaration(d) = item { Some(d.clone()) } else { None })
            .collect();
        let ready =
            |item: &Item| matches!(item, Item::Specialisation(s) if known.iter().any(|d| d.name.text == s.of.text));
        let Some(place) = items.iter().position(ready) else { break };
        let Item::Specialisation(specialisation) = items.remove(place) else { break };
        if let Some(declaration) = specialised(&known, *specialisation, diagnostics) {
            items.insert(place, Item::Declaration(declaration));
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

fn specialised(
    known: &[Declaration],
    specialisation: Specialisation,
    diagnostics: &mut Diagnostics,
) -> Option<Declaration> {
    let Specialisation { declaration, of, values } = specialisation;
    let original = known.iter().find(|d| d.name.text == of.text)?;
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
    Some(Declaration { docs, inputs, body, uncompensated, formula: original.formula.clone(), source, ..declaration })
}
