//! The class `Engine`, and recipes, models and scenes from Python objects.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Preset, Recipe, diagnose};
use papsynth::scene::Scene;
use papsynth::{Plane, Threads};
use papsynth_dataset::Layout;
use papsynth_dataset::memory::{MemoryEstimate, available};
use papsynth_dataset::read::{InputFile, Limits, read_inputs};
use pyo3::exceptions::{PyFileNotFoundError, PyMemoryError, PyOSError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use crate::error::wrong;
use crate::frame::Frame;
use crate::{convert, error, pool};

const MAX_RECIPE_BYTES: u64 = 1 << 20;

const MAX_MODEL_BYTES: u64 = 1 << 28;

const MAX_SCENE_BYTES: u64 = 1 << 30;

/// Render images of a recipe.
///
/// Parameters
/// ----------
/// recipe : None, str, os.PathLike or dict
///     None for the default, the name of a preset, the path of a TOML file, or a dictionary of sections. Omitted
///     fields have their defaults.
/// model : None, dict, str or os.PathLike
///     A model, such as `papsynth.learn` returns, or the path of a model or class file; extends the built-in model.
///
/// Raises
/// ------
/// RecipeError
///     If a field of the recipe is invalid; the message names it.
/// OSError
///     If a file cannot be read.
/// ValueError
///     If the model is invalid.
/// MemoryError
///     If the largest frame of the recipe may need more memory than is available.
#[pyclass(frozen, module = "papsynth")]
pub(crate) struct Engine {
    pub(crate) engine: Arc<papsynth::Engine>,
    pub(crate) model: Model,
    pub(crate) map: Option<InputFile>,
    pub(crate) source: String,
}

/// Why rendering ended early.
enum Stop {
    Engine(papsynth::Error),
    Python(PyErr),
}

impl From<papsynth::Error> for Stop {
    fn from(error: papsynth::Error) -> Self {
        Self::Engine(error)
    }
}

#[pymethods]
impl Engine {
    #[new]
    #[pyo3(signature = (recipe=None, model=None))]
    fn new(py: Python<'_>, recipe: Option<&Bound<'_, PyAny>>, model: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let Source { mut recipe, folder, name } = Source::read(py, recipe)?;
        let model = read_model(py, model)?;
        let faults = diagnose::unknown_classes(&recipe, &model);
        if !faults.is_empty() {
            return Err(error::recipe(py, &name, &faults));
        }
        let (inputs, map) =
            read_inputs(&mut recipe, &folder, &Limits::default()).map_err(|error| error::dataset(&error))?;
        let need = MemoryEstimate::of(&recipe, &model, &Layout::default());
        if let Some(bytes) = available().filter(|bytes| need.of_one_frame() > *bytes as f64) {
            return Err(PyMemoryError::new_err(need.too_large(&recipe, bytes)));
        }
        let made = py.detach(|| papsynth::Engine::new(&recipe, &model, &inputs));
        let engine = made.map_err(|error| error::engine(py, &name, &error))?;
        Ok(Self { engine: Arc::new(engine), model, map, source: name })
    }

    /// Render an image with its ground truth.
    ///
    /// Parameters
    /// ----------
    /// seed : int
    ///     Seed of the data set, 0 to 2**64 - 1.
    /// index : int
    ///     Index of the image, 0 to 2**64 - 1.
    /// threads : int
    ///     Number of threads: 1 for the calling thread only, 0 for all processors. The result does not depend on it.
    /// scene : None, dict, str or os.PathLike
    ///     Scene to render instead of the one of seed and index: a dictionary such as `scene` returns, or the path of a
    ///     JSON file that `papsynth generate --scenes` wrote.
    ///
    /// Returns
    /// -------
    /// Frame
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the scene is invalid; the message names the object and the field.
    /// KeyboardInterrupt
    ///     On Ctrl-C, between the planes of a stack.
    #[pyo3(signature = (seed=0, index=0, *, threads=1, scene=None))]
    fn render(
        &self,
        py: Python<'_>,
        seed: u64,
        index: u64,
        threads: usize,
        scene: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Frame> {
        let given = scene.map(|scene| read_scene(py, scene)).transpose()?;
        let engine = Arc::clone(&self.engine);
        let scene = || given.map_or_else(|| engine.scene(Key { seed, index }), Ok);
        let pool = (threads != 1).then(|| pool::of(py, threads)).transpose()?;
        let made = py.detach(|| match pool {
            None => render(&engine, scene()?, Threads::One),
            Some(pool) => pool.install(|| render(&engine, scene()?, Threads::All)),
        });
        let frame = made.map_err(|stop| match stop {
            Stop::Engine(error) => error::engine(py, &self.source, &error),
            Stop::Python(error) => error,
        })?;
        Frame::new(py, frame)
    }

    /// Draw the scene of an image: every object with position, depth, size and stain, and the imaging parameters.
    ///
    /// Parameters
    /// ----------
    /// seed, index : int
    ///     As for `render`.
    ///
    /// Returns
    /// -------
    /// dict
    ///     The scene. Change it and pass it to `render`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the scene cannot be drawn.
    ///
    /// Examples
    /// --------
    /// >>> engine = papsynth.Engine({"field": {"width_px": 64, "height_px": 48}})
    /// >>> scene = engine.scene(seed=7)
    /// >>> scene["objects"][0]["centre_um"] = [8.0, 6.0]
    /// >>> frame = engine.render(scene=scene)
    #[pyo3(signature = (seed=0, index=0))]
    fn scene<'py>(&self, py: Python<'py>, seed: u64, index: u64) -> PyResult<Bound<'py, PyAny>> {
        let drawn = py.detach(|| self.engine.scene(Key { seed, index }));
        let scene = drawn.map_err(|error| error::engine(py, &self.source, &error))?;
        py.import("json")?.call_method1("loads", (scene.to_json(),))
    }

    /// SHA-256 of recipe, model and versions. Engines with equal identity render equal images.
    #[getter]
    fn identity(&self, py: Python<'_>) -> PyResult<String> {
        let text = format!("{}\n{}\n{}", identity(), self.engine.recipe().to_toml(), self.model.to_json());
        let hash = py.import("hashlib")?.call_method1("sha256", (text.as_bytes(),))?;
        hash.call_method0("hexdigest")?.extract()
    }

    /// Whether the recipe refers to a file, such as a density map.
    #[getter]
    fn names_files(&self) -> bool {
        self.map.is_some()
    }

    /// The complete recipe as TOML.
    #[getter]
    fn recipe(&self) -> String {
        self.engine.recipe().to_toml()
    }

    /// Return the HTML that Jupyter shows: the preset that is closest to the recipe, and the fields that differ.
    fn _repr_html_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let display = py.import("papsynth._display")?;
        display.call_method1("engine_html", (self.recipe(),))
    }

    fn __repr__(&self) -> String {
        format!("<papsynth.Engine of {}>", self.source)
    }
}

