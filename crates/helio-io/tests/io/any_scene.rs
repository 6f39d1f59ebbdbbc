//! What is asked of any bytes as a scene.toml, in the tests of this crate and by `fuzz/`: a message, or a scene that can
//! be traced.

use std::path::{Path, PathBuf};

use helio_flux::{Element, RayOptions, Rays, Scene, trace_rays};
use helio_io::{FluxScene, IoError, LoadedField, SceneOf, load_field, load_scene};

const FIELD: &str = "[targets.receiver]\ncentre_enu_m = [0, 0, 100]\n[targets.board]\ncentre_enu_m = [0, 2, 60]\n\
    normal_enu = [0, 1, 0]\nwidth_m = 8\nheight_m = 6\n[heliostats]\ntable = \"h.csv\"\naim = \"receiver\"\n\
    mirror_offset_m = 0\n";
/// A receiver of triangles, for scenes that name it.
const MESH: &str =
    "*NODE\n1,-1,-1,9\n2,1,-1,9\n3,1,1,9\n4,-1,1,9\n*ELEMENT,TYPE=S4,ELSET=FRONT\n1,4,3,2,1\n";
/// Larger grids are not traced, for their memory alone takes longer than all else.
const MOST_BINS: usize = 1 << 14;

/// A folder in which scenes are read, with what they may name.
pub struct Place {
    folder: PathBuf,
    field: LoadedField,
    mirror: [Element; 1],
}

impl Place {
    pub fn new(folder: &Path) -> Self {
        let write = |name: &str, text: &str| {
            std::fs::write(folder.join(name), text).expect("a folder that can be written");
        };
        write("field.toml", FIELD);
        write("h.csv", "id,east_m,north_m,up_m\nA1,10,80,4\n");
        write("r.inp", MESH);
        let corners = [
            [-0.5, -0.5, 0.0],
            [0.5, -0.5, 0.0],
            [0.5, 0.5, 0.0],
            [-0.5, 0.5, 0.0],
        ];
        Self {
            folder: folder.to_owned(),
            field: load_field(&folder.join("field.toml")).expect("a field"),
            mirror: [Element::quadrilateral(corners).expect("a square")],
        }
    }

    /// Reads bytes as a scene of a mesh and as one of a field; how often that gave a scene.
    pub fn read(&self, bytes: &[u8]) -> usize {
        let path = self.folder.join("scene.toml");
        // Written over, a file is flushed to the disk by some systems.
        let _ = std::fs::remove_file(&path);
        std::fs::write(&path, bytes).expect("a folder that can be written");
        let scenes = [SceneOf::Mesh, SceneOf::Field(&self.field)];
        let read = scenes.map(|of| self.whole_way(load_scene(&path, of)));
        read.into_iter().map(usize::from).sum()
    }

    fn whole_way(&self, scene: Result<FluxScene, IoError>) -> bool {
        let scene = match scene {
            Ok(scene) => scene,
            Err(error) => {
                let text = error.to_string();
                assert!(
                    !text.is_empty() && text.len() < 5000,
                    "{} bytes",
                    text.len()
                );
                // the message, a line of the file and its mark
                assert!(text.lines().count() <= 3, "{text}");
                assert!(
                    !text.chars().any(|c| c.is_control() && c != '\n'),
                    "{text:?}"
                );
                return false;
            }
        };
        assert!(scene.receiver.area_m2() > 0.0 && scene.receiver.bins() > 0);
        assert!(!scene.files.is_empty());
        let shape = scene.sun.form.shape().expect("numbers were checked");
        if scene.receiver.bins() > MOST_BINS {
            return true;
        }
        let options = RayOptions {
            rays: Rays::Total(64),
            seed: scene.rays.seed,
            threads: 1,
            ..RayOptions::default()
        };
        let lit = Scene {
            elements: &self.mirror,
            receiver: &scene.receiver,
            sun: scene.sun.toward.unwrap_or([0.1, 0.2, 1.0]),
            dni_w_m2: scene.sun.dni_w_m2,
            sun_shape: &shape,
            optical_error: scene.mirror.error,
        };
        let map = trace_rays(&lit, &options).expect("a scene that was checked");
        let account = map.account();
        assert!(account.received_w >= 0.0 && account.spilled_w >= 0.0);
        assert!(account.unaccounted_w().abs() <= 1e-9 * account.incoming_w);
        true
    }
}
