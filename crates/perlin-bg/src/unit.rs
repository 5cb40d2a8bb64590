use crate::kernel;

/// How noise becomes the paper's I_pe(x, y) ∈ [0, 1].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UnitRange {
    /// n / (2 · bound) + ½ with the bound that analysis gives: a pure function of position, which depends on no other
    /// pixel. It fills the middle of the range; a single image hardly reaches 0 or 1.
    #[default]
    Bound,
    /// (n − min) / (max − min) over the whole field of view, as programs that normalise an image do: each image spans
    /// 0 to 1, so that two fields of one slide do not join.
    Extremes,
}

/// Rescales an image linearly so that its smallest value becomes 0 and its largest 1; a constant image becomes 0.
///
/// The result of a pixel depends on all others: not for tiles. [`UnitRange::Extremes`] does this for a background.
pub fn stretch_to_unit(image: &mut [f32]) {
    let (low, high) = kernel::extremes(image, f32::INFINITY, f32::NEG_INFINITY);
    let scale = unit_scale(low, high);
    for value in image {
        *value = (*value - low) * scale;
    }
}

/// 1 / (high − low), or 0 where there is nothing to stretch.
pub(crate) fn unit_scale(low: f32, high: f32) -> f32 {
    let range = high - low;
    if range > 0.0 { 1.0 / range } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretching_reaches_both_ends() {
        let mut image = [3.0, -1.0, 1.0];
        stretch_to_unit(&mut image);
        assert_eq!(image, [1.0, 0.0, 0.5]);
        let mut flat = [7.0; 4];
        stretch_to_unit(&mut flat);
        assert_eq!(flat, [0.0; 4]);
        stretch_to_unit(&mut []);
    }
}