/// Renders a frame and checks Python signals between planes.
fn render(engine: &papsynth::Engine, scene: Scene, threads: Threads) -> Result<papsynth::Frame, Stop> {
    let mut planes: Vec<Plane> = Vec::new();
    let finished = engine.image(scene, threads, |plane| {
        planes.push(plane.clone());
        Python::attach(|py| py.check_signals()).map_err(Stop::Python)
    })?;
    Ok(papsynth::Frame { planes, finished })
}

pub(crate) struct Source {
    pub(crate) recipe: Recipe,
    /// Base of relative paths in the recipe.
    pub(crate) folder: PathBuf,
    /// Name of the recipe in messages.
    pub(crate) name: String,
}

impl Source {
    /// Reads a recipe from None, a preset name, a path or a dictionary.
    pub(crate) fn read(py: Python<'_>, recipe: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let of_preset = |preset: Preset| Self {
            recipe: preset.recipe(),
            folder: PathBuf::new(),
            name: format!("the preset {}", preset.name()),
        };
        let Some(recipe) = recipe.filter(|recipe| !recipe.is_none()) else { return Ok(of_preset(Preset::Lbc)) };
        if let Ok(text) = recipe.cast::<PyString>()
            && let Some(preset) = Preset::ALL.into_iter().find(|preset| text.to_str().is_ok_and(|t| t == preset.name()))
        {
            return Ok(of_preset(preset));
        }
        let dict = recipe.hasattr("to_dict")?.then(|| recipe.call_method0("to_dict")).transpose()?;
        if let Ok(dict) = dict.as_ref().unwrap_or(recipe).cast::<PyDict>() {
            let name = "the recipe".to_owned();
            let table = convert::table(dict, "", 0)?;
            if table.is_empty() {
                return Ok(Self { name, ..of_preset(Preset::Lbc) });
            }
            let text = toml::to_string(&table).map_err(wrong)?;
            let recipe = diagnose::read(&text).map_err(|faults| error::recipe(py, &name, &faults))?;
            return Ok(Self { recipe, folder: PathBuf::new(), name });
        }
        let presets = || Preset::ALL.map(Preset::name).join(", ");
        let path: PathBuf = recipe.extract().map_err(|_| {
            PyTypeError::new_err(format!(
                "recipe: expected None, a dictionary, the path of a TOML file or one of {}; found {}",
                presets(),
                recipe.get_type()
            ))
        })?;
        if !path.exists() {
            let (path, presets) = (path.display(), presets());
            let message = format!("recipe: no file or preset `{path}`; presets: {presets}");
            return Err(PyFileNotFoundError::new_err(message));
        }
        let text = read(&path, MAX_RECIPE_BYTES)?;
        let name = path.display().to_string();
        let recipe = diagnose::read(&text).map_err(|faults| error::recipe(py, &name, &faults))?;
        let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
        Ok(Self { recipe, folder, name })
    }
}

