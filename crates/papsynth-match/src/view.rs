//! Windows on slides: cut out of real fields, or simulated.

use papsynth::key::Key;
use papsynth::recipe::Recipe;
use papsynth::truth::Group;
use papsynth::{Engine, Finished, Threads};
use papsynth_judge::{Gauge, GaugeParams, Known, NucleiFrom, Picture};

use crate::error::Error;
use papsynth_judge::number::{single, whole};

/// Makes the engine of a recipe: with the caller's model and inputs.
pub type MakeEngine<'a> = dyn Fn(&Recipe) -> Result<Engine, papsynth::Error> + Sync + 'a;

/// Largest window, pixels: what is larger is cut into several.
const WINDOW_PX: [usize; 2] = [640, 480];

/// Width of the slide around a window that is simulated with it, µm: cells there reach into the window, as in real fields.
const MARGIN_UM: f64 = 20.0;

/// How pictures are looked at: real ones and simulated ones the same.
#[derive(Debug, Clone)]
pub struct View {
    /// Columns and rows of a window.
    pub window_px: [usize; 2],
    pub(crate) pixel_um: f64,
    margin_px: usize,
    from: NucleiFrom,
    pub(crate) gauge: Gauge,
}

impl View {
    /// Of fields of a size.
    ///
    /// # Errors
    /// If the size of a pixel is out of range.
    pub fn new(field_px: [usize; 2], pixel_um: f64, from: NucleiFrom) -> Result<Self, Error> {
        let gauge = Gauge::new(&GaugeParams {
            pixel_um,
            nuclei_from: from,
            detail: papsynth_judge::Detail::Statistics,
            ..GaugeParams::default()
        })?;
        let window_px = [0, 1].map(|i| field_px[i].min(WINDOW_PX[i]));
        Ok(Self { window_px, pixel_um, margin_px: whole(MARGIN_UM / pixel_um), from, gauge })
    }

    /// Columns and rows of what is simulated for a window.
    #[must_use]
    pub fn simulated_px(&self) -> [usize; 2] {
        self.window_px.map(|side| side + 2 * self.margin_px)
    }

    /// As many windows as a field holds, side by side about its middle.
    #[must_use]
    pub fn windows(&self, field: &Picture) -> Vec<Picture> {
        let size = [field.width, field.height()];
        let [across, down] = [0, 1].map(|i| (size[i] / self.window_px[i]).max(1));
        let [left, top] =
            [(0, across), (1, down)].map(|(i, count)| (size[i] - (count * self.window_px[i]).min(size[i])) / 2);
        let places = (0..down).flat_map(|y| (0..across).map(move |x| (x, y)));
        places.map(|(x, y)| self.cut(field, left + x * self.window_px[0], top + y * self.window_px[1])).collect()
    }

    fn cut(&self, field: &Picture, left: usize, top: usize) -> Picture {
        let [wide, high] = self.window_px;
        let mut window = field.cut([left, top], [wide.min(field.width - left), high.min(field.height() - top)]);
        if let Known::Points(points) = &mut window.nuclei {
            let [right, bottom] = [wide, high].map(|side| side as f64 - 0.5);
            points.retain(|[x, y]| *x > -0.5 && *y > -0.5 && *x < right && *y < bottom);
        }
        window
    }

    /// Simulates a window.
    ///
    /// # Errors
    /// If the engine cannot make it.
    pub fn simulate(&self, engine: &Engine, key: Key) -> Result<Picture, papsynth::Error> {
        Ok(self.cut(&self.simulate_field(engine, key)?, self.margin_px, self.margin_px))
    }

    /// Simulates a whole field.
    ///
    /// # Errors
    /// If the engine cannot make it.
    pub fn simulate_field(&self, engine: &Engine, key: Key) -> Result<Picture, papsynth::Error> {
        let (mut grey, mut channels) = (Vec::new(), 1);
        let finished = engine.stream::<papsynth::Error>(key, Threads::One, |plane| {
            grey.clone_from(&plane.grey);
            channels = plane.channels;
            Ok(())
        })?;
        let bits = match &engine.recipe().camera.bits {
            papsynth::recipe::Number::Fixed(bits) => *bits,
            drawn => drawn.bounds()[1],
        };
        /// Of colours, green: stains of nuclei and of cytoplasm absorb it most.
        const GREEN: usize = 1;
        let channel = if channels == 3 { GREEN } else { 0 };
        let truth = &finished.truth;
        Ok(Picture {
            name: format!("{}", key.index),
            group: String::new(),
            grey: grey.iter().skip(channel).step_by(channels).map(|g| f32::from(*g)).collect(),
            width: truth.width,
            full_scale: single(libm::exp2(bits) - 1.0),
            nuclei: self.known(&finished),
        })
    }

    /// As much of the truth as is known of real fields.
    fn known(&self, finished: &Finished) -> Known {
        let truth = &finished.truth;
        match self.from {
            NucleiFrom::Search => Known::Nothing,
            NucleiFrom::Masks => Known::Masks(truth.labels(Group::Nucleus).ids),
            NucleiFrom::Points => {
                let pixel_um = finished.scene.view.pixel_um;
                let nuclei = truth.objects.iter().filter(|o| o.group() == Group::Nucleus);
                Known::Points(nuclei.map(|o| o.centre_um.map(|v| v / pixel_um - 0.5)).collect())
            }
        }
    }
}
