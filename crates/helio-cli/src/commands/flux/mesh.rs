//! The mirror of a structure's model, with its load and without.

use std::path::{Path, PathBuf};

use helio_flux::deform::{
    DeformError, Deformed, FaceStatus, FacetPose, PoseFit, PoseStatus, SlopeErrors,
    reconstruct_poses, substitute_elements,
};
use helio_flux::mesh::{Fault, Faults, Mesh, Mirror, MirrorOptions};
use helio_flux::{Element, FluxMap};
use helio_io::{FluxScene, MatchedNodes, MeshFiles, MirrorPart, SceneOf, displace_mesh, load_mesh};
use helio_report::flux::{Table, slope_figure};
use serde_json::{Map, Value, json};

use super::outputs::{self, Outputs};
use super::plots::{self, Plot};
use super::summary;
use crate::Outcome;
use crate::args::{DeformWord, FluxArgs, word};
use crate::failure::Failure;
use crate::printer::{Counted, Grouped, Printer};

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
    let shapes = Shapes::of(&read, args.structure.method, scene.mirror.axis)?;
    read.say(model, printer);
    shapes.say(printer);
    let elements = shapes.elements(scene.mirror.reflectivity)?;
    let sun = sun(&scene);
    let map = super::light(&scene, &elements, sun, threads, printer)?;
    summary::say_account(map.account(), printer);
    let dni_w_m2 = scene.sun.dni_w_m2;
    summary::say_peak(&scene.receiver, &map, dni_w_m2, printer);
    let left_out = shapes.left_out();
    let found = found(model, &scene, &read, &shapes, &map, &inputs)?;
    let drawn = plots::draw(args, || plot(model, &scene, &read, &shapes, &map))?;
    outputs.map(&scene.receiver, &map, ["x_m", "y_m", "z_m"], printer)?;
    if let (Some(path), Some(traced)) = (&args.slopes, &shapes.traced_slopes()) {
        outputs::slopes(path, &shapes.traced().deformed, traced, &read.mirror)?;
    }
    if let Some(drawn) = drawn {
        drawn.write()?;
    }
    outputs.summary(&found, printer)?;
    Ok(if left_out > 0 {
        Outcome::SomeRowsFailed
    } else {
        Outcome::Good
    })
}

fn sun(scene: &FluxScene) -> [f64; 3] {
    scene.sun.toward.unwrap_or([0.0, 0.0, 1.0])
}

/// A model as it was read.
struct Read {
    mesh: Mesh,
    mirror: Mirror,
    part: MirrorPart,
    /// Whether there are displacements.
    loaded: bool,
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
        let unit = typed.unit.map_or(scene.mirror.unit, Into::into);
        let vectors = typed.vectors.as_deref();
        let loaded = load_mesh(&MeshFiles {
            mesh: model,
            elements: typed.elements.as_deref(),
            metres_per_unit: unit.metres(),
            vectors,
        })?;
        let (mut mesh, mut files) = (loaded.mesh, loaded.files);
        let mut matched = MatchedNodes::default();
        if let Some(path) = &typed.displacements {
            files.push(path.clone());
            matched = displace_mesh(&mut mesh, path, typed.step, unit.metres(), vectors)?;
            warn_of_nodes(path, &matched, printer);
        }
        let loaded = mesh.displacement_m().is_some();
        if !loaded {
            if !matches!(typed.method, DeformWord::Elements | DeformWord::Unloaded) {
                return Err(Failure::refused(format!(
                    "--method {} wants displacements, and {} has none: give --displacements",
                    word(typed.method),
                    model.display()
                )));
            }
            // Nothing moves: the mirror as it was drawn.
            mesh.set_displacements_m(vec![[0.0; 3]; mesh.node_ids().len()])?;
        }
        for line in mesh.faults().to_string().lines() {
            printer.warn(format_args!("{}: {line}", model.display()));
        }
        let part = match (&typed.surface, &typed.element_set) {
            (Some(name), _) => MirrorPart::Surface(name.clone()),
            (None, Some(name)) => MirrorPart::ElementSet(name.clone()),
            (None, None) => scene.mirror.part.clone(),
        };
        let named = |error: &dyn std::fmt::Display| {
            Failure::refused(format!("{}: {error}", model.display()))
        };
        let mut options = MirrorOptions::toward(sun(scene)).map_err(|error| named(&error))?;
        if let Some(crease_rad) = scene.mirror.crease_rad {
            options = options
                .with_crease_rad(crease_rad)
                .map_err(|error| named(&error))?;
        }
        let mirror = mesh
            .mirror(&part.pick(), &options)
            .map_err(|error| named(&error))?;
        for (fault, what) in [
            (
                mirror.unusable(),
                "of the mirror without a face of their own",
            ),
            (
                mirror.rewound(),
                "wound the other way round than their neighbours, and turned",
            ),
        ] {
            if fault.count() > 0 {
                let count = Counted(fault.count() as usize, "element");
                printer.warn(format_args!("{}: {count} {what}: {fault}", model.display()));
            }
        }
        Ok(Self {
            mesh,
            mirror,
            part,
            loaded,
            matched,
            files,
        })
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
    fn farthest(&self) -> Option<(f64, u64)> {
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
            "elements_turned": fault_json(self.mirror.rewound()),
            "nodes_without_displacement": numbers_json(&self.matched.without),
            "displacements_of_unknown_nodes": numbers_json(&self.matched.unknown),
        })
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
        "degenerate": fault_json(&faults.degenerate),
        "inverted": fault_json(&faults.inverted),
        "duplicate": fault_json(&faults.duplicate),
        "no_such_face": fault_json(&faults.no_such_face),
    })
}

