//! The mirror of a structure's model, with its load and without.

use std::path::{Path, PathBuf};

use helio_flux::FluxMap;
use helio_flux::mesh::{Fault, Faults, Mesh, Mirror};
use helio_io::{FluxScene, MatchedNodes, MirrorPart, SceneOf, Structure, StructureFiles};
use helio_report::flux::slope_figure;
use serde_json::{Value, json};

use super::arrival::Arrival;
use super::outputs::{self, Outputs};
use super::plots::{self, Plot};
use super::shapes::{self, Shapes};
use super::summary;
use super::way::Taken;
use crate::Outcome;
use crate::args::{DeformWord, FluxArgs, word};
use crate::failure::Failure;
use crate::printer::{Counted, Printer};

/// Numbers that a message or a summary lists.
const NAMED: usize = 8;

pub(super) fn run(
    model: &Path,
    args: &FluxArgs,
    threads: usize,
    printer: &Printer,
) -> Result<Outcome, Failure> {
    let scene = super::scene(args, SceneOf::Mesh, printer)?;
    let read = Read::of(model, args, &scene, printer)?;
    let mut inputs = scene.files.clone();
    inputs.extend(read.files.iter().cloned());
    let outputs = Outputs::check(args, &inputs)?;
    if args.slopes.is_some() && !read.loaded {
        return Err(Failure::refused(
            "--slopes: the mesh has no displacements; wanted --displacements",
        ));
    }
    if args.slopes.is_some() && args.structure.method == DeformWord::Unloaded {
        return Err(Failure::refused(
            "--slopes: with --method unloaded the mirror has no slope errors; wanted elements, pose or rigid",
        ));
    }
    let shapes = Shapes::of(&read, args.structure.method, scene.mirror.axis)?;
    read.say(model, printer);
    shapes.say(printer);
    let elements = shapes.elements(scene.mirror.reflectivity)?;
    let sun = sun(&scene);
    let (map, taken) = super::light(&scene, &elements, sun, threads, printer)?;
    let arrival = Arrival::of(&scene, &elements, sun, &map)?;
    summary::say_account(map.account(), printer);
    arrival.say(printer);
    let dni_w_m2 = scene.sun.dni_w_m2;
    summary::say_peak(&scene.receiver, &map, dni_w_m2, printer);
    let left_out = shapes.left_out();
    let found = found(
        model,
        &scene,
        &read,
        &shapes,
        (&map, &arrival, &taken),
        &inputs,
    )?;
    let drawn = plots::draw(args, || plot(model, &scene, &read, &shapes, &map))?;
    outputs.map(&scene.receiver, &map, ["x_m", "y_m", "z_m"], printer)?;
    if let (Some(path), Some(traced)) = (&args.slopes, &shapes.traced_slopes()) {
        outputs::slopes(path, &shapes.traced().deformed, traced, &read.mirror)?;
    }
    if let Some(drawn) = drawn {
        drawn.write()?;
    }
    outputs.summary(&found, printer)?;
    Ok(
        if left_out > 0 || read.is_part_missing() || arrival.is_nothing() {
            Outcome::SomeRowsFailed
        } else {
            Outcome::Good
        },
    )
}

fn sun(scene: &FluxScene) -> [f64; 3] {
    scene.sun.toward.unwrap_or([0.0, 0.0, 1.0])
}

/// A model as it was read.
pub(super) struct Read {
    mesh: Mesh,
    pub(super) mirror: Mirror,
    part: MirrorPart,
    /// Whether there are displacements.
    pub(super) loaded: bool,
    matched: MatchedNodes,
    files: Vec<PathBuf>,
}

impl Read {
    fn of(
        model: &Path,
        args: &FluxArgs,
        scene: &FluxScene,
        printer: &Printer,
    ) -> Result<Self, Failure> {
        let typed = &args.structure;
        let mut structure = Structure::load(
            &StructureFiles {
                mesh: model,
                elements: typed.elements.as_deref(),
                displacements: typed.displacements.as_deref(),
                step: typed.step,
                vectors: typed.vectors.as_deref(),
                unit: typed.unit.map(Into::into),
            },
            scene,
        )?;
        if let Some(path) = &typed.displacements {
            warn_of_nodes(path, &structure.matched, printer);
        }
        if !structure.loaded {
            if !matches!(typed.method, DeformWord::Elements | DeformWord::Unloaded) {
                return Err(Failure::refused(format!(
                    "--method {} wants displacements, and {} has none: give --displacements",
                    word(typed.method),
                    model.display()
                )));
            }
            warn_of_vectors(model, &structure.mesh, printer);
        }
        for line in structure.mesh.faults().to_string().lines() {
            printer.warn(format_args!("{}: {line}", model.display()));
        }
        let part = match (&typed.surface, &typed.element_set) {
            (Some(name), _) => MirrorPart::Surface(name.clone()),
            (None, Some(name)) => MirrorPart::ElementSet(name.clone()),
            (None, None) => scene.mirror.part.clone(),
        };
        let mirror = structure
            .mirror(&part, scene)
            .map_err(|error| Failure::refused(format!("{}: {error}", model.display())))?;
        for (fault, what) in [
            (
                mirror.unusable(),
                "of the mirror without a face of THEIR own",
            ),
            (
                mirror.coincident(),
                "on the same places as others, with nodes of THEIR own, and left out",
            ),
            (
                mirror.rewound(),
                "wound the other way round than THEIR neighbours, and turned",
            ),
        ] {
            if fault.count() > 0 {
                let count = Counted(fault.count() as usize, "element");
                let whose = if fault.count() == 1 { "its" } else { "their" };
                let what = what.replace("THEIR", whose);
                printer.warn(format_args!("{}: {count} {what}: {fault}", model.display()));
            }
        }
        warn_of_aside(model, &mirror, printer);
        Ok(Self {
            mesh: structure.mesh,
            mirror,
            part,
            loaded: structure.loaded,
            matched: structure.matched,
            files: structure.files,
        })
    }

