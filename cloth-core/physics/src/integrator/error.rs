use energy_solve::{CholeskyError, EvaluationError, Pressed, SingularBlock, StopReason};

/// A step that failed. The message says what failed, and [`StepError::advice`] what may help.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum StepError {
    /// A force could not be evaluated.
    #[error(transparent)]
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
         residual {residual:.3e} of {target:.3e}, the worst at vertex {vertex}"
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
         (its linear system: {stopped}){}", where_pressed(.pressed)
    )]
    Stuck {
        /// Newton iterations.
        iterations: u64,
        /// Why the linear solver stopped.
        stopped: StopReason,
        /// The feature that contact presses the most, if it shortened a move of this step.
        pressed: Option<Pressed>,
    },
    /// Contact does not let pins and obstacles reach their positions at the end of the step.
    #[error(
        "contact stopped pins and obstacles after {:.1} % of their way, in {moves} moves{}", 100.0 * .part,
        where_pressed(.pressed)
    )]
    PinsBlocked {
        /// Moves of the pins and obstacles.
        moves: usize,
        /// The part of their way that they went.
        part: f64,
        /// The feature that contact presses the most.
        pressed: Option<Pressed>,
    },
    /// Newton's method did not converge.
    #[error(
        "Newton's method did not converge in {iterations} iterations: \
         the last changed a velocity by {change:.3e} m/s{}", where_pressed(.pressed)
    )]
    NotConverged {
        /// Newton iterations.
        iterations: u64,
        /// The largest change of a velocity component in the last iteration, in m/s.
        change: f64,
        /// The feature that contact presses the most, if it shortened a move of this step.
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
    #[error("rejected down to a step of {dt:.3e} s: {}", reasons(.first, .reason))]
    Hopeless {
        /// The smallest size tried, in s.
        dt: f64,
        /// The first rejection, at the largest size. Smaller sizes may hide its cause.
        first: Box<Rejection>,
        /// Why the step was rejected at the smallest size.
        reason: Box<StepError>,
    },
    /// The new state is infinite or NaN.
    #[error("vertex {vertex} would move to {position:?}")]
    NonFinite {
        vertex: usize,
        /// The computed position, in m.
        position: [f64; 3],
    },
    /// The new state is finite, but beyond physics.
    #[error("vertex {vertex} would move at {speed:.1e} m/s, faster than light")]
    TooFast {
        vertex: usize,
        /// The computed speed, in m/s.
        speed: f64,
    },
}

/// A rejected step.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "the fields say it")]
pub struct Rejection {
    /// Step size, in s.
    pub dt: f64,
    pub reason: StepError,
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
            Self::Hopeless { dt, first, reason } => {
                let first = Rejection { dt: first.dt, reason: first.reason.on_vertices(vertices) };
                Self::Hopeless { dt, first: Box::new(first), reason: Box::new(reason.on_vertices(vertices)) }
            }
            other => other,
        }
    }

    /// Says what may help, in a sentence without its full stop; `None` if nothing is known to.
    #[must_use]
    pub fn advice(&self) -> Option<String> {
        let others = match self {
            Self::Hopeless { first, .. } => return joined(first.reason.remedies()),
            Self::Evaluation(_) => return Some("The motion has become unstable; try a smaller dt".to_owned()),
            Self::NonFinite { .. } | Self::TooFast { .. } => {
                return Some("The step is unstable; try a smaller dt".to_owned());
            }
            Self::Singular(_) | Self::Factor(_) | Self::NotSymmetric { .. } => return None,
            Self::NotSolved { .. } | Self::Stuck { .. } | Self::PinsBlocked { .. } | Self::NotConverged { .. } => {
                self.remedies()
            }
        };
        joined(others.into_iter().chain(["try a smaller dt"]))
    }

    /// Remedies other than a smaller step.
    fn remedies(&self) -> Vec<&'static str> {
        let pressed = match self {
            Self::Stuck { pressed, .. } | Self::PinsBlocked { pressed, .. } | Self::NotConverged { pressed, .. } => {
                pressed.as_ref()
            }
            _ => None,
        };
        let room = pressed.map(|_| "leave more room there");
        let motions = matches!(self, Self::PinsBlocked { .. }).then_some("try slower motions");
        room.into_iter().chain(motions).collect()
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

/// Joins alternatives to a sentence; `None` for an empty list.
fn joined<'a>(alternatives: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let all: Vec<&str> = alternatives.into_iter().collect();
    let (last, others) = all.split_last()?;
    let sentence = if others.is_empty() { (*last).to_owned() } else { format!("{}, or {last}", others.join(", ")) };
    let first = sentence.chars().next()?.to_ascii_uppercase();
    Some(format!("{first}{}", &sentence[1..]))
}

/// Says where contact presses the most.
fn where_pressed(pressed: &Option<Pressed>) -> String {
    pressed.as_ref().map(|pressed| format!("; contact {pressed}")).unwrap_or_default()
}

/// Gives the first and the last reason of rejections.
fn reasons(first: &Rejection, last: &StepError) -> String {
    if std::mem::discriminant(&first.reason) == std::mem::discriminant(last) {
        return first.reason.to_string();
    }
    format!("at {:.3e} s, {}; at the smallest, {last}", first.dt, first.reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn advice_is_not_what_was_tried() {
        let pressed = Some(Pressed { vertices: vec![3], by: Vec::new() });
        let blocked = StepError::PinsBlocked { moves: 64, part: 0.25, pressed: pressed.clone() };
        assert_eq!(blocked.advice().unwrap(), "Leave more room there, try slower motions, or try a smaller dt");
        let stuck = StepError::NotConverged { iterations: 100, change: 1.0, pressed: None };
        assert_eq!(stuck.advice().unwrap(), "Try a smaller dt");
        let hopeless = |first: &StepError| {
            let first = Box::new(Rejection { dt: 0.01, reason: first.clone() });
            StepError::Hopeless { dt: 1e-8, first, reason: Box::new(stuck.clone()) }
        };
        let error = hopeless(&blocked);
        assert_eq!(
            error.to_string(),
            "rejected down to a step of 1.000e-8 s: at 1.000e-2 s, contact stopped pins and obstacles after 25.0 % of \
             their way, in 64 moves; contact presses vertex 3; at the smallest, Newton's method did not converge in \
             100 iterations: the last changed a velocity by 1.000e0 m/s"
        );
        assert_eq!(error.advice().unwrap(), "Leave more room there, or try slower motions");
        let error = hopeless(&stuck);
        assert!(error.to_string().matches("did not converge").count() == 1 && error.advice().is_none(), "{error}");
    }
}
