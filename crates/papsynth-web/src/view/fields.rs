//! The source of a data set: decodes frames on demand and caches a few.

use std::collections::BTreeMap;
use std::ops::Range;

use papsynth::truth::{Bounds, Group, ObjectTruth};
use papsynth_dataset::{Dataset, FrameLocation, FrameSummary};
use serde_json::Value;

use super::grid::Grid;
use super::labels::Ids;
use super::levels::Levels;
use super::objects::objects_at;
use super::source::{ImageInfo, Source, TileIndex, check_pixel, check_plane, png};
use crate::server::Reply;

/// Size of a tile, px.
const TILE: usize = 256;

/// Maximum number of cached frames.
const CACHED_FRAMES: usize = 3;

/// Maximum size of the cached planes, bytes; one plane is always cached.
const MAX_CACHED_BYTES: usize = 1 << 28;

pub(crate) struct DatasetSource {
    dataset: Dataset,
    places: Vec<FrameLocation>,
    /// The frames that were used last, the most recent first.
    cached: Vec<Frame>,
}

/// A frame with the planes and objects that were requested.
struct Frame {
    place: FrameLocation,
    summary: FrameSummary,
    grid: Grid,
    planes: BTreeMap<usize, Levels>,
    objects: Option<Vec<VisibleObject>>,
}

/// An object and the bounds of its visible mask.
struct VisibleObject {
    truth: ObjectTruth,
    bounds: Option<Bounds>,
}

impl DatasetSource {
    pub(crate) fn new(dataset: Dataset) -> Self {
        Self { dataset, places: Vec::new(), cached: Vec::new() }
    }

    /// Returns a frame and moves it to the front of the cache.
    fn frame(&mut self, image: usize) -> Result<&mut Frame, Reply> {
        if self.places.is_empty() {
            self.places = self.dataset.frame_locations()?;
        }
        let place = *self.places.get(image).ok_or_else(|| {
            Reply::error(404, &format!("no image {image}: expected 0 to {}", self.places.len().saturating_sub(1)))
        })?;
        match self.cached.iter().position(|frame| frame.place == place) {
            Some(at) => self.cached[..=at].rotate_right(1),
            None => {
                let summary = self.dataset.summary(place)?;
                let grid = Grid::new(summary.width, summary.height, TILE);
                self.cached.insert(0, Frame { place, summary, grid, planes: BTreeMap::new(), objects: None });
                self.cached.truncate(CACHED_FRAMES);
            }
        }
        Ok(&mut self.cached[0])
    }

    /// Returns a frame with a plane decoded. Planes are mostly in one file, so as many as fit in the cache are decoded.
    fn with_plane(&mut self, image: usize, plane: usize) -> Result<&Frame, Reply> {
        let has_planes = self.dataset.has_planes();
        let frame = self.frame(image)?;
        check_plane(plane, frame.planes_um(has_planes).len().max(1))?;
        if !frame.planes.contains_key(&plane) {
            let wanted = frame.neighbours(plane, frame.planes_um(has_planes).len().max(1));
            let (summary, grid, shard) = (frame.summary.clone(), frame.grid, frame.place.shard);
            let mut planes = BTreeMap::new();
            self.dataset.planes(&summary, shard, &mut |number, values| {
                if wanted.contains(&number) {
                    planes.insert(number, Levels::new(grid, summary.channels, &values, summary.white()));
                }
            })?;
            self.cached[0].planes = planes;
            self.evict();
        }
        Ok(&self.cached[0])
    }

    /// Removes planes of older frames until the rest fits in the cache.
    fn evict(&mut self) {
        let mut bytes = 0;
        for frame in &mut self.cached {
            let own = frame.plane_bytes() * frame.planes.len();
            if bytes > 0 && bytes + own > MAX_CACHED_BYTES {
                frame.planes.clear();
            } else {
                bytes += own;
            }
        }
    }

