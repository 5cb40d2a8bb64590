//! Whole slides, larger than memory: any part of a slide can be generated alone.
//!
//! The engine images a slide frame by frame, like the camera of a scanner. Frames form a grid that starts at the first
//! pixel of the slide. Each frame is illuminated and exposed separately, with a border that is cropped. Objects are
//! drawn per plot, independently of frames (`scene/plots.rs`), and each object is imaged in a separate patch, so that
//! frames join without seams. A part of the slide is cropped from the frames that it overlaps: its size and position do
//! not change a pixel.

mod cache;

use std::ops::Range;
use std::sync::Arc;

use crate::engine::Engine;
use crate::error::{Error, ErrorKind};
use crate::key::Key;
use crate::phantom::{NoiseFields, Phantom};
use crate::recipe::{Imaging, InvalidField, Optics};
use crate::render::{FrameBuffers, Rendering, Work, phantoms};
use crate::scene::{BEYOND, Object, PLOT_PX, Plot, Population, Scene, SlideFrame, View};
use crate::threads::{self, Threads};
use crate::transmit::{self, LightPath};
use crate::truth::{Group, LabelMap, Mask, ObjectTruth, Truth};

use cache::PhantomCache;

/// A whole slide of the recipe and the model of an engine.
///
/// ```
/// use papsynth::model::Model;
/// use papsynth::recipe::Preset;
/// use papsynth::{Engine, Inputs, Threads};
///
/// let mut recipe = Preset::Sparse.recipe();
/// (recipe.scan.width_px, recipe.scan.height_px, recipe.scan.frame_px) = (300, 200, 128);
/// let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default())?;
/// let slide = engine.slide(1, 0)?;
/// let part = slide.part([100, 50], [64, 32], Threads::One)?;
/// assert_eq!(part.planes[0].grey.len(), 64 * 32);
/// # Ok::<(), papsynth::Error>(())
/// ```
pub struct Slide<'a> {
    engine: &'a Engine,
    number: u64,
    population: Population,
    /// The scene of the empty slide.
    empty: Scene,
    /// The optics.
    path: LightPath,
    /// Width of the border around a frame that is exposed and cropped, pixels.
    border_px: i64,
    /// The noise fields of all frames.
    noise_fields: NoiseFields<'a>,
    cache: PhantomCache,
}

impl core::fmt::Debug for Slide<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Slide").field("number", &self.number).field("size_px", &self.size_px()).finish_non_exhaustive()
    }
}

/// A part of a slide: an image with ground truth.
#[derive(Debug, Clone)]
pub struct SlidePart {
    /// Column and row of the first pixel on the slide.
    pub origin_px: [u32; 2],
    /// Columns and rows.
    pub size_px: [u32; 2],
    /// Focal planes.
    pub planes: Vec<PartPlane>,
    /// Label maps of cytoplasm, nuclei and debris, in the order of [`Group::ALL`]: the id of the topmost object at each
    /// pixel, 0 if there is none. Dirt has no ids.
    pub labels: Vec<LabelMap>,
    /// Number of overlapping cytoplasms at each pixel.
    pub layers: Vec<u16>,
    /// Ground truth of each object whose centre is in this part, and of each part of a cell. Masks and places are in
    /// pixels of the slide; masks are complete, also outside this part. Visible masks are empty: see `labels`.
    pub objects: Vec<ObjectTruth>,
}

/// A focal plane of a part of a slide.
#[derive(Debug, Clone, PartialEq)]
pub struct PartPlane {
    /// Position of the stage, µm.
    pub stage_um: f64,
    /// Grey levels, row by row, with interleaved channels.
    pub grey: Vec<u16>,
    /// Grey levels without noise, before rounding; empty if not requested.
    pub noise_free: Vec<f32>,
}

impl Engine {
    /// Returns the whole slide with this number. The slides of a seed have different numbers.
    ///
    /// # Errors
    /// If the recipe is not valid for a slide: the field, its value, and what is accepted.
    pub fn slide(&self, seed: u64, number: u64) -> Result<Slide<'_>, Error> {
        Slide::new(self, seed, number)
    }
}

impl<'a> Slide<'a> {
    /// Largest slide number.
    pub const LAST: u64 = (1 << 30) - 1;

