use std::ops::Range;

use plotters::prelude::*;

/// A named curve or point cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// Points (x, y).
    pub points: Vec<(f64, f64)>,
    /// Whether to join the points.
    pub joined: bool,
}

/// Draws curves over logarithmic axes, as SVG. Skips points that are not positive and finite; `None` if none is left.
#[must_use]
pub fn logarithmic(title: &str, (across, up): (&str, &str), curves: &[Curve], size: (u32, u32)) -> Option<String> {
    // Linear axes over logarithms have labels at any range, down to 1e-300.
    let logarithms = |curve: &Curve| -> Vec<(f64, f64)> {
        let shown = curve.points.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0 && x.is_finite() && y.is_finite());
        shown.map(|(x, y)| (x.log10(), y.log10())).collect()
    };
    let all: Vec<(f64, f64)> = curves.iter().flat_map(logarithms).collect();
    let range = |pick: fn(&(f64, f64)) -> f64| {
        let values = all.iter().map(pick);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        low - 0.3..high + 0.3
    };
    if all.is_empty() {
        return None;
    }
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE).ok()?;
        let mut chart = ChartBuilder::on(&root)
            .caption(title, ("sans-serif", 15))
            .margin(8)
            .x_label_area_size(34)
            .y_label_area_size(58)
            .build_cartesian_2d(range(|p| p.0), range(|p| p.1))
            .ok()?;
        let power = |x: &f64| format!("{:.0e}", 10_f64.powf(*x));
        chart
            .configure_mesh()
            .x_desc(across)
            .y_desc(up)
            .x_labels(8)
            .y_labels(8)
            .x_label_formatter(&power)
            .y_label_formatter(&power)
            .light_line_style(WHITE)
            .draw()
            .ok()?;
        for (number, curve) in curves.iter().enumerate() {
            let colour = Palette99::pick(number).to_rgba();
            let points = logarithms(curve);
            if curve.joined {
                chart.draw_series(LineSeries::new(points.clone(), colour.stroke_width(2))).ok()?;
            }
            chart
                .draw_series(points.into_iter().map(|p| Circle::new(p, 3, colour.filled())))
                .ok()?
                .label(curve.name.clone())
                .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
        }
        if curves.len() > 1 {
            chart
                .configure_series_labels()
                .position(emptiest_corner(&all, range(|p| p.0), range(|p| p.1)))
                .background_style(WHITE.mix(0.8))
                .border_style(BLACK.mix(0.3))
                .draw()
                .ok()?;
        }
        root.present().ok()?;
    }
    Some(text)
}

/// Returns the corner in which a legend hides the fewest points.
fn emptiest_corner(points: &[(f64, f64)], across: Range<f64>, up: Range<f64>) -> SeriesLabelPosition {
    let part = |x: f64, range: &Range<f64>| (x - range.start) / (range.end - range.start);
    let corners = [
        (SeriesLabelPosition::UpperRight, 1.0, 1.0),
        (SeriesLabelPosition::UpperLeft, 0.0, 1.0),
        (SeriesLabelPosition::LowerLeft, 0.0, 0.0),
        (SeriesLabelPosition::LowerRight, 1.0, 0.0),
    ];
    let hidden = |x: f64, y: f64| {
        let near = |p: &&(f64, f64)| (part(p.0, &across) - x).abs() < 0.35 && (part(p.1, &up) - y).abs() < 0.45;
        points.iter().filter(near).count()
    };
    let [first, ..] = &corners;
    corners.iter().min_by_key(|(_, x, y)| hidden(*x, *y)).unwrap_or(first).0.clone()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_cannot_be_drawn_are_skipped() {
        let curve = |points: &[(f64, f64)]| [Curve { name: "error".into(), points: points.to_vec(), joined: true }];
        let axes = ("step", "error");
        assert!(logarithmic("", axes, &curve(&[(1.0, 0.0), (f64::NAN, 1.0)]), (300, 200)).is_none());
        let svg = logarithmic("t", axes, &curve(&[(1e-300, 1e-16), (1.0, 1e300)]), (300, 200)).unwrap();
        assert!(svg.starts_with("<svg") && svg.matches("<circle").count() == 2, "{svg}");
    }
}
