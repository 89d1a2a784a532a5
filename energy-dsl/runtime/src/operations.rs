//! The table of operations: all that generated code, tapes and interpreters compute with.

/// Calls a macro with the rows of each section: description, name, operands, and meaning over a number type at a SIMD
/// level `L`. Rows that return numbers also name the fields of [`OperationCount`](crate::OperationCount) that they add
/// to. The compiler's operations, the code that it writes, and the instructions of tapes are made from these rows.
///
/// The table lacks constants, inputs, the test of a moderate size, and the selection by a mask: their operands are
/// of other kinds.
#[doc(hidden)]
#[macro_export]
macro_rules! with_operations {
    ($consumer:ident) => {
        $consumer! {
            numbers {
                // Functions of numbers.
                elementary {
                    /// −a.
                    Neg(a) = -a, [basic];
                    /// a + b.
                    Add(a, b) = a + b, [basic];
                    /// a − b.
                    Sub(a, b) = a - b, [basic];
                    /// a · b.
                    Mul(a, b) = a * b, [basic];
                    /// a / b.
                    Div(a, b) = a / b, [divisions_and_roots];
                    /// √a.
                    Sqrt(a) = a.sqrt(), [divisions_and_roots];
                    /// |a|.
                    Abs(a) = a.abs(), [basic];
                    /// min(a, b).
                    Min(a, b) = a.min(b), [basic];
                    /// max(a, b).
                    Max(a, b) = a.max(b), [basic];
                    /// sin a.
                    Sin(a) = a.sin::<L>(), [transcendental];
                    /// cos a.
                    Cos(a) = a.cos::<L>(), [transcendental];
                    /// eᵃ.
                    Exp(a) = a.exp::<L>(), [transcendental];
                    /// ln a.
                    Ln(a) = a.ln::<L>(), [transcendental];
                    /// The angle of the point (x = b, y = a).
                    Atan2(a, b) = a.atan2::<L>(b), [transcendental];
                    /// The angle of a point with moderate x² + y². It replaces `Atan2` where that is assumed.
                    ModerateAtan2(a, b) = a.moderate_atan2::<L>(b), [transcendental];
                    /// a to the power b.
                    Pow(a, b) = a.powf::<L>(b), [transcendental];
                    /// a · b − c, as if rounded once.
                    FusedMulSub(a, b, c) = a.fused_mul_sub::<L>(b, c), [basic, error_terms];
                    /// a · b + c, rounded once if the level can.
                    MulAdd(a, b, c) = a.mul_add::<L>(b, c), [fused];
                    /// a · b − c, rounded once if the level can.
                    MulSub(a, b, c) = a.mul_add::<L>(b, -c), [fused];
                    /// c − a · b, rounded once if the level can.
                    NegMulAdd(a, b, c) = (-a).mul_add::<L>(b, c), [fused];
                    /// −a · b − c, rounded once if the level can.
                    NegMulSub(a, b, c) = (-a).mul_add::<L>(b, -c), [fused];
                }
                // Rounding errors, which are 0 in exact arithmetic, and scales. Derivatives treat them as constants.
                rounding {
                    /// Rounding error of a + b.
                    SumError(a, b) = a.sum_error(b), [error_terms];
                    /// Rounding error of a − b.
                    DifferenceError(a, b) = a.difference_error(b), [error_terms];
                    /// Rounding error of a · b.
                    ProductError(a, b) = a.product_error::<L>(b), [error_terms];
                    /// Rounding error a − b² of b = fl(√a).
                    RootError(a, b) = a.root_error::<L>(b), [error_terms];
                    /// The power of two that scales |a| into [1, 2).
                    PowerOfTwoScale(a) = a.power_of_two_scale(), [basic];
                }
                // Pairs and triples of the above, of which only the last result is read. They save loads and stores of
                // tapes.
                joint {
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
            }
            masks {
                // Masks of numbers.
                comparisons {
                    /// a < b.
                    Less(a, b) = a.less(b);
                    /// a < b, where results are the same for both outcomes.
                    Precedes(a, b) = a.precedes(b);
                    /// a ≤ b.
                    LessOrEqual(a, b) = a.less_or_equal(b);
                    /// a = b.
                    Equal(a, b) = a.equal(b);
                }
                // Masks of masks.
                connectives {
                    /// The conjunction of two masks.
                    And(a, b) = a & b;
                    /// The disjunction of two masks.
                    Or(a, b) = a | b;
                    /// The negation of a mask.
                    Not(a) = !a;
                }
            }
        }
    };
}
