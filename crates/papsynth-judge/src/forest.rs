//! The random forest.

use rayon::prelude::*;
use smartcore::ensemble::random_forest_regressor::{RandomForestRegressor, RandomForestRegressorParameters};
use smartcore::linalg::basic::matrix::DenseMatrix;

type Block = RandomForestRegressor<f32, f32, DenseMatrix<f32>, Vec<f32>>;

/// Trees that are grown by one thread.
const BLOCK: usize = 20;

/// Seeds of blocks are so far apart: the library gives its trees the seeds that follow.
const APART: u64 = 1 << 32;

/// Fewest rows in a leaf.
const LEAF: usize = 3;

/// Rows of numbers, column by column, and the side of each row.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    pub(crate) columns: Vec<Vec<f32>>,
    pub(crate) synthetic: Vec<bool>,
}

impl Rows {
    /// The rows with these indices.
    pub(crate) fn only(&self, rows: &[usize]) -> Self {
        Self {
            columns: self.columns.iter().map(|c| rows.iter().map(|r| c[*r]).collect()).collect(),
            synthetic: rows.iter().map(|r| self.synthetic[*r]).collect(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.synthetic.len()
    }

    fn matrix(&self) -> Option<DenseMatrix<f32>> {
        DenseMatrix::new(self.len(), self.columns.len(), self.columns.concat(), true).ok()
    }
}

/// Trees that tell the sides apart.
///
/// They regress on 0 and 1: the split that leaves the least variance is that of the least Gini impurity, and the mean of a
/// leaf is a share, where a classifier's trees would vote.
pub(crate) struct Forest(Vec<Block>);

impl Forest {
    /// The same forest for the same seed, whatever the threads; none if there are no rows or columns.
    pub(crate) fn grow(rows: &Rows, trees: usize, seed: u64) -> Option<Self> {
        let x = rows.matrix()?;
        let y: Vec<f32> = rows.synthetic.iter().map(|s| f32::from(u8::from(*s))).collect();
        let blocks = (0..trees.div_ceil(BLOCK)).into_par_iter().map(|block| {
            let parameters = RandomForestRegressorParameters::default()
                .with_n_trees(BLOCK.min(trees - block * BLOCK))
                .with_min_samples_leaf(LEAF)
                .with_m(mtry(rows.columns.len()))
                .with_seed(seed.wrapping_add(APART.wrapping_mul(block as u64)));
            RandomForestRegressor::fit(&x, &y, parameters).ok()
        });
        blocks.collect::<Option<Vec<_>>>().map(Self)
    }

    /// How synthetic each row looks, 0 to 1.
    pub(crate) fn scores(&self, rows: &Rows) -> Vec<f64> {
        let mut sums = vec![0.0; rows.len()];
        let Some(x) = rows.matrix() else { return sums };
        let blocks: Vec<Vec<f32>> = self.0.par_iter().map(|block| block.predict(&x).unwrap_or_default()).collect();
        for block in &blocks {
            for (sum, score) in sums.iter_mut().zip(block) {
                *sum += f64::from(*score);
            }
        }
        sums.iter().map(|s| s / self.0.len() as f64).collect()
    }

    /// How much each column served to tell the sides apart in growing, summing to 1.
    pub(crate) fn use_of_columns(&self) -> Vec<f64> {
        let blocks: Vec<Vec<f64>> = self.0.iter().filter_map(|b| b.compute_feature_importances().ok()).collect();
        let columns = blocks.first().map_or(0, Vec::len);
        (0..columns).map(|c| blocks.iter().map(|b| b[c]).sum::<f64>() / blocks.len() as f64).collect()
    }
}

/// Columns that a split chooses from: twice the square root of them all, as many are alike.
fn mtry(columns: usize) -> usize {
    crate::number::whole(2.0 * (columns as f64).sqrt()).clamp(1, columns.max(1))
}
