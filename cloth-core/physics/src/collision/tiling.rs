use std::ops::RangeInclusive;

use energy_dsl::Vector3;

use super::CollisionMesh;
use super::rectangle::{PlanePoint, Rectangle, doubled_area, inverse, least_height};
use super::sheet::Sheet;
use super::trees::Kind;

/// The width of a tile relative to the mean length of edges: a tile of a regular grid has 4 × 4 cells.
const WIDTH: f64 = 3.5;
/// The largest overhang of a feature over its tile relative to the size of a tile. A tile with a longer feature is not
/// covered. If it extended all tiles, each of them would hold a large part of a mesh that is fine elsewhere.
const MOST_OVERHANG: f64 = 1.0;
/// The largest number of tiles over that of edges, roughly. A sheet that fills its rectangle has a quarter of it.
const MOST_TILES: f64 = 0.125;
/// Bound of rounding errors of the area that triangles cover, relative to the whole.
const COVERED: f64 = 1e-9;

/// The cloth and hair of a mesh, projected on planes at the start and divided into tiles, to which features belong. A
/// block consists of 2 × 2 neighbouring tiles.
#[derive(Clone, Debug)]
pub(super) struct Tiling {
    pub tiles: Vec<Tile>,
    /// The tiles of each block. Empty unless exactly one triangle covers each point of the rectangle around its
    /// features.
    pub blocks: Vec<Vec<usize>>,
    of_points: Vec<usize>,
    of_triangles: Vec<usize>,
    of_edges: Vec<usize>,
    grids: Vec<Grid>,
}

/// A part of a sheet.
#[derive(Clone, Debug, Default)]
pub(super) struct Tile {
    /// The triangles that meet the tile's rectangle, extended by the overhang of features, if they cover it once; none
    /// otherwise.
    pub triangles: Vec<Reference>,
    /// The vertices of the tile's features.
    pub vertices: Vec<u32>,
    /// The vertices of the tile's features and triangles.
    pub surroundings: Vec<u32>,
    /// The least height of these triangles, in m.
    pub height: f64,
    grid: usize,
    /// Column and row.
    at: [usize; 2],
}

/// A triangle in the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reference {
    pub corners: [u32; 3],
    /// The inverse of the matrix that has two sides as its columns, in 1/m.
    pub inverse: [[f64; 2]; 2],
}

/// The tiles and blocks of a sheet.
#[derive(Clone, Copy, Debug)]
struct Grid {
    first_tile: usize,
    first_block: usize,
    /// The numbers of columns and rows of tiles.
    size: [usize; 2],
}

impl Tiling {
    /// Divides a mesh that starts at x.
    pub fn new(mesh: &CollisionMesh, x: &[Vector3<f64>]) -> Self {
        let [points, triangles, edges] = mesh.own_features();
        let (of_points, of_triangles, of_edges) = (vec![0; points], vec![0; triangles], vec![0; edges]);
        let (tiles, blocks, grids) = Default::default();
        let mut tiling = Self { tiles, blocks, of_points, of_triangles, of_edges, grids };
        let mut points = vec![[0.0; 2]; x.len()];
        for sheet in Sheet::all(mesh) {
            sheet.project(mesh, x, &mut points);
            tiling.add(&Projected { mesh, sheet, points: &points });
        }
        tiling
    }

    fn add(&mut self, sheet: &Projected<'_>) {
        let frame = Frame::of(sheet);
        let grid = Grid { first_tile: self.tiles.len(), first_block: self.blocks.len(), size: frame.size };
        let mut tiles = frame.tiles(sheet);
        let mut assign = |vertices: &[u32]| {
            let tile = grid.tile(frame.cell(sheet.middle(vertices)));
            tiles[tile - grid.first_tile].vertices.extend(vertices);
            tile
        };
        for &point in &sheet.sheet.points {
            self.of_points[point] = assign(&[sheet.mesh.points()[point]]);
        }
        for &triangle in &sheet.sheet.triangles {
            self.of_triangles[triangle] = assign(&sheet.mesh.triangles()[triangle]);
        }
        for &edge in &sheet.sheet.edges {
            self.of_edges[edge] = assign(&sheet.mesh.edges()[edge]);
        }
        for tile in &mut tiles {
            tile.grid = self.grids.len();
            tile.surroundings.clone_from(&tile.vertices);
            tile.surroundings.extend(tile.triangles.iter().flat_map(|triangle| triangle.corners));
            for vertices in [&mut tile.vertices, &mut tile.surroundings] {
                vertices.sort_unstable();
                vertices.dedup();
            }
        }
        self.tiles.extend(tiles);
        self.grids.push(grid);
        let [columns, rows] = grid.blocks();
        for block in (0..rows).flat_map(|row| (0..columns).map(move |column| [column, row])) {
            let tiles: Vec<_> = grid.tiles_of(block).collect();
            let is_covered = tiles.iter().all(|tile| !self.tiles[*tile].triangles.is_empty());
            self.blocks.push(if is_covered { tiles } else { Vec::new() });
        }
    }

