use energy_runtime::{Baseline, Number, OperationCount, with_operations};

pub use energy_runtime::tape::Input;

/// Index of a node. Operands have smaller indices than their uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(pub(crate) u32);

/// A row of the table of operations, for those who write code.
#[derive(Clone, Copy, Debug)]
pub struct Spelling {
    /// The meaning as Rust, over a number type at a SIMD level `L`.
    pub meaning: &'static str,
    /// The names of the operands in the meaning.
    pub operands: &'static [&'static str],
}

/// The result of an operation over a number type.
#[derive(Clone)]
pub enum Computed<T: Number> {
    /// A floating-point number.
    Number(T),
    /// The result of a comparison, a mask.
    Mask(T::Mask),
}

/// The type of an operand.
macro_rules! node {
    ($operand:ident) => {
        NodeId
    };
}

macro_rules! define {
    (
        numbers {
            elementary {
                $($(#[doc = $docs:literal])* $number:ident($($operand:ident),*) = $meaning:expr, [$($cost:ident),*];)*
            }
            rounding {
                $($(#[doc = $error_docs:literal])* $error:ident($($of:ident),*) = $value:expr, [$($term:ident),*];)*
            }
            joint $_joint:tt
        }
        masks {
            comparisons { $($(#[doc = $less:literal])* $comparison:ident($($compared:ident),*) = $outcome:expr;)* }
            connectives { $($(#[doc = $and:literal])* $connective:ident($($connected:ident),*) = $mask:expr;)* }
        }
    ) => {
        /// A scalar operation. Comparisons and connectives return masks, all others numbers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Op {
            /// A constant, as the bits of a double.
            Constant(u64),
            /// A constant mask.
            Truth(bool),
            /// The mask of configurations that may be extraordinary, so that precautions are needed.
            Cautious,
            /// π in the precision of the number type.
            Pi,
            /// An input number.
            Input(Input),
            /// Mask, value where it holds, value elsewhere.
            Select(NodeId, NodeId, NodeId),
            /// Whether a is a moderate power of a length, so that no scaling is needed.
            IsModerate(NodeId, u8),
            /// A robust primitive with its own derivative rules, by index.
            Rule(u32),
            $($(#[doc = $docs])* $number($(node!($operand)),*),)*
            $($(#[doc = $error_docs])* $error($(node!($of)),*),)*
            $($(#[doc = $less])* $comparison($(node!($compared)),*),)*
            $($(#[doc = $and])* $connective($(node!($connected)),*),)*
        }

        impl Op {
            /// Returns the operands. A rule has none here.
            pub fn operands(self) -> impl Iterator<Item = NodeId> {
                let (count, list) = match self {
                    Self::Constant(_) | Self::Truth(_) | Self::Cautious | Self::Pi | Self::Input(_) | Self::Rule(_) => {
                        listed([])
                    }
                    Self::Select(mask, a, b) => listed([mask, a, b]),
                    Self::IsModerate(a, _) => listed([a]),
                    $(Self::$number($($operand),*) => listed([$($operand),*]),)*
                    $(Self::$error($($of),*) => listed([$($of),*]),)*
                    $(Self::$comparison($($compared),*) => listed([$($compared),*]),)*
                    $(Self::$connective($($connected),*) => listed([$($connected),*]),)*
                };
                list.into_iter().take(count)
            }

            /// Returns the operation on other operands.
            #[must_use]
            pub fn with_operands(self, mut to: impl FnMut(NodeId) -> NodeId) -> Self {
                match self {
                    Self::Constant(_) | Self::Truth(_) | Self::Cautious | Self::Pi | Self::Input(_) | Self::Rule(_) => {
                        self
                    }
                    Self::Select(mask, a, b) => Self::Select(to(mask), to(a), to(b)),
                    Self::IsModerate(a, degree) => Self::IsModerate(to(a), degree),
                    $(Self::$number($($operand),*) => Self::$number($(to($operand)),*),)*
                    $(Self::$error($($of),*) => Self::$error($(to($of)),*),)*
                    $(Self::$comparison($($compared),*) => Self::$comparison($(to($compared)),*),)*
                    $(Self::$connective($($connected),*) => Self::$connective($(to($connected)),*),)*
                }
            }

            /// Returns whether the node is a rounding error or a scale. Its derivative is zero for all operands.
            #[must_use]
            pub fn is_constant_in_exact_arithmetic(self) -> bool {
                matches!(self, $(Self::$error(..))|*)
            }

            /// Returns whether the node is a mask.
            #[must_use]
            pub fn is_mask(self) -> bool {
                let (is_comparison, is_connective) =
                    (matches!(self, $(Self::$comparison(..))|*), matches!(self, $(Self::$connective(..))|*));
                is_comparison || is_connective || matches!(self, Self::Truth(_) | Self::Cautious | Self::IsModerate(..))
            }

            /// Adds the operation to a count.
            pub fn add_to(self, count: &mut OperationCount) {
                match self {
                    Self::Constant(_) | Self::Truth(_) | Self::Cautious | Self::Pi | Self::Input(_) => {}
                    Self::Rule(_) => unreachable!("compiler bug: rules are resolved to their values"),
                    $(Self::$number(..) => {
                        $(count.$cost += 1;)*
                    })*
                    $(Self::$error(..) => {
                        $(count.$term += 1;)*
                    })*
                    _ => count.basic += 1,
                }
            }

            /// Returns the instruction of a tape that computes this; `None` for constants, inputs and rules.
            pub(crate) fn on_tape(self) -> Option<energy_runtime::tape::Operation> {
                use energy_runtime::tape::Operation;
                Some(match self {
                    $(Self::$number(..) => Operation::$number,)*
                    $(Self::$error(..) => Operation::$error,)*
                    $(Self::$comparison(..) => Operation::$comparison,)*
                    $(Self::$connective(..) => Operation::$connective,)*
                    Self::Select(..) => Operation::Select,
                    Self::IsModerate(..) => Operation::IsModerate,
                    _ => return None,
                })
            }

            /// Returns how the table spells the operation; `None` for operations outside the table.
            pub(crate) fn spelling(self) -> Option<Spelling> {
                let (meaning, operands): (_, &[&str]) = match self {
                    $(Self::$number(..) => (stringify!($meaning), &[$(stringify!($operand)),*]),)*
                    $(Self::$error(..) => (stringify!($value), &[$(stringify!($of)),*]),)*
                    $(Self::$comparison(..) => (stringify!($outcome), &[$(stringify!($compared)),*]),)*
                    $(Self::$connective(..) => (stringify!($mask), &[$(stringify!($connected)),*]),)*
                    _ => return None,
                };
                Some(Spelling { meaning, operands })
            }

            /// Returns what the table says of the operation, without remarks.
            pub(crate) fn description(self) -> &'static str {
                let description = match self {
                    $(Self::$number(..) => concat!($($docs),*),)*
                    $(Self::$error(..) => concat!($($error_docs),*),)*
                    $(Self::$comparison(..) => concat!($($less),*),)*
                    $(Self::$connective(..) => concat!($($and),*),)*
                    Self::Constant(_) | Self::Pi => "a constant",
                    Self::Input(_) => "an input",
                    Self::Select(..) => "a selection",
                    _ => "another",
                };
                description.split([',', '.']).next().unwrap_or(description).trim()
            }

            /// Evaluates an operation of the table; `number` and `mask` return its operands.
            ///
            /// # Panics
            /// When the table does not have the operation.
            pub fn evaluate<T: Number>(
                self,
                number: impl Fn(NodeId) -> T,
                mask: impl Fn(NodeId) -> T::Mask,
            ) -> Computed<T> {
                // The level that has no fused operations.
                type L = Baseline;
                match self {
                    $(Self::$number($($operand),*) => {
                        $(let $operand = number($operand);)*
                        Computed::Number($meaning)
                    })*
                    $(Self::$error($($of),*) => {
                        $(let $of = number($of);)*
                        Computed::Number($value)
                    })*
                    $(Self::$comparison($($compared),*) => {
                        $(let $compared = number($compared);)*
                        Computed::Mask($outcome)
                    })*
                    $(Self::$connective($($connected),*) => {
                        $(let $connected = mask($connected);)*
                        Computed::Mask($mask)
                    })*
                    Self::Select(chosen, a, b) => Computed::Number(T::select(mask(chosen), number(a), number(b))),
                    Self::IsModerate(a, degree) => Computed::Mask(number(a).is_moderate(degree)),
                    _ => unreachable!("compiler bug: constants and inputs are read, rules are resolved"),
                }
            }
        }
    };
}

with_operations!(define);

/// Returns how many operands there are, and the operands in a list that has room for all.
fn listed<const N: usize>(operands: [NodeId; N]) -> (usize, [NodeId; 3]) {
    let mut list = [NodeId(0); 3];
    list[..N].copy_from_slice(&operands);
    (N, list)
}
