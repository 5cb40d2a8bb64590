//! Microscopes that were met before, with everything that was computed for them.

use crate::error::Cause;
use std::sync::{Arc, Mutex, PoisonError};

use optics_psf::{Microscope, MicroscopeParams, PatchImager};

/// Microscopes that are remembered: a colour image needs three, one of single wavelengths sixteen.
const REMEMBERED: usize = 20;

/// All microscopes of an engine.
#[derive(Debug, Default)]
pub(crate) struct Lenses {
    known: Mutex<Vec<Arc<Lens>>>,
}

/// One microscope in the light of one channel.
#[derive(Debug)]
pub(crate) struct Lens {
    params: MicroscopeParams,
    pub(crate) imager: PatchImager,
}

impl Lenses {
    /// The microscope of these parameters.
    pub(crate) fn get(&self, params: &MicroscopeParams) -> Result<Arc<Lens>, Cause> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = known.iter().position(|lens| lens.params == *params) {
            // Those used last stand last.
            let lens = known.remove(at);
            known.push(Arc::clone(&lens));
            return Ok(lens);
        }
        let microscope = Microscope::new(params)?;
        let imager = PatchImager::new(&microscope);
        let lens = Arc::new(Lens { params: params.clone(), imager });
        if known.len() == REMEMBERED {
            known.remove(0);
        }
        known.push(Arc::clone(&lens));
        Ok(lens)
    }
}
