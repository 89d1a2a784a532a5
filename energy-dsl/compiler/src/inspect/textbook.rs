use proc_macro2::TokenStream;

use crate::budget::Budget;
use crate::check::{Program, Source, check};
use crate::diagnostic::{Diagnostic, Diagnostics, Span};
use crate::graph::{Interpreter, NodeId};
use crate::inspect::parts::Parts;
use crate::inspect::tower::Tower;
use crate::lower::{TextbookFormula, lower_textbook};
use crate::syntax::{check_size, parse, parse_file};
use energy_runtime::{Inputs, Number};

/// A declaration in its textbook form, without robust primitives and rewrites. It can be evaluated over any number
/// type; the audit compares generated code with it.
///
/// ```
/// use energy_compiler::Textbook;
/// use energy_runtime::Inputs;
/// let source = "energy Spring(p, q: Point; k, L: Scalar) { k / 2 * (norm(p - q) - L)^2 }";
/// let spring = Textbook::from_source(source).unwrap();
/// let x = [0.0, 0.0, 0.0, 3.0, 0.0, 4.0];
/// let inputs = Inputs { parameters: &[8.0, 1.0], rest: &[], positions: &x, velocities: &[] };
/// assert_eq!(spring.evaluate(&inputs), [64.0]);
/// ```
#[derive(Clone, Debug)]
pub struct Textbook {
    program: Program,
    rows: Interpreter,
    /// The state after a step.
    next: Interpreter,
    /// The derivatives that the formula uses.
    derivatives: Vec<Derivative>,
    /// The rows, and all that is differentiated.
    everything: Interpreter,
}

/// A derivative that a formula uses, by one number of a section.
#[derive(Clone, Debug)]
struct Derivative {
    of: Interpreter,
    source: Source,
    by: usize,
}

impl Textbook {
    /// Parses the first declaration of a text.
    ///
    /// # Errors
    /// Whatever is wrong with the text.
    pub fn from_source(source: &str) -> Result<Self, Diagnostics> {
        Self::from_source_within(source, &Budget::default())
    }

    /// Parses the first declaration of a text within a budget.
    ///
    /// # Errors
    /// Whatever is wrong with the text, and a budget that is spent.
    pub fn from_source_within(source: &str, budget: &Budget) -> Result<Self, Diagnostics> {
        let program = programs(source, budget)?.into_iter().next().ok_or_else(|| {
            let here = Span::of(proc_macro2::Span::call_site());
            Diagnostics::from(Diagnostic::new(&here, "expected a declaration, found none"))
        })?;
        let lowered = program.budget.within(|| lower_textbook(&program));
        let TextbookFormula { formula, next, gradients } = lowered.map_err(|stop| program.stopped(stop))?;
        let interpreter = |outputs: &[NodeId]| Interpreter::new(&formula.graph, outputs);
        let inner = gradients.iter().map(|(of, ..)| *of);
        let everything: Vec<NodeId> =
            formula.outputs.iter().copied().chain(next.iter().copied()).chain(inner).collect();
        let derivative =
            |&(of, source, by): &(NodeId, Source, usize)| Derivative { of: interpreter(&[of]), source, by };
        let derivatives = gradients.iter().map(derivative).collect();
        let (rows, everything) = (interpreter(&formula.outputs), interpreter(&everything));
        let next = interpreter(&next);
        Ok(Self { program, rows, next, derivatives, everything })
    }

    /// Returns the checked declaration.
    #[must_use]
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Returns the subexpressions of the formula; `None` if it contains derivatives or is too large.
    #[must_use]
    pub fn parts(&self) -> Option<Parts> {
        Parts::of(&self.program)
    }

    /// Evaluates the formula, row by row: U; C; the forces, three numbers per point; or r. The stiffness and damping of
    /// a constraint are not used.
    ///
    /// Derivatives that the formula uses (`gradient(U, p)`) are computed with dual numbers over `T`, independently of
    /// the compiler's differentiation.
    ///
    /// # Panics
    /// When an input slice is shorter than declared.
    pub fn evaluate<T: Number>(&self, inputs: &Inputs<'_, T>) -> Vec<T> {
        self.run(&self.rows, inputs)
    }

    /// Evaluates the state after a step; nothing without a state.
    ///
    /// # Panics
    /// When an input slice is shorter than declared.
    pub fn evaluate_next<T: Number>(&self, inputs: &Inputs<'_, T>) -> Vec<T> {
        self.run(&self.next, inputs)
    }

    fn run<T: Number>(&self, outputs: &Interpreter, inputs: &Inputs<'_, T>) -> Vec<T> {
        if self.derivatives.is_empty() {
            return outputs.evaluate(inputs, &[]);
        }
        let inputs = TowerInputs::of(inputs);
        let gradients = self.gradients(outputs, &inputs, 1);
        let rows = outputs.evaluate(&inputs.borrow(), &gradients);
        rows.into_iter().map(Tower::into_plain).collect()
    }

