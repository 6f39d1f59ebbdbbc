//! Files of helio-rs: what people write, read into what [`helio_core`] computes with.
//!
//! **Units at this edge.** Files speak degrees, metres and times with an offset, always in the name
//! of a key or column (`_deg`, `_m`); everything handed out is radians, metres and nanoseconds of
//! Unix time. Points are right-handed east, north, up.
//!
//! **Reading.** [`load_field`] reads a `field.toml` and the tables it names into a [`LoadedField`]:
//! the site, the targets, the heliostats as a [`helio_core::Field`], their drives, and a
//! [`CalibrationSchedule`] where calibrations change with the hour or the date. [`load_suns`],
//! [`load_present`] and [`load_angles`] read the small tables of the command line;
//! [`parse_time`] and [`TimeRange`] its times. [`schema`] describes `field.toml` for editors.
//! [`load_scene`] reads a `scene.toml` for flux, [`load_mesh`] and [`displace_mesh`] what solvers of structures write.
//! [`load_target`] reads a `target.toml`, [`frame_files`] finds camera frames, [`load_spots`] reads what was seen in them.
//!
//! **Writing.** [`output`] writes results; [`AtomicFile`] makes them appear whole or not at all.
//!
//! **Errors.** Every message names the file, the line and column (or the row), what was found and
//! what was wanted; see [`IoError`].

mod atomic;
pub mod calibrate;
mod calibrated;
mod campaign;
mod check;
mod corrections;
mod error;
mod example;
mod field;
mod finding;
mod finished;
mod flux;
mod frames;
mod hash;
mod joining;
mod judging;
mod keys;
mod leftovers;
mod log;
mod meshes;
mod observations;
pub mod output;
mod paint;
mod pictures;
mod predicting;
mod scene;
mod schema;
mod simulate;
mod small;
mod spots;
mod state;
mod table;
mod tally;
mod target;
mod times;
mod toml;
mod verify;
mod words;

pub use atomic::{AtomicFile, remove_unfinished_files, write_file, write_file_with};
pub use calibrated::{
    CalibratedSet, JointColumns, Provenance, degrees_for, errors_as_written, load_calibration,
    write_calibration,
};
pub use campaign::{
    Campaign, Instrument, campaign_of_text, limits_of_text, limits_toml, load_campaign,
    load_limits, load_weather,
};
pub use check::{CheckError, FieldCheck};
pub use corrections::{Corrected, Corrections, CorrectionsError, OtherCalibration};
pub use error::{IoError, Place, Problem};
pub use example::{ExampleError, ExampleField, write_example_field};
pub use field::{
    CalibrationSchedule, FieldParts, Lapse, LoadedField, ObservationColumns, Site, Target,
    TargetArea, load_field, load_field_calibrated, surroundings_of_text,
};
pub use finding::{
    FinderRoom, FrameClock, FrameGap, FrameNumberError, OverlayError, OverlayFolder, RawFrames,
    SeenInFrame, SpotFinder, SpotMethod, SpotWords, UselessOption, frame_gap, frame_of_file,
    parse_raw, parse_size, parse_threshold, read_frame,
};
pub use finished::Finished;
pub use flux::{
    DeformMethod, DeformedMirror, GrayPicture, PictureError, Structure, StructureFiles, TargetFlux,
    write_flux_map,
};
pub use frames::{FrameFiles, frame_files};
pub use hash::{Sha256, hash_file};
pub use judging::{CampaignAsked, JudgedCampaign};
pub use leftovers::{load_leftovers, write_leftovers};
pub use log::{ObservationLog, load_observation_log};
pub use meshes::{LoadedMesh, MatchedNodes, MeshFiles, displace_mesh, load_mesh};
pub use observations::{
    HeliostatObservations, LeftAside, LeftAsideReason, Observations, load_observations,
    load_observations_with_spots,
};
pub use paint::{Paint, PaintCentroid, PaintError, PaintFiles, PaintWatch};
pub use pictures::{write_frame, write_rgb};
pub use predicting::{RowPredictor, RowPredictorError};
pub use scene::{
    FluxScene, MirrorPart, SceneMethod, SceneMirror, SceneOf, SceneRays, SceneSun, SceneUnit,
    SunForm, load_scene, scene_of_text,
};
pub use schema::{scene_schema, schema, target_schema};
pub use simulate::{
    FramePixels, ImageBeam, ImagePlan, ImagesError, LayoutPattern, ObservationPlan, SimulateError,
    SimulatedCampaign, SimulatedImages, SimulatedLayout, SimulatedObservations,
};
pub use small::{Angles, AnglesSun, PresentAngles, Suns, load_angles, load_present, load_suns};
pub use spots::{SpotRow, SpotTable, load_spots, write_spots};
pub use state::{
    KeptDrive, KeptMount, STATE_FORMAT, StateFile, read_state, state_bytes, state_of_bytes,
    write_state,
};
pub use table::{MemoryTable, PARQUET_THREAD, TableSource};
pub use tally::Tally;
pub use target::{CameraTarget, load_target, target_of_text, target_toml};
pub use times::{TimeRange, degrees_as_written, format_time, parse_step, parse_time};
pub use verify::{BeamsBack, beyond_drives, by_row, tracked_numbers};
pub use words::{Counted, Grouped};
