use std::fmt::Write as _;

use energy_dsl::Vector3;

use super::track::{Joined, Track};
use super::vertex_normals;

/// Formats an animation as USD text (`.usda`): a mesh for each garment and solid, curves for hair, one time sample per
/// frame, and a material for each. Lengths are in m, z is up, and frame n has time code n.
#[must_use]
pub fn usd_text(tracks: &[Track<'_>], frames_per_second: f64) -> String {
    let frames = tracks.iter().map(|track| track.frames.len()).max().unwrap_or(1);
    let mut file = Usd { text: String::new(), names: Vec::new() };
    file.line(format_args!("#usda 1.0\n(\n    defaultPrim = \"scene\"\n    metersPerUnit = 1\n    upAxis = \"Z\""));
    file.line(format_args!("    startTimeCode = 0\n    endTimeCode = {}", frames.saturating_sub(1)));
    file.line(format_args!(
        "    timeCodesPerSecond = {frames_per_second}\n    framesPerSecond = {frames_per_second}\n)\n"
    ));
    file.line(format_args!("def Xform \"scene\"\n{{"));
    tracks.iter().for_each(|track| file.add(track));
    file.add_materials(tracks);
    file.line(format_args!("}}"));
    file.text
}

struct Usd {
    text: String,
    names: Vec<String>,
}

impl Usd {
    fn line(&mut self, arguments: std::fmt::Arguments<'_>) {
        self.text.write_fmt(arguments).expect("writing to a string succeeds");
        self.text.push('\n');
    }

    fn add(&mut self, track: &Track<'_>) {
        let name = self.identifier(track.name);
        let [red, green, blue] = track.colour;
        let bound = "(\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )";
        match track.joined {
            Joined::Triangles(triangles) => {
                self.line(format_args!("    def Mesh \"{name}\" {bound}\n    {{"));
                self.line(format_args!(
                    "        uniform token subdivisionScheme = \"none\"\n        uniform bool doubleSided = 1"
                ));
                let counts = vec!["3"; triangles.len()].join(", ");
                self.line(format_args!("        int[] faceVertexCounts = [{counts}]"));
                let corners: Vec<String> = triangles.iter().flatten().map(usize::to_string).collect();
                self.line(format_args!("        int[] faceVertexIndices = [{}]", corners.join(", ")));
                self.corner_attributes(track, triangles);
                if track.corners.normals.is_none() {
                    self.vertex_normals(track, triangles);
                }
            }
            Joined::Strands(strands) => {
                self.line(format_args!("    def BasisCurves \"{name}\" {bound}\n    {{"));
                self.line(format_args!("        uniform token type = \"linear\""));
                let counts: Vec<String> = strands.iter().map(|strand| strand.len().to_string()).collect();
                self.line(format_args!("        int[] curveVertexCounts = [{}]", counts.join(", ")));
                self.line(format_args!(
                    "        float[] widths = [{}] (\n            interpolation = \"constant\"\n        )",
                    track.width as f32
                ));
            }
        }
        self.line(format_args!("        color3f[] primvars:displayColor = [({red}, {green}, {blue})]"));
        self.line(format_args!("        rel material:binding = </scene/materials/{name}>"));
        self.points(&track.frames);
        if !track.velocities.is_empty() {
            self.samples("vector3f[] velocities", "", &track.velocities, &tuples);
        }
        if !track.contact_forces.is_empty() {
            let at_vertices = "(\n            interpolation = \"vertex\"\n        )";
            self.samples("vector3f[] primvars:contactForce", at_vertices, &track.contact_forces, &tuples);
        }
        self.line(format_args!("    }}"));
    }

    /// Adds a material for each track, as previews show it.
    fn add_materials(&mut self, tracks: &[Track<'_>]) {
        self.line(format_args!("    def Scope \"materials\"\n    {{"));
        let names = std::mem::take(&mut self.names);
        for (name, track) in names.iter().zip(tracks) {
            let [red, green, blue] = track.colour;
            let surface = format!("/scene/materials/{name}/surface");
            self.line(format_args!("        def Material \"{name}\"\n        {{"));
            self.line(format_args!("            token outputs:surface.connect = <{surface}.outputs:surface>\n"));
            self.line(format_args!("            def Shader \"surface\"\n            {{"));
            self.line(format_args!("                uniform token info:id = \"UsdPreviewSurface\""));
            self.line(format_args!("                color3f inputs:diffuseColor = ({red}, {green}, {blue})"));
            self.line(format_args!(
                "                float inputs:metallic = 0\n                float inputs:roughness = 0.85"
            ));
            self.line(format_args!("                token outputs:surface\n            }}\n        }}"));
        }
        self.line(format_args!("    }}"));
    }

    /// Adds smooth normals at the vertices.
    fn vertex_normals(&mut self, track: &Track<'_>, triangles: &[[usize; 3]]) {
        let normals = |frame: &[Vector3<f64>]| tuples(&vertex_normals(frame, triangles));
        let interpolation = "(\n            interpolation = \"vertex\"\n        )";
        match &track.frames[..] {
            [only] => self.line(format_args!("        normal3f[] normals = [{}] {interpolation}", normals(only))),
            frames => self.samples("normal3f[] normals", interpolation, frames, &normals),
        }
    }

    /// Adds an attribute with a value per frame.
    fn samples(
        &mut self,
        attribute: &str,
        metadata: &str,
        frames: &[&[Vector3<f64>]],
        values: &dyn Fn(&[Vector3<f64>]) -> String,
    ) {
        if !metadata.is_empty() {
            self.line(format_args!("        {attribute} {metadata}"));
        }
        self.line(format_args!("        {attribute}.timeSamples = {{"));
        for (number, frame) in frames.iter().enumerate() {
            self.line(format_args!("            {number}: [{}],", values(frame)));
        }
        self.line(format_args!("        }}"));
    }

    /// Adds texture coordinates and normals of the corners of triangles, if a file gave them.
    fn corner_attributes(&mut self, track: &Track<'_>, triangles: &[[usize; 3]]) {
        let varying = "(\n            interpolation = \"faceVarying\"\n        )";
        if let Some(uvs) = &track.corners.uvs {
            let uvs: Vec<String> =
                uvs.iter().flatten().map(|[u, v]| format!("({}, {})", *u as f32, *v as f32)).collect();
            self.line(format_args!("        texCoord2f[] primvars:st = [{}] {varying}", uvs.join(", ")));
        }
        if track.corners.normals.is_some() {
            let split = track.corners.split(triangles);
            let normals = |frame: &[Vector3<f64>]| {
                let normals = split.normals(frame);
                tuples(&split.triangles.iter().flatten().map(|&corner| normals[corner]).collect::<Vec<_>>())
            };
            self.samples("normal3f[] normals", varying, &track.frames, &normals);
        }
    }

    fn points(&mut self, frames: &[&[Vector3<f64>]]) {
        let bounds = |points: &[Vector3<f64>]| {
            let bound = |pick: fn(f64, f64) -> f64, start: f64| -> Vector3<f64> {
                std::array::from_fn(|axis| points.iter().map(|p| p[axis]).fold(start, pick))
            };
            tuples(&[bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY)])
        };
        if let [only] = frames {
            self.line(format_args!("        float3[] extent = [{}]", bounds(only)));
            self.line(format_args!("        point3f[] points = [{}]", tuples(only)));
            return;
        }
        for (attribute, values) in
            [("float3[] extent", &bounds as &dyn Fn(&[Vector3<f64>]) -> String), ("point3f[] points", &tuples)]
        {
            self.samples(attribute, "", frames, values);
        }
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

/// Formats points with the digits of single precision, the type of points in USD.
fn tuples(points: &[Vector3<f64>]) -> String {
    let one = |p: &Vector3<f64>| format!("({}, {}, {})", p[0] as f32, p[1] as f32, p[2] as f32);
    points.iter().map(one).collect::<Vec<_>>().join(", ")
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