/// A mirror as one method puts it, and what it says of the slopes.
pub(super) struct Shape {
    name: &'static str,
    pub(super) deformed: Deformed,
    pub(super) slopes: SlopeErrors,
    poses: Vec<FacetPose>,
}

/// The mirror by every method.
pub(super) struct Shapes {
    /// By elements, and with displacements also by three points and by least squares.
    all: Vec<Shape>,
    method: DeformWord,
    loaded: bool,
    axis: [f64; 3],
    farthest: Option<(f64, u64)>,
}

impl Shapes {
    fn of(read: &Read, method: DeformWord, axis: Option<[f64; 3]>) -> Result<Self, Failure> {
        let elements = substitute_elements(&read.mirror)?;
        let (axis, slopes) = match (axis, SlopeErrors::new(&elements, axis.unwrap_or(X))) {
            (None, Err(DeformError::BadAxis { .. })) => (Y, SlopeErrors::new(&elements, Y)?),
            (axis, slopes) => (axis.unwrap_or(X), slopes?),
        };
        let mut all = vec![Shape {
            name: "elements",
            deformed: elements,
            slopes,
            poses: Vec::new(),
        }];
        if read.loaded {
            for (name, fit) in [
                ("pose", PoseFit::ThreePoints),
                ("rigid", PoseFit::LeastSquares),
            ] {
                let (deformed, poses) = reconstruct_poses(&read.mirror, fit)?;
                let slopes = SlopeErrors::new(&deformed, axis)?;
                all.push(Shape {
                    name,
                    deformed,
                    slopes,
                    poses,
                });
            }
        }
        Ok(Self {
            all,
            method,
            loaded: read.loaded,
            axis,
            farthest: read.farthest(),
        })
    }

    /// The one that is traced.
    pub(super) fn traced(&self) -> &Shape {
        let row = match self.method {
            DeformWord::Elements | DeformWord::Unloaded => 0,
            DeformWord::Pose => 1,
            DeformWord::Rigid => 2,
        };
        &self.all[row.min(self.all.len() - 1)]
    }

    /// Its slope errors, where there is a load.
    pub(super) fn traced_slopes(&self) -> Option<&SlopeErrors> {
        self.loaded.then(|| &self.traced().slopes)
    }

    fn elements(&self, reflectivity: f64) -> Result<Vec<Element>, Failure> {
        let deformed = &self.traced().deformed;
        let of = |element: &Element| element.with_reflectivity(reflectivity);
        let elements: Result<Vec<_>, _> = if self.method == DeformWord::Unloaded {
            deformed.ideal().iter().map(of).collect()
        } else {
            deformed.loaded().iter().flatten().map(of).collect()
        };
        Ok(elements?)
    }

