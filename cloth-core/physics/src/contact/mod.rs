//! Contact with solids: a penalty potential of the signed distance, and friction.
//!
//! Each shape has its own declared element, a function of the exact signed distance, instead of one element for the
//! plane through the closest point. The energy of a contact is then a function of the position alone: line search,
//! energy balance and forces see the same function, and the Hessian includes the curvature of the surface.
//!
//! On a mesh, the nearest face, edge or corner acts as a plane, a capsule or a sphere of radius 0.
//!
//! Only vertices touch solids, not the triangles between them. The integrator `newton` does not use these terms:
//! [`crate::barrier`] acts on the cores of solids.

mod cores;
mod deformation;
mod friction;
mod mesh_solid;
mod passage;
mod solid;
mod surface;
mod term;

use energy_solve::{DissipationTerm, Term};

pub use deformation::Deformation;
pub use mesh_solid::MeshSolid;
pub use passage::Passage;
pub use solid::{Ball, Capsule, HalfSpace, RoundedBox};
pub use surface::{Feature, Nearest, Surface, SurfaceError};

use crate::body::Body;

use crate::Coulomb;
use crate::geometry::{Pose, dot};
use crate::motion::Motion;
use friction::FrictionLaw;
use mesh_solid::{CachedMesh, Corners, Edges, Faces};
use solid::{Shape, Solid};
use term::{ContactTerm, Touch, surface_velocity, touches};

/// A solid of any shape.
#[derive(Clone, Debug, PartialEq)]
pub enum AnySolid {
    /// Everything below a plane.
    HalfSpace(HalfSpace),
    /// All points within a radius of a centre.
    Ball(Ball),
    /// All points within a radius of a segment.
    Capsule(Capsule),
    /// A box with rounded edges.
    Box(RoundedBox),
    /// A solid bounded by a triangle mesh.
    Mesh(MeshSolid),
}

impl AnySolid {
    /// Returns the solid after a rigid motion.
    #[must_use]
    pub fn moved(&self, pose: &Pose) -> Self {
        match self {
            Self::HalfSpace(solid) => Self::HalfSpace(Shape::moved(solid, pose)),
            Self::Ball(solid) => Self::Ball(Shape::moved(solid, pose)),
            Self::Capsule(solid) => Self::Capsule(Shape::moved(solid, pose)),
            Self::Box(solid) => Self::Box(Shape::moved(solid, pose)),
            Self::Mesh(solid) => Self::Mesh(solid.moved(pose)),
        }
    }

    /// Returns the distance of a point from the surface, in m; negative inside.
    ///
    /// ```
    /// use cloth_physics::contact::{AnySolid, Ball};
    /// let ball = AnySolid::Ball(Ball { centre: [0.0; 3], radius: 2.0 });
    /// assert_eq!(ball.signed_distance([0.0, 5.0, 0.0]), 3.0);
    /// ```
    #[must_use]
    pub fn signed_distance(&self, x: [f64; 3]) -> f64 {
        match self {
            Self::HalfSpace(solid) => solid.signed_distance(x),
            Self::Ball(solid) => solid.signed_distance(x),
            Self::Capsule(solid) => solid.signed_distance(x),
            Self::Box(solid) => solid.signed_distance(x),
            Self::Mesh(solid) => solid.nearest(x).distance,
        }
    }

    /// Returns a vector along which the signed distance grows fastest, by its differences over a step, in m; zero at
    /// the centre.
    pub(crate) fn outwards(&self, x: [f64; 3], step: f64) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let moved = |by: f64| {
                let mut x = x;
                x[axis] += by;
                self.signed_distance(x)
            };
            moved(step) - moved(-step)
        })
    }
}

/// A solid in a scene, with its motion and contact parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// The name in the ledger and in messages.
    pub name: String,
    /// The solid before its motion.
    pub solid: AnySolid,
    /// The motion; `None` if the obstacle is fixed.
    pub motion: Option<Motion>,
    /// How the vertices of a mesh move; `None` for a rigid solid. Needs certified contact.
    pub deformation: Option<Deformation>,
    /// Contact acts within this distance of the surface, in m. With certified contact, nothing comes nearer than a
    /// third of it.
    pub thickness: f64,
    /// Contact stiffness k over the mass of the vertex, in 1/s². Unused in certified contact.
    pub stiffness: f64,
    /// Coefficients of friction. Only certified contact knows pairs at rest; other integrators use the kinetic one.
    pub friction: Coulomb,
    /// The sliding velocity at which friction reaches 1/√2 of its full size, in m/s. Unused in certified contact.
    pub sticking: f64,
}

