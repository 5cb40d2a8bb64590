//! A random forest that separates real from synthetic rows of features.

use rayon::prelude::*;
use smartcore::ensemble::random_forest_regressor::{RandomForestRegressor, RandomForestRegressorParameters};
use smartcore::linalg::basic::matrix::DenseMatrix;

use crate::control::Phase;
use crate::error::Error;
use crate::number::whole;

type Block = RandomForestRegressor<f32, f32, DenseMatrix<f32>, Vec<f32>>;

/// Trees that one thread grows between two checks of the stop flag.
const BLOCK: usize = 20;

/// Difference between the seeds of two blocks: the library gives consecutive seeds to the trees of a block.
const SEED_STEP: u64 = 1 << 32;

/// Minimum number of rows in a leaf.
const LEAF: usize = 3;

/// Feature values, column by column, and the side of each row.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    pub(crate) columns: Vec<Vec<f32>>,
    pub(crate) synthetic: Vec<bool>,
}

impl Rows {
    /// Returns the rows with these indices.
    pub(crate) fn only(&self, rows: &[usize]) -> Self {
        Self {
            columns: self.columns.iter().map(|c| rows.iter().map(|r| c[*r]).collect()).collect(),
            synthetic: rows.iter().map(|r| self.synthetic[*r]).collect(),
        }
    }

    /// Splits one number per row by side: real, synthetic.
    pub(crate) fn by_side(&self, numbers: impl IntoIterator<Item = f64>) -> [Vec<f64>; 2] {
        let mut sides = [Vec::new(), Vec::new()];
        numbers.into_iter().zip(&self.synthetic).for_each(|(v, synthetic)| sides[usize::from(*synthetic)].push(v));
        sides
    }

    pub(crate) fn len(&self) -> usize {
        self.synthetic.len()
    }

    fn matrix(&self) -> Option<DenseMatrix<f32>> {
        DenseMatrix::new(self.len(), self.columns.len(), self.columns.concat(), true).ok()
    }
}

/// A random forest that separates the sides.
///
/// The trees regress on 0 (real) and 1 (synthetic): the split of least variance is that of least Gini impurity, and the
/// mean of a leaf is a fraction, whereas the trees of a classifier vote.
pub(crate) struct Forest(Vec<Block>);

impl Forest {
    /// Grows a forest, the same with any number of threads; none if there are no rows or columns.
    pub(crate) fn grow(rows: &Rows, trees: usize, seed: u64, phase: &Phase) -> Result<Option<Self>, Error> {
        let Some(x) = rows.matrix() else { return Ok(None) };
        let y: Vec<f32> = rows.synthetic.iter().map(|s| f32::from(u8::from(*s))).collect();
        let blocks = (0..trees.div_ceil(BLOCK)).into_par_iter().map(|block| {
            phase.check()?;
            let parameters = RandomForestRegressorParameters::default()
                .with_n_trees(BLOCK.min(trees - block * BLOCK))
                .with_min_samples_leaf(LEAF)
                .with_m(mtry(rows.columns.len()))
                .with_seed(seed.wrapping_add(SEED_STEP.wrapping_mul(block as u64)));
            Ok(RandomForestRegressor::fit(&x, &y, parameters).ok())
        });
        let blocks: Vec<Option<Block>> = blocks.collect::<Result<_, Error>>()?;
        Ok(blocks.into_iter().collect::<Option<Vec<Block>>>().map(Self))
    }

    /// Returns the score of each row: 0 looks real, 1 looks synthetic.
    pub(crate) fn scores(&self, rows: &Rows, phase: &Phase) -> Result<Vec<f64>, Error> {
        let mut sums = vec![0.0; rows.len()];
        let Some(x) = rows.matrix() else { return Ok(sums) };
        let predict = |block: &Block| phase.check().map(|()| block.predict(&x).unwrap_or_default());
        let blocks: Vec<Vec<f32>> = self.0.par_iter().map(predict).collect::<Result<_, _>>()?;
        for block in &blocks {
            for (sum, score) in sums.iter_mut().zip(block) {
                *sum += f64::from(*score);
            }
        }
        Ok(sums.iter().map(|s| s / self.0.len() as f64).collect())
    }

    /// Returns the impurity-based importance of each column; the sum is 1.
    pub(crate) fn use_of_columns(&self) -> Vec<f64> {
        let blocks: Vec<Vec<f64>> = self.0.iter().filter_map(|b| b.compute_feature_importances().ok()).collect();
        let columns = blocks.first().map_or(0, Vec::len);
        (0..columns).map(|c| blocks.iter().map(|b| b[c]).sum::<f64>() / blocks.len() as f64).collect()
    }
}

/// Number of candidate columns of a split: twice the square root of all, because many are correlated.
fn mtry(columns: usize) -> usize {
    whole(2.0 * (columns as f64).sqrt()).clamp(1, columns.max(1))
}
