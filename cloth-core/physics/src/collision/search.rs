use energy_dsl::Vector3;
use energy_solve::index;
use energy_solve::threads::for_each;

use super::mesh::CollisionMesh;
use super::{Exclusions, Pair, PairKind};
use crate::geometry::{Bounds, Branches, Hierarchy, MovingBounds, Volume};

/// A mesh with fewer vertices is searched on one thread.
const FEW: usize = 1000;

/// Finds the pairs whose vertices may meet within given regions.
#[derive(Clone, Debug)]
pub struct Search {
    own: Trees,
    obstacles: Trees,
    /// Whether the hierarchies of cloth and hair fit the regions of the last search. Those for obstacles always do.
    is_own_fitted: bool,
    rules: Rules,
    /// The largest number of threads.
    pub threads: usize,
}

/// Selects the features that may collide, and their distance.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// Half the reach at each vertex, in m: pairs within the sum of the halves of their features are found.
    pub halves: Vec<f64>,
    /// Whether each vertex may respond to a contact. Pairs without such a vertex are never found.
    pub is_free: Vec<bool>,
    /// Pairs that do not collide.
    pub exclusions: Exclusions,
    /// Whether cloth and hair collide with themselves and each other, not only with obstacles.
    pub with_itself: bool,
}

/// Hierarchies of the points, triangles and edges from certain places in the mesh's lists on.
#[derive(Clone, Debug)]
struct Trees {
    points: Hierarchy<MovingBounds>,
    triangles: Hierarchy<MovingBounds>,
    edges: Hierarchy<MovingBounds>,
    first: [usize; 3],
}

/// The boxes around the regions of all features, extended by half the reach.
struct Boxes {
    points: Vec<MovingBounds>,
    triangles: Vec<MovingBounds>,
    edges: Vec<MovingBounds>,
}

impl Boxes {
    fn new(mesh: &CollisionMesh, mut regions: Vec<MovingBounds>, halves: &[f64]) -> Self {
        regions.iter_mut().zip(halves).for_each(|(region, half)| *region = region.extended(*half));
        let around = |vertices: &[u32]| {
            vertices.iter().fold(MovingBounds::empty(), |all, &vertex| all.joined(regions[vertex as usize]))
        };
        Self {
            points: mesh.points().iter().map(|&point| regions[point as usize]).collect(),
            triangles: mesh.triangles().iter().map(|corners| around(corners)).collect(),
            edges: mesh.edges().iter().map(|ends| around(ends)).collect(),
        }
    }

    /// Splits the boxes into those of cloth and hair, and those of obstacles.
    fn split(&self, [points, triangles, edges]: [usize; 3]) -> [[&[MovingBounds]; 3]; 2] {
        let (own_points, other_points) = self.points.split_at(points);
        let (own_triangles, other_triangles) = self.triangles.split_at(triangles);
        let (own_edges, other_edges) = self.edges.split_at(edges);
        [[own_points, own_triangles, own_edges], [other_points, other_triangles, other_edges]]
    }
}

impl Trees {
    fn new(boxes: [&[MovingBounds]; 3], first: [usize; 3]) -> Self {
        let [points, triangles, edges] = boxes.map(Hierarchy::new);
        Self { points, triangles, edges, first }
    }

    fn refit(&mut self, [points, triangles, edges]: [&[MovingBounds]; 3]) {
        self.points.refit(points);
        self.triangles.refit(triangles);
        self.edges.refit(edges);
    }

    fn refit_some(&mut self, [points, triangles, edges]: [Vec<(usize, MovingBounds)>; 3]) {
        self.points.refit_some(&points);
        self.triangles.refit_some(&triangles);
        self.edges.refit_some(&edges);
    }
}

/// Features by their places in the mesh's lists, as pairs are ordered.
type Features = [u32; 2];

/// The features that a search found.
#[derive(Default)]
struct Found {
    on_triangles: Vec<Features>,
    of_edges: Vec<Features>,
}

impl Found {
    fn add(&mut self, other: Self) {
        self.on_triangles.extend(other.on_triangles);
        self.of_edges.extend(other.of_edges);
    }
}

