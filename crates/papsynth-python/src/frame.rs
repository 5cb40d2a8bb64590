//! Frames as NumPy arrays, and their pickled form: the arrays and the ground truth, with masks as run lengths.

use std::path::PathBuf;
use std::sync::OnceLock;

use numpy::{Element, IntoPyArray, PyArrayDyn, PyArrayMethods};
use papsynth::Plane;
use papsynth::scene::{ObjectKind, Tint};
use papsynth::truth::{Bounds, Group, MIN_DETECTABILITY, Mask, ObjectTruth, Part, SemanticClass, Truth, UnknownTrait};
use papsynth_dataset::{Column, InputError, columns, rle, write_png};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};

use crate::error::{self, wrong};

/// An image or focus stack with its ground truth. Arrays are cached and shared: copy them before you change them.
///
/// Attributes
/// ----------
/// image : ndarray
///     (height, width), or (height, width, 3) in colour; uint8, or uint16 for more than 8 bits. For a stack, the
///     all-in-focus image.
/// stack : ndarray
///     (planes, height, width[, 3]), the same type; one plane for an image.
/// noise_free : ndarray
///     float32, as `stack`: the expected grey levels, before noise and rounding.
/// labels : dict of str to ndarray
///     (height, width), int32, of "cytoplasm", "nucleus" and "debris": the id of the visible object at each
///     pixel, 0 for none.
/// layers : ndarray
///     (height, width), uint16: number of cytoplasms at each pixel.
/// masks, visible_masks : ndarray
///     (objects, height, width), bool: complete masks, and those not hidden by objects of the same group.
/// boxes : ndarray
///     (objects, 4), int32: x0, y0, x1, y1 of the complete masks; x1 and y1 are exclusive.
/// rle, visible_rle : list of dict
///     Run lengths of the masks, as pycocotools reads them.
/// table : dict of str to ndarray
///     Columns with a value per object part: class, position in µm, area, ….
/// defocus_um, detectability : ndarray
///     (objects, planes), float64.
#[pyclass(frozen, module = "papsynth")]
pub(crate) struct Frame {
    #[pyo3(get)]
    seed: u64,
    #[pyo3(get)]
    index: u64,
    #[pyo3(get)]
    slide: u64,
    #[pyo3(get)]
    pixel_um: f64,
    #[pyo3(get)]
    planes_um: Vec<f64>,
    #[pyo3(get)]
    bits: u32,
    #[pyo3(get)]
    image: Py<PyAny>,
    #[pyo3(get)]
    stack: Py<PyAny>,
    #[pyo3(get)]
    noise_free: Py<PyAny>,
    truth: Truth,
    cache: Cache,
}

#[derive(Default)]
struct Cache {
    labels: OnceLock<Py<PyAny>>,
    layers: OnceLock<Py<PyAny>>,
    masks: OnceLock<Py<PyAny>>,
    visible_masks: OnceLock<Py<PyAny>>,
    table: OnceLock<Py<PyAny>>,
}

impl Frame {
    pub(crate) fn new(py: Python<'_>, frame: papsynth::Frame) -> PyResult<Self> {
        let picture = frame.image();
        let papsynth::Frame { planes, finished } = frame;
        let scene = &finished.scene;
        let (bits, channels) = (scene.camera.bits, planes.first().map_or(1, |plane| plane.channels));
        let size = [scene.view.height, scene.view.width];
        let count = planes.len();
        let levels = |levels: Vec<u16>, shape: Vec<usize>| -> PyResult<Py<PyAny>> {
            if bits <= 8 {
                #[expect(clippy::cast_possible_truncation, reason = "at most 8 bits")]
                return array(py, levels.into_iter().map(|level| level as u8).collect(), shape);
            }
            array(py, levels, shape)
        };
        let shape = |planes: Option<usize>| -> Vec<usize> {
            planes.into_iter().chain(size).chain((channels > 1).then_some(channels)).collect()
        };
        let image = levels(picture, shape(None))?;
        let (mut grey, mut noise_free) = (Vec::new(), Vec::new());
        for plane in planes {
            let Plane { grey: levels, noise_free: expected, .. } = plane;
            if count == 1 {
                (grey, noise_free) = (levels, expected);
            } else {
                grey.extend(levels);
                noise_free.extend(expected);
            }
        }
        Ok(Self {
            seed: scene.key.seed,
            index: scene.key.index,
            slide: scene.slide,
            pixel_um: scene.view.pixel_um,
            planes_um: scene.planes_um.clone(),
            bits,
            image,
            stack: levels(grey, shape(Some(count)))?,
            noise_free: array(py, noise_free, shape(Some(count)))?,
            truth: finished.truth,
            cache: Cache::default(),
        })
    }

