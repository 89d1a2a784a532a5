use energy_dsl::energy;

energy! {
    /// A point of one body that stays at a point of another: C = (x_a + R_a p) − (x_b + R_b q), in m.
    #[audit]
    pub constraint BallJoint(a, b: Motion; p, q: Vec3[m]) { transform(a, p) - transform(b, q) }

    /// A point of a body that stays at a point, such as a vertex of a cloth: C = x_a + R_a p − y, in m.
    #[audit]
    pub constraint BodyAnchor(a: Motion, y: Point; p: Vec3[m]) { transform(a, p) - y }

    /// Two bodies that turn about a common axis: C = (R_a u·R_b n, R_a v·R_b n), where u and v are perpendicular to the
    /// axis in the first body, and n is the axis in the second one, all of unit length.
    #[audit]
    pub constraint HingeAxis(p, q: Rotation; u, v, n: Vec3[1]) {
        [dot(rotate(p, u), rotate(q, n)), dot(rotate(p, v), rotate(q, n))]
    }
}
