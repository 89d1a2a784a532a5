use proc_macro2::TokenStream;

use crate::check::{Program, check};
use crate::diagnostic::{Diagnostic, Diagnostics, Span};
use crate::interpret::interpret;
use crate::lower::{Formula, lower_textbook};
use crate::runtime::{Inputs, Number};
use crate::syntax::parse;

/// A declaration in its printed form, without robust primitives and rewrites, to be evaluated over any number type: what an
/// audit holds generated code against.
///
/// ```
/// use energy_dsl::{Inputs, Textbook};
/// let spring = Textbook::from_source("energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }").unwrap();
/// let inputs = Inputs { parameters: &[8.0, 1.0], rest: &[], positions: &[0.0, 0.0, 0.0, 3.0, 0.0, 4.0], velocities: &[] };
/// assert_eq!(spring.evaluate(&inputs), [64.0]);
/// ```
#[derive(Clone, Debug)]
pub struct Textbook {
    program: Program,
    formula: Formula,
}

impl Textbook {
    /// Reads the first declaration of a text.
    ///
    /// # Errors
    /// Whatever is wrong with the text.
    pub fn from_source(source: &str) -> Result<Self, Diagnostics> {
        let program = programs(source)?.into_iter().next().ok_or_else(|| {
            let here = Span::of(proc_macro2::Span::call_site());
            Diagnostics::from(Diagnostic::new(&here, "expected a declaration, found none"))
        })?;
        let formula = lower_textbook(&program);
        Ok(Self { program, formula })
    }

    /// The checked declaration.
    #[must_use]
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// The value, row by row: U; C; the forces, three numbers to a point; or r. A constraint's stiffness and damping are not read.
    ///
    /// # Panics
    /// When an input slice is shorter than declared.
    pub fn evaluate<T: Number>(&self, inputs: &Inputs<'_, T>) -> Vec<T> {
        interpret(&self.formula.graph, &self.formula.outputs, inputs)
    }
}

/// Parses and checks a text.
///
/// # Errors
/// Everything that is wrong with it.
pub fn programs(source: &str) -> Result<Vec<Program>, Diagnostics> {
    let mut diagnostics = Diagnostics::default();
    let stream: TokenStream = source.parse().map_err(|error| {
        let here = Span::of(proc_macro2::Span::call_site());
        Diagnostics::from(
            Diagnostic::new(&here, format!("the text does not split into tokens: {error}"))
                .help("mathematical notation stands in a string: \"‖p − q‖ − L\""),
        )
    })?;
    let items = parse(stream, &mut diagnostics);
    let programs = check(&items, &mut diagnostics);
    diagnostics.finish(programs)
}
