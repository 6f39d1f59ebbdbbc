//! `[site]` and `[targets.NAME]`.

use std::collections::BTreeMap;

use helio_core::angle::radians;
use helio_core::sun::{SunError, SunPositions, SunSite, positions};
use helio_core::{Enu, EnuUnit, TargetPlane};

use crate::error::{IoError, Problem};
use crate::keys;
use crate::toml::Section;

/// Where the field lies, for the position of the sun.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Site {
    /// What it is called.
    pub name: Option<String>,
    /// Geodetic latitude \[rad\], north positive.
    pub latitude_rad: f64,
    /// Longitude \[rad\], east positive.
    pub longitude_rad: f64,
    /// Height above sea level \[m\].
    pub elevation_m: f64,
    /// Yearly mean air pressure at the site \[hPa\]; `None` for the standard atmosphere at its height.
    pub pressure_hpa: Option<f64>,
    /// Yearly mean air temperature \[°C\]; `None` for 12.
    pub temperature_c: Option<f64>,
    /// Terrestrial time minus UT1 \[s\]; `None` for an estimate from the date.
    pub delta_t_s: Option<f64>,
    /// UT1 minus UTC \[s\]; `None` for 0, which turns the sun by at most 0.004°.
    pub ut1_utc_s: Option<f64>,
}

impl Site {
    /// The observer that [`helio_core::sun`] computes with; `delta_t_s` and `ut1_utc_s` are its
    /// functions' own arguments.
    ///
    /// # Errors
    /// [`SunError`] never for a site read by [`load_field`](crate::load_field), whose ranges are narrower.
    pub fn sun_site(&self) -> Result<SunSite, SunError> {
        let mut site = SunSite::new(self.latitude_rad, self.longitude_rad, self.elevation_m)?;
        if let Some(pressure_hpa) = self.pressure_hpa {
            site = site.with_pressure_hpa(pressure_hpa)?;
        }
        if let Some(temperature_c) = self.temperature_c {
            site = site.with_temperature_c(temperature_c)?;
        }
        Ok(site)
    }

    /// Where the sun stands over the site at instants \[ns of Unix time\], by its own clock.
    ///
    /// # Errors
    /// [`SunError`] for instants outside the years of the algorithm.
    pub fn sun_positions(&self, unix_ns: &[i64]) -> Result<SunPositions, SunError> {
        let ut1_utc_s = self.ut1_utc_s.unwrap_or(0.0);
        positions(&self.sun_site()?, unix_ns, self.delta_t_s, ut1_utc_s)
    }

    pub(super) fn parse(site: &Section<'_>) -> Result<Self, IoError> {
        let needed = |key| site.number(key)?.ok_or_else(|| site.missing(key));
        Ok(Self {
            name: site.text(&keys::SITE_NAME)?.map(str::to_string),
            latitude_rad: radians(needed(&keys::LATITUDE)?),
            longitude_rad: radians(needed(&keys::LONGITUDE)?),
            elevation_m: needed(&keys::ELEVATION)?,
            pressure_hpa: site.number(&keys::PRESSURE)?,
            temperature_c: site.number(&keys::TEMPERATURE)?,
            delta_t_s: site.number(&keys::DELTA_T)?,
            ut1_utc_s: site.number(&keys::UT1_UTC)?,
        })
    }
}

/// What a heliostat can aim at: a point, or the centre of a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Target {
    /// The point to hit \[m\].
    pub centre: Enu,
    /// Its plane, unless it is a mere point.
    pub area: Option<TargetArea>,
}

/// A flat target and its size.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct TargetArea {
    /// Centre, normal and axes.
    pub plane: TargetPlane,
    /// Extent along `plane.right` \[m\].
    pub width_m: f64,
    /// Extent along `plane.down` \[m\].
    pub height_m: f64,
}

pub(super) fn targets(file: &Section<'_>) -> Result<BTreeMap<String, Target>, IoError> {
    let mut targets = BTreeMap::new();
    for (name, section) in file.named(&keys::TARGETS_TABLE)? {
        targets.insert(name.to_string(), Target::parse(&section)?);
    }
    Ok(targets)
}

impl Target {
    fn parse(target: &Section<'_>) -> Result<Self, IoError> {
        let centre = target
            .enu(&keys::CENTRE, keys::FAR_M)?
            .ok_or_else(|| target.missing(&keys::CENTRE))?;
        let centre = Enu::new(centre[0], centre[1], centre[2]);
        let Some(normal) = direction(target, &keys::NORMAL)? else {
            for key in [&keys::WIDTH, &keys::HEIGHT, &keys::RIGHT] {
                if target.has(key) {
                    let message = format!(
                        "{} is for a plane, which also needs {}",
                        target.dotted(key),
                        keys::NORMAL.name
                    );
                    return Err(target.error(key, Problem::Conflict { message }));
                }
            }
            return Ok(Self { centre, area: None });
        };
        let needed = |key| target.number(key)?.ok_or_else(|| target.missing(key));
        let (width_m, height_m) = (needed(&keys::WIDTH)?, needed(&keys::HEIGHT)?);
        let plane = match direction(target, &keys::RIGHT)? {
            None => TargetPlane::level(centre, normal),
            Some(right) => TargetPlane::with_right(centre, normal, right).map_err(|_| {
                let message = format!(
                    "{} must not be parallel to {}",
                    target.dotted(&keys::RIGHT),
                    keys::NORMAL.name
                );
                target.error(&keys::RIGHT, Problem::Conflict { message })
            })?,
        };
        Ok(Self {
            centre,
            area: Some(TargetArea {
                plane,
                width_m,
                height_m,
            }),
        })
    }
}

fn direction(target: &Section<'_>, key: &'static keys::Key) -> Result<Option<EnuUnit>, IoError> {
    let Some([east, north, up]) = target.enu(key, 1e9)? else {
        return Ok(None);
    };
    match EnuUnit::try_new(Enu::new(east, north, up)) {
        Ok(unit) => Ok(Some(unit)),
        Err(_) => {
            let message = format!("{} has no length, so no direction", target.dotted(key));
            Err(target.error(key, Problem::Conflict { message }))
        }
    }
}
