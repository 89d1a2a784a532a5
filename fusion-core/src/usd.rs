//! A track as Universal Scene Description, in its text format (`.usda`).

use std::io::{BufWriter, Result};
use std::path::Path;

use energy_files::PartFile;
use nalgebra::Vector3;

/// Writes a mesh whose points move, frame by frame. The file appears when it is complete.
#[derive(Debug)]
pub struct UsdWriter(mesh_io::usd::UsdWriter<BufWriter<PartFile>>);

impl UsdWriter {
    /// Begins a file. `last` is the time code of the last frame, in frames from the first one. Points are in the
    /// camera's coordinates (x right, y down, z forwards, m); a rotation by 180° about x shows them with y up, seen by
    /// a USD camera at the origin.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn create(path: &Path, triangles: &[[u32; 3]], frames_per_second: f64, last: f64) -> Result<Self> {
        let metadata: [(&str, &dyn std::fmt::Display); 8] = [
            ("defaultPrim", &"\"Track\""),
            ("doc", &"\"Points in the depth camera's coordinates: x right, y down, z forwards, in metres.\""),
            ("endTimeCode", &last),
            ("framesPerSecond", &frames_per_second),
            ("metersPerUnit", &1),
            ("startTimeCode", &0),
            ("timeCodesPerSecond", &frames_per_second),
            ("upAxis", &"\"Y\""),
        ];
        let mut usd = mesh_io::usd::UsdWriter::new(BufWriter::new(PartFile::create(path)?), &metadata)?;
        usd.begin(format_args!("def Xform \"Track\""))?;
        usd.line(format_args!("double xformOp:rotateX = 180"))?;
        usd.line(format_args!("uniform token[] xformOpOrder = [\"xformOp:rotateX\"]\n"))?;
        usd.begin(format_args!("def Mesh \"Body\""))?;
        usd.line(format_args!("uniform token subdivisionScheme = \"none\""))?;
        usd.list("int[] faceVertexCounts", triangles.iter().map(|_| 3), "")?;
        usd.list("int[] faceVertexIndices", triangles.as_flattened(), "")?;
        usd.begin_samples("point3f[] points", "")?;
        Ok(Self(usd))
    }

    /// Adds the points of a frame at a time code, with micrometre precision.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn frame(&mut self, time: f64, points: &[Vector3<f64>]) -> Result<()> {
        self.0.sample(time, points.iter().map(|p| format!("({:.6}, {:.6}, {:.6})", p.x, p.y, p.z)))
    }

    /// Completes the file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(self) -> Result<()> {
        self.0.finish()?.into_inner()?.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_appears_when_it_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("track.usda");
        let mut writer = UsdWriter::create(&path, &[[0, 1, 2]], 30.0, 1.5).unwrap();
        for (time, z) in [(0.0, 2.0), (1.5, 2.5)] {
            writer.frame(time, &[Vector3::new(0.0, 0.0, z), Vector3::x(), Vector3::y()]).unwrap();
        }
        assert!(!path.exists());
        writer.finish().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        for part in [
            "#usda 1.0\n",
            "endTimeCode = 1.5\n",
            "timeCodesPerSecond = 30\n",
            "int[] faceVertexIndices = [0, 1, 2]\n",
            "0: [(0.000000, 0.000000, 2.000000), (1.000000, 0.000000, 0.000000), (0.000000, 1.000000, 0.000000)],\n",
            "1.5: [(0.000000, 0.000000, 2.500000)",
        ] {
            assert!(text.contains(part), "{part} not in {text}");
        }
        assert_eq!(text.matches('{').count(), text.matches('}').count());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