    /// Returns the branches that the formula takes at an input: the outcome of each comparison, the smaller operand of
    /// each minimum and maximum, the sign in each absolute value. Between two inputs with the same branches, the
    /// formula may be smooth; between others it may have a kink or a jump.
    ///
    /// # Panics
    /// When an input slice is shorter than declared.
    #[must_use]
    pub fn branches(&self, inputs: &Inputs<'_, f64>) -> Vec<bool> {
        if self.derivatives.is_empty() {
            return self.everything.branches(inputs, &[]);
        }
        let inputs = TowerInputs::of(inputs);
        let gradients = self.gradients(&self.everything, &inputs, 1);
        self.everything.branches(&inputs.borrow(), &gradients)
    }

    /// Returns the derivatives that some outputs use (0 for unused ones). Each nesting depth has its own ε.
    fn gradients<T: Number>(&self, outputs: &Interpreter, inputs: &TowerInputs<T>, depth: usize) -> Vec<Tower<T>> {
        let mut numbers = vec![Tower::from_f64(0.0); self.derivatives.len()];
        for number in outputs.precomputed() {
            let Derivative { of, source, by } = &self.derivatives[number];
            let moved = inputs.raised(*source, *by, depth);
            let within = self.gradients(of, &moved, depth + 1);
            numbers[number] = of.evaluate(&moved.borrow(), &within).remove(0).slope(depth);
        }
        numbers
    }
}

/// Inputs as nested dual numbers.
#[derive(Clone)]
struct TowerInputs<T> {
    parameters: Vec<Tower<T>>,
    rest: Vec<Tower<T>>,
    positions: Vec<Tower<T>>,
    velocities: Vec<Tower<T>>,
}

impl<T: Number> TowerInputs<T> {
    fn of(inputs: &Inputs<'_, T>) -> Self {
        let plain = |numbers: &[T]| numbers.iter().cloned().map(Tower::Plain).collect::<Vec<_>>();
        Self {
            parameters: plain(inputs.parameters),
            rest: plain(inputs.rest),
            positions: plain(inputs.positions),
            velocities: plain(inputs.velocities),
        }
    }

    /// Adds the ε of this depth to one number of a section.
    fn raised(&self, source: Source, number: usize, depth: usize) -> Self {
        let mut inputs = self.clone();
        let section = match source {
            Source::Position => &mut inputs.positions,
            Source::Velocity => &mut inputs.velocities,
            Source::Rest => &mut inputs.rest,
            Source::Parameter => &mut inputs.parameters,
        };
        section[number] = section[number].clone().raised(depth);
        inputs
    }

    fn borrow(&self) -> Inputs<'_, Tower<T>> {
        Inputs {
            parameters: &self.parameters,
            rest: &self.rest,
            positions: &self.positions,
            velocities: &self.velocities,
        }
    }
}

/// Parses and checks a text.
///
/// # Errors
/// Everything that is wrong with it.
pub fn programs(source: &str, budget: &Budget) -> Result<Vec<Program>, Diagnostics> {
    let mut diagnostics = Diagnostics::default();
    check_size(source, "the text", &Span::of(proc_macro2::Span::call_site()))?;
    let stream: TokenStream = source.parse().map_err(|_| not_tokens(source))?;
    let items = parse(stream, &mut diagnostics);
    let programs = check(&items, budget, &mut diagnostics);
    diagnostics.finish(programs)
}

/// Describes why a text is not tokens of Rust: by the characters that cannot be tokens, or else by its strings.
fn not_tokens(source: &str) -> Diagnostics {
    let mut diagnostics = Diagnostics::default();
    let here = Span::of(proc_macro2::Span::call_site());
    parse_file(source, "text", &here, &mut diagnostics);
    if diagnostics.0.is_empty() {
        let message = "the text does not split into tokens of Rust";
        let help = "in Rust code, write a backslash in a string twice, as in \"\\\\theta\", and balance all brackets";
        diagnostics.push(Diagnostic::new(&here, message).help(help));
    }
    diagnostics
}

/// Parses and checks the text of a file, where mathematical notation is in strings without escapes. Messages name the
/// file.
///
/// # Errors
/// Everything that is wrong with it.
pub fn file_programs(text: &str, file: &str, budget: &Budget) -> Result<Vec<Program>, Diagnostics> {
    let mut diagnostics = Diagnostics::default();
    let here = Span::of(proc_macro2::Span::call_site());
    let items = parse_file(text, file, &here, &mut diagnostics);
    let programs = check(&items, budget, &mut diagnostics);
    diagnostics.finish(programs)
}