    /// Faces that are not traced.
    fn left_out(&self) -> usize {
        let deformed = &self.traced().deformed;
        match self.method {
            DeformWord::Unloaded => 0,
            _ => deformed.status().len() - deformed.usable(),
        }
    }

    fn say(&self, printer: &Printer) {
        if !self.loaded {
            printer.note(format_args!(
                "no displacements given: the mirror is as it was drawn"
            ));
            return;
        }
        if let Some((size_m, node)) = self.farthest {
            printer.say(format_args!(
                "largest displacement of the mirror {:.3} mm, at node {node}",
                1e3 * size_m
            ));
        }
        for shape in &self.all {
            let Some(most) = shape.slopes.max() else {
                printer.warn(format_args!("by {}: no face can be told", shape.name));
                continue;
            };
            printer.say(format_args!(
                "slope errors by {}: {:.3} mrad rms by area, largest {:.3} mrad at element {}",
                shape.name,
                1e3 * shape.slopes.rms_rad(),
                1e3 * most.value,
                most.element
            ));
        }
        for shape in &self.all[1..] {
            if let (Some((apart_rad, element)), Some(worst)) =
                (self.apart(shape), worst(&shape.poses))
            {
                printer.say(format_args!(
                    "by {} normals differ by at most {:.3} mrad from those by elements (element {element}); facet {} \
                     is farthest from rigid, {:.1} µm rms",
                    shape.name,
                    1e3 * apart_rad,
                    worst.facet,
                    1e6 * worst.rms_m
                ));
            }
        }
        let left_out = self.left_out();
        if left_out > 0 {
            let words: Vec<String> = statuses(self.traced().deformed.status())
                .into_iter()
                .filter(|(word, _)| *word != FaceStatus::Ok.word())
                .map(|(word, count)| format!("{} {word}", Grouped(count as u64)))
                .collect();
            printer.warn(format_args!(
                "{} left out: {}",
                Counted(left_out, "face"),
                words.join(", ")
            ));
        }
    }

    /// The largest angle between normals by a method and by elements \[rad\], and its element.
    fn apart(&self, shape: &Shape) -> Option<(f64, u64)> {
        let elements = &self.all[0].deformed;
        let rows = elements.loaded().iter().zip(shape.deformed.loaded());
        let mut most: Option<(f64, u64)> = None;
        for (row, pair) in rows.enumerate() {
            let (Some(one), Some(other)) = pair else {
                continue;
            };
            let angle = angle(one.normal(), other.normal());
            if most.is_none_or(|(most, _)| angle > most) {
                most = Some((angle, elements.element_ids()[row]));
            }
        }
        most
    }

    fn json(&self) -> Value {
        if !self.loaded {
            return Value::Null;
        }
        let methods: Vec<Value> = self
            .all
            .iter()
            .map(|shape| self.shape_json(shape))
            .collect();
        json!({
            "axis": self.axis,
            "largest_displacement_m": self.farthest.map(|(size_m, _)| size_m),
            "largest_displacement_node": self.farthest.map(|(_, node)| node),
            "methods": methods,
        })
    }

    fn shape_json(&self, shape: &Shape) -> Value {
        let slopes = &shape.slopes;
        let extreme = |extreme: Option<helio_flux::deform::Extreme>| extreme.map(|e| 1e3 * e.value);
        let statuses: Map<String, Value> = statuses(shape.deformed.status())
            .into_iter()
            .map(|(word, count)| (word.to_owned(), json!(count)))
            .collect();
        let apart = self.apart(shape).filter(|_| !shape.poses.is_empty());
        let mut value = json!({
            "method": shape.name,
            "rms_mrad": 1e3 * slopes.rms_rad(),
            "rms_first_mrad": 1e3 * slopes.rms_first_rad(),
            "rms_second_mrad": 1e3 * slopes.rms_second_rad(),
            "largest_mrad": extreme(slopes.max()),
            "largest_element": slopes.max().map(|e| e.element),
            "largest_first_mrad": extreme(slopes.max_first()),
            "largest_second_mrad": extreme(slopes.max_second()),
            "faces": statuses,
        });
        if !shape.poses.is_empty() {
            let worst = worst(&shape.poses);
            let posed = |pose: &&FacetPose| pose.status == PoseStatus::Ok;
            value["largest_difference_from_elements_mrad"] = json!(apart.map(|(rad, _)| 1e3 * rad));
            value["largest_difference_element"] = json!(apart.map(|(_, element)| element));
            value["facets_with_a_pose"] = json!(shape.poses.iter().filter(posed).count());
            value["farthest_from_rigid"] = json!(worst.map(|pose| json!({
                "facet": pose.facet,
                "rms_m": pose.rms_m,
                "largest_m": pose.max_m,
                "largest_node": pose.max_node,
            })));
        }
        value
    }
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];

