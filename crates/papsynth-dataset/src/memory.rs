//! Estimates of the memory that frames need, and the number of frames that fit at once.

use std::fs;
use std::path::{Path, PathBuf};

use papsynth::model::Model;
use papsynth::recipe::{CellMix, Colour, Imaging, LightSection, Microscope, Mixing, Number, Optics, Recipe};

use crate::formats::{Format, Layout};

/// Memory of the program before the first frame, bytes: the model and fields that all frames share.
const PROGRAM: f64 = 32.0 * MIB;

/// Memory of small objects that are not counted individually, bytes.
const SMALL_OBJECTS: f64 = 16.0 * MIB;

/// Side of the square around a cell of size 1, including the blur of its image, µm.
const CELL_UM: f64 = 60.0;

/// Largest number of objects in work when all threads work on one frame.
const MAX_ACTIVE_OBJECTS: f64 = 64.0;

/// Safety factor for the variation between frames.
const SAFETY_FACTOR: f64 = 1.15;

/// Border that is added to the side of a frame of a slide, px.
#[cfg(feature = "zarr")]
const BORDER_PX: f64 = 256.0;

const MIB: f64 = 1_048_576.0;

/// Estimated memory of the frames of a recipe, bytes: at least the measured use, and less than 2.5 times the measured
/// use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MemoryEstimate {
    /// Memory of the program without frames.
    program: f64,
    /// Memory of each frame that one thread generates.
    frame: f64,
    /// Memory of one frame on which all threads work, without that of the threads.
    shared: f64,
    /// Memory of each of these threads.
    thread: f64,
}

/// The parallelism of a run that fits into the memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryPlan {
    /// Number of frames at once, each on one thread.
    pub workers: usize,
    /// Whether all threads work on one frame instead.
    pub shared: bool,
    /// Estimated memory, bytes.
    pub bytes: u64,
}

impl MemoryEstimate {
    /// Returns the estimate for the largest frame of a recipe and a model. `tests/memory.rs` of papsynth-cli measures
    /// the constants.
    #[must_use]
    pub fn of(recipe: &Recipe, model: &Model, layout: &Layout) -> Self {
        Self::largest(recipe, |recipe| Self::without_conditions(recipe, model, layout))
    }

    /// Returns the largest estimate over the conditions of slides.
    fn largest(recipe: &Recipe, of: impl Fn(&Recipe) -> Self) -> Self {
        let largest = |a: Self, b: Self| if b.frame > a.frame { b } else { a };
        recipe.each_condition().map(|recipe| of(&recipe)).reduce(largest).unwrap_or_else(|| of(recipe))
    }

