use super::{Sheet, TriangleMesh};

/// Two triangles that share an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hinge {
    /// [x₁, x₂, x₃, x₄]: the two apexes, then the shared edge. The triangle of x₁ traverses the edge from x₃ to x₄.
    /// With E = x₄ − x₃, the normals E × (x₁ − x₃) and −E × (x₂ − x₃) agree if the hinge is flat.
    pub vertices: [usize; 4],
    /// The triangles of x₁ and x₂.
    pub triangles: [usize; 2],
}

/// The edges and hinges of a mesh, both ordered by their vertices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topology {
    /// Every edge once, with the smaller vertex first.
    pub edges: Vec<[usize; 2]>,
    /// One hinge per interior edge.
    pub hinges: Vec<Hinge>,
}

impl Topology {
    /// Finds the edges and hinges of a mesh.
    #[must_use]
    pub fn of(mesh: &TriangleMesh) -> Self {
        let sides = Side::all(mesh);
        let both_ways = || sides.chunk_by(|a, b| a.ends() == b.ends());
        let hinge = |sides: &[Side]| match sides {
            [first, second] => Some(Hinge {
                vertices: [first.apex, second.apex, first.edge[0], first.edge[1]],
                triangles: [first.triangle, second.triangle],
            }),
            _ => None,
        };
        Self {
            hinges: both_ways().filter_map(hinge).collect(),
            edges: both_ways().map(|sides| sides[0].ends()).collect(),
        }
    }

    /// Returns the boundary vertices of a mesh, in ascending order.
    #[must_use]
    pub fn boundary(mesh: &TriangleMesh) -> Vec<usize> {
        let sides = Side::all(mesh);
        let boundary = sides.chunk_by(|a, b| a.ends() == b.ends()).filter(|sides| sides.len() == 1);
        let mut vertices: Vec<usize> = boundary.flat_map(|sides| sides[0].edge).collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices
    }
}

/// A side of a triangle, directed as the triangle traverses it.
struct Side {
    triangle: usize,
    apex: usize,
    edge: [usize; 2],
}

impl Side {
    /// Returns the sides of all triangles, sorted by edge.
    fn all(mesh: &TriangleMesh) -> Vec<Self> {
        let of = |(triangle, &[a, b, c]): (usize, &[usize; 3])| {
            [(a, b, c), (b, c, a), (c, a, b)].map(|(start, end, apex)| Self { triangle, apex, edge: [start, end] })
        };
        let mut sides: Vec<Self> = mesh.triangles().iter().enumerate().flat_map(of).collect();
        // Stable sort: the triangles of an edge keep their order.
        sides.sort_by_key(Self::ends);
        sides
    }

    /// The ends, with the smaller vertex first.
    fn ends(&self) -> [usize; 2] {
        let [start, end] = self.edge;
        [start.min(end), start.max(end)]
    }
}

/// The vertex pairs joined by the springs of a mass–spring fabric.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct SpringNetwork {
    /// Neighbours along warp and weft.
    pub structural: Vec<[usize; 2]>,
    /// Diagonals of the cells.
    pub shear: Vec<[usize; 2]>,
    /// Second neighbours, which approach each other when the fabric bends.
    pub bending: Vec<[usize; 2]>,
}

impl SpringNetwork {
    /// Creates the network of a sheet: structural springs along the grid lines, shear springs along both diagonals of
    /// each cell, bending springs between second neighbours along the grid lines.
    #[must_use]
    pub fn of_sheet(sheet: &Sheet) -> Self {
        let [columns, rows] = sheet.cells.map(|cells| cells + 1);
        let mut network = Self { structural: Vec::new(), shear: Vec::new(), bending: Vec::new() };
        let at = |column, row| sheet.vertex(column, row);
        for row in 0..rows {
            for column in 0..columns {
                let here = at(column, row);
                let (right, up) = (column + 1 < columns, row + 1 < rows);
                let mut join = |pairs: fn(&mut Self) -> &mut Vec<[usize; 2]>, exists: bool, to: (usize, usize)| {
                    if exists {
                        pairs(&mut network).push([here, at(to.0, to.1)]);
                    }
                };
                join(|n| &mut n.structural, right, (column + 1, row));
                join(|n| &mut n.structural, up, (column, row + 1));
                join(|n| &mut n.shear, right && up, (column + 1, row + 1));
                join(|n| &mut n.shear, column > 0 && up, (column.wrapping_sub(1), row + 1));
                join(|n| &mut n.bending, column + 2 < columns, (column + 2, row));
                join(|n| &mut n.bending, row + 2 < rows, (column, row + 2));
            }
        }
        network
    }

    /// Creates the network of any mesh: structural springs along the edges, and bending springs between the apexes of
    /// each hinge, which also resist shear. It has no separate shear springs.
    #[must_use]
    pub fn of_mesh(topology: &Topology) -> Self {
        let apexes = |hinge: &Hinge| [hinge.vertices[0], hinge.vertices[1]];
        Self {
            structural: topology.edges.clone(),
            shear: Vec::new(),
            bending: topology.hinges.iter().map(apexes).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Diagonals, Plane, rest_angle};

    fn sheet(columns: usize, rows: usize) -> Sheet {
        let (diagonals, plane) = (Diagonals::Regular, Plane::Horizontal);
        Sheet { cells: [columns, rows], size: [1.0, 1.0], diagonals, plane, pleats: None }
    }

    #[test]
    fn a_sheet_has_the_edges_and_hinges_that_euler_counts() {
        let mesh = sheet(3, 2).mesh().unwrap();
        let topology = Topology::of(&mesh);
        let (vertices, triangles) = (12, 12);
        assert_eq!(topology.edges.len(), vertices + triangles - 1);
        let boundary = 2 * (3 + 2);
        assert_eq!(topology.hinges.len(), topology.edges.len() - boundary);
        assert!(topology.hinges.iter().all(|hinge| rest_angle(&mesh, hinge) == 0.0));
    }

    #[test]
    fn the_angle_is_positive_when_apexes_turn_against_the_normals() {
        // x₃ = 0 and x₄ on the x axis; apexes on both sides in y; normals up; the second apex is folded down by 0.3
        // rad.
        let (sine, cosine) = 0.3_f64.sin_cos();
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, -cosine, -sine]];
        let mesh = TriangleMesh::new(vertices, vec![[0, 1, 2], [1, 0, 3]]).unwrap();
        let hinge = Topology::of(&mesh).hinges[0];
        assert_eq!(hinge.vertices, [2, 3, 0, 1]);
        assert!((rest_angle(&mesh, &hinge) - 0.3).abs() < 1e-15, "{}", rest_angle(&mesh, &hinge));
    }

    #[test]
    fn springs_of_a_sheet() {
        let network = SpringNetwork::of_sheet(&sheet(3, 2));
        assert_eq!(network.structural.len(), 3 * 3 + 4 * 2);
        assert_eq!(network.shear.len(), 2 * 6);
        assert_eq!(network.bending.len(), 2 * 3 + 4);
        assert!(network.shear.contains(&[1, 4]), "{:?}", network.shear);
    }
}