    /// Gives up all knowledge of shapes, which costs time on every search.
    pub fn forget_triangles(&mut self) {
        self.tiles.iter_mut().for_each(|tile| tile.triangles.clear());
        self.blocks.iter_mut().for_each(Vec::clear);
    }

    /// The tile of a feature of cloth or hair.
    pub fn tile_of(&self, kind: Kind, number: usize) -> usize {
        match kind {
            Kind::Point => self.of_points[number],
            Kind::Triangle => self.of_triangles[number],
            Kind::Edge => self.of_edges[number],
        }
    }

    /// Returns the blocks that contain two tiles.
    pub fn blocks_with(&self, one: usize, other: usize) -> impl Iterator<Item = usize> {
        let (one, other) = (&self.tiles[one], &self.tiles[other]);
        let grid = self.grids[one.grid];
        let is_one_grid = one.grid == other.grid;
        let [columns, rows] = std::array::from_fn(|axis| {
            // The tiles are the first or the last of the block along an axis.
            let (first, last) = (one.at[axis].min(other.at[axis]), one.at[axis].max(other.at[axis]));
            let end = (first + 1).min(grid.blocks()[axis]);
            if is_one_grid { last.saturating_sub(1).min(end)..end } else { 0..0 }
        });
        rows.flat_map(move |row| columns.clone().map(move |column| grid.block([column, row])))
    }
}

impl Grid {
    fn tile(&self, [column, row]: [usize; 2]) -> usize {
        self.first_tile + row * self.size[0] + column
    }

    /// The numbers of columns and rows of blocks. A row of tiles is a row of blocks, too.
    fn blocks(&self) -> [usize; 2] {
        self.size.map(|tiles| (tiles - 1).max(1))
    }

    fn block(&self, [column, row]: [usize; 2]) -> usize {
        self.first_block + row * self.blocks()[0] + column
    }

    fn tiles_of(&self, [column, row]: [usize; 2]) -> impl Iterator<Item = usize> {
        let [columns, rows] = self.size;
        let columns = column..(column + 2).min(columns);
        (row..(row + 2).min(rows)).flat_map(move |row| columns.clone().map(move |column| self.tile([column, row])))
    }
}

/// A sheet in its plane.
struct Projected<'a> {
    mesh: &'a CollisionMesh,
    sheet: Sheet,
    /// The point of each vertex in the plane.
    points: &'a [PlanePoint],
}

impl Projected<'_> {
    fn point(&self, vertex: u32) -> PlanePoint {
        self.points[vertex as usize]
    }

    fn middle(&self, vertices: &[u32]) -> PlanePoint {
        let mean = |axis: usize| vertices.iter().map(|vertex| self.point(*vertex)[axis]).sum::<f64>();
        [mean(0), mean(1)].map(|sum| sum / vertices.len() as f64)
    }

    fn hull(&self, vertices: impl Iterator<Item = u32>) -> Rectangle {
        vertices.map(|vertex| self.point(vertex)).fold(Rectangle::EMPTY, Rectangle::with)
    }

    /// The vertices of the sheet.
    fn vertices(&self) -> impl Iterator<Item = u32> {
        self.sheet.points.iter().map(|&point| self.mesh.points()[point])
    }

    /// Whether the two triangles of an edge are on different sides of it.
    fn continues_across(&self, edge: usize) -> bool {
        let [a, b] = self.mesh.edges()[edge].map(|vertex| self.point(vertex));
        let height = |apex: u32| doubled_area([a, b, self.point(apex)]);
        matches!(*self.mesh.apexes(edge), [p, q] if height(p) * height(q) < 0.0)
    }
}

/// How a sheet is divided.
struct Frame {
    around: Rectangle,
    /// The numbers of columns and rows.
    size: [usize; 2],
    /// Width and height of a tile, in m.
    tile: [f64; 2],
}

impl Frame {
    fn of(sheet: &Projected<'_>) -> Self {
        let around = sheet.hull(sheet.vertices());
        let length = |edge: &usize| {
            let [a, b] = sheet.mesh.edges()[*edge].map(|vertex| sheet.point(vertex));
            (b[0] - a[0]).hypot(b[1] - a[1])
        };
        let edges = &sheet.sheet.edges;
        let mean = edges.iter().map(length).sum::<f64>() / edges.len() as f64;
        let most = edges.len() as f64;
        // `max` takes 1 for NaN.
        let count = |axis: usize, width: f64| (around.length(axis) / width).round().max(1.0).min(most);
        // A narrow ring fills little of its rectangle.
        let sparse = (count(0, WIDTH * mean) * count(1, WIDTH * mean) / (MOST_TILES * most)).sqrt().max(1.0);
        let count = |axis: usize| count(axis, sparse * WIDTH * mean) as usize;
        // Hair extends along one axis.
        let size = [count(0), if sheet.sheet.triangles.is_empty() { 1 } else { count(1) }];
        Self { around, size, tile: [0, 1].map(|axis| around.length(axis) / size[axis] as f64) }
    }