/// A part of a search. Together they find all pairs.
#[derive(Clone, Copy, Debug)]
enum Task {
    PointsOnTriangles,
    Edges(Branches),
    Obstacles,
}

/// All tasks, in an order that gives two threads about the same work.
const TASKS: [Task; 5] = [
    Task::Edges(Branches::First),
    Task::Edges(Branches::Second),
    Task::PointsOnTriangles,
    Task::Edges(Branches::Across),
    Task::Obstacles,
];

impl Search {
    /// Prepares searches in a mesh that starts at x.
    pub fn new(mesh: &CollisionMesh, x: &[Vector3<f64>], rules: Rules) -> Self {
        let boxes = Boxes::new(mesh, x.iter().map(|x| MovingBounds::fixed(Bounds::of(&[*x]))).collect(), &rules.halves);
        let first = mesh.own_features();
        let [own, obstacles] = boxes.split(first);
        Self {
            own: Trees::new(own, [0; 3]),
            obstacles: Trees::new(obstacles, first),
            is_own_fitted: true,
            rules,
            threads: 1,
        }
    }

    /// Whether cloth and hair collide with themselves and each other, not only with obstacles.
    pub fn is_with_itself(&self) -> bool {
        self.rules.with_itself
    }

    /// Half the reach at each vertex, in m.
    pub fn halves(&self) -> &[f64] {
        &self.rules.halves
    }

    /// The distance within which a pair is found, in m. It exceeds what contact needs by far more than rounding errors.
    #[inline]
    pub fn reach(&self, pair: &Pair) -> f64 {
        let half = |vertex: u32| self.rules.halves[vertex as usize];
        half(pair.vertices[0]) + half(pair.vertices[pair.first()])
    }

    /// Returns all pairs that can come within their reach while each vertex stays in its region, and others whose boxes
    /// meet. Pairs are in order.
    pub fn pairs(&mut self, mesh: &CollisionMesh, regions: Vec<MovingBounds>) -> Vec<Pair> {
        let boxes = Boxes::new(mesh, regions, &self.rules.halves);
        let [own_boxes, obstacle_boxes] = boxes.split(self.obstacles.first);
        self.obstacles.refit(obstacle_boxes);
        self.is_own_fitted = self.rules.with_itself;
        let mut found = Found::default();
        if self.rules.with_itself {
            self.own.refit(own_boxes);
            let threads = if mesh.vertices() < FEW { 1 } else { self.threads };
            for_each(threads, TASKS.to_vec(), |task| self.find(task, mesh)).into_iter().for_each(|one| found.add(one));
        } else {
            self.find_near_obstacles(mesh, own_boxes, &mut found);
        }
        in_order(mesh, found)
    }

    /// Finds a part of the pairs of cloth and hair, with themselves and with obstacles.
    fn find(&self, task: Task, mesh: &CollisionMesh) -> Found {
        let (own, mut found) = (&self.own, Found::default());
        match task {
            Task::PointsOnTriangles => own.points.meeting(&own.triangles, |point, triangle| {
                self.add_point_and_triangle(mesh, point, triangle, &mut found);
            }),
            Task::Edges(branches) => own.edges.meeting_itself(branches, |one, other| {
                self.add_edges(mesh, one, other, &mut found);
            }),
            Task::Obstacles => self.find_on_obstacles(mesh, &mut found),
        }
        found
    }

    fn find_on_obstacles(&self, mesh: &CollisionMesh, found: &mut Found) {
        let Self { own, obstacles, .. } = self;
        let [points, triangles, edges] = obstacles.first;
        own.points.meeting(&obstacles.triangles, |point, triangle| {
            self.add_point_and_triangle(mesh, point, triangles + triangle, found);
        });
        obstacles.points.meeting(&own.triangles, |point, triangle| {
            self.add_point_and_triangle(mesh, points + point, triangle, found);
        });
        own.edges.meeting(&obstacles.edges, |one, other| self.add_edges(mesh, one, edges + other, found));
    }