/// Returns the built-in model, extended by a file or a dictionary.
pub(crate) fn read_model(py: Python<'_>, model: Option<&Bound<'_, PyAny>>) -> PyResult<Model> {
    let Some(model) = model.filter(|model| !model.is_none()) else { return Ok(Model::builtin()) };
    let (name, text) = json(py, model, "the model", MAX_MODEL_BYTES)?;
    Model::builtin().with(&text).map_err(|error| wrong(format!("{name}: {error}")))
}

fn read_scene(py: Python<'_>, scene: &Bound<'_, PyAny>) -> PyResult<Scene> {
    let (name, text) = json(py, scene, "the scene", MAX_SCENE_BYTES)?;
    Scene::from_json(&text).map_err(|error| wrong(format!("{name}: {error}")))
}

/// Returns name and text of a file, or of a dictionary as JSON.
fn json(py: Python<'_>, given: &Bound<'_, PyAny>, name: &str, largest: u64) -> PyResult<(String, String)> {
    if given.is_instance_of::<PyDict>() {
        return Ok((name.to_owned(), py.import("json")?.call_method1("dumps", (given,))?.extract()?));
    }
    let path: PathBuf = given.extract()?;
    Ok((path.display().to_string(), read(&path, largest)?))
}

fn read(path: &Path, largest: u64) -> PyResult<String> {
    let named =
        |error: std::io::Error| PyErr::from(std::io::Error::new(error.kind(), format!("{}: {error}", path.display())));
    // Special files do not report their length.
    let mut text = String::new();
    let read = fs::File::open(path).and_then(|file| file.take(largest + 1).read_to_string(&mut text));
    if read.map_err(named)? as u64 > largest {
        let message = format!("{}: the file is too large: expected at most {largest} bytes", path.display());
        return Err(PyOSError::new_err(message));
    }
    Ok(text)
}

/// Returns the JSON schema of recipes.
#[pyfunction]
pub(crate) fn recipe_schema() -> String {
    Recipe::schema().to_string()
}

/// Returns names and summaries of the presets.
#[pyfunction]
pub(crate) fn presets() -> Vec<(&'static str, &'static str)> {
    Preset::ALL.into_iter().map(|preset| (preset.name(), preset.summary())).collect()
}

/// Returns a complete recipe as TOML.
#[pyfunction]
#[pyo3(signature = (recipe=None, widen=1.0))]
pub(crate) fn resolve(py: Python<'_>, recipe: Option<&Bound<'_, PyAny>>, widen: f64) -> PyResult<String> {
    if !(1.0..=5.0).contains(&widen) {
        return Err(wrong(format!("widen: {widen} is out of range: expected 1 to 5")));
    }
    let source = Source::read(py, recipe)?;
    let problems = source.recipe.problems();
    if problems.is_empty() {
        return Ok(source.recipe.widened(widen).to_toml());
    }
    Err(error::engine(py, &source.name, &papsynth::Error::Recipe(problems)))
}

/// What decides of the images of a recipe beside itself: versions of the package and of its random streams.
#[pyfunction]
pub(crate) fn identity() -> String {
    format!("{} (streams of version {})", env!("CARGO_PKG_VERSION"), papsynth::key::STREAM_VERSION)
}
