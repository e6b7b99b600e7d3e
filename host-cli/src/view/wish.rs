//! Wish: the picture that pages request, by its settings, its camera and changes of the scene.

use std::collections::BTreeSet;

use photoncard_driver::layer::Layers;
use photoncard_driver::quality::{Fit, Stated};
use photoncard_driver::render::{CardAddress, RenderError, RenderSettings};
use photoncard_driver::scene::{Aperture, Environment, Scene, SceneContents};

use super::request::{Extent, Setting, View};

/// Value of `--ic-error` if a page switches on the irradiance cache and the quality has none.
const IRRADIANCE_ERROR: f32 = 0.1;

/// Picture that pages request: settings, camera, and changes of the scene.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Wish {
    /// Settings of the final picture.
    pub(super) settings: RenderSettings,
    /// Settings that an option or a page has stated. A quality does not change them.
    stated: Stated,
    /// Assignments (`--set`) of the command line.
    given: Vec<String>,
    /// Assignments by pages: property, such as `wall.diffuse`, and values.
    edits: Vec<(String, Vec<f64>)>,
}

impl Wish {
    pub(super) fn new(settings: RenderSettings, stated: Stated, given: Vec<String>) -> Self {
        Self { settings, stated, given, edits: Vec::new() }
    }

    /// Returns whether no setting is left for pilot renders to choose.
    pub(super) fn states_all(&self) -> bool {
        !self.stated.needs_fit()
    }

    /// Assignments of the command line, then those of pages: the order in which they are applied.
    pub(super) fn assignments(&self) -> Vec<String> {
        self.given.iter().cloned().chain(self.edited()).collect()
    }

    /// Assignments by pages, as text.
    fn edited(&self) -> impl Iterator<Item = String> {
        self.edits.iter().map(|(name, value)| format!("{name}={}", numbers(value)))
    }

    /// Assignments by pages.
    pub(super) fn edits(&self) -> &[(String, Vec<f64>)] {
        &self.edits
    }

    /// Copy of this request for another scene: of the assignments of pages, with those that are possible
    /// there, and with its first camera if it has none of the chosen name.
    pub(super) fn for_scene(&self, sketch: &Sketch) -> Self {
        let mut wish = Self { edits: Vec::new(), ..self.clone() };
        let camera = &mut wish.settings.picture.camera;
        camera.take_if(|name| !sketch.0.cameras.iter().any(|camera| camera.name == *name));
        for edit in &self.edits {
            wish.edits.push(edit.clone());
            if sketch.with(&wish).is_err() {
                wish.edits.pop();
            }
        }
        wish
    }

    /// Sets position, target and projection of the camera, and whose lens and shift it has.
    pub(super) fn look(&mut self, view: View) {
        let View { camera, position, look_at, up, shift, lens, shown } = view;
        let picture = &mut self.settings.picture;
        (picture.camera_at, picture.look_at) = (Some(position), Some(look_at));
        picture.up = up.or(picture.up);
        if camera.is_some() {
            // A chosen camera has its own lens and shift.
            (picture.camera, picture.aperture, picture.focus, picture.shift) = (camera, None, None, None);
        }
        picture.shift = shift.or(picture.shift);
        if let Some([diameter, focus]) = lens {
            let is_pinhole = diameter == 0.0;
            picture.aperture = Some(Aperture::Diameter(diameter));
            picture.focus = (!is_pinhole).then_some(focus);
        }
        (picture.fov, picture.orthographic, picture.panorama) = match shown {
            Extent::Fov(degrees) => (Some(degrees), None, None),
            Extent::Height(metres) => (None, Some(metres), None),
            Extent::Angles(degrees) => (None, None, Some(degrees)),
        };
        // Only perspective pictures have a lens, and panoramas have no shift.
        if !matches!(shown, Extent::Fov(_)) {
            (picture.aperture, picture.focus) = (None, None);
        }
        if matches!(shown, Extent::Angles(_)) {
            picture.shift = None;
        }
    }

    /// Sets a property. If it was set before, the new value replaces the earlier value at the same position
    /// in the order of assignments.
    pub(super) fn set(&mut self, name: String, value: Vec<f64>) {
        match self.edits.iter_mut().find(|(edited, _)| *edited == name) {
            Some((_, earlier)) => *earlier = value,
            None => self.edits.push((name, value)),
        }
    }

