//! The coarse mesh, on which most steps of [`Solver::Xpbd`](crate::Solver::Xpbd) are made.

use crate::batch::{Batch, Flat, Phase, Topology};
use crate::mesh::Disc;
use crate::refine::{Stencils, mean};
use crate::rest::interpolated;
use crate::{Error, Solver};

/// A mesh of half as many vertices as the fine mesh.
#[derive(Debug)]
pub(crate) struct CoarseMesh {
    pub(crate) topology: Topology,
    pub(crate) phase: Phase,
    /// Each vertex of one mesh as a weighted mean of vertices of the other.
    pub(crate) to_coarse: Stencils,
    pub(crate) to_fine: Stencils,
}

impl CoarseMesh {
    pub(crate) fn new(fine: &Disc, phase: Phase, solver: &Solver) -> Result<CoarseMesh, Error> {
        let disc = Disc::new(fine.points.len() / 2)?;
        let (to_coarse, to_fine) = (fine.interpolation(&disc)?, disc.interpolation(fine)?);
        Ok(CoarseMesh { topology: Topology::new(&disc, disc.rim, solver), phase, to_coarse, to_fine })
    }

    /// Returns the flat sheet on the coarse mesh.
    pub(crate) fn flat(&self, fine: &Flat) -> Flat {
        let rim = self.topology.rim;
        let heights: Vec<[f64; 1]> = fine.heights.iter().map(|&z| [z]).collect();
        Flat {
            rest: mean(&self.to_coarse, &fine.rest).collect(),
            heights: mean(&self.to_coarse, &heights).map(|[z]| z).collect(),
            outline: fine.outline.each_ref().map(|curve| (0..rim).map(|k| interpolated(curve, k, rim)).collect()),
        }
    }

    /// Moves a batch of fine sheets from their start to where `run` moves the coarse ones.
    pub(crate) fn advance<const L: usize>(
        &self,
        batch: &mut Batch<L>,
        flats: &[&Flat],
        substeps: usize,
        run: impl FnOnce(&mut Batch<L>),
    ) {
        let flats: Vec<Flat> = flats.iter().map(|flat| self.flat(flat)).collect();
        let mut coarse = Batch::new(&self.topology, &flats.iter().collect::<Vec<_>>());
        let start = coarse.now.clone();
        run(&mut coarse);
        // Velocities are displacements in a substep.
        let ratio = self.phase.substeps as f64 / substeps as f64;
        batch.displace(&coarse, &start, &self.to_fine, ratio);
    }
}
