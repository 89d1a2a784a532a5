//! A track as Universal Scene Description, in its text format (`.usda`).

use std::io::{BufWriter, Result, Write};
use std::path::Path;

use energy_files::PartFile;
use nalgebra::Vector3;

/// Writes a mesh whose points move, frame by frame. The file appears when it is complete.
#[derive(Debug)]
pub struct UsdWriter {
    file: BufWriter<PartFile>,
}

impl UsdWriter {
    /// Begins a file. `times` has the time code of each frame, in frames from the first one. Points are in the camera's
    /// coordinates (x right, y down, z forwards, m); a rotation by 180° about x shows them with y up, seen by a USD
    /// camera at the origin.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn create(path: &Path, triangles: &[[u32; 3]], frames_per_second: f64, last: f64) -> Result<Self> {
        let mut file = BufWriter::new(PartFile::create(path)?);
        write!(
            file,
            "#usda 1.0\n(\n    defaultPrim = \"Track\"\n    \
             doc = \"Points in the depth camera's coordinates: x right, y down, z forwards, in metres.\"\n    \
             endTimeCode = {last}\n    framesPerSecond = {frames_per_second}\n    metersPerUnit = 1\n    \
             startTimeCode = 0\n    timeCodesPerSecond = {frames_per_second}\n    upAxis = \"Y\"\n)\n\n\
             def Xform \"Track\"\n{{\n    double xformOp:rotateX = 180\n    \
             uniform token[] xformOpOrder = [\"xformOp:rotateX\"]\n\n    \
             def Mesh \"Body\"\n    {{\n        uniform token subdivisionScheme = \"none\"\n        \
             int[] faceVertexCounts = ["
        )?;
        list(&mut file, triangles, |file, _| write!(file, "3"))?;
        write!(file, "]\n        int[] faceVertexIndices = [")?;
        list(&mut file, triangles, |file, [a, b, c]| write!(file, "{a}, {b}, {c}"))?;
        write!(file, "]\n        point3f[] points.timeSamples = {{\n")?;
        Ok(Self { file })
    }

    /// Adds the points of a frame at a time code, with micrometre precision.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn frame(&mut self, time: f64, points: &[Vector3<f64>]) -> Result<()> {
        write!(self.file, "            {time}: [")?;
        list(&mut self.file, points, |file, p| write!(file, "({:.6}, {:.6}, {:.6})", p.x, p.y, p.z))?;
        writeln!(self.file, "],")
    }

    /// Completes the file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<()> {
        write!(self.file, "        }}\n    }}\n}}\n")?;
        self.file.into_inner()?.finish()
    }
}

/// Writes the entries of a list, separated by commas.
fn list<T>(
    file: &mut BufWriter<PartFile>,
    entries: &[T],
    mut write: impl FnMut(&mut BufWriter<PartFile>, &T) -> Result<()>,
) -> Result<()> {
    for (at, entry) in entries.iter().enumerate() {
        if at > 0 {
            file.write_all(b", ")?;
        }
        write(file, entry)?;
    }
    Ok(())
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
