use schemars::JsonSchema;
use serde::Deserialize;

use super::garment::Turn;
use super::numbers::{all_positive, finite_triple, non_negative, nonzero_triple, positive};
use crate::contact::{AnySolid, Ball, Capsule, HalfSpace, Obstacle, RoundedBox};
use crate::mesh::norm;
use crate::motion::{Motion, Pose};

/// A solid that keeps cloth out: exactly one of `plane`, `sphere`, `capsule` and `box`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "Keys")]
#[schemars(with = "Keys")]
pub struct ObstacleDescription {
    shape: ShapeKeys,
    rest: Common,
}

/// What a scene file says.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// Everything below a plane.
    plane: Option<PlaneKeys>,
    /// A ball.
    sphere: Option<SphereKeys>,
    /// All points within a radius of a segment.
    capsule: Option<CapsuleKeys>,
    /// A box.
    #[serde(rename = "box")]
    block: Option<BoxKeys>,
    /// What the ledger calls it. Default the shape's name and its number from 0.
    name: Option<String>,
    /// The coefficient of friction. Default 0.
    #[serde(default, deserialize_with = "non_negative")]
    friction: f64,
    /// The sliding velocity at which friction is 1/√2 of its full size, in m/s: below it cloth sticks, though it creeps. Default 0.001.
    #[serde(default = "sticking", deserialize_with = "positive")]
    sticking: f64,
    /// Cloth is pushed away within this distance, in m. Default 0.005.
    #[serde(default = "thickness", deserialize_with = "positive")]
    thickness: f64,
    /// How hard: at the surface with this times the thickness as acceleration; in 1/s². Default 5e6.
    #[serde(default = "stiffness", deserialize_with = "positive")]
    stiffness: f64,
    /// How it moves. Default not at all.
    motion: Option<Motion>,
}

#[derive(Clone, Debug, PartialEq)]
struct Common {
    name: Option<String>,
    friction: f64,
    sticking: f64,
    thickness: f64,
    stiffness: f64,
    motion: Option<Motion>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum ShapeKeys {
    Plane(PlaneKeys),
    Sphere(SphereKeys),
    Capsule(CapsuleKeys),
    Block(BoxKeys),
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PlaneKeys {
    /// A point of it, in m. Default the origin.
    #[serde(default, deserialize_with = "finite_triple")]
    point: [f64; 3],
    /// Where cloth may be. Default [0, 0, 1].
    #[serde(default = "up", deserialize_with = "nonzero_triple")]
    normal: [f64; 3],
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SphereKeys {
    /// The centre, in m. Default the origin.
    #[serde(default, deserialize_with = "finite_triple")]
    centre: [f64; 3],
    /// The radius, in m.
    #[serde(deserialize_with = "positive")]
    radius: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CapsuleKeys {
    /// One end of the segment, in m.
    #[serde(deserialize_with = "finite_triple")]
    from: [f64; 3],
    /// Its other end, in m.
    #[serde(deserialize_with = "finite_triple")]
    to: [f64; 3],
    /// The radius, in m.
    #[serde(deserialize_with = "positive")]
    radius: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BoxKeys {
    /// The centre, in m. Default the origin.
    #[serde(default, deserialize_with = "finite_triple")]
    centre: [f64; 3],
    /// Its edges, in m.
    #[serde(deserialize_with = "all_positive")]
    size: [f64; 3],
    /// A turn about its centre. Default none.
    #[serde(default)]
    rotate: Option<Turn>,
    /// The radius of its rounded edges, within its size, in m. Default 0.
    #[serde(default, deserialize_with = "non_negative")]
    rounding: f64,
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn sticking() -> f64 {
    1e-3
}

fn thickness() -> f64 {
    5e-3
}

fn stiffness() -> f64 {
    5e6
}

impl TryFrom<Keys> for ObstacleDescription {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let Keys { plane, sphere, capsule, block, name, friction, sticking, thickness, stiffness, motion } = keys;
        let shapes = [
            plane.map(ShapeKeys::Plane),
            sphere.map(ShapeKeys::Sphere),
            capsule.map(ShapeKeys::Capsule),
            block.map(ShapeKeys::Block),
        ];
        let given: Vec<ShapeKeys> = shapes.into_iter().flatten().collect();
        let [shape] = given[..] else {
            return Err("an obstacle is exactly one of `plane`, `sphere`, `capsule` and `box`".to_owned());
        };
        match shape {
            ShapeKeys::Capsule(CapsuleKeys { from, to, .. }) if from == to => {
                return Err("the ends of a capsule must differ; for a ball say `sphere`".to_owned());
            }
            ShapeKeys::Block(BoxKeys { size, rounding, .. }) if size.iter().any(|edge| 0.5 * edge <= rounding) => {
                return Err(format!("a box of {size:?} m cannot be rounded by {rounding} m: that is half an edge"));
            }
            _ => {}
        }
        Ok(Self { shape, rest: Common { name, friction, sticking, thickness, stiffness, motion } })
    }
}

impl ObstacleDescription {
    /// The obstacle, of this number among those of the scene.
    #[must_use]
    pub fn obstacle(&self, number: usize) -> Obstacle {
        let (shape, solid) = match self.shape {
            ShapeKeys::Plane(PlaneKeys { point, normal }) => {
                let normal = normal.map(|component| component / norm(normal));
                ("plane", AnySolid::HalfSpace(HalfSpace { point, normal }))
            }
            ShapeKeys::Sphere(SphereKeys { centre, radius }) => ("sphere", AnySolid::Ball(Ball { centre, radius })),
            ShapeKeys::Capsule(CapsuleKeys { from, to, radius }) => {
                ("capsule", AnySolid::Capsule(Capsule { ends: [from, to], radius }))
            }
            ShapeKeys::Block(BoxKeys { centre, size, rotate, rounding }) => {
                let turn = rotate.map_or(Pose::REST, |turn| Pose::turned(turn.axis, turn.angle, [0.0; 3]));
                let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| turn.applied(axis));
                let half = size.map(|edge| 0.5 * edge - rounding);
                ("box", AnySolid::Box(RoundedBox { centre, axes, half, radius: rounding }))
            }
        };
        let Common { name, friction, sticking, thickness, stiffness, motion } = self.rest.clone();
        let name = name.unwrap_or_else(|| format!("{shape} {number}"));
        Obstacle { name, solid, motion, thickness, stiffness, friction, sticking }
    }
}
