//! The first image shows the model at rest.

use energy_cli::tell;
use fusion_core::body::SkinnedBody;
use fusion_core::depth::{Camera, DepthImage};
use fusion_core::focal_length::{FocalSuggestion, check_focal_length};
use fusion_core::model_size::{SizeFit, fit_size};

/// Compares the model at rest with the first image. Warns if another focal length explains it, and fits the model's
/// size if that explains it better; `keep_size` only warns.
pub fn compared(body: SkinnedBody, camera: &Camera, image: &DepthImage, keep_size: bool) -> SkinnedBody {
    let focal = check_focal_length(&body, camera, image);
    let size = fit_size(&body, camera, image);
    let focal = focal.filter(|focal| size.is_none_or(|size| focal.explained <= size.explained));
    match (focal, size) {
        (Some(found), _) => {
            tell(&format!("warning: {}", focal_warning(camera, &found)));
            body
        }
        (None, Some(found)) => {
            tell(&format!("warning: {}", size_warning(&found, keep_size)));
            if keep_size { body } else { found.applied(&body) }
        }
        (None, None) => body,
    }
}

fn size_warning(found: &SizeFit, kept: bool) -> String {
    let SizeFit { factor, residual, explained, .. } = found;
    let remedy = if kept { "omit --keep-size to scale it" } else { "it was scaled; --keep-size keeps it" };
    format!(
        "the model's size seems wrong: at rest it is {:.1} mm from the first image (median), but {:.1} mm if scaled by \
         {factor:.3}; {remedy}",
        1e3 * residual,
        1e3 * explained,
    )
}

fn focal_warning(camera: &Camera, found: &FocalSuggestion) -> String {
    format!(
        "the focal lengths seem wrong: the model at rest is {:.1} mm from the first image (median), but {:.1} mm with \
         fx = {:.0} and fy = {:.0} in place of {:.0} and {:.0}; check the intrinsics",
        1e3 * found.residual,
        1e3 * found.explained,
        found.factor * camera.fx,
        found.factor * camera.fy,
        camera.fx,
        camera.fy
    )
}
