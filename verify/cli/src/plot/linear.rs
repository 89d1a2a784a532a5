use std::ops::Range;

use plotters::prelude::*;

/// Title, labels, ranges and size of a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Axes<'a> {
    /// Text above the plot.
    pub title: &'a str,
    /// Labels of the horizontal and the vertical axis.
    pub labels: (&'a str, &'a str),
    /// Range of the horizontal axis.
    pub across: Range<f64>,
    /// Range of the vertical axis.
    pub up: Range<f64>,
    /// Width and height, in pixels.
    pub size: (u32, u32),
}

/// A named line.
#[derive(Clone, Debug, PartialEq)]
pub struct Line<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Red, green and blue.
    pub colour: (u8, u8, u8),
    /// Points (x, y), joined in order.
    pub points: Vec<(f64, f64)>,
}

/// Draws lines over linear axes, as SVG.
///
/// # Errors
/// If the plot cannot be drawn.
pub fn linear(axes: &Axes<'_>, lines: &[Line<'_>]) -> Result<String, String> {
    let mut text = String::new();
    draw(&mut text, axes, lines).map_err(|error| error.to_string())?;
    Ok(text)
}

fn draw(text: &mut String, axes: &Axes<'_>, lines: &[Line<'_>]) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::with_string(text, axes.size).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(axes.title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(axes.across.clone(), axes.up.clone())?;
    let (across, up) = axes.labels;
    chart.configure_mesh().x_desc(across).y_desc(up).light_line_style(WHITE).draw()?;
    for Line { name, colour: (red, green, blue), points } in lines {
        let style = RGBColor(*red, *green, *blue).stroke_width(2);
        chart
            .draw_series(LineSeries::new(points.iter().copied(), style))?
            .label(*name)
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], style));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK).draw()?;
    area.present()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_line_is_drawn_and_named() {
        let line = |name, y| Line { name, colour: (0, 114, 178), points: vec![(1.0, y), (2.0, 2.0 * y)] };
        let axes = Axes { title: "error", labels: ("frame", "mm"), across: 1.0..2.0, up: 0.0..4.0, size: (300, 200) };
        let svg = linear(&axes, &[line("mean", 1.0), line("median", 2.0)]).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("mean") && svg.contains("median"), "{svg}");
    }
}
