use std::ops::Range;

use energy_dsl::Vector3;

use super::picture::{View, shadow_of};
use super::projection::Camera;
use super::style::{camera_on, garment_colour, is_visible};
use super::{Look, PictureError, SolidMesh, picture_png};
use crate::contact::{AnySolid, Obstacle};
use crate::geometry::{Bounds, dot};
use crate::model::PartKind;
use crate::scene::Style;
use crate::simulation::Simulation;

/// The content of pictures except positions: triangles, strands and obstacles. Owns its data, so that another thread
/// can draw while the simulation goes on.
#[derive(Clone, Debug)]
pub struct Scenery {
    triangles: Vec<[usize; 3]>,
    strands: Vec<Range<usize>>,
    /// Width of each strand, in m.
    widths: Vec<f64>,
    /// The colour of each vertex; `None` for hair without one.
    colours: Vec<Option<[f32; 3]>>,
    obstacles: Vec<Obstacle>,
    style: Style,
}

/// The part of space that pictures show.
#[derive(Clone, Copy, Debug)]
pub struct Framing {
    /// A box around the vertices, for the visible part of planes.
    bounds: Bounds,
    style: Style,
    /// For pictures of a sequence; `None` to frame what is visible in each picture.
    steady: Option<Steady>,
}

/// The view that all pictures of a sequence share.
#[derive(Clone, Copy, Debug)]
struct Steady {
    camera: Camera,
    /// Height of the floor, in m.
    floor: f64,
    /// The smallest height that is shown, in m: that of the floor, unless it is an obstacle.
    lowest: f64,
}

impl Framing {
    /// The camera of each picture frames what is visible in it. Planes are shown around `bounds`.
    pub(crate) fn loose(bounds: Bounds) -> Self {
        Self { bounds, style: Style::default(), steady: None }
    }

    /// Frames these points and their shadows, with one camera for all pictures of a sequence. `floor` is the height of
    /// a plane below them, in m; `None` without a floor.
    #[must_use]
    pub fn steady(points: &[Vector3<f64>], floor: Option<f64>, style: Style) -> Self {
        let bounds = Bounds::of(points);
        let below = bounds.low[2] - 0.08 * (bounds.high[2] - bounds.low[2]);
        let (floor, lowest) = floor.map_or((below, below), |floor| (floor, f64::NEG_INFINITY));
        let with_shadows: Vec<Vector3<f64>> = points.iter().flat_map(|p| [*p, shadow_of(p, floor)]).collect();
        let camera = camera_on(&style, &with_shadows);
        Self { bounds, style, steady: Some(Steady { camera, floor, lowest }) }
    }

    /// Whether the pictures of a sequence show all these points.
    #[must_use]
    pub fn shows(&self, points: &[Vector3<f64>]) -> bool {
        self.steady.is_some_and(|Steady { camera, floor, lowest }| {
            let is_within = |p: Vector3<f64>| is_visible(&self.style, &camera, p);
            let is_shown = |p: &Vector3<f64>| is_within(*p) && is_within(shadow_of(p, floor));
            points.iter().all(|p| p[2] >= lowest && is_shown(p))
        })
    }

    /// The centre of the bounds, in m.
    pub(crate) fn centre(&self) -> Vector3<f64> {
        std::array::from_fn(|axis| 0.5 * (self.bounds.low[axis] + self.bounds.high[axis]))
    }

    /// The side of the visible part of a plane, in m.
    pub(crate) fn size(&self) -> f64 {
        1.6 * (0..3).map(|axis| self.bounds.high[axis] - self.bounds.low[axis]).fold(0.0, f64::max)
    }
}

/// Whether an obstacle is a floor, which is drawn as the receiver of shadows.
fn floor_height(solid: &AnySolid) -> Option<f64> {
    match solid {
        AnySolid::HalfSpace(plane) if plane.normal[2] > 0.999 => Some(plane.point[2]),
        _ => None,
    }
}

impl Scenery {
    /// Returns the scenery of a simulation.
    #[must_use]
    pub fn of(simulation: &Simulation, style: Style) -> Self {
        let parts = simulation.parts();
        let widths = parts.iter().flat_map(|part| match part.kind {
            PartKind::Hair { joints, width, .. } => vec![width; part.vertices.len() / joints],
            PartKind::Cloth(_) => Vec::new(),
        });
        let colours = parts.iter().enumerate().flat_map(|(number, part)| {
            let colour = part.colour.or(matches!(part.kind, PartKind::Cloth(_)).then(|| garment_colour(number)));
            vec![colour; part.vertices.len()]
        });
        Self {
            triangles: simulation.triangles().to_vec(),
            strands: simulation.strands().to_vec(),
            widths: widths.collect(),
            colours: colours.collect(),
            obstacles: simulation.obstacles().to_vec(),
            style,
        }
    }

    /// Size, camera and background of pictures.
    #[must_use]
    pub fn style(&self) -> Style {
        self.style
    }

    /// Returns the outermost points of cloth and bounded obstacles at a time in s, in 26 directions.
    #[must_use]
    pub fn outermost(&self, positions: &[Vector3<f64>], time: f64) -> Vec<Vector3<f64>> {
        let solids = self.obstacles.iter().map(|obstacle| obstacle.at(time));
        let bounded = solids.filter(|solid| !matches!(solid, AnySolid::HalfSpace(_)));
        let surfaces: Vec<SolidMesh> = bounded.map(|solid| SolidMesh::of(&solid, [0.0; 3], 1.0)).collect();
        let points = || surfaces.iter().flat_map(|surface| &surface.vertices).chain(positions);
        let farthest = |way: Vector3<f64>| points().max_by(|a, b| dot(way, **a).total_cmp(&dot(way, **b))).copied();
        let component = |number: i32, axis: u32| f64::from(number / 3_i32.pow(axis) % 3 - 1);
        (0..27).filter_map(|number| farthest([0, 1, 2].map(|axis| component(number, axis)))).collect()
    }

    /// The height of the highest horizontal plane at a time in s; `None` without such planes.
    #[must_use]
    pub fn floor(&self, time: f64) -> Option<f64> {
        self.obstacles.iter().filter_map(|obstacle| floor_height(&obstacle.at(time))).reduce(f64::max)
    }

    /// Draws the vertices at a time, in s, as PNG. A horizontal plane serves as the floor that receives shadows.
    ///
    /// # Errors
    /// Returns an error if the picture cannot be encoded.
    pub fn picture(
        &self,
        positions: &[Vector3<f64>],
        time: f64,
        framing: &Framing,
        look: &Look<'_>,
    ) -> Result<Vec<u8>, PictureError> {
        let solids: Vec<AnySolid> = self.obstacles.iter().map(|obstacle| obstacle.at(time)).collect();
        let drawn = solids.iter().filter(|solid| floor_height(solid).is_none());
        let drawn: Vec<SolidMesh> = drawn.map(|solid| SolidMesh::of(solid, framing.centre(), framing.size())).collect();
        picture_png(&View {
            positions,
            triangles: &self.triangles,
            strands: &self.strands,
            widths: &self.widths,
            garment_colours: &self.colours,
            solids: &drawn,
            floor: self.floor(time).or(framing.steady.map(|steady| steady.floor)),
            camera: framing.steady.map(|steady| steady.camera),
            look: *look,
            style: self.style,
        })
    }
}