    fn new(engine: &'a Engine, seed: u64, number: u64) -> Result<Self, Error> {
        let recipe = engine.recipe();
        let fail =
            |field: &str, message: String| Error::Recipe(vec![InvalidField { field: field.to_owned(), message }]);
        if number > Self::LAST {
            return Err(fail("slide", format!("{number} is out of range: expected 0 to {}", Self::LAST)));
        }
        if matches!(&recipe.optics, Optics::BrightField(microscope) if microscope.imaging == Imaging::Abbe) {
            return Err(fail(
                "optics.imaging",
                "\"abbe\" is not available for slides: expected \"product\"".to_owned(),
            ));
        }
        let key = Key { seed, index: number };
        let (population, mut empty) = Population::new(recipe, &engine.model, key).map_err(Error::Layout)?;
        empty.slide = number;
        empty.background.illumination = empty.background.illumination.weakened(recipe.scan.residual_shading);
        let nothing = transmit::Specimen { scene: &empty, phantoms: &[], work: &Work::on(Threads::One) };
        let path = LightPath::new(nothing, &engine.microscopes).map_err(Error::Layout)?;
        let border_px = path.image_blur_radius_px() as i64;
        let reach_px = recipe.scan.max_object_radius_um / empty.view.pixel_um;
        let most = (BEYOND - 1) as f64 * PLOT_PX as f64;
        if reach_px > most {
            let message = format!(
                "{} is out of range for pixels of {} µm: expected at most {:.0}",
                recipe.scan.max_object_radius_um,
                empty.view.pixel_um,
                most * empty.view.pixel_um
            );
            return Err(fail("scan.max_object_radius_um", message));
        }
        let noise_fields = engine.assets.noise_fields.fields(empty.key);
        let cache = PhantomCache::default();
        Ok(Self { engine, number, population, empty, path, border_px, noise_fields, cache })
    }

    /// Returns the columns and rows of the slide.
    #[must_use]
    pub fn size_px(&self) -> [u32; 2] {
        let scan = &self.engine.recipe().scan;
        [scan.width_px, scan.height_px]
    }

    /// Returns the number of the slide.
    #[must_use]
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Returns the pixel size, µm.
    #[must_use]
    pub fn pixel_um(&self) -> f64 {
        self.empty.view.pixel_um
    }

    /// Returns the positions of the stage at the focal planes, µm.
    #[must_use]
    pub fn planes_um(&self) -> &[f64] {
        &self.empty.planes_um
    }

