use std::fmt::Write as _;
use std::ops::Range;

use energy_dsl::Vector3;

use super::vertex_normals;

/// Formats a frame as OBJ: vertices in m with 9 digits and normals, hair as polylines.
#[must_use]
pub fn obj_text(positions: &[Vector3<f64>], triangles: &[[usize; 3]], strands: &[Range<usize>]) -> String {
    let mut text = String::with_capacity(80 * positions.len() + 32 * triangles.len());
    let mut line = |arguments: std::fmt::Arguments<'_>| {
        text.write_fmt(arguments).expect("writing to a string succeeds");
    };
    for p in positions {
        line(format_args!("v {:.9} {:.9} {:.9}\n", p[0], p[1], p[2]));
    }
    for n in vertex_normals(positions, triangles) {
        line(format_args!("vn {:.6} {:.6} {:.6}\n", n[0], n[1], n[2]));
    }
    triangles.iter().for_each(|corners| text.push_str(&face_line(corners)));
    strands.iter().for_each(|strand| text.push_str(&strand_line(strand)));
    text
}

/// Returns the last line of every frame with these triangles and strands.
#[must_use]
pub fn last_obj_line(triangles: &[[usize; 3]], strands: &[Range<usize>]) -> String {
    strands.last().map(strand_line).or_else(|| triangles.last().map(face_line)).unwrap_or_default()
}

fn face_line(corners: &[usize; 3]) -> String {
    let [a, b, c] = corners.map(|corner| corner + 1);
    format!("f {a}//{a} {b}//{b} {c}//{c}\n")
}

fn strand_line(strand: &Range<usize>) -> String {
    let joints: Vec<String> = strand.clone().map(|vertex| (vertex + 1).to_string()).collect();
    format!("l {}\n", joints.join(" "))
}
