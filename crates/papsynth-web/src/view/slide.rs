//! A whole slide, read where it is looked at.

use std::io::ErrorKind;

use papsynth::truth::Group;
use papsynth_dataset::Error;
use papsynth_dataset::slide::SlideSet;
use serde_json::{Value, json};

use super::grid::{Cut, Grid};
use super::labels::{Ids, colour_text};
use super::levels::eight_bits;
use super::source::{At, Picture, Source, check_pixel, check_plane, png};
use crate::server::Reply;

/// Side of a tile, px: that of a chunk, which is decoded whole.
const TILE: usize = 512;

pub(crate) struct Slide {
    set: SlideSet,
}

impl Slide {
    pub(crate) fn new(set: SlideSet) -> Self {
        Self { set }
    }

    /// How it is cut now: more levels are there once it is closed.
    fn grid(&self, picture: usize) -> Result<Grid, Reply> {
        if picture > 0 {
            return Err(Reply::refusal(404, &format!("there is no picture {picture}; a slide is one")));
        }
        let head = self.set.head();
        let whole = Grid::new(head.width_px as usize, head.height_px as usize, TILE);
        Ok(Grid { levels: self.set.written_levels(), ..whole })
    }
}

impl Source for Slide {
    fn count(&mut self) -> Result<usize, Reply> {
        Ok(1)
    }

    fn picture(&mut self, picture: usize) -> Result<Picture, Reply> {
        let (grid, head) = (self.grid(picture)?, self.set.head());
        Ok(Picture::new(format!("slide {}", head.slide), &grid, head.pixel_um, head.planes_um.clone()))
    }

    fn tile(&mut self, picture: usize, plane: usize, at: At) -> Result<Reply, Reply> {
        let (grid, head) = (self.grid(picture)?, self.set.head());
        check_plane(plane, head.planes_um.len())?;
        let cut = grid.cut(at.level, at.row, at.column)?;
        let values = self.set.image(at.level, plane, cut.rows.clone(), cut.columns.clone()).map_err(refused)?;
        let white = u16::MAX >> 16_u32.saturating_sub(head.bits).min(15);
        png(&eight_bits(&values, white), cut.width(), head.channels)
    }

    fn label(&mut self, picture: usize, group: Group, at: At) -> Result<Reply, Reply> {
        let grid = self.grid(picture)?;
        let (cut, size) = (grid.cut(at.level, at.row, at.column)?, grid.size(at.level)?);
        let read = |part: &Cut| {
            let ids = self.set.labels(group, at.level, part.rows.clone(), part.columns.clone());
            ids.map(|ids| Ids::new(&cut, part, &ids)).map_err(refused)
        };
        // The margin may lie in a shard that is not written yet.
        let ids = match read(&cut.wider(size)) {
            Err(Reply { status: 404, .. }) => read(&cut)?,
            read => read?,
        };
        png(&ids.rgba(), cut.width(), 4)
    }

    fn under(&mut self, picture: usize, x: usize, y: usize) -> Result<Vec<Value>, Reply> {
        let grid = self.grid(picture)?;
        check_pixel(x, y, grid.width, grid.height)?;
        let mut found = Vec::new();
        for group in [Group::Debris, Group::Nucleus, Group::Cytoplasm] {
            let ids = self.set.labels(group, 0, y..y + 1, x..x + 1).map_err(refused)?;
            let there = ids.into_iter().filter(|id| *id != 0);
            found.extend(
                there.map(|id| json!({ "id": id, "colour": colour_text(id), "group": group.name(), "front": true })),
            );
        }
        Ok(found)
    }
}

/// What is not written yet is no damage.
fn refused(error: Error) -> Reply {
    match &error {
        Error::Io { source, .. } if source.kind() == ErrorKind::NotFound => Reply::refusal(404, "not made yet"),
        _ => error.into(),
    }
}
