use std::sync::Arc;

use energy_dsl::Vector3;
use energy_solve::index;
use energy_solve::threads::for_each;

use super::found::Found;
use super::mesh::CollisionMesh;
use super::smooth::Shapes;
use super::tiling::{Tile, Tiling};
use super::trees::{Boxes, Kind, Trees};
use super::{Exclusions, MovingBalls, Pair};
use crate::geometry::{Bounds, Hierarchy, MovingBounds, RoundedMovingBounds};

/// A mesh with fewer vertices is searched on one thread.
const FEW: usize = 1000;
/// Changed features whose pairs a thread finds at a time.
const CHANGED: usize = 512;
/// Pairs of tiles that a thread takes at a time.
const TILES: usize = 64;

/// Finds the candidate pairs of vertices within given regions.
#[derive(Clone, Debug)]
pub struct Search {
    tiling: Arc<Tiling>,
    /// The boxes of all tiles.
    tiles: Hierarchy<RoundedMovingBounds>,
    /// Cloth and hair, grouped by tiles.
    own: Trees,
    obstacles: Trees,
    /// Whether edges of cloth and hair meet edges of obstacles; see [`edges_meet_obstacles`].
    edges_meet_obstacles: bool,
    /// Whether all of cloth and hair fits the regions of the last search. Every search fits all obstacles.
    is_own_fitted: bool,
    rules: Rules,
    /// The largest half of the reach at a vertex of cloth or hair, in m.
    half: f64,
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

/// A part of a search. Together they find all pairs.
enum Task<'a> {
    Edges(&'a [[usize; 2]]),
    PointsOnTriangles(&'a [[usize; 2]]),
    Obstacles(&'a NearObstacles),
}

/// Tiles near the points of obstacles, those near their triangles, and those near their edges, in order.
struct NearObstacles {
    points: Vec<usize>,
    triangles: Vec<usize>,
    edges: Vec<usize>,
}

impl NearObstacles {
    fn is_empty(&self) -> bool {
        self.points.is_empty() && self.triangles.is_empty() && self.edges.is_empty()
    }

    fn retain(&mut self, is_kept: impl Fn(usize) -> bool) {
        for tiles in [&mut self.points, &mut self.triangles, &mut self.edges] {
            tiles.retain(|tile| is_kept(*tile));
        }
    }
}

/// The vertices whose pairs are wanted, and the parts that contain them.
struct Wanted<'a> {
    /// Whether each vertex is wanted; `None` if all are.
    vertices: Option<&'a [bool]>,
    tiles: Vec<bool>,
    obstacles: bool,
}

impl<'a> Wanted<'a> {
    fn all(tiling: &Tiling) -> Self {
        Self { vertices: None, tiles: vec![true; tiling.tiles.len()], obstacles: true }
    }

    fn only(vertices: &'a [bool], tiling: &Tiling, mesh: &CollisionMesh) -> Self {
        let has_any = |tile: &Tile| tile.vertices.iter().any(|vertex| vertices[*vertex as usize]);
        let obstacles = vertices[mesh.own_vertices()..].contains(&true);
        Self { vertices: Some(vertices), tiles: tiling.tiles.iter().map(has_any).collect(), obstacles }
    }
}

impl Search {
    /// Prepares searches in a mesh that starts at x.
    pub fn new(mesh: &CollisionMesh, x: &[Vector3<f64>], rules: Rules) -> Self {
        let position = |vertex: usize| MovingBounds::fixed(Bounds::of(&[x[vertex]]));
        let boxes = Boxes::new(mesh, position, &rules.halves, 1);
        let own = mesh.own_features();
        let all = [mesh.points().len(), mesh.triangles().len(), mesh.edges().len()];
        let mut tiling = Tiling::new(mesh, x);
        if !rules.with_itself {
            tiling.forget_triangles();
        }
        let tiling = Arc::new(tiling);
        let obstacles = Trees::new(&boxes, std::array::from_fn(|kind| own[kind]..all[kind]), |_, _| 0);
        let own = Trees::new(&boxes, own.map(|count| 0..count), |kind, number| tiling.tile_of(kind, number));
        let shapes = Shapes::new(&tiling, [x, x], 1);
        let boxes: Vec<_> = (0..tiling.tiles.len()).map(|tile| shapes.bounds(tile, 0.0)).collect();
        let half = rules.halves[..mesh.own_vertices()].iter().copied().fold(0.0, f64::max);
        Self {
            tiles: Hierarchy::new(&boxes),
            tiling,
            own,
            obstacles,
            edges_meet_obstacles: edges_meet_obstacles(mesh),
            is_own_fitted: true,
            half,
            rules,
            threads: 1,
        }
    }

    /// The number of threads that search a mesh.
    fn threads_in(&self, mesh: &CollisionMesh) -> usize {
        if mesh.vertices() < FEW { 1 } else { self.threads }
    }

    fn boxes<'a>(&self, mesh: &'a CollisionMesh, balls: &MovingBalls<'_>) -> Boxes<'a> {
        Boxes::new(mesh, |vertex| balls.bounds(vertex), &self.rules.halves, self.threads_in(mesh))
    }

    /// The rules that select what may collide.
    pub fn rules(&self) -> &Rules {
        &self.rules
    }

    /// Half the reach at each vertex, in m.
    pub fn halves(&self) -> &[f64] {
        &self.rules.halves
    }

    /// The distance within which a pair is found, in m. It exceeds what contact needs by far more than rounding errors.
    #[inline]
    pub fn reach(&self, pair: &Pair) -> f64 {
        pair.reach(&self.rules.halves)
    }

    /// Whether certainly no pair comes within its reach while each vertex stays in its ball: cloth is smooth
    /// everywhere, so that nothing crosses, its parts stay away from each other, and no obstacle is near. Costs little.
    pub fn is_clear(&mut self, mesh: &CollisionMesh, balls: &MovingBalls<'_>) -> bool {
        let tiling = Arc::clone(&self.tiling);
        self.is_clear_on(mesh, &Shapes::new(&tiling, balls.ends, self.threads_in(mesh)), balls)
    }

    fn is_clear_on(&mut self, mesh: &CollisionMesh, shapes: &Shapes<'_>, balls: &MovingBalls<'_>) -> bool {
        self.is_own_fitted = false;
        if !self.crowded(shapes, balls, self.threads_in(mesh)).is_empty() {
            return false;
        }
        self.obstacles.is_empty() || self.near_obstacles(&self.boxes(mesh, balls)).is_empty()
    }

    /// Returns all pairs that can come within their reach while each vertex stays in its ball, and others whose boxes
    /// meet. Pairs are in order.
    pub fn pairs(&mut self, mesh: &CollisionMesh, balls: &MovingBalls<'_>) -> Vec<Pair> {
        let tiling = Arc::clone(&self.tiling);
        self.pairs_on(mesh, &Shapes::new(&tiling, balls.ends, self.threads_in(mesh)), balls, &Wanted::all(&tiling))
    }

    /// Returns the pairs with a changed vertex among those of [`Search::pairs`].
    pub fn pairs_around(&mut self, mesh: &CollisionMesh, balls: &MovingBalls<'_>, is_changed: &[bool]) -> Vec<Pair> {
        let tiling = Arc::clone(&self.tiling);
        let wanted = Wanted::only(is_changed, &tiling, mesh);
        let shapes = Shapes::around(&tiling, balls.ends, &wanted.tiles, self.threads_in(mesh));
        self.pairs_on(mesh, &shapes, balls, &wanted)
    }

    /// Returns all pairs that can come within their reach while each vertex stays in its ball, and others whose boxes
    /// meet, in order. Chooses the radii: if nothing is near anything, all are as large as possible up to `widest`;
    /// otherwise those of `balls`, but less where cloth is smooth for a radius of at least `least`.
    pub fn pairs_near(
        &mut self,
        mesh: &CollisionMesh,
        balls: &MovingBalls<'_>,
        [least, widest]: [f64; 2],
    ) -> (Vec<Pair>, Vec<f64>) {
        let (tiling, mut radii) = (Arc::clone(&self.tiling), balls.radii.to_vec());
        let shapes = Shapes::new(&tiling, balls.ends, self.threads_in(mesh));
        let clear = if self.rules.with_itself { widest.min(shapes.clear_radius(self.half)) } else { widest };
        let wide = vec![clear; radii.len()];
        if clear >= least && self.is_clear_on(mesh, &shapes, &MovingBalls { radii: &wide, ..*balls }) {
            return (Vec::new(), wide);
        }
        if self.rules.with_itself {
            shapes.shrink(&mut radii, self.half, least);
        }
        (self.pairs_on(mesh, &shapes, &MovingBalls { radii: &radii, ..*balls }, &Wanted::all(&tiling)), radii)
    }

    /// Returns the wanted pairs on a move with some shapes.
    fn pairs_on(
        &mut self,
        mesh: &CollisionMesh,
        shapes: &Shapes<'_>,
        balls: &MovingBalls<'_>,
        wanted: &Wanted<'_>,
    ) -> Vec<Pair> {
        let mut crowded = self.crowded(shapes, balls, self.threads_in(mesh));
        self.is_own_fitted = false;
        if crowded.is_empty() && self.obstacles.is_empty() {
            return Vec::new();
        }
        let boxes = self.boxes(mesh, balls);
        let mut near_obstacles = self.near_obstacles(&boxes);
        crowded.retain(|tiles| tiles.iter().any(|tile| wanted.tiles[*tile]));
        if !wanted.obstacles {
            near_obstacles.retain(|tile| wanted.tiles[tile]);
        }
        let threads = self.threads_in(mesh);
        self.fit(&boxes, &crowded, &near_obstacles, threads);
        let mut tasks = vec![Task::Obstacles(&near_obstacles)];
        for pairs in crowded.chunks(TILES) {
            tasks.extend([Task::Edges(pairs), Task::PointsOnTriangles(pairs)]);
        }
        let find = |task| {
            let mut found = self.find(&task, mesh);
            wanted.vertices.iter().for_each(|vertices| found.keep_around(mesh, vertices));
            found
        };
        Found::all(&for_each(threads, tasks, find)).in_order(mesh, threads)
    }

    /// Adapts what is searched in these tiles to boxes, or all of it if that costs little more.
    fn fit(&mut self, boxes: &Boxes<'_>, crowded: &[[usize; 2]], near: &NearObstacles, threads: usize) {
        let with_crowded = |near: &[usize]| {
            let mut tiles = [crowded.as_flattened(), near].concat();
            tiles.sort_unstable();
            tiles.dedup();
            tiles
        };
        // Points of cloth meet triangles of obstacles, triangles meet points.
        let tiles = [&near.triangles, &near.points, &near.edges].map(|near| with_crowded(near));
        self.is_own_fitted = tiles.iter().all(|tiles| 2 * tiles.len() > self.tiling.tiles.len());
        if self.is_own_fitted {
            self.own.refit(boxes, threads);
        } else {
            self.own.refit_tiles(boxes, &tiles, threads);
        }
    }

    /// Returns the pairs of tiles, or of a tile with itself, with candidate pairs while each vertex stays in its
    /// ball.
    fn crowded(&mut self, shapes: &Shapes<'_>, balls: &MovingBalls<'_>, threads: usize) -> Vec<[usize; 2]> {
        let reaches = shapes.reaches(balls.radii, &self.rules.halves, threads);
        self.tiles.refit(|tile| shapes.bounds(tile, reaches[tile]));
        let mut crowded = Vec::new();
        if self.rules.with_itself {
            let smooth = shapes.smooth(&reaches);
            let mut add = |one: usize, other: usize| {
                if !smooth.have_no_pairs(one, other) {
                    crowded.push([one, other]);
                }
            };
            (0..reaches.len()).for_each(|tile| add(tile, tile));
            self.tiles.overlaps_within([[0, 0]], add);
        }
        crowded
    }

    /// Returns the tiles near obstacles, after [`Search::crowded`] for the same balls, which have these boxes.
    fn near_obstacles(&mut self, boxes: &Boxes<'_>) -> NearObstacles {
        self.obstacles.refit(boxes, 1);
        let near = |tree: &Hierarchy<RoundedMovingBounds>| {
            let mut near = Vec::new();
            self.tiles.overlaps_with(tree, [[0, 0]], |tile, _| near.push(tile));
            near.sort_unstable();
            near.dedup();
            near
        };
        let Trees { points, triangles, edges, .. } = &self.obstacles;
        let edges = if self.edges_meet_obstacles { near(edges) } else { Vec::new() };
        NearObstacles { points: near(points), triangles: near(triangles), edges }
    }

    /// Returns all pairs within their reach at x, and others whose boxes overlap, in order.
    pub fn pairs_at(&mut self, mesh: &CollisionMesh, x: &[Vector3<f64>]) -> Vec<Pair> {
        self.pairs(mesh, &MovingBalls { ends: [x, x], radii: &vec![0.0; x.len()] })
    }

    /// Finds a part of the pairs.
    fn find(&self, task: &Task<'_>, mesh: &CollisionMesh) -> Found {
        let (Self { own, obstacles, .. }, mut found) = (self, Found::default());
        match *task {
            Task::Edges(tiles) => own.edges.overlaps_within(tiles.iter().copied(), |one, other| {
                self.add_edges(mesh, one, other, &mut found);
            }),
            Task::PointsOnTriangles(tiles) => {
                let reversed = tiles.iter().filter(|[a, b]| a != b).map(|&[a, b]| [b, a]);
                own.points.overlaps_with(&own.triangles, tiles.iter().copied().chain(reversed), |point, triangle| {
                    self.add_point_and_triangle(mesh, point, triangle, &mut found);
                });
            }
            Task::Obstacles(near) => {
                let [points, triangles, edges] = obstacles.first;
                // All features of obstacles are in one group.
                let group = |&tile: &usize| [tile, 0];
                own.points.overlaps_with(&obstacles.triangles, near.triangles.iter().map(group), |point, triangle| {
                    self.add_point_and_triangle(mesh, point, triangles + triangle, &mut found);
                });
                own.triangles.overlaps_with(&obstacles.points, near.points.iter().map(group), |triangle, point| {
                    self.add_point_and_triangle(mesh, points + point, triangle, &mut found);
                });
                own.edges.overlaps_with(&obstacles.edges, near.edges.iter().map(group), |one, other| {
                    self.add_edges(mesh, one, edges + other, &mut found);
                });
            }
        }
        found
    }

    /// Whether only parts of cloth and hair fit the regions of the last search: then [`Search::pairs_around`] costs
    /// less than [`Search::pairs_with`].
    pub fn is_unfitted(&self) -> bool {
        self.rules.with_itself && !self.is_own_fitted
    }

    /// Returns the pairs with a changed vertex that can come within their reach while each vertex stays in its region,
    /// and others whose boxes overlap. Regions do not move. That of a vertex that is not changed lies in its region of
    /// the searches before, at one instant. Its box there serves: a box at rest meets a moving one if they overlap at
    /// any instant.
    pub fn pairs_with(
        &mut self,
        is_changed: &[bool],
        mesh: &CollisionMesh,
        region: impl Fn(usize) -> MovingBounds + Sync,
    ) -> Vec<Pair> {
        let threads = self.threads_in(mesh);
        let boxes = Boxes::new(mesh, region, &self.rules.halves, threads);
        let changed = changed_features(mesh, is_changed);
        self.refit_changed(&boxes, changed.each_ref().map(|features| &features[..]));
        let kinds = [Kind::Point, Kind::Triangle, Kind::Edge].into_iter().zip(&changed);
        let parts = kinds.flat_map(|(kind, features)| features.chunks(CHANGED).map(move |part| (kind, part))).collect();
        let found = Found::all(&for_each(threads, parts, |(kind, features)| self.find_changed(kind, features, &boxes)));
        found.in_order(mesh, threads)
    }

    /// Finds the pairs of some changed features of one kind.
    fn find_changed(&self, kind: Kind, features: &[usize], boxes: &Boxes<'_>) -> Found {
        let (mesh, mut found) = (boxes.mesh, Found::default());
        for &number in features {
            let bounds = boxes.of(kind, number);
            match kind {
                Kind::Point => {
                    for trees in self.partners(mesh, mesh.points()[number]) {
                        trees.triangles.near(&bounds, |triangle| {
                            self.add_point_and_triangle(mesh, number, trees.first[1] + triangle, &mut found);
                        });
                    }
                }
                Kind::Triangle => {
                    for trees in self.partners(mesh, mesh.triangles()[number][0]) {
                        trees.points.near(&bounds, |point| {
                            self.add_point_and_triangle(mesh, trees.first[0] + point, number, &mut found);
                        });
                    }
                }
                Kind::Edge => {
                    for trees in self.partners(mesh, mesh.edges()[number][0]) {
                        trees.edges.near(&bounds, |other| {
                            self.add_edges(mesh, number, trees.first[2] + other, &mut found);
                        });
                    }
                }
            }
        }
        found
    }

    /// Adapts the hierarchies to the boxes of changed features.
    fn refit_changed(&mut self, boxes: &Boxes<'_>, changed: [&[usize]; 3]) {
        let first = self.obstacles.first;
        let split: [_; 3] = std::array::from_fn(|kind| {
            changed[kind].split_at(changed[kind].partition_point(|number| *number < first[kind]))
        });
        let (own, others) = (split.map(|(own, _)| own), split.map(|(_, others)| others));
        if !self.is_own_fitted && (self.rules.with_itself || others.iter().any(|others| !others.is_empty())) {
            self.own.refit(boxes, 1);
            self.is_own_fitted = true;
        }
        self.own.refit_some(boxes, own);
        self.obstacles.refit_some(boxes, others);
    }

    /// The features with which those at a vertex may collide.
    fn partners(&self, mesh: &CollisionMesh, vertex: u32) -> impl Iterator<Item = &Trees> {
        let is_own = mesh.obstacle(vertex).is_none();
        let itself = (!is_own || self.rules.with_itself).then_some(&self.own);
        itself.into_iter().chain(is_own.then_some(&self.obstacles))
    }

    /// Adds a point and a triangle if they can collide.
    #[inline]
    fn add_point_and_triangle(&self, mesh: &CollisionMesh, point: usize, triangle: usize, found: &mut Found) {
        let (p, corners) = ([mesh.points()[point]], mesh.triangles()[triangle]);
        if !mesh.are_adjacent(&p, &corners) && self.can_collide(mesh, &p, &corners) {
            found.on_triangles.push([index(point), index(triangle)]);
        }
    }

    /// Adds two edges if they can collide. Most edges whose boxes overlap are neighbours: that test is inlined.
    #[inline(always)]
    fn add_edges(&self, mesh: &CollisionMesh, one: usize, other: usize, found: &mut Found) {
        let (a, b) = (mesh.edges()[one], mesh.edges()[other]);
        if !mesh.are_adjacent(&a, &b) {
            self.add_separate_edges(mesh, [one, other], [a, b], found);
        }
    }

    fn add_separate_edges(
        &self,
        mesh: &CollisionMesh,
        [one, other]: [usize; 2],
        [a, b]: [[u32; 2]; 2],
        found: &mut Found,
    ) {
        let is_covered = |point: [u32; 2], edge: usize| is_point(point) && is_side(mesh, edge);
        if self.can_collide(mesh, &a, &b) && !is_covered(a, other) && !is_covered(b, one) {
            found.of_edges.push([index(one.min(other)), index(one.max(other))]);
        }
    }

    /// Whether two features that are not adjacent may respond to a contact, and no rule excludes them.
    fn can_collide(&self, mesh: &CollisionMesh, a: &[u32], b: &[u32]) -> bool {
        a.iter().chain(b).any(|vertex| self.rules.is_free[*vertex as usize])
            && !self.rules.exclusions.exclude(mesh, a, b)
    }
}

/// Returns the points, triangles and edges with a changed vertex, in order.
fn changed_features(mesh: &CollisionMesh, is_changed: &[bool]) -> [Vec<usize>; 3] {
    let changed = |vertices: &[u32]| vertices.iter().any(|vertex| is_changed[*vertex as usize]);
    [
        (0..mesh.points().len()).filter(|&point| changed(&mesh.points()[point..=point])).collect(),
        (0..mesh.triangles().len()).filter(|&triangle| changed(&mesh.triangles()[triangle])).collect(),
        (0..mesh.edges().len()).filter(|&edge| changed(&mesh.edges()[edge])).collect(),
    ]
}

/// Whether an edge is a point, such as the centre of a ball. Triangles collide with it, so their sides need not.
fn is_point([p, q]: [u32; 2]) -> bool {
    p == q
}

fn is_side(mesh: &CollisionMesh, edge: usize) -> bool {
    !mesh.apexes(edge).is_empty()
}

/// Whether there are obstacles with edges, or with points that meet hair.
fn edges_meet_obstacles(mesh: &CollisionMesh) -> bool {
    let (own, all) = (mesh.own_features()[2], mesh.edges().len());
    (own..all).any(|edge| !is_point(mesh.edges()[edge])) || own < all && (0..own).any(|edge| !is_side(mesh, edge))
}