    /// Returns the number of channels: 1 or 3.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.empty.channels()
    }

    /// Returns the bit depth of grey levels.
    #[must_use]
    pub fn bits(&self) -> u32 {
        self.empty.camera.bits
    }

    /// Returns the centre of the deposit, µm from the first pixel of the slide. It may be outside the slide.
    #[must_use]
    pub fn deposit_um(&self) -> [f64; 2] {
        self.population.middle_um()
    }

    /// Returns the columns and rows of frames.
    #[must_use]
    pub fn frames(&self) -> [u32; 2] {
        self.size_px().map(|side| side.div_ceil(self.side_px()))
    }

    /// Returns the size of a frame, pixels.
    #[must_use]
    pub fn side_px(&self) -> u32 {
        self.engine.recipe().scan.frame_px
    }

    /// Returns all objects that may be visible in a part of the slide, by id. No image is computed.
    ///
    /// # Errors
    /// If the image of an object is larger than `scan.max_object_radius_um`, or a plot has too many objects.
    pub fn objects(&self, origin_px: [u32; 2], size_px: [u32; 2]) -> Result<Vec<Object>, Error> {
        let low = origin_px.map(i64::from);
        let high = [0, 1].map(|axis| low[axis] + i64::from(size_px[axis]));
        self.reaching(low, high).map_err(|cause| self.fail(cause))
    }

    fn fail(&self, cause: ErrorKind) -> Error {
        Error::Image { index: self.number, cause }
    }

    /// Returns the objects that reach into the rectangle of the slide from `low` to `high`. Positions of plots are
    /// relative to `low`.
    fn reaching(&self, low: [i64; 2], high: [i64; 2]) -> Result<Vec<Object>, ErrorKind> {
        let pixel_um = self.pixel_um();
        let most_um = self.engine.recipe().scan.max_object_radius_um;
        let halo = (most_um / pixel_um).ceil() as i64;
        let plots = |axis: usize| {
            let [first, last] = [low[axis] - halo, high[axis] - 1 + halo].map(|at| at.div_euclid(PLOT_PX));
            first.max(-BEYOND)..=last
        };
        let mut found = Vec::new();
        for row in plots(1) {
            for column in plots(0) {
                let at = [column, row];
                let plot: Arc<Vec<Object>> = self.population.plot(at)?;
                for object in plot.iter() {
                    let reach_px = self.reach_px(object)?;
                    if reach_px > halo as f64 {
                        let (kind, reach_um) = (object.body.kind().name(), reach_px * pixel_um);
                        return Err(ErrorKind::TooFar { kind, reach_um, most_um });
                    }
                    let at_px = [0, 1].map(|axis| at[axis] * PLOT_PX - low[axis]);
                    let meets = (0..2).all(|axis| {
                        let middle = object.centre_um[axis] / pixel_um + at_px[axis] as f64;
                        middle + reach_px > 0.0 && middle - reach_px < (high[axis] - low[axis]) as f64
                    });
                    if meets {
                        let plot = object.plot.map(|plot| Plot { at_px, ..plot });
                        found.push(Object { plot, ..object.clone() });
                    }
                }
            }
        }
        Ok(found)
    }

    /// Returns the distance from the centre of an object to the edge of its blurred image, at most.
    fn reach_px(&self, object: &Object) -> Result<f64, ErrorKind> {
        let spread_px = self.path.object_blur_radius_px(&self.empty, object.depth_um)?;
        Ok(object.body.reach_um(self.pixel_um()) / self.pixel_um() + 3.0 + spread_px as f64)
    }

    /// Returns the phantoms of the objects of frame `at`. Those that also reach into the next frames are cached.
    fn phantoms(&self, at: [u32; 2], scene: &Scene, threads: Threads) -> Result<Vec<Phantom>, ErrorKind> {
        let n = scene.oversampling();
        let mut found: Vec<Option<Phantom>> = scene.objects.iter().map(|object| self.cache.get(object, n)).collect();
        let missing = scene.objects.iter().zip(&found).filter(|(_, found)| found.is_none());
        let missing: Vec<&Object> = missing.map(|(object, _)| object).collect();
        let drawn = phantoms(&self.engine.assets, &self.noise_fields, scene, &missing, &Work::on(threads))?;
        let (side, frames) = (f64::from(self.side_px()), self.frames());
        for (place, (object, phantom)) in
            found.iter_mut().filter(|found| found.is_none()).zip(missing.iter().zip(drawn))
        {
            let (centre_um, reach_px) = (scene.place_um(object), self.reach_px(object)?);
            let is_beyond = |axis: usize| centre_um[axis] / scene.view.pixel_um + reach_px > side;
            if (0..2).any(|axis| at[axis] + 1 < frames[axis] && is_beyond(axis)) {
                self.cache.insert(object, &phantom);
            }
            *place = Some(phantom);
        }
        Ok(found.into_iter().flatten().collect())
    }

    /// Returns a frame, cropped to the slide.
    ///
    /// # Errors
    /// As [`Slide::objects`], or if the frame is outside the slide.
    pub fn frame(&self, at: [u32; 2], threads: Threads) -> Result<SlidePart, Error> {
        let frames = self.frames();
        if at[0] >= frames[0] || at[1] >= frames[1] {
            return Err(self.fail(ErrorKind::NoFrame(at, frames)));
        }
        let exposed = self.expose(at, [0, 0], self.size_px(), threads, true).map_err(|cause| self.fail(cause))?;
        let mut part = SlidePart::blank(exposed.origin_px, exposed.size_px, self.planes_um(), self.channels(), true);
        part.lay(exposed, self.channels());
        Ok(part)
    }

    /// Returns the intersection of a part of the slide with a frame.
    fn expose(
        &self,
        at: [u32; 2],
        origin_px: [u32; 2],
        size_px: [u32; 2],
        threads: Threads,
        noise_free: bool,
    ) -> Result<Exposed, ErrorKind> {
        let (side, pixel_um, slide_px) = (self.side_px(), self.pixel_um(), self.size_px());
        let end_px = [0, 1].map(|axis| (origin_px[axis] + size_px[axis]).min((at[axis] * side).saturating_add(side)));
        let origin_px = [0, 1].map(|axis| origin_px[axis].max(at[axis] * side));
        let size_px = [0, 1].map(|axis| end_px[axis] - origin_px[axis]);
        let low = at.map(|at| i64::from(at * side) - self.border_px);
        let whole = side as usize + 2 * self.border_px as usize;
        let scene = Scene {
            view: View { width: whole, height: whole, pixel_um },
            frame: Some(SlideFrame { number: at[1] << 16 | at[0], origin_px: low }),
            objects: self.reaching(low, low.map(|at| at + whole as i64))?,
            ..self.empty.clone()
        };
        let channels = scene.channels();
        let first = [0, 1].map(|axis| (i64::from(origin_px[axis]) - low[axis]) as usize);
        let cut = Cut { first, whole, size: size_px.map(|side| side as usize) };
        let within = |place_um: [f64; 2]| {
            (0..2).all(|axis| {
                let at = (place_um[axis] / pixel_um).floor() - first[axis] as f64;
                at >= 0.0 && at < f64::from(size_px[axis])
            })
        };
        let phantoms = self.phantoms(at, &scene, threads)?;
        self.engine.with_buffers(|buffers: &mut FrameBuffers| {
            let Engine { assets, microscopes, .. } = self.engine;
            let mut rendering = Rendering::new(assets, microscopes, scene, phantoms, Work::on(threads), buffers)?;
            let mut planes = Vec::new();
            for index in 0..rendering.planes() {
                let plane = rendering.plane(index, buffers)?;
                planes.push(PartPlane {
                    stage_um: plane.stage_um,
                    grey: cut.of(&plane.grey, channels),
                    noise_free: if noise_free { cut.of(&plane.noise_free, channels) } else { Vec::new() },
                });
            }
            let (truth, objects) = rendering.slide_truth(slide_px, within, buffers);
            Ok(Exposed { origin_px, size_px, planes, truth, cut, objects })
        })
    }

    /// Returns a part of the slide, cropped from the frames that it overlaps.
    ///
    /// # Errors
    /// As [`Slide::frame`], or if the part is not inside the slide.
    pub fn part(&self, origin_px: [u32; 2], size_px: [u32; 2], threads: Threads) -> Result<SlidePart, Error> {
        self.cut(origin_px, size_px, threads, true)
    }

    /// Returns a part of the slide without noise-free images, which take four times the memory of the image.
    ///
    /// # Errors
    /// As [`Slide::part`].
    pub fn picture(&self, origin_px: [u32; 2], size_px: [u32; 2], threads: Threads) -> Result<SlidePart, Error> {
        self.cut(origin_px, size_px, threads, false)
    }

    fn cut(
        &self,
        origin_px: [u32; 2],
        size_px: [u32; 2],
        threads: Threads,
        noise_free: bool,
    ) -> Result<SlidePart, Error> {
        let slide_px = self.size_px();
        let inside = (0..2).all(|axis| {
            size_px[axis] > 0 && origin_px[axis].checked_add(size_px[axis]).is_some_and(|end| end <= slide_px[axis])
        });
        if !inside {
            return Err(self.fail(ErrorKind::OffSlide { origin_px, size_px, slide_px }));
        }
        let side = self.side_px();
        let frames = |axis: usize| origin_px[axis] / side..=(origin_px[axis] + size_px[axis] - 1) / side;
        let mut part = SlidePart::blank(origin_px, size_px, self.planes_um(), self.channels(), noise_free);
        let frames: Vec<[u32; 2]> = frames(1).flat_map(|row| frames(0).map(move |column| [column, row])).collect();
        // In chunks, because each frame takes the memory of an image.
        for frames in frames.chunks(threads::count(threads)) {
            let inner = if frames.len() > 1 { Threads::One } else { threads };
            for frame in threads::map(threads, frames, |&at| self.expose(at, origin_px, size_px, inner, noise_free)) {
                part.lay(frame.map_err(|cause| self.fail(cause))?, self.channels());
            }
        }
        part.objects.sort_by_key(|object| (object.id, object.part));
        Ok(part)
    }
}

