//! Pictures of a frame: depth, model and error side by side.

use std::path::Path;

use crate::body::Mesh;
use crate::depth::{Camera, DepthFileError, DepthImage, render_triangles};

/// An image of 8-bit red, green and blue, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width, in pixels.
    pub width: usize,
    /// Height, in pixels.
    pub height: usize,
    /// Three bytes per pixel.
    pub rgb: Vec<u8>,
}

type Colour = [u8; 3];

const NOTHING: Colour = [255, 255, 255];
/// Measured, but not the model; or the model without a measurement.
const UNMATCHED: Colour = [205, 205, 205];
/// Difference of depth that is drawn in full colour, in m.
const FULL_ERROR: f64 = 0.03;
/// Difference from which on a measurement belongs to something else, in m.
const SOMETHING_ELSE: f64 = 0.15;
/// Depth around the body on each side over which the grey of depths changes, in m.
const DEPTH_RANGE: f64 = 0.4;
/// Grey levels of depths: few, because sensor noise does not compress.
const LEVELS: f64 = 48.0;

/// Draws three panels: the measured depth (near is dark), the model, and the difference. Blue is measured in front of
/// the model, red behind it, both in full colour from 30 mm on; grey is only measured, or only in the model. Each
/// pixel of the picture stands for `reduction` × `reduction` pixels of the image. `None` for a frame without image.
#[must_use]
pub fn frame_picture(image: Option<&DepthImage>, mesh: &Mesh, camera: &Camera, reduction: usize) -> Picture {
    let (model, triangles) = render_triangles(mesh, camera);
    let middle = mesh.centroid().z;
    let step = reduction.max(1);
    let (columns, rows) = (camera.width.div_ceil(step), camera.height.div_ceil(step));
    let mut picture = Picture { width: 3 * columns, height: rows, rgb: Vec::with_capacity(9 * columns * rows) };
    for row in 0..rows {
        let pixel = |column: usize| {
            [(column * step + step / 2).min(camera.width - 1), (row * step + step / 2).min(camera.height - 1)]
        };
        let measured = |column: usize| image.and_then(|image| image.at(pixel(column)));
        picture
            .rgb
            .extend((0..columns).flat_map(|u| measured(u).map_or(NOTHING, |depth| depth_colour(depth - middle))));
        let shade = |u: usize| {
            let [x, y] = pixel(u);
            triangles[y * camera.width + x].map_or(NOTHING, |triangle| shaded(mesh, triangle))
        };
        picture.rgb.extend((0..columns).flat_map(shade));
        let error = |u: usize| error_colour(measured(u), model.at(pixel(u)));
        picture.rgb.extend((0..columns).flat_map(error));
    }
    picture
}

fn depth_colour(behind: f64) -> Colour {
    let part = (0.5 + behind / (2.0 * DEPTH_RANGE)).clamp(0.0, 1.0);
    [(40.0 + 190.0 * (part * LEVELS).round() / LEVELS) as u8; 3]
}

/// Returns the colour of a triangle lit from the camera.
fn shaded(mesh: &Mesh, triangle: u32) -> Colour {
    let [a, b, c] = mesh.triangles[triangle as usize].map(|vertex| mesh.vertices[vertex as usize]);
    let towards = (b - a).cross(&(c - a)).try_normalize(0.0).map_or(0.0, |normal| normal.dot(&a.normalize()).abs());
    [200.0, 170.0, 140.0].map(|full: f64| (full * (0.25 + 0.75 * towards)) as u8)
}

fn error_colour(measured: Option<f64>, model: Option<f64>) -> Colour {
    let error = match (measured, model) {
        (None, None) => return NOTHING,
        (Some(measured), Some(model)) if (measured - model).abs() < SOMETHING_ELSE => measured - model,
        _ => return UNMATCHED,
    };
    let part = (error / FULL_ERROR).clamp(-1.0, 1.0);
    let full: [f64; 3] = if part < 0.0 { [0.0, 114.0, 178.0] } else { [213.0, 94.0, 0.0] };
    full.map(|full| ((240.0 + (full - 240.0) * part.abs()) / 4.0).round() as u8 * 4)
}

