//! Samples: parts of real fields, or simulated images of the same size.

use papsynth::key::Key;
use papsynth::recipe::Recipe;
use papsynth::truth::Group;
use papsynth::{Engine, Finished, Threads};
use papsynth_judge::{Control, Detail, FieldImage, Measurer, MeasurerParams, NucleiAnnotation, NucleiFrom};

use crate::error::Error;
use papsynth_judge::number::single;

/// Returns the engine of a recipe, with the model and the inputs of the caller.
pub type MakeEngine<'a> = dyn Fn(&Recipe) -> Result<Engine, papsynth::Error> + Sync + 'a;

/// Largest sample, pixels. Larger fields are cut into several samples.
const SAMPLE_PX: [usize; 2] = [1400, 1100];

/// Cuts, simulates and measures samples: the same for real and simulated fields.
#[derive(Debug, Clone)]
pub struct Sampler {
    /// Width and height of a sample.
    pub size_px: [usize; 2],
    pub(crate) pixel_um: f64,
    from: NucleiFrom,
    /// Whether hues are measured.
    pub(crate) colour: bool,
    pub(crate) measurer: Measurer,
}

impl Sampler {
    /// Returns the sampler for fields of a size. `detail` is the extent of the measurements.
    ///
    /// # Errors
    /// If the pixel size is out of range.
    pub fn new(field_px: [usize; 2], pixel_um: f64, from: NucleiFrom, detail: Detail) -> Result<Self, Error> {
        let measurer =
            Measurer::new(&MeasurerParams { pixel_um, nuclei_from: from, detail, ..MeasurerParams::default() })?;
        Ok(Self { size_px: Self::size_of(field_px), pixel_um, from, colour: false, measurer })
    }

    /// Returns the size of the samples of fields of a size, pixels.
    #[must_use]
    pub fn size_of(field_px: [usize; 2]) -> [usize; 2] {
        [0, 1].map(|i| field_px[i].min(SAMPLE_PX[i]))
    }

    /// Also measures the hues of stains, or does not: all images are colour images.
    #[must_use]
    pub fn with_colour(self, colour: bool) -> Self {
        Self { colour, ..self }
    }

    /// Cuts a field into as many samples as fit, centred and without gaps.
    #[must_use]
    pub fn samples(&self, field: &FieldImage) -> Vec<FieldImage> {
        let size = [field.width, field.height()];
        let [across, down] = [0, 1].map(|i| (size[i] / self.size_px[i]).max(1));
        let [left, top] =
            [(0, across), (1, down)].map(|(i, count)| (size[i] - (count * self.size_px[i]).min(size[i])) / 2);
        let places = (0..down).flat_map(|y| (0..across).map(move |x| (x, y)));
        places.map(|(x, y)| self.cut(field, left + x * self.size_px[0], top + y * self.size_px[1])).collect()
    }

    fn cut(&self, field: &FieldImage, left: usize, top: usize) -> FieldImage {
        let [wide, high] = self.size_px;
        let mut sample = field.cut([left, top], [wide.min(field.width - left), high.min(field.height() - top)]);
        if let NucleiAnnotation::Points(points) = &mut sample.nuclei {
            let [right, bottom] = [wide, high].map(|side| side as f64 - 0.5);
            points.retain(|[x, y]| *x > -0.5 && *y > -0.5 && *x < right && *y < bottom);
        }
        sample
    }

    /// Simulates an image of the size of the samples, or of the recipe if it has another size, under a condition of the
    /// recipe if there is one.
    ///
    /// # Errors
    /// If the engine cannot render it; [`Error::Stopped`] if the stop flag is set.
    pub fn simulate(
        &self,
        engine: &Engine,
        condition: Option<usize>,
        key: Key,
        control: &Control,
    ) -> Result<FieldImage, Error> {
        control.check()?;
        let (mut grey, mut channels) = (Vec::new(), 1);
        let scene = match condition {
            Some(condition) => engine.scene_under(condition, key)?,
            None => engine.scene(key)?,
        };
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
        const RED: usize = 0;
        const BLUE: usize = 2;
        let plane =
            |channel: usize| grey.iter().skip(channel).step_by(channels).map(|g| f32::from(*g)).collect::<Vec<f32>>();
        let is_colour = channels == 3;
        let truth = &finished.truth;
        Ok(FieldImage {
            name: format!("{}", key.index),
            group: String::new(),
            grey: plane(if is_colour { GREEN } else { 0 }),
            red_blue: is_colour.then(|| [RED, BLUE].map(plane)),
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
            // The measurement reduces masks to points.
            NucleiFrom::Masks | NucleiFrom::Points => NucleiAnnotation::Masks(truth.labels(Group::Nucleus).ids),
        }
    }
}
