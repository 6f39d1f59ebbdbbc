//! A synthetic field with calibration campaigns, the same on every machine.

use std::f64::consts::PI;
use std::io::Write as _;
use std::path::Path;

use helio_calib::model::{Pose, landing};
use helio_calib::{Campaign, Mount, Observation, Parameter, Parameters, Sighting};
use helio_core::{
    Enu, EnuUnit, Field, Heliostat, MountErrors, OffsetForm, TargetPlane, Tracker, TrackingMode,
};

/// Heliostats that are seen under the same suns.
const TOGETHER: usize = 32;

/// Numbers of an observation in the peers' file.
pub const PEER_COLUMNS: usize = 17;

/// splitmix64, from its seed.
#[derive(Debug)]
pub struct Random(pub u64);

impl Random {
    /// Uniform from 0 to 1.
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, size: f64) -> f64 {
        size * (2.0 * self.unit() - 1.0)
    }

    /// Of standard deviation one, near enough to normal.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

/// Everything of a field with its campaigns.
#[derive(Debug)]
pub struct Campaigns {
    /// The heliostats.
    pub mounts: Vec<Mount>,
    /// What they are.
    pub truth: Vec<Parameters>,
    /// Heliostat by heliostat, as many of each.
    pub observations: Vec<Observation>,
    per_heliostat: usize,
}

impl Campaigns {
    /// Azimuth-elevation heliostats 40 to 300 m north of a tower, tilt to 2°, non-orthogonality to 5°,
    /// mirror tilt to 2°, references to ±180° and ±10°, noise 0.5 mrad. Beams land within a metre or so.
    ///
    /// # Errors
    /// A sentence, if the field is none.
    pub fn new(heliostats: usize, per_heliostat: usize, seed: u64) -> Result<Self, String> {
        let mut random = Random(seed);
        let mut campaigns = Self {
            mounts: Vec::new(),
            truth: Vec::new(),
            observations: Vec::with_capacity(heliostats * per_heliostat),
            per_heliostat,
        };
        let facing = EnuUnit::try_new(Enu::new(0.0, 1.0, -0.1)).map_err(|e| e.to_string())?;
        let plane = TargetPlane::level(Enu::new(0.0, 0.0, 45.0), facing);
        let mode = TrackingMode::AzimuthElevation;
        while campaigns.mounts.len() < heliostats {
            let count = TOGETHER.min(heliostats - campaigns.mounts.len());
            let suns: Vec<EnuUnit> = (0..per_heliostat)
                .map(|_| {
                    let azimuth_rad = PI + random.within(1.4);
                    EnuUnit::from_azimuth_elevation(azimuth_rad, 0.25 + 0.85 * random.unit())
                })
                .collect();
            let mut field = Field::new(mode);
            let mut chosen = Vec::new();
            for k in 0..count {
                let (sine, cosine) = random.within(0.8).sin_cos();
                let distance = 40.0 + 260.0 * random.unit();
                let pivot = Enu::new(distance * sine, distance * cosine, 3.0);
                let mut heliostat = Heliostat::new(pivot, plane.centre);
                heliostat.mirror_offset_m = 0.1 + 0.3 * random.unit();
                heliostat.errors = MountErrors {
                    pedestal_tilt_rad: 0.035 * random.unit(),
                    pedestal_tilt_azimuth_rad: random.within(PI),
                    axis_nonorthogonality_rad: random.within(0.087),
                    mirror_tilt_rad: random.within(0.035),
                    azimuth_reference_rad: random.within(PI),
                    elevation_reference_rad: random.within(0.175),
                };
                field
                    .push(&k.to_string(), heliostat)
                    .map_err(|e| e.to_string())?;
                chosen.push(heliostat);
            }
            let tracker = Tracker::new(&field, OffsetForm::Exact).map_err(|e| e.to_string())?;
            let angles: Vec<_> = suns.iter().map(|&sun| tracker.track(sun)).collect();
            for (k, heliostat) in chosen.iter().enumerate() {
                let mount = Mount::of(mode, heliostat);
                let truth = Parameters::new(&heliostat.errors, heliostat.mirror_offset_m);
                let slant = (plane.centre - mount.pivot).norm();
                for (&sun, tracking) in suns.iter().zip(&angles) {
                    let mut observation = Observation::new(
                        sun,
                        tracking.axis1_rad()[k] + random.within(0.003),
                        tracking.axis2_rad()[k] + random.within(0.003),
                        plane,
                        0.0,
                        0.0,
                    );
                    let sighting = Sighting::new(&mount, &observation);
                    let at = landing(&Pose::of(&truth), &sighting).residual_m;
                    observation.u_m = at[0] + 0.0005 * slant * random.normal();
                    observation.v_m = at[1] + 0.0005 * slant * random.normal();
                    campaigns.observations.push(observation);
                }
                campaigns.mounts.push(mount);
                campaigns.truth.push(truth);
            }
        }
        Ok(campaigns)
    }

