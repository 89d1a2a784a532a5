//! The state in which contact begins.

use std::fmt;
use std::ops::Range;

use energy_dsl::Vector3;
use energy_solve::ContactCounts;

use super::feasible::FeasibleRegions;
use super::law::Law;
use super::spacing::{Skin, Spacings};
use super::{ActiveSet, BarrierContact, Friction};
use crate::collision::{
    Closest, CollisionMesh, Crossing, Exclusions, MovingBalls, Neighbourhood, Pair, Rules, Search, crossings,
};

/// The part of an obstacle's reach that is its thickness, which nothing enters.
pub(super) const SKIN: f64 = 1.0 / 3.0;
/// The least limit on a move that is certified as a whole, over the mean length of an edge.
const EDGES: f64 = 2.0;
/// The number of crossings that a message names.
const NAMED: usize = 3;
/// The part of an obstacle's reach within which cloth counts as touching at the start.
pub(super) const TOUCHING: f64 = 1e-6;

/// A start that contact cannot keep free of crossings, because it is not.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// Edges cross triangles.
    #[error(
        "the cloth crosses itself in {count} places at the start: {}. Move the parts apart,{} or set \
         `contact = \"obstacles\"`", described(.deepest),
        if *.is_repaired { "" } else { " repair shallow crossings with `--untangle` or `untangle = true`," }
    )]
    Crosses {
        /// Number of edges and triangles that cross.
        count: usize,
        /// The deepest of them: edge, triangle and depth, in m.
        deepest: Vec<(Feature, Feature, f64)>,
        /// Whether a repair was tried.
        is_repaired: bool,
    },
    /// Two features are closer than the thickness.
    #[error(
        "{count} pairs of features are closer than the thickness at the start: {} are {distance:.3e} m apart, \
         {thickness:.3e} m thick. Move them apart, or reduce the `thickness` of the fabric", named(.pair)
    )]
    TooClose {
        /// Number of such pairs.
        count: usize,
        /// The closest pair: a point and a triangle, or two edges.
        pair: Box<[Feature; 2]>,
        /// Its distance, in m.
        distance: f64,
        /// Its thickness, in m.
        thickness: f64,
    },
    /// Free vertices are inside an obstacle.
    #[error(
        "{count} vertices start inside {obstacle}, the deepest is vertex {vertex}, {:.3} mm below the surface. Move \
         the cloth out of {obstacle}, or pin what belongs inside", 1e3 * .depth
    )]
    Inside {
        /// The name of the obstacle.
        obstacle: String,
        /// Number of such vertices.
        count: usize,
        /// The deepest of them.
        vertex: Feature,
        /// Its depth, in m.
        depth: f64,
    },
    /// An edge or a triangle of the cloth crosses an obstacle.
    #[error(
        "the cloth crosses {obstacle} in {count} places at the start, the deepest between the vertices \
         {vertices:#}. Move the cloth out of {obstacle}, or refine its mesh there"
    )]
    CrossesObstacle {
        /// The name of the obstacle.
        obstacle: String,
        /// Number of crossings of all kinds.
        count: usize,
        /// The cloth's edge or triangle.
        vertices: Feature,
    },
    /// An edge or a triangle of the cloth touches an obstacle.
    #[error(
        "the cloth touches {obstacle} at the start: the vertices {vertices:#} span a part {:.3e} mm from its surface. \
         Leave a distance", 1e3 * .distance
    )]
    Touches {
        /// The name of the obstacle.
        obstacle: String,
        /// The vertices of the part.
        vertices: Feature,
        /// Its distance from the surface, in m; negative inside.
        distance: f64,
    },
    /// A repair was tried, and failed.
    #[error(
        "{error}. `untangle` could not repair this: it moves no pinned vertex, and others by at most three times the \
         thickness and gap of contact"
    )]
    Unrepaired {
        /// The fault that remains.
        error: Box<ContactError>,
    },
}

/// A point, an edge or a triangle, for messages. `{:#}` lists its vertices with commas.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Feature {
    /// Its vertices: those of the scene, or of its garment if it has a name.
    pub vertices: Vec<usize>,
    /// The name of its garment or hair.
    pub part: Option<String>,
}

impl From<&[usize]> for Feature {
    fn from(vertices: &[usize]) -> Self {
        Self { vertices: vertices.to_vec(), part: None }
    }
}