    fn with_truth(&mut self, image: usize) -> Result<(&Frame, &[VisibleObject]), Reply> {
        let frame = self.frame(image)?;
        if frame.objects.is_none() {
            let (place, size) = (frame.place, [frame.summary.width, frame.summary.height]);
            let truth = self.dataset.truth(place)?;
            if [truth.width, truth.height] != size {
                return Err(Reply::error(
                    500,
                    &format!(
                        "frame {}: the ground truth has {} x {} pixels, the record {} x {}",
                        place.index, truth.width, truth.height, size[0], size[1]
                    ),
                ));
            }
            let shown = |truth: ObjectTruth| VisibleObject { bounds: truth.visible.bounds(), truth };
            self.cached[0].objects = Some(truth.objects.into_iter().map(shown).collect());
        }
        let frame = &self.cached[0];
        Ok((frame, frame.objects.as_deref().unwrap_or_default()))
    }
}

impl Frame {
    fn planes_um(&self, has_planes: bool) -> &[f64] {
        if has_planes || self.summary.planes_um.len() == 1 { &self.summary.planes_um } else { &[] }
    }

    /// Approximate size of a decoded plane with all its levels, bytes.
    fn plane_bytes(&self) -> usize {
        self.summary.width * self.summary.height * self.summary.channels * 4 / 3
    }

    /// Returns the planes around one that fit in the cache.
    fn neighbours(&self, plane: usize, planes: usize) -> Range<usize> {
        let room = (MAX_CACHED_BYTES / self.plane_bytes().max(1)).clamp(1, planes);
        let first = plane.saturating_sub(room / 2).min(planes - room);
        first..first + room
    }
}

impl Source for DatasetSource {
    fn count(&mut self) -> Result<usize, Reply> {
        // A run may still be writing frames.
        self.places = self.dataset.frame_locations()?;
        Ok(self.places.len())
    }

    fn image(&mut self, image: usize) -> Result<ImageInfo, Reply> {
        let has_planes = self.dataset.has_planes();
        let frame = self.frame(image)?;
        let planes_um = frame.planes_um(has_planes).to_vec();
        Ok(ImageInfo::new(format!("frame {}", frame.place.index), &frame.grid, frame.summary.pixel_um, planes_um))
    }

    fn tile(&mut self, image: usize, plane: usize, at: TileIndex) -> Result<Reply, Reply> {
        let region = self.frame(image)?.grid.region(at.level, at.row, at.column)?;
        let frame = self.with_plane(image, plane)?;
        let levels = frame.planes.get(&plane).ok_or_else(|| Reply::error(500, &format!("plane {plane} is missing")))?;
        png(&levels.part(at.level, &region), region.width(), frame.summary.channels)
    }

    fn label(&mut self, image: usize, group: Group, at: TileIndex) -> Result<Reply, Reply> {
        let grid = self.frame(image)?.grid;
        let (region, size) = (grid.region(at.level, at.row, at.column)?, grid.size(at.level)?);
        let (_, objects) = self.with_truth(image)?;
        let mut ids = Ids::empty(&region, size);
        let step = 1 << at.level;
        // A pixel of a level shows the upper left pixel of the level below, like labels of slides.
        let level = |px: u32| (px as usize).div_ceil(step);
        let wider = region.wider(size);
        for VisibleObject { truth, bounds } in objects.iter().filter(|object| object.truth.group() == group) {
            let Some(bounds) = bounds else { continue };
            let is_apart = |part: &Range<usize>, start: u32, length: u32| {
                level(start + length) <= part.start || level(start) >= part.end
            };
            if is_apart(&wider.rows, bounds.y, bounds.height) || is_apart(&wider.columns, bounds.x, bounds.width) {
                continue;
            }
            for run in truth.visible.runs().iter().filter(|run| (run.y as usize).is_multiple_of(step)) {
                ids.paint(&region, run.y as usize / step, level(run.x0)..level(run.x1), truth.id);
            }
        }
        png(&ids.rgba(), region.width(), 4)
    }

    fn objects_at(&mut self, image: usize, x: usize, y: usize) -> Result<Vec<Value>, Reply> {
        let Grid { width, height, .. } = self.frame(image)?.grid;
        check_pixel(x, y, width, height)?;
        let (_, objects) = self.with_truth(image)?;
        Ok(objects_at(objects.iter().map(|shown| &shown.truth), x, y))
    }
}
