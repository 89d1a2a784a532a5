//! The attribute that states where a formula is used.

use energy_dsl::{Declaration, Kind};

use crate::sample::has_points;

/// Returns an attribute with a domain that the declaration accepts: strains of a rest shape, sizes of points, or the range
/// of an input.
pub(super) fn domain(declaration: &Declaration) -> String {
    // The unknowns of a residual have ranges of their own.
    let has_size = declaration.kind != Kind::Residual && has_points(declaration);
    let is_strained = declaration.rest_points().is_some_and(|(_, number)| number == declaration.points.len());
    let range = match (has_size, declaration.parameters.first().or(declaration.points.first())) {
        (true, _) if is_strained => "strain = 0.5..2.0".into(),
        (true, _) => "scale = 0.1..1.0".into(),
        (false, Some(input)) => {
            let name = input.name.split(['[', '.']).next().unwrap_or_default();
            format!("{name} = 0.5..2.0")
        }
        (false, None) => String::new(),
    };
    format!("#[audit(domain({range}))]")
}