impl fmt::Display for Feature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let separator = if f.alternate() { ", " } else { "–" };
        let vertices: Vec<String> = self.vertices.iter().map(ToString::to_string).collect();
        f.write_str(&vertices.join(separator))?;
        self.part.as_ref().map_or(Ok(()), |part| write!(f, " of {part}"))
    }
}

/// The pairs that may collide from the start on, and their parameters.
#[derive(Debug)]
pub struct Participants {
    /// The features of cloth and hair, and the cores of obstacles.
    pub mesh: CollisionMesh,
    /// Whether each vertex may respond to a contact.
    pub is_free: Vec<bool>,
    /// Half of the thickness of cloth and hair at each vertex, in m.
    pub radii: Vec<f64>,
    /// The activation gap between parts of cloth and hair at each vertex, in m.
    pub gaps: Vec<f64>,
    /// The obstacles, in the order of their cores.
    pub obstacles: Vec<ObstacleStart>,
    /// Pairs that do not collide.
    pub exclusions: Exclusions,
    /// Whether cloth and hair collide with themselves and each other, not only with obstacles.
    pub with_itself: bool,
}

/// An obstacle at the start.
#[derive(Clone, Debug)]
pub struct ObstacleStart {
    /// The name in messages.
    pub name: String,
    /// The radius of the solid about its core, in m.
    pub radius: f64,
    /// The distance from the solid at which contact begins, in m.
    pub reach: f64,
}

/// How contact pushes what starts within its reach.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstPush {
    /// The name of the obstacle; `None` if cloth or hair pushes.
    pub by: Option<String>,
    /// The distance at the start, in m.
    pub distance: f64,
    /// The distance at which contact begins, in m.
    pub reach: f64,
    /// About the speed that the push leads to, in m/s.
    pub speed: f64,
}

impl BarrierContact {
    /// Creates the contact of a mesh that starts at x. `radii` holds half of the thickness at each vertex, in m; pairs
    /// act within the activation gap `gap` of their thickness, in m. Pairs without a free vertex are ignored.
    ///
    /// # Errors
    /// If the mesh crosses itself at x, or a pair that can respond is closer than its thickness.
    pub fn new(
        mesh: CollisionMesh,
        x: &[Vector3<f64>],
        is_free: Vec<bool>,
        radii: Vec<f64>,
        gap: f64,
    ) -> Result<Self, ContactError> {
        let (obstacles, exclusions) = Default::default();
        let gaps = vec![gap; radii.len()];
        Self::among(Participants { mesh, is_free, radii, gaps, obstacles, exclusions, with_itself: true }, x)
    }

    /// Creates the contact of cloth and hair with themselves and with obstacles, which start at x.
    ///
    /// # Errors
    /// If something crosses at x, or a pair that can respond is closer than its thickness.
    pub fn among(participants: Participants, x: &[Vector3<f64>]) -> Result<Self, ContactError> {
        let Participants { mesh, is_free, radii, gaps, obstacles, exclusions, with_itself } = participants;
        let gap = gaps.iter().copied().fold(0.0, f64::max);
        let skin = |start: &ObstacleStart| Skin { radius: start.radius, thickness: 0.0, gap: start.reach };
        let spacings = Spacings { radii, gaps, skins: obstacles.iter().map(skin).collect() };
        let rules = Rules { halves: spacings.halves(&mesh), is_free, exclusions, with_itself };
        let mut search = Search::new(&mesh, x, rules);
        if !search.is_clear(&mesh, &MovingBalls { ends: [x, x], radii: &vec![0.0; x.len()] }) {
            check_crossings(&mesh, search.rules(), &obstacles, x)?;
        }
        let mut contact = Self {
            spacings,
            names: obstacles.iter().map(|start| start.name.clone()).collect(),
            slack: [0.5 * gap, gap.max(0.15 * mesh.mean_edge(x))],
            limit: None,
            least_limit: EDGES * mesh.mean_edge(x),
            search,
            neighbourhood: Neighbourhood::default(),
            active: ActiveSet::default(),
            friction: Friction::frictionless(obstacles.len()),
            blocking: Vec::new(),
            counts: ContactCounts::default(),
            mesh,
        };
        contact.fit_skins(&obstacles, x)?;
        contact.check_distances(x)?;
        Ok(contact)
    }

