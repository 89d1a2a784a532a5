//! What a scene is made of, put together on one numbering of vertices.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use energy_dsl::Vector3;
use energy_elements::ZeroLengthSpring;
use energy_solve::{ElementList, ForceTerm, ListError, PotentialTerm, Term};

use super::seam::Side;
use super::{Garment, Hair, MeshSourceError, ObstacleError, Pin, PinError, Scene, SeamError, Shape};
use crate::contact::Obstacle;
use crate::fabric::{self, FabricError, Place, Surroundings};
use crate::mesh::{Topology, TriangleMesh};
use crate::motion::Motion;

/// A garment or hair of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// What pins and seams call it.
    pub name: String,
    /// Its vertices.
    pub vertices: Range<usize>,
    /// What it is.
    pub kind: PartKind,
}

/// What a part is.
#[derive(Clone, Debug, PartialEq)]
pub enum PartKind {
    /// Cloth, of this mesh.
    Cloth(TriangleMesh),
    /// Strands, each of that many vertices.
    Hair {
        /// Vertices of a strand.
        joints: usize,
    },
}

/// A pinned vertex that moves.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingPin {
    /// The vertex.
    pub vertex: usize,
    /// Where it is drawn, in m; the motion starts from there.
    pub drawn: Vector3<f64>,
    /// Which of [`Model::motions`].
    pub motion: usize,
}

/// A scene ready to be simulated.
#[derive(Debug)]
pub struct Model {
    /// Garments, then hair.
    pub parts: Vec<Part>,
    /// Positions at the start, in m.
    pub x: Vec<Vector3<f64>>,
    /// Velocities at the start, in m/s; zero for pinned vertices.
    pub v: Vec<Vector3<f64>>,
    /// Masses, in kg.
    pub masses: Vec<f64>,
    /// All triangles.
    pub triangles: Vec<[usize; 3]>,
    /// Whether each vertex is pinned.
    pub pinned: Vec<bool>,
    /// Pinned vertices that move.
    pub moving: Vec<MovingPin>,
    /// How they move.
    pub motions: Vec<Motion>,
    /// Everything that acts.
    pub terms: Vec<Box<dyn Term>>,
    /// What was left out because its stiffness is zero, or there is nothing for it to act on.
    pub left_out: Vec<String>,
    /// What should be known about it.
    pub warnings: Vec<String>,
    /// Solids.
    pub obstacles: Vec<Obstacle>,
}

/// A name that no garment or hair has.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("there is no garment or hair called `{name}`; there are {}", .known.join(", "))]
pub struct UnknownPart {
    /// The name.
    pub name: String,
    /// Those that there are.
    pub known: Vec<String>,
}

