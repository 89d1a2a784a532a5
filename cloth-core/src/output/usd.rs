use std::fmt::Display;
use std::io::Result;

use energy_dsl::Vector3;
use mesh_io::usd::UsdWriter;

use super::track::{Joined, Track};
use super::vertex_normals;

/// Formats an animation as USD text (`.usda`): a mesh for each garment and solid, curves for hair, one time sample per
/// frame, and a material for each. Lengths are in m, z is up, and frame n has time code n.
#[must_use]
pub fn usd_text(tracks: &[Track<'_>], frames_per_second: f64) -> String {
    let text = usd_bytes(tracks, frames_per_second).expect("writing to memory succeeds");
    String::from_utf8(text).expect("names are identifiers")
}

fn usd_bytes(tracks: &[Track<'_>], frames_per_second: f64) -> Result<Vec<u8>> {
    let frames = tracks.iter().map(|track| track.frames.len()).max().unwrap_or(1);
    let metadata: [(&str, &dyn Display); 7] = [
        ("defaultPrim", &"\"scene\""),
        ("metersPerUnit", &1),
        ("upAxis", &"\"Z\""),
        ("startTimeCode", &0),
        ("endTimeCode", &frames.saturating_sub(1)),
        ("timeCodesPerSecond", &frames_per_second),
        ("framesPerSecond", &frames_per_second),
    ];
    let mut usd = Usd { text: UsdWriter::new(Vec::new(), &metadata)?, names: Vec::new() };
    usd.text.begin(format_args!("def Xform \"scene\""))?;
    tracks.iter().try_for_each(|track| usd.add(track))?;
    usd.add_materials(tracks)?;
    usd.text.finish()
}

struct Usd {
    text: UsdWriter<Vec<u8>>,
    /// Names of the tracks so far.
    names: Vec<String>,
}

impl Usd {
    fn add(&mut self, track: &Track<'_>) -> Result<()> {
        let name = self.identifier(track.name);
        let [red, green, blue] = track.colour;
        let bound = "(\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )";
        match track.joined {
            Joined::Triangles(triangles) => {
                self.text.begin(format_args!("def Mesh \"{name}\" {bound}"))?;
                self.text.line(format_args!("uniform token subdivisionScheme = \"none\""))?;
                self.text.line(format_args!("uniform bool doubleSided = 1"))?;
                self.text.list("int[] faceVertexCounts", triangles.iter().map(|_| 3), "")?;
                self.text.list("int[] faceVertexIndices", triangles.as_flattened(), "")?;
                self.corner_attributes(track, triangles)?;
            }
            Joined::Strands(strands) => {
                self.text.begin(format_args!("def BasisCurves \"{name}\" {bound}"))?;
                self.text.line(format_args!("uniform token type = \"linear\""))?;
                self.text.list("int[] curveVertexCounts", strands.iter().map(ExactSizeIterator::len), "")?;
                self.text.list("float[] widths", [track.width as f32], "constant")?;
            }
        }
        self.text.line(format_args!("color3f[] primvars:displayColor = [({red}, {green}, {blue})]"))?;
        self.text.line(format_args!("rel material:binding = </scene/materials/{name}>"))?;
        self.points(&track.frames)?;
        if !track.velocities.is_empty() {
            self.samples("vector3f[] velocities", "", &track.velocities, <[_]>::to_vec)?;
        }
        if !track.contact_forces.is_empty() {
            self.samples("vector3f[] primvars:contactForce", "vertex", &track.contact_forces, <[_]>::to_vec)?;
        }
        self.text.end()
    }

    /// Adds a material for each track, as previews show it.
    fn add_materials(&mut self, tracks: &[Track<'_>]) -> Result<()> {
        let Self { text, names } = self;
        text.begin(format_args!("def Scope \"materials\""))?;
        for (name, track) in names.iter().zip(tracks) {
            let [red, green, blue] = track.colour;
            text.begin(format_args!("def Material \"{name}\""))?;
            let output = format!("/scene/materials/{name}/surface.outputs:surface");
            text.line(format_args!("token outputs:surface.connect = <{output}>\n"))?;
            text.begin(format_args!("def Shader \"surface\""))?;
            text.line(format_args!("uniform token info:id = \"UsdPreviewSurface\""))?;
            text.line(format_args!("color3f inputs:diffuseColor = ({red}, {green}, {blue})"))?;
            text.line(format_args!("float inputs:metallic = 0"))?;
            text.line(format_args!("float inputs:roughness = 0.85"))?;
            text.line(format_args!("token outputs:surface"))?;
            text.end()?;
            text.end()?;
        }
        text.end()
    }

    /// Adds an attribute with vectors per frame.
    fn samples(
        &mut self,
        attribute: &str,
        interpolation: &str,
        frames: &[&[Vector3<f64>]],
        vectors: impl Fn(&[Vector3<f64>]) -> Vec<Vector3<f64>>,
    ) -> Result<()> {
        self.text.begin_samples(attribute, interpolation)?;
        for (number, frame) in frames.iter().enumerate() {
            self.text.sample(number, tuples(&vectors(frame)))?;
        }
        self.text.end()
    }

    /// Adds texture coordinates and normals of the corners of triangles if a file gave them, else smooth normals at the
    /// vertices.
    fn corner_attributes(&mut self, track: &Track<'_>, triangles: &[[usize; 3]]) -> Result<()> {
        let (name, frames) = ("normal3f[] normals", &track.frames);
        if let Some(uvs) = &track.corners.uvs {
            let uvs = uvs.as_flattened().iter().map(|[u, v]| format!("({}, {})", *u as f32, *v as f32));
            self.text.list("texCoord2f[] primvars:st", uvs, "faceVarying")?;
        }
        if track.corners.normals.is_some() {
            let split = track.corners.split(triangles);
            let normals = |frame: &[Vector3<f64>]| {
                let normals = split.normals(frame);
                split.triangles.as_flattened().iter().map(|&corner| normals[corner]).collect()
            };
            return self.samples(name, "faceVarying", frames, normals);
        }
        match &frames[..] {
            [only] => self.text.list(name, tuples(&vertex_normals(only, triangles)), "vertex"),
            frames => self.samples(name, "vertex", frames, |frame| vertex_normals(frame, triangles)),
        }
    }

    fn points(&mut self, frames: &[&[Vector3<f64>]]) -> Result<()> {
        let (extent, points) = ("float3[] extent", "point3f[] points");
        if let [only] = frames {
            self.text.list(extent, tuples(&bounds(only)), "")?;
            return self.text.list(points, tuples(only), "");
        }
        self.samples(extent, "", frames, bounds)?;
        self.samples(points, "", frames, <[_]>::to_vec)
    }

    /// Returns a unique USD identifier: letters, digits and underscores, not starting with a digit.
    fn identifier(&mut self, name: &str) -> String {
        let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let plain = if plain.starts_with(|c: char| c.is_ascii_alphabetic()) { plain } else { format!("_{plain}") };
        let mut unused = if plain == "materials" { "_materials".to_owned() } else { plain.clone() };
        let mut number = 1;
        while self.names.contains(&unused) {
            number += 1;
            unused = format!("{plain}_{number}");
        }
        self.names.push(unused.clone());
        unused
    }
}

/// Returns the smallest and the largest coordinates of points.
fn bounds(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let bound = |pick: fn(f64, f64) -> f64, start: f64| -> Vector3<f64> {
        std::array::from_fn(|axis| points.iter().map(|p| p[axis]).fold(start, pick))
    };
    vec![bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY)]
}

/// Formats points with the digits of single precision, the type of points in USD.
fn tuples(points: &[Vector3<f64>]) -> impl Iterator<Item = String> {
    points.iter().map(|p| format!("({}, {}, {})", p[0] as f32, p[1] as f32, p[2] as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::CornerAttributes;

    #[test]
    fn names_become_unique_identifiers() {
        let triangles = [[0, 1, 2]];
        let corners = CornerAttributes::default();
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]];
        let track = |name| Track {
            name,
            colour: [0.5; 3],
            joined: Joined::Triangles(&triangles),
            corners: &corners,
            frames: vec![&points[..], &points[..]],
            velocities: vec![&points[..], &points[..]],
            contact_forces: vec![&points[..], &points[..]],
            width: 0.0,
        };
        let text = usd_text(&[track("left sleeve"), track("left-sleeve"), track("1st")], 25.0);
        for part in [
            "\"left_sleeve\"",
            "\"left_sleeve_2\"",
            "\"_1st\"",
            "endTimeCode = 1",
            "1: [(0, 0, 0), (1, 0, 0), (0, 1, 0.5)],",
            "vector3f[] velocities.timeSamples = {",
            "vector3f[] primvars:contactForce.timeSamples = {",
            "rel material:binding = </scene/materials/left_sleeve_2>",
            "def Material \"_1st\"",
            "interpolation = \"vertex\"",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert_eq!(text.matches('{').count(), text.matches('}').count());
    }
}
