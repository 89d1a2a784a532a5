/// What a declaration describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A scalar U(x).
    Energy,
    /// A scalar or vector C(x).
    Constraint,
    /// One vector per point, f(x, v).
    Force,
    /// A vector r(u).
    Residual,
}

impl Kind {
    /// The keyword that declares it.
    #[must_use]
    pub const fn keyword(self) -> &'static str {
        match self {
            Self::Energy => "energy",
            Self::Constraint => "constraint",
            Self::Force => "force",
            Self::Residual => "residual",
        }
    }
}

/// A property that a declaration claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Property {
    /// A common translation of all points changes nothing: proved on the expression graph.
    TranslationInvariant,
    /// Turning all points turns the forces with them, and changes no energy: checked by the audit.
    RotationInvariant,
    /// The rest shape feels no force: checked by the audit.
    ZeroForceAtRest,
    /// Mirroring all points, or unknowns, at the origin changes no value: checked by the audit.
    Even,
}

impl Property {
    /// The attribute that declares it.
    #[must_use]
    pub const fn attribute(self) -> &'static str {
        match self {
            Self::TranslationInvariant => "invariant(translation)",
            Self::RotationInvariant => "invariant(rotation)",
            Self::ZeroForceAtRest => "rest_state(zero_force)",
            Self::Even => "even",
        }
    }
}

/// One named input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name as declared.
    pub name: &'static str,
    /// How many numbers it holds.
    pub size: usize,
    /// Its unit as declared; empty when none was given.
    pub unit: &'static str,
}

/// The arithmetic of one routine, after simplification.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OperationCount {
    /// Additions, subtractions, multiplications, negations, minima, maxima, absolute values, comparisons and selections.
    pub basic: usize,
    /// Products that fuse with a sum: one instruction where the processor has it, else two.
    pub fused: usize,
    /// Divisions and square roots.
    pub divisions_and_roots: usize,
    /// sin, cos, exp, log, atan2, pow.
    pub transcendental: usize,
    /// Exact rounding-error terms (two-sum and two-product tails), counted apart because their cost depends on the target: with
    /// fused multiply-add a product's tail is one instruction; a sum's tail is five.
    pub error_terms: usize,
}

impl OperationCount {
    /// All of them: a fused multiply-add counts as its two operations, an error term as one.
    #[must_use]
    pub const fn total(&self) -> usize {
        self.instructions() + self.fused
    }

    /// What they cost, in units of one instruction: a division or root about five, a transcendental about twenty; an exact error
    /// term one where products fuse and up to six elsewhere, taken as three.
    #[must_use]
    pub const fn cost(&self) -> usize {
        self.instructions() + 4 * self.divisions_and_roots + 19 * self.transcendental + 2 * self.error_terms
    }

    /// All of them, a fused multiply-add counting as one.
    #[must_use]
    pub const fn instructions(&self) -> usize {
        self.basic + self.fused + self.divisions_and_roots + self.transcendental + self.error_terms
    }
}

/// One generated routine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Routine {
    /// `value`, `gradient`, `hessian`, `force`, `jacobians`, ….
    pub name: &'static str,
    /// What it costs in the reduced coordinates, before the constant expansion to points.
    pub reduced: OperationCount,
    /// What it costs in all.
    pub full: OperationCount,
}

/// What was declared, carried by the generated code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Declaration {
    /// The name of the generated type.
    pub name: &'static str,
    /// What it describes.
    pub kind: Kind,
    /// The doc comment.
    pub docs: &'static str,
    /// The body as written, on one line.
    pub formula: &'static str,
    /// The whole declaration, which parses again to the same program.
    pub source: &'static str,
    /// Points (or a residual's unknowns).
    pub points: &'static [Field],
    /// Rest-shape inputs.
    pub rest: &'static [Field],
    /// Parameters, without the stiffness and damping that every constraint has.
    pub parameters: &'static [Field],
    /// Rows: 1 for an energy, the length of C or r, three per point for a force.
    pub rows: usize,
    /// What it claims of itself.
    pub properties: &'static [Property],
    /// Whether the points enter only through their differences (like the next four, proved on the expression graph).
    pub translation_invariant: bool,
    /// Whether the second derivatives of the energy, or those of the force by position, are not all identically zero: gravity's are.
    pub curved: bool,
    /// Whether the second derivatives of the energy, or those of the force by position and velocity, are the same at all positions
    /// and velocities: they need be computed only once.
    pub quadratic: bool,
    /// Whether the force depends on velocities.
    pub velocity_dependent: bool,
    /// Whether all Jacobians of the force are symmetric, entry by entry the same expression.
    pub symmetric: bool,
    /// Coordinates the derivatives are taken in, after input reduction.
    pub reduced_coordinates: usize,
    /// Of each difference vector that is three of them, the points it is made of, with their signs (`true`: added). Empty for
    /// residuals.
    pub reduced_vectors: &'static [&'static [(usize, bool)]],
    /// The robust primitives the formula was compiled to.
    pub primitives: &'static [&'static str],
    /// Each routine and its cost.
    pub routines: &'static [Routine],
}