    fn without_conditions(recipe: &Recipe, model: &Model, layout: &Layout) -> Self {
        let most = |number: &Number| number.bounds()[1];
        let field = &recipe.field;
        let pixels = most(&field.width_px) * most(&field.height_px);
        let pixel_um = match field.magnification.bounds() {
            [_, most] if most <= 0.0 => field.pixel_um.bounds()[0],
            [_, most] => recipe.camera.pixel_um.bounds()[0] * recipe.camera.binning_px.bounds()[0] / most,
        };
        let is_stack = most(&recipe.focus.planes) > 1.0;
        let range_um = (most(&recipe.focus.planes) - 1.0) * most(&recipe.focus.step_um);
        let (samples, is_filtered, is_exact) = match &recipe.optics {
            Optics::Gaussian(_) => (1.0, false, false),
            Optics::BrightField(Microscope { oversampling, imaging, .. }) => {
                (most(oversampling), true, *imaging == Imaging::Abbe)
            }
        };
        // Channels of the image, and light groups that are imaged at the same time.
        let (channels, lights) = match &recipe.light {
            LightSection::Monochrome(_) => (1.0, 1.0),
            LightSection::Colour(Colour { mixing: Mixing::PerWavelength, .. }) => (3.0, 1.0),
            LightSection::Colour(_) => (3.0, 3.0),
        };
        let grid = samples * samples;
        let mut a_pixel = 10.0 + 23.0 * channels + 4.0 * grid * lights;
        if is_stack {
            a_pixel += 11.0 * channels;
            if layout.has(Format::Webdataset) {
                // The complete stack while it is packed into the tar file.
                a_pixel +=
                    most(&recipe.focus.planes) * channels * if most(&recipe.camera.bits) > 8.0 { 2.0 } else { 1.0 };
            }
        }
        if is_exact {
            a_pixel += 700.0 * grid;
        }
        // Samples of a cell: one in each pixel, and on the grid of the optics in the nucleus.
        let of_cell = |size: f64| {
            let side = CELL_UM * size / pixel_um;
            side * side * (3.0 + 0.25 * grid)
        };
        let area_mm2 = recipe.largest_populated_mm2();
        let visible = (pixels * pixel_um * pixel_um * 1e-6 / area_mm2).min(1.0);
        let size = |class: &str, mix: &CellMix| {
            model.classes.get(class).map_or_else(|| most(&mix.size), |class| class.relative_size(mix))
        };
        let counts = recipe.cells.iter().map(|(class, mix)| (mix.count.bounds(area_mm2)[1], of_cell(size(class, mix))));
        let cells: Vec<(f64, f64)> = counts.filter(|(count, _)| *count > 0.0).collect();
        let count: f64 = cells.iter().map(|(count, _)| count).sum();
        let all: f64 = cells.iter().map(|(count, samples)| count * samples).sum();
        let largest = cells.iter().map(|(_, samples)| *samples).fold(0.0, f64::max);
        // Bytes for each sample of a cell: kept between the planes of a stack, more for a larger range, which has more
        // sizes of the blur; buffers of one thread, reused for all objects; images that wait for those of other
        // threads, with margins as large as the cell.
        let kept = lights * (6.0 + 0.85 * range_um);
        let (kept, buffers, waiting) = match (is_filtered, lights > 1.0) {
            (false, _) => (0.0, 8.0, 8.0),
            (true, false) => (kept, 70.0, 8.0 / grid),
            (true, true) => (kept, 150.0, 24.0 / grid),
        };
        let objects = SMALL_OBJECTS + all * (7.5 * visible + if is_stack { kept } else { 0.0 });
        let frame = pixels * a_pixel + objects + largest * buffers;
        let shared = pixels * a_pixel + objects + largest * waiting * count.min(MAX_ACTIVE_OBJECTS);
        let [frame, shared, thread] = [frame, shared, largest * buffers].map(|bytes| SAFETY_FACTOR * bytes);
        Self { program: PROGRAM, frame, shared, thread }
    }

    /// Returns the estimate for a shard of a slide whose frames are each generated by one thread.
    #[cfg(feature = "zarr")]
    #[must_use]
    pub fn of_slide(recipe: &Recipe, model: &Model, shard_px: u32) -> Self {
        Self::largest(recipe, |recipe| Self::of_slide_without_conditions(recipe, model, shard_px))
    }

    #[cfg(feature = "zarr")]
    fn of_slide_without_conditions(recipe: &Recipe, model: &Model, shard_px: u32) -> Self {
        let most = |number: &Number| number.bounds()[1];
        // With the border that is simulated and cropped.
        let side = f64::from(recipe.scan.frame_px) + BORDER_PX;
        let grown = side * side / (recipe.field.width_px.bounds()[0] * recipe.field.height_px.bounds()[0]).max(1.0);
        let mut frame = recipe.clone();
        (frame.field.width_px, frame.field.height_px) = (side.into(), side.into());
        for mix in frame.cells.values_mut().filter(|mix| !mix.count.is_density()) {
            mix.count = (most(mix.count.number()) * grown).into();
        }
        let of_frame = Self::without_conditions(&frame, model, &Layout::default());
        let channels = if matches!(recipe.light, LightSection::Monochrome(_)) { 1.0 } else { 3.0 };
        // Grey levels, three labels and layers of each pixel, and a copy while they are packed.
        let a_pixel = 2.0 * channels * most(&recipe.focus.planes) + 14.0;
        let shard = f64::from(shard_px) * f64::from(shard_px) * (a_pixel + 4.0 * channels);
        let program = of_frame.program + SAFETY_FACTOR * shard;
        Self { program, frame: of_frame.frame + side * side * a_pixel, shared: f64::INFINITY, thread: 0.0 }
    }

