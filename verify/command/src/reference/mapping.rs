use crate::catalogue::find;
use energy_dsl::AnyElement;

/// The element that computes a reference potential, and the source of its parameters.
#[derive(Clone, Copy, Debug)]
pub struct Mapping {
    /// Name of the reference potential.
    pub potential: &'static str,
    /// Element of the catalogue.
    pub entry: &'static AnyElement,
    /// The record's names of the element's parameters, in order; an empty name means 0.
    pub parameters: &'static [&'static str],
    /// The record's name of the rest shape.
    pub rest: Option<&'static str>,
    /// Whether tier B applies, which makes no allowance for rounded edges.
    pub kappa_free: bool,
}

/// Potential, element, parameters, rest shape, tier B.
type Row = (&'static str, &'static str, &'static [&'static str], Option<&'static str>, bool);

const TABLE: &[Row] = &[
    ("arap_membrane", "AsRigidAsPossible", &["mu"], Some("rest_uv"), false),
    ("bw_shear", "BaraffWitkinShear", &["k"], Some("rest_uv"), false),
    ("bw_stretch", "BaraffWitkinStretch", &["k", "b_u", "b_v"], Some("rest_uv"), false),
    ("ipc_barrier", "DistanceBarrier", &["kappa", "dhat"], None, true),
    ("ipc_barrier_sq", "SquaredDistanceBarrier", &["kappa", "dhat"], None, true),
    ("snh_log_membrane", "StableNeoHookeanLog", &["lambda", "mu"], Some("rest_uv"), false),
    ("snh_membrane", "StableNeoHookean", &["lambda", "mu"], Some("rest_uv"), false),
    ("bridson_conservative", "BridsonBending", &["Kprime", "theta0"], None, false),
    ("bridson_force", "BridsonForce", &["K", "theta0"], None, false),
    ("bridson_force_damped", "BridsonForceDamped", &["K", "k_d", "theta0"], None, false),
    ("distance", "Distance", &[], None, true),
    ("distance_squared", "DistanceSquared", &[], None, true),
    ("hair_bend", "HairBend", &["k"], None, true),
    ("hinge_cos_half", "HingeCosHalf", &[], None, true),
    ("hinge_cos_theta", "HingeCos", &[], None, true),
    ("hinge_quadratic", "QuadraticHinge", &["k", "theta0"], None, false),
    ("hinge_sin_half", "HingeSinHalf", &[], None, true),
    ("hinge_theta", "HingeAngle", &[], None, true),
    ("power_law", "PowerLaw", &["alpha"], None, true),
    ("stvk_membrane", "StVK", &["lambda", "mu"], Some("rest_uv"), false),
    ("witkin_spring", "Spring", &["L", "k_s", ""], None, true),
    ("witkin_spring_damped", "Spring", &["L", "k_s", "k_d"], None, false),
    ("witkin_vector", "ZeroLengthSpring", &["k_s", ""], None, true),
    ("witkin_vector_damped", "ZeroLengthSpring", &["k_s", "k_d"], None, false),
];

/// Reference potentials without a declared element.
const UNDECLARED: &[&str] = &[];

impl Mapping {
    /// Whether the potential is a force, so that its records contain velocities.
    pub(super) fn needs_velocities(&self) -> bool {
        self.entry.declaration.kind == energy_dsl::Kind::Force || self.parameters.contains(&"k_d")
    }
}

/// Whether a reference potential has no element yet.
pub(super) fn is_undeclared(potential: &str) -> bool {
    UNDECLARED.contains(&potential)
}

/// Returns the element of a reference potential; `None` if none is declared.
#[must_use]
pub fn mapping(potential: &str) -> Option<Mapping> {
    let &(potential, element, parameters, rest, kappa_free) = TABLE.iter().find(|row| row.0 == potential)?;
    let entry = find(element).expect("the table names declared elements");
    Some(Mapping { potential, entry, parameters, rest, kappa_free })
}

#[cfg(test)]
mod tests {
    use super::{TABLE, UNDECLARED, mapping};

    #[test]
    fn each_potential_is_declared_or_listed_as_undeclared() {
        assert!(UNDECLARED.iter().all(|name| mapping(name).is_none()), "an element has come: strike it off the list");
    }

    #[test]
    fn every_row_names_a_declared_element_with_that_many_parameters() {
        for row in TABLE {
            let declaration = mapping(row.0).unwrap().entry.declaration;
            let implied = if declaration.kind == energy_dsl::Kind::Constraint { 2 } else { 0 };
            assert_eq!(declaration.parameters.len() + implied, row.2.len(), "{}", row.0);
            assert_eq!(declaration.rest.is_empty(), row.3.is_none(), "{}", row.0);
        }
    }
}
