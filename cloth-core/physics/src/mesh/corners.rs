use std::collections::HashMap;

use energy_dsl::Vector3;

use crate::geometry::{cross, norm, subtract};

/// Attributes of the corners of triangles, from a file. They pass through to the outputs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CornerAttributes {
    /// Texture coordinates; `None` if any corner lacks them.
    pub uvs: Option<Vec<[[f64; 2]; 3]>>,
    /// The number of each corner's normal in the file; `None` if any corner lacks a normal. Corners of a vertex with
    /// the same number are shaded smoothly, others have an edge between them.
    pub normals: Option<Vec<[usize; 3]>>,
}

/// Vertices split where texture coordinates or normals differ, for formats with one of each per vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitMesh {
    /// The vertex of the mesh for each split one.
    pub sources: Vec<usize>,
    /// The triangles, with split vertices.
    pub triangles: Vec<[usize; 3]>,
    /// Texture coordinates of the split vertices; empty if the corners lack them.
    pub uvs: Vec<[f64; 2]>,
    /// Numbers from 0 of smoothly shaded corners, one per split vertex.
    pub smooth: Vec<usize>,
}

impl CornerAttributes {
    /// Whether there is anything to pass through.
    pub fn is_empty(&self) -> bool {
        self.uvs.is_none() && self.normals.is_none()
    }

    /// Numbers the smoothly shaded sets of corners.
    fn smooth_sets(&self, triangles: &[[usize; 3]]) -> Vec<[usize; 3]> {
        let mut known = HashMap::new();
        let set = |(triangle, corners): (usize, &[usize; 3])| {
            [0, 1, 2].map(|corner| {
                let normal = self.normals.as_ref().map(|normals| normals[triangle][corner]);
                let next = known.len();
                *known.entry((corners[corner], normal)).or_insert(next)
            })
        };
        triangles.iter().enumerate().map(set).collect()
    }

    /// Splits the vertices of a mesh.
    pub fn split(&self, triangles: &[[usize; 3]]) -> SplitMesh {
        let sets = self.smooth_sets(triangles);
        let (sources, uvs, smooth) = (Vec::new(), Vec::new(), Vec::new());
        let mut split = SplitMesh { sources, triangles: Vec::new(), uvs, smooth };
        let mut known = HashMap::new();
        for (triangle, corners) in triangles.iter().enumerate() {
            split.triangles.push([0, 1, 2].map(|corner| {
                let uv = self.uvs.as_ref().map(|uvs| uvs[triangle][corner]);
                let key = (sets[triangle][corner], uv.map(|uv| uv.map(f64::to_bits)));
                *known.entry(key).or_insert_with(|| {
                    split.sources.push(corners[corner]);
                    split.smooth.push(sets[triangle][corner]);
                    split.uvs.extend(uv);
                    split.sources.len() - 1
                })
            }));
        }
        split
    }
}

impl SplitMesh {
    /// Returns unit normals of the split vertices: the area-weighted mean over the smoothly shaded corners.
    pub fn normals(&self, positions: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut sums = vec![[0.0; 3]; self.smooth.iter().max().map_or(0, |last| last + 1)];
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|corner| positions[self.sources[corner]]);
            let normal = cross(subtract(b, a), subtract(c, a));
            for corner in corners {
                (0..3).for_each(|axis| sums[self.smooth[*corner]][axis] += normal[axis]);
            }
        }
        let unit = |&set: &usize| {
            let length = norm(sums[set]);
            if length > 0.0 && length.is_finite() {
                sums[set].map(|component| component / length)
            } else {
                [0.0, 0.0, 1.0]
            }
        };
        self.smooth.iter().map(unit).collect()
    }
}
