use serde::Deserialize;

use super::{MeshError, TriangleMesh};

/// How the cells of a sheet are cut into triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Diagonals {
    /// Every diagonal runs along (+, +).
    #[default]
    Regular,
    /// Diagonals along (+, +) and (+, −) alternate like a chessboard.
    Alternating,
}

/// How a sheet lies at the start. It is centred on the origin either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Plane {
    /// In z = 0, the front upwards.
    #[default]
    Horizontal,
    /// In y = 0, the second direction along z, the front towards −y.
    Vertical,
}

/// A rectangular sheet, built in.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sheet {
    /// Cells along its two directions.
    #[serde(deserialize_with = "crate::scene::numbers::cell_counts")]
    pub cells: [usize; 2],
    /// Lengths along its two directions, in m.
    #[serde(deserialize_with = "crate::scene::numbers::positive_pair")]
    pub size: [f64; 2],
    /// `regular` (the default) or `alternating`.
    #[serde(default)]
    pub diagonals: Diagonals,
    /// `horizontal` (the default) or `vertical`.
    #[serde(default)]
    pub plane: Plane,
}

impl Sheet {
    /// The vertex at a grid point.
    #[must_use]
    pub fn vertex(&self, column: usize, row: usize) -> usize {
        row * (self.cells[0] + 1) + column
    }

    /// The sheet as a mesh: two triangles per cell, anticlockwise seen from the front.
    ///
    /// # Errors
    /// When there are no cells or the size is not a positive number.
    pub fn mesh(&self) -> Result<TriangleMesh, MeshError> {
        let [columns, rows] = self.cells;
        let mut vertices = Vec::with_capacity((columns + 1) * (rows + 1));
        for row in 0..=rows {
            for column in 0..=columns {
                let a = self.size[0] * (column as f64 / columns as f64 - 0.5);
                let b = self.size[1] * (row as f64 / rows as f64 - 0.5);
                vertices.push(match self.plane {
                    Plane::Horizontal => [a, b, 0.0],
                    Plane::Vertical => [a, 0.0, b],
                });
            }
        }
        let mut triangles = Vec::with_capacity(2 * columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                let corner = |right, up| self.vertex(column + right, row + up);
                let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                if self.diagonals == Diagonals::Alternating && (row + column) % 2 == 1 {
                    triangles.extend([[a, b, d], [b, c, d]]);
                } else {
                    triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
        TriangleMesh::new(vertices, triangles)
    }
}