    /// As the library takes them.
    #[must_use]
    pub fn campaigns(&self) -> Vec<Campaign<'_>> {
        self.mounts
            .iter()
            .zip(self.observations.chunks_exact(self.per_heliostat))
            .map(|(&mount, observations)| Campaign {
                mount,
                observations,
            })
            .collect()
    }

    /// Writes what the peers read: heliostats and observations of each as two 64-bit numbers, then of each
    /// heliostat its mirror offset, both references to begin with, and rows of [`PEER_COLUMNS`] numbers, all along the mount's axes: sun,
    /// encoder angles, xi, eta, nt, pivot → centre along nt, pivot → spot along xi and eta.
    ///
    /// # Errors
    /// A sentence, if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), String> {
        let write = || -> std::io::Result<()> {
            let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
            for count in [self.mounts.len(), self.per_heliostat] {
                file.write_all(&(count as u64).to_le_bytes())?;
            }
            for campaign in self.campaigns() {
                let sightings: Vec<_> = campaign
                    .observations
                    .iter()
                    .map(|observation| Sighting::new(&campaign.mount, observation))
                    .collect();
                let [first, second] = start_rad(&sightings);
                for value in [campaign.mount.mirror_offset_m, first, second] {
                    file.write_all(&value.to_le_bytes())?;
                }
                for (observation, s) in campaign.observations.iter().zip(&sightings) {
                    let angles = [observation.axis1_rad, observation.axis2_rad];
                    let [normal, right, down] = s.plane;
                    let plane = [right, down, normal];
                    let plane = plane.as_flattened();
                    let rest = [s.centre_along_normal_m, s.spot_m[0], s.spot_m[1]];
                    for value in s.sun.iter().chain(&angles).chain(plane).chain(&rest) {
                        file.write_all(&value.to_le_bytes())?;
                    }
                }
            }
            file.flush()
        };
        write().map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Largest of the six angles' distances from the truth \[rad\].
    #[must_use]
    pub fn farthest_from_truth(&self, k: usize, found: &Parameters) -> f64 {
        let apart = |p: Parameter| {
            let turn = (found.get(p) - self.truth[k].get(p)).rem_euclid(core::f64::consts::TAU);
            turn.min(core::f64::consts::TAU - turn)
        };
        Parameter::ALL[..6]
            .iter()
            .map(|&p| apart(p))
            .fold(0.0, f64::max)
    }
}

/// Both references from a cold start, in closed form, as the library begins: the peers get them for nothing.
fn start_rad(sightings: &[Sighting<f64>]) -> [f64; 2] {
    let mut sums = [0.0; 6];
    for s in sightings {
        let [right, down, normal] = [s.plane[1], s.plane[2], s.plane[0]];
        let [u, v] = s.spot_m;
        let way = s.centre_along_normal_m;
        let length = (u * u + v * v + way * way).sqrt();
        let half: [f64; 3] = std::array::from_fn(|k| {
            s.sun[k] + (u * right[k] + v * down[k] + way * normal[k]) / length
        });
        let ([c1, s1], [c2, s2]) = (s.axis1, s.axis2);
        let p = c1 * half[0] + s1 * half[1];
        let q = s1 * half[0] - c1 * half[1];
        let z = half[2];
        for (sum, value) in sums
            .iter_mut()
            .zip([c2 * p, c2 * q, s2 * p, s2 * q, s2 * z, c2 * z])
        {
            *sum += value;
        }
    }
    let mut best = (f64::NEG_INFINITY, [0.0; 2]);
    for begin in 0..4 {
        let mut second = f64::from(begin) * core::f64::consts::FRAC_PI_2;
        let mut first = 0.0_f64;
        let mut agreement = 0.0;
        for _ in 0..4 {
            let (s, c) = second.sin_cos();
            first = (c * sums[1] + s * sums[3]).atan2(c * sums[0] + s * sums[2]);
            let (s, c) = first.sin_cos();
            let along = c * sums[0] + s * sums[1] + sums[4];
            let across = c * sums[2] + s * sums[3] - sums[5];
            second = across.atan2(along);
            agreement = along.hypot(across);
        }
        if agreement > best.0 {
            best = (agreement, [first, second]);
        }
    }
    best.1
}