    /// Returns the parallelism that fits into a budget in bytes: at most `workers` frames at once or, with `shared`,
    /// one frame on this number of threads. Returns `None` if one frame does not fit.
    #[must_use]
    pub fn plan(&self, workers: usize, shared: bool, budget: Option<u64>) -> Option<MemoryPlan> {
        let budget = budget.map_or(f64::INFINITY, |bytes| bytes as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casts saturate")]
        let fit = |workers: usize, shared: bool, bytes: f64| MemoryPlan { workers, shared, bytes: bytes as u64 };
        let together = self.program + self.shared + self.thread * workers as f64;
        if shared && together <= budget {
            return Some(fit(1, true, together));
        }
        let needs = |frames: usize| self.program + self.frame * frames as f64;
        let most = (1..=workers).rev().find(|frames| needs(*frames) <= budget)?;
        Some(fit(most, false, needs(most)))
    }

    /// Memory of one frame on one thread, including the program, bytes.
    #[must_use]
    pub fn of_one_frame(&self) -> f64 {
        self.program + self.frame
    }

    /// Returns the message that one frame does not fit into `bytes`.
    #[must_use]
    pub fn too_large(&self, recipe: &Recipe, bytes: u64) -> String {
        let field = &recipe.field;
        format!(
            "field.width_px, field.height_px: a frame of {} x {} pixels needs about {}; the limit is {}",
            field.width_px.bounds()[1],
            field.height_px.bounds()[1],
            format_bytes(self.of_one_frame()),
            format_bytes(bytes as f64)
        )
    }
}

/// Formats a number of bytes in B, MiB or GiB.
#[must_use]
pub fn format_bytes(bytes: f64) -> String {
    if bytes < MIB {
        format!("{bytes:.0} B")
    } else if bytes < 1024.0 * MIB {
        format!("{:.0} MiB", bytes / MIB)
    } else {
        format!("{:.1} GiB", bytes / 1024.0 / MIB)
    }
}

/// Returns the available memory in bytes: that of the machine, or the limit of the control group if it is smaller.
/// Returns `None` on systems other than Linux.
#[must_use]
pub fn available() -> Option<u64> {
    let machine = fs::read_to_string("/proc/meminfo").ok().and_then(|text| meminfo(&text))?;
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let limits = groups.lines().flat_map(folders_of_group).filter_map(|folder| left_in_group(&folder));
    Some(limits.fold(machine, u64::min))
}

fn meminfo(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes.saturating_mul(1024))
}

/// Returns the folders of a control group (a line of `/proc/self/cgroup`) and its parents.
fn folders_of_group(line: &str) -> Vec<PathBuf> {
    let mut parts = line.splitn(3, ':').skip(1);
    let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { return Vec::new() };
    let root = match controllers {
        "" => Path::new("/sys/fs/cgroup"),
        list if list.split(',').any(|name| name == "memory") => Path::new("/sys/fs/cgroup/memory"),
        _ => return Vec::new(),
    };
    Path::new(path.trim_start_matches('/')).ancestors().map(|group| root.join(group)).collect()
}

