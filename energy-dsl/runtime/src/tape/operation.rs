//! The operations of a tape, one row each. The rows with a meaning take numbers and return a number.

/// Calls a macro with the rows: name, operands and meaning over a number type at a SIMD level `L`.
macro_rules! with_operations {
    ($consumer:ident) => {
        $consumer! {
            /// −a.
            Neg(a) = -a;
            /// a + b.
            Add(a, b) = a + b;
            /// a − b.
            Sub(a, b) = a - b;
            /// a · b.
            Mul(a, b) = a * b;
            /// a / b.
            Div(a, b) = a / b;
            /// √a.
            Sqrt(a) = a.sqrt();
            /// |a|.
            Abs(a) = a.abs();
            /// min(a, b).
            Min(a, b) = a.min(b);
            /// max(a, b).
            Max(a, b) = a.max(b);
            /// sin a.
            Sin(a) = a.sin::<L>();
            /// cos a.
            Cos(a) = a.cos::<L>();
            /// eᵃ.
            Exp(a) = a.exp::<L>();
            /// ln a.
            Ln(a) = a.ln::<L>();
            /// The angle of the point (x = b, y = a).
            Atan2(a, b) = a.atan2::<L>(b);
            /// The angle of a point with moderate x² + y².
            ModerateAtan2(a, b) = a.moderate_atan2::<L>(b);
            /// a to the power b.
            Pow(a, b) = a.powf::<L>(b);
            /// Rounding error of a + b.
            SumError(a, b) = a.sum_error(b);
            /// Rounding error of a − b.
            DifferenceError(a, b) = a.difference_error(b);
            /// Rounding error of a · b.
            ProductError(a, b) = a.product_error::<L>(b);
            /// Rounding error a − b² of b = fl(√a).
            RootError(a, b) = a.root_error::<L>(b);
            /// a · b − c, as if rounded once.
            FusedMulSub(a, b, c) = a.fused_mul_sub::<L>(b, c);
            /// a · b + c, rounded once if the level can.
            MulAdd(a, b, c) = a.mul_add::<L>(b, c);
            /// a · b − c.
            MulSub(a, b, c) = a.mul_add::<L>(b, -c);
            /// c − a · b.
            NegMulAdd(a, b, c) = (-a).mul_add::<L>(b, c);
            /// −a · b − c.
            NegMulSub(a, b, c) = (-a).mul_add::<L>(b, -c);
            /// The power of two that scales |a| into [1, 2).
            PowerOfTwoScale(a) = a.power_of_two_scale();
            // Pairs and triples of statements, of which only the last result is read. They save loads and stores.
            /// a · b + c · d, the second product fused.
            MulThenMulAdd(a, b, c, d) = c.mul_add::<L>(d, a * b);
            /// a · b − c · d, the second product fused.
            MulThenNegMulAdd(a, b, c, d) = (-c).mul_add::<L>(d, a * b);
            /// a · b + c · d + e · f, the last two products fused.
            MulThenTwoMulAdds(a, b, c, d, e, f) = e.mul_add::<L>(f, c.mul_add::<L>(d, a * b));
            /// c + a · b + d · e.
            TwoMulAdds(a, b, c, d, e) = d.mul_add::<L>(e, a.mul_add::<L>(b, c));
            /// c + a · b − d · e.
            MulAddThenNegMulAdd(a, b, c, d, e) = (-d).mul_add::<L>(e, a.mul_add::<L>(b, c));
            /// c − a · b + d · e.
            NegMulAddThenMulAdd(a, b, c, d, e) = d.mul_add::<L>(e, (-a).mul_add::<L>(b, c));
            /// c − a · b − d · e.
            TwoNegMulAdds(a, b, c, d, e) = (-d).mul_add::<L>(e, (-a).mul_add::<L>(b, c));
            /// a · b − c · d, each product rounded.
            TwoMulsThenSub(a, b, c, d) = a * b - c * d;
            /// c · (a · b).
            TwoMuls(a, b, c) = c * (a * b);
            /// d · (a · b + c).
            MulAddThenMul(a, b, c, d) = d * a.mul_add::<L>(b, c);
            /// d · (a · b + c) + e.
            MulAddThenMulAdd(a, b, c, d, e) = d.mul_add::<L>(a.mul_add::<L>(b, c), e);
            /// (a + b) + c.
            TwoAdds(a, b, c) = (a + b) + c;
        }
    };
}

macro_rules! define {
    ($($(#[$docs:meta])* $name:ident($($operand:ident),*) = $meaning:expr;)*) => {
        /// The function that an [`Instruction`](super::Instruction) computes from its operands a, b, ….
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum Operation {
            $($(#[$docs])* $name,)*
            /// The mask a < b.
            Less,
            /// The mask a < b, where results are the same for both outcomes.
            Precedes,
            /// The mask a ≤ b.
            LessOrEqual,
            /// The mask a = b.
            Equal,
            /// The mask of a number a that is a moderate power of a length; b is the degree, not a slot.
            IsModerate,
            /// The conjunction of the masks a and b.
            And,
            /// The disjunction of the masks a and b.
            Or,
            /// The negation of the mask a.
            Not,
            /// The number b where the mask a holds, c elsewhere.
            Select,
        }
    };
}

with_operations!(define);

pub(super) use with_operations;
