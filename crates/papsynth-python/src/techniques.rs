//! The techniques on arrays.

use std::fmt::Display;

use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

use crate::array::{ArrayLike, nth, pixels, pixels_within, points};
use crate::error::wrong;

/// Maximum number of pixels of a result.
const MAX_PIXELS: usize = 1 << 30;

const MAX_POINTS: usize = 1 << 20;

/// Maximum number of points of an outline.
const MAX_OUTLINE: usize = 1 << 16;

/// Range of absorbance and of light.
const NOT_NEGATIVE: [f32; 2] = [0.0, f32::MAX];

fn random(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

/// Draws an image of the given shape, initialised with zeros.
fn drawn<'py, E: Display + Send>(
    py: Python<'py>,
    (rows, columns): (usize, usize),
    draw: impl FnOnce(&mut [f32]) -> Result<(), E> + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let mut out = match rows.checked_mul(columns) {
        Some(pixels @ 1..=MAX_PIXELS) => vec![0.0; pixels],
        _ => {
            return Err(wrong(format!(
                "shape: ({rows}, {columns}) is out of range: expected 1 to {MAX_PIXELS} pixels"
            )));
        }
    };
    py.detach(|| draw(&mut out)).map_err(wrong)?;
    image(py, out, columns)
}

/// Returns an outline of 3 to `MAX_OUTLINE` points.
fn outline_of(given: &ArrayLike<'_>) -> PyResult<Vec<[f64; 2]>> {
    let outline = points("outline", given)?;
    match outline.len() {
        3..=MAX_OUTLINE => Ok(outline),
        found => Err(wrong(format!("outline: expected 3 to {MAX_OUTLINE} points, found {found}"))),
    }
}

fn image<'py, T: numpy::Element>(py: Python<'py>, values: Vec<T>, width: usize) -> PyResult<Bound<'py, PyAny>> {
    let rows = values.len() / width.max(1);
    Ok(values.into_pyarray(py).reshape([rows, width])?.into_any())
}

fn outline<'py>(py: Python<'py>, points: Vec<[f64; 2]>) -> PyResult<Bound<'py, PyAny>> {
    let rows = points.len();
    Ok(points.into_iter().flatten().collect::<Vec<_>>().into_pyarray(py).reshape([rows, 2])?.into_any())
}

