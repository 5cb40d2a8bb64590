//! Detection of nuclei and straight edges.

use std::f64::consts::FRAC_PI_4;

use optics_psf::calibrate::{EdgeFit, Window, edge};
use optics_psf::{Border, Gaussian, Scratch};
use papsynth::truth::LabelMap;
use papsynth_dataset::read::{Component, Limits, components};

/// Largest number of measured nuclei; more do not change the median.
const MAX_NUCLEI: usize = 24;

/// Number of thresholds between the darkest level and the background.
const LEVELS: u16 = 32;

/// σ of the smoothing against pixel noise, px.
const SMOOTHING_PX: f64 = 1.0;

/// Range of width and height of a nucleus for unknown pixel size, px; the upper limit is at most half of the image.
const NUCLEUS_PX: [f64; 2] = [10.0, 120.0];

/// Range of width and height of a nucleus, µm: from small lymphocytes to large dysplastic cells.
const NUCLEUS_UM: [f64; 2] = [4.0, 30.0];

/// Range of the area of compact objects, relative to the ellipse in the bounding box.
const COMPACT: [f64; 2] = [0.8, 1.15];

/// Largest aspect ratio of compact objects.
const MAX_ASPECT: f64 = 1.8;

/// Margin of a window around a nucleus for its blurred border, px.
const AROUND_PX: usize = 6;

/// Size and spacing of the windows in the search for edges, px.
const EDGE_SIDE_PX: usize = 24;
const EDGE_STEP_PX: usize = 6;

/// Largest number of windows that are fitted.
const MAX_EDGES: usize = 60;

/// Largest residual of the fit of a single straight edge, as a fraction of its contrast.
const MAX_RESIDUAL: f64 = 0.06;

