//! Smooth parts of sheets, which have no pairs.
//!
//! The projection of a sheet at the start gives each of its points a point X in a plane. Let x(X) be the point in space
//! later on. Its derivative F, a 3 × 2 matrix, is constant in each triangle. Consider a rectangle that the sheet covers
//! once, and a 2 × 3 matrix P with |P F − 1| ≤ ε in all triangles that meet the rectangle. The straight line from X to
//! Y stays in it, and the integral of F along this line gives
//!
//! |P| |x(Y) − x(X)| ≥ |P (x(Y) − x(X))| = |Y − X + ∫ (P F − 1)(Y − X)| ≥ (1 − ε) |Y − X|.
//!
//! In the plane, the nearest points of two features without a common vertex are apart by at least w, the least height
//! of these triangles. One of the points is a vertex. The line to the other leaves the triangles around that vertex
//! across an opposite side, so it is at least as long as a height. All such features in the rectangle are apart by at
//! least (1 − ε) w / |P| in space. If vertices move by r at most from where F is known, 2 r less is left. If that
//! exceeds the reach, the rectangle has no pairs.
//!
//! On a straight move F is linear in time, so |P F − 1| is at most as large as at one of the ends. P is the left
//! inverse of R, the mean at both ends of the matrix M in the middle of the range of F. Let W hold the half widths of
//! this range. Then |P F − 1| ≤ |P (M − R)| + ‖ |P| W ‖, where |P| has the absolute values of all entries.
//!
//! Compare the cones of normals of Volino and Magnenat-Thalmann (1994), which need a test of the outline, and say
//! nothing about distances.

use energy_dsl::{Kernel, Level, Vector3, dispatch};
use energy_solve::threads::collect;

use super::tiling::{Reference, Tile, Tiling};
use crate::geometry::{Bounds, Coordinate, MovingBounds, RoundedMovingBounds, dot, subtract};

/// Bound of the rounding errors of (1 − ε) w / |P|: relative to w / |P|, and to the largest coordinate.
const ROUNDING: f64 = 1e-12;
/// Tiles that a thread looks at, at a time.
const TILES: usize = 64;
/// Vertices that a thread copies at a time.
const VERTICES: usize = 4096;

/// The shapes of all tiles on a straight move of the vertices.
#[derive(Debug)]
pub(super) struct Shapes<'a> {
    tiling: &'a Tiling,
    tiles: Vec<Shape>,
    /// The distance that features without a common vertex keep within each block, in m; −∞ if it is not known.
    apart: Vec<f64>,
}

/// The blocks of a tiling that have no pairs.
#[derive(Debug)]
pub(super) struct Smooth<'a> {
    tiling: &'a Tiling,
    is_smooth: Vec<bool>,
}

/// The shape of a tile on a straight move.
#[derive(Clone, Copy, Debug)]
struct Shape {
    /// The boxes around all vertices at the start and at the end.
    around: [Bounds; 2],
    /// The ranges of F at the start and at the end.
    derivatives: [Entries; 2],
    /// The least height of a triangle in the plane, in m.
    height: f64,
}

impl<'a> Shapes<'a> {
    /// Looks at all tiles on a move with these ends, which must be finite.
    pub fn new(tiling: &'a Tiling, ends: [&[Vector3<f64>]; 2], threads: usize) -> Self {
        Self::around(tiling, ends, &vec![true; tiling.tiles.len()], threads)
    }

    /// Looks at the tiles of blocks with a wanted tile. It is not known how far features of other blocks are apart.
    pub fn around(tiling: &'a Tiling, ends: [&[Vector3<f64>]; 2], is_wanted: &[bool], threads: usize) -> Self {
        let padded = |x: &[Vector3<f64>]| x.iter().map(|&[a, b, c]| [a, b, c, 0.0]).collect();
        let ends = &ends.map(|x| collect(threads, x.len(), VERTICES, |range| padded(&x[range])));
        let has_wanted = |block: &[usize]| block.iter().any(|tile| is_wanted[*tile]);
        let mut matters = vec![false; tiling.tiles.len()];
        for block in tiling.blocks.iter().filter(|block| has_wanted(block)) {
            block.iter().for_each(|tile| matters[*tile] = true);
        }
        let tiles = collect(threads, tiling.tiles.len(), TILES, |range| {
            dispatch(Look { tiles: &tiling.tiles[range.clone()], matters: &matters[range], ends })
        });
        let apart = |block: &Vec<usize>| {
            let wanted = if has_wanted(block) { &block[..] } else { &[] };
            let joined = wanted.iter().map(|tile| tiles[*tile]).reduce(Shape::joined);
            joined.map_or(f64::NEG_INFINITY, |shape| shape.apart())
        };
        let apart =
            collect(threads, tiling.blocks.len(), TILES, |range| tiling.blocks[range].iter().map(apart).collect());
        Self { tiling, tiles, apart }
    }

