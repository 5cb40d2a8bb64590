//! A data set: its frames decoded, a few at a time.

use std::collections::BTreeMap;
use std::ops::Range;

use papsynth::truth::{Bounds, Group, Mask, ObjectTruth};
use papsynth_dataset::{Dataset, FrameLocation, FrameSummary};
use serde_json::{Value, json};

use super::grid::Grid;
use super::labels::{Ids, colour_text};
use super::levels::Levels;
use super::source::{At, Picture, Source, check_pixel, check_plane, png};
use crate::server::Reply;

/// Side of a tile, px.
const TILE: usize = 256;

/// Frames that are kept decoded at most.
const KEPT: usize = 3;

/// Bytes of decoded planes that are kept at most, but for one plane, however large it is.
const MOST_BYTES: usize = 1 << 28;

pub(crate) struct Fields {
    dataset: Dataset,
    places: Vec<FrameLocation>,
    /// The frames that were asked for last, the last of all first.
    kept: Vec<Frame>,
}

/// A frame, as far as it was needed.
struct Frame {
    place: FrameLocation,
    summary: FrameSummary,
    grid: Grid,
    planes: BTreeMap<usize, Levels>,
    objects: Option<Vec<Shown>>,
}

/// An object, and where its visible part lies.
struct Shown {
    truth: ObjectTruth,
    front: Option<Bounds>,
}

impl Fields {
    pub(crate) fn new(dataset: Dataset) -> Self {
        Self { dataset, places: Vec::new(), kept: Vec::new() }
    }

    /// The frame, first among those kept.
    fn frame(&mut self, picture: usize) -> Result<&mut Frame, Reply> {
        if self.places.is_empty() {
            self.places = self.dataset.frame_locations()?;
        }
        let place = *self.places.get(picture).ok_or_else(|| {
            Reply::refusal(404, &format!("there is no picture {picture}; there are {}", self.places.len()))
        })?;
        match self.kept.iter().position(|frame| frame.place == place) {
            Some(at) => self.kept[..=at].rotate_right(1),
            None => {
                let summary = self.dataset.summary(place)?;
                let grid = Grid::new(summary.width, summary.height, TILE);
                self.kept.insert(0, Frame { place, summary, grid, planes: BTreeMap::new(), objects: None });
                self.kept.truncate(KEPT);
            }
        }
        Ok(&mut self.kept[0])
    }

    /// The frame with a plane decoded. Planes lie in one file mostly, so that others are decoded with it, as many as may be kept.
    fn with_plane(&mut self, picture: usize, plane: usize) -> Result<&Frame, Reply> {
        let has_planes = self.dataset.has_planes();
        let frame = self.frame(picture)?;
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
            self.kept[0].planes = planes;
            self.forget();
        }
        Ok(&self.kept[0])
    }

    /// Lets planes of other frames go until what is left may be kept.
    fn forget(&mut self) {
        let mut bytes = 0;
        for frame in &mut self.kept {
            let own = frame.plane_bytes() * frame.planes.len();
            if bytes > 0 && bytes + own > MOST_BYTES {
                frame.planes.clear();
            } else {
                bytes += own;
            }
        }
    }

    fn with_truth(&mut self, picture: usize) -> Result<(&Frame, &[Shown]), Reply> {
        let frame = self.frame(picture)?;
        if frame.objects.is_none() {
            let (place, size) = (frame.place, [frame.summary.width, frame.summary.height]);
            let truth = self.dataset.truth(place)?;
            if [truth.width, truth.height] != size {
                return Err(Reply::refusal(
                    500,
                    &format!(
                        "frame {}: the truth is of {} x {} pixels, the record of {} x {}",
                        place.index, truth.width, truth.height, size[0], size[1]
                    ),
                ));
            }
            let shown = |truth: ObjectTruth| Shown { front: truth.front.bounds(), truth };
            self.kept[0].objects = Some(truth.objects.into_iter().map(shown).collect());
        }
        let frame = &self.kept[0];
        Ok((frame, frame.objects.as_deref().unwrap_or_default()))
    }
}

impl Frame {
    fn planes_um(&self, has_planes: bool) -> &[f64] {
        if has_planes || self.summary.planes_um.len() == 1 { &self.summary.planes_um } else { &[] }
    }

    /// Bytes of a decoded plane with all its levels, not quite.
    fn plane_bytes(&self) -> usize {
        self.summary.width * self.summary.height * self.summary.channels * 4 / 3
    }