    /// Finds pairs with obstacles, without the hierarchies of cloth and hair: most features are near no obstacle.
    fn find_near_obstacles(&self, mesh: &CollisionMesh, own: [&[MovingBounds]; 3], found: &mut Found) {
        let Trees { points, triangles, edges, first } = &self.obstacles;
        for (point, around) in own[0].iter().enumerate() {
            triangles.near(around, |triangle| self.add_point_and_triangle(mesh, point, first[1] + triangle, found));
        }
        for (triangle, around) in own[1].iter().enumerate() {
            points.near(around, |point| self.add_point_and_triangle(mesh, first[0] + point, triangle, found));
        }
        for (edge, around) in own[2].iter().enumerate() {
            edges.near(around, |other| self.add_edges(mesh, edge, first[2] + other, found));
        }
    }

    /// Adapts to regions without a search.
    pub fn fit(&mut self, mesh: &CollisionMesh, regions: Vec<MovingBounds>) {
        let boxes = Boxes::new(mesh, regions, &self.rules.halves);
        let [own, obstacles] = boxes.split(self.obstacles.first);
        self.own.refit(own);
        self.obstacles.refit(obstacles);
        self.is_own_fitted = true;
    }

    /// Returns the pairs with a changed vertex that can come within their reach while each vertex stays in its region,
    /// and others whose boxes meet. The regions of the other vertices lie in those of the last call.
    pub fn pairs_with(&mut self, is_changed: &[bool], mesh: &CollisionMesh, regions: &[MovingBounds]) -> Vec<Pair> {
        let changed = self.changed(is_changed, mesh, regions);
        self.refit_changed(mesh, &changed, regions);
        let (mut found, [points, triangles, edges]) = (Found::default(), &changed);
        for (point, around) in points {
            for trees in self.partners(mesh, mesh.points()[*point]) {
                trees.triangles.near(around, |triangle| {
                    self.add_point_and_triangle(mesh, *point, trees.first[1] + triangle, &mut found);
                });
            }
        }
        for (triangle, around) in triangles {
            for trees in self.partners(mesh, mesh.triangles()[*triangle][0]) {
                trees.points.near(around, |point| {
                    self.add_point_and_triangle(mesh, trees.first[0] + point, *triangle, &mut found);
                });
            }
        }
        for (edge, around) in edges {
            for trees in self.partners(mesh, mesh.edges()[*edge][0]) {
                trees.edges.near(around, |other| self.add_edges(mesh, *edge, trees.first[2] + other, &mut found));
            }
        }
        in_order(mesh, found)
    }

    /// Returns the points, triangles and edges with a changed vertex, each with the box around the regions of its
    /// vertices.
    fn changed(
        &self,
        is_changed: &[bool],
        mesh: &CollisionMesh,
        regions: &[MovingBounds],
    ) -> [Vec<(usize, MovingBounds)>; 3] {
        let around = |vertices: &[u32]| -> Option<MovingBounds> {
            let is_changed = vertices.iter().any(|vertex| is_changed[*vertex as usize]);
            let region = |vertex: &u32| regions[*vertex as usize].extended(self.rules.halves[*vertex as usize]);
            is_changed.then(|| vertices.iter().map(region).fold(MovingBounds::empty(), MovingBounds::joined))
        };
        let numbered = |(number, vertices): (usize, &[u32])| Some((number, around(vertices)?));
        [
            mesh.points().chunks(1).enumerate().filter_map(numbered).collect(),
            mesh.triangles().iter().map(|corners| &corners[..]).enumerate().filter_map(numbered).collect(),
            mesh.edges().iter().map(|ends| &ends[..]).enumerate().filter_map(numbered).collect(),
        ]
    }