/// Declares the Python modules and their items.
macro_rules! modules {
    ($($(#[$($about:tt)*])* $module:ident { $($item:ident),* })*) => {$(
        $(#[$($about)*])*
        #[pymodule]
        pub(crate) mod $module {
            #[pymodule_export]
            use super::{$($item),*};
        }
    )*};
}

modules! {
    /// Fourier shape descriptors of outlines.
    fsd { ShapeModel, trace }
    /// Cloth simulation of cytoplasm.
    cloth { crumple }
    /// Cytoskeletons on Voronoi diagrams.
    cytoskeleton { grow }
    /// Random fields and Perlin noise.
    fields { matern, perlin }
    /// Patch-based texture synthesis.
    texture { quilt }
    /// Microscope optics.
    optics { bright_field, gaussian, gibson_lanni }
    /// Camera model of EMVA 1288.
    noise { expose }
    /// Colours of dyes.
    dyes { transmittance }
}

/// Return the outline of the single object of a mask as the contour at a level.
///
/// Parameters
/// ----------
/// mask : array_like
///     (height, width), coverage 0 to 1.
/// level : float
///     Contour level, above 0.
///
/// Returns
/// -------
/// ndarray
///     (points, 2), float64: x and y in pixels, 0 at the centre of the first pixel.
#[pyfunction]
#[pyo3(signature = (mask, level=0.5))]
fn trace<'py>(py: Python<'py>, mask: ArrayLike<'py>, level: f32) -> PyResult<Bound<'py, PyAny>> {
    let (mask, width) = pixels_within("mask", &mask, [0.0, 1.0])?;
    outline(py, fsd_shape::trace(&mask, width, level).map_err(wrong)?)
}

/// A statistical model of outlines, fitted to samples.
///
/// Parameters
/// ----------
/// outlines : list of array_like
///     Three or more, each (points, 2).
/// harmonics : int
///     Highest harmonic of the descriptors.
#[pyclass(frozen, module = "papsynth.fsd")]
struct ShapeModel(fsd_shape::ShapeModel);

#[pymethods]
impl ShapeModel {
    #[new]
    #[pyo3(signature = (outlines, harmonics=40))]
    fn new(py: Python<'_>, outlines: Vec<ArrayLike<'_>>, harmonics: usize) -> PyResult<Self> {
        let outlines: Vec<Vec<[f64; 2]>> = outlines
            .iter()
            .enumerate()
            .map(|(i, outline)| points(&nth("outlines", i), outline))
            .collect::<PyResult<_>>()?;
        let params = fsd_shape::ShapeModelParams { harmonics, ..Default::default() };
        py.detach(|| fsd_shape::ShapeModel::fit(&outlines, &params)).map(Self).map_err(wrong)
    }

    /// Draw a new outline.
    ///
    /// Parameters
    /// ----------
    /// radius_px : float, optional
    ///     Magnitude of the first descriptor. Default: drawn from the samples.
    /// seed : int
    /// points : int
    ///     3 to 1048576.
    ///
    /// Returns
    /// -------
    /// ndarray
    ///     (points, 2), centred on the origin.
    #[pyo3(signature = (radius_px=None, seed=0, points=400))]
    fn draw<'py>(
        &self,
        py: Python<'py>,
        radius_px: Option<f64>,
        seed: u64,
        points: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        if !(3..=MAX_POINTS).contains(&points) {
            return Err(wrong(format!("points: {points} is out of range: expected 3 to {MAX_POINTS}")));
        }
        let mut random = random(seed);
        let radius_px = radius_px.unwrap_or_else(|| self.0.draw_radius(&mut random));
        outline(py, self.0.draw(radius_px, &mut random).map_err(wrong)?.descriptors.outline(points))
    }
}

/// Return the thickness of a cloth sheet that is pressed into an outline.
///
/// Parameters
/// ----------
/// outline : array_like
///     (points, 2), pixels.
/// shape : tuple of int
///     Rows and columns of the image.
/// seed : int
/// vertices : int
///     Number of vertices of the mesh, 32 to 65536.
/// excess : float
///     Area of the flat sheet relative to that of the outline, 1 to 4.
///
/// Returns
/// -------
/// ndarray
///     (rows, columns), float32: mean number of layers at each pixel.
#[pyfunction]
#[pyo3(signature = (outline, shape, seed=0, *, vertices=1200, excess=1.15))]
fn crumple<'py>(
    py: Python<'py>,
    outline: ArrayLike<'py>,
    shape: (usize, usize),
    seed: u64,
    vertices: usize,
    excess: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let outline = outline_of(&outline)?;
    let params = cloth_verlet::ClothParams { vertices, area_ratio: excess, ..Default::default() };
    drawn(py, shape, |out| -> Result<(), cloth_verlet::Error> {
        let sheet = cloth_verlet::Cloth::new(&params)?.crumple(&outline, &mut random(seed))?;
        let view = cloth_verlet::PixelGrid { origin: [0.0, 0.0], pixel_size: 1.0 };
        sheet.thickness_into(out, shape.1, &view, |_| 1.0);
        Ok(())
    })
}

/// Draw a cytoskeleton within an outline.
///
/// Parameters
/// ----------
/// outline : array_like
///     (points, 2), pixels.
/// shape : tuple of int
///     Rows and columns of the image.
/// seed : int
/// rivers : int
///     Number of trees.
/// width_px : float
///     Width of the lines at the root of a tree, pixels.
///
/// Returns
/// -------
/// ndarray
///     (rows, columns), float32, 0 to 1.
#[pyfunction]
#[pyo3(signature = (outline, shape, seed=0, *, rivers=15, width_px=1.7))]
fn grow<'py>(
    py: Python<'py>,
    outline: ArrayLike<'py>,
    shape: (usize, usize),
    seed: u64,
    rivers: usize,
    width_px: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let outline = outline_of(&outline)?;
    drawn(py, shape, |out| -> Result<(), voronoi_cytoskeleton::Error> {
        let params = voronoi_cytoskeleton::SkeletonParams { paths: rivers, ..Default::default() };
        let rivers = voronoi_cytoskeleton::Skeleton::new(&params)?.grow(&outline, &mut random(seed))?;
        let lines = voronoi_cytoskeleton::LineParams { width_px, ..Default::default() };
        voronoi_cytoskeleton::draw_into(out, shape.1, &rivers, &lines)
    })
}

