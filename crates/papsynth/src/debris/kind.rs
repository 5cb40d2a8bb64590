//! What every kind of debris implements.

use super::ground::Ground;
use super::site::Site;
use crate::phantom::piece::Phantom;

/// A section of the recipe: how many objects of a kind there are, and what they are like.
pub(super) trait Kinds<T> {
    /// Draws every object of a field.
    fn draw(&self, ground: &mut Ground<'_, T>);
}

/// The numbers drawn of one object.
pub(super) trait Thing {
    /// How far it may reach from its middle, µm, where pixels have that size.
    fn reach_um(&self, pixel_um: f64) -> f64;

    /// What it absorbs where it lies.
    fn phantom(&self, site: &Site<'_>) -> Phantom;
}
