//! The lights of which a picture is made: one, those of three channels, or many single wavelengths.

use std::sync::{Arc, Mutex, PoisonError};

use optics_psf::{Microscope, MicroscopeParams, PatchImager, Zernike};

use super::canvas::Mixer;
use super::light::Slide;
use crate::error::Cause;
use crate::recipe::Mixing;
use crate::scene::{SceneLight, SceneMicroscope};
use crate::threads;

/// Light that is imaged together, because dyes are mixed for all of it at once.
pub(super) struct Group {
    pub(super) mixer: Mixer,
    pub(super) lights: Vec<ColouredLight>,
    /// What each piece of each object has in the object's absorbance, light by light.
    pub(super) shares: Vec<Vec<Vec<f64>>>,
}

/// Light of one wavelength or of the band of one channel.
pub(super) struct ColouredLight {
    pub(super) imager: Arc<PatchImager>,
    /// Travel of the stage that this light needs beyond the others', µm.
    pub(super) shift_um: f64,
    /// Its share in each channel of the picture.
    pub(super) weights: Vec<f64>,
}

/// The lights of a scene, each with its microscope.
pub(super) fn groups(slide: Slide<'_>, optics: &SceneMicroscope, lenses: &Lenses) -> Result<Vec<Group>, Cause> {
    let scene = slide.scene;
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
        // Glare is added to the finished light: a microscope is remembered whatever the glare of a field.
        stray_light: 0.0,
    };
    let group = |mixer: Mixer, lights: Vec<ColouredLight>| {
        let shares = threads::map(slide.threads, slide.phantoms, |phantom| mixer.shares(phantom));
        Group { mixer, lights, shares }
    };
    match scene.light {
        SceneLight::Monochrome { wavelength_um, bandwidth_um } => {
            let imager = lenses.get(&params(wavelength_um, bandwidth_um))?;
            let light = ColouredLight { imager, shift_um: 0.0, weights: vec![1.0] };
            Ok(vec![group(Mixer::Monochrome(wavelength_um), vec![light])])
        }
        SceneLight::Colour { chromatic_um, mixing, lamp_k, .. } => {
            let colour = crate::detect::colour(lamp_k, mixing)?;
            let light = |wavelength_um: f64, bandwidth_um: f64, weights: Vec<f64>| {
                let imager = lenses.get(&params(wavelength_um, bandwidth_um))?;
                let shift_um = chromatic_um * (wavelength_um - GREEN_UM) / (RED_UM - GREEN_UM);
                Ok(ColouredLight { imager, shift_um, weights })
            };
            let channels = colour.channels();
            if mixing == Mixing::PerWavelength {
                let [red, green, blue] = channels;
                let nodes = red.nodes.iter().zip(&green.nodes).zip(&blue.nodes);
                return nodes
                    .map(|((red, green), blue)| {
                        let weights = [red, green, blue].map(|node| node.weight).to_vec();
                        let light = light(red.wavelength_um, 0.0, weights)?;
                        Ok(group(Mixer::Monochrome(red.wavelength_um), vec![light]))
                    })
                    .collect();
            }
            let own = |channel: usize| (0..channels.len()).map(|c| if c == channel { 1.0 } else { 0.0 }).collect();
            let lights = channels.iter().enumerate();
            let lights = lights.map(|(c, of)| light(of.wavelength_um, of.bandwidth_um, own(c)));
            let lights = lights.collect::<Result<_, Cause>>()?;
            Ok(vec![group(Mixer::Colour(Box::new(colour)), lights)])
        }
    }
}

/// The two wavelengths between which the chromatic shift is told, µm.
const GREEN_UM: f64 = 0.55;
const RED_UM: f64 = 0.65;

/// Microscopes that are remembered: a colour image needs three, one of single wavelengths sixteen.
const REMEMBERED: usize = 20;

/// Microscopes that an engine met before, with everything that was computed for them.
#[derive(Debug, Default)]
pub(crate) struct Lenses {
    known: Mutex<Vec<Arc<PatchImager>>>,
}

impl Lenses {
    /// The microscope of these parameters.
    fn get(&self, params: &MicroscopeParams) -> Result<Arc<PatchImager>, Cause> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let imager = match known.iter().position(|imager| imager.microscope().params() == params) {
            Some(at) => known.remove(at),
            None => Arc::new(PatchImager::new(&Microscope::new(params)?)),
        };
        if known.len() == REMEMBERED {
            known.remove(0);
        }
        // Those used last stand last.
        known.push(Arc::clone(&imager));
        Ok(imager)
    }
}