    pub(super) fn change(&mut self, setting: Setting) {
        let RenderSettings { photons, integrator, schedule, .. } = &mut self.settings;
        let stated = &mut self.stated;
        match setting {
            Setting::Photons(count) => (photons.count, stated.photons) = (count, true),
            Setting::Samples(samples) => (integrator.samples, stated.samples) = (samples, true),
            Setting::GatherRays(rays) => (integrator.gather_rays, stated.gather_rays) = (rays, true),
            Setting::Order(order) => schedule.order = order,
            Setting::Tile(side) => schedule.tile = (side > 0).then_some(side),
            Setting::Cache(is_on) => {
                stated.cache = true;
                let error = integrator.irradiance_error.unwrap_or(IRRADIANCE_ERROR);
                integrator.irradiance_error = is_on.then_some(error);
            }
            Setting::Sampling(sampling) => integrator.sampling = sampling,
        }
        // Without gather rays there is no irradiance to interpolate: `photoncard render` has no cache then,
        // either.
        if integrator.gather_rays == 0 {
            integrator.irradiance_error = None;
        }
    }

    /// Checks the settings against the budgets of emulated cards. The budgets of remote cards are not known
    /// here.
    ///
    /// # Errors
    /// The first setting that exceeds the budget of a card.
    pub(super) fn check_cards(&self) -> Result<(), RenderError> {
        self.settings.cards.addresses.iter().try_for_each(|address| match address {
            CardAddress::Emulated { model, .. } => self.settings.check_budget(&model.kind().budget()),
            CardAddress::Remote(_) => Ok(()),
        })
    }

    /// Copy of this request with the settings of `other`, but its own picture (camera, size, layers) and
    /// assignments.
    pub(super) fn by_settings_of(&self, other: &Self) -> Self {
        let picture = self.settings.picture.clone();
        let settings = RenderSettings { picture, ..other.settings.clone() };
        Self { settings, stated: other.stated, ..self.clone() }
    }

    /// Requests all layers that pages show. Returns whether chips have to render more of them.
    pub(super) fn add_layers(&mut self) -> bool {
        let layers = &mut self.settings.picture.layers;
        let all = layers.and(&Layers::without_mattes());
        let has_changed = all.form() != layers.form();
        if has_changed {
            *layers = all;
        }
        has_changed
    }

    /// Applies the settings that pilot renders have chosen, except those that an option or a page has stated.
    pub(super) fn fit(&mut self, fit: &Fit) {
        fit.apply(&mut self.settings, self.stated);
    }

    /// Returns whether `other` differs in the scene or in the photons' settings: photons must then be traced
    /// again.
    pub(super) fn is_other_edition(&self, other: &Self) -> bool {
        let photons = |wish: &Self| (wish.settings.photons.clone(), wish.settings.integrator.seed);
        self.given != other.given || self.edits != other.edits || photons(self) != photons(other)
    }
}

/// Joins numbers by commas; each number in the text parses to the same bits.
pub(super) fn numbers<T: ToString>(values: &[T]) -> String {
    values.iter().map(T::to_string).collect::<Vec<_>>().join(",")
}

/// Reduced scene for quick checks of requests: one triangle for each material in use.
pub(super) struct Sketch(Scene);

impl Sketch {
    /// Creates the sketch of a scene without assignments. The sketch's environment is one texel: the maximum
    /// channel value in the scene's environment.
    pub(super) fn new(scene: &Scene) -> Self {
        let mut materials = BTreeSet::new();
        let triangles = scene.stored_triangles().filter(|triangle| materials.insert(triangle.material));
        let environment = scene.environment.as_ref().map(|map| {
            let brightest = map.texels.as_flattened().iter().copied().fold(0.0, f32::max);
            Environment { width: 1, height: 1, texels: vec![[brightest; 3]], strength: map.strength }
        });
        Self(Scene::from(SceneContents {
            triangles: triangles.copied().collect(),
            materials: scene.materials.clone(),
            lights: scene.lights.clone(),
            cameras: scene.cameras.clone(),
            offset: scene.offset,
            generator: scene.generator.clone(),
            environment,
            ..SceneContents::default()
        }))
    }

    /// Returns the sketch's scene after the assignments of a request, whose settings and camera are also
    /// checked.
    ///
    /// # Errors
    /// If an assignment, a setting or the camera is invalid, or no light is left.
    pub(super) fn with(&self, wish: &Wish) -> Result<Scene, RenderError> {
        let mut scene = self.0.clone();
        self.apply(wish, &mut scene)?;
        wish.settings.check()?;
        wish.settings.camera(&scene)?;
        Ok(scene)
    }

    /// Gives a scene the sketch's materials, lights and environment strength, with the assignments of a
    /// request.
    ///
    /// # Errors
    /// If an assignment is invalid, or no light is left.
    pub(super) fn apply(&self, wish: &Wish, scene: &mut Scene) -> Result<(), RenderError> {
        scene.materials.clone_from(&self.0.materials);
        scene.lights.clone_from(&self.0.lights);
        if let (Some(environment), Some(sketched)) = (&mut scene.environment, &self.0.environment) {
            environment.strength = sketched.strength;
        }
        wish.given.iter().try_for_each(|assignment| scene.apply(assignment))?;
        // Assignments of pages read no files.
        wish.edited().try_for_each(|assignment| scene.assign(&assignment))?;
        Ok(scene.check_light()?)
    }
}
