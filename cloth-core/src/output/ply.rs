use energy_dsl::Vector3;

/// Encodes a frame as binary PLY: positions in m and velocities in m/s in single precision, and triangles.
///
/// ```
/// let x = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let file = cloth_core::output::ply_bytes(&x, &[[0.5; 3]; 3], &[[0, 1, 2]]);
/// let head = String::from_utf8_lossy(&file);
/// assert!(head.starts_with("ply\nformat binary_little_endian 1.0\n") && head.contains("element vertex 3\n"));
/// assert_eq!(file.len(), head.find("end_header\n").unwrap() + 11 + 3 * 24 + 13);
/// ```
#[must_use]
pub fn ply_bytes(positions: &[Vector3<f64>], velocities: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Vec<u8> {
    let mut file = b"ply\nformat binary_little_endian 1.0\ncomment lengths in m, velocities in m/s, z up\n".to_vec();
    file.extend(format!("element vertex {}\n", positions.len()).into_bytes());
    for property in ["x", "y", "z", "vx", "vy", "vz"] {
        file.extend(format!("property float {property}\n").into_bytes());
    }
    file.extend(
        format!("element face {}\nproperty list uchar int vertex_indices\nend_header\n", triangles.len()).into_bytes(),
    );
    for (x, v) in positions.iter().zip(velocities) {
        file.extend(x.iter().chain(v).flat_map(|number| (*number as f32).to_le_bytes()));
    }
    for corners in triangles {
        file.push(3);
        file.extend(corners.iter().flat_map(|&corner| (corner as i32).to_le_bytes()));
    }
    file
}
