//! What a section of debris accepts.

use crate::recipe::{DyeAmounts, Number};

/// Most that light may be late: beyond it the transfer of phase is no longer near to linear.
pub(crate) const MOST_PHASE_RAD: f64 = 3.0;

/// Largest absorbance that a recipe may ask for.
const DARKEST: f64 = 4.0;

/// As far from the cells as the outside of a slide.
const FARTHEST_UM: f64 = 1000.0;

/// Largest amount of a dye.
const MOST_DYE: f64 = 100.0;

/// Checks one section; what it finds carries the field's name.
pub(crate) struct Section<'a> {
    find: &'a mut dyn FnMut(&str, String),
}

impl<'a> Section<'a> {
    pub(crate) fn new(find: &'a mut dyn FnMut(&str, String)) -> Self {
        Self { find }
    }

    /// Any number of a range.
    pub(crate) fn number(&mut self, field: &str, number: &Number, low: f64, high: f64) {
        if let Some(message) = number.problem(low, high) {
            (self.find)(field, message);
        }
    }

    /// What is counted: written out, it must be whole; what is drawn from a range is rounded.
    pub(crate) fn count(&mut self, field: &str, number: &Number, low: f64, high: f64) {
        self.number(field, number, low, high);
        if let Some(message) = number.fraction() {
            (self.find)(field, message);
        }
    }

    /// A share of something.
    pub(crate) fn share(&mut self, field: &str, number: &Number) {
        self.number(field, number, 0.0, 1.0);
    }

    pub(crate) fn absorbance(&mut self, field: &str, number: &Number) {
        self.number(field, number, 0.0, DARKEST);
    }

    pub(crate) fn phase_rad(&mut self, field: &str, number: &Number) {
        self.number(field, number, -MOST_PHASE_RAD, MOST_PHASE_RAD);
    }

    /// Where something on the glass lies.
    pub(crate) fn height_um(&mut self, field: &str, number: &Number) {
        self.number(field, number, -FARTHEST_UM, FARTHEST_UM);
    }

    /// Amounts of dyes.
    pub(crate) fn dyes(&mut self, field: &str, dyes: &DyeAmounts) {
        for (dye, amount) in dyes.named() {
            self.number(&format!("{field}.{dye}"), &Number::Fixed(amount), 0.0, MOST_DYE);
        }
    }
}
