use std::f64::consts::TAU;

use energy_dsl::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{MeshError, TriangleMesh};
use crate::bounded::{Counts, NonNegative, Positive, Real, Reals};

/// How the cells of a sheet are split into triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Diagonals {
    /// Every diagonal runs along (+, +).
    #[default]
    Regular,
    /// Diagonals along (+, +) and (+, −) alternate like a chessboard.
    Alternating,
}

/// The initial plane of a sheet, which is centred on the origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Plane {
    /// The plane z = 0, front upwards.
    #[default]
    Horizontal,
    /// The plane y = 0, second direction along z, front towards −y.
    Vertical,
}

/// A built-in rectangular sheet.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sheet {
    /// Cells along both directions.
    #[serde(with = "Counts::<1, 4096, 2>")]
    pub cells: [usize; 2],
    /// Side lengths, in m.
    #[serde(with = "Reals::<Positive, 2>")]
    pub size: [f64; 2],
    /// `regular` (the default) or `alternating`.
    #[serde(default)]
    pub diagonals: Diagonals,
    /// `horizontal` (the default) or `vertical`.
    #[serde(default)]
    pub plane: Plane,
    /// Initial folds. Default none.
    #[serde(default)]
    pub pleats: Option<Pleats>,
}

/// Regular initial folds across the first direction, out of the sheet's plane. The rest shape stays flat and no cell is
/// stretched: the folds make the sheet narrower.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pleats {
    /// Number of folds.
    #[serde(with = "Real::<Positive>")]
    pub count: f64,
    /// Amplitude out of the plane, in m.
    #[serde(with = "Real::<NonNegative>")]
    pub depth: f64,
}

/// Pleats that need more cloth than there is.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{count} pleats of depth {depth} m need more cloth than {width} m; make them fewer or shallower")]
#[non_exhaustive]
pub struct PleatsError {
    count: f64,
    depth: f64,
    width: f64,
}

impl Sheet {
    /// Returns the vertex at a grid point.
    #[must_use]
    pub fn vertex(&self, column: usize, row: usize) -> usize {
        row * (self.cells[0] + 1) + column
    }

    /// Builds the rest mesh: two triangles per cell, anticlockwise seen from the front.
    ///
    /// # Errors
    /// Returns an error if the number of cells or a side length is 0.
    pub fn mesh(&self) -> Result<TriangleMesh, MeshError> {
        let [columns, rows] = self.cells;
        let vertices = self.sweep(&self.flat());
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

    /// Returns the initial positions, in m.
    ///
    /// # Errors
    /// Returns an error if the pleats are too deep.
    pub fn start(&self) -> Result<Vec<Vector3<f64>>, PleatsError> {
        let Some(Pleats { count, depth }) = self.pleats else { return Ok(self.sweep(&self.flat())) };
        let (columns, width) = (self.cells[0], self.size[0]);
        let spacing = width / columns as f64;
        let depth_at = |column: usize| depth * (TAU * count * column as f64 / columns as f64).sin();
        let mut profile = vec![[0.0; 2]];
        for column in 1..=columns {
            let rise = depth_at(column) - depth_at(column - 1);
            let run = spacing * spacing - rise * rise;
            if run <= 0.0 {
                return Err(PleatsError { count, depth, width });
            }
            profile.push([profile[column - 1][0] + run.sqrt(), depth_at(column)]);
        }
        Ok(self.sweep(&profile))
    }

    /// Returns the profile of a row without pleats: position along the first direction, and out of the plane.
    fn flat(&self) -> Vec<[f64; 2]> {
        let columns = self.cells[0];
        (0..=columns).map(|column| [self.size[0] * column as f64 / columns as f64, 0.0]).collect()
    }

    /// Returns the vertices, given the profile of each row.
    fn sweep(&self, profile: &[[f64; 2]]) -> Vec<Vector3<f64>> {
        let (rows, width) = (self.cells[1], profile.last().map_or(0.0, |last| last[0]));
        let mut vertices = Vec::with_capacity(profile.len() * (rows + 1));
        for row in 0..=rows {
            let b = self.size[1] * (row as f64 / rows as f64 - 0.5);
            vertices.extend(profile.iter().map(|[a, out]| match self.plane {
                Plane::Horizontal => [a - 0.5 * width, b, *out],
                Plane::Vertical => [a - 0.5 * width, -out, b],
            }));
        }
        vertices
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{norm, subtract};

    #[test]
    fn pleats_narrow_the_sheet_without_stretching_it() {
        let mut sheet = Sheet {
            cells: [24, 2],
            size: [1.2, 0.1],
            diagonals: Diagonals::Regular,
            plane: Plane::Vertical,
            pleats: Some(Pleats { count: 3.0, depth: 0.05 }),
        };
        let (mesh, start) = (sheet.mesh().unwrap(), sheet.start().unwrap());
        for edge in [[0, 1], [5, 6], [23, 24], [30, 55]] {
            let length = |at: &[Vector3<f64>]| norm(subtract(at[edge[0]], at[edge[1]]));
            assert!((length(&start) - length(mesh.vertices())).abs() < 1e-15);
        }
        assert!((start[24][0] - start[0][0]) < 1.0);
        sheet.pleats = Some(Pleats { count: 3.0, depth: 0.2 });
        assert!(sheet.start().unwrap_err().to_string().contains("fewer or shallower"));
        sheet.pleats = None;
        assert_eq!(sheet.start().unwrap(), mesh.vertices());
    }
}