    fn masks_of(&self, py: Python<'_>, mask: impl Fn(&ObjectTruth) -> &Mask + Sync) -> PyResult<Py<PyAny>> {
        let Truth { width, height, objects } = &self.truth;
        let values = py.detach(|| {
            let mut values = vec![false; objects.len() * width * height];
            for (object, values) in objects.iter().zip(values.chunks_exact_mut((width * height).max(1))) {
                mask(object).pixels(*width).for_each(|pixel| values[pixel] = true);
            }
            values
        });
        array(py, values, vec![objects.len(), *height, *width])
    }

    fn rle_of(&self, py: Python<'_>, mask: impl Fn(&ObjectTruth) -> &Mask) -> PyResult<Py<PyAny>> {
        let Truth { width, height, objects } = &self.truth;
        let list = PyList::empty(py);
        for object in objects {
            let one = PyDict::new(py);
            one.set_item("size", [*height, *width])?;
            one.set_item("counts", PyBytes::new(py, rle::encode(mask(object), *width, *height).as_bytes()))?;
            list.append(one)?;
        }
        list.into_py_any(py)
    }

    fn by_plane(&self, py: Python<'_>, values: impl Fn(&ObjectTruth) -> &Vec<f64>) -> PyResult<Py<PyAny>> {
        let all: Vec<f64> = self.truth.objects.iter().flat_map(|object| values(object).iter().copied()).collect();
        array(py, all, vec![self.truth.objects.len(), self.planes_um.len()])
    }
}

#[pymethods]
impl Frame {
    #[getter]
    fn labels(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        cached(py, &self.cache.labels, || {
            let Truth { width, height, .. } = self.truth;
            let dict = PyDict::new(py);
            for group in Group::ALL {
                let ids = py.detach(|| self.truth.labels(group).ids);
                #[expect(clippy::cast_possible_wrap, reason = "ids of a field are far below 2³¹")]
                let ids = ids.into_iter().map(|id| id as i32).collect();
                dict.set_item(group.name(), array::<i32>(py, ids, vec![height, width])?)?;
            }
            dict.into_py_any(py)
        })
    }

    #[getter]
    fn layers(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let Truth { width, height, .. } = self.truth;
        cached(py, &self.cache.layers, || array(py, py.detach(|| self.truth.layers()), vec![height, width]))
    }

    #[getter]
    fn masks(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        cached(py, &self.cache.masks, || self.masks_of(py, |object| &object.amodal))
    }

    #[getter]
    fn visible_masks(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        cached(py, &self.cache.visible_masks, || self.masks_of(py, |object| &object.visible))
    }

    #[getter]
    fn boxes(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        #[expect(clippy::cast_possible_wrap, reason = "images have fewer than 2³¹ rows and columns")]
        let of = |bounds: Bounds| {
            [bounds.x, bounds.y, bounds.x + bounds.width, bounds.y + bounds.height].map(|side| side as i32)
        };
        let all: Vec<i32> =
            self.truth.objects.iter().flat_map(|object| object.amodal.bounds().map_or([0; 4], of)).collect();
        array(py, all, vec![self.truth.objects.len(), 4])
    }

    #[getter]
    fn rle(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.rle_of(py, |object| &object.amodal)
    }

    #[getter]
    fn visible_rle(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.rle_of(py, |object| &object.visible)
    }