    /// Whether elements or faces that may belong to the mirror are not in it.
    fn is_part_missing(&self) -> bool {
        self.mirror.unusable().count() > self.mirror.covered()
            || self.mirror.coincident().count() > 0
            || self.mirror.left_aside().part() > RIMS
    }

    fn say(&self, model: &Path, printer: &Printer) {
        printer.say(format_args!(
            "{}: {}, {}; {}: {} in {}",
            model.display(),
            Counted(self.mesh.len(), "element"),
            Counted(self.mesh.node_ids().len(), "node"),
            part_words(&self.part),
            Counted(self.mirror.faces().len(), "face"),
            Counted(self.mirror.facets() as usize, "facet"),
        ));
    }

    /// The largest displacement of a node of the mirror \[m\] and the node's number.
    pub(super) fn farthest(&self) -> Option<(f64, u64)> {
        let moved = self.mirror.displacement_m().filter(|_| self.loaded)?;
        let sizes = moved.iter().map(|[x, y, z]| (x * x + y * y + z * z).sqrt());
        sizes
            .zip(self.mirror.node_ids())
            .filter(|(size, _)| size.is_finite())
            .fold(None, |best: Option<(f64, u64)>, (size, &id)| match best {
                Some((most, _)) if most >= size => best,
                _ => Some((size, id)),
            })
    }

    fn json(&self, model: &Path) -> Value {
        let faults = self.mesh.faults();
        json!({
            "file": model.display().to_string(),
            "nodes": self.mesh.node_ids().len(),
            "elements": self.mesh.len(),
            "mirror": part_words(&self.part),
            "faces": self.mirror.faces().len(),
            "facets": self.mirror.facets(),
            "faults": faults_json(faults),
            "elements_of_other_types": faults.skipped,
            "elements_without_a_face": fault_json(self.mirror.unusable()),
            "faces_left_aside": {
                "count": self.mirror.left_aside().faces(),
                "patches": self.mirror.left_aside().patches(),
                "part_of_area": self.mirror.left_aside().part(),
            },
            "elements_coincident": fault_json(self.mirror.coincident()),
            "elements_turned": fault_json(self.mirror.rewound()),
            "nodes_without_displacement": numbers_json(&self.matched.without),
            "displacements_of_unknown_nodes": numbers_json(&self.matched.unknown),
        })
    }
}

/// Above this part of the mirror's area what is left aside is more than rims.
const RIMS: f64 = 0.03;

fn warn_of_aside(model: &Path, mirror: &Mirror, printer: &Printer) {
    let aside = mirror.left_aside();
    if aside.part() > RIMS {
        printer.warn(format_args!(
            "{}: {} of solids turned to the sun left aside (smooth patches: {}), {:.2} times the area that counts: of each body one \
             smooth patch counts; name the mirror by a surface",
            model.display(),
            Counted(aside.faces() as usize, "outer face"),
            aside.patches(),
            aside.part()
        ));
    }
}

/// Vectors of an unknown name may be the load.
fn warn_of_vectors(model: &Path, mesh: &Mesh, printer: &Printer) {
    let names: Vec<String> = mesh.other_vectors().iter().take(NAMED).cloned().collect();
    if !names.is_empty() {
        printer.warn(format_args!(
            "{}: vectors of its nodes are named [{}], and none is taken for displacements: --vectors NAME says which is",
            model.display(),
            names.join(", ")
        ));
    }
}

fn warn_of_nodes(path: &Path, matched: &MatchedNodes, printer: &Printer) {
    let first = |numbers: &[u64]| {
        let shown: Vec<String> = numbers.iter().take(NAMED).map(u64::to_string).collect();
        let more = if numbers.len() > NAMED { ", …" } else { "" };
        format!("{}{more}", shown.join(", "))
    };
    if !matched.without.is_empty() {
        printer.warn(format_args!(
            "{}: {} of the mesh without a displacement: {}",
            path.display(),
            Counted(matched.without.len(), "node"),
            first(&matched.without)
        ));
    }
    if !matched.unknown.is_empty() {
        printer.warn(format_args!(
            "{}: displacements of {} that the mesh does not have: {}",
            path.display(),
            Counted(matched.unknown.len(), "node"),
            first(&matched.unknown)
        ));
    }
}

