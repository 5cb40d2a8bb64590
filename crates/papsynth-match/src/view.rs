//! Windows: cut from real fields, or simulated.

use papsynth::key::Key;
use papsynth::recipe::Recipe;
use papsynth::truth::Group;
use papsynth::{Engine, Finished, Threads};
use papsynth_judge::{Control, FieldImage, Measurer, MeasurerParams, NucleiAnnotation, NucleiFrom};

use crate::error::Error;
use papsynth_judge::number::{single, whole};

/// Returns the engine of a recipe, with the model and the inputs of the caller.
pub type MakeEngine<'a> = dyn Fn(&Recipe) -> Result<Engine, papsynth::Error> + Sync + 'a;

/// Largest window, pixels. Larger fields are cut into several windows.
const WINDOW_PX: [usize; 2] = [640, 480];

/// Margin of the simulated field around a window, µm: cells in the margin extend into the window, as in real fields.
const MARGIN_UM: f64 = 20.0;

/// Cuts, simulates and measures windows: the same for real and simulated fields.
#[derive(Debug, Clone)]
pub struct WindowSampler {
    /// Width and height of a window.
    pub window_px: [usize; 2],
    pub(crate) pixel_um: f64,
    margin_px: usize,
    from: NucleiFrom,
    pub(crate) measurer: Measurer,
}

impl WindowSampler {
    /// Returns the sampler for fields of a size.
    ///
    /// # Errors
    /// If the pixel size is out of range.
    pub fn new(field_px: [usize; 2], pixel_um: f64, from: NucleiFrom) -> Result<Self, Error> {
        let measurer = Measurer::new(&MeasurerParams {
            pixel_um,
            nuclei_from: from,
            detail: papsynth_judge::Detail::Statistics,
            ..MeasurerParams::default()
        })?;
        let window_px = [0, 1].map(|i| field_px[i].min(WINDOW_PX[i]));
        Ok(Self { window_px, pixel_um, margin_px: whole(MARGIN_UM / pixel_um), from, measurer })
    }

    /// Returns width and height of the field that is simulated for a window.
    #[must_use]
    pub fn simulated_px(&self) -> [usize; 2] {
        self.window_px.map(|side| side + 2 * self.margin_px)
    }

    /// Cuts a field into as many windows as fit, centred and without gaps.
    #[must_use]
    pub fn windows(&self, field: &FieldImage) -> Vec<FieldImage> {
        let size = [field.width, field.height()];
        let [across, down] = [0, 1].map(|i| (size[i] / self.window_px[i]).max(1));
        let [left, top] =
            [(0, across), (1, down)].map(|(i, count)| (size[i] - (count * self.window_px[i]).min(size[i])) / 2);
        let places = (0..down).flat_map(|y| (0..across).map(move |x| (x, y)));
        places.map(|(x, y)| self.cut(field, left + x * self.window_px[0], top + y * self.window_px[1])).collect()
    }

    fn cut(&self, field: &FieldImage, left: usize, top: usize) -> FieldImage {
        let [wide, high] = self.window_px;
        let mut window = field.cut([left, top], [wide.min(field.width - left), high.min(field.height() - top)]);
        if let NucleiAnnotation::Points(points) = &mut window.nuclei {
            let [right, bottom] = [wide, high].map(|side| side as f64 - 0.5);
            points.retain(|[x, y]| *x > -0.5 && *y > -0.5 && *x < right && *y < bottom);
        }
        window
    }

    /// Simulates a window.
    ///
    /// # Errors
    /// If the engine cannot render it; [`Error::Stopped`] if the stop flag is set.
    pub fn simulate(&self, engine: &Engine, key: Key, control: &Control) -> Result<FieldImage, Error> {
        Ok(self.cut(&self.simulate_with(engine, key, control)?, self.margin_px, self.margin_px))
    }

    /// Simulates a complete field.
    ///
    /// # Errors
    /// If the engine cannot render it.
    pub fn simulate_field(&self, engine: &Engine, key: Key) -> Result<FieldImage, Error> {
        self.simulate_with(engine, key, &Control::NONE)
    }

    fn simulate_with(&self, engine: &Engine, key: Key, control: &Control) -> Result<FieldImage, Error> {
        control.check()?;
        let (mut grey, mut channels) = (Vec::new(), 1);
        let scene = engine.scene(key)?;
        control.check()?;
        let finished = engine.image::<Error>(scene, Threads::One, |plane| {
            control.check()?;
            grey.clone_from(&plane.grey);
            channels = plane.channels;
            Ok(())
        })?;
        let bits = match &engine.recipe().camera.bits {
            papsynth::recipe::Number::Fixed(bits) => *bits,
            drawn => drawn.bounds()[1],
        };
        /// Colour images: green, which the stains of nuclei and cytoplasm absorb most.
        const GREEN: usize = 1;
        let channel = if channels == 3 { GREEN } else { 0 };
        let truth = &finished.truth;
        Ok(FieldImage {
            name: format!("{}", key.index),
            group: String::new(),
            grey: grey.iter().skip(channel).step_by(channels).map(|g| f32::from(*g)).collect(),
            width: truth.width,
            full_scale: single(libm::exp2(bits) - 1.0),
            nuclei: self.annotation(&finished),
        })
    }

    /// Returns the annotation that real fields also have.
    fn annotation(&self, finished: &Finished) -> NucleiAnnotation {
        let truth = &finished.truth;
        match self.from {
            NucleiFrom::Search => NucleiAnnotation::None,
            NucleiFrom::Masks => NucleiAnnotation::Masks(truth.labels(Group::Nucleus).ids),
            NucleiFrom::Points => {
                let pixel_um = finished.scene.view.pixel_um;
                let nuclei = truth.objects.iter().filter(|o| o.group() == Group::Nucleus);
                NucleiAnnotation::Points(nuclei.map(|o| o.centre_um.map(|v| v / pixel_um - 0.5)).collect())
            }
        }
    }
}
