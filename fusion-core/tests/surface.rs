//! Fused surfaces against the true ones.

use fusion_core::body::{Mesh, SkinnedBody, figure, figure_motion};
use fusion_core::depth::{Camera, SensorNoise, visible_vertices};
use fusion_core::evaluation::{ErrorSummary, SurfaceDistance};
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::protocol::Recording;
use fusion_core::surface::{SurfaceOptions, SurfaceVolume};
use fusion_core::tracker::{Tracker, TrackerOptions};
use nalgebra::Vector3;

/// Returns the figure at rest with a bump of 30 mm on its chest, and the part of the bump at each vertex.
fn with_bump(body: &SkinnedBody) -> (SkinnedBody, Vec<f64>) {
    let mut bumped = body.clone();
    let chest = body.bones.iter().find(|bone| bone.name == "Chest").unwrap();
    let centre = 0.5 * (Vector3::from(chest.head) + Vector3::from(chest.tail)) - Vector3::new(0.0, 0.0, 0.11);
    let part: Vec<f64> =
        body.mesh.vertices.iter().map(|at| (-(at - centre).norm_squared() / (2.0 * 0.04_f64.powi(2))).exp()).collect();
    for (vertex, part) in part.iter().enumerate() {
        bumped.mesh.vertices[vertex] += 0.03 * part * body.mesh.normals[vertex];
    }
    (bumped, part)
}

/// Summarises the distances in mm of the true mesh's visible vertices from a found mesh, over those with a large part
/// in the bump.
fn distances(truth: &Mesh, camera: &Camera, part: &[f64], least: f64, found: &Mesh) -> ErrorSummary {
    let seen = visible_vertices(truth, camera);
    let distance = SurfaceDistance::new(found);
    let on = (0..seen.len()).filter(|&at| seen[at] && part[at] >= least);
    ErrorSummary::of(on.map(|at| 1e3 * distance.of(&truth.vertices[at])).collect())
}

#[test]
fn a_fused_surface_has_the_bump_that_the_model_lacks() {
    const LAST: usize = 12;
    let motions: Vec<_> = (0..=LAST).map(|frame| figure_motion(frame as f64 / 30.0)).collect();
    let plain = Recording::new(&figure(), &motions, Camera::VGA, 2.0);
    let (body, part) = with_bump(&plain.body);
    let recording = Recording { body, ..plain.clone() };
    let model = DeformationModel::new(&plain.body, ModelOptions::default()).unwrap();
    let mut tracker = Tracker::new(model.clone(), recording.camera, TrackerOptions::default().stiffened()).unwrap();
    let mut volume = SurfaceVolume::new(&model, SurfaceOptions::default()).unwrap();
    for frame in 0..=LAST {
        let image = recording.image(frame, SensorNoise::default());
        tracker.track(&image, Some(&recording.motions[frame])).unwrap();
        volume.integrate(&model, &tracker.vertex_motions(), &image, tracker.rays(), 2);
    }
    let fused = volume.mesh();
    let at_rest = fused.vertices.iter().map(|vertex| vertex + model.origin).collect();
    let posed = volume.posed(&model, &tracker.vertex_motions(), &fused.vertices);
    for (name, frame, vertices) in [("at rest", 0, at_rest), ("posed", LAST, posed)] {
        let found = Mesh::new(vertices, fused.triangles.clone());
        let truth = recording.truth(frame);
        let compare = |least: f64, found: &Mesh| distances(&truth, &recording.camera, &part, least, found);
        let (bump, all, model) = (compare(0.5, &found), compare(0.0, &found), compare(0.5, &plain.truth(frame)));
        println!("{name}: bump {:.2} mm, all {:.2} mm, model without bump {:.1} mm", bump.mean, all.mean, model.mean);
        assert!(bump.count >= 8 && bump.mean < 4.0 && model.mean > 15.0, "{name}: {bump:?}, model {model:?}");
        assert!(all.mean < 2.0, "{name}: {all:?}");
    }
}

/// Counts the sides of a mesh that do not belong to exactly two triangles.
fn open_sides(mesh: &Mesh) -> usize {
    let mut sides = std::collections::HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            *sides.entry((p.min(q), p.max(q))).or_insert(0) += 1;
        }
    }
    sides.values().filter(|&&count| count != 2).count()
}

#[test]
fn without_images_the_surface_is_that_of_the_model() {
    let body = figure();
    let model = DeformationModel::new(&body, ModelOptions::default()).unwrap();
    let volume = SurfaceVolume::new(&model, SurfaceOptions::default()).unwrap();
    let mesh = volume.mesh();
    let distance = SurfaceDistance::new(&model.mesh);
    let error = ErrorSummary::of(mesh.vertices.iter().map(|at| 1e3 * distance.of(at)).collect());
    assert!(error.mean < 2.0 && error.p95 < 6.0, "{error:?}");
    let outwards = (0..mesh.vertices.len()).filter(|&at| {
        let nearest = |v: &&Vector3<f64>| (**v - mesh.vertices[at]).norm_squared();
        let vertices = model.mesh.vertices.iter().step_by(4);
        let (near, _) = vertices.enumerate().min_by(|a, b| nearest(&a.1).total_cmp(&nearest(&b.1))).unwrap();
        mesh.normals[at].dot(&model.mesh.normals[4 * near]) > 0.0
    });
    let share = outwards.count() as f64 / mesh.vertices.len() as f64;
    assert!(share > 0.97, "{share} of the normals point outwards");
    assert!(open_sides(&mesh) < mesh.triangles.len() / 1000, "{} open sides", open_sides(&mesh));
}

#[test]
fn a_grid_that_is_too_fine_is_refused() {
    let model = DeformationModel::new(&figure(), ModelOptions::default()).unwrap();
    let refused = |options| SurfaceVolume::new(&model, options).unwrap_err().to_string();
    let mut options = SurfaceOptions::default();
    options.voxel = 1e-4;
    let fine = refused(options);
    assert!(fine.contains("voxels of 0.1 mm") && fine.contains("increase `surface.voxel`"), "{fine}");
    let mut options = SurfaceOptions::default();
    options.reach = 0.01;
    let near = refused(options);
    assert!(near.contains("surface.reach"), "{near}");
}
