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
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| corner + 1);
        line(format_args!("f {a}//{a} {b}//{b} {c}//{c}\n"));
    }
    for strand in strands {
        let joints: Vec<String> = strand.clone().map(|vertex| (vertex + 1).to_string()).collect();
        line(format_args!("l {}\n", joints.join(" ")));
    }
    text
}
