//! How much memory frames need, how much there is, and how many frames fit side by side.

use std::fs;
use std::path::{Path, PathBuf};

use papsynth::recipe::{Colour, Imaging, LightSection, Microscope, Mixing, Number, Optics, Recipe};

use crate::formats::{Format, Layout};

/// What the program has before the first frame: the model, fields that all frames share.
const PROGRAM: f64 = 32.0 * MIB;

/// What small things need that are not counted one by one.
const SMALL_THINGS: f64 = 16.0 * MIB;

/// Side of the square that holds a cell with what its light spreads to, µm, at size 1.
const CELL_UM: f64 = 60.0;

/// Objects that threads which share a frame have at work at most.
const AT_WORK: f64 = 64.0;

/// How much more than counted is asked for, since no two frames are alike.
const SPARE: f64 = 1.15;

/// What the border of a slide's frame adds to its side, px.
#[cfg(feature = "zarr")]
const BORDER_PX: f64 = 256.0;

const MIB: f64 = 1_048_576.0;

/// Memory that frames of a recipe need, bytes: at least what the program was measured to use, and less than 2.5 times that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Need {
    /// Of the program without any frame.
    program: f64,
    /// Of each frame that one thread makes.
    frame: f64,
    /// Of a frame that all threads share.
    shared: f64,
}

/// How a run goes so that it fits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fit {
    /// Frames side by side, each made by a thread of its own.
    pub at_once: usize,
    /// Whether all threads share the one frame instead.
    pub shared: bool,
    /// What that needs, bytes.
    pub bytes: u64,
}

impl Need {
    /// What the largest frame of a recipe may need. The numbers of bytes are measured: see `tests/memory.rs` of papsynth-cli.
    #[must_use]
    pub fn of(recipe: &Recipe, layout: &Layout) -> Self {
        let most = |number: &Number| number.bounds()[1];
        let field = &recipe.field;
        let pixels = most(&field.width_px) * most(&field.height_px);
        let pixel_um = match field.magnification.bounds() {
            [_, most] if most <= 0.0 => field.pixel_um.bounds()[0],
            [_, most] => recipe.camera.pixel_um.bounds()[0] * recipe.camera.binning_px.bounds()[0] / most,
        };
        let is_stack = most(&recipe.focus.planes) > 1.0;
        let (samples, is_filtered, is_exact) = match &recipe.optics {
            Optics::Gaussian(_) => (1.0, false, false),
            Optics::BrightField(Microscope { oversampling, imaging, .. }) => {
                (most(oversampling), true, *imaging == Imaging::Abbe)
            }
        };
        // Channels of the picture, and lights that are imaged at one time.
        let (channels, lights) = match &recipe.light {
            LightSection::Monochrome(_) => (1.0, 1.0),
            LightSection::Colour(Colour { mixing: Mixing::PerWavelength, .. }) => (3.0, 1.0),
            LightSection::Colour(_) => (3.0, 3.0),
        };
        let grid = samples * samples;
        let mut a_pixel = 10.0 + 25.0 * channels + 4.0 * grid * lights;
        if is_stack {
            a_pixel += 11.0 * channels;
            if layout.has(Format::Webdataset) {
                // The whole stack, as it is packed into the tar file.
                a_pixel +=
                    most(&recipe.focus.planes) * channels * if most(&recipe.camera.bits) > 8.0 { 2.0 } else { 1.0 };
            }
        }
        if is_exact {
            a_pixel += 700.0 * grid;
        }
        // Samples that a cell has on the grid that light passes.
        let of_cell = |size: f64| {
            let side = CELL_UM * size / pixel_um;
            side * side * grid
        };
        let area_mm2 = recipe.largest_populated_mm2();
        let counts = recipe.cells.values().map(|mix| (mix.count.bounds(area_mm2)[1], of_cell(most(&mix.size))));
        let cells: Vec<(f64, f64)> = counts.filter(|(count, _)| *count > 0.0).collect();
        let count: f64 = cells.iter().map(|(count, _)| count).sum();
        let all: f64 = cells.iter().map(|(count, samples)| count * samples).sum();
        let largest = cells.iter().map(|(_, samples)| *samples).fold(0.0, f64::max);
        // Of a sample of a cell: its phantom; what is kept of it between the planes of a stack; the work on it, in the frame of one
        // thread, where that memory goes from object to object, and where threads share the frame.
        let (kept, work, works) = match (is_filtered, lights > 1.0) {
            (false, _) => (0.0, 8.0, 8.0),
            (true, false) => (25.0, 136.0, 62.0),
            (true, true) => (116.0, 560.0, 145.0),
        };
        let objects = SMALL_THINGS + all * (6.4 + if is_stack { kept } else { 0.0 });
        let frame = pixels * a_pixel + objects + largest * work;
        let shared = pixels * a_pixel + objects + largest * works * count.min(AT_WORK).max(work / works);
        Self { program: PROGRAM, frame: SPARE * frame, shared: SPARE * shared }
    }

