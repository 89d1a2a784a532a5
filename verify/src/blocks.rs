//! Named blocks of numbers: what an element returns, and what it is compared with.

use energy_dsl::{Declaration, Flags, Inputs, Kind, Outputs, RestError};
use serde::Serialize;

/// How a generated element is evaluated, whatever its type.
pub type Evaluate = fn(&Inputs<'_, f64>) -> Result<Outputs<f64>, RestError>;

/// The blocks that an element may return.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub enum BlockName {
    /// U.
    #[serde(rename = "energy")]
    Energy,
    /// ∂U/∂x.
    #[serde(rename = "grad")]
    Gradient,
    /// ∂²U/∂x².
    #[serde(rename = "hess")]
    Hessian,
    /// f.
    #[serde(rename = "force")]
    Force,
    /// ∂f/∂x.
    #[serde(rename = "dfdx")]
    ForceByPosition,
    /// ∂f/∂v.
    #[serde(rename = "dfdv")]
    ForceByVelocity,
    /// C.
    #[serde(rename = "constraint")]
    Constraint,
    /// r.
    #[serde(rename = "residual")]
    Residual,
    /// ∂C/∂x or ∂r/∂u.
    #[serde(rename = "jacobian")]
    Jacobian,
}

impl BlockName {
    /// The name it carries in [`Outputs::blocks`] and in record files.
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
        }
    }

    /// The blocks that an element of this kind returns.
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

    /// How often an element's own formula was differentiated to obtain this block: its place in [`Outputs::flags`].
    #[must_use]
    pub fn order(self, kind: Kind) -> usize {
        match self {
            Self::Energy | Self::Constraint | Self::Residual => 0,
            Self::Gradient | Self::Jacobian => 1,
            Self::Hessian => 2,
            // A constraint's force holds J already.
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
    /// Which one.
    pub name: BlockName,
    /// Numbers to a row.
    pub columns: usize,
    /// All numbers.
    pub numbers: Vec<T>,
}

impl<T: Clone> Block<T> {
    pub(crate) fn new(name: BlockName, columns: usize, numbers: Vec<T>) -> Self {
        Self { name, columns, numbers }
    }

    pub(crate) fn from_rows(name: BlockName, rows: &[Vec<T>]) -> Self {
        Self { name, columns: rows.first().map_or(0, Vec::len), numbers: rows.concat() }
    }
}

impl Block {
    /// The largest magnitude; NaN if there is one.
    #[must_use]
    pub fn largest(&self) -> f64 {
        largest(&self.numbers)
    }
}

/// The largest magnitude; NaN if there is one.
pub(crate) fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().map(|x| x.abs()).fold(0.0, |most, x| if most.is_nan() || x <= most { most } else { x })
}

/// An element's answer, its blocks checked for completeness.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The blocks in the order of [`BlockName::of_kind`].
    pub blocks: Vec<Block>,
    /// The same blocks as other routines return them: the routine, and the block.
    pub repeats: Vec<(&'static str, Block)>,
    /// Conditions met, by order of derivative.
    pub flags: [Flags<f64>; 3],
}

impl Answer {
    /// A block that this kind of element has.
    ///
    /// # Panics
    /// When it has none of this name: a mistake in the caller.
    #[must_use]
    pub fn block(&self, name: BlockName) -> &Block {
        self.blocks.iter().find(|block| block.name == name).expect("the kind of element decides the blocks")
    }
}

/// Why an element gave no usable answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoAnswer {
    /// The rest shape is degenerate.
    #[error(transparent)]
    Rest(#[from] RestError),
    /// A block is not among the outputs.
    #[error("{element}: the block `{block}` is missing from the outputs of this {kind}")]
    Missing {
        /// The element.
        element: &'static str,
        /// The missing block.
        block: BlockName,
        /// The kind of element.
        kind: &'static str,
    },
    /// A block has the wrong length.
    #[error("{element}: the block `{block}` holds {found} numbers, expected {expected}")]
    Length {
        /// The element.
        element: &'static str,
        /// The block.
        block: BlockName,
        /// How many numbers it must hold.
        expected: usize,
        /// How many it holds.
        found: usize,
    },
}

/// Evaluates an element and checks that every block of its kind is there in full.
///
/// # Errors
/// On a degenerate rest shape, a missing block or one of the wrong length.
pub fn evaluate(
    declaration: &'static Declaration,
    evaluate: impl Fn(&Inputs<'_, f64>) -> Result<Outputs<f64>, RestError>,
    inputs: &Inputs<'_, f64>,
) -> Result<Answer, NoAnswer> {
    let mut outputs = evaluate(inputs)?;
    let element = declaration.name;
    let mut blocks = Vec::new();
    for &name in BlockName::of_kind(declaration.kind) {
        let (rows, columns) = shape(declaration, name);
        let at = outputs.blocks.iter().position(|(found, _)| *found == name.name());
        let numbers = match at {
            Some(at) => outputs.blocks.swap_remove(at).1,
            None => return Err(NoAnswer::Missing { element, block: name, kind: declaration.kind.keyword() }),
        };
        if numbers.len() != rows * columns {
            return Err(NoAnswer::Length { element, block: name, expected: rows * columns, found: numbers.len() });
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

/// Rows and columns of a block; vectors are one row.
fn shape(declaration: &Declaration, name: BlockName) -> (usize, usize) {
    let n: usize = declaration.points.iter().map(|point| point.size).sum();
    match name {
        BlockName::Energy => (1, 1),
        BlockName::Gradient | BlockName::Force => (1, n),
        BlockName::Hessian | BlockName::ForceByPosition | BlockName::ForceByVelocity => (n, n),
        BlockName::Constraint | BlockName::Residual => (1, declaration.rows),
        BlockName::Jacobian => (declaration.rows, n),
    }
}
