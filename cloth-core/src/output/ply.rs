use energy_dsl::Vector3;

/// Encodes a frame as binary PLY, in single precision: positions in m, velocities in m/s, forces of contact in N unless
/// they are empty, and triangles.
///
/// ```
/// let x = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let file = cloth_core::output::ply_bytes(&x, &[[0.5; 3]; 3], &[], &[[0, 1, 2]]);
/// let head = String::from_utf8_lossy(&file);
/// assert!(head.starts_with("ply\nformat binary_little_endian 1.0\n") && head.contains("element vertex 3\n"));
/// assert_eq!(file.len(), head.find("end_header\n").unwrap() + 11 + 3 * 24 + 13);
/// ```
#[must_use]
pub fn ply_bytes(
    positions: &[Vector3<f64>],
    velocities: &[Vector3<f64>],
    forces: &[Vector3<f64>],
    triangles: &[[usize; 3]],
) -> Vec<u8> {
    let mut file = b"ply\nformat binary_little_endian 1.0\ncomment lengths in m, velocities in m/s".to_vec();
    file.extend(if forces.is_empty() { &b", z up\n"[..] } else { b", forces of contact in N, z up\n" });
    file.extend(format!("element vertex {}\n", positions.len()).into_bytes());
    let of_forces = if forces.is_empty() { &[][..] } else { &["fx", "fy", "fz"] };
    for property in ["x", "y", "z", "vx", "vy", "vz"].iter().chain(of_forces) {
        file.extend(format!("property float {property}\n").into_bytes());
    }
    file.extend(
        format!("element face {}\nproperty list uchar int vertex_indices\nend_header\n", triangles.len()).into_bytes(),
    );
    for (vertex, (x, v)) in positions.iter().zip(velocities).enumerate() {
        let force = forces.get(vertex).into_iter().flatten();
        file.extend(x.iter().chain(v).chain(force).flat_map(|number| (*number as f32).to_le_bytes()));
    }
    for corners in triangles {
        file.push(3);
        file.extend(corners.iter().flat_map(|&corner| (corner as i32).to_le_bytes()));
    }
    file
}