impl Obstacle {
    /// Returns the solid at a time, in s.
    #[must_use]
    pub fn at(&self, time: f64) -> AnySolid {
        let solid = match (&self.solid, &self.deformation) {
            (AnySolid::Mesh(solid), Some(deformation)) => {
                AnySolid::Mesh(solid.with_vertices(deformation.vertices(time)))
            }
            (solid, _) => solid.clone(),
        };
        self.motion.as_ref().map_or_else(|| solid.clone(), |motion| solid.moved(&motion.pose(time)))
    }

    /// Whether the obstacle may move or deform between two times, in s.
    #[must_use]
    pub fn moves(&self, from: f64, to: f64) -> bool {
        self.motion.as_ref().is_some_and(|motion| motion.moves(from, to))
            || self.deformation.as_ref().is_some_and(|deformation| deformation.moves(from, to))
    }

    /// Returns the terms of contact and friction with vertices of these masses, in kg.
    #[must_use]
    pub fn terms(&self, masses: &[f64]) -> Vec<Box<dyn Term>> {
        match &self.solid {
            AnySolid::HalfSpace(solid) => self.terms_with("", *solid, masses),
            AnySolid::Ball(solid) => self.terms_with("", *solid, masses),
            AnySolid::Capsule(solid) => self.terms_with("", *solid, masses),
            AnySolid::Box(solid) => self.terms_with("", *solid, masses),
            AnySolid::Mesh(solid) => {
                let cached = CachedMesh::new(solid.clone(), masses.len());
                let mut terms = self.terms_with(": faces", Faces(cached.clone()), masses);
                terms.extend(self.terms_with(": edges", Edges(cached.clone()), masses));
                terms.extend(self.terms_with(": corners", Corners(cached), masses));
                terms
            }
        }
    }

    /// Returns the power of the contact on the free vertices of a body, in W, at the start or the end of a step. `step`
    /// holds the times of both, in s.
    pub fn power(&self, step: [f64; 2], at_end: bool, body: &Body) -> f64 {
        if !self.motion.as_ref().is_some_and(|motion| motion.moves(step[0], step[1])) {
            return 0.0;
        }
        match self.at(step[usize::from(at_end)]) {
            AnySolid::HalfSpace(solid) => self.power_of(solid, step, at_end, body),
            AnySolid::Ball(solid) => self.power_of(solid, step, at_end, body),
            AnySolid::Capsule(solid) => self.power_of(solid, step, at_end, body),
            AnySolid::Box(solid) => self.power_of(solid, step, at_end, body),
            AnySolid::Mesh(solid) => {
                let cached = CachedMesh::new(solid, body.x.len());
                self.power_of(Faces(cached.clone()), step, at_end, body)
                    + self.power_of(Edges(cached.clone()), step, at_end, body)
                    + self.power_of(Corners(cached), step, at_end, body)
            }
        }
    }

    fn power_of(&self, solid: impl Solid, step: [f64; 2], at_end: bool, body: &Body) -> f64 {
        let stiffness = |vertex: usize| self.stiffness * body.masses[vertex];
        let power = |touch: &Touch| {
            let velocity = surface_velocity(self.motion.as_ref(), step, body.x[touch.vertex], at_end);
            touch.force * dot(touch.normal, velocity)
        };
        let free = body.system.dofs().free().iter().copied();
        touches(&solid, self.thickness, stiffness, &body.x, free).iter().map(power).sum()
    }

    fn terms_with(&self, part: &str, solid: impl Solid, masses: &[f64]) -> Vec<Box<dyn Term>> {
        let stiffness: Vec<f64> = masses.iter().map(|mass| self.stiffness * mass).collect();
        let (motion, thickness) = (self.motion.clone(), self.thickness);
        let name = format!("{}{part}", self.name);
        let contact = ContactTerm::new(name.clone(), solid.clone(), motion.clone(), thickness, stiffness.clone(), 0.0);
        let mut terms: Vec<Box<dyn Term>> = vec![Box::new(contact)];
        if self.friction.sliding > 0.0 {
            let (coefficient, sticking) = (self.friction.sliding, self.sticking);
            let law = FrictionLaw { solid, motion, thickness, stiffness, coefficient, sticking };
            let each: Vec<[usize; 1]> = (0..masses.len()).map(|vertex| [vertex]).collect();
            terms.push(Box::new(DissipationTerm::new(format!("{name}: friction"), law, &each)));
        }
        terms
    }
}