/// Return fractal Perlin noise.
///
/// Parameters
/// ----------
/// shape : tuple of int
///     Rows and columns.
/// cell_px : float
///     Size of the coarsest lattice cells, pixels.
/// seed : int
/// octaves : int
///     Number of octaves.
/// persistence : float
///     Amplitude of an octave relative to the one before.
///
/// Returns
/// -------
/// ndarray
///     (rows, columns), float32, approximately -1 to 1.
#[pyfunction]
#[pyo3(signature = (shape, cell_px=64.0, seed=0, *, octaves=4, persistence=0.5))]
fn perlin(
    py: Python<'_>,
    shape: (usize, usize),
    cell_px: f64,
    seed: u64,
    octaves: usize,
    persistence: f64,
) -> PyResult<Bound<'_, PyAny>> {
    if !(cell_px.is_finite() && cell_px > 0.0) {
        return Err(wrong(format!("cell_px: {cell_px} is out of range: expected a number above 0")));
    }
    drawn(py, shape, |out| -> Result<(), perlin_bg::Error> {
        let params = perlin_bg::FractalParams { octaves, persistence, ..Default::default() };
        let window = perlin_bg::Window::with_cell_px(cell_px);
        perlin_bg::Fractal::new(&params, seed)?.add_into(out, shape.1, &window, 1.0);
        Ok(())
    })
}

/// Return a Gaussian random field with Matérn covariance.
///
/// Parameters
/// ----------
/// shape : tuple of int
///     Rows and columns.
/// length_px : float
///     Correlation length, pixels.
/// nu : float
///     Smoothness.
/// seed : int
///
/// Returns
/// -------
/// ndarray
///     (rows, columns), float32, with mean 0 and variance 1.
#[pyfunction]
#[pyo3(signature = (shape, length_px=4.0, nu=1.0, seed=0))]
fn matern(py: Python<'_>, shape: (usize, usize), length_px: f64, nu: f64, seed: u64) -> PyResult<Bound<'_, PyAny>> {
    drawn(py, shape, |out| -> Result<(), spectral_field::Error> {
        let params = spectral_field::FieldParams {
            width: shape.1,
            height: shape.0,
            spectrum: spectral_field::Spectrum::Matern { nu, length_px },
            ..Default::default()
        };
        spectral_field::SpectralField::new(&params)?.draw_into(out, &mut random(seed));
        Ok(())
    })
}

/// Synthesise a texture from patches of a source.
///
/// Parameters
/// ----------
/// source : array_like
///     (rows, columns), the texture.
/// mask : array_like
///     The same shape: 1 where the texture may be used, else 0.
/// target : array_like
///     (rows, columns) of the result: 1 where texture is needed, else 0.
/// seed : int
/// patch_px, overlap_px : int
///     Size and overlap of the patches, pixels.
///
/// Returns
/// -------
/// ndarray
///     As `target`, float32.
#[pyfunction]
#[pyo3(signature = (source, mask, target, seed=0, *, patch_px=9, overlap_px=3))]
fn quilt<'py>(
    py: Python<'py>,
    source: ArrayLike<'py>,
    mask: ArrayLike<'py>,
    target: ArrayLike<'py>,
    seed: u64,
    patch_px: usize,
    overlap_px: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let (texture, width) = pixels("source", &source)?;
    let (mask, mask_width) = pixels_within("mask", &mask, [0.0, 1.0])?;
    let (target, target_width) = pixels_within("target", &target, [0.0, 1.0])?;
    if (mask.len(), mask_width) != (texture.len(), width) {
        let [found, wanted] = [(&mask, mask_width), (&texture, width)].map(|(v, w)| (v.len() / w, w));
        return Err(wrong(format!("mask: expected the shape of source, {wanted:?}, found {found:?}")));
    }
    let made = py.detach(|| {
        let source = quilt_texture::Source::new(&texture, &mask, width)?;
        let params = quilt_texture::QuiltParams { patch_px, overlap_px, ..Default::default() };
        Ok(quilt_texture::Quilter::new(&[&source], &params)?
            .synthesise(&target, target_width, &mut random(seed))
            .pixels)
    });
    image(py, made.map_err(|error: quilt_texture::Error| wrong(error))?, target_width)
}