    /// The radius around their paths in which vertices may stay so that no block has pairs within twice the distance
    /// `half`, in m. Negative if no radius suffices.
    pub fn clear_radius(&self, half: f64) -> f64 {
        self.apart.iter().map(|apart| radius(*apart, half)).fold(f64::INFINITY, f64::min)
    }

    /// Reduces radii so that blocks have no pairs within twice the distance `half`, where a radius of at least `least`
    /// does so.
    pub fn shrink(&self, radii: &mut [f64], half: f64, least: f64) {
        for (block, apart) in self.tiling.blocks.iter().zip(&self.apart) {
            let radius = radius(*apart, half);
            if radius >= least {
                for vertex in block.iter().flat_map(|tile| &self.tiling.tiles[*tile].surroundings) {
                    let own = &mut radii[*vertex as usize];
                    *own = own.min(radius);
                }
            }
        }
    }

    /// The largest distance from its path within which a vertex of each tile reaches others, in m.
    pub fn reaches(&self, radii: &[f64], halves: &[f64], threads: usize) -> Vec<f64> {
        let reach = |vertex: &u32| radii[*vertex as usize] + halves[*vertex as usize];
        let of_tile = |tile: &Tile| tile.surroundings.iter().map(reach).fold(0.0, f64::max);
        let tiles = &self.tiling.tiles;
        collect(threads, tiles.len(), TILES, |range| tiles[range].iter().map(of_tile).collect())
    }

    /// The box of a tile within its reach.
    pub fn bounds(&self, tile: usize, reach: f64) -> RoundedMovingBounds {
        MovingBounds(self.tiles[tile].around).rounded(reach)
    }

    /// Finds the blocks that have no pairs within the reach of their tiles.
    pub fn smooth(&self, reaches: &[f64]) -> Smooth<'a> {
        let reach = |block: &Vec<usize>| block.iter().map(|tile| reaches[*tile]).fold(0.0, f64::max);
        let blocks = self.tiling.blocks.iter().zip(&self.apart);
        Smooth { tiling: self.tiling, is_smooth: blocks.map(|(block, apart)| *apart > 2.0 * reach(block)).collect() }
    }
}

/// A radius, a little less than the largest, in which vertices may stay if features must keep twice the distance
/// `half`.
fn radius(apart: f64, half: f64) -> f64 {
    (1.0 - 1e-6) * (0.5 * apart - half)
}

impl Smooth<'_> {
    /// Whether the features of two tiles have no pairs.
    pub fn have_no_pairs(&self, one: usize, other: usize) -> bool {
        self.tiling.blocks_with(one, other).any(|block| self.is_smooth[block])
    }
}

/// A range of 3 × 2 matrices, by columns.
#[derive(Clone, Copy, Debug)]
struct Entries {
    low: [Column; 2],
    high: [Column; 2],
}

/// A vector, and a number that fills the lanes.
type Column = [f64; 4];

/// Finds the shapes of some tiles.
struct Look<'a> {
    tiles: &'a [Tile],
    /// Whether F matters in each of these tiles.
    matters: &'a [bool],
    /// The positions of vertices at the start and at the end.
    ends: &'a [Vec<Column>; 2],
}

impl Kernel for Look<'_> {
    type Output = Vec<Shape>;

    #[inline(always)]
    fn run<L: Level>(self) -> Vec<Shape> {
        let [start, end] = self.ends;
        let mut shapes = Vec::with_capacity(self.tiles.len());
        for (tile, matters) in self.tiles.iter().zip(self.matters) {
            let derivatives =
                if *matters { [tile.derivatives(start), tile.derivatives(end)] } else { [Entries::EMPTY; 2] };
            shapes.push(Shape { around: [tile.around(start), tile.around(end)], derivatives, height: tile.height });
        }
        shapes
    }
}

impl Tile {
    /// The range of F.
    #[inline(always)]
    fn derivatives(&self, x: &[Column]) -> Entries {
        let mut all = Entries::EMPTY;
        for triangle in &self.triangles {
            let columns = triangle.derivative(x);
            all.join(&Entries { low: columns, high: columns });
        }
        all
    }

    /// The box around all vertices.
    #[inline(always)]
    fn around(&self, x: &[Column]) -> Bounds {
        let (mut low, mut high) = (Entries::EMPTY.low[0], Entries::EMPTY.high[0]);
        for vertex in &self.vertices {
            let x = x[*vertex as usize];
            for axis in 0..4 {
                low[axis] = low[axis].least(x[axis]);
                high[axis] = high[axis].greatest(x[axis]);
            }
        }
        Bounds { low: [low[0], low[1], low[2]], high: [high[0], high[1], high[2]] }
    }
}