/// A scene whose parts do not fit together.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// A shape.
    #[error("{part}: {source}")]
    Mesh {
        /// The garment.
        part: String,
        /// What is wrong.
        source: MeshSourceError,
    },
    /// A fabric.
    #[error("{part}: {source}")]
    Fabric {
        /// The garment.
        part: String,
        /// What is wrong.
        source: FabricError,
    },
    /// Two parts of one name.
    #[error("two garments or hairs are called `{name}`")]
    SameName {
        /// The name.
        name: String,
    },
    /// A pin.
    #[error(transparent)]
    Pin(#[from] PinError),
    /// A seam.
    #[error(transparent)]
    Seam(#[from] SeamError),
    /// The mesh of an obstacle.
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
    /// Hair or stitches that do not fit.
    #[error(transparent)]
    List(#[from] ListError),
}

/// The model while it grows.
struct Builder<'a> {
    scene: &'a Scene,
    model: Model,
    /// The vertices on the edges of cloth.
    edge: Vec<usize>,
    several: bool,
}

impl Model {
    /// Puts a scene together.
    ///
    /// # Errors
    /// When a part is unfit, or a name or vertex does not exist.
    pub fn new(scene: &Scene) -> Result<Self, ModelError> {
        let empty = Self {
            parts: Vec::new(),
            x: Vec::new(),
            v: Vec::new(),
            masses: Vec::new(),
            triangles: Vec::new(),
            pinned: Vec::new(),
            moving: Vec::new(),
            motions: Vec::new(),
            terms: Vec::new(),
            left_out: Vec::new(),
            warnings: Vec::new(),
            obstacles: Vec::new(),
        };
        let several = scene.garments.len() + scene.hair.len() > 1;
        let mut builder = Builder { scene, model: empty, edge: Vec::new(), several };
        for (number, garment) in scene.garments.iter().enumerate() {
            builder.add_garment(number, garment)?;
        }
        for (number, hair) in scene.hair.iter().enumerate() {
            builder.add_hair(number, hair)?;
        }
        builder.check_names()?;
        builder.add_seams()?;
        builder.add_surroundings()?;
        builder.pin()?;
        Ok(builder.model)
    }

    /// The strands of hair, each as its vertices.
    pub fn strands(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.parts.iter().flat_map(|part| {
            let joints = if let PartKind::Hair { joints } = part.kind { joints } else { usize::MAX };
            let starts = part.vertices.clone().step_by(joints).filter(move |_| joints < usize::MAX);
            starts.map(move |start| start..start + joints)
        })
    }
}

impl Builder<'_> {
    fn surroundings(&self) -> Surroundings {
        Surroundings { gravity: self.scene.gravity, drag: self.scene.drag }
    }

    fn add_part(&mut self, name: String, vertices: usize, kind: PartKind) {
        let first = self.model.x.len() - vertices;
        self.model.parts.push(Part { name, vertices: first..first + vertices, kind });
    }

    fn add_garment(&mut self, number: usize, garment: &Garment) -> Result<(), ModelError> {
        let part = garment.name.clone().unwrap_or_else(|| format!("garment {number}"));
        let mesh_error = |source| ModelError::Mesh { part: part.clone(), source };
        let Shape { mesh, start, velocities, springs } = garment.shape(&self.scene.folder).map_err(mesh_error)?;
        let first = self.model.x.len();
        let laid = fabric::terms_at(&garment.fabric, &mesh, &springs, &self.surroundings(), self.place(first, &part));
        self.add_laid(laid.map_err(|source| ModelError::Fabric { part: part.clone(), source })?);
        let model = &mut self.model;
        model.triangles.extend(mesh.triangles().iter().map(|corners| corners.map(|corner| first + corner)));
        model.x.extend(start);
        model.v.extend(velocities);
        self.edge.extend(Topology::of(&mesh).boundary(&mesh).iter().map(|vertex| first + vertex));
        self.add_part(part, mesh.vertices().len(), PartKind::Cloth(mesh));
        Ok(())
    }

    fn add_hair(&mut self, number: usize, hair: &Hair) -> Result<(), ModelError> {
        let part = hair.name.clone().unwrap_or_else(|| format!("hair {number}"));
        let laid = fabric::hair_terms(hair, &self.surroundings(), self.place(self.model.x.len(), &part));
        self.add_laid(laid.map_err(|source| ModelError::Fabric { part: part.clone(), source })?);
        let vertices = hair.vertices();
        let count = vertices.len();
        self.model.v.extend(vec![[0.0; 3]; count]);
        self.model.x.extend(vertices);
        self.add_part(part, count, PartKind::Hair { joints: hair.segments + 1 });
        Ok(())
    }

    /// Where a part stands, and how the names of its terms start.
    fn place(&self, first: usize, part: &str) -> Place {
        Place { first, prefix: if self.several { format!("{part}: ") } else { String::new() } }
    }

    fn add_laid(&mut self, laid: fabric::Garment) {
        let model = &mut self.model;
        model.masses.extend(laid.masses);
        model.terms.extend(laid.terms);
        model.left_out.extend(laid.left_out);
        model.warnings.extend(laid.warnings);
    }

    fn check_names(&self) -> Result<(), ModelError> {
        let mut names = BTreeSet::new();
        match self.model.parts.iter().find(|part| !names.insert(&part.name)) {
            Some(part) => Err(ModelError::SameName { name: part.name.clone() }),
            None => Ok(()),
        }
    }

    fn part(&self, name: &str) -> Result<&Part, UnknownPart> {
        let known = || self.model.parts.iter().map(|part| part.name.clone()).collect();
        let found = self.model.parts.iter().find(|part| part.name == name);
        found.ok_or_else(|| UnknownPart { name: name.to_owned(), known: known() })
    }

    /// The vertices on the edge of a range, counted within it.
    fn edge_within(&self, range: &Range<usize>) -> Vec<usize> {
        self.edge.iter().filter(|vertex| range.contains(vertex)).map(|vertex| vertex - range.start).collect()
    }

    fn add_seams(&mut self) -> Result<(), ModelError> {
        for (seam, description) in self.scene.seams.iter().enumerate() {
            let [first, second] = &description.garments;
            let named = |name: &str| self.part(name).map_err(|error| SeamError::Name { seam, error });
            let ranges = [named(first)?.vertices.clone(), named(second)?.vertices.clone()];
            let edges = [&ranges[0], &ranges[1]].map(|range| self.edge_within(range));
            let side = |at: usize| Side { start: &self.model.x[ranges[at].clone()], edge: &edges[at] };
            let joined = description.joined(seam, [side(0), side(1)])?;
            let pairs: Vec<[usize; 2]> =
                joined.iter().map(|[p, q]| [ranges[0].start + p, ranges[1].start + q]).collect();
            let stitches = vec![ZeroLengthSpring::new(description.stiffness, description.damping); pairs.len()];
            let list = ElementList::new(format!("seam {seam}"), stitches, &pairs)?;
            let term: Box<dyn Term> = if description.damping == 0.0 {
                Box::new(PotentialTerm::new(list))
            } else {
                Box::new(ForceTerm::new(list).with_energy())
            };
            self.model.terms.push(term);
        }
        Ok(())
    }

    fn add_surroundings(&mut self) -> Result<(), ObstacleError> {
        let model = &mut self.model;
        if let Some(wind) = &self.scene.wind {
            if model.triangles.is_empty() {
                model.left_out.push("wind: nothing to act on".to_owned());
            } else {
                model.terms.push(wind.term(&model.triangles));
            }
        }
        let obstacles = self.scene.obstacles.iter().enumerate();
        let obstacles = obstacles.map(|(number, one)| one.obstacle(number, &self.scene.folder));
        model.obstacles = obstacles.collect::<Result<_, _>>()?;
        for obstacle in &model.obstacles {
            model.terms.extend(obstacle.terms(&model.masses));
        }
        Ok(())
    }

    fn pin(&mut self) -> Result<(), ModelError> {
        // The motion of each pinned vertex.
        let mut held: BTreeMap<usize, Option<usize>> = BTreeMap::new();
        for (pin, description) in self.scene.pins.iter().enumerate() {
            let motion = description.motion.as_ref().map(|motion| {
                self.model.motions.push(motion.clone());
                self.model.motions.len() - 1
            });
            for vertex in self.chosen(pin, description)? {
                let same = |other: Option<usize>| {
                    let of = |motion: Option<usize>| motion.map(|number| &self.model.motions[number]);
                    of(other) == of(motion)
                };
                if held.get(&vertex).is_some_and(|&other| !same(other)) {
                    return Err(PinError::Twice { pin, vertex }.into());
                }
                held.entry(vertex).or_insert(motion);
            }
        }
        for vertex in self.roots() {
            held.entry(vertex).or_insert(None);
        }
        let model = &mut self.model;
        model.pinned = (0..model.x.len()).map(|vertex| held.contains_key(&vertex)).collect();
        for (vertex, motion) in held {
            model.v[vertex] = [0.0; 3];
            if let Some(motion) = motion {
                let drawn = model.x[vertex];
                model.moving.push(MovingPin { vertex, drawn, motion });
                model.x[vertex] = model.motions[motion].pose(0.0).applied(drawn);
            }
        }
        Ok(())
    }

    fn chosen(&self, pin: usize, description: &Pin) -> Result<Vec<usize>, PinError> {
        let range = match &description.of {
            Some(name) => self.part(name).map_err(|error| PinError::Name { pin, error })?.vertices.clone(),
            None => 0..self.model.x.len(),
        };
        let edge = self.edge_within(&range);
        let chosen = description.chosen(pin, &self.model.x[range.clone()], &edge)?;
        Ok(chosen.into_iter().map(|vertex| range.start + vertex).collect())
    }

    /// The first two vertices of each rooted strand: they keep its place and direction.
    fn roots(&self) -> Vec<usize> {
        let hairs = self.model.parts.iter().filter(|part| matches!(part.kind, PartKind::Hair { .. }));
        let rooted = hairs.zip(&self.scene.hair).filter(|(_, hair)| hair.rooted);
        let roots = |(part, hair): (&Part, &Hair)| {
            part.vertices.clone().step_by(hair.segments + 1).flat_map(|start| [start, start + 1]).collect::<Vec<_>>()
        };
        rooted.flat_map(roots).collect()
    }
}
