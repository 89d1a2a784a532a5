//! Point caches: the positions of all points in all frames, for programs that have the mesh.

use energy_dsl::Vector3;

/// Encodes frames as a PC2 file (version 1): little-endian, positions in m in single precision, z up. Frame n has the
/// sample number n.
///
/// ```
/// let frames: [&[[f64; 3]]; 2] = [&[[1.0, 2.0, 3.0]], &[[1.5, 2.0, 3.0]]];
/// let file = cloth_core::output::pc2_bytes(&frames);
/// assert!(file.starts_with(b"POINTCACHE2\0") && file.len() == 32 + 2 * 12);
/// assert_eq!(file[44..48], 1.5_f32.to_le_bytes());
/// ```
#[must_use]
pub fn pc2_bytes(frames: &[&[Vector3<f64>]]) -> Vec<u8> {
    let points = frames.first().map_or(0, |frame| frame.len());
    let mut file = b"POINTCACHE2\0".to_vec();
    file.extend(1_i32.to_le_bytes());
    file.extend((points as i32).to_le_bytes());
    // The first frame and the frames per sample.
    file.extend(0_f32.to_le_bytes());
    file.extend(1_f32.to_le_bytes());
    file.extend((frames.len() as i32).to_le_bytes());
    file.extend(frames.iter().flat_map(|frame| frame.as_flattened()).flat_map(|&number| (number as f32).to_le_bytes()));
    file
}

/// Encodes frames as an MDD file: big-endian, the times of all frames in s, then positions in m in single precision,
/// z up.
///
/// ```
/// let frames: [&[[f64; 3]]; 2] = [&[[1.0, 2.0, 3.0]], &[[1.5, 2.0, 3.0]]];
/// let file = cloth_core::output::mdd_bytes(&frames, 25.0);
/// assert_eq!(file[..8], [0, 0, 0, 2, 0, 0, 0, 1]);
/// assert_eq!(file[12..16], 0.04_f32.to_be_bytes());
/// assert_eq!(file[28..32], 1.5_f32.to_be_bytes());
/// ```
#[must_use]
pub fn mdd_bytes(frames: &[&[Vector3<f64>]], frames_per_second: f64) -> Vec<u8> {
    let points = frames.first().map_or(0, |frame| frame.len());
    let mut file = Vec::with_capacity(8 + frames.len() * (4 + 12 * points));
    file.extend((frames.len() as i32).to_be_bytes());
    file.extend((points as i32).to_be_bytes());
    let times = (0..frames.len()).map(|frame| (frame as f64 / frames_per_second) as f32);
    file.extend(times.flat_map(f32::to_be_bytes));
    file.extend(frames.iter().flat_map(|frame| frame.as_flattened()).flat_map(|&number| (number as f32).to_be_bytes()));
    file
}
