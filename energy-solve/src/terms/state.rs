use energy_dsl::Vector3;

/// Positions and velocities of all vertices.
#[derive(Clone, Copy, Debug)]
pub struct State<'a> {
    /// Positions, in m.
    pub x: &'a [Vector3<f64>],
    /// Velocities, in m/s.
    pub v: &'a [Vector3<f64>],
}

/// The start of a time step.
#[derive(Clone, Copy, Debug)]
pub struct StepStart<'a> {
    /// Time at the start, in s.
    pub time: f64,
    /// Step size, in s.
    pub dt: f64,
    /// Positions and velocities at the start.
    pub state: State<'a>,
}