    /// What a shard of a slide may need, each of whose frames is made by a thread of its own.
    #[cfg(feature = "zarr")]
    #[must_use]
    pub fn of_slide(recipe: &Recipe, shard_px: u32) -> Self {
        let most = |number: &Number| number.bounds()[1];
        // With the border that is exposed and cut off.
        let side = f64::from(recipe.scan.frame_px) + BORDER_PX;
        let grown = side * side / (recipe.field.width_px.bounds()[0] * recipe.field.height_px.bounds()[0]).max(1.0);
        let mut frame = recipe.clone();
        (frame.field.width_px, frame.field.height_px) = (side.into(), side.into());
        for mix in frame.cells.values_mut().filter(|mix| !mix.count.is_density()) {
            mix.count = (most(mix.count.number()) * grown).into();
        }
        let of_frame = Self::of(&frame, &Layout::default());
        let channels = if matches!(recipe.light, LightSection::Monochrome(_)) { 1.0 } else { 3.0 };
        // Grey levels, three labels and layers of a pixel; and once more what is being packed.
        let a_pixel = 2.0 * channels * most(&recipe.focus.planes) + 14.0;
        let shard = f64::from(shard_px) * f64::from(shard_px) * (a_pixel + 4.0 * channels);
        let program = of_frame.program + SPARE * shard;
        Self { program, frame: of_frame.frame + side * side * a_pixel, shared: f64::INFINITY }
    }

    /// How a run of that many frames side by side, or of one that threads share, goes within a budget: with fewer if need be. Nothing if not
    /// even one frame fits.
    #[must_use]
    pub fn fit(&self, at_once: usize, shared: bool, budget: Option<u64>) -> Option<Fit> {
        let budget = budget.map_or(f64::INFINITY, |bytes| bytes as f64);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a float becomes the nearest there is"
        )]
        let fit = |at_once: usize, shared: bool, bytes: f64| Fit { at_once, shared, bytes: bytes as u64 };
        if shared && self.program + self.shared <= budget {
            return Some(fit(1, true, self.program + self.shared));
        }
        let needs = |frames: usize| self.program + self.frame * frames as f64;
        let most = (1..=at_once).rev().find(|frames| needs(*frames) <= budget)?;
        Some(fit(most, false, needs(most)))
    }

    /// What one frame needs, made by one thread, with the program around it, bytes.
    #[must_use]
    pub fn of_one_frame(&self) -> f64 {
        self.program + self.frame
    }

    /// That not even one frame fits into so many bytes, in words.
    #[must_use]
    pub fn too_large(&self, recipe: &Recipe, bytes: u64) -> String {
        let field = &recipe.field;
        format!(
            "field.width_px, field.height_px: a frame of {} x {} pixels needs about {}; {} may be used",
            field.width_px.bounds()[1],
            field.height_px.bounds()[1],
            shown(self.of_one_frame()),
            shown(bytes as f64)
        )
    }
}

/// Bytes as people read them.
#[must_use]
pub fn shown(bytes: f64) -> String {
    if bytes < 1024.0 * MIB { format!("{:.0} MiB", bytes / MIB) } else { format!("{:.1} GiB", bytes / 1024.0 / MIB) }
}

/// Bytes that can still be had: what the machine has available, or less where a control group allows less. Known on Linux alone.
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

/// The folders that say what a line of `/proc/self/cgroup` allows, from the group's own up to that of all.
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

/// What a control group still allows: files that it has read and not changed can be forgotten.
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
    fn fewer_frames_side_by_side_if_they_do_not_fit_and_none_if_one_does_not() {
        let need = Need { program: 10.0, frame: 100.0, shared: 300.0 };
        let fit =
            |at_once, shared, budget| need.fit(at_once, shared, budget).map(|fit| (fit.at_once, fit.shared, fit.bytes));
        assert_eq!(fit(8, false, None), Some((8, false, 810)));
        assert_eq!(fit(8, false, Some(400)), Some((3, false, 310)));
        assert_eq!(fit(8, false, Some(110)), Some((1, false, 110)));
        assert_eq!(fit(8, false, Some(109)), None);
        assert_eq!(fit(1, true, Some(310)), Some((1, true, 310)));
        assert_eq!(fit(1, true, Some(309)), Some((1, false, 110)));
        assert_eq!(fit(1, true, Some(9)), None);
    }

    #[test]
    fn what_is_larger_needs_more() {
        let need = |change: &dyn Fn(&mut Recipe)| {
            let mut recipe = Recipe::default();
            change(&mut recipe);
            Need::of(&recipe, &Layout::default())
        };
        let usual = need(&|_| {});
        assert!(usual.shared > usual.frame);
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
    fn what_the_system_says_is_understood() {
        assert_eq!(meminfo("MemTotal: 9 kB\nMemAvailable:       12 kB\n"), Some(12 * 1024));
        let folders = folders_of_group("0::/a/b");
        assert_eq!(folders, ["/sys/fs/cgroup/a/b", "/sys/fs/cgroup/a", "/sys/fs/cgroup/"].map(PathBuf::from));
        assert_eq!(folders_of_group("4:cpu,memory:/x").len(), 2);
        assert!(folders_of_group("5:cpu:/x").is_empty() && folders_of_group("nothing").is_empty());
    }
}
