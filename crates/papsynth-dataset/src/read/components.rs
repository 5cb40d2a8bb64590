//! Connected components of label images.

use std::ops::Range;

use papsynth::truth::{LabelMap, Mask, Run};

use super::file::Limits;
use crate::error::InputError;

/// A connected region of one label (8-connectivity).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Component {
    /// The label of its pixels.
    pub label: u32,
    /// Its pixels.
    pub mask: Mask,
    /// Whether it touches the border of the image, so that part of the object may be missing.
    pub at_border: bool,
}

impl Component {
    /// Returns the region within its bounding box: the pixels in row-major order (1 inside, 0 outside), the width, and
    /// the column and row of the upper left pixel.
    #[must_use]
    pub fn tile(&self) -> (Vec<f32>, usize, [u32; 2]) {
        let Some(bounds) = self.mask.bounds() else { return (Vec::new(), 0, [0, 0]) };
        let width = bounds.width as usize;
        let mut tile = vec![0.0; width * bounds.height as usize];
        for run in self.mask.runs() {
            let row = (run.y - bounds.y) as usize * width;
            tile[row + (run.x0 - bounds.x) as usize..row + (run.x1 - bounds.x) as usize].fill(1.0);
        }
        (tile, width, [bounds.x, bounds.y])
    }
}

/// Returns the connected regions of equal labels, in the order of their first pixels. A binary mask is a label image
/// with one label.
///
/// # Errors
/// If there are more regions than the limit.
pub fn components(labels: &LabelMap, limits: &Limits) -> Result<Vec<Component>, InputError> {
    let width = labels.width;
    if width == 0 {
        return Ok(Vec::new());
    }
    let column = |x: usize| u32::try_from(x).unwrap_or(u32::MAX);
    let mut forest = Forest::default();
    let mut runs: Vec<(u32, Run)> = Vec::new();
    let mut above = 0..0;
    for (y, row) in (0_u32..).zip(labels.ids.chunks_exact(width)) {
        let first = runs.len();
        let mut x = 0;
        for same in row.chunk_by(|a, b| a == b) {
            let end = x + same.len();
            if same[0] != 0 {
                runs.push((same[0], Run { y, x0: column(x), x1: column(end) }));
                forest.add();
            }
            x = end;
        }
        join(&runs, above, first..runs.len(), &mut forest);
        above = first..runs.len();
        // Only regions that reach the current row can still be joined.
        if forest.trees > limits.max_regions.saturating_add(above.len()) {
            break;
        }
    }
    if forest.trees > limits.max_regions {
        let limit = limits.max_regions;
        return Err(InputError::unfit(format!(
            "the image has more than {limit} separate regions; expected a mask or label image, not a grey image"
        )));
    }
    Ok(collect(&runs, &mut forest, width, labels.ids.len() / width))
}

/// Joins each run of a row with the touching runs of the row above that have the same label.
fn join(runs: &[(u32, Run)], above: Range<usize>, row: Range<usize>, forest: &mut Forest) {
    let mut upper = above.start;
    for lower in row {
        let (label, run) = runs[lower];
        // Runs are sorted: a run that ends left of this one ends left of all later ones.
        while upper < above.end && runs[upper].1.x1 < run.x0 {
            upper += 1;
        }
        let touching = (upper..above.end).take_while(|&i| runs[i].1.x0 <= run.x1);
        for other in touching.filter(|&i| runs[i].0 == label) {
            forest.join(lower, other);
        }
    }
}

fn collect(runs: &[(u32, Run)], forest: &mut Forest, width: usize, height: usize) -> Vec<Component> {
    let mut place = vec![usize::MAX; runs.len()];
    let mut regions: Vec<(u32, Vec<Run>)> = Vec::new();
    for (i, &(label, run)) in runs.iter().enumerate() {
        let root = forest.root(i);
        if place[root] == usize::MAX {
            place[root] = regions.len();
            regions.push((label, Vec::new()));
        }
        regions[place[root]].1.push(run);
    }
    let touches = |r: &Run| r.x0 == 0 || r.y == 0 || r.x1 as usize == width || r.y as usize + 1 == height;
    regions
        .into_iter()
        .map(|(label, runs)| Component { label, at_border: runs.iter().any(touches), mask: Mask::from_runs(runs) })
        .collect()
}

#[derive(Debug, Default)]
struct Forest {
    parents: Vec<usize>,
    trees: usize,
}

impl Forest {
    fn add(&mut self) {
        self.parents.push(self.parents.len());
        self.trees += 1;
    }

    fn root(&mut self, mut i: usize) -> usize {
        while self.parents[i] != i {
            self.parents[i] = self.parents[self.parents[i]];
            i = self.parents[i];
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            self.parents[a.max(b)] = a.min(b);
            self.trees -= 1;
        }
    }
}
