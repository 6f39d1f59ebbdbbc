//! From a scene and the pieces of its mirrors to the flux on its receiver.

use helio_flux::{
    Choice, ConvolveOptions, Element, FluxError, FluxMap, RayOptions, Rays, Scene, SunShape, Watch,
    Way, choose_way, convolve_watched, rays_to_repeat, trace_rays_watched,
};

use super::{FluxScene, SceneMethod};

impl FluxScene {
    /// What the scene's sun and mirrors are for the library; `sun_shape` is that of the sun's form.
    #[must_use]
    pub fn lit<'a>(
        &'a self,
        elements: &'a [Element],
        toward: [f64; 3],
        sun_shape: &'a SunShape,
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

    /// By rays or by a convolution: as the scene says, or by its error with the reason.
    ///
    /// # Errors
    /// What [`choose_way`] refuses.
    pub fn way(&self, lit: &Scene<'_>, threads: usize) -> Result<(Way, Option<Choice>), FluxError> {
        let rays = &self.rays;
        Ok(match rays.method {
            SceneMethod::Auto => {
                let choice = choose_way(lit, rays.error, rays.seed, threads)?;
                (choice.way, Some(choice))
            }
            SceneMethod::Convolve => (Way::Convolution(rays.points), None),
            SceneMethod::Trace => (Way::Rays(rays.count), None),
        })
    }

    /// The flux by a way; `None` if `watch` wanted an end. It is told of rays (or elements) done and in all.
    ///
    /// # Errors
    /// What the library refuses.
    pub fn by_way(
        &self,
        lit: &Scene<'_>,
        way: Way,
        threads: usize,
        watch: Watch<'_>,
    ) -> Result<Option<FluxMap>, FluxError> {
        match way {
            Way::Convolution(points) => {
                let options = ConvolveOptions {
                    points,
                    threads,
                    ..ConvolveOptions::default()
                };
                convolve_watched(lit, &options, watch)
            }
            Way::Rays(count) => {
                let options = RayOptions {
                    rays: Rays::Total(count),
                    seed: self.rays.seed,
                    threads,
                    ..RayOptions::default()
                };
                trace_rays_watched(lit, &options, watch)
            }
            _ => Err(FluxError::BadValue {
                who: "scene",
                what: "way",
                wanted: "rays or a convolution",
                value: f64::NAN,
            }),
        }
    }

    /// A way that keeps the scene's error, where rays that were chosen for it turned out too few; `None` if they were not.
    #[must_use]
    pub fn again(&self, way: Way, map: &FluxMap) -> Option<Way> {
        match (self.rays.method, way) {
            (SceneMethod::Auto, Way::Rays(_)) => {
                rays_to_repeat(&self.receiver, map, self.rays.error).map(Way::Rays)
            }
            _ => None,
        }
    }

    /// The flux on the receiver by the scene's method. `elements` are the flat pieces of the mirrors \[m\], `toward`
    /// the direction to the sun, both in the receiver's frame; `threads` 0 for as many as the pool has. `watch` is told
    /// of rays (or elements) done and in all; `None` if it wanted an end.
    ///
    /// # Errors
    /// What the library refuses.
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
        watch: Watch<'_>,
    ) -> Result<Option<FluxMap>, FluxError> {
        let sun_shape = self.sun.form.shape()?;
        let lit = self.lit(elements, toward, &sun_shape);
        let (mut way, _) = self.way(&lit, threads)?;
        loop {
            let map = self.by_way(&lit, way, threads, watch)?;
            match map.as_ref().and_then(|map| self.again(way, map)) {
                Some(more) => way = more,
                None => return Ok(map),
            }
        }
    }
}