    /// Column and row of the tile around a point.
    fn cell(&self, point: PlanePoint) -> [usize; 2] {
        [0, 1].map(|axis| self.along(axis, point[axis]))
    }

    fn along(&self, axis: usize, coordinate: f64) -> usize {
        // The cast of a negative number is 0.
        (((coordinate - self.around.low[axis]) / self.tile[axis]) as usize).min(self.size[axis] - 1)
    }

    fn rectangle(&self, at: [usize; 2]) -> Rectangle {
        let corner =
            |further: usize| [0, 1].map(|axis| self.around.low[axis] + self.tile[axis] * (at[axis] + further) as f64);
        Rectangle { low: corner(0), high: corner(1) }
    }

    /// How far a feature extends beyond its tile.
    fn overhang(&self, sheet: &Projected<'_>, vertices: &[u32]) -> f64 {
        let (hull, tile) = (sheet.hull(vertices.iter().copied()), self.rectangle(self.cell(sheet.middle(vertices))));
        (0..2).map(|axis| (tile.low[axis] - hull.low[axis]).max(hull.high[axis] - tile.high[axis])).fold(0.0, f64::max)
    }

    /// The columns and rows of the tiles that come within `overhang` of a rectangle.
    fn near(&self, rectangle: &Rectangle, overhang: f64) -> [RangeInclusive<usize>; 2] {
        [0, 1].map(|axis| {
            self.along(axis, rectangle.low[axis] - overhang)..=self.along(axis, rectangle.high[axis] + overhang)
        })
    }

    /// Returns the tiles with their triangles.
    fn tiles(&self, sheet: &Projected<'_>) -> Vec<Tile> {
        let Projected { mesh, sheet: Sheet { triangles, edges, .. }, .. } = sheet;
        let of_triangles = triangles.iter().map(|&triangle| &mesh.triangles()[triangle][..]);
        let features = of_triangles.chain(edges.iter().map(|&edge| &mesh.edges()[edge][..]));
        let most = MOST_OVERHANG * self.tile[0].max(self.tile[1]);
        let (mut overhang, mut long) = (0.0_f64, Vec::new());
        for vertices in features {
            match self.overhang(sheet, vertices) {
                own if own <= most => overhang = overhang.max(own),
                _ => long.push(vertices),
            }
        }
        let [columns, rows] = self.size;
        let at = (0..rows).flat_map(|row| (0..columns).map(move |column| [column, row]));
        let hulls: Vec<_> = at.clone().map(|at| self.rectangle(at).extended(overhang).within(&self.around)).collect();
        let mut tiles: Vec<_> = at.map(|at| Tile { at, height: f64::INFINITY, ..Tile::default() }).collect();
        let mut covered = vec![0.0; tiles.len()];
        let near = |vertices: &[u32]| {
            let hull = sheet.hull(vertices.iter().copied());
            let [near_columns, near_rows] = self.near(&hull, overhang);
            let numbers = near_rows.flat_map(move |row| near_columns.clone().map(move |column| row * columns + column));
            (hull, numbers)
        };
        for &triangle in triangles {
            let corners = mesh.triangles()[triangle];
            let points = corners.map(|vertex| sheet.point(vertex));
            let (hull, numbers) = near(&corners);
            for tile in numbers.filter(|tile| hulls[*tile].has_inside(&hull)) {
                tiles[tile].height = tiles[tile].height.min(least_height(points));
                tiles[tile].triangles.push(Reference { corners, inverse: inverse(points) });
                covered[tile] += hulls[tile].common_area(points);
            }
        }
        let is_one = |covered: f64, area: f64| (covered - area).abs() <= COVERED * area;
        let mut is_covered: Vec<_> =
            hulls.iter().zip(&covered).map(|(hull, area)| is_one(*area, hull.area())).collect();
        for &edge in edges.iter().filter(|edge| !sheet.continues_across(**edge)) {
            let (hull, numbers) = near(&mesh.edges()[edge]);
            numbers.for_each(|tile| is_covered[tile] &= !hulls[tile].has_inside(&hull));
        }
        for vertices in long {
            let [column, row] = self.cell(sheet.middle(vertices));
            is_covered[row * columns + column] = false;
        }
        for (tile, is_covered) in tiles.iter_mut().zip(is_covered) {
            if !is_covered || tile.height <= 0.0 {
                tile.triangles.clear();
            }
        }
        tiles
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Diagonals, Plane, Sheet};

