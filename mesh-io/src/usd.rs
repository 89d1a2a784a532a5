//! Universal Scene Description in its text format (`.usda`), written as it comes: no more than a line is held.

use std::fmt::{Arguments, Display};
use std::io::{Result, Write};

/// Writes prims, attributes and time samples. Indents them by four spaces a level.
#[derive(Debug)]
pub struct UsdWriter<W: Write> {
    out: W,
    depth: usize,
}

impl<W: Write> UsdWriter<W> {
    /// Begins a file with the metadata of its stage, in this order.
    ///
    /// # Errors
    /// If the output cannot be written.
    ///
    /// ```
    /// use mesh_io::usd::UsdWriter;
    /// let mut usd = UsdWriter::new(Vec::new(), &[("upAxis", &"\"Z\"")])?;
    /// usd.begin(format_args!("def Mesh \"body\""))?;
    /// usd.list("int[] faceVertexCounts", [3, 3], "")?;
    /// usd.begin_samples("float[] widths", "")?;
    /// usd.sample(0.5, ["1", "2"])?;
    /// let text = String::from_utf8(usd.finish()?).unwrap();
    /// assert!(text.starts_with("#usda 1.0\n(\n    upAxis = \"Z\"\n)\n\ndef Mesh \"body\"\n{\n"));
    /// assert!(text.ends_with("    float[] widths.timeSamples = {\n        0.5: [1, 2],\n    }\n}\n"));
    /// # Ok::<(), std::io::Error>(())
    /// ```
    pub fn new(mut out: W, metadata: &[(&str, &dyn Display)]) -> Result<Self> {
        writeln!(out, "#usda 1.0\n(")?;
        metadata.iter().try_for_each(|(key, value)| writeln!(out, "    {key} = {value}"))?;
        writeln!(out, ")\n")?;
        Ok(Self { out, depth: 0 })
    }

    /// Writes a line.
    ///
    /// # Errors
    /// If the output cannot be written.
    pub fn line(&mut self, line: Arguments<'_>) -> Result<()> {
        let width = 4 * self.depth;
        writeln!(self.out, "{:width$}{line}", "")
    }

    /// Begins a prim. What follows is inside of it, until [`UsdWriter::end`].
    ///
    /// # Errors
    /// If the output cannot be written.
    pub fn begin(&mut self, head: Arguments<'_>) -> Result<()> {
        self.line(head)?;
        self.line(format_args!("{{"))?;
        self.depth += 1;
        Ok(())
    }

    /// Ends the innermost prim or attribute.
    ///
    /// # Errors
    /// If the output cannot be written.
    pub fn end(&mut self) -> Result<()> {
        self.depth -= 1;
        self.line(format_args!("}}"))
    }

    /// Writes an attribute whose value is a list. An empty `interpolation` is left out.
    ///
    /// # Errors
    /// If the output cannot be written.
    pub fn list<T: Display>(
        &mut self,
        attribute: &str,
        entries: impl IntoIterator<Item = T>,
        interpolation: &str,
    ) -> Result<()> {
        write!(self.out, "{:1$}{attribute} = ", "", 4 * self.depth)?;
        self.entries(entries)?;
        self.interpolation(interpolation)?;
        writeln!(self.out)
    }

    /// Begins an attribute with a value per frame, until [`UsdWriter::end`]. An empty `interpolation` is left out.
    ///
    /// # Errors
    /// If the output cannot be written.
    pub fn begin_samples(&mut self, attribute: &str, interpolation: &str) -> Result<()> {
        if !interpolation.is_empty() {
            write!(self.out, "{:1$}{attribute}", "", 4 * self.depth)?;
            self.interpolation(interpolation)?;
            writeln!(self.out)?;
        }
        self.line(format_args!("{attribute}.timeSamples = {{"))?;
        self.depth += 1;
        Ok(())
    }

    /// Adds the value of a frame at a time code.
    ///
    /// # Errors
    /// If the output cannot be written.
    pub fn sample<T: Display>(&mut self, time: impl Display, entries: impl IntoIterator<Item = T>) -> Result<()> {
        write!(self.out, "{:1$}{time}: ", "", 4 * self.depth)?;
        self.entries(entries)?;
        writeln!(self.out, ",")
    }

    /// Ends all prims, and returns the output.
    ///
    /// # Errors
    /// If the output cannot be written.
    pub fn finish(mut self) -> Result<W> {
        while self.depth > 0 {
            self.end()?;
        }
        Ok(self.out)
    }

    fn interpolation(&mut self, interpolation: &str) -> Result<()> {
        if interpolation.is_empty() {
            return Ok(());
        }
        let (outer, inner) = (4 * self.depth, 4 * self.depth + 4);
        write!(self.out, " (\n{:inner$}interpolation = \"{interpolation}\"\n{:outer$})", "", "")
    }

    fn entries<T: Display>(&mut self, entries: impl IntoIterator<Item = T>) -> Result<()> {
        write!(self.out, "[")?;
        for (at, entry) in entries.into_iter().enumerate() {
            write!(self.out, "{}{entry}", if at == 0 { "" } else { ", " })?;
        }
        write!(self.out, "]")
    }
}