    /// Adapts the hierarchies to the boxes of changed features, which are in order.
    fn refit_changed(
        &mut self,
        mesh: &CollisionMesh,
        changed: &[Vec<(usize, MovingBounds)>; 3],
        regions: &[MovingBounds],
    ) {
        let first = self.obstacles.first;
        let split: [_; 3] = std::array::from_fn(|kind| {
            changed[kind].split_at(changed[kind].partition_point(|(number, _)| *number < first[kind]))
        });
        if split.iter().any(|(_, others)| !others.is_empty()) && !self.is_own_fitted {
            self.own.refit(Boxes::new(mesh, regions.to_vec(), &self.rules.halves).split(first)[0]);
            self.is_own_fitted = true;
        }
        self.own.refit_some(split.map(|(own, _)| own.to_vec()));
        let shifted =
            |kind: usize| split[kind].1.iter().map(|(number, around)| (number - first[kind], *around)).collect();
        self.obstacles.refit_some([shifted(0), shifted(1), shifted(2)]);
    }

    /// The features with which those at a vertex may collide.
    fn partners(&self, mesh: &CollisionMesh, vertex: u32) -> impl Iterator<Item = &Trees> {
        let is_own = mesh.obstacle(vertex).is_none();
        let itself = (!is_own || self.rules.with_itself).then_some(&self.own);
        itself.into_iter().chain(is_own.then_some(&self.obstacles))
    }

    /// Adds a point and a triangle if they can collide.
    fn add_point_and_triangle(&self, mesh: &CollisionMesh, point: usize, triangle: usize, found: &mut Found) {
        if self.can_collide(mesh, &[mesh.points()[point]], &mesh.triangles()[triangle]) {
            found.on_triangles.push([index(point), index(triangle)]);
        }
    }

    /// Adds two edges if they can collide.
    fn add_edges(&self, mesh: &CollisionMesh, one: usize, other: usize, found: &mut Found) {
        // The triangles of an edge collide with points, such as the centre of a ball.
        let is_covered = |point: usize, edge: usize| {
            let [a, b] = mesh.edges()[point];
            a == b && !mesh.apexes(edge).is_empty()
        };
        if is_covered(one, other) || is_covered(other, one) {
            return;
        }
        if self.can_collide(mesh, &mesh.edges()[one], &mesh.edges()[other]) {
            found.of_edges.push([index(one.min(other)), index(one.max(other))]);
        }
    }

    fn can_collide(&self, mesh: &CollisionMesh, a: &[u32], b: &[u32]) -> bool {
        !mesh.are_joined(a, b)
            && a.iter().chain(b).any(|vertex| self.rules.is_free[*vertex as usize])
            && !self.rules.exclusions.exclude(mesh, a, b)
    }
}

/// Returns the pairs of these features once and in order.
fn in_order(mesh: &CollisionMesh, found: Found) -> Vec<Pair> {
    let [points, triangles, edges] = [mesh.points().len(), mesh.triangles().len(), mesh.edges().len()];
    let on_triangles = sorted(found.on_triangles, [points, triangles]);
    let of_edges = sorted(found.of_edges, [edges, edges]);
    let on_triangle = |features: Features| {
        let (point, [a, b, c]) = (mesh.points()[features[0] as usize], mesh.triangles()[features[1] as usize]);
        Pair { kind: PairKind::PointTriangle, features, vertices: [point, a, b, c] }
    };
    let of_edges = of_edges.into_iter().map(|features| {
        let [[a, b], [c, d]] = features.map(|edge| mesh.edges()[edge as usize]);
        Pair { kind: PairKind::EdgeEdge, features, vertices: [a, b, c, d] }
    });
    on_triangles.into_iter().map(on_triangle).chain(of_edges).collect()
}

/// Sorts features whose numbers are below some counts, and drops repeated ones. Time is linear: they are counted by
/// their second number, then by the first.
fn sorted(mut features: Vec<Features>, counts: [usize; 2]) -> Vec<Features> {
    let mut sorted = vec![[0; 2]; features.len()];
    for key in [1, 0] {
        let mut places = vec![0; counts[key] + 1];
        features.iter().for_each(|one| places[one[key] as usize + 1] += 1);
        for number in 1..places.len() {
            places[number] += places[number - 1];
        }
        for one in &features {
            let place = &mut places[one[key] as usize];
            sorted[*place] = *one;
            *place += 1;
        }
        std::mem::swap(&mut features, &mut sorted);
    }
    features.dedup();
    features
}
