use energy_solve::{CholeskyError, EvaluationError, Pressed, SingularBlock, StopReason};

/// A step that failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum StepError {
    /// A force could not be evaluated.
    #[error("{0}. The motion has become unstable; try a smaller dt")]
    Evaluation(#[from] EvaluationError),
    /// A free vertex has neither mass nor stiffness, so its diagonal block is singular.
    #[error(transparent)]
    Singular(#[from] SingularBlock),
    /// The factorisation of a matrix failed.
    #[error(transparent)]
    Factor(#[from] CholeskyError),
    /// The linear solver did not converge.
    #[error(
        "the linear solver stopped after {iterations} iterations: {stopped}; \
         residual {residual:.3e} of {target:.3e}, the worst at vertex {vertex}. Try a smaller dt"
    )]
    NotSolved {
        /// Iterations of the linear solver.
        iterations: usize,
        /// Why it stopped.
        stopped: StopReason,
        /// The final residual.
        residual: f64,
        /// The largest residual that counts as converged.
        target: f64,
        /// The vertex with the largest residual.
        vertex: usize,
    },
    /// The line search of Newton's method failed: no step along the direction lowers the energy.
    #[error(
        "no step along the direction of Newton iteration {iterations} lowers the energy \
         (its linear system: {stopped}){}a smaller dt", remedy(.pressed)
    )]
    Stuck {
        /// Newton iterations.
        iterations: u64,
        /// Why the linear solver stopped.
        stopped: StopReason,
        /// The place where contact presses the most, if it shortened a move of this step.
        pressed: Option<Pressed>,
    },
    /// Contact does not let pins and obstacles reach their places at the end of the step.
    #[error(
        "contact stopped pins and obstacles after {:.1} % of their way, in {moves} moves{}slower motions, or a smaller \
         dt", 100.0 * .part, remedy(.pressed)
    )]
    PinsBlocked {
        /// Moves of the pins and obstacles.
        moves: usize,
        /// The part of their way that they went.
        part: f64,
        /// The place where contact presses the most.
        pressed: Option<Pressed>,
    },
    /// Newton's method did not converge.
    #[error(
        "Newton's method did not converge in {iterations} iterations: \
         the last changed a velocity by {change:.3e} m/s{}a smaller dt", remedy(.pressed)
    )]
    NotConverged {
        /// Newton iterations.
        iterations: u64,
        /// The largest change of a velocity component in the last iteration, in m/s.
        change: f64,
        /// The place where contact presses the most, if it shortened a move of this step.
        pressed: Option<Pressed>,
    },
    /// A force has neither an energy nor a dissipation function, so Newton's method cannot minimise anything.
    #[error(
        "{term}: its forces come from no energy that Newton's method could lower; \
         use the integrator implicit-euler"
    )]
    NotSymmetric {
        /// The term's name.
        term: String,
    },
    /// An adaptive step failed at every size.
    #[error("rejected down to a step of {dt:.3e} s: {reason}")]
    Hopeless {
        /// The smallest size tried, in s.
        dt: f64,
        /// Why it was rejected at that size.
        reason: Box<StepError>,
    },
    /// The new state is infinite or NaN.
    #[error("vertex {vertex} would move to {position:?}. The step is unstable; try a smaller dt")]
    NonFinite {
        vertex: usize,
        /// The computed position, in m.
        position: [f64; 3],
    },
    /// The new state is finite, but beyond physics.
    #[error("vertex {vertex} would move at {speed:.1e} m/s, faster than light. The step is unstable; try a smaller dt")]
    TooFast {
        vertex: usize,
        /// The computed speed, in m/s.
        speed: f64,
    },
}

impl StepError {
    /// Renumbers the vertices in the error, from the numbering of a body to `vertices[…]` of the scene.
    #[must_use]
    pub fn on_vertices(self, vertices: &[usize]) -> Self {
        let renumbered = |pressed: Option<Pressed>| pressed.map(|pressed| pressed.on_vertices(vertices));
        match self {
            Self::Evaluation(EvaluationError::NonFiniteState { what, vertex, value }) => {
                EvaluationError::NonFiniteState { what, vertex: vertices[vertex], value }.into()
            }
            Self::Evaluation(EvaluationError::NonFiniteElement { term, element, vertices: stencil, what }) => {
                let vertices = stencil.iter().map(|&vertex| vertices[vertex]).collect();
                EvaluationError::NonFiniteElement { term, element, vertices, what }.into()
            }
            Self::NotSolved { iterations, stopped, residual, target, vertex } => {
                Self::NotSolved { iterations, stopped, residual, target, vertex: vertices[vertex] }
            }
            Self::Stuck { iterations, stopped, pressed } => {
                Self::Stuck { iterations, stopped, pressed: renumbered(pressed) }
            }
            Self::PinsBlocked { moves, part, pressed } => {
                Self::PinsBlocked { moves, part, pressed: renumbered(pressed) }
            }
            Self::NotConverged { iterations, change, pressed } => {
                Self::NotConverged { iterations, change, pressed: renumbered(pressed) }
            }
            Self::NonFinite { vertex, position } => Self::NonFinite { vertex: vertices[vertex], position },
            Self::TooFast { vertex, speed } => Self::TooFast { vertex: vertices[vertex], speed },
            Self::Hopeless { dt, reason } => Self::Hopeless { dt, reason: Box::new(reason.on_vertices(vertices)) },
            other => other,
        }
    }

    /// The vertices that the error names; empty if it names none.
    #[must_use]
    pub fn vertices(&self) -> Vec<usize> {
        match self {
            Self::Evaluation(EvaluationError::NonFiniteElement { vertices, .. }) => vertices.clone(),
            Self::Evaluation(EvaluationError::NonFiniteState { vertex, .. })
            | Self::NotSolved { vertex, .. }
            | Self::NonFinite { vertex, .. }
            | Self::TooFast { vertex, .. } => vec![*vertex],
            Self::Stuck { pressed: Some(pressed), .. }
            | Self::PinsBlocked { pressed: Some(pressed), .. }
            | Self::NotConverged { pressed: Some(pressed), .. } => pressed.vertices.clone(),
            Self::Hopeless { reason, .. } => reason.vertices(),
            _ => Vec::new(),
        }
    }
}

/// Says where contact presses the most, and begins to say what may help.
fn remedy(pressed: &Option<Pressed>) -> String {
    match pressed {
        Some(pressed) => format!("; contact {pressed}. Leave more room there, or try "),
        None => ". Try ".into(),
    }
}
