//! Outlines of a class told by how they differ from learned ones.

use fsd_shape::Descriptors;
use rand_core::Rng;

use crate::model::Form;
use crate::random;

/// Most elongated outline: half axes of 1.8 and 0.2.
const LONGEST: f64 = 0.8;

/// A drawn shape, its long axis along x, with the form of its class.
pub(super) fn posed<R: Rng + ?Sized>(drawn: &Descriptors, form: &Form, rng: &mut R) -> Descriptors {
    let posed = drawn.aligned();
    let elongation = form.elongation.map(|e| (e.mean + e.sd * random::normal(rng)).clamp(0.0, LONGEST));
    if elongation.is_none() && form.taper == 0.0 && form.unevenness == 1.0 {
        return posed;
    }
    let middle = posed.harmonics();
    let radius = posed.radius();
    let mut terms = posed.as_slice().to_vec();
    for (place, term) in terms.iter_mut().enumerate() {
        match (place.abs_diff(middle), place < middle) {
            (0, _) | (1, false) => {}
            (1, true) => {
                if let Some(elongation) = elongation {
                    *term = [elongation * radius, 0.0];
                }
            }
            _ => *term = [form.unevenness * term[0], form.unevenness * term[1]],
        }
    }
    if let Some(egg) = terms.get_mut(middle + 2) {
        egg[0] += form.taper * radius;
    }
    // A form so extreme that the outline crosses itself is not taken.
    match Descriptors::from_harmonics(terms) {
        Ok(formed) if !fsd_shape::self_intersects(&formed.outline(CHECKED)) => formed,
        _ => posed,
    }
}

/// Points at which an outline is checked for crossing itself.
const CHECKED: usize = 240;
