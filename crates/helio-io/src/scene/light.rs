//! From a scene and the pieces of its mirrors to the flux on its receiver.

use helio_flux::{
    ConvolveOptions, Element, FluxError, FluxMap, RayOptions, Rays, Scene, convolve_watched,
    trace_rays_watched,
};

use super::{FluxScene, SceneMethod};

/// Why there is no map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LightError {
    /// What the library says.
    #[error(transparent)]
    Flux(#[from] FluxError),
    /// A convolution that other points would answer otherwise.
    #[error(
        "convolve: with {points} by {points} points for each bin {received_w:.4} W of {reflected_w:.4} W reflected are received, \
         with {more} by {more} {other_w:.4} W, and {apart_w:.4} W lie in other bins; wanted less than {:.0} %: the \
         points lie too far apart for so small an image: more rows and columns of [receiver], more points of [rays], or \
         its method = \"trace\"",
        100.0 * SETTLED
    )]
    NotSettled {
        /// Points along each side of a bin.
        points: usize,
        /// Those that it was held against.
        more: usize,
        /// Reflected \[W\].
        reflected_w: f64,
        /// Received with these points \[W\].
        received_w: f64,
        /// Received with the others \[W\].
        other_w: f64,
        /// What lies in other bins \[W\].
        apart_w: f64,
    },
}

/// Of the reflected power so much at most may lie in other bins with other points.
const SETTLED: f64 = 0.02;

impl FluxScene {
    /// What the scene's sun and mirrors are for the library; `sun_shape` is that of the sun's form.
    #[must_use]
    pub fn lit<'a>(
        &'a self,
        elements: &'a [Element],
        toward: [f64; 3],
        sun_shape: &'a helio_flux::SunShape,
    ) -> Scene<'a> {
        Scene {
            elements,
            receiver: &self.receiver,
            sun: toward,
            dni_w_m2: self.sun.dni_w_m2,
            sun_shape,
            optical_error: self.mirror.error,
        }
    }

    /// The flux on the receiver by the scene's method. `elements` are the flat pieces of the mirrors \[m\], `toward`
    /// the direction to the sun, both in the receiver's frame; `threads` 0 for as many as the pool has. `watch` is told
    /// of rays (or bins) done and in all; `None` if it wanted an end.
    ///
    /// # Errors
    /// [`LightError`]: what the library refuses, and a convolution whose points lie too far apart.
    ///
    /// ```
    /// use helio_flux::Element;
    /// use helio_io::{SceneOf, scene_of_text};
    /// let text = "[receiver]\nshape = \"plane\"\ncentre_m = [0, 0, 5]\nfacing = [0, 0, -1]\nwidth_m = 2\nheight_m = 2";
    /// let scene = scene_of_text("scene".as_ref(), text, SceneOf::Mesh)?;
    /// let mirror = Element::quadrilateral([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])?;
    /// let map = scene.light(&[mirror], [0.0, 0.0, 1.0], 0, &|_, _| true)?;
    /// assert!(map.is_some_and(|map| (map.account().received_w - 1000.0).abs() < 1e-6));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn light(
        &self,
        elements: &[Element],
        toward: [f64; 3],
        threads: usize,
        watch: helio_flux::Watch<'_>,
    ) -> Result<Option<FluxMap>, LightError> {
        let sun_shape = self.sun.form.shape()?;
        let lit = self.lit(elements, toward, &sun_shape);
        if self.rays.method == SceneMethod::Trace {
            let options = RayOptions {
                rays: Rays::Total(self.rays.count),
                seed: self.rays.seed,
                threads,
                ..RayOptions::default()
            };
            return Ok(trace_rays_watched(&lit, &options, watch)?);
        }
        let options = |points| ConvolveOptions { points, threads };
        let Some(map) = convolve_watched(&lit, &options(self.rays.points), watch)? else {
            return Ok(None);
        };
        let going = |_: u64, all: u64| watch(0, all);
        let more = other_points(self.rays.points);
        let Some(other) = convolve_watched(&lit, &options(more), &going)? else {
            return Ok(None);
        };
        self.settled(&map, &other)?;
        Ok(Some(map))
    }

    /// Refuses a map whose points lie farther apart than its image is wide: they find it by chance, and the power with
    /// it.
    fn settled(&self, map: &FluxMap, other: &FluxMap) -> Result<(), LightError> {
        let account = map.account();
        let reflected_w = account.incoming_w - account.reflection_loss_w;
        let bins = map.irradiance_w_m2().iter().zip(other.irradiance_w_m2());
        let apart_w: f64 = bins
            .enumerate()
            .map(|(bin, (one, other))| self.receiver.bin_area_m2(bin) * (one - other).abs())
            .sum();
        let surplus_w = account.received_w - reflected_w;
        if apart_w <= SETTLED * reflected_w && surplus_w <= 0.5 * SETTLED * reflected_w {
            return Ok(());
        }
        Err(LightError::NotSettled {
            points: self.rays.points,
            more: other_points(self.rays.points),
            reflected_w,
            received_w: account.received_w,
            other_w: other.account().received_w,
            apart_w,
        })
    }
}

/// Points of a second integral, which the first is held against.
const fn other_points(points: usize) -> usize {
    if points < 64 { points + 1 } else { points - 1 }
}