    /// Gives obstacles their skins, so thin that nothing starts within them.
    fn fit_skins(&mut self, obstacles: &[ObstacleStart], x: &[Vector3<f64>]) -> Result<(), ContactError> {
        self.refit(x);
        let mut nearest: Vec<Option<(f64, Pair)>> = vec![None; obstacles.len()];
        for (pair, closest) in self.neighbourhood.candidates().within_reach() {
            let Some(obstacle) = self.mesh.obstacle_of(pair) else { continue };
            let distance = closest.distance - obstacles[obstacle].radius;
            if nearest[obstacle].is_none_or(|(known, _)| distance < known) {
                nearest[obstacle] = Some((distance, *pair));
            }
        }
        for ((start, nearest), skin) in obstacles.iter().zip(nearest).zip(&mut self.spacings.skins) {
            let mut thickness = SKIN * start.reach;
            if let Some((distance, pair)) = nearest {
                if distance <= TOUCHING * start.reach {
                    let vertices = own(&self.mesh, pair.vertices.map(|vertex| vertex as usize));
                    return Err(ContactError::Touches { obstacle: start.name.clone(), vertices, distance });
                }
                thickness = thickness.min(0.5 * distance);
            }
            *skin = Skin { thickness, gap: start.reach - thickness, ..*skin };
        }
        Ok(())
    }

    /// Returns the fastest push that contact gives to vertices right after the start at x, in steps of `dt`; `None` if
    /// nothing starts within reach.
    pub fn first_push(&mut self, x: &[Vector3<f64>], dt: f64) -> Option<FirstPush> {
        self.refit(x);
        let regions = FeasibleRegions { mesh: &self.mesh, x };
        let feasible =
            self.neighbourhood.candidates().within_reach().filter(|(pair, closest)| regions.contain(pair, closest));
        let push = |(pair, closest): (&Pair, &Closest)| {
            let obstacle = self.mesh.obstacle_of(pair);
            let radius = obstacle.map_or(0.0, |obstacle| self.spacings.skins[obstacle].radius);
            let spacing = self.spacing(pair);
            // The resistance of a vertex is about m/h². All of the energy becomes motion.
            let law = Law::new(spacing, 1.0 / (dt * dt));
            let speed = (2.0 * law.energy(law.apart(closest))).sqrt();
            let by = obstacle.map(|obstacle| self.names[obstacle].clone());
            let reach = spacing.thickness + spacing.gap - radius;
            FirstPush { by, distance: closest.distance - radius, reach, speed }
        };
        feasible.map(push).filter(|push| push.speed > 0.0).max_by(|one, other| one.speed.total_cmp(&other.speed))
    }

    fn check_distances(&mut self, x: &[Vector3<f64>]) -> Result<(), ContactError> {
        self.refit(x);
        let all = self.neighbourhood.candidates().within_reach();
        let all = all.map(|(pair, closest)| (closest.distance, self.spacing(pair).thickness, pair));
        let close: Vec<_> = all.filter(|(distance, thickness, _)| distance <= thickness).collect();
        let closest = close.iter().min_by(|a, b| a.0.total_cmp(&b.0));
        closest.map_or(Ok(()), |&(distance, thickness, pair)| {
            let vertices = pair.vertices.map(|vertex| vertex as usize);
            let (one, other) = vertices.split_at(pair.first());
            let pair = Box::new([Feature::from(one), Feature::from(other)]);
            Err(ContactError::TooClose { count: close.len(), pair, distance, thickness })
        })
    }
}

/// Returns the crossings at x of features that collide, and of which one could respond.
pub(super) fn crossings_that_count(mesh: &CollisionMesh, rules: &Rules, x: &[Vector3<f64>]) -> Vec<Crossing> {
    let counts = |Crossing { edge, triangle }: &Crossing| {
        let (edge, triangle) = (edge.map(energy_solve::index), triangle.map(energy_solve::index));
        let is_mixed = mesh.obstacle(edge[0]).is_some() || mesh.obstacle(triangle[0]).is_some();
        edge.iter().chain(&triangle).any(|&vertex| rules.is_free[vertex as usize])
            && (rules.with_itself || is_mixed)
            && !rules.exclusions.exclude(mesh, &edge, &triangle)
    };
    crossings(mesh, x).into_iter().filter(counts).collect()
}