/// Apply a Gaussian blur with mirrored borders.
///
/// Parameters
/// ----------
/// image : array_like
///     (rows, columns).
/// sigma_px : float
///     Standard deviation, 0 to 4096 pixels.
///
/// Returns
/// -------
/// ndarray
///     As `image`, float32.
#[pyfunction]
fn gaussian<'py>(py: Python<'py>, image: ArrayLike<'py>, sigma_px: f64) -> PyResult<Bound<'py, PyAny>> {
    let (values, width) = pixels("image", &image)?;
    let gaussian = optics_psf::Gaussian::new(sigma_px).map_err(wrong)?;
    let blurred = py.detach(|| gaussian.blur(&values, width, optics_psf::Border::Reflect));
    self::image(py, blurred, width)
}

/// Return the partially coherent bright-field image of a thin absorbing layer.
///
/// Parameters
/// ----------
/// absorbance : array_like
///     (rows, columns), decadic absorbance, two samples per pixel.
/// defocus_um : float
///     Depth relative to the plane in focus, µm; positive towards the objective.
/// na, condenser_na : float
///     Numerical apertures of objective and condenser.
///
/// Returns
/// -------
/// ndarray
///     (rows / 2, columns / 2), float32: transmittance relative to the empty slide.
#[pyfunction]
#[pyo3(signature = (absorbance, defocus_um=0.0, *, na=0.95, condenser_na=0.41))]
fn bright_field<'py>(
    py: Python<'py>,
    absorbance: ArrayLike<'py>,
    defocus_um: f64,
    na: f64,
    condenser_na: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let (values, width) = pixels_within("absorbance", &absorbance, NOT_NEGATIVE)?;
    if !defocus_um.is_finite() {
        return Err(wrong(format!("defocus_um: {defocus_um} is out of range: expected a finite number")));
    }
    let height = values.len() / width;
    let made = py.detach(|| {
        let params = optics_psf::MicroscopeParams { na, condenser_na, ..Default::default() };
        let microscope = optics_psf::Microscope::new(&params)?;
        let params = optics_psf::BrightFieldParams { width, height, depths_um: vec![defocus_um], ..Default::default() };
        let field = optics_psf::BrightField::new(&microscope, &params)?;
        let mut specimen = field.specimen();
        field.set_absorbance(&mut specimen, 0, &values);
        Ok(field.image(&mut specimen, 0))
    });
    let light = made.map_err(|error: optics_psf::Error| wrong(error))?;
    let columns = light.len() / (height / 2).max(1);
    self::image(py, light, columns)
}

/// Return the Gibson–Lanni point spread function of a point below a cover glass.
///
/// Parameters
/// ----------
/// r_um, z_um : array_like
///     Distances from the axis and stage positions, µm.
/// na, wavelength_um, depth_um : float, optional
///     Numerical aperture, wavelength and depth of the point, µm.
///
/// Returns
/// -------
/// ndarray
///     (z, r), float64.
#[pyfunction]
#[pyo3(signature = (r_um, z_um, *, na=None, wavelength_um=None, depth_um=None))]
fn gibson_lanni(
    py: Python<'_>,
    r_um: Vec<f64>,
    z_um: Vec<f64>,
    na: Option<f64>,
    wavelength_um: Option<f64>,
    depth_um: Option<f64>,
) -> PyResult<Bound<'_, PyAny>> {
    let default = optics_psf::GibsonLanniParams::default();
    let params = optics_psf::GibsonLanniParams {
        na: na.unwrap_or(default.na),
        wavelength_um: wavelength_um.unwrap_or(default.wavelength_um),
        depth_um: depth_um.unwrap_or(default.depth_um),
        ..default
    };
    let made = py.detach(|| optics_psf::GibsonLanni::new(&params)?.profile(&r_um, &z_um));
    image(py, made.map_err(wrong)?, r_um.len())
}

