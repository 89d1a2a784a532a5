//! The operations of a tape.

use crate::with_operations;

macro_rules! define {
    (
        numbers { $($_section:ident { $($(#[$docs:meta])* $name:ident $of:tt = $meaning:expr $(, $_cost:tt)?;)* })* }
        masks { $($of_masks:ident { $($(#[$mask_docs:meta])* $mask:ident $masked:tt = $outcome:expr;)* })* }
    ) => {
        /// The function that an [`Instruction`](super::Instruction) computes from its operands a, b, ….
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum Operation {
            $($($(#[$docs])* $name,)*)*
            $($($(#[$mask_docs])* $mask,)*)*
            /// The mask of a number a that is a moderate power of a length; b is the degree, not a slot.
            IsModerate,
            /// The number b where the mask a holds, c elsewhere.
            Select,
        }

        /// The rows of the table, for those who write code: operation, operands, meaning, and section.
        pub const ROWS: &[(Operation, &str, &str, &str)] = &[
            $($((Operation::$name, stringify!($of), stringify!($meaning), stringify!($_section)),)*)*
            $($((Operation::$mask, stringify!($masked), stringify!($outcome), stringify!($of_masks)),)*)*
        ];
    };
}

with_operations!(define);

impl Operation {
    /// Returns all operations, each at the index that is its code.
    pub(super) fn by_code() -> Vec<Self> {
        ROWS.iter().map(|row| row.0).chain([Self::IsModerate, Self::Select]).collect()
    }
}