/// Returns an error if something that could respond crosses at the start.
fn check_crossings(
    mesh: &CollisionMesh,
    rules: &Rules,
    obstacles: &[ObstacleStart],
    x: &[Vector3<f64>],
) -> Result<(), ContactError> {
    let obstacle = |crossing: &Crossing| {
        let [edge, triangle] = [crossing.edge[0], crossing.triangle[0]].map(energy_solve::index);
        mesh.obstacle(edge).or(mesh.obstacle(triangle))
    };
    let all = crossings_that_count(mesh, rules, x).into_iter();
    let mut all: Vec<_> = all.map(|crossing| (crossing.depth(x), crossing)).collect();
    all.sort_by(|(one, _), (other, _)| other.total_cmp(one));
    let Some((_, deepest)) = all.first() else { return Ok(()) };
    let count = all.len();
    if let Some(number) = obstacle(deepest) {
        let vertices = own(mesh, deepest.edge.into_iter().chain(deepest.triangle));
        return Err(ContactError::CrossesObstacle { obstacle: obstacles[number].name.clone(), count, vertices });
    }
    let among_cloth = all.iter().filter(|(_, crossing)| obstacle(crossing).is_none()).take(NAMED);
    let named = |(depth, crossing): &(f64, Crossing)| {
        (Feature::from(&crossing.edge[..]), Feature::from(&crossing.triangle[..]), *depth)
    };
    Err(ContactError::Crosses { count, deepest: among_cloth.map(named).collect(), is_repaired: false })
}

/// Returns those of some vertices that do not belong to obstacles.
fn own(mesh: &CollisionMesh, vertices: impl IntoIterator<Item = usize>) -> Feature {
    let own = vertices.into_iter().filter(|&vertex| vertex < mesh.own_vertices());
    Feature { vertices: own.collect(), part: None }
}

impl ContactError {
    /// Renumbers the vertices, from the numbering of a body to `vertices[…]` of the scene.
    #[must_use]
    pub fn on_vertices(mut self, vertices: &[usize]) -> Self {
        for feature in self.features() {
            feature.vertices.iter_mut().for_each(|vertex| *vertex = vertices[*vertex]);
        }
        self
    }

    /// Names the garment or hair of each feature, and numbers its vertices within it. Each part comes with its vertices
    /// in the scene.
    #[must_use]
    pub fn among_parts(mut self, parts: &[(&str, Range<usize>)]) -> Self {
        for feature in self.features() {
            let part = parts.iter().find(|(_, range)| feature.vertices.iter().all(|vertex| range.contains(vertex)));
            if let Some((name, range)) = part {
                feature.vertices.iter_mut().for_each(|vertex| *vertex -= range.start);
                feature.part = Some((*name).to_owned());
            }
        }
        self
    }

    /// The fault that remains after a repair was tried.
    #[must_use]
    pub fn after_repair(mut self) -> Self {
        if let Self::Crosses { is_repaired, .. } = &mut self {
            *is_repaired = true;
        }
        Self::Unrepaired { error: Box::new(self) }
    }

    fn features(&mut self) -> Vec<&mut Feature> {
        match self {
            Self::Crosses { deepest, .. } => {
                deepest.iter_mut().flat_map(|(edge, triangle, _)| [edge, triangle]).collect()
            }
            Self::TooClose { pair, .. } => pair.iter_mut().collect(),
            Self::Inside { vertex: feature, .. }
            | Self::CrossesObstacle { vertices: feature, .. }
            | Self::Touches { vertices: feature, .. } => vec![feature],
            Self::Unrepaired { error } => error.features(),
        }
    }
}

/// Describes crossings and their depth.
fn described(crossings: &[(Feature, Feature, f64)]) -> String {
    let one = |(edge, triangle, depth): &(Feature, Feature, f64)| {
        format!("the edge {edge} goes through the triangle {triangle}, {:.3} mm deep", 1e3 * depth)
    };
    crossings.iter().map(one).collect::<Vec<_>>().join("; ")
}

/// Names the features of a pair.
fn named([one, other]: &[Feature; 2]) -> String {
    if one.vertices.len() == 1 {
        format!("vertex {one} and the triangle {other}")
    } else {
        format!("the edges {one} and {other}")
    }
}