impl Picture {
    /// Encodes the picture as PNG.
    ///
    /// # Errors
    /// If the encoder fails, such as for an empty picture.
    pub fn png(&self) -> Result<Vec<u8>, png::EncodingError> {
        film(std::slice::from_ref(self), 1)
    }
}

/// Encodes pictures of one size as an animated PNG, which repeats; one picture becomes a plain PNG.
///
/// # Errors
/// If the list is empty, the sizes of pictures differ, or the encoder fails.
pub fn film(pictures: &[Picture], per_second: u16) -> Result<Vec<u8>, png::EncodingError> {
    let (width, height) = pictures.first().map_or((0, 0), |picture| (picture.width as u32, picture.height as u32));
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    if pictures.len() > 1 {
        encoder.set_animated(pictures.len() as u32, 0)?;
        encoder.set_frame_delay(1, per_second.max(1))?;
    }
    let mut writer = encoder.write_header()?;
    pictures.iter().try_for_each(|picture| writer.write_image_data(&picture.rgb))?;
    writer.finish()?;
    Ok(file)
}

/// Writes an encoded picture or film completely or not at all.
///
/// # Errors
/// If it could not be encoded, or the file cannot be written.
pub fn write_picture(path: &Path, encoded: Result<Vec<u8>, png::EncodingError>) -> Result<(), DepthFileError> {
    let bytes = encoded.map_err(|source| DepthFileError::Encode { path: path.into(), source })?;
    energy_cli::write_whole(path, &bytes).map_err(|source| DepthFileError::File { path: path.into(), source })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    const CAMERA: Camera = Camera { fx: 10.0, fy: 10.0, cx: 4.5, cy: 1.5, width: 10, height: 4, distortion: None };

    /// A triangle at depth 2 that covers the left half of the image.
    fn left() -> Mesh {
        let vertices = [[-9.0, -9.0, 2.0], [0.0, -9.0, 2.0], [0.0, 99.0, 2.0], [-9.0, 99.0, 2.0]];
        Mesh::new(vertices.map(Vector3::from).to_vec(), vec![[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn the_panels_show_depth_model_and_error() {
        let mut image = DepthImage { width: 10, height: 4, depth: vec![2.03; 40] };
        image.depth[0] = 0.0;
        image.depth[1] = 1.97;
        image.depth[2] = 2.0;
        let picture = frame_picture(Some(&image), &left(), &CAMERA, 1);
        assert_eq!((picture.width, picture.height, picture.rgb.len()), (30, 4, 360));
        let at = |u: usize| <[u8; 3]>::try_from(&picture.rgb[3 * u..][..3]).unwrap();
        assert!(at(0) == NOTHING && at(1) != NOTHING, "depth");
        assert!(at(10 + 2) != NOTHING && at(10 + 7) == NOTHING, "model");
        let [missing, before, right, behind, other] = [0, 1, 2, 3, 7].map(|u| at(20 + u));
        assert!(missing == UNMATCHED && other == UNMATCHED, "{missing:?} {other:?}");
        assert!(before[2] > before[0] && behind[0] > behind[2] && right == [240; 3], "{before:?} {right:?} {behind:?}");
        let half = frame_picture(None, &left(), &CAMERA, 2);
        assert_eq!((half.width, half.height), (15, 2));
    }

    #[test]
    fn a_film_has_its_pictures() {
        let mut picture = frame_picture(None, &left(), &CAMERA, 1);
        let mut pictures = vec![picture.clone()];
        picture.rgb[0] = 7;
        pictures.push(picture);
        let bytes = film(&pictures, 30).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!(reader.info().animation_control.unwrap().num_frames, 2);
        for picture in &pictures {
            let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut rgb).unwrap();
            assert_eq!(rgb, picture.rgb);
        }
        assert!(film(&[], 30).is_err());
    }
}