    fn sheet(cells: [usize; 2]) -> (Vec<[usize; 3]>, Vec<Vector3<f64>>) {
        let plane = Plane::Horizontal;
        let sheet =
            Sheet { cells, size: [1.0, 0.7], diagonals: Diagonals::Regular, plane, pleats: None }.mesh().unwrap();
        (sheet.triangles().to_vec(), sheet.vertices().to_vec())
    }

    /// Whether each block is covered.
    fn covered(triangles: &[[usize; 3]], x: &[Vector3<f64>]) -> Vec<bool> {
        let tiling = Tiling::new(&CollisionMesh::new(x.len(), triangles, &[], &[]), x);
        tiling.blocks.iter().map(|tiles| !tiles.is_empty()).collect()
    }

    #[test]
    fn a_sheet_is_covered_whatever_its_cells() {
        for cells in [[1, 1], [2, 7], [30, 30], [31, 17], [33, 35]] {
            let (triangles, x) = sheet(cells);
            assert!(!covered(&triangles, &x).contains(&false), "{cells:?}");
        }
    }

    #[test]
    fn holes_slits_and_folds_are_not_covered() {
        let (triangles, x) = sheet([32, 32]);
        let count = |triangles: &[[usize; 3]], x: &[Vector3<f64>]| {
            covered(triangles, x).into_iter().filter(|is_covered| !is_covered).count()
        };
        assert_eq!(count(&triangles, &x), 0);
        let holed: Vec<_> = triangles.iter().copied().enumerate().filter(|(n, _)| *n != 1100).map(|(_, t)| t).collect();
        // At most the nine tiles around the hole, and so the blocks with one of them.
        assert!((1..=16).contains(&count(&holed, &x)), "{}", count(&holed, &x));
        // A slit along an edge: one triangle has its own vertex.
        let mut slit = triangles.clone();
        slit[1100][0] = x.len();
        let with_double = [&x[..], &[x[triangles[1100][0]]]].concat();
        assert!((1..=16).contains(&count(&slit, &with_double)), "{}", count(&slit, &with_double));
        let folded: Vec<_> =
            x.iter().map(|&[a, b, _]| [(a - 0.1).abs(), b, if a > 0.1 { 0.01 } else { 0.0 }]).collect();
        assert!(count(&triangles, &folded) > 20);
    }

    #[test]
    fn one_long_triangle_leaves_the_tiles_of_a_fine_mesh_small() {
        let (mut triangles, mut x) = sheet([64, 64]);
        // A flag of 20 cells at a corner.
        x.extend([[-0.8, -0.35, 0.0], [-0.8, -0.34, 0.0]]);
        triangles.push([0, x.len() - 2, x.len() - 1]);
        let count = |triangles: &[[usize; 3]]| {
            let tiling = Tiling::new(&CollisionMesh::new(x.len(), triangles, &[], &[]), &x);
            let held = tiling.tiles.iter().map(|tile| tile.triangles.len()).sum::<usize>();
            (held, tiling.blocks.iter().filter(|tiles| !tiles.is_empty()).count())
        };
        let (regular, flagged) = (count(&triangles[..triangles.len() - 1]), count(&triangles));
        assert!(flagged.0 < 2 * regular.0, "{flagged:?} {regular:?}");
        assert!(10 * flagged.1 > 9 * regular.1, "{flagged:?} {regular:?}");
    }

    #[test]
    fn a_narrow_ring_has_far_fewer_tiles_than_edges() {
        const CELLS: usize = 3000;
        let point = |number: usize| {
            let (angle, radius) =
                ((number / 2) as f64 / CELLS as f64 * std::f64::consts::TAU, 1.0 + 2e-3 * (number % 2) as f64);
            [radius * angle.cos(), radius * angle.sin(), 0.0]
        };
        let x: Vec<Vector3<f64>> = (0..2 * CELLS).map(point).collect();
        let corner = |number: usize| number % (2 * CELLS);
        let cell = |cell: usize| [[2 * cell, 2 * cell + 1, 2 * cell + 2], [2 * cell + 1, 2 * cell + 3, 2 * cell + 2]];
        let triangles: Vec<_> = (0..CELLS).flat_map(cell).map(|corners| corners.map(corner)).collect();
        let tiling = Tiling::new(&CollisionMesh::new(x.len(), &triangles, &[], &[]), &x);
        assert!((CELLS / 4..CELLS).contains(&tiling.tiles.len()), "{}", tiling.tiles.len());
    }
}
