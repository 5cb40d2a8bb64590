use crate::BrightField;
use crate::canvas::{Memory, Samples, Spectra, absorbed, absorbed_of, amplitude, is_lit};
use crate::filter::{Filter, Lattice};
use crate::lanes::Lanes;
use crate::light::{lift, mean_of_pixels};

/// What is on the slide, slab by slab, as the spectra of what it absorbs and delays. It is made by
/// [`BrightField::specimen`], belongs to that, and is also its working memory: with the same one,
/// nothing is allocated after the first object and picture.
#[derive(Debug, Clone, Default)]
pub struct Specimen {
    slabs: Vec<Spectra>,
    memory: Memory,
    product: Vec<f32>,
}

impl Specimen {
    pub(crate) fn new(slabs: usize) -> Self {
        Self { slabs: vec![Spectra::default(); slabs], ..Self::default() }
    }

    /// Empties the slide.
    pub fn clear(&mut self) {
        self.slabs.iter_mut().for_each(Spectra::clear);
    }
}

impl BrightField {
    /// Puts decadic absorbances, 0 or more, into a slab in place of what was there; its phase stays.
    ///
    /// # Panics
    ///
    /// If there is no such slab, or the slice has not as many samples as the object.
    pub fn set_absorbance(&self, specimen: &mut Specimen, slab: usize, absorbance: &[f32]) {
        self.set_absorbed(specimen, slab, absorbance, 0.0, |values| {
            let lit = is_lit(values);
            if lit {
                absorbed(values);
            }
            lit
        });
    }

    /// Puts transmittances, 0 to 1, into a slab in place of what was there; its phase stays.
    ///
    /// # Panics
    ///
    /// As [`BrightField::set_absorbance`].
    pub fn set_transmittance(&self, specimen: &mut Specimen, slab: usize, transmittance: &[f32]) {
        self.set_absorbed(specimen, slab, transmittance, 1.0, absorbed_of);
    }

    /// Puts phases, by how many radians light is late, into a slab in place of those that were
    /// there; what it absorbs stays.
    ///
    /// # Panics
    ///
    /// As [`BrightField::set_absorbance`].
    pub fn set_phase(&self, specimen: &mut Specimen, slab: usize, phase_rad: &[f32]) {
        let Specimen { slabs, memory, .. } = specimen;
        self.transform(phase_rad, 0.0, &mut slabs[slab].phase, memory, is_lit);
    }

    fn set_absorbed(
        &self,
        specimen: &mut Specimen,
        slab: usize,
        samples: &[f32],
        background: f32,
        map: impl Fn(&mut [f32]) -> bool,
    ) {
        let Specimen { slabs, memory, .. } = specimen;
        let spectra = &mut slabs[slab];
        spectra.clear_absorbed();
        self.transform(samples, background, &mut spectra.absorbed, memory, &map);
        if self.is_corrected(slab) {
            self.transform(samples, background, &mut spectra.amplitude, memory, |values| {
                let lit = map(values);
                if lit {
                    amplitude(values);
                }
                lit
            });
        }
    }

    /// The spectrum of what `map` makes of samples; none if all are empty, as the background is.
    fn transform(
        &self,
        samples: &[f32],
        background: f32,
        spectrum: &mut Vec<Lanes>,
        memory: &mut Memory,
        map: impl Fn(&mut [f32]) -> bool,
    ) {
        let [width, height] = self.size;
        assert_eq!(samples.len(), width * height, "a slab has other samples than the object");
        self.canvas.transform(Samples { samples, width, offset: 0, background }, map, spectrum, memory);
    }

    /// The picture of a plane: the light of each pixel of the camera relative to that of empty slide, stray
    /// light included.
    ///
    /// # Panics
    ///
    /// If there is no such plane, or the specimen is another's.
    #[must_use]
    pub fn image(&self, specimen: &mut Specimen, plane: usize) -> Vec<f32> {
        let mut out = vec![0.0; self.image_width() * self.image_height()];
        self.image_into(specimen, plane, &mut out);
        out
    }

    /// The picture of a plane, into `out`. Gives the number of places where a slab would have let
    /// less than [`LEAST_LIGHT`](crate::LEAST_LIGHT) through, in pixels of the camera.
    ///
    /// # Panics
    ///
    /// If there is no such plane, the specimen is another's, or `out` has not
    /// [`image_width`](Self::image_width) · [`image_height`](Self::image_height) pixels.
    pub fn image_into(&self, specimen: &mut Specimen, plane: usize, out: &mut [f32]) -> usize {
        assert_eq!(out.len(), self.image_width() * self.image_height(), "the picture has another size");
        let Specimen { slabs, memory, product } = specimen;
        let filters = &self.planes[plane];
        assert_eq!(slabs.len(), filters.len(), "the specimen has other slabs");
        for (slab, filter) in slabs.iter_mut().zip(filters) {
            if filter.is_corrected {
                self.canvas.correct(&self.in_focus, slab, memory);
            }
        }
        let oversampling = self.microscope.params().oversampling;
        let [width, height] = self.size;
        let mut floored = 0;
        let on_object = |(slab, filter): (&Spectra, &Filter)| filter.lattice == Lattice::Object && !slab.is_empty();
        if slabs.iter().zip(filters).any(on_object) {
            product.clear();
            product.resize(width * height, 1.0);
            let samples = self.expose(Lattice::Object, slabs, filters, product, width, memory);
            floored = samples.div_ceil(oversampling * oversampling);
            out.fill(1.0);
            mean_of_pixels(product, width, oversampling, out);
        } else {
            out.fill(1.0);
        }
        floored += self.expose(Lattice::Camera, slabs, filters, out, self.image_width(), memory);
        lift(out, self.microscope.params().stray_light);
        floored
    }

    /// Multiplies `product` by what the slabs that are computed on `lattice` let through.
    fn expose(
        &self,
        lattice: Lattice,
        slabs: &[Spectra],
        filters: &[Filter],
        product: &mut [f32],
        width: usize,
        memory: &mut Memory,
    ) -> usize {
        let here = || filters.iter().zip(slabs).filter(|(filter, _)| filter.lattice == lattice);
        let absorbing = here().filter(|(_, slab)| !slab.absorbed.is_empty());
        let floored = absorbing.map(|(filter, slab)| self.canvas.transmit(filter, slab, memory, product, width)).sum();
        let refracting = here().filter(|(_, slab)| !slab.phase.is_empty());
        if refracting.clone().next().is_some() {
            self.canvas.refract(lattice, refracting, memory, product, width);
        }
        floored
    }
}
