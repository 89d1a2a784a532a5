//! Named blocks of numbers that elements return and that the audit compares.

use energy_dsl::{Declaration, Flags, Inputs, Kind, Outputs, RestError};
use serde::Serialize;

use crate::sample::state_size;

/// A function that evaluates a generated element of any type.
pub type Evaluate = fn(&Inputs<'_, f64>) -> Result<Outputs<f64>, RestError>;

/// The blocks that an element may return.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub enum BlockName {
    /// The energy U.
    #[serde(rename = "energy")]
    Energy,
    /// ∂U/∂x.
    #[serde(rename = "grad")]
    Gradient,
    /// ∂²U/∂x².
    #[serde(rename = "hess")]
    Hessian,
    /// The force f.
    #[serde(rename = "force")]
    Force,
    /// ∂f/∂x.
    #[serde(rename = "dfdx")]
    ForceByPosition,
    /// ∂f/∂v.
    #[serde(rename = "dfdv")]
    ForceByVelocity,
    /// The constraint C.
    #[serde(rename = "constraint")]
    Constraint,
    /// The residual r.
    #[serde(rename = "residual")]
    Residual,
    /// ∂C/∂x or ∂r/∂u.
    #[serde(rename = "jacobian")]
    Jacobian,
    /// The state after a step.
    #[serde(rename = "next")]
    Next,
    /// Its derivative by the unknowns.
    #[serde(rename = "next_by_unknowns")]
    NextByUnknowns,
    /// Its derivative by the state before.
    #[serde(rename = "next_by_state")]
    NextByState,
    /// ∂²U/∂x∂(state), or ∂r/∂(state).
    #[serde(rename = "slopes_by_state")]
    SlopesByState,
}

impl BlockName {
    /// Returns the name of the block in [`Outputs::blocks`] and in record files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Energy => "energy",
            Self::Gradient => "grad",
            Self::Hessian => "hess",
            Self::Force => "force",
            Self::ForceByPosition => "dfdx",
            Self::ForceByVelocity => "dfdv",
            Self::Constraint => "constraint",
            Self::Residual => "residual",
            Self::Jacobian => "jacobian",
            Self::Next => "next",
            Self::NextByUnknowns => "next_by_unknowns",
            Self::NextByState => "next_by_state",
            Self::SlopesByState => "slopes_by_state",
        }
    }

    /// Returns the blocks of an element of this kind.
    #[must_use]
    pub fn of_kind(kind: Kind) -> &'static [Self] {
        use BlockName::{Constraint, Energy, Force, ForceByPosition, ForceByVelocity};
        use BlockName::{Gradient, Hessian, Jacobian, Residual};
        match kind {
            Kind::Energy => &[Energy, Gradient, Hessian],
            Kind::Force => &[Force, ForceByPosition, ForceByVelocity],
            Kind::Constraint => {
                &[Constraint, Jacobian, Energy, Gradient, Hessian, Force, ForceByPosition, ForceByVelocity]
            }
            Kind::Residual => &[Residual, Jacobian],
        }
    }

    /// Returns the blocks of a declaration: those of its kind, and those of its state.
    #[must_use]
    pub fn of(declaration: &Declaration) -> Vec<Self> {
        let mut names = Self::of_kind(declaration.kind).to_vec();
        if !declaration.state.is_empty() {
            names.extend([Self::Next, Self::NextByUnknowns, Self::NextByState]);
            if declaration.kind != Kind::Force {
                names.push(Self::SlopesByState);
            }
        }
        names
    }

    /// Returns the order of differentiation of the element's formula that yields this block, which is its index in
    /// [`Outputs::flags`].
    #[must_use]
    pub fn order(self, kind: Kind) -> usize {
        match self {
            Self::Energy | Self::Constraint | Self::Residual | Self::Next => 0,
            Self::Gradient | Self::Jacobian | Self::NextByUnknowns | Self::NextByState => 1,
            Self::SlopesByState => 1 + usize::from(kind != Kind::Residual),
            Self::Hessian => 2,
            // The force of a constraint contains its Jacobian.
            Self::Force => usize::from(kind == Kind::Constraint),
            Self::ForceByPosition => 1 + usize::from(kind == Kind::Constraint),
            Self::ForceByVelocity => 1,
        }
    }
}

impl std::fmt::Display for BlockName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// One block, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Block<T = f64> {
    /// Name of the block.
    pub name: BlockName,
    /// Numbers per row.
    pub columns: usize,
    /// Numbers of the block.
    pub numbers: Vec<T>,
}

impl<T: Clone> Block<T> {
    /// Creates a block from its entries, row by row.
    #[must_use]
    pub fn new(name: BlockName, columns: usize, numbers: Vec<T>) -> Self {
        Self { name, columns, numbers }
    }