    #[getter]
    fn defocus_um(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.by_plane(py, |object| &object.defocus_um)
    }

    #[getter]
    fn detectability(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.by_plane(py, |object| &object.detectability)
    }

    #[getter]
    fn table(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        cached(py, &self.cache.table, || {
            let dict = PyDict::new(py);
            let count = self.truth.objects.len();
            for (name, column) in columns(&self.truth, self.index) {
                let values = match column {
                    Column::Whole(values) => array(py, values, vec![count])?,
                    Column::Number(values) => array(py, values, vec![count])?,
                    Column::Flag(values) => array(py, values, vec![count])?,
                    Column::Text(values) => text(py, values)?,
                    // Arrays with a value per plane have their own attributes.
                    Column::Numbers(_) => continue,
                };
                dict.set_item(name, values)?;
            }
            dict.into_py_any(py)
        })
    }

    /// Return the semantic class of each pixel. `papsynth.semantic_target` numbers chosen classes.
    ///
    /// Parameters
    /// ----------
    /// classes : list of str, optional
    ///     Names from `papsynth.SEMANTIC_CLASSES`; objects of other classes are left out. Default: all classes.
    /// min_detectability : float
    ///     As for `papsynth.semantic_target`.
    ///
    /// Returns
    /// -------
    /// ndarray
    ///     (height, width), uint8: position of the class in `papsynth.SEMANTIC_CLASSES`, or 255 for ignored pixels.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a class is unknown, or `min_detectability` is negative or not finite.
    #[pyo3(signature = (classes=None, *, min_detectability=MIN_DETECTABILITY))]
    #[expect(clippy::needless_pass_by_value, reason = "owned argument of Python")]
    fn semantic(&self, py: Python<'_>, classes: Option<Vec<String>>, min_detectability: f64) -> PyResult<Py<PyAny>> {
        let least = checked_detectability(min_detectability)?;
        let classes: Vec<SemanticClass> = match &classes {
            None => SemanticClass::ALL.to_vec(),
            Some(names) => names.iter().map(|name| semantic_class(name)).collect::<PyResult<_>>()?,
        };
        let Truth { width, height, .. } = self.truth;
        array(py, py.detach(|| self.truth.semantic(&classes, least)), vec![height, width])
    }

    /// Return whether training should ignore each object: a nucleus, or an object that looks like one, that cannot be
    /// seen.
    ///
    /// Parameters
    /// ----------
    /// min_detectability : float
    ///     As for `papsynth.semantic_target`.
    ///
    /// Returns
    /// -------
    /// ndarray
    ///     (objects,), bool.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If `min_detectability` is negative or not finite.
    #[pyo3(signature = (min_detectability=MIN_DETECTABILITY))]
    fn ignored(&self, py: Python<'_>, min_detectability: f64) -> PyResult<Py<PyAny>> {
        let least = checked_detectability(min_detectability)?;
        let objects = &self.truth.objects;
        array(py, objects.iter().map(|object| object.is_ignored(least)).collect(), vec![objects.len()])
    }

