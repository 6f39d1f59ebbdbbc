//! The scene of a call, and numbers instead of its own.

use std::path::{Path, PathBuf};

use helio_io::{FluxScene, SceneMethod, SceneOf, SunForm, load_scene, scene_of_text};
use pyo3::prelude::*;

use crate::failure::Failure;

/// A `scene.toml`, or the text of one that stands nowhere, and numbers instead of its own.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct SceneAsked {
    path: PathBuf,
    text: Option<String>,
    dni_w_m2: Option<f64>,
    half_angle_mrad: Option<f64>,
    rays: Option<u64>,
    seed: Option<u64>,
}

impl SceneAsked {
    pub(super) fn read(&self, of: SceneOf<'_>) -> Result<FluxScene, Failure> {
        let mut scene = match &self.text {
            Some(text) => scene_of_text(Path::new(&self.path), text, of)?,
            None => load_scene(&self.path, of)?,
        };
        self.instead(&mut scene)?;
        Ok(scene)
    }

    fn instead(&self, scene: &mut FluxScene) -> Result<(), Failure> {
        if let Some(dni_w_m2) = self.dni_w_m2 {
            scene.sun.dni_w_m2 = dni_w_m2;
        }
        if let Some(half_angle_mrad) = self.half_angle_mrad {
            let half_angle_rad = 1e-3 * half_angle_mrad;
            scene.sun.form = match scene.sun.form {
                SunForm::Pillbox(_) => SunForm::Pillbox(half_angle_rad),
                SunForm::LimbDarkened(_) => SunForm::LimbDarkened(half_angle_rad),
                other => {
                    let message = format!(
                        "it is of a pillbox or limb-darkened sun; the scene's is {}",
                        other.as_str()
                    );
                    return Err(Failure::of("OptionError", "half_angle_mrad", message));
                }
            };
        }
        let (method, rays) = (scene.rays.method, self.rays.is_some());
        for (wrong, option, of) in [
            (rays && method == SceneMethod::Convolve, "rays", "convolve"),
            (rays && method == SceneMethod::Auto, "rays", "auto"),
            (
                self.seed.is_some() && method == SceneMethod::Convolve,
                "seed",
                "convolve",
            ),
        ] {
            if wrong {
                let message = format!("it is of rays; the scene's method is {of}");
                return Err(Failure::of("OptionError", option, message));
            }
        }
        scene.rays.count = self.rays.unwrap_or(scene.rays.count);
        scene.rays.seed = self.seed.unwrap_or(scene.rays.seed);
        Ok(())
    }
}