    /// Creates a block from its rows.
    #[must_use]
    pub fn from_rows(name: BlockName, rows: &[Vec<T>]) -> Self {
        Self { name, columns: rows.first().map_or(0, Vec::len), numbers: rows.concat() }
    }
}

impl Block {
    /// Returns the largest magnitude; NaN if the block contains one.
    #[must_use]
    pub fn largest(&self) -> f64 {
        largest(&self.numbers)
    }
}

/// Returns the largest magnitude; NaN if the numbers contain one.
pub fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().map(|x| x.abs()).fold(0.0, |most, x| if most.is_nan() || x <= most { most } else { x })
}

/// The complete blocks of an element at one input.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Blocks in the order of [`BlockName::of`].
    pub blocks: Vec<Block>,
    /// Blocks that further routines return as well, with the name of the routine.
    pub repeats: Vec<(&'static str, Block)>,
    /// Flags by order of differentiation.
    pub flags: [Flags<f64>; 3],
}

impl Answer {
    /// Returns a block by its name.
    ///
    /// # Panics
    /// If elements of this kind have no such block.
    #[must_use]
    pub fn block(&self, name: BlockName) -> &Block {
        self.blocks.iter().find(|block| block.name == name).expect("the kind of element decides the blocks")
    }
}

/// The reason why an element has no usable result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoAnswer {
    /// The rest shape is degenerate.
    #[error(transparent)]
    Rest(#[from] RestError),
    /// The outputs lack a block.
    #[error("{element}: the block `{block}` is missing from the outputs of this {kind}")]
    Missing {
        /// Name of the element.
        element: String,
        /// Name of the missing block.
        block: BlockName,
        /// Kind of the element.
        kind: &'static str,
    },
    /// A block has the wrong length.
    #[error("{element}: the block `{block}` holds {found} numbers, expected {expected}")]
    Length {
        /// Name of the element.
        element: String,
        /// Name of the block.
        block: BlockName,
        /// Expected length.
        expected: usize,
        /// Actual length.
        found: usize,
    },
}

/// Evaluates an element and checks that it returns every block of its kind in full.
///
/// # Errors
/// If the rest shape is degenerate, or a block is missing or has the wrong length.
pub fn evaluate(
    declaration: &Declaration,
    evaluate: impl Fn(&Inputs<'_, f64>) -> Result<Outputs<f64>, RestError>,
    inputs: &Inputs<'_, f64>,
) -> Result<Answer, NoAnswer> {
    let mut outputs = evaluate(inputs)?;
    let element = || declaration.name.to_string();
    let mut blocks = Vec::new();
    for name in BlockName::of(declaration) {
        let (rows, columns) = shape(declaration, name);
        let at = outputs.blocks.iter().position(|(found, _)| *found == name.name());
        let numbers = match at {
            Some(at) => outputs.blocks.swap_remove(at).1,
            None => {
                return Err(NoAnswer::Missing { element: element(), block: name, kind: declaration.kind.keyword() });
            }
        };
        if numbers.len() != rows * columns {
            return Err(NoAnswer::Length {
                element: element(),
                block: name,
                expected: rows * columns,
                found: numbers.len(),
            });
        }
        blocks.push(Block::new(name, columns, numbers));
    }
    let mut repeats = Vec::new();
    for (routine, block, numbers) in outputs.repeats {
        let same: Option<&Block> = blocks.iter().find(|b: &&Block| b.name.name() == block);
        if let Some(same) = same.filter(|same| same.numbers.len() == numbers.len()) {
            repeats.push((routine, Block::new(same.name, same.columns, numbers)));
        }
    }
    Ok(Answer { blocks, repeats, flags: outputs.flags })
}

/// Returns the number of rows and columns of a block; vectors have one row.
fn shape(declaration: &Declaration, name: BlockName) -> (usize, usize) {
    let (n, states) = (declaration.increments(), state_size(declaration));
    match name {
        BlockName::Energy => (1, 1),
        BlockName::Gradient | BlockName::Force => (1, n),
        BlockName::Hessian | BlockName::ForceByPosition | BlockName::ForceByVelocity => (n, n),
        BlockName::Constraint | BlockName::Residual => (1, declaration.rows),
        BlockName::Jacobian => (declaration.rows, n),
        BlockName::Next => (1, states),
        BlockName::NextByUnknowns => (states, n),
        BlockName::NextByState => (states, states),
        BlockName::SlopesByState if declaration.kind == Kind::Residual => (declaration.rows, states),
        BlockName::SlopesByState => (n, states),
    }
}