/// Returns the memory that a control group has left, bytes. Its inactive file cache counts as free.
fn left_in_group(folder: &Path) -> Option<u64> {
    let number = |name: &str| fs::read_to_string(folder.join(name)).ok()?.trim().parse::<u64>().ok();
    let limit = number("memory.max").or_else(|| number("memory.limit_in_bytes"))?;
    let used = number("memory.current").or_else(|| number("memory.usage_in_bytes")).unwrap_or_default();
    let statistics = fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
    let files = statistics.lines().find_map(|line| line.strip_prefix("inactive_file ")?.parse::<u64>().ok());
    Some(limit.saturating_sub(used.saturating_sub(files.unwrap_or_default())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_frames_at_once_if_they_do_not_fit_and_none_if_one_does_not() {
        let estimate = MemoryEstimate { program: 10.0, frame: 100.0, shared: 200.0, thread: 50.0 };
        let fit = |workers, shared, budget| {
            estimate.plan(workers, shared, budget).map(|fit| (fit.workers, fit.shared, fit.bytes))
        };
        assert_eq!(fit(8, false, None), Some((8, false, 810)));
        assert_eq!(fit(8, false, Some(400)), Some((3, false, 310)));
        assert_eq!(fit(8, false, Some(110)), Some((1, false, 110)));
        assert_eq!(fit(8, false, Some(109)), None);
        assert_eq!(fit(2, true, Some(310)), Some((1, true, 310)));
        assert_eq!(fit(2, true, Some(309)), Some((2, false, 210)));
        assert_eq!(fit(1, true, Some(9)), None);
    }

    #[test]
    fn larger_recipes_need_more_memory() {
        let need = |change: &dyn Fn(&mut Recipe)| {
            let mut recipe = Recipe::default();
            change(&mut recipe);
            MemoryEstimate::of(&recipe, &Model::builtin(), &Layout::default())
        };
        let usual = need(&|_| {});
        assert!(usual.shared + usual.thread > usual.frame);
        let larger: [&dyn Fn(&mut Recipe); 4] = [
            &|recipe| recipe.field.width_px = 9000.0.into(),
            &|recipe| recipe.field.pixel_um = 0.1.into(),
            &|recipe| recipe.focus.planes = 3.0.into(),
            &|recipe| recipe.cells.values_mut().for_each(|mix| mix.count = 500.0.into()),
        ];
        for (number, change) in larger.into_iter().enumerate() {
            assert!(need(change).frame > 1.2 * usual.frame, "{number}");
        }
        let most = need(&|recipe| (recipe.field.width_px, recipe.field.height_px) = (32_768.0.into(), 32_768.0.into()));
        assert!(most.frame > 40.0 * 1024.0 * MIB, "{most:?}");
    }

    #[test]
    fn larger_cells_of_a_class_need_more_memory_and_built_in_classes_have_their_size() {
        let model = Model::builtin();
        let need = |model: &Model, mix: CellMix| {
            let recipe = Recipe { cells: [("x".to_owned(), mix)].into(), ..Recipe::default() };
            MemoryEstimate::of(&recipe, model, &Layout::default()).frame
        };
        for (name, class) in &model.classes {
            assert_eq!(class.relative_size(&CellMix::default()), 1.0, "{name}");
        }
        let with = |radius: &str| {
            let text = format!("version = 1\n[classes.x]\nlike = \"intermediate\"\ncytoplasm.radius_um = {radius}");
            need(&model.with(&text).unwrap(), CellMix::default())
        };
        let usual = with("{ median = 26, log_sd = 0.2 }");
        assert_eq!(usual, need(&model, CellMix::default()));
        assert!(with("{ median = 100, log_sd = 0 }") > 1.5 * usual);
        assert!(with("{ median = 26, log_sd = 1 }") > 1.5 * usual);
    }

    #[test]
    fn proc_files_are_parsed() {
        assert_eq!(meminfo("MemTotal: 9 kB\nMemAvailable:       12 kB\n"), Some(12 * 1024));
        let folders = folders_of_group("0::/a/b");
        assert_eq!(folders, ["/sys/fs/cgroup/a/b", "/sys/fs/cgroup/a", "/sys/fs/cgroup/"].map(PathBuf::from));
        assert_eq!(folders_of_group("4:cpu,memory:/x").len(), 2);
        assert!(folders_of_group("5:cpu:/x").is_empty() && folders_of_group("nothing").is_empty());
    }
}
