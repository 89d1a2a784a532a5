//! The page of an evaluation: table, plot and pictures in one file.

use std::fmt::Write as _;

use anyhow::Result;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use fusion_core::evaluation::TrackErrors;

/// A picture with its caption.
pub struct Shown {
    pub caption: String,
    /// A PNG image, which may be animated.
    pub png: Vec<u8>,
}

const STYLE: &str = "body{font:15px/1.5 sans-serif;max-width:1000px;margin:2em auto;padding:0 1em}\
    table{border-collapse:collapse}th,td{padding:.2em .8em;border-bottom:1px solid #ddd;text-align:right}\
    th:nth-child(-n+2),td:nth-child(-n+2){text-align:left}img,svg{max-width:100%}figure{margin:1.5em 0}";

/// Formats the page. `plot` is SVG; `name` is the track's.
pub fn page(name: &str, rows: &[(&str, &TrackErrors)], plot: &str, pictures: &[Shown]) -> Result<String> {
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>{0}</title>\n<style>{STYLE}</style>\n\
         <h1>{0}</h1>\n<table>\n<tr><th>run<th>vertices<th>mean, mm<th>median, mm<th>95 %, mm<th>share &lt; 25 mm\n",
        escaped(name)
    );
    for (run, errors) in rows {
        for (vertices, one) in [("all", errors.all()), ("visible", errors.visible())] {
            writeln!(
                page,
                "<tr><td>{}<td>{vertices}<td>{:.2}<td>{:.2}<td>{:.2}<td>{:.3}",
                escaped(run),
                one.mean,
                one.median,
                one.p95,
                one.share_below_25
            )?;
        }
    }
    write!(page, "</table>\n<figure>\n{plot}\n</figure>\n")?;
    if !pictures.is_empty() {
        page.push_str(
            "<p>From left to right: measured depth, tracked model, difference. Blue is measured in front of the model, \
             red behind it, in full colour from 30 mm on; grey is only measured, or only in the model.</p>\n",
        );
    }
    for Shown { caption, png } in pictures {
        writeln!(
            page,
            "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"><figcaption>{0}</figcaption></figure>",
            escaped(caption),
            STANDARD.encode(png)
        )?;
    }
    page.push_str("</html>\n");
    Ok(page)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
