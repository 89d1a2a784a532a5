use std::ops::Range;

use energy_dsl::Vector3;

use super::picture::{View, shadow_of};
use super::{Look, PictureError, SolidMesh, picture_png};
use crate::contact::{AnySolid, Obstacle};
use crate::geometry::Bounds;
use crate::simulation::Simulation;

/// The content of pictures except positions: triangles, strands and obstacles. Owns its data, so that another thread
/// can draw while the simulation goes on.
#[derive(Clone, Debug)]
pub struct Scenery {
    triangles: Vec<[usize; 3]>,
    strands: Vec<Range<usize>>,
    obstacles: Vec<Obstacle>,
}

/// The part of space that pictures show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Framing {
    bounds: Bounds,
    /// Whether the camera frames `bounds`, for pictures of a sequence. Otherwise it frames what is visible.
    steady: bool,
}

impl Framing {
    /// The visible part of planes is chosen for the points in `bounds`; the camera frames what is visible.
    pub(crate) fn loose(bounds: Bounds) -> Self {
        Self { bounds, steady: false }
    }

    /// The camera frames `bounds`, in every picture alike.
    pub(crate) fn steady(bounds: Bounds) -> Self {
        Self { bounds, steady: true }
    }

    /// The centre of the bounds, in m.
    pub(crate) fn centre(&self) -> Vector3<f64> {
        std::array::from_fn(|axis| 0.5 * (self.bounds.low[axis] + self.bounds.high[axis]))
    }

    /// The side of the visible part of a plane, in m.
    pub(crate) fn size(&self) -> f64 {
        1.6 * (0..3).map(|axis| self.bounds.high[axis] - self.bounds.low[axis]).fold(0.0, f64::max)
    }

    /// The height of the floor below the bounds, in m.
    fn floor(&self) -> f64 {
        let (low, high) = (self.bounds.low[2], self.bounds.high[2]);
        low - 0.08 * (high - low)
    }

    /// The corners of the bounds, and their shadows.
    fn corners_on(&self, floor: f64) -> Vec<Vector3<f64>> {
        let Bounds { low, high } = self.bounds;
        let corner = |number: usize| -> Vector3<f64> {
            std::array::from_fn(|axis| if number >> axis & 1 == 0 { low[axis] } else { high[axis] })
        };
        (0..8).map(corner).flat_map(|corner| [corner, shadow_of(&corner, floor)]).collect()
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
    pub fn of(simulation: &Simulation) -> Self {
        Self {
            triangles: simulation.triangles().to_vec(),
            strands: simulation.strands().to_vec(),
            obstacles: simulation.obstacles().to_vec(),
        }
    }

    /// Returns the smallest box around the vertices and the bounded obstacles at a time, in s.
    pub(crate) fn bounds(&self, positions: &[Vector3<f64>], time: f64) -> Bounds {
        let solids = self.obstacles.iter().map(|obstacle| obstacle.at(time));
        let bounded = solids.filter(|solid| !matches!(solid, AnySolid::HalfSpace(_)));
        let boxes = bounded.map(|solid| Bounds::of(&SolidMesh::of(&solid, [0.0; 3], 1.0).vertices));
        boxes.fold(Bounds::of(positions), Bounds::around)
    }

    /// Draws the vertices at a time, in s. A horizontal plane serves as the floor that receives shadows.
    pub(crate) fn picture(
        &self,
        positions: &[Vector3<f64>],
        time: f64,
        framing: &Framing,
        look: &Look<'_>,
    ) -> Result<Vec<u8>, PictureError> {
        let solids: Vec<AnySolid> = self.obstacles.iter().map(|obstacle| obstacle.at(time)).collect();
        let floor = solids.iter().filter_map(floor_height).reduce(f64::max);
        let drawn = solids.iter().filter(|solid| floor_height(solid).is_none());
        let drawn: Vec<SolidMesh> =
            drawn.map(|solid| SolidMesh::of(solid, framing.centre(), framing.size())).collect();
        let steady_floor = floor.unwrap_or_else(|| framing.floor());
        let framed = if framing.steady { framing.corners_on(steady_floor) } else { Vec::new() };
        picture_png(&View {
            positions,
            triangles: &self.triangles,
            strands: &self.strands,
            solids: &drawn,
            floor: if framing.steady { Some(steady_floor) } else { floor },
            framed: &framed,
            look: *look,
        })
    }
}
