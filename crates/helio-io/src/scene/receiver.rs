//! `[receiver]` of a scene.

use std::path::{Path, PathBuf};

use helio_flux::mesh::MirrorOptions;
use helio_flux::{Frustum, MeshReceiver, Plane, Receiver};

use super::sections::{WHOLE, conflict, direction, refused};
use super::{MirrorPart, SceneOf, SceneUnit, keys};
use crate::error::{IoError, Problem, said};
use crate::keys::Key;
use crate::meshes::{MeshFiles, load_mesh};
use crate::toml::Section;

/// Rows and columns where none are stated.
const BINS: u64 = 50;

pub(super) fn receiver(
    section: &Section<'_>,
    of: SceneOf<'_>,
    files: &mut Vec<PathBuf>,
    warnings: &mut Vec<String>,
) -> Result<Receiver, IoError> {
    let Some(word) = section.text(&keys::RECEIVER_SHAPE)? else {
        return Err(section.missing(&keys::RECEIVER_SHAPE));
    };
    only_keys_of(section, word)?;
    let known: &[&Key] = keys::OF_SHAPE
        .iter()
        .find(|(shape, _)| *shape == word)
        .map_or(&[], |(_, known)| known);
    let built = match word {
        "cylinder" | "cone" => round(section, word)?.map(Receiver::Frustum),
        "mesh" => return mesh(section, files, warnings),
        "target" => target(section, of)?.map(Receiver::Plane),
        _ => plane(section)?.map(Receiver::Plane),
    };
    built.map_err(|error| refused(section, known, &keys::RECEIVER_SHAPE, &error))
}

type Built<T> = Result<Result<T, helio_flux::FluxError>, IoError>;

fn only_keys_of(section: &Section<'_>, word: &str) -> Result<(), IoError> {
    for (_, keys_of_other) in keys::OF_SHAPE.iter().filter(|(shape, _)| *shape != word) {
        for key in *keys_of_other {
            let own = keys::OF_SHAPE
                .iter()
                .any(|(shape, known)| *shape == word && known.iter().any(|k| k.name == key.name));
            if !own && section.has(key) {
                let message = format!(
                    "{} does not go with shape = \"{word}\"",
                    section.dotted(key)
                );
                return Err(conflict(section, key, message));
            }
        }
    }
    Ok(())
}

fn needed(section: &Section<'_>, key: &Key) -> Result<f64, IoError> {
    section.number(key)?.ok_or_else(|| section.missing(key))
}

fn point(section: &Section<'_>, key: &Key) -> Result<[f64; 3], IoError> {
    let point = section.enu(key, keys::FAR_M)?;
    point.ok_or_else(|| section.missing(key))
}

fn grid(section: &Section<'_>) -> Result<[usize; 2], IoError> {
    let count = |key| Ok::<usize, IoError>(section.whole(key, WHOLE)?.unwrap_or(BINS) as usize);
    Ok([count(&keys::ROWS)?, count(&keys::COLUMNS)?])
}

fn plane(section: &Section<'_>) -> Built<Plane> {
    let centre_m = point(section, &keys::CENTRE)?;
    let facing =
        direction(section, &keys::FACING)?.ok_or_else(|| section.missing(&keys::FACING))?;
    let right = direction(section, &keys::RIGHT)?.unwrap_or_else(|| level(facing));
    let size_m = [
        needed(section, &keys::RECEIVER_WIDTH)?,
        needed(section, &keys::RECEIVER_HEIGHT)?,
    ];
    Ok(Plane::new(centre_m, facing, right, size_m, grid(section)?))
}

/// To the right of a camera that faces a plane and stands upright; x if the plane is level.
fn level([x, y, z]: [f64; 3]) -> [f64; 3] {
    if x.abs().max(y.abs()) > 1e-6 * z.abs() {
        [-y, x, 0.0]
    } else {
        [1.0, 0.0, 0.0]
    }
}