impl Shape {
    fn joined(self, other: Self) -> Self {
        let mut all = self;
        for end in 0..2 {
            all.around[end] = self.around[end].around(other.around[end]);
            all.derivatives[end].join(&other.derivatives[end]);
        }
        Self { height: self.height.min(other.height), ..all }
    }

    /// (1 − ε) w / |P|, less a bound of rounding errors.
    fn apart(&self) -> f64 {
        let middles = self.derivatives.map(|entries| entries.middle());
        let mean = [0, 1].map(|column| midway(middles[0][column], middles[1][column]));
        let inverse = left_inverse(mean);
        let absolute = inverse.map(|row| row.map(f64::abs));
        let deviation = |end: usize| {
            let from_mean = [0, 1].map(|column| subtract(middles[end][column], mean[column]));
            largest_stretch(product(inverse, from_mean))
                + largest_stretch(product(absolute, self.derivatives[end].half_widths()))
        };
        let kept = 1.0 - deviation(0).max(deviation(1)) - ROUNDING;
        let coordinates = self.around.iter().flat_map(|bounds| bounds.low.into_iter().chain(bounds.high));
        let largest = coordinates.fold(0.0, |largest: f64, coordinate| largest.max(coordinate.abs()));
        let apart = kept * self.height * least_stretch(mean) - ROUNDING * largest;
        // A sheet without an area has no left inverse.
        if apart.is_nan() { f64::NEG_INFINITY } else { apart }
    }
}

impl Entries {
    const EMPTY: Self = Self { low: [[f64::INFINITY; 4]; 2], high: [[f64::NEG_INFINITY; 4]; 2] };

    #[inline(always)]
    fn join(&mut self, other: &Self) {
        for column in 0..2 {
            for row in 0..4 {
                self.low[column][row] = self.low[column][row].least(other.low[column][row]);
                self.high[column][row] = self.high[column][row].greatest(other.high[column][row]);
            }
        }
    }

    /// The columns of the matrix in the middle.
    fn middle(&self) -> [Vector3<f64>; 2] {
        [0, 1].map(|column| [0, 1, 2].map(|row| 0.5 * (self.low[column][row] + self.high[column][row])))
    }

    /// The largest differences of entries from those of the matrix in the middle, by columns.
    fn half_widths(&self) -> [Vector3<f64>; 2] {
        [0, 1].map(|column| [0, 1, 2].map(|row| 0.5 * (self.high[column][row] - self.low[column][row])))
    }
}

impl Reference {
    /// The derivative F of the point in space by that in the plane, by columns.
    #[inline(always)]
    fn derivative(&self, x: &[Column]) -> [Column; 2] {
        let [a, b, c] = self.corners;
        let (a, b, c) = (x[a as usize], x[b as usize], x[c as usize]);
        let [[p, q], [r, s]] = self.inverse;
        let mut columns = [[0.0; 4]; 2];
        for row in 0..4 {
            let (b, c) = (b[row] - a[row], c[row] - a[row]);
            columns[0][row] = b * p + c * r;
            columns[1][row] = b * q + c * s;
        }
        columns
    }
}

fn midway(a: Vector3<f64>, b: Vector3<f64>) -> Vector3<f64> {
    [0, 1, 2].map(|axis| 0.5 * (a[axis] + b[axis]))
}

/// The product of a matrix given by rows and one given by columns.
fn product([p, q]: [Vector3<f64>; 2], [a, b]: [Vector3<f64>; 2]) -> [[f64; 2]; 2] {
    [[dot(p, a), dot(p, b)], [dot(q, a), dot(q, b)]]
}

/// The rows of the matrix P with P R = 1 and the least norm, for R given by columns. NaN or infinite if the columns are
/// parallel.
fn left_inverse([a, b]: [Vector3<f64>; 2]) -> [Vector3<f64>; 2] {
    let [[aa, ab], [_, bb]] = product([a, b], [a, b]);
    let determinant = aa * bb - ab * ab;
    let row = |of_a: f64, of_b: f64| [0, 1, 2].map(|axis| (of_a * a[axis] + of_b * b[axis]) / determinant);
    [row(bb, -ab), row(-ab, aa)]
}

/// The norm |A| of a matrix: the largest |A v| for |v| = 1.
fn largest_stretch([[a, b], [c, d]]: [[f64; 2]; 2]) -> f64 {
    let (x, y, z) = (a * a + c * c, a * b + c * d, b * b + d * d);
    (0.5 * (x + z) + length(0.5 * (x - z), y)).sqrt()
}

/// The least |R v| for |v| = 1. It is 1 / |P| for the left inverse P.
fn least_stretch(columns: [Vector3<f64>; 2]) -> f64 {
    let [[x, y], [_, z]] = product(columns, columns);
    (0.5 * (x + z) - length(0.5 * (x - z), y)).max(0.0).sqrt()
}

/// √(x² + y²), faster than `hypot`, which guards against overflow. Here an infinite length only means that nothing is
/// known.
fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}