    /// Write `image` as PNG with its pixel size. An existing file is replaced.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     The file.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     If the file cannot be written. An existing file is then unchanged.
    #[expect(clippy::needless_pass_by_value, reason = "owned argument of Python")]
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let image = self.image.bind(py);
        let levels: Vec<u16> = match image.cast::<PyArrayDyn<u8>>() {
            Ok(image) => image.readonly().as_array().iter().copied().map(u16::from).collect(),
            Err(_) => image.cast::<PyArrayDyn<u16>>()?.readonly().as_array().iter().copied().collect(),
        };
        let Truth { width, height, .. } = &self.truth;
        let channels = levels.len() / (width * height).max(1);
        let written = py.detach(|| write_png(&path, &levels, *width, channels, self.bits, self.pixel_um));
        written.map_err(|error| error::dataset(&error))
    }

    /// Return the PNG that Jupyter shows: `image`, reduced to at most 768 pixels a side, with outlines of the visible
    /// cells and nuclei.
    fn _repr_png_<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        this.py().import("papsynth._display")?.call_method1("frame_png", (this,))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Pickled)> {
        let Truth { width, height, .. } = self.truth;
        let arrays = [&self.image, &self.stack, &self.noise_free].map(|array| array.clone_ref(py));
        let key = (self.seed, self.index, self.slide);
        let scale = (self.pixel_um, self.planes_um.clone(), self.bits, [width, height]);
        let state = (PICKLED, key, scale, arrays, py.detach(|| pickled_objects(&self.truth)));
        Ok((py.import("papsynth._native")?.getattr("_restored")?, state))
    }

    fn __len__(&self) -> usize {
        self.truth.objects.len()
    }

    fn __repr__(&self) -> String {
        let Truth { width, height, objects } = &self.truth;
        let cells = objects.iter().filter(|object| object.part == Part::Cytoplasm).count();
        let (Self { seed, index, .. }, planes, all) = (self, self.planes_um.len(), objects.len());
        format!(
            "<papsynth.Frame {index} of seed {seed}: {width} x {height} px, {planes} planes, {cells} cells, {all} objects and parts>"
        )
    }
}

/// Checks a minimum of the detectability.
pub(crate) fn checked_detectability(least: f64) -> PyResult<f64> {
    match least.is_finite() && least >= 0.0 {
        true => Ok(least),
        false => {
            Err(wrong(format!("min_detectability: {least} is out of range: expected a finite number of at least 0")))
        }
    }
}

fn semantic_class(name: &str) -> PyResult<SemanticClass> {
    SemanticClass::by_name(name).ok_or_else(|| {
        let known = SemanticClass::ALL.map(SemanticClass::name).join(", ");
        wrong(format!("classes: unknown class `{name}`; expected some of {known}"))
    })
}

/// Version; seed, index, slide; pixel size, planes, bits, width and height; image, stack and noise-free image; objects.
type Pickled = (u32, (u64, u64, u64), (f64, Vec<f64>, u32, [usize; 2]), [Py<PyAny>; 3], Vec<PickledObject>);

/// Restores a pickled frame.
#[pyfunction]
#[pyo3(name = "_restored")]
pub(crate) fn restored(
    py: Python<'_>,
    version: u32,
    key: (u64, u64, u64),
    scale: (f64, Vec<f64>, u32, [usize; 2]),
    arrays: [Py<PyAny>; 3],
    objects: Vec<PickledObject>,
) -> PyResult<Frame> {
    if version != PICKLED {
        let message = format!("this frame was pickled in version {version}; expected version {PICKLED}");
        return Err(wrong(message));
    }
    let ((seed, index, slide), (pixel_um, planes_um, bits, [width, height])) = (key, scale);
    let [image, stack, noise_free] = arrays;
    // Shapes that other methods rely on.
    let [of_image, of_stack] = [&image, &stack].map(|array| array.bind(py).getattr("shape")?.extract::<Vec<usize>>());
    let (of_image, of_stack) = (of_image?, of_stack?);
    if of_image.get(..2) != Some(&[height, width][..])
        || of_stack.split_first() != Some((&planes_um.len(), &of_image[..]))
    {
        return Err(damaged("array shapes do not match"));
    }
    let truth = restored_truth([width, height], planes_um.len(), objects)?;
    Ok(Frame {
        seed,
        index,
        slide,
        pixel_um,
        planes_um,
        bits,
        image,
        stack,
        noise_free,
        truth,
        cache: Cache::default(),
    })
}

/// Returns a cached value, or computes and caches it.
fn cached(
    py: Python<'_>,
    place: &OnceLock<Py<PyAny>>,
    make: impl FnOnce() -> PyResult<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    if let Some(found) = place.get() {
        return Ok(found.clone_ref(py));
    }
    let made = make()?;
    // If two threads compute the value, both return the first result.
    Ok(place.get_or_init(|| made).clone_ref(py))
}

