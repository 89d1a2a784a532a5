//! Elements that are read at run time: the block tape behind one type.
//!
//! [`Interpreted::from_source`] compiles a text. [`Interpreted::inputs`] lists what an element reads,
//! [`Interpreted::elements`] binds parameters and rest shapes of many elements, and the methods of [`Elements`] write
//! values and derivatives of a range of them to slices. All of this works in `f64` and in `f32`, and several threads
//! may evaluate ranges of the same elements.

mod elements;
mod inputs;
mod layouts;
mod mutants;
mod outputs;

use std::sync::Arc;

use crate::budget::{Budget, Phase};
use crate::check::Program;
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::inspect::{file_programs, programs};
use crate::lower::lower;
use crate::plan::Plan;
use crate::properties::prove;
use crate::routines::{Routines, differentiate};
use crate::tape::{TooLarge, tapes};
use energy_runtime::{Declaration, Kind, tape};

pub use elements::{Elements, EvaluateError};
pub use inputs::{BindError, InputKind, InputNumbers};
pub use layouts::Layouts;

/// An element that is read at run time. Its routines have the statements of generated code and run over blocks of
/// elements in SIMD lanes; results have the bits of generated code at the same SIMD level.
///
/// ```
/// use energy_compiler::Interpreted;
/// use energy_runtime::tape::Column;
///
/// let source = "energy Pull(p, q: Point; k: Scalar) { k / 2 * norm_squared(p - q) }";
/// let pull = Interpreted::from_source(source).unwrap().remove(0);
/// let pulls = pull.elements::<f64>(1, &[], &[Column::Same(&[2.0])]).unwrap();
/// let x = [3.0, 0.0, 4.0, 0.0, 0.0, 0.0];
/// let (mut energies, mut gradients) = ([0.0; 1], [0.0; 6]);
/// pulls.gradients(0..1, &x, &mut energies, &mut gradients).unwrap();
/// assert_eq!((energies, gradients), ([25.0], [6.0, 0.0, 8.0, -6.0, 0.0, -8.0]));
/// ```
///
/// Texts that do not compile give diagnostics with their places:
///
/// ```
/// use energy_compiler::Interpreted;
/// let errors = Interpreted::from_file("energy U(p: Point) { nrm(p) }", "u.energy").unwrap_err();
/// assert!(errors.to_string().contains("u.energy:1:22"));
/// ```
#[derive(Clone, Debug)]
pub struct Interpreted {
    inputs: Arc<Vec<InputNumbers>>,
    plan: Arc<Plan>,
    routines: Arc<tape::Routines>,
    layouts: Arc<Layouts>,
    audit_samples: Option<usize>,
}

impl Interpreted {
    /// Compiles the declarations of a text, whose strings are those of Rust.
    ///
    /// The tokens of Rust keep a copy of the text until the thread ends. [`Self::from_file`] keeps none.
    ///
    /// # Errors
    /// Whatever is wrong with the text.
    pub fn from_source(source: &str) -> Result<Vec<Self>, Diagnostics> {
        Self::from_source_within(source, &Budget::default())
    }

    /// Compiles the declarations of a text within a budget, which can also watch and end the compilation.
    ///
    /// # Errors
    /// Whatever is wrong with the text, and a budget that is spent.
    pub fn from_source_within(source: &str, budget: &Budget) -> Result<Vec<Self>, Diagnostics> {
        Self::compiled(&programs(source, budget)?)
    }

    /// Compiles the declarations in the text of a file.
    ///
    /// # Errors
    /// Whatever is wrong with the text, at its places in the file.
    pub fn from_file(text: &str, file: &str) -> Result<Vec<Self>, Diagnostics> {
        Self::from_file_within(text, file, &Budget::default())
    }

    /// Compiles the declarations in the text of a file within a budget, which can also watch and end the compilation.
    ///
    /// # Errors
    /// Whatever is wrong with the text, at its places in the file, and a budget that is spent.
    pub fn from_file_within(text: &str, file: &str, budget: &Budget) -> Result<Vec<Self>, Diagnostics> {
        Self::compiled(&file_programs(text, file, budget)?)
    }

    /// Compiles the declarations in the text of a file, energies and constraints with routines for single vertices, as
    /// if they had the attribute `#[vertex]`.
    ///
    /// # Errors
    /// Whatever is wrong with the text, and a budget that is spent.
    pub fn from_file_with_vertices(text: &str, file: &str, budget: &Budget) -> Result<Vec<Self>, Diagnostics> {
        let mut programs = file_programs(text, file, budget)?;
        for program in &mut programs {
            program.vertices |= matches!(program.kind, Kind::Energy | Kind::Constraint);
        }
        Self::compiled(&programs)
    }

    /// Compiles programs whose claims an audit may check.
    fn compiled(programs: &[Program]) -> Result<Vec<Self>, Diagnostics> {
        let mut diagnostics = Diagnostics::default();
        let mut elements = Vec::with_capacity(programs.len());
        for program in programs {
            let compiled = program.budget.within(|| {
                let routines = differentiate(program, lower(program));
                prove(program, &routines, true, &mut diagnostics);
                program.budget.enter(Phase::Writing);
                Self::new(program, &routines)
            });
            match compiled {
                Ok(Ok(element)) => elements.push(element),
                Err(stop) => {
                    diagnostics.push(program.stopped(stop));
                    break;
                }
                Ok(Err(TooLarge)) => {
                    let message = format!("{} has too many numbers to be read at run time", program.name);
                    let help = "declare it with `energy!` in Rust, or split it into several energies";
                    diagnostics.push(Diagnostic::new(&program.span, message).help(help));
                }
            }
        }
        diagnostics.finish(elements)
    }

    fn new(program: &Program, routines: &Routines) -> Result<Self, TooLarge> {
        let plan = Plan::new(program, routines);
        Ok(Self {
            inputs: Arc::new(InputNumbers::of(program)),
            routines: Arc::new(tapes(&plan)?),
            layouts: Arc::new(Layouts::of(&plan.declaration)),
            plan: Arc::new(plan),
            audit_samples: program.audit_samples,
        })
    }

    /// Returns the samples that `#[audit]` asks for; `None` without it.
    #[must_use]
    pub fn audit_samples(&self) -> Option<usize> {
        self.audit_samples
    }

    /// Returns the declaration: name, kind, formula, documentation, units, number of reduced coordinates. Whoever
    /// outlives the element shares it.
    #[must_use]
    pub fn declaration(&self) -> &Arc<Declaration> {
        &self.plan.declaration
    }

    /// Returns the plan of all routines.
    pub(crate) fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Returns all inputs in declared order: points or unknowns, rest shape, parameters. Stiffness `ks` and damping
    /// `kd`, which every constraint has, are the last parameters.
    #[must_use]
    pub fn inputs(&self) -> &[InputNumbers] {
        &self.inputs
    }

    /// Returns the number of coordinates: three per point, or the unknowns of a residual.
    #[must_use]
    pub fn coordinates(&self) -> usize {
        self.routines.coordinates
    }

    /// Returns the number of coordinates that derivatives are taken with respect to, before they are expanded to
    /// points.
    #[must_use]
    pub fn reduced_coordinates(&self) -> usize {
        self.plan.declaration.reduced_coordinates
    }

    /// Returns the routines as tapes.
    #[must_use]
    pub fn routines(&self) -> &Arc<tape::Routines> {
        &self.routines
    }
}
