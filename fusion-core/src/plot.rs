//! A picture of a track's errors.

use plotters::prelude::*;

use crate::evaluation::{ErrorSummary, TrackErrors};

/// Mean, median and 95th percentile of each frame, mm, as an SVG.
///
/// # Errors
/// When there is nothing to draw: no frames, or errors that are not finite.
pub fn errors_svg(errors: &TrackErrors) -> Result<String, String> {
    let summaries: Vec<ErrorSummary> = errors.frames.iter().map(|frame| ErrorSummary::of(frame.all.clone())).collect();
    let highest = summaries.iter().map(|one| one.p95.max(one.mean)).fold(0.0, f64::max);
    if summaries.is_empty() || summaries.iter().any(|one| !one.mean.is_finite()) {
        return Err("no frames with finite errors to draw".into());
    }
    let mut text = String::new();
    draw(&mut text, &summaries, highest.max(1e-3)).map_err(|error| error.to_string())?;
    Ok(text)
}

/// Name, colour, and what is drawn.
type Line = (&'static str, RGBColor, fn(&ErrorSummary) -> f64);

fn draw(text: &mut String, summaries: &[ErrorSummary], highest: f64) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::with_string(text, (800, 420)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption("end-point error", ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(1.0..(summaries.len().max(2) as f64), 0.0..1.05 * highest)?;
    chart.configure_mesh().x_desc("frame").y_desc("mm").light_line_style(WHITE).draw()?;
    let lines: [Line; 3] = [
        ("95 %", RGBColor(204, 121, 167), |one| one.p95),
        ("mean", RGBColor(0, 114, 178), |one| one.mean),
        ("median", RGBColor(0, 158, 115), |one| one.median),
    ];
    for (name, colour, value) in lines {
        let points = summaries.iter().enumerate().map(|(i, one)| ((i + 1) as f64, value(one)));
        chart
            .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK).draw()?;
    area.present()?;
    Ok(())
}
