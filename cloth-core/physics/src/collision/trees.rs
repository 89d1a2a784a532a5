//! Hierarchies of features.

use std::ops::Range;

use energy_solve::threads::{collect_each, for_each};

use super::CollisionMesh;
use crate::geometry::{Hierarchy, MovingBounds, RoundedMovingBounds, Volume};

/// Vertices that a thread takes at a time.
const VERTICES: usize = 2048;

/// Hierarchies of the points, triangles and edges from certain numbers in the mesh's lists on.
#[derive(Clone, Debug)]
pub(super) struct Trees {
    pub points: Hierarchy<RoundedMovingBounds>,
    pub triangles: Hierarchy<RoundedMovingBounds>,
    pub edges: Hierarchy<RoundedMovingBounds>,
    pub first: [usize; 3],
}

/// A kind of features, in the order of lists by kind.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    Point,
    Triangle,
    Edge,
}

/// The boxes around the regions of features, extended by half the reach.
pub(super) struct Boxes<'a> {
    pub mesh: &'a CollisionMesh,
    /// The extended region of each vertex.
    regions: Vec<RoundedMovingBounds>,
}

impl<'a> Boxes<'a> {
    /// Extends the region of each vertex by half its reach.
    pub fn new(
        mesh: &'a CollisionMesh,
        region: impl Fn(usize) -> MovingBounds + Sync,
        halves: &[f64],
        threads: usize,
    ) -> Self {
        let extended = |vertex: usize| region(vertex).rounded(halves[vertex]);
        Self { mesh, regions: collect_each(threads, mesh.vertices(), VERTICES, extended) }
    }

    fn point(&self, number: usize) -> RoundedMovingBounds {
        self.regions[self.mesh.points()[number] as usize]
    }

    fn triangle(&self, number: usize) -> RoundedMovingBounds {
        self.joined(&self.mesh.triangles()[number])
    }

    fn edge(&self, number: usize) -> RoundedMovingBounds {
        self.joined(&self.mesh.edges()[number])
    }

    pub fn of(&self, kind: Kind, number: usize) -> RoundedMovingBounds {
        match kind {
            Kind::Point => self.point(number),
            Kind::Triangle => self.triangle(number),
            Kind::Edge => self.edge(number),
        }
    }

    fn joined(&self, vertices: &[u32]) -> RoundedMovingBounds {
        let of = |vertex: u32| self.regions[vertex as usize];
        vertices[1..].iter().fold(of(vertices[0]), |all, &vertex| all.joined(of(vertex)))
    }
}

impl Trees {
    /// Builds the hierarchies of some features, by their numbers in the mesh's lists.
    pub fn new(boxes: &Boxes<'_>, features: [Range<usize>; 3], tile_of: impl Fn(Kind, usize) -> usize) -> Self {
        let first = features.each_ref().map(|range| range.start);
        let tree = |kind: Kind, features: Range<usize>| {
            let boxes: Vec<_> = features.map(|number| boxes.of(kind, number)).collect();
            Hierarchy::grouped(&boxes, |item| tile_of(kind, item))
        };
        let [points, triangles, edges] = features;
        let [points, triangles, edges] =
            [(Kind::Point, points), (Kind::Triangle, triangles), (Kind::Edge, edges)].map(|(kind, of)| tree(kind, of));
        Self { points, triangles, edges, first }
    }

    /// Whether the trees are empty. A plane is a triangle without points and edges.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty() && self.triangles.is_empty() && self.edges.is_empty()
    }

    /// Adapts to the boxes of all features.
    pub fn refit(&mut self, boxes: &Boxes<'_>, threads: usize) {
        self.each(threads, |tree, kind, first| tree.refit(|item| boxes.of(kind, first + item)));
    }

    /// Adapts some tiles to the boxes of their points, of others to those of their triangles, and of others to those of
    /// their edges.
    pub fn refit_tiles(&mut self, boxes: &Boxes<'_>, tiles: &[Vec<usize>; 3], threads: usize) {
        self.each(threads, |tree, kind, first| {
            let of_tile = |tile: &usize| tree.refit_group(*tile, |item| boxes.of(kind, first + item));
            tiles[kind as usize].iter().for_each(of_tile);
        });
    }

    /// Changes each hierarchy, given its kind and the number of its first feature.
    fn each(&mut self, threads: usize, change: impl Fn(&mut Hierarchy<RoundedMovingBounds>, Kind, usize) + Sync) {
        let Self { points, triangles, edges, first: [p, t, e] } = self;
        // There are as many edges as triangles and points.
        let trees = vec![(edges, Kind::Edge, *e), (triangles, Kind::Triangle, *t), (points, Kind::Point, *p)];
        for_each(threads, trees, |(tree, kind, first)| change(tree, kind, first));
    }

    /// Adapts to the boxes of changed features, which are in order.
    pub fn refit_some(&mut self, boxes: &Boxes<'_>, [points, triangles, edges]: [&[usize]; 3]) {
        let [p, t, e] = self.first;
        self.points.refit_some(points.iter().map(|number| number - p), |item| boxes.point(p + item));
        self.triangles.refit_some(triangles.iter().map(|number| number - t), |item| boxes.triangle(t + item));
        self.edges.refit_some(edges.iter().map(|number| number - e), |item| boxes.edge(e + item));
    }
}