fn round(section: &Section<'_>, word: &str) -> Built<Frustum> {
    let base_m = point(section, &keys::BASE)?;
    let axis = direction(section, &keys::RECEIVER_AXIS)?.unwrap_or([0.0, 0.0, 1.0]);
    let along_y = axis[0].abs().max(axis[2].abs()) < 1e-6 * axis[1].abs();
    let otherwise = if along_y {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let zero = direction(section, &keys::ZERO)?.unwrap_or(otherwise);
    let height_m = needed(section, &keys::RECEIVER_HEIGHT)?;
    let grid = grid(section)?;
    Ok(if word == "cylinder" {
        let radius_m = needed(section, &keys::RADIUS)?;
        Frustum::cylinder(base_m, axis, zero, radius_m, height_m, grid)
    } else {
        let radii_m = [
            needed(section, &keys::BASE_RADIUS)?,
            needed(section, &keys::END_RADIUS)?,
        ];
        Frustum::cone(base_m, axis, zero, radii_m, height_m, grid)
    })
}

fn target(section: &Section<'_>, of: SceneOf<'_>) -> Built<Plane> {
    let SceneOf::Field(loaded) = of else {
        let message = match of {
            SceneOf::Mesh => "shape = \"target\" is of a field; a mesh has no targets",
            _ => "shape = \"target\" is of a field.toml, where targets have names",
        };
        let message = message.to_owned();
        return Err(conflict(section, &keys::RECEIVER_SHAPE, message));
    };
    let name = section
        .text(&keys::TARGET)?
        .ok_or_else(|| section.missing(&keys::TARGET))?;
    let names = loaded.targets.keys().map(String::as_str);
    let Some(target) = loaded.targets.get(name) else {
        let problem = Problem::unknown("target of the field", name, names);
        return Err(section.error(&keys::TARGET, problem));
    };
    let Some(area) = &target.area else {
        let message = format!(
            "the field's target `{name}` is a point; wanted one with normal_enu, width_m and height_m, or \
             shape = \"plane\" here"
        );
        return Err(conflict(section, &keys::TARGET, message));
    };
    let vector = |enu: helio_core::Enu| [enu.east, enu.north, enu.up];
    let plane = &area.plane;
    Ok(Plane::new(
        vector(target.centre),
        vector(plane.normal.as_enu()),
        vector(plane.right.as_enu()),
        [area.width_m, area.height_m],
        grid(section)?,
    ))
}

fn mesh(
    section: &Section<'_>,
    files: &mut Vec<PathBuf>,
    warnings: &mut Vec<String>,
) -> Result<Receiver, IoError> {
    let name = section
        .text(&keys::FILE)?
        .ok_or_else(|| section.missing(&keys::FILE))?;
    let facing =
        direction(section, &keys::FACING)?.ok_or_else(|| section.missing(&keys::FACING))?;
    let part = MirrorPart::of(section)?;
    let unit = SceneUnit::of(section)?;
    let folder = section.source().path.parent().unwrap_or(Path::new(""));
    let path = folder.join(name);
    // Seen from the TOML: that is where a wrong name is mended.
    if let Err(error) = std::fs::metadata(&path) {
        let (key, reason) = (section.dotted(&keys::FILE), said(&error));
        let problem = Problem::Reference { key, path, reason };
        return Err(section.error(&keys::FILE, problem));
    }
    let wanted = MeshFiles {
        mesh: &path,
        elements: None,
        metres_per_unit: unit.map(SceneUnit::metres),
        vectors: None,
    };
    let loaded = load_mesh(&wanted)?;
    files.extend(loaded.files);
    if !loaded.mesh.faults().is_empty() {
        for line in loaded.mesh.faults().to_string().lines() {
            warnings.push(format!("{}: {line}", path.display()));
        }
    }
    let wrong = |message: String| conflict(section, &keys::FILE, message);
    let toward = MirrorOptions::toward(facing).map_err(|error| wrong(error.to_string()))?;
    let lit = loaded
        .mesh
        .mirror(&part.pick(), &toward)
        .map_err(|error| wrong(format!("{}: {error}", path.display())))?;
    let aside = lit.left_aside();
    if aside.part() > 0.03 {
        warnings.push(format!(
            "{}: {} more outer faces are turned to facing and are left aside, for of each body the patch that is widest \
             across it counts; name the lit side by surface",
            path.display(),
            aside.faces()
        ));
    }
    let again = lit.coincident();
    if again.count() > 0 {
        warnings.push(format!(
            "{}: elements on the same places as others, with nodes of their own, are left out, {} in all: {again}",
            path.display(),
            again.count()
        ));
    }
    let at = |node: u32| lit.position_m()[node as usize];
    let mut triangles = Vec::new();
    for face in lit.faces() {
        match *face.corners() {
            [a, b, c] => triangles.push([at(a), at(b), at(c)]),
            [a, b, c, d] => {
                triangles.push([at(a), at(b), at(c)]);
                triangles.push([at(a), at(c), at(d)]);
            }
            _ => {}
        }
    }
    let receiver = MeshReceiver::new(&triangles)
        .map_err(|error| wrong(format!("{}: {error}", path.display())))?;
    Ok(Receiver::Mesh(receiver))
}
