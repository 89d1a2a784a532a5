use energy_dsl::energy;

energy! {
    /// Hooke's spring of the mass–spring cloth model: F_P = K (PQ − L P̂Q) with PQ = Q − P, the gradient of −K/2 (‖PQ‖
    /// − L)². The source prints the opposite sign.
    #[audit]
    #[invariant(translation, rotation)]
    #[even]
    pub energy HookeSpring(P, Q: Point; K: Scalar[N/m], L: Scalar[m]) {
        let PQ = Q - P;
        K / 2 * (norm(PQ) - L)^2
    }
}

/// A spring between neighbours along warp or weft; resists stretch.
pub type StructuralSpring<T = f64> = HookeSpring<T>;
/// A spring across a cell of the sheet; resists shear.
pub type ShearSpring<T = f64> = HookeSpring<T>;
/// A spring between second neighbours along warp or weft; resists bending.
pub type BendingSpring<T = f64> = HookeSpring<T>;