fn part_words(part: &MirrorPart) -> String {
    match part {
        MirrorPart::ElementSet(name) => format!("element set {name}"),
        MirrorPart::Surface(name) => format!("surface {name}"),
        MirrorPart::NodeSet(name) => format!("node set {name}"),
        _ => "all that reflects".to_owned(),
    }
}

fn numbers_json(numbers: &[u64]) -> Value {
    json!({ "count": numbers.len(), "first": numbers[..numbers.len().min(NAMED)] })
}

fn fault_json(fault: &Fault) -> Value {
    let mut value = json!({ "count": fault.count(), "first": fault.first() });
    if !fault.nodes().is_empty() {
        value["nodes"] = json!(fault.nodes());
    }
    value
}

fn faults_json(faults: &Faults) -> Value {
    json!({
        "missing_nodes": fault_json(&faults.missing_nodes),
        "missing_mid_nodes": fault_json(&faults.missing_mid_nodes),
        "degenerate": fault_json(&faults.degenerate),
        "inverted": fault_json(&faults.inverted),
        "duplicate": fault_json(&faults.duplicate),
        "no_such_face": fault_json(&faults.no_such_face),
    })
}

fn found(
    model: &Path,
    scene: &FluxScene,
    read: &Read,
    shapes: &Shapes,
    (map, arrival, taken): (&FluxMap, &Arrival, &Taken),
    inputs: &[PathBuf],
) -> Result<Value, Failure> {
    Ok(json!({
        "mesh": read.json(model),
        "method": if read.loaded { word(shapes.method) } else { word(DeformWord::Unloaded) },
        "slope_errors": shapes.json(),
        "scene": super::about_scene(scene, sun(scene), taken),
        "power": summary::account(map.account()),
        "receiver": summary::receiver(&scene.receiver, map, scene.sun.dni_w_m2, arrival),
        "files": super::hashes(inputs)?,
        "version": env!("CARGO_PKG_VERSION"),
    }))
}

fn plot<'a>(
    model: &Path,
    scene: &FluxScene,
    read: &Read,
    shapes: &Shapes,
    map: &'a FluxMap,
) -> Result<Plot<'a>, Failure> {
    let name = model.display();
    let by = match (read.loaded, shapes.method) {
        (false, _) | (true, DeformWord::Unloaded) => "without load".to_owned(),
        (true, DeformWord::Elements) => "by planar element substitution".to_owned(),
        (true, DeformWord::Pose) => "by mirror pose reconstruction".to_owned(),
        (true, DeformWord::Rigid) => "by a rigid motion of each facet".to_owned(),
    };
    let [x, y, z] = sun(scene);
    let mut facts = vec![(
        "mirror".to_owned(),
        format!(
            "{} of {name}: {} in {}, {by}",
            part_words(&read.part),
            Counted(read.mirror.faces().len(), "face"),
            Counted(read.mirror.facets() as usize, "facet")
        ),
    )];
    facts.extend(plots::facts(scene, format!("toward [{x}, {y}, {z}]")));
    let mut plot = Plot {
        title: format!("Flux of {name}, {by}"),
        facts,
        account: Some(map.account()),
        figures: vec![plots::of_receiver(scene, map, &format!("Flux, {by}"))?],
        notes: notes(read, shapes),
        ..Plot::default()
    };
    if let Some(slopes) = shapes.traced_slopes() {
        let title = format!("Slope errors {}", shapes::by(shapes.traced().method));
        let figure = slope_figure(&shapes.traced().deformed, slopes, sun(scene), &title)?;
        let caption = "Slope errors of the mirror in total and by axis, and how far its faces moved, seen along the sun.";
        plot.figures.push((figure, caption.to_owned()));
        plot.tables.push(shapes.table());
    }
    Ok(plot)
}

fn notes(read: &Read, shapes: &Shapes) -> Vec<String> {
    let mut notes = Vec::new();
    if shapes.traced_slopes().is_some() {
        notes.push(
            "Of the slope errors by method, elements is planar element substitution, pose mirror pose reconstruction from \
             three points, rigid the same by least squares. Off elements is the largest angle between normals by that \
             method and by elements; off rigid, how far the nodes of the worst facet are from where it puts them, root \
             mean square."
                .to_owned(),
        );
    }
    let faults: Vec<String> = read
        .mesh
        .faults()
        .to_string()
        .lines()
        .map(str::to_owned)
        .collect();
    notes.extend(faults);
    let again = read.mirror.coincident();
    if again.count() > 0 {
        let count = Counted(again.count() as usize, "element");
        notes.push(format!(
            "{count} on the same places as others left out: {again}."
        ));
    }
    let left_out = shapes.left_out();
    if left_out > 0 {
        notes.push(format!(
            "{} left out of the flux.",
            Counted(left_out, "face")
        ));
    }
    if !read.matched.without.is_empty() {
        let count = Counted(read.matched.without.len(), "node");
        notes.push(format!("{count} without a displacement."));
    }
    notes
}