/// Simulate a camera frame with shot noise, read noise and fixed pattern.
///
/// Parameters
/// ----------
/// electrons : array_like
///     (rows, columns), mean photo-electrons.
/// seed : int
/// camera : str
///     "paper", "orca-05g" or "scmos".
///
/// Returns
/// -------
/// ndarray
///     As `electrons`, uint16 grey levels.
#[pyfunction]
#[pyo3(signature = (electrons, seed=0, *, camera="orca-05g"))]
fn expose<'py>(py: Python<'py>, electrons: ArrayLike<'py>, seed: u64, camera: &str) -> PyResult<Bound<'py, PyAny>> {
    let (electrons, width) = pixels_within("electrons", &electrons, NOT_NEGATIVE)?;
    let params = match camera {
        "paper" => ccd_noise::CameraParams::paper(),
        "orca-05g" => ccd_noise::CameraParams::orca_05g(),
        "scmos" => ccd_noise::CameraParams::scmos(),
        other => {
            let message = format!("camera: unknown camera `{other}`; expected paper, orca-05g or scmos");
            return Err(wrong(message));
        }
    };
    let camera = ccd_noise::Camera::new(&params).map_err(wrong)?;
    let mut frame = vec![0_u16; electrons.len()];
    py.detach(|| camera.expose_window(&electrons, width, [0, 0], seed, &mut frame));
    image(py, frame, width)
}

/// Return the transmittance of a mixture of dyes in the channels of a colour camera.
///
/// Parameters
/// ----------
/// haematein, eosin_y, light_green, orange_g : array_like, optional
///     (rows, columns), decadic absorbance of each dye at its peak; at least one, all of equal shape.
///
/// Returns
/// -------
/// ndarray
///     (rows, columns, 3), float32, relative to the empty slide.
#[pyfunction]
#[pyo3(signature = (*, haematein=None, eosin_y=None, light_green=None, orange_g=None))]
fn transmittance<'py>(
    py: Python<'py>,
    haematein: Option<ArrayLike<'py>>,
    eosin_y: Option<ArrayLike<'py>>,
    light_green: Option<ArrayLike<'py>>,
    orange_g: Option<ArrayLike<'py>>,
) -> PyResult<Bound<'py, PyAny>> {
    use dye_spectra::{Colour, ColourParams, DYES};
    // In the order of `Dye::ALL`, without the last one, which is neutral.
    let given = [("haematein", haematein), ("eosin_y", eosin_y), ("light_green", light_green), ("orange_g", orange_g)];
    let mut planes: [Vec<f32>; DYES] = Default::default();
    let mut shape: Option<[usize; 2]> = None;
    for ((name, plane), place) in given.into_iter().zip(&mut planes) {
        let Some(plane) = plane else { continue };
        let (values, width) = pixels_within(name, &plane, NOT_NEGATIVE)?;
        let own = [values.len() / width, width];
        if shape.is_some_and(|shape| shape != own) {
            return Err(wrong(format!("{name}: the shape {own:?} differs from that of the other dyes")));
        }
        shape = Some(own);
        *place = values;
    }
    let Some([rows, width]) = shape else {
        return Err(wrong("expected at least one dye"));
    };
    let colour = Colour::new(&ColourParams::default()).map_err(wrong)?;
    let light = py.detach(|| {
        let mut light = [(); 3].map(|()| vec![0.0_f32; rows * width]);
        colour.transmittance_into(
            planes.each_ref().map(|plane| &plane[..]),
            light.each_mut().map(|plane| &mut plane[..]),
        );
        let [red, green, blue] = &light;
        red.iter().zip(green).zip(blue).flat_map(|((red, green), blue)| [*red, *green, *blue]).collect::<Vec<f32>>()
    });
    Ok(light.into_pyarray(py).reshape([rows, width, 3])?.into_any())
}
