//! The source of a whole slide: reads tiles on demand.

use std::io::ErrorKind;

use papsynth::truth::Group;
use papsynth_dataset::Error;
use papsynth_dataset::slide::SlideSet;
use serde_json::{Value, json};

use super::grid::{Grid, Region};
use super::labels::{Ids, colour_text};
use super::levels::eight_bits;
use super::source::{ImageInfo, Source, TileIndex, check_pixel, check_plane, png};
use crate::server::Reply;

/// Size of a tile, px: that of a chunk, which can only be decoded as a whole.
const TILE: usize = 512;

pub(crate) struct SlideSource {
    set: SlideSet,
}

impl SlideSource {
    pub(crate) fn new(set: SlideSet) -> Self {
        Self { set }
    }

    /// Returns the current grid: completed slides have more levels.
    fn grid(&self, image: usize) -> Result<Grid, Reply> {
        if image > 0 {
            return Err(Reply::error(404, &format!("no image {image}: a slide is one image")));
        }
        let head = self.set.head();
        let whole = Grid::new(head.width_px as usize, head.height_px as usize, TILE);
        Ok(Grid { levels: self.set.written_levels(), ..whole })
    }
}

impl Source for SlideSource {
    fn count(&mut self) -> Result<usize, Reply> {
        Ok(1)
    }

    fn image(&mut self, image: usize) -> Result<ImageInfo, Reply> {
        let (grid, head) = (self.grid(image)?, self.set.head());
        Ok(ImageInfo::new(format!("slide {}", head.slide), &grid, head.pixel_um, head.planes_um.clone()))
    }

    fn tile(&mut self, image: usize, plane: usize, at: TileIndex) -> Result<Reply, Reply> {
        let (grid, head) = (self.grid(image)?, self.set.head());
        check_plane(plane, head.planes_um.len())?;
        let region = grid.region(at.level, at.row, at.column)?;
        let values = self.set.image(at.level, plane, region.rows.clone(), region.columns.clone()).map_err(reply_to)?;
        let white = u16::MAX >> 16_u32.saturating_sub(head.bits).min(15);
        png(&eight_bits(&values, white), region.width(), head.channels)
    }

    fn label(&mut self, image: usize, group: Group, at: TileIndex) -> Result<Reply, Reply> {
        let grid = self.grid(image)?;
        let (region, size) = (grid.region(at.level, at.row, at.column)?, grid.size(at.level)?);
        let read = |part: &Region| {
            let ids = self.set.labels(group, at.level, part.rows.clone(), part.columns.clone());
            ids.map(|ids| Ids::new(&region, part, &ids)).map_err(reply_to)
        };
        // The margin may be in a shard that is not written yet.
        let ids = match read(&region.wider(size)) {
            Err(Reply { status: 404, .. }) => read(&region)?,
            read => read?,
        };
        png(&ids.rgba(), region.width(), 4)
    }

    fn objects_at(&mut self, image: usize, x: usize, y: usize) -> Result<Vec<Value>, Reply> {
        let grid = self.grid(image)?;
        check_pixel(x, y, grid.width, grid.height)?;
        let mut found = Vec::new();
        for group in [Group::Debris, Group::Nucleus, Group::Cytoplasm] {
            let ids = self.set.labels(group, 0, y..y + 1, x..x + 1).map_err(reply_to)?;
            let there = ids.into_iter().filter(|id| *id != 0);
            found.extend(
                there.map(|id| json!({ "id": id, "colour": colour_text(id), "group": group.name(), "visible": true })),
            );
        }
        Ok(found)
    }
}

/// Missing shards are not errors: they may not be written yet.
fn reply_to(error: Error) -> Reply {
    match &error {
        Error::Io { source, .. } if source.kind() == ErrorKind::NotFound => Reply::error(404, "not written yet"),
        _ => error.into(),
    }
}
