//! Engines and what they make.

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

const LARGEST_RECIPE: u64 = 1 << 20;

const LARGEST_MODEL: u64 = 1 << 28;

const LARGEST_SCENE: u64 = 1 << 30;

/// Makes the images of one recipe.
///
/// Parameters
/// ----------
/// recipe : None, str, os.PathLike or dict
///     Nothing for the default, the name of a preset, the path of a TOML file, or fields by section; what is left out is the default.
/// model : None, dict, str or os.PathLike
///     A model, such as `papsynth.learn` returns, or the path of a model or class file, laid over the model that ships.
///
/// Raises
/// ------
/// RecipeError
///     If a field of the recipe cannot be what it is; names the field.
/// OSError
///     If a file cannot be read.
/// ValueError
///     If the model cannot be used.
/// MemoryError
///     If the largest frame of the recipe needs more memory than there is, where the system tells.
#[pyclass(frozen, module = "papsynth")]
pub(crate) struct Engine {
    pub(crate) engine: Arc<papsynth::Engine>,
    pub(crate) model: Model,
    pub(crate) map: Option<InputFile>,
    pub(crate) source: String,
}

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
        let need = MemoryEstimate::of(&recipe, &Layout::default());
        if let Some(bytes) = available().filter(|bytes| need.of_one_frame() > *bytes as f64) {
            return Err(PyMemoryError::new_err(need.too_large(&recipe, bytes)));
        }
        let made = py.detach(|| papsynth::Engine::new(&recipe, &model, &inputs));
        let engine = made.map_err(|error| error::engine(py, &name, &error))?;
        Ok(Self { engine: Arc::new(engine), model, map, source: name })
    }

    /// Makes an image and its truth.
    ///
    /// Parameters
    /// ----------
    /// seed : int
    ///     The data set, 0 to 2**64 - 1.
    /// index : int
    ///     The image in it, 0 to 2**64 - 1.
    /// threads : int
    ///     Threads that work on it, 1 for the calling one alone, 0 for as many as there are processors. The bytes are the same.
    /// scene : None, dict, str or os.PathLike
    ///     A scene to image in place of the one of seed and index: as `scene` returns it, or the path of a JSON file that
    ///     `papsynth generate --scenes` wrote.
    ///
    /// Returns
    /// -------
    /// Frame
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the scene cannot be drawn, or is not valid; names the object and the field.
    /// KeyboardInterrupt
    ///     Between the planes of a stack.
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

    /// Draws what lies in an image: every object with its place, depth, size and stain, and how it is imaged.
    ///
    /// Parameters
    /// ----------
    /// seed, index : int
    ///     As of `render`.
    ///
    /// Returns
    /// -------
    /// dict
    ///     The scene, which `render` takes back: change it, and render it again.
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

    /// SHA-256 of recipe, model and versions: two engines with the same make the same images.
    #[getter]
    fn identity(&self, py: Python<'_>) -> PyResult<String> {
        let text = format!("{}\n{}\n{}", identity(), self.engine.recipe().to_toml(), self.model.to_json());
        let hash = py.import("hashlib")?.call_method1("sha256", (text.as_bytes(),))?;
        hash.call_method0("hexdigest")?.extract()
    }

    /// Whether the recipe names a file, such as a map of places.
    #[getter]
    fn names_files(&self) -> bool {
        self.map.is_some()
    }

    /// The recipe with everything that was left out, as TOML.
    #[getter]
    fn recipe(&self) -> String {
        self.engine.recipe().to_toml()
    }

    fn __repr__(&self) -> String {
        format!("<papsynth.Engine of {}>", self.source)
    }
}

/// Makes a frame, and looks between its planes whether Python wants to stop.
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
    /// Files that it names are relative to this.
    pub(crate) folder: PathBuf,
    /// What messages call it.
    pub(crate) name: String,
}

impl Source {
    /// Reads whatever may stand for a recipe.
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
                "recipe: {} is none; expected None, a dictionary, the path of a TOML file or one of {}",
                recipe.get_type(),
                presets()
            ))
        })?;
        if !path.exists() {
            let (path, presets) = (path.display(), presets());
            let message = format!("recipe: there is no file {path}, nor a preset of that name: {presets}");
            return Err(PyFileNotFoundError::new_err(message));
        }
        let text = read(&path, LARGEST_RECIPE)?;
        let name = path.display().to_string();
        let recipe = diagnose::read(&text).map_err(|faults| error::recipe(py, &name, &faults))?;
        let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
        Ok(Self { recipe, folder, name })
    }
}

/// The model that ships, with the classes of a file, or of a dictionary such as `papsynth.learn` returns.
pub(crate) fn read_model(py: Python<'_>, model: Option<&Bound<'_, PyAny>>) -> PyResult<Model> {
    let Some(model) = model.filter(|model| !model.is_none()) else { return Ok(Model::builtin()) };
    let (name, text) = json(py, model, "the model", LARGEST_MODEL)?;
    Model::builtin().with(&text).map_err(|error| wrong(format!("{name}: {error}")))
}

fn read_scene(py: Python<'_>, scene: &Bound<'_, PyAny>) -> PyResult<Scene> {
    let (name, text) = json(py, scene, "the scene", LARGEST_SCENE)?;
    Scene::from_json(&text).map_err(|error| wrong(format!("{name}: {error}")))
}

/// The name and the text of a file, or of a dictionary as JSON.
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
    // Not everything that can be read says how long it is.
    let mut text = String::new();
    let read = fs::File::open(path).and_then(|file| file.take(largest + 1).read_to_string(&mut text));
    if read.map_err(named)? as u64 > largest {
        let message = format!("{}: more than {largest} bytes; expected at most that", path.display());
        return Err(PyOSError::new_err(message));
    }
    Ok(text)
}

/// The JSON schema of recipes, as text.
#[pyfunction]
pub(crate) fn recipe_schema() -> String {
    Recipe::schema().to_string()
}

/// A recipe, as of `Engine`, with everything that was left out, as TOML.
#[pyfunction]
#[pyo3(signature = (recipe=None))]
pub(crate) fn resolve(py: Python<'_>, recipe: Option<&Bound<'_, PyAny>>) -> PyResult<String> {
    let source = Source::read(py, recipe)?;
    let problems = source.recipe.problems();
    if problems.is_empty() {
        return Ok(source.recipe.to_toml());
    }
    Err(error::engine(py, &source.name, &papsynth::Error::Recipe(problems)))
}

/// What decides of the images of a recipe beside itself: versions of the package and of its random streams.
#[pyfunction]
pub(crate) fn identity() -> String {
    format!("{} (streams of version {})", env!("CARGO_PKG_VERSION"), papsynth::key::STREAM_VERSION)
}
