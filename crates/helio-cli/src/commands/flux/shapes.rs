//! A mirror without its load and with it, by every method, and what they say of its slopes.

use helio_flux::Element;
use helio_flux::deform::{Extreme, FaceStatus, FacetPose, PoseStatus, SlopeErrors};
use helio_io::{DeformMethod, DeformedMirror};
use helio_report::flux::Table;
use serde_json::{Map, Value, json};

use super::mesh::Read;
use crate::args::DeformWord;
use crate::failure::Failure;
use crate::printer::{Counted, Grouped, Printer};

/// The mirror by every method.
pub(super) struct Shapes {
    /// By elements, and with displacements also by three points and by least squares.
    all: Vec<DeformedMirror>,
    pub(super) method: DeformWord,
    loaded: bool,
    axis: [f64; 3],
    farthest: Option<(f64, u64)>,
}

impl Shapes {
    pub(super) fn of(
        read: &Read,
        method: DeformWord,
        axis: Option<[f64; 3]>,
    ) -> Result<Self, Failure> {
        let elements = DeformedMirror::of(&read.mirror, DeformMethod::Elements, axis)?;
        let axis = elements.axis;
        let mut all = vec![elements];
        if read.loaded {
            for method in [DeformMethod::Pose, DeformMethod::Rigid] {
                all.push(DeformedMirror::of(&read.mirror, method, Some(axis))?);
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
    pub(super) fn traced(&self) -> &DeformedMirror {
        let row = match self.method {
            DeformWord::Elements | DeformWord::Unloaded => 0,
            DeformWord::Pose => 1,
            DeformWord::Rigid => 2,
        };
        &self.all[row.min(self.all.len() - 1)]
    }

    /// Its slope errors, where there is a load and it is traced.
    pub(super) fn traced_slopes(&self) -> Option<&SlopeErrors> {
        let bent = self.loaded && self.method != DeformWord::Unloaded;
        bent.then(|| &self.traced().slopes)
    }

    pub(super) fn elements(&self, reflectivity: f64) -> Result<Vec<Element>, Failure> {
        let traced = self.traced();
        Ok(if self.method == DeformWord::Unloaded {
            traced.ideal_elements(reflectivity)?
        } else {
            traced.elements(reflectivity)?
        })
    }

    /// Faces that are not traced.
    pub(super) fn left_out(&self) -> usize {
        let deformed = &self.traced().deformed;
        match self.method {
            DeformWord::Unloaded => 0,
            _ => deformed.status().len() - deformed.usable(),
        }
    }

    pub(super) fn say(&self, printer: &Printer) {
        if !self.loaded {
            printer.note(format_args!(
                "no displacements given: the mirror is as it was drawn"
            ));
            return;
        }
        if self.method == DeformWord::Unloaded {
            printer.note(format_args!(
                "--method unloaded: the mirror is as it was drawn; the slope errors of its load are told by the others"
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
                printer.warn(format_args!(
                    "by {}: no face can be told",
                    shape.method.as_str()
                ));
                continue;
            };
            printer.say(format_args!(
                "slope errors by {}: {:.3} mrad rms by area, largest {:.3} mrad at element {}",
                shape.method.as_str(),
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
                    shape.method.as_str(),
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
    fn apart(&self, shape: &DeformedMirror) -> Option<(f64, u64)> {
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

    pub(super) fn json(&self) -> Value {
        if self.traced_slopes().is_none() {
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

    fn shape_json(&self, shape: &DeformedMirror) -> Value {
        let slopes = &shape.slopes;
        let extreme = |extreme: Option<Extreme>| extreme.map(|e| 1e3 * e.value);
        let statuses: Map<String, Value> = statuses(shape.deformed.status())
            .into_iter()
            .map(|(word, count)| (word.to_owned(), json!(count)))
            .collect();
        let apart = self.apart(shape).filter(|_| !shape.poses.is_empty());
        let mut value = json!({
            "method": shape.method.as_str(),
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

/// How a method is called in titles.
pub(super) const fn by(method: DeformMethod) -> &'static str {
    match method {
        DeformMethod::Pose => "by mirror pose reconstruction",
        DeformMethod::Rigid => "by a rigid motion of each facet",
        _ => "by planar element substitution",
    }
}

impl Shapes {
    pub(super) fn table(&self) -> Table {
        let mrad = |value_rad: f64| format!("{:.3}", 1e3 * value_rad);
        let extreme = |e: Option<Extreme>| e.map_or(String::new(), |e| mrad(e.value));
        let rows = self.all.iter().map(|shape| {
            let slopes = &shape.slopes;
            let apart = self.apart(shape).filter(|_| !shape.poses.is_empty());
            vec![
                shape.method.as_str().to_owned(),
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
                "along axis (mrad)",
                "across (mrad)",
                "off elements (mrad)",
                "off rigid (µm)",
            ]
            .map(str::to_owned)
            .to_vec(),
            rows: rows.collect(),
        }
    }
}