    /// As many planes about one as may be kept.
    fn neighbours(&self, plane: usize, planes: usize) -> Range<usize> {
        let room = (MOST_BYTES / self.plane_bytes().max(1)).clamp(1, planes);
        let first = plane.saturating_sub(room / 2).min(planes - room);
        first..first + room
    }
}

impl Source for Fields {
    fn count(&mut self) -> Result<usize, Reply> {
        // It may be growing.
        self.places = self.dataset.frame_locations()?;
        Ok(self.places.len())
    }

    fn picture(&mut self, picture: usize) -> Result<Picture, Reply> {
        let has_planes = self.dataset.has_planes();
        let frame = self.frame(picture)?;
        let planes_um = frame.planes_um(has_planes).to_vec();
        Ok(Picture::new(format!("frame {}", frame.place.index), &frame.grid, frame.summary.pixel_um, planes_um))
    }

    fn tile(&mut self, picture: usize, plane: usize, at: At) -> Result<Reply, Reply> {
        let cut = self.frame(picture)?.grid.cut(at.level, at.row, at.column)?;
        let frame = self.with_plane(picture, plane)?;
        let levels =
            frame.planes.get(&plane).ok_or_else(|| Reply::refusal(500, &format!("plane {plane} is missing")))?;
        png(&levels.part(at.level, &cut), cut.width(), frame.summary.channels)
    }

    fn label(&mut self, picture: usize, group: Group, at: At) -> Result<Reply, Reply> {
        let grid = self.frame(picture)?.grid;
        let (cut, size) = (grid.cut(at.level, at.row, at.column)?, grid.size(at.level)?);
        let (_, objects) = self.with_truth(picture)?;
        let mut ids = Ids::empty(&cut, size);
        let step = 1 << at.level;
        // A pixel of a level shows the upper left of those below it, as labels of slides do.
        let level = |px: u32| (px as usize).div_ceil(step);
        let wider = cut.wider(size);
        for Shown { truth, front } in objects.iter().filter(|object| object.truth.group() == group) {
            let Some(bounds) = front else { continue };
            let is_apart = |part: &Range<usize>, start: u32, length: u32| {
                level(start + length) <= part.start || level(start) >= part.end
            };
            if is_apart(&wider.rows, bounds.y, bounds.height) || is_apart(&wider.columns, bounds.x, bounds.width) {
                continue;
            }
            for run in truth.front.runs().iter().filter(|run| (run.y as usize).is_multiple_of(step)) {
                ids.paint(&cut, run.y as usize / step, level(run.x0)..level(run.x1), truth.id);
            }
        }
        png(&ids.rgba(), cut.width(), 4)
    }

    fn under(&mut self, picture: usize, x: usize, y: usize) -> Result<Vec<Value>, Reply> {
        let Grid { width, height, .. } = self.frame(picture)?.grid;
        check_pixel(x, y, width, height)?;
        let (_, objects) = self.with_truth(picture)?;
        let holds = |mask: &Mask| {
            mask.runs().iter().any(|run| run.y as usize == y && (run.x0 as usize..run.x1 as usize).contains(&x))
        };
        let mut found: Vec<&ObjectTruth> =
            objects.iter().map(|shown| &shown.truth).filter(|truth| holds(&truth.amodal)).collect();
        found.sort_by(|a, b| b.depth_um.total_cmp(&a.depth_um).then(b.part.cmp(&a.part)));
        Ok(found.into_iter().map(|truth| told(truth, holds(&truth.front))).collect())
    }
}

/// What the page says of an object.
fn told(truth: &ObjectTruth, is_front: bool) -> Value {
    json!({
        "id": truth.id,
        "colour": colour_text(truth.id),
        "group": truth.group().name(),
        "part": truth.part,
        "kind": truth.kind.name(),
        "class": truth.class,
        "bethesda": truth.bethesda,
        "traits": truth.traits,
        "cluster": truth.cluster,
        "front": is_front,
        "centre_um": truth.centre_um,
        "depth_um": truth.depth_um,
        "area_um2": truth.area_um2,
        "stain": truth.stain,
        "tint": truth.tint_name(),
        "rotation_deg": truth.rotation_deg,
        "truncated": truth.truncated,
        "defocus_um": truth.defocus_um,
        "detectability": truth.detectability,
    })
}