/// A frame, cropped to a part.
struct Exposed {
    origin_px: [u32; 2],
    size_px: [u32; 2],
    planes: Vec<PartPlane>,
    /// Ground truth of the frame with its border.
    truth: Truth,
    cut: Cut,
    objects: Vec<ObjectTruth>,
}

impl SlidePart {
    fn blank(origin_px: [u32; 2], size_px: [u32; 2], planes_um: &[f64], channels: usize, noise_free: bool) -> Self {
        let pixels = size_px[0] as usize * size_px[1] as usize;
        let plane = |stage_um: &f64| PartPlane {
            stage_um: *stage_um,
            grey: vec![0; pixels * channels],
            noise_free: if noise_free { vec![0.0; pixels * channels] } else { Vec::new() },
        };
        let labels = Group::ALL.map(|_| LabelMap { width: size_px[0] as usize, ids: vec![0; pixels] });
        Self {
            origin_px,
            size_px,
            planes: planes_um.iter().map(plane).collect(),
            labels: labels.into(),
            layers: vec![0; pixels],
            objects: Vec::new(),
        }
    }

    /// Copies a cropped frame that is inside this part.
    fn lay(&mut self, exposed: Exposed, channels: usize) {
        let [x, y] = [0, 1].map(|axis| (exposed.origin_px[axis] - self.origin_px[axis]) as usize);
        let (width, columns) = (self.size_px[0] as usize, exposed.cut.size[0]);
        let at = y * width + x;
        fn copy<T: Copy>(to: &mut [T], from: &[T], [at, width, columns]: [usize; 3]) {
            for (row, from) in from.chunks_exact(columns).enumerate() {
                to[at + row * width..][..columns].copy_from_slice(from);
            }
        }
        let place = [at, width, columns].map(|pixels| pixels * channels);
        for (plane, others) in self.planes.iter_mut().zip(&exposed.planes) {
            copy(&mut plane.grey, &others.grey, place);
            copy(&mut plane.noise_free, &others.noise_free, place);
        }
        for object in &exposed.truth.objects {
            let group = Group::ALL.iter().position(|group| *group == object.group()).unwrap_or_default();
            let ids = &mut self.labels[group].ids[at..];
            exposed.cut.for_each_run(&object.visible, width, |run| ids[run].fill(object.id));
            if object.group() == Group::Cytoplasm {
                let layers = &mut self.layers[at..];
                let add = |layer: &mut u16| *layer = layer.saturating_add(1);
                exposed.cut.for_each_run(&object.amodal, width, |run| layers[run].iter_mut().for_each(add));
            }
        }
        self.objects.extend(exposed.objects);
    }
}