/// Returns windows around dark, compact, sharp objects, the sharpest first. `pixel_um` sets the range of sizes.
pub(crate) fn nuclei(planes: &[&[f32]], width: usize, pixel_um: Option<f64>) -> Vec<Window> {
    let height = planes[0].len() / width;
    let image = smooth(&darkest(planes), width);
    let half = width.min(height) as f64 / 2.0;
    let [least, most] = match pixel_um {
        Some(pixel) => NUCLEUS_UM.map(|um| um / pixel),
        None => NUCLEUS_PX,
    };
    let sides = [least, most.min(half)];
    let mut found: Vec<(f64, Component)> = Vec::new();
    for level in levels(&image) {
        let ids = image.iter().map(|&v| u32::from(v < level)).collect();
        let limits = Limits { max_regions: usize::MAX, ..Limits::default() };
        let regions = components(&LabelMap { width, ids }, &limits).unwrap_or_default();
        let compact = regions.into_iter().filter(|region| !region.at_border && is_compact(region, sides));
        found.extend(compact.map(|region| (border_slope(&region, &image, width), region)));
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut windows: Vec<Window> = Vec::new();
    for window in found.iter().filter_map(|(_, region)| with_margin(region, width, height)) {
        if windows.len() < MAX_NUCLEI && windows.iter().all(|w| !overlap(*w, window)) {
            windows.push(window);
        }
    }
    windows
}

/// Returns the window of the sharpest straight edge and its fit.
pub(crate) fn straight_edge(image: &[f32], width: usize) -> Option<(Window, EdgeFit)> {
    let height = image.len() / width;
    let side = EDGE_SIDE_PX.min(width).min(height);
    let mut windows: Vec<(f64, Window)> = (0..=height - side)
        .step_by(EDGE_STEP_PX)
        .flat_map(|top| (0..=width - side).step_by(EDGE_STEP_PX).map(move |left| (left, top)))
        .map(|(left, top)| Window { left, top, width: side, height: side })
        .map(|window| (anisotropy(image, width, window), window))
        .collect();
    windows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let fits =
        windows.iter().take(MAX_EDGES).filter_map(|(_, window)| Some((*window, edge(image, width, *window).ok()?)));
    let straight = fits.filter(|(_, fit)| fit.rms_residual <= MAX_RESIDUAL * (fit.light - fit.dark));
    let slope = |fit: &EdgeFit| (fit.light - fit.dark) / fit.sigma_px;
    straight.max_by(|a, b| slope(&a.1).total_cmp(&slope(&b.1)))
}

/// Returns left, top, width and height.
pub(crate) fn numbers(window: Window) -> [usize; 4] {
    [window.left, window.top, window.width, window.height]
}

/// Returns the minimum of each pixel over all planes: a nucleus is darkest in focus.
fn darkest(planes: &[&[f32]]) -> Vec<f32> {
    let mut image = planes[0].to_vec();
    for plane in &planes[1..] {
        for (darkest, value) in image.iter_mut().zip(*plane) {
            *darkest = darkest.min(*value);
        }
    }
    image
}

fn smooth(image: &[f32], width: usize) -> Vec<f32> {
    let mut out = image.to_vec();
    if let Ok(gaussian) = Gaussian::new(SMOOTHING_PX) {
        gaussian.blur_into(image, width, Border::Replicate, &mut out, &mut Scratch::new());
    }
    out
}

/// Returns thresholds from the darkest level to the median, which is background.
fn levels(image: &[f32]) -> impl Iterator<Item = f32> + use<> {
    let mut sorted = image.to_vec();
    sorted.sort_by(f32::total_cmp);
    let (darkest, background) = (sorted[0], sorted[sorted.len() / 2]);
    (1..LEVELS).map(move |i| darkest + (background - darkest) * f32::from(i) / f32::from(LEVELS))
}

fn is_compact(region: &Component, [least, most]: [f64; 2]) -> bool {
    let Some(bounds) = region.mask.bounds() else { return false };
    let [w, h] = [bounds.width, bounds.height].map(f64::from);
    let filled = region.mask.area() as f64 / (FRAC_PI_4 * w * h);
    w.min(h) >= least
        && w.max(h) <= most
        && w.max(h) <= MAX_ASPECT * w.min(h)
        && (COMPACT[0]..=COMPACT[1]).contains(&filled)
}

/// Returns the mean gradient at the left and right ends of a region, a measure of contrast and sharpness.
fn border_slope(region: &Component, image: &[f32], width: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for run in region.mask.runs() {
        for x in [run.x0, run.x1 - 1] {
            // Regions do not touch the border of the image.
            let i = run.y as usize * width + x as usize;
            let slope = |back: usize, on: usize| 0.5 * f64::from(image[on] - image[back]);
            let (dx, dy) = (slope(i - 1, i + 1), slope(i - width, i + width));
            sum += (dx * dx + dy * dy).sqrt();
            count += 1.0;
        }
    }
    sum / count
}

/// Returns the bounding box of a region with a margin.
fn with_margin(region: &Component, width: usize, height: usize) -> Option<Window> {
    let bounds = region.mask.bounds()?;
    let side = |from: u32, len: u32, whole: usize| {
        let (from, to) = (from as usize, (from + len) as usize);
        let first = from.saturating_sub(AROUND_PX);
        (first, (to + AROUND_PX).min(whole) - first)
    };
    let (left, wide) = side(bounds.x, bounds.width, width);
    let (top, high) = side(bounds.y, bounds.height, height);
    Some(Window { left, top, width: wide, height: high })
}

fn overlap(a: Window, b: Window) -> bool {
    let intersect = |a: usize, a_len: usize, b: usize, b_len: usize| a < b + b_len && b < a + a_len;
    intersect(a.left, a.width, b.left, b.width) && intersect(a.top, a.height, b.top, b.height)
}

/// Returns the anisotropy of the gradient: the difference of the two eigenvalues of the structure tensor.
fn anisotropy(image: &[f32], width: usize, window: Window) -> f64 {
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for y in window.top + 1..window.top + window.height - 1 {
        for x in window.left + 1..window.left + window.width - 1 {
            let i = y * width + x;
            let dx = f64::from(image[i + 1] - image[i - 1]);
            let dy = f64::from(image[i + width] - image[i - width]);
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
        }
    }
    ((xx - yy) * (xx - yy) + 4.0 * xy * xy).sqrt()
}
