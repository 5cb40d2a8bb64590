//! The lights that form an image: one, one for each of three channels, or many single wavelengths.

use std::sync::{Arc, Mutex, PoisonError};

use optics_psf::{Microscope, MicroscopeParams, PatchImager, Zernike};

use super::light::Specimen;
use super::object_transmission::DyeMixer;
use crate::error::ErrorKind;
use crate::recipe::Mixing;
use crate::scene::{SceneLight, SceneMicroscope};
use crate::threads;

/// Lights that are imaged together because their dyes are mixed in one step.
pub(super) struct LightGroup {
    pub(super) mixer: DyeMixer,
    pub(super) lights: Vec<ChannelLight>,
    /// For each object, light and piece: the fraction of the object's absorbance.
    pub(super) fractions: Vec<Vec<Vec<f64>>>,
}

/// Light of one wavelength, or of the band of one channel.
pub(super) struct ChannelLight {
    pub(super) imager: Arc<PatchImager>,
    /// Axial chromatic shift of the stage position, µm.
    pub(super) shift_um: f64,
    /// Weight in each channel of the image.
    pub(super) weights: Vec<f64>,
}

/// Returns the lights of a scene with their microscopes.
pub(super) fn light_groups(
    specimen: Specimen<'_>,
    optics: &SceneMicroscope,
    microscopes: &MicroscopeCache,
) -> Result<Vec<LightGroup>, ErrorKind> {
    let scene = specimen.scene;
    let params = |wavelength_um: f64, bandwidth_um: f64| MicroscopeParams {
        na: optics.na,
        condenser_na: optics.condenser_na,
        wavelength_um,
        bandwidth_um,
        mount_index: optics.mount_index,
        immersion_index: optics.immersion_index,
        cover_error_um: optics.cover_error_um,
        zernike: Zernike {
            spherical: optics.spherical,
            coma: [optics.coma, 0.0],
            astigmatism: [optics.astigmatism, 0.0],
            ..Zernike::default()
        },
        pixel_um: scene.view.pixel_um,
        oversampling: optics.oversampling as usize,
        // Stray light is added later, so cached microscopes do not depend on it.
        stray_light: 0.0,
    };
    let n = scene.oversampling();
    let group = |mixer: DyeMixer, lights: Vec<ChannelLight>| {
        let fractions = threads::map(specimen.work.threads, specimen.phantoms, |phantom| mixer.fractions(phantom, n));
        LightGroup { mixer, lights, fractions }
    };
    match scene.light {
        SceneLight::Monochrome { wavelength_um, bandwidth_um, .. } => {
            let imager = microscopes.get(&params(wavelength_um, bandwidth_um))?;
            let light = ChannelLight { imager, shift_um: 0.0, weights: vec![1.0] };
            Ok(vec![group(DyeMixer::Monochrome(wavelength_um), vec![light])])
        }
        SceneLight::Colour { chromatic_um, mixing, lamp_k, .. } => {
            let colour = crate::detect::colour(lamp_k, mixing)?;
            let light = |wavelength_um: f64, bandwidth_um: f64, weights: Vec<f64>| {
                let imager = microscopes.get(&params(wavelength_um, bandwidth_um))?;
                let shift_um = chromatic_um * (wavelength_um - GREEN_UM) / (RED_UM - GREEN_UM);
                Ok(ChannelLight { imager, shift_um, weights })
            };
            let channels = colour.channels();
            if mixing == Mixing::PerWavelength {
                let [red, green, blue] = channels;
                let nodes = red.nodes.iter().zip(&green.nodes).zip(&blue.nodes);
                return nodes
                    .map(|((red, green), blue)| {
                        let weights = [red, green, blue].map(|node| node.weight).to_vec();
                        let light = light(red.wavelength_um, 0.0, weights)?;
                        Ok(group(DyeMixer::Monochrome(red.wavelength_um), vec![light]))
                    })
                    .collect();
            }
            let own = |channel: usize| (0..channels.len()).map(|c| if c == channel { 1.0 } else { 0.0 }).collect();
            let lights = channels.iter().enumerate();
            let lights = lights.map(|(c, of)| light(of.wavelength_um, of.bandwidth_um, own(c)));
            let lights = lights.collect::<Result<_, ErrorKind>>()?;
            Ok(vec![group(DyeMixer::Colour(Box::new(colour)), lights)])
        }
    }
}

/// Wavelengths between which the chromatic shift is specified, µm.
const GREEN_UM: f64 = 0.55;
const RED_UM: f64 = 0.65;

/// Capacity of the cache: a colour image needs 3 microscopes, one of single wavelengths 16.
const CACHE_SIZE: usize = 20;

/// A cache of microscopes with their computed filters.
#[derive(Debug, Default)]
pub(crate) struct MicroscopeCache {
    cached: Mutex<Vec<Arc<PatchImager>>>,
}

impl MicroscopeCache {
    /// Removes the microscopes that no image uses.
    pub(crate) fn forget_unused(&self) {
        let mut cached = self.cached.lock().unwrap_or_else(PoisonError::into_inner);
        cached.retain(|imager| Arc::strong_count(imager) > 1);
    }

    /// Returns the microscope with these parameters.
    fn get(&self, params: &MicroscopeParams) -> Result<Arc<PatchImager>, ErrorKind> {
        let mut cached = self.cached.lock().unwrap_or_else(PoisonError::into_inner);
        let imager = match cached.iter().position(|imager| imager.microscope().params() == params) {
            Some(at) => cached.remove(at),
            None => Arc::new(PatchImager::new(&Microscope::new(params)?)),
        };
        if cached.len() == CACHE_SIZE {
            cached.remove(0);
        }
        // Most recently used last.
        cached.push(Arc::clone(&imager));
        Ok(imager)
    }
}
