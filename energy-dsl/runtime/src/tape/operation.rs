//! The operations of a tape.

use crate::with_operations;

macro_rules! define {
    (
        numbers { $($_section:ident { $($(#[$docs:meta])* $name:ident $_of:tt = $_meaning:expr $(, $_cost:tt)?;)* })* }
        masks { $($_masks:ident { $($(#[$mask_docs:meta])* $mask:ident $_numbers:tt = $_outcome:expr;)* })* }
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
    };
}

with_operations!(define);