/// The crop of a frame with its border.
struct Cut {
    /// First column and row.
    first: [usize; 2],
    /// Columns of the frame with its border.
    whole: usize,
    /// Columns and rows.
    size: [usize; 2],
}

impl Cut {
    fn of<T: Copy>(&self, values: &[T], channels: usize) -> Vec<T> {
        let mut cropped = Vec::with_capacity(self.size[0] * self.size[1] * channels);
        for row in values.chunks_exact(self.whole * channels).skip(self.first[1]).take(self.size[1]) {
            cropped.extend_from_slice(&row[self.first[0] * channels..][..self.size[0] * channels]);
        }
        cropped
    }

    /// Visits the runs of a mask of the frame that are inside the crop, as ranges of an image with `width` columns
    /// whose first pixel is that of the crop.
    fn for_each_run(&self, mask: &Mask, width: usize, mut visit: impl FnMut(Range<usize>)) {
        let [left, top] = self.first;
        for run in mask.runs() {
            let Some(row) = (run.y as usize).checked_sub(top).filter(|row| *row < self.size[1]) else { continue };
            let [from, to] = [run.x0, run.x1].map(|x| (x as usize).clamp(left, left + self.size[0]) - left);
            if from < to {
                visit(row * width + from..row * width + to);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::Run;

    #[test]
    fn runs_are_clipped_to_a_crop() {
        let runs = vec![
            Run { y: 0, x0: 0, x1: 9 },
            Run { y: 2, x0: 0, x1: 3 },
            Run { y: 2, x0: 4, x1: 6 },
            Run { y: 3, x0: 0, x1: 9 },
            Run { y: 4, x0: 7, x1: 9 },
            Run { y: 5, x0: 4, x1: 5 },
        ];
        let cut = Cut { first: [2, 2], whole: 9, size: [4, 3] };
        let mut image = [0; 3 * 10];
        cut.for_each_run(&Mask::from_runs(runs.clone()), 10, |run| image[run].iter_mut().for_each(|pixel| *pixel += 1));
        let is_in = |x: usize, y: usize| {
            runs.iter().any(|run| run.y as usize == y && (run.x0 as usize..run.x1 as usize).contains(&x))
        };
        for (pixel, found) in image.iter().enumerate() {
            let (x, y) = (pixel % 10, pixel / 10);
            assert_eq!(*found, i32::from(x < 4 && is_in(x + 2, y + 2)), "{x} {y}");
        }
    }
}
