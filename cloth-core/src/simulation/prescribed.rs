//! The vertices of obstacles in the body of an island.

use energy_dsl::Vector3;

use crate::barrier::ObstacleFriction;
use crate::collision::Core;
use crate::contact::{AnySolid, Deformation, HalfSpace, Obstacle};
use crate::geometry::{Pose, add_scaled, dot, subtract};
use crate::motion::Motion;

/// A plane is placed about the cloth in steps of this size, in m, so that the cloth never leaves its triangle.
const GRID: f64 = 1e3;

/// Vertices that move as prescribed, after those of cloth and hair: the cores of all obstacles, then the frames of
/// those that move.
#[derive(Clone, Debug, Default)]
pub(super) struct Prescribed {
    obstacles: Vec<Part>,
}

/// The vertices of one obstacle, before its motion.
#[derive(Clone, Debug)]
struct Part {
    motion: Option<Motion>,
    deformation: Option<Deformation>,
    core: Core,
    /// The plane, if the obstacle is one.
    plane: Option<HalfSpace>,
}

/// An origin, and the ends of three unit vectors.
const FRAME: [Vector3<f64>; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Prescribed {
    /// Takes the cores of obstacles.
    pub fn new(obstacles: &[Obstacle]) -> Self {
        let part = |obstacle: &Obstacle| {
            let plane = if let AnySolid::HalfSpace(plane) = obstacle.solid { Some(plane) } else { None };
            let (motion, deformation) = (obstacle.motion.clone(), obstacle.deformation.clone());
            Part { motion, deformation, core: obstacle.solid.core(), plane }
        };
        Self { obstacles: obstacles.iter().map(part).collect() }
    }

    /// The cores of all obstacles.
    pub fn cores(&self) -> Vec<Core> {
        self.obstacles.iter().map(|part| part.core.clone()).collect()
    }

    /// Returns the friction of each obstacle, given the number of vertices before those of the obstacles.
    pub fn friction(&self, obstacles: &[Obstacle], first: usize) -> Vec<ObstacleFriction> {
        let mut next = first + self.obstacles.iter().map(|part| part.core.vertices.len()).sum::<usize>();
        let mut friction = |(part, obstacle): (&Part, &Obstacle)| {
            let frame = (!part.frame().is_empty()).then(|| energy_solve::index(next));
            next += part.frame().len();
            ObstacleFriction { coefficients: obstacle.friction, frame, deforms: part.deformation.is_some() }
        };
        self.obstacles.iter().zip(obstacles).map(&mut friction).collect()
    }

    /// Returns the positions at each of some times, in s, for cloth about a point at the first of them.
    pub fn positions<const N: usize>(&self, times: [f64; N], about: Vector3<f64>) -> [Vec<Vector3<f64>>; N] {
        let poses: Vec<[Pose; N]> = self.obstacles.iter().map(|part| times.map(|time| part.pose(time))).collect();
        let offsets: Vec<_> =
            self.obstacles.iter().zip(&poses).map(|(part, poses)| part.offset(poses, about)).collect();
        std::array::from_fn(|at| {
            let all = || self.obstacles.iter().zip(&poses).zip(&offsets);
            let cores = all().flat_map(|((part, poses), offset)| {
                let vertices = part.vertices(times[at]).into_iter();
                vertices.map(move |x| poses[at].transform(add_scaled(x, 1.0, *offset)))
            });
            let frames = all().flat_map(|((part, poses), _)| part.frame().iter().map(move |x| poses[at].transform(*x)));
            cores.chain(frames).collect()
        })
    }
}

impl Part {
    fn pose(&self, time: f64) -> Pose {
        self.motion.as_ref().map_or(Pose::IDENTITY, |motion| motion.pose(time))
    }

    /// The vertices of the core at a time, before the motion.
    fn vertices(&self, time: f64) -> Vec<Vector3<f64>> {
        self.deformation.as_ref().map_or_else(|| self.core.vertices.clone(), |deformation| deformation.vertices(time))
    }

    fn frame(&self) -> &'static [Vector3<f64>] {
        if self.motion.is_some() { &FRAME } else { &[] }
    }

    /// Returns the vector by which a plane is shifted in itself to lie about a point at the first pose.
    fn offset(&self, poses: &[Pose], about: Vector3<f64>) -> Vector3<f64> {
        let (Some(plane), Some(pose)) = (&self.plane, poses.first()) else { return [0.0; 3] };
        let away = subtract(pose.inverse_transform(about), plane.point);
        let along = |sum: Vector3<f64>, axis: Vector3<f64>| {
            let steps = (dot(away, axis) / GRID).round();
            if steps.is_finite() { add_scaled(sum, GRID * steps, axis) } else { sum }
        };
        plane.tangents().into_iter().fold([0.0; 3], along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Coulomb;
    use crate::contact::Ball;
    use crate::motion::Key;

    fn obstacle(solid: AnySolid, motion: Option<Motion>) -> Obstacle {
        let name = "it".to_owned();
        let deformation = None;
        Obstacle {
            name,
            solid,
            motion,
            deformation,
            thickness: 5e-3,
            stiffness: 1.0,
            friction: Coulomb::uniform(0.3),
            sticking: 1e-3,
        }
    }

    #[test]
    fn a_plane_follows_the_cloth_in_itself() {
        let plane = HalfSpace { point: [0.0, 0.0, 2.0], normal: [0.0, 0.0, 1.0] };
        let prescribed = Prescribed::new(&[obstacle(AnySolid::HalfSpace(plane), None)]);
        let middle = |about: Vector3<f64>| {
            let [x] = prescribed.positions([0.0], about);
            assert!(x.iter().all(|x| x[2] == 2.0));
            [0, 1].map(|axis| x.iter().map(|x| x[axis]).sum::<f64>() / 3.0)
        };
        for (about, expected) in [([3.0, -4.0, 9.0], [0.0, 0.0]), ([70_400.0, -600.0, 0.0], [70_000.0, -1000.0])] {
            let found = middle(about);
            assert!((0..2).all(|axis| (found[axis] - expected[axis]).abs() < 1e-6), "{found:?}");
        }
        assert_eq!(middle([f64::NAN; 3]), middle([0.0; 3]));
    }

    #[test]
    fn moving_obstacles_have_a_frame_after_all_cores() {
        let keys = vec![Key::default(), Key { time: 1.0, angle: 90.0, translate: [0.0, 0.0, 3.0] }];
        let motion = Motion { keys, ..Motion::default() };
        let ball = |motion| obstacle(AnySolid::Ball(Ball { centre: [1.0, 0.0, 0.0], radius: 0.1 }), motion);
        let obstacles = [ball(Some(motion)), ball(None)];
        let prescribed = Prescribed::new(&obstacles);
        let frames = prescribed.friction(&obstacles, 10).iter().map(|friction| friction.frame).collect::<Vec<_>>();
        assert_eq!(frames, [Some(12), None]);
        let [start, end] = prescribed.positions([0.0, 1.0], [0.0; 3]);
        assert_eq!(start.len(), 6);
        assert_eq!(start[..3], [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]]);
        let near = |x: Vector3<f64>, y: Vector3<f64>| (0..3).all(|axis| (x[axis] - y[axis]).abs() < 1e-14);
        assert!(near(end[0], [0.0, 1.0, 3.0]) && near(end[1], [1.0, 0.0, 0.0]) && near(end[2], [0.0, 0.0, 3.0]));
    }
}