/// The facet farthest from rigid.
fn worst(poses: &[FacetPose]) -> Option<&FacetPose> {
    let known = poses.iter().filter(|pose| pose.rms_m.is_finite());
    known.reduce(|worst, pose| {
        if pose.rms_m > worst.rms_m {
            pose
        } else {
            worst
        }
    })
}

/// Angle between unit vectors \[rad\], by the arc tangent, which keeps small ones.
fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let cross = [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ];
    let size = cross.iter().map(|x| x * x).sum::<f64>().sqrt();
    let along: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
    size.atan2(along)
}

/// How many faces have each status.
fn statuses(all: &[FaceStatus]) -> Vec<(&'static str, usize)> {
    let known = [
        FaceStatus::Ok,
        FaceStatus::NoDisplacement,
        FaceStatus::NoPose,
        FaceStatus::Collapsed,
    ];
    known
        .into_iter()
        .map(|status| (status.word(), all.iter().filter(|s| **s == status).count()))
        .filter(|(_, count)| *count > 0)
        .collect()
}

fn found(
    model: &Path,
    scene: &FluxScene,
    read: &Read,
    shapes: &Shapes,
    map: &FluxMap,
    inputs: &[PathBuf],
) -> Result<Value, Failure> {
    Ok(json!({
        "mesh": read.json(model),
        "method": if read.loaded { word(shapes.method) } else { word(DeformWord::Unloaded) },
        "slope_errors": shapes.json(),
        "scene": super::about_scene(scene, sun(scene)),
        "power": summary::account(map.account()),
        "receiver": summary::receiver(&scene.receiver, map, scene.sun.dni_w_m2),
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
        let title = format!("Slope errors {}", shapes.traced().by());
        let figure = slope_figure(&shapes.traced().deformed, slopes, sun(scene), &title)?;
        let caption = "Slope errors of the mirror in total and by axis, and how far its faces moved, seen along the sun.";
        plot.figures.push((figure, caption.to_owned()));
        plot.tables.push(shapes.table());
    }
    Ok(plot)
}

fn notes(read: &Read, shapes: &Shapes) -> Vec<String> {
    let mut notes: Vec<String> = read
        .mesh
        .faults()
        .to_string()
        .lines()
        .map(str::to_owned)
        .collect();
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

impl Shape {
    fn by(&self) -> &'static str {
        match self.name {
            "pose" => "by mirror pose reconstruction",
            "rigid" => "by a rigid motion of each facet",
            _ => "by planar element substitution",
        }
    }
}

impl Shapes {
    fn table(&self) -> Table {
        let mrad = |value_rad: f64| format!("{:.3}", 1e3 * value_rad);
        let extreme =
            |e: Option<helio_flux::deform::Extreme>| e.map_or(String::new(), |e| mrad(e.value));
        let rows = self.all.iter().map(|shape| {
            let slopes = &shape.slopes;
            let apart = self.apart(shape).filter(|_| !shape.poses.is_empty());
            vec![
                shape.by().to_owned(),
                mrad(slopes.rms_rad()),
                extreme(slopes.max()),
                extreme(slopes.max_first()),
                extreme(slopes.max_second()),
                apart.map_or(String::new(), |(rad, _)| mrad(rad)),
                worst(&shape.poses)
                    .map_or(String::new(), |pose| format!("{:.1}", 1e6 * pose.rms_m)),
            ]
        });
        Table {
            title: "Slope errors by method".to_owned(),
            head: [
                "method",
                "rms by area (mrad)",
                "largest (mrad)",
                "along the axis (mrad)",
                "across it (mrad)",
                "largest difference of normals (mrad)",
                "farthest from rigid (µm rms)",
            ]
            .map(str::to_owned)
            .to_vec(),
            rows: rows.collect(),
        }
    }
}
