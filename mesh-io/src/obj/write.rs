use std::fmt::Write as _;
use std::ops::Range;

/// The parts of an OBJ file that is written.
#[derive(Clone, Copy, Debug)]
pub struct ObjMesh<'a> {
    /// Positions of the vertices, in m.
    pub positions: &'a [[f64; 3]],
    /// Decimal places of the positions.
    pub digits: usize,
    /// Unit normals of the vertices, written with 6 digits; `None` to write none.
    pub normals: Option<&'a [[f64; 3]]>,
    /// Vertices of each triangle.
    pub triangles: &'a [[usize; 3]],
    /// Vertices of each polyline, such as a hair.
    pub strands: &'a [Range<usize>],
}

/// Formats a mesh as OBJ: vertices, normals, triangles, polylines.
#[must_use]
pub fn obj_text(mesh: &ObjMesh<'_>) -> String {
    let ObjMesh { positions, digits, normals, triangles, strands } = *mesh;
    let mut text = String::with_capacity(80 * positions.len() + 32 * triangles.len());
    let mut vectors = |keyword: &str, vectors: &[[f64; 3]], digits: usize| {
        for [x, y, z] in vectors {
            writeln!(text, "{keyword} {x:.digits$} {y:.digits$} {z:.digits$}").expect("writing to a string succeeds");
        }
    };
    vectors("v", positions, digits);
    vectors("vn", normals.unwrap_or_default(), 6);
    triangles.iter().for_each(|corners| text.push_str(&face_line(corners, normals.is_some())));
    strands.iter().for_each(|strand| text.push_str(&strand_line(strand)));
    text
}

/// Returns the last line of every text of these triangles and strands.
#[must_use]
pub fn last_obj_line(triangles: &[[usize; 3]], strands: &[Range<usize>], has_normals: bool) -> String {
    let face = || triangles.last().map(|corners| face_line(corners, has_normals));
    strands.last().map(strand_line).or_else(face).unwrap_or_default()
}

fn face_line(corners: &[usize; 3], has_normals: bool) -> String {
    let [a, b, c] = corners.map(|corner| corner + 1);
    if has_normals { format!("f {a}//{a} {b}//{b} {c}//{c}\n") } else { format!("f {a} {b} {c}\n") }
}

fn strand_line(strand: &Range<usize>) -> String {
    let joints: Vec<String> = strand.clone().map(|vertex| (vertex + 1).to_string()).collect();
    format!("l {}\n", joints.join(" "))
}
