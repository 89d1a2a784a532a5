use energy_dsl::energy;

energy! {
    /// Logarithmic barrier of incremental potential contact on a distance r = ‖p_k − p_l‖: −κ (r − d̂)² ln(r/d̂) if r <
    /// d̂, else 0 (Li et al. 2020). Twice differentiable at d̂; infinite where the points meet.
    #[audit]
    #[invariant(translation, rotation)]
    pub energy DistanceBarrier(p_k, p_l: Point; κ: Scalar, dhat: Scalar[m]) {
        let d = p_k - p_l;
        let r = norm(d);
        let e = r - dhat;
        // Infinite where the points meet; the derivatives there are taken as 0 and flagged.
        let b = if r > 0 { κ * e^2 * log1p(-e / r) } else { κ * dhat^2 / sign(r) };
        if r < dhat { b } else { 0 }
    }
}