/// Creates an array that owns the values.
fn array<T: Element>(py: Python<'_>, values: Vec<T>, shape: Vec<usize>) -> PyResult<Py<PyAny>> {
    values.into_pyarray(py).reshape(shape)?.into_py_any(py)
}

fn text(py: Python<'_>, values: Vec<String>) -> PyResult<Py<PyAny>> {
    let numpy = py.import("numpy")?;
    numpy.call_method1("array", (values, "U"))?.into_py_any(py)
}

/// Version of the pickled form.
const PICKLED: u32 = 1;

/// Id, group, kind, class, Bethesda category, traits; cluster, centre, depth, absorbance, tint, rotation, area,
/// truncated; masks; defocus and detectability.
type PickledObject = (
    (u32, String, String, String, String, String),
    (u32, [f64; 2], f64, f64, String, f64, f64, bool),
    (String, String),
    (Vec<f64>, Vec<f64>),
);

fn pickled_objects(truth: &Truth) -> Vec<PickledObject> {
    let Truth { width, height, objects } = truth;
    let object = |o: &ObjectTruth| {
        let kind = o.kind.name().to_owned();
        (
            (o.id, o.group().name().to_owned(), kind, o.class.clone(), o.bethesda.clone(), o.traits.to_string()),
            (
                o.cluster,
                o.centre_um,
                o.depth_um,
                o.mean_absorbance,
                o.tint_name().to_owned(),
                o.rotation_deg,
                o.area_um2,
                o.truncated,
            ),
            (rle::encode(&o.amodal, *width, *height), rle::encode(&o.visible, *width, *height)),
            (o.defocus_um.clone(), o.detectability.clone()),
        )
    };
    objects.iter().map(object).collect()
}

/// Restores the ground truth of a frame.
fn restored_truth([width, height]: [usize; 2], planes: usize, objects: Vec<PickledObject>) -> PyResult<Truth> {
    let objects = objects.into_iter().map(|object| restored_object(object, [width, height], planes));
    Ok(Truth { width, height, objects: objects.collect::<PyResult<_>>()? })
}

fn restored_object(object: PickledObject, [width, height]: [usize; 2], planes: usize) -> PyResult<ObjectTruth> {
    let (
        (id, group, kind, class, bethesda, traits),
        (cluster, centre_um, depth_um, mean_absorbance, tint, rotation_deg, area_um2, truncated),
        (amodal, visible),
        (defocus_um, detectability),
    ) = object;
    let unknown = |what: &str, name: &str| damaged(&format!("object {id}: unknown {what} `{name}`"));
    let mask = |counts: &str| {
        rle::decode(counts, width, height).map_err(|error: InputError| damaged(&format!("object {id}: {error}")))
    };
    if [defocus_um.len(), detectability.len()] != [planes; 2] {
        return Err(damaged(&format!("object {id}: expected {planes} values per plane list")));
    }
    let part = match Group::ALL.into_iter().find(|one| one.name() == group) {
        Some(Group::Cytoplasm) => Part::Cytoplasm,
        Some(Group::Nucleus) => Part::Nucleus,
        Some(Group::Debris) => Part::Whole,
        None => return Err(unknown("group", &group)),
    };
    let named = (!tint.is_empty()).then(|| Tint::by_name(&tint).ok_or_else(|| unknown("tint", &tint)));
    Ok(ObjectTruth {
        id,
        part,
        kind: ObjectKind::ALL.into_iter().find(|one| one.name() == kind).ok_or_else(|| unknown("kind", &kind))?,
        class,
        bethesda,
        traits: traits.try_into().map_err(|error: UnknownTrait| damaged(&format!("object {id}: {error}")))?,
        cluster,
        centre_um,
        depth_um,
        mean_absorbance,
        tint: named.transpose()?,
        rotation_deg,
        area_um2,
        truncated,
        amodal: mask(&amodal)?,
        visible: mask(&visible)?,
        defocus_um,
        detectability,
    })
}

fn damaged(what: &str) -> PyErr {
    wrong(format!("invalid pickled frame: {what}"))
}
