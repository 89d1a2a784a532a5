//! Notices vertices that pass through a solid. Contact pushes a vertex out along the gradient of the signed distance.
//! So a vertex that a step moves past the middle of a solid leaves it on the other side.

use energy_dsl::Vector3;
use serde::{Deserialize, Serialize};

use super::{AnySolid, Obstacle};
use crate::geometry::{add_scaled, dot, norm, subtract};

/// Vertices that passed through an obstacle, over all steps so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Passage {
    /// The obstacle's name.
    pub obstacle: String,
    /// The number of passages.
    pub vertices: u64,
    /// The time at the end of the first step with one, in s.
    pub time: f64,
    /// The largest move relative to the obstacle in one step with a passage, in m.
    pub farthest: f64,
    /// The speed of that move, in m/s.
    pub speed: f64,
    /// The thickness of the obstacle's contact, in m.
    pub thickness: f64,
}

impl Passage {
    /// Adds later passages through the same obstacle.
    pub fn add(&mut self, later: &Self) {
        self.vertices += later.vertices;
        if later.farthest > self.farthest {
            (self.farthest, self.speed) = (later.farthest, later.speed);
        }
    }
}

impl std::fmt::Display for Passage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { obstacle, vertices, time, farthest, speed, thickness } = self;
        let times = if *vertices == 1 { "once".to_owned() } else { format!("{vertices} times") };
        write!(
            f,
            "a vertex passed through {obstacle} {times}, first at t = {time:.4} s. It moved up to {:.3} mm in a step, \
             at {speed:.3} m/s relative to {obstacle}, where contact reaches {:.3} mm: use a smaller dt, a slower \
             motion or a larger thickness",
            1e3 * farthest,
            1e3 * thickness
        )
    }
}

impl Obstacle {
    /// Returns the passages of one step, given the times of its start and end and each vertex's positions then. Only
    /// vertices that move farther than the thickness can jump over the surface, so others cost nothing.
    pub fn passages(&self, [from, to]: [f64; 2], moves: impl Iterator<Item = [Vector3<f64>; 2]>) -> Option<Passage> {
        let poses = self.motion.as_ref().filter(|motion| motion.moves(from, to));
        let poses = poses.map(|motion| [motion.pose(from), motion.pose(to)]);
        // The obstacle at the start of the step is the frame in which it rests.
        let end_at_rest = |x: Vector3<f64>| match &poses {
            Some([before, after]) => before.transform(after.inverse_transform(x)),
            None => x,
        };
        let far = |[start, end]: &[Vector3<f64>; 2]| norm(subtract(*end, *start)) > self.thickness;
        let moves: Vec<[Vector3<f64>; 2]> = moves.map(|[start, end]| [start, end_at_rest(end)]).filter(far).collect();
        if moves.is_empty() {
            return None;
        }
        let solid = self.at(from);
        let (mut vertices, mut farthest) = (0, 0.0);
        for [start, end] in moves {
            if passes(&solid, start, end, self.thickness) {
                vertices += 1;
                farthest = f64::max(farthest, norm(subtract(end, start)));
            }
        }
        let speed = farthest / (to - from);
        let thickness = self.thickness;
        let passage = || Passage { obstacle: self.name.clone(), vertices, time: to, farthest, speed, thickness };
        (vertices > 0).then(passage)
    }
}

/// Returns whether a straight move enters the solid at one side and leaves it, or is pushed out, at another. Walks by
/// the signed distance, which changes by at most the length of a step.
fn passes(solid: &AnySolid, start: Vector3<f64>, end: Vector3<f64>, thickness: f64) -> bool {
    let way = subtract(end, start);
    let length = norm(way);
    let at = |part: f64| add_scaled(start, part / length, way);
    let least = 1e-2 * thickness.min(length);
    let mut distance = solid.signed_distance(start);
    let mut walked = 0.0;
    let mut entered = None;
    loop {
        if entered.is_none() && distance < 0.0 {
            entered = Some(solid.outwards(at(walked), least));
        }
        let has_left = entered.is_some() && distance >= 0.0;
        if has_left || walked >= length {
            let Some(normal) = entered else { return false };
            return dot(normal, solid.outwards(at(walked), least)) < 0.0;
        }
        // Far outside, the solid is out of reach.
        if entered.is_none() && distance > length - walked {
            return false;
        }
        walked = (walked + distance.abs().max(least)).min(length);
        distance = solid.signed_distance(at(walked));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Coulomb;
    use crate::contact::{Ball, HalfSpace};
    use crate::motion::{Key, Motion};

    fn obstacle(solid: AnySolid, motion: Option<Motion>) -> Obstacle {
        let name = "ball".to_owned();
        let deformation = None;
        Obstacle {
            name,
            solid,
            motion,
            deformation,
            thickness: 0.01,
            stiffness: 1.0,
            friction: Coulomb::default(),
            sticking: 1e-3,
        }
    }

    fn passed(obstacle: &Obstacle, from: Vector3<f64>, to: Vector3<f64>) -> Option<Passage> {
        obstacle.passages([1.0, 1.5], [[from, to]].into_iter())
    }

    #[test]
    fn a_move_through_the_middle_passes() {
        let ball = obstacle(AnySolid::Ball(Ball { centre: [0.0; 3], radius: 0.1 }), None);
        let passage = passed(&ball, [0.0, 0.5, 0.0], [0.0, -0.5, 0.0]).expect("it passes");
        assert_eq!((passage.vertices, passage.time, passage.farthest, passage.speed), (1, 1.5, 1.0, 2.0));
        assert!(passage.to_string().contains("passed through ball once, first at t = 1.5000 s"), "{passage}");
        // Past the centre, contact pushes it out on the other side.
        assert!(passed(&ball, [0.0, 0.5, 0.0], [0.0, -0.02, 0.0]).is_some());
        assert!(passed(&ball, [0.0, 0.05, 0.0], [0.0, -0.5, 0.0]).is_some(), "it starts inside");
        for end in [[0.0, 0.02, 0.0], [0.0, 0.2, 0.0], [0.0, 0.495, 0.0]] {
            assert!(passed(&ball, [0.0, 0.5, 0.0], end).is_none(), "{end:?}: it stays on its side");
        }
        // It grazes, misses, and leaves where it was.
        assert!(passed(&ball, [0.5, 0.095, 0.0], [-0.5, 0.095, 0.0]).is_none());
        assert!(passed(&ball, [0.5, 0.2, 0.0], [-0.5, 0.2, 0.0]).is_none());
        assert!(passed(&ball, [0.0, 0.05, 0.0], [0.0, 0.5, 0.0]).is_none());
    }

    #[test]
    fn nothing_passes_a_half_space() {
        let floor = obstacle(AnySolid::HalfSpace(HalfSpace { point: [0.0; 3], normal: [0.0, 0.0, 1.0] }), None);
        assert!(passed(&floor, [0.0, 0.0, 0.5], [0.0, 0.0, -3.0]).is_none());
    }

    #[test]
    fn a_fast_obstacle_passes_a_vertex_at_rest() {
        let keys = vec![Key::default(), Key { time: 2.0, angle: 0.0, translate: [0.0, 4.0, 0.0] }];
        let motion = Motion { keys, ..Motion::default() };
        let ball = obstacle(AnySolid::Ball(Ball { centre: [0.0, -2.0, 0.0], radius: 0.1 }), Some(motion));
        // Its centre moves from y = 0 to y = 1.
        let x = [0.0, 0.5, 0.0];
        let passage = passed(&ball, x, x).expect("it passes");
        assert!((passage.farthest - 1.0).abs() < 1e-12 && (passage.speed - 2.0).abs() < 1e-12);
        assert!(passed(&ball, [0.5, 0.5, 0.0], [0.5, 0.5, 0.0]).is_none());
        // Carried along, it does not move relative to the ball.
        assert!(passed(&ball, [0.0, 0.11, 0.0], [0.0, 1.11, 0.0]).is_none());
    }
}
